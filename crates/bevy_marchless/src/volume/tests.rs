//! Random events, until nothing waits: no app, no window, no entity but a number.

mod events;
mod levels;
mod systems;

use std::collections::HashMap;

use bevy_ecs::entity::Entity;
use marchless::{
    Bound, DualSettings, Grid, LeafKey, MeshBuffer, MeshSettings, MeshUnion, Operation, QuantisedShape, QuantisedStamp,
    Region, SamplePool, SourceRegion,
};
use proptest::prelude::*;

use super::*;
use crate::cover::{LoadRegion, View};
use crate::jobs::WorkQueue;
use crate::stats::TerrainStats;
use events::{Event, event, event_of_surface};

const CELLS: u32 = 8;
/// Of every extent.
const WHOLE: Region = Region { min: [-4, -3, -4], max: [5, 3, 4] };
/// The extents that a terrain may be given.
const EXTENTS: [Region; 5] = [
    WHOLE,
    Region { min: [-3, -3, -4], max: [5, 3, 4] },
    Region { min: [-3, -2, -3], max: [3, 2, 3] },
    Region { min: [-1, -1, 0], max: [0, 1, 4] },
    Region { min: [-3, -2, -3], max: [3, 6, 3] },
];

/// A terrain with all that is around it in a game.
struct Game {
    heart: Heart,
    queue: WorkQueue,
    stats: TerrainStats,
    /// What is on the screen.
    screen: HashMap<Entity, (ChunkKey, Arc<MeshBuffer>)>,
    despawned: Vec<ChunkKey>,
    views: HashMap<u32, ([f64; 3], f64, f64, Option<f64>)>,
    next_entity: u32,
    /// The stamps since the source began, and those that wait.
    stamps: Vec<QuantisedStamp>,
    waiting: Vec<QuantisedStamp>,
    settings: SamplingSettings,
    levels: Option<LevelDetail>,
    normals: bool,
    isovalue: f32,
    /// The steps of smoothing of the dual mesher; `None` with the primal one.
    smoothing: Option<u32>,
    /// Whether all that is drawn is one surface, which holds in every update from then on.
    is_surface: bool,
}

/// Rolling ground around a height.
struct Hills(f64);

impl Source for Hills {
    fn fill(&self, region: &SourceRegion, distances: &mut [f32], materials: &mut [u8]) {
        let shift = self.0;
        let hills = move |[x, y, z]: [f64; 3]| y - shift - 3.0 * (x * 0.2).sin() * (z * 0.15).cos();
        Source::fill(&hills, region, distances, materials);
    }

    fn bound(&self, region: &SourceRegion) -> Bound {
        let [low, high] = [[0; 3], region.size.map(|v| v - 1)].map(|end| region.position(end)[1] - self.0);
        match (low > 3.0, high < -3.0) {
            (true, _) => Bound::Outside,
            (_, true) => Bound::Inside { material: 0 },
            _ => Bound::Mixed,
        }
    }
}

fn sampling_settings(shift: f64, extent: Region) -> SamplingSettings {
    SamplingSettings { source: Arc::new(Hills(shift)), extent, cells: CELLS, spacing: 1.0 }
}

fn colors() -> Colors {
    Arc::new([[0.5; 4]; 256])
}

impl Game {
    fn new() -> Self {
        let settings = sampling_settings(0.0, WHOLE);
        Self {
            heart: Heart::new(settings.clone(), MeshMethod::default(), true, colors(), true),
            queue: WorkQueue::default(),
            stats: TerrainStats::default(),
            screen: HashMap::new(),
            despawned: Vec::new(),
            views: HashMap::new(),
            next_entity: 1,
            stamps: Vec::new(),
            waiting: Vec::new(),
            settings,
            levels: None,
            normals: true,
            isovalue: 0.0,
            smoothing: None,
            is_surface: false,
        }
    }

    /// The mesher and the isovalue that are asked for.
    fn method(&self) -> MeshMethod {
        let isovalue = self.isovalue;
        match self.smoothing {
            None => MeshMethod::Primal(MeshSettings { isovalue, ..MeshSettings::default() }),
            Some(smoothing) => MeshMethod::Dual(DualSettings { isovalue, smoothing, ..DualSettings::default() }),
        }
    }

    fn happen(&mut self, event: &Event) {
        match *event {
            Event::View { viewer, view } => {
                match view {
                    Some(view) => _ = self.views.insert(viewer, view),
                    None => _ = self.views.remove(&viewer),
                }
                self.appearance(viewer);
            }
            Event::QuantisedStamp { center, radius, add } => {
                let scale = f64::from(CELLS);
                let shape = QuantisedShape::sphere(center.map(|v| v * scale), radius * scale).expect("in range");
                let operation = if add { Operation::Add } else { Operation::Dig };
                self.waiting.push(QuantisedStamp::new(shape, operation, 3).with_isovalue(self.isovalue));
            }
            Event::Despawn { index } => {
                let mut all: Vec<_> = self.screen.iter().map(|(entity, (key, _))| (*key, *entity)).collect();
                all.sort();
                if let Some((key, entity)) = all.get(index % all.len().max(1)) {
                    self.screen.remove(entity);
                    self.heart.despawned(*key, *entity);
                    self.despawned.push(*key);
                }
            }
            Event::Source { shift } if self.levels.is_some() => self.start_over(shift),
            Event::Source { shift } => {
                if self.heart.is_generation_shown() {
                    self.settings = sampling_settings(shift, self.settings.extent);
                    self.heart.refill(self.settings.clone(), self.method());
                    self.stamps.clear();
                    self.waiting.clear();
                }
            }
            Event::Colors => self.heart.set_appearance(self.normals, colors()),
            Event::Normals => {
                self.normals = !self.normals;
                self.heart.set_appearance(self.normals, colors());
            }
            Event::Isovalue { isovalue } => {
                self.isovalue = isovalue;
                self.heart.set_mesh_method(self.method());
            }
            // Terrains with several levels are meshed with the primal mesher only.
            Event::Mesher { .. } if self.levels.is_some() => {}
            Event::Mesher { smoothing } => {
                self.smoothing = smoothing;
                self.heart.set_mesh_method(self.method());
            }
            Event::Extent { index } => {
                self.settings.extent = EXTENTS[index];
                self.heart.resize(EXTENTS[index]);
                self.keep();
                self.take_released();
                let mut viewers: Vec<u32> = self.views.keys().copied().collect();
                viewers.sort_unstable();
                viewers.into_iter().for_each(|viewer| self.appearance(viewer));
            }
            Event::Update { jobs, inline, late } => self.update(jobs, inline, late),
        }
    }

    /// Tells the heart what a viewer sees.
    fn appearance(&mut self, viewer: u32) {
        let extent = self.settings.extent;
        let view = self.views.get(&viewer).map(|&(middle, radius, margin, samples)| {
            let range = LoadRegion::ellipsoid(middle, [radius; 3], extent);
            let samples = samples.map(|samples| LoadRegion::ellipsoid(middle, [samples + 0.1; 3], extent));
            View::new(range, margin, samples, [1.0, 0.0, 0.0])
        });
        self.heart.set_view(Entity::from_raw_u32(viewer), view);
    }

    fn update(&mut self, jobs: usize, inline: usize, late: bool) {
        self.run_systems(jobs, inline, late);
        self.check();
    }

    /// What holds in every update.
    fn check(&self) {
        let heart = &self.heart;
        heart.table.check();
        heart.groups.check();
        if let Some(levels) = &heart.levels {
            self.check_levels(levels);
        }
        if self.is_surface {
            self.check_surface();
        }
        let drawn: HashMap<_, _> = heart.table.entities().map(|(key, entity)| (entity, key)).collect();
        assert_eq!(drawn.len(), self.screen.len(), "what is drawn is on the screen");
        for (entity, key) in drawn {
            let (on_screen, geometry) = &self.screen[&entity];
            assert_eq!(*on_screen, key);
            assert!(Arc::ptr_eq(geometry, &heart.table.drawn(key).expect("it is drawn").geometry));
        }
        for position in WHOLE.points() {
            let key = ChunkKey::finest(position);
            let (is_filled, is_resident) = (heart.table.is_filled(key), heart.samples.is_resident(position));
            let may_be_resident = is_filled || heart.samples.is_held(position);
            assert!(
                is_resident == is_filled || is_resident && may_be_resident,
                "{position:?}: {is_filled}, {is_resident}"
            );
        }
        for queue in [heart.arriving.len(), heart.to_fill.len(), heart.to_mesh.len()] {
            assert!(queue <= 2 * WHOLE.points().count());
        }
    }

    /// Checks that all meshes on the screen form one closed surface, bit for bit. Vertices that smoothing has moved to one
    /// point count as one.
    fn check_surface(&self) {
        let mut union = MeshUnion::new();
        for (key, mesh) in self.screen.values() {
            union.add(mesh, key.position.map(|v| i64::from(v) * i64::from(CELLS)), key.level);
        }
        // Each edge is passed as often in one direction as in the other.
        let mut passes = HashMap::<[u32; 2], i32>::new();
        let (_, indices) = union.weld();
        for triangle in indices.chunks_exact(3) {
            for [from, to] in [0, 1, 2].map(|corner| [triangle[corner], triangle[(corner + 1) % 3]]) {
                let (edge, step) = if from < to { ([from, to], 1) } else { ([to, from], -1) };
                *passes.entry(edge).or_default() += step;
            }
        }
        let open = passes.values().filter(|passes| **passes != 0).count();
        assert!(open == 0, "{open} open edges");
    }

    /// Updates until nothing waits; then everything is as if it had always been so.
    fn follow_residency(&mut self) {
        for _ in 0..2_000 {
            self.update(30, 8, false);
            if self.heart.is_settled() && self.waiting.is_empty() {
                return self.check_settled();
            }
        }
        panic!("not settled: {:?}, {:?}", self.heart.coverage(), self.heart.table.counts());
    }

    fn check_settled(&self) {
        let heart = &self.heart;
        assert_eq!(heart.coverage().waiting, 0);
        assert_eq!(heart.mesh_method(), self.method());
        assert!(heart.is_generation_shown() && heart.sampling == 0 && heart.groups.is_empty());
        let extent = self.settings.extent;
        let is_there = |key: ChunkKey| !LeafKey::from(key).region().intersection(&extent).is_empty();
        assert!(heart.table.keys().all(is_there), "what lies beyond has gone");
        let mut fresh = Grid::<i16>::bounded(CELLS, extent).expect("a good extent");
        for position in extent.points() {
            let source = self.settings.source.as_ref();
            fresh.insert_clean(position, GridChunk::from_source(source, position, CELLS, 1.0)).expect("a chunk of it");
            for stamp in &self.stamps {
                fresh.apply_to_chunk(position, stamp, &mut SamplePool::new());
            }
        }
        let method = self.method().with_normals(self.normals);
        if let (Some(levels), MeshMethod::Primal(settings)) = (&heart.levels, method) {
            return self.check_settled_levels(levels, &fresh, &settings);
        }
        for position in extent.points() {
            let key = ChunkKey::finest(position);
            if let Some(chunk) = heart.samples().newest().chunk(position) {
                let expected = fresh.chunk(position).expect("all are there");
                let is_same = (0..CELLS.pow(3) as usize).all(|index| chunk.voxel(index) == expected.voxel(index));
                assert!(is_same, "samples of {position:?}");
            }
            let state = heart.leaf_at(position).map(|leaf| leaf.state);
            assert!(state.is_some() || !heart.cover.contains(position), "{position:?} is in range");
            assert_eq!(state.is_some(), heart.table.is_leaf(key));
            let is_despawned = self.despawned.contains(&key) && heart.entity(key).is_none();
            if let Some(state) = state.filter(|_| !is_despawned) {
                let input = MeshInput::Finest(Box::new(fresh.neighbourhood_view(position).to_neighbourhood()));
                let expected = meshed(&input, key, &method).geometry;
                let wanted = if expected.is_empty() { LeafState::Empty } else { LeafState::Drawn };
                assert_eq!(state, wanted, "{position:?}");
                if let Some(drawn) = heart.table.drawn(key).filter(|drawn| !drawn.geometry.is_empty()) {
                    assert!(*drawn.geometry == *expected, "the mesh of {position:?}");
                    assert_eq!(drawn.appearance, heart.appearance(), "the appearance of {position:?}");
                }
            }
        }
    }
}

fn meshed(input: &MeshInput, key: ChunkKey, method: &MeshMethod) -> ChunkMesh {
    let mut geometry = MeshBuffer::new();
    input.mesh(&mut MeshScratch::default(), method, &mut geometry).expect("samples of a chunk");
    ChunkMesh { geometry: Arc::new(geometry), ..ChunkMesh::empty(key) }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn whatever_happens_nothing_waits_for_ever(events in prop::collection::vec(event(), 1..60)) {
        let mut game = Game::new();
        for event in &events {
            game.happen(event);
        }
        game.follow_residency();
        // And again, from there.
        for event in events.iter().rev() {
            game.happen(event);
        }
        game.follow_residency();
    }

    #[test]
    fn the_surface_is_closed_in_every_update(events in prop::collection::vec(event_of_surface(), 1..60)) {
        let mut game = Game::new();
        game.settings.extent = Region::new([-2, -1, -2], [2, 1, 2]);
        game.heart.resize(game.settings.extent);
        game.happen(&Event::View { viewer: 0, view: Some(([0.0; 3], 4.0, 0.0, None)) });
        game.follow_residency();
        game.is_surface = true;
        for event in &events {
            game.happen(event);
        }
        game.follow_residency();
        prop_assert!(game.heart.coverage().waiting == 0 && game.settings.extent.points().all(|chunk| game.heart.leaf_at(chunk).is_some()));
    }

    #[test]
    fn each_queue_holds_a_chunk_once(turns in prop::collection::vec((0.0..6.2f64, any::<bool>()), 1..200)) {
        let mut game = Game::new();
        for (angle, here) in turns {
            let x = if here { -3.0 } else { 3.5 };
            let view = Some(([x + 0.3 * angle.cos(), 0.0, 0.3 * angle.sin()], 1.5, 0.5, Some(0.5)));
            game.happen(&Event::View { viewer: 1, view });
            game.happen(&Event::QuantisedStamp { center: [x, 0.0, 0.0], radius: 0.5, add: here });
            game.update(0, 0, true);
        }
        game.follow_residency();
    }
}

#[test]
fn another_source_comes_after_the_game_has_despawned_all_there_was() {
    let mut game = Game::new();
    game.happen(&Event::View { viewer: 0, view: Some(([-1.7, 0.7, -0.4], 0.2, 0.0, None)) });
    game.follow_residency();
    while !game.screen.is_empty() {
        game.happen(&Event::Despawn { index: 0 });
    }
    for shift in [1.0, 2.0] {
        let before = game.heart.samples().generation();
        game.happen(&Event::Source { shift });
        assert_ne!(game.heart.samples().generation(), before);
        game.follow_residency();
    }
}

/// A plate is so thin that a hole changes no sample much beside it, and smoothing moves vertices far beside it.
#[test]
fn edits_during_a_change_of_the_mesher_reach_as_far_as_both_read() {
    for (offset, meshers) in
        (0..16).map(|i| (f64::from(i / 2) / 8.0, [[None, Some(6)], [Some(6), None]][i as usize % 2]))
    {
        let mut game = Game::new();
        let plate = |[_, y, _]: [f64; 3]| (y - 0.3).abs() - 1.2;
        let extent = Region::new([-2, -1, -2], [2, 1, 2]);
        game.settings = SamplingSettings { source: Arc::new(plate), extent, cells: CELLS, spacing: 1.0 };
        game.smoothing = meshers[0];
        game.heart = Heart::new(game.settings.clone(), game.method(), true, colors(), true);
        game.happen(&Event::View { viewer: 0, view: Some(([0.0; 3], 4.0, 0.0, None)) });
        game.follow_residency();
        game.is_surface = true;
        game.happen(&Event::Mesher { smoothing: meshers[1] });
        (0..5).for_each(|_| game.update(4, 0, false));
        assert!(game.heart.transition.is_some(), "it is under way");
        game.happen(&Event::QuantisedStamp { center: [offset, 0.04, 0.4], radius: 0.3, add: false });
        game.follow_residency();
    }
}
