//! Bits agree with a plain loop over the samples, before and after edits, and loose islands are found.

use std::collections::BTreeSet;

use crate::common::*;
use bevy_app::App;
use bevy_ecs::prelude::*;
use bevy_ecs::system::RunSystemOnce as _;
use bevy_marchless::bits::prelude::*;
use bevy_marchless::prelude::*;
use bevy_marchless::source::prelude::*;
use bevy_math::{DVec3, IVec3, UVec3, Vec3};
use bevy_tasks::block_on;
use marchless::Shape;

/// Runs `question` in a system and returns its result.
fn ask<T: Send + 'static>(app: &mut App, question: impl Fn(&TerrainBits) -> T + Send + Sync + 'static) -> T {
    app.world_mut().run_system_once(move |bits: TerrainBits| question(&bits)).unwrap()
}

fn stamp(app: &mut App, stamp: Stamp) {
    app.world_mut().write_message(stamp);
    app.update();
}

/// The solid points, sample by sample, inside the outermost planes.
struct Oracle(BTreeSet<[i32; 3]>);

impl Oracle {
    fn new(app: &App, terrain: Entity) -> Self {
        let volume = volume(app, terrain);
        let isovalue = volume.settings().unwrap().isovalue;
        let size = volume.settings().unwrap().size_in_voxels().as_ivec3().to_array();
        let inside = |point: &[i32; 3]| f32::from(volume.grid().get(*point).weight) / 256.0 < isovalue;
        Self(Region::new([1; 3], size).points().filter(inside).collect())
    }

    fn solid(&self, point: [i32; 3]) -> bool {
        self.0.contains(&point)
    }

    /// The points that a path along the axes reaches.
    fn island(&self, first: [i32; 3], region: Region) -> BTreeSet<[i32; 3]> {
        let mut found = BTreeSet::new();
        let mut next = vec![first];
        while let Some(point) = next.pop() {
            if region.contains(point) && self.solid(point) && found.insert(point) {
                for axis in 0..3 {
                    for step in [-1, 1] {
                        let mut neighbour = point;
                        neighbour[axis] += step;
                        next.push(neighbour);
                    }
                }
            }
        }
        found
    }
}

/// Boxes within a chunk, across chunks, across the border, outside, empty and absurd, on a terrain of 32³ points.
const BOXES: [Region; 10] = [
    Region::new([1, 1, 1], [15, 15, 15]),
    Region::new([3, 14, 5], [29, 19, 18]),
    Region::new([15, 15, 15], [17, 17, 17]),
    Region::new([0, 0, 0], [32, 32, 32]),
    Region::new([-3, 10, -3], [4, 18, 40]),
    Region::new([1, 2, 1], [32, 9, 32]),
    Region::new([0, 2, 0], [33, 9, 33]),
    Region::new([40, 0, 0], [50, 50, 50]),
    Region::new([8, 8, 8], [8, 20, 20]),
    Region::new([5, 18, 5], [6, 19, 29]),
];

fn assert_answers(app: &mut App, terrain: Entity) {
    let oracle = Oracle::new(app, terrain);
    for region in BOXES {
        let points = || region.points();
        assert_eq!(
            ask(app, move |bits| bits.is_solid(terrain, region)),
            Ok(points().all(|point| oracle.solid(point))),
            "{region:?}"
        );
        assert_eq!(
            ask(app, move |bits| bits.overlaps_region(terrain, region)),
            Ok(points().any(|point| oracle.solid(point))),
            "{region:?}"
        );
        let bits = ask(app, move |bits| bits.bits(terrain, region));
        if region.is_empty() {
            assert_eq!(bits, Err(TerrainBitsError::Empty { region }));
            continue;
        }
        let bits = bits.expect("a small box");
        assert_eq!(bits.shape().size(), region.size());
        for point in points() {
            let place = [0, 1, 2].map(|axis| (point[axis] - region.min[axis]) as u32);
            assert_eq!(bits.get(place), oracle.solid(point), "{point:?} in {region:?}");
        }
    }
    for (center, radius) in [
        ([8.25, 19.5, 8.0], 2.75),
        ([16.0, 18.0, 16.0], 1.0),
        ([15.5, 20.5, 15.5], 4.0),
        ([16.0, 16.5, 16.0], 0.5),
        ([16.25, 16.25, 16.25], 0.25),
        ([-4.0, 8.0, 8.0], 5.0),
        ([-4.0, 8.0, 8.0], 4.5),
        ([16.0, 40.0, 16.0], 24.0),
        ([16.0, 40.0, 16.0], 23.0),
        ([16.0, 16.0, 16.0], 1.0e9),
        ([1.0e30, 16.0, 16.0], 3.0),
    ] {
        let distance =
            |point: [i32; 3]| Vec3::from(point.map(|v| v as f32)).as_dvec3().distance(Vec3::from(center).as_dvec3());
        let expected = oracle.0.iter().any(|point| distance(*point) <= f64::from(radius));
        let found = ask(app, move |bits| bits.overlaps_ball(terrain, Vec3::from(center), radius));
        assert_eq!(found, Ok(expected), "{center:?}, {radius}");
    }
    // A diagonal bar, longer than a chunk.
    let bar = BitGrid::from_fn(Shape::new([20, 3, 20]).unwrap(), |[x, y, z]| x == z && y == 1).unwrap();
    for offset in [
        [0, 0, 0],
        [5, 14, 7],
        [5, 15, 7],
        [5, 16, 7],
        [13, 20, 2],
        [-19, 2, 3],
        [-18, 2, 3],
        [31, 2, 2],
        [i32::MIN; 3],
        [i32::MAX; 3],
    ] {
        let at = |p: [u32; 3]| [0, 1, 2].map(|axis| offset[axis].saturating_add_unsigned(p[axis]));
        let expected = bar.iter().any(|point| oracle.solid(at(point)));
        let shape = bar.clone();
        let found = ask(app, move |bits| bits.collides(terrain, &shape, offset.into()));
        assert_eq!(found, Ok(expected), "{offset:?}");
    }
}

#[test]
fn answers_are_those_of_the_samples_before_and_after_edits() {
    let mut app = app();
    let terrain = settled(&mut app, ground());
    assert_answers(&mut app, terrain);
    let edges = Vec3::new(15.5, 17.0, 15.5);
    stamp(&mut app, Stamp::dig(terrain, BrushShape::sphere(edges, 4.3)));
    assert_answers(&mut app, terrain);
    stamp(&mut app, Stamp::add(terrain, BrushShape::cuboid(Vec3::new(8.0, 20.0, 9.0), Vec3::splat(2.5)), 1));
    assert_answers(&mut app, terrain);
    stamp(&mut app, Stamp::dig(terrain, BrushShape::cuboid(Vec3::splat(16.0), Vec3::splat(30.0))));
    assert_answers(&mut app, terrain);
    assert_eq!(ask(&mut app, move |bits| bits.overlaps_region(terrain, BOXES[3])), Ok(false), "all is dug");
}

#[test]
fn answers_are_those_of_the_samples_at_other_isovalues_and_in_uniform_chunks() {
    let mut app = app();
    let source = |[x, y, z]: [f64; 3]| y - 16.5 + 3.0 * (x * 0.5).sin() * (z * 0.3).cos();
    let terrain = settled(&mut app, small(Terrain::new(source)));
    for isovalue in [0.0, 1.75, -2.0] {
        app.world_mut().get_mut::<Terrain>(terrain).unwrap().isovalue = isovalue;
        settle(&mut app, terrain);
        assert_answers(&mut app, terrain);
    }
    // Ground and air without a surface, except for the walls: most chunks are uniform.
    let deep = Sdf::cuboid(DVec3::new(40.0, -51.5, 40.0), DVec3::splat(100.0));
    let terrain = settled(&mut app, Terrain::new(deep).with_extent(UVec3::new(5, 6, 5)).with_chunk_cells(16));
    let grid = volume(&app, terrain).grid();
    for (chunk, solid) in [([2, 1, 2], true), ([2, 5, 2], false)] {
        let Some(marchless::GridChunk::Uniform(voxel)) = grid.chunk(chunk) else { panic!("{chunk:?} is not uniform") };
        assert_eq!(voxel.weight < 0, solid);
    }
    assert_answers(&mut app, terrain);
    for (region, solid, touched) in [
        (Region::new([16, 16, 16], [48, 32, 48]), true, true),
        (Region::new([16, 16, 16], [48, 49, 48]), true, true),
        (Region::new([16, 16, 16], [48, 50, 48]), false, true),
        (Region::new([16, 49, 16], [48, 80, 48]), false, false),
    ] {
        assert_eq!(ask(&mut app, move |bits| bits.is_solid(terrain, region)), Ok(solid), "{region:?}");
        assert_eq!(ask(&mut app, move |bits| bits.overlaps_region(terrain, region)), Ok(touched), "{region:?}");
        let count = ask(&mut app, move |bits| bits.bits(terrain, region)).unwrap().count() as u64;
        let [nx, ny, nz] = region.size().map(u64::from);
        assert!(count <= nx * ny * nz && (count == nx * ny * nz) == solid && (count > 0) == touched);
    }
}

#[test]
fn questions_without_an_answer_say_why() {
    let mut app = app();
    let nothing = app.world_mut().spawn_empty().id();
    let region = Region::new([0; 3], [8; 3]);
    let error = TerrainBitsError::NoTerrain { entity: nothing };
    assert_eq!(ask(&mut app, move |bits| bits.is_solid(nothing, region)), Err(error));

    let gate = Gate::default();
    let source = {
        let gate = gate.clone();
        move |[_, y, _]: [f64; 3]| {
            gate.pass();
            y - 8.0
        }
    };
    let terrain = app.world_mut().spawn(small(Terrain::new(source))).id();
    let error = TerrainBitsError::NoTerrain { entity: terrain };
    assert_eq!(ask(&mut app, move |bits| bits.is_solid(terrain, region)), Err(error), "no update yet");
    app.update();
    let error = TerrainBitsError::NotFilled { chunk: IVec3::ZERO };
    assert_eq!(ask(&mut app, move |bits| bits.overlaps_region(terrain, region)), Err(error));
    let outside = Region::new([100; 3], [108; 3]);
    assert_eq!(ask(&mut app, move |bits| bits.overlaps_region(terrain, outside)), Ok(false), "needs no chunk");
    gate.open();
    settle(&mut app, terrain);

    for region in [Region::new([i32::MIN; 3], [i32::MAX; 3]), Region::new([0; 3], [1, 1 << 12, 1 << 11])] {
        let bits = ask(&mut app, move |bits| bits.bits(terrain, region));
        assert_eq!(bits, Err(TerrainBitsError::TooLarge { region }));
        // All points outside the terrain are air.
        let islands = ask(&mut app, move |bits| bits.islands(terrain, region)).expect("the terrain is small");
        assert!(islands.len() <= 1 && islands.iter().all(Island::touches_boundary));
        assert!(ask(&mut app, move |bits| bits.is_solid(terrain, region)) == Ok(false));
    }
    for region in [Region::new([9; 3], [3; 3]), Region::new([i32::MAX; 3], [i32::MIN; 3])] {
        assert_eq!(ask(&mut app, move |bits| bits.bits(terrain, region)), Err(TerrainBitsError::Empty { region }));
        assert_eq!(ask(&mut app, move |bits| bits.islands(terrain, region)), Ok(vec![]));
        let ends = [IVec3::splat(3), IVec3::splat(4)];
        for phase in [Phase::Solid, Phase::Air] {
            let connected = ask(&mut app, move |bits| bits.connected(terrain, ends[0], ends[1], region, phase));
            assert_eq!(connected, Ok(false));
        }
    }
    for (center, radius) in
        [(Vec3::NAN, 5.0), (Vec3::splat(8.0), f32::NAN), (Vec3::splat(8.0), -1.0), (Vec3::ZERO, f32::INFINITY)]
    {
        assert_eq!(ask(&mut app, move |bits| bits.overlaps_ball(terrain, center, radius)), Ok(false));
    }
}

#[test]
fn what_is_connected_depends_on_the_box_and_on_edits() {
    use Phase::{Air, Solid};
    let mut app = app();
    let terrain = settled(&mut app, ground());
    let whole = Region::new([-1; 3], [34; 3]);
    let [left, right] = [IVec3::new(4, 8, 16), IVec3::new(28, 8, 16)];
    let connected = |app: &mut App, a: IVec3, b: IVec3, region: Region, phase: Phase| {
        ask(app, move |bits| bits.connected(terrain, a, b, region, phase)).expect("a small box")
    };
    assert!(connected(&mut app, left, right, whole, Solid));
    assert!(!connected(&mut app, left, right, whole, Air), "they are not in the air");
    assert!(!connected(&mut app, left, IVec3::new(28, 20, 16), whole, Solid), "above the ground");
    // A trench from wall to wall, down to the bottom except for a layer of two voxels.
    let trench = BrushShape::cuboid(Vec3::new(16.0, 18.0, 16.0), Vec3::new(2.0, 15.5, 30.0));
    stamp(&mut app, Stamp::dig(terrain, trench));
    assert!(connected(&mut app, left, right, whole, Solid), "along the bottom");
    let above = Region::new([1, 3, 1], [32; 3]);
    assert!(!connected(&mut app, left, right, above, Solid), "not within the box");
    // A cave, and then a tunnel to it.
    let (cave, sky) = (IVec3::new(6, 8, 8), IVec3::new(6, 25, 8));
    stamp(&mut app, Stamp::dig(terrain, BrushShape::sphere(cave.as_vec3(), 3.0)));
    assert!(!connected(&mut app, cave, sky, whole, Air));
    stamp(&mut app, Stamp::dig(terrain, BrushShape::capsule(cave.as_vec3(), sky.as_vec3(), 1.5)));
    assert!(connected(&mut app, cave, sky, whole, Air));
    assert!(connected(&mut app, sky, IVec3::new(6, -1, 8), whole, Air), "round the outside");
}

/// A pillar with a head on flat ground, in 3 × 3 × 3 chunks.
fn pillar() -> Terrain {
    let ball = |[x, y, z]: [f64; 3], middle: f64, radius: f64| {
        ((x - 24.0).powi(2) + (y - middle).powi(2) + (z - 24.0).powi(2)).sqrt() - radius
    };
    let source = move |[x, y, z]: [f64; 3]| {
        let pillar = ((x - 24.0).hypot(z - 24.0) - 3.0).max(y - 34.0);
        (y - 8.5).min(pillar).min(ball([x, y, z], 34.0, 7.0))
    };
    Terrain::new(source).with_extent(UVec3::splat(3)).with_chunk_cells(16)
}

#[derive(Resource, Default)]
struct Edits(Vec<TerrainEdited>);

fn app_with_edits() -> App {
    let mut app = app();
    app.init_resource::<Edits>();
    app.add_systems(bevy_app::Last, |mut messages: MessageReader<TerrainEdited>, mut edits: ResMut<Edits>| {
        edits.0.extend(messages.read().cloned());
    });
    app
}

/// Applies a stamp and returns the loose islands around its changes.
fn loosened_by(app: &mut App, by: Stamp) -> Vec<Island> {
    stamp(app, by);
    app.update();
    let edits = core::mem::take(&mut app.world_mut().resource_mut::<Edits>().0);
    let [edited] = &edits[..] else { panic!("one edit: {edits:?}") };
    let edited = edited.clone();
    ask(app, move |bits| bits.loose_islands(&edited, 30)).expect("a small box")
}

#[test]
fn a_head_hangs_free_once_its_pillar_is_cut_and_can_be_dug_out() {
    let mut app = app_with_edits();
    let terrain = settled(&mut app, pillar());
    let side = Stamp::dig(terrain, BrushShape::sphere(Vec3::new(20.5, 18.0, 24.0), 3.0));
    assert_eq!(loosened_by(&mut app, side), [], "something of the pillar is left");
    let cut = Stamp::dig(terrain, BrushShape::sphere(Vec3::new(24.0, 18.0, 24.0), 5.0));
    let loose = loosened_by(&mut app, cut);
    let [head] = &loose[..] else { panic!("one island: {loose:?}") };

    let oracle = Oracle::new(&app, terrain);
    let whole = Region::new([0; 3], [48; 3]);
    let expected = oracle.island([24, 34, 24], whole);
    assert!(head.size() > 1_300 && head.size() == expected.len(), "{head:?}");
    let min = head.bounds().min;
    let at = |p: [u32; 3]| [0, 1, 2].map(|axis| min[axis] + p[axis] as i32);
    assert_eq!(head.bits().iter().map(at).collect::<BTreeSet<_>>(), expected);

    let islands = ask(&mut app, move |bits| bits.islands(terrain, whole)).unwrap();
    let [ground, same] = &islands[..] else { panic!("the ground and the head: {islands:?}") };
    assert!(ground.touches_boundary() && same == head && ground.size() + head.size() == oracle.0.len());
    // A box that is too small cuts through it, so its support is unknown.
    let [min, max] = [head.bounds().min, head.bounds().max];
    let small = Region::new([min[0] - 1, min[1] + 2, min[2] - 1], max.map(|v| v + 1));
    let islands = ask(&mut app, move |bits| bits.islands(terrain, small)).unwrap();
    assert!(islands.iter().all(Island::touches_boundary), "{islands:?}");

    let island = head.clone();
    let samples = ask(&mut app, move |bits| bits.samples(terrain, &island)).expect("a terrain");
    let (lowest, shape) = (min.map(|v| v - 2), samples.shape().as_ivec3().to_array());
    assert_eq!(shape, [0, 1, 2].map(|axis| head.bounds().max[axis] + 2 - lowest[axis]));
    for (index, point) in Region::new(lowest, [0, 1, 2].map(|axis| lowest[axis] + shape[axis])).points().enumerate() {
        assert_eq!(samples.weights()[index] < 0, expected.contains(&point), "{point:?}");
    }
    let body = app.world_mut().spawn(samples).id();

    for stamp in head.stamps(terrain) {
        app.world_mut().write_message(stamp);
    }
    app.update();
    let left = Oracle::new(&app, terrain).0;
    assert_eq!(left, oracle.0.difference(&expected).copied().collect());
    assert_drawn(&mut app, terrain);
    // The body shows in the update in which the terrain loses it.
    let mesh = &app.world().get::<ChunkGeometry>(body).unwrap().mesh;
    let report = marchless::MeshReport::new(&mesh.positions, &mesh.indices);
    assert!(report.triangles > 500 && report.components == 1 && report.is_closed() && report.is_clean(), "{report}");
}

#[test]
fn pieces_that_interlock_are_dug_out_one_by_one() {
    for isovalue in [0.0, -2.5, -0.3, 1.5] {
        let mut app = app();
        // Two rings, each through the other, above the ground.
        let ring = move |[x, y, z]: [f64; 3], flat: bool| {
            let (x, y, z) = if flat { (x - 12.0, z - 16.0, y - 20.0) } else { (x - 19.0, y - 20.0, z - 16.0) };
            ((x.hypot(y) - 7.0).powi(2) + z * z).sqrt() - 1.6 + isovalue
        };
        let source = move |p: [f64; 3]| (p[1] - 6.5).min(ring(p, false)).min(ring(p, true));
        let terrain = settled(&mut app, small(Terrain::new(source)).with_isovalue(isovalue as f32));
        let whole = Region::new([0; 3], [33; 3]);
        let islands = ask(&mut app, move |bits| bits.islands(terrain, whole)).unwrap();
        let loose: Vec<_> = islands.iter().filter(|island| !island.touches_boundary()).collect();
        assert_eq!((islands.len(), loose.len()), (3, 2), "{islands:?}");
        let before = Oracle::new(&app, terrain);
        let ring = before.island(loose[0].first().to_array(), whole);
        for stamp in loose[0].stamps(terrain) {
            app.world_mut().write_message(stamp);
        }
        app.update();
        let left = Oracle::new(&app, terrain).0;
        assert_eq!(left, before.0.difference(&ring).copied().collect(), "isovalue {isovalue}");
    }
}

#[test]
fn a_task_answers_as_asking_at_once_does_about_the_terrain_as_it_was() {
    let mut app = app();
    let terrain = settled(&mut app, pillar());
    stamp(&mut app, Stamp::dig(terrain, BrushShape::sphere(Vec3::new(24.0, 18.0, 24.0), 5.0)));
    let whole = Region::new([-2; 3], [50; 3]);
    let (foot, head) = (IVec3::new(24, 4, 24), IVec3::new(24, 34, 24));
    let now = ask(&mut app, move |bits| {
        let connected = bits.connected(terrain, foot, head, whole, Phase::Solid);
        (bits.islands(terrain, whole).unwrap(), bits.bits(terrain, whole).unwrap(), connected.unwrap())
    });
    assert_eq!((now.0.len(), now.2), (2, false));
    let tasks = ask(&mut app, move |bits| {
        let snapshot = bits.snapshot(terrain, whole).unwrap();
        let connected = move |snapshot: &BitsSnapshot| snapshot.connected(foot, head, Phase::Solid);
        (
            snapshot.clone().in_task(BitsSnapshot::islands),
            snapshot.clone().in_task(BitsSnapshot::bits),
            snapshot.in_task(connected),
        )
    });
    let earlier = ask(&mut app, move |bits| bits.snapshot(terrain, whole).unwrap());
    stamp(&mut app, Stamp::add(terrain, BrushShape::sphere(Vec3::new(24.0, 18.0, 24.0), 6.0), 0));
    assert_eq!(block_on(tasks.0).unwrap(), now.0);
    assert_eq!(block_on(tasks.1).unwrap(), now.1);
    assert_eq!(block_on(tasks.2).unwrap(), now.2);
    assert_eq!(earlier.islands().unwrap(), now.0, "asked after the edit");
    let after = ask(&mut app, move |bits| bits.connected(terrain, foot, head, whole, Phase::Solid));
    assert_eq!(after, Ok(true));
}
