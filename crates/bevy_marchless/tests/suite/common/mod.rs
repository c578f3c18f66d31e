//! The harness of the headless tests: apps without window and renderer, and bounded numbers of updates.
#![allow(dead_code, reason = "each test uses a part of the harness")]
#![allow(unreachable_pub, reason = "a module of each test")]

pub mod log;
pub mod stream;

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use bevy_app::{App, TaskPoolPlugin};
use bevy_asset::{AssetPlugin, Assets};
use bevy_color::ColorToComponents as _;
use bevy_ecs::prelude::*;
use bevy_ecs::system::RunSystemOnce as _;
use bevy_marchless::prelude::*;
use bevy_marchless::source::prelude::*;
use bevy_math::{Dir3, IVec3, Ray3d, UVec3, Vec3};
use bevy_mesh::{Mesh, Mesh3d, MeshPlugin, VertexAttributeValues};
use bevy_transform::TransformPlugin;
use bevy_transform::components::Transform;
use marchless::{MeshBuffer, MeshReport};

/// An app with `MinimalPlugins`, `TransformPlugin` and the plugin. Jobs run on threads.
pub fn bare_app() -> App {
    let mut app = App::new();
    app.add_plugins((TaskPoolPlugin::default(), TransformPlugin, MarchlessPlugins));
    app
}

/// An app like [`app`], with mesh assets.
pub fn app() -> App {
    let mut app = App::new();
    app.add_plugins((TaskPoolPlugin::default(), TransformPlugin, AssetPlugin::default(), MeshPlugin, MarchlessPlugins));
    app
}

/// An app like [`app`] without threads: a fixed number of jobs per update, always in the same order.
pub fn app_with_budget(budget: usize) -> App {
    let mut app = app();
    app.insert_resource(MarchlessSettings { max_jobs_per_update: Some(budget), ..MarchlessSettings::default() });
    app
}

/// Flat ground of 2 × 2 × 2 chunks of 16 voxels, its surface 16.5 voxels high.
pub fn ground() -> Terrain {
    small(Terrain::new(|[_, y, _]: [f64; 3]| y - 16.5))
}

/// A ball of radius 12 in the middle of the same extent.
pub fn ball() -> Terrain {
    small(Terrain::new(|p: [f64; 3]| p.map(|v| (v - 16.0) * (v - 16.0)).iter().sum::<f64>().sqrt() - 12.0))
}

/// 2 × 2 × 2 chunks of 16 voxels.
pub fn small(terrain: Terrain) -> Terrain {
    terrain.with_extent(UVec3::splat(2)).with_chunk_cells(16)
}

/// Spawns a terrain and updates until it is drawn.
pub fn settled(app: &mut App, terrain: Terrain) -> Entity {
    let entity = app.world_mut().spawn(terrain).id();
    settle(app, entity);
    entity
}

/// Updates until everything of the terrain is filled and drawn, at most 10,000 times.
pub fn settle(app: &mut App, terrain: Entity) {
    update_until(app, |app| volume(app, terrain).is_settled());
}

/// Updates until `done`, at most 10,000 times, and lets other threads work in between.
pub fn update_until(app: &mut App, mut done: impl FnMut(&App) -> bool) {
    for _ in 0..10_000 {
        app.update();
        if done(app) {
            return;
        }
        std::thread::sleep(Duration::from_micros(500));
    }
    panic!("it did not happen in 10,000 updates");
}

pub fn volume(app: &App, terrain: Entity) -> &TerrainVolume {
    app.world().get::<TerrainVolume>(terrain).expect("a terrain has a volume")
}

/// The geometry of every chunk of a terrain, in order of position.
pub fn geometry(app: &mut App, terrain: Entity) -> Vec<(IVec3, Arc<MeshBuffer>)> {
    let mut chunks = app.world_mut().query::<(&Chunk, &ChunkGeometry)>();
    let of_terrain = chunks.iter(app.world()).filter(|(chunk, _)| chunk.terrain == terrain);
    let mut all: Vec<_> = of_terrain.map(|(chunk, geometry)| (chunk.position, geometry.mesh.clone())).collect();
    all.sort_by_key(|(position, _)| position.to_array());
    all
}

/// The expected geometry: each chunk meshed from the samples, in order of position.
pub fn expected_geometry(app: &App, terrain: Entity) -> Vec<(IVec3, MeshBuffer)> {
    let volume = volume(app, terrain);
    let settings = volume.settings().expect("good settings");
    let method = settings.mesher.method(settings.isovalue).with_normals(settings.normals);
    let mut mesher = marchless::Mesher::new();
    volume
        .grid()
        .bounds()
        .expect("bounded")
        .points()
        .map(|position| {
            let mut mesh = MeshBuffer::new();
            volume.grid().mesh_chunk(position, &mut mesher, method, &mut mesh).expect("samples of a chunk");
            (IVec3::from(position), mesh)
        })
        .collect()
}

/// Asserts that the drawn meshes are those of the samples.
pub fn assert_drawn(app: &mut App, terrain: Entity) {
    let expected = expected_geometry(app, terrain);
    let drawn = geometry(app, terrain);
    let places: std::collections::HashSet<_> = drawn.iter().map(|(position, _)| *position).collect();
    assert_eq!(drawn.len(), places.len(), "two entities at one place");
    for (position, mesh) in expected {
        let found = drawn.iter().find(|(at, _)| *at == position);
        assert_eq!(*found.map(|(_, mesh)| mesh.clone()).unwrap_or_default(), mesh, "chunk {position}");
    }
}

/// Calls [`assert_as_new_after`] with stamps that all apply at the terrain's current isovalue.
pub fn assert_as_new(app: &mut App, terrain: Entity, stamps: &[Stamp]) {
    let settings = app.world().get::<Terrain>(terrain).expect("a terrain").clone();
    let stamps: Vec<_> = stamps.iter().map(|stamp| core_stamp(stamp, settings.isovalue)).collect();
    assert_as_new_after(app, terrain, &stamps);
}

/// The core's form of a stamp at an isovalue.
pub fn core_stamp(stamp: &Stamp, isovalue: f32) -> marchless::QuantisedStamp {
    stamp.quantised().expect("numbers in range").with_isovalue(isovalue)
}

/// Asserts that a bounded terrain draws the same as a new terrain of the same settings would after these stamps.
pub fn assert_as_new_after(app: &mut App, terrain: Entity, stamps: &[marchless::QuantisedStamp]) {
    let settings = app.world().get::<Terrain>(terrain).expect("a terrain").clone();
    let mut fresh = stream::Fresh::new(&settings);
    stamps.iter().for_each(|stamp| fresh.stamp(stamp));
    let mut drawn: std::collections::BTreeMap<_, _> =
        geometry(app, terrain).into_iter().map(|(position, mesh)| (position.to_array(), mesh)).collect();
    for position in fresh.extent().points() {
        let mesh = drawn.remove(&position).unwrap_or_default();
        assert!(*mesh == fresh.mesh(position), "the chunk at {position:?} is not as in a new terrain");
    }
    assert!(drawn.is_empty(), "chunks outside of the extent: {:?}", drawn.keys());
    assert_coloured(app, terrain);
}

/// Asserts that the mesh assets of all chunks have the vertices of their geometry, in the palette's colours.
pub fn assert_coloured(app: &mut App, terrain: Entity) {
    let palette = app.world().get::<Terrain>(terrain).expect("a terrain").palette.clone();
    let mut chunks = app.world_mut().query::<(&Chunk, &ChunkGeometry, Option<&Mesh3d>)>();
    let assets = app.world().resource::<Assets<Mesh>>();
    for (chunk, geometry, mesh) in chunks.iter(app.world()).filter(|(chunk, ..)| chunk.terrain == terrain) {
        let geometry = &geometry.mesh;
        assert_eq!(mesh.is_some(), !geometry.is_empty(), "chunk {}", chunk.position);
        let Some(mesh) = mesh else { continue };
        let mesh = assets.get(&mesh.0).expect("the asset of a chunk");
        assert_eq!(mesh.count_vertices(), geometry.positions.len(), "chunk {}", chunk.position);
        assert_eq!(mesh.contains_attribute(Mesh::ATTRIBUTE_NORMAL), !geometry.normals.is_empty());
        let colors: Vec<[f32; 4]> =
            geometry.materials.iter().map(|m| palette.color(*m).to_linear().to_f32_array()).collect();
        let found = mesh.attribute(Mesh::ATTRIBUTE_COLOR).and_then(|values| match values {
            VertexAttributeValues::Float32x4(values) => Some(values),
            _ => None,
        });
        assert!(found == Some(&colors), "the colours of chunk {}", chunk.position);
    }
}

/// The union of a terrain's drawn chunks, with the vertices on shared borders merged.
pub fn report(app: &mut App, terrain: Entity) -> MeshReport {
    let cells = volume(app, terrain).grid().chunk_cells() as i32;
    let mut positions = Vec::new();
    let mut indices = Vec::new();
    let mut known = std::collections::HashMap::new();
    for (chunk, mesh) in geometry(app, terrain) {
        let corner = (chunk * cells).as_vec3();
        for index in &mesh.indices {
            let position = (corner + Vec3::from(mesh.positions[*index as usize])).to_array();
            let next = positions.len() as u32;
            let index = *known.entry(position.map(f32::to_bits)).or_insert(next);
            if index == next {
                positions.push(position);
            }
            indices.push(index);
        }
    }
    MeshReport::new(&positions, &indices)
}

/// The hit of a ray towards a point, on all visible terrains.
pub fn cast(app: &mut App, origin: Vec3, towards: Vec3, max_distance: f32) -> Option<TerrainHit> {
    let ray = Ray3d::new(origin, Dir3::new(towards - origin).unwrap());
    app.world_mut().run_system_once(move |terrains: TerrainQuery| terrains.ray_cast(ray, max_distance)).unwrap()
}

pub fn mesh_assets(app: &App) -> usize {
    app.world().resource::<Assets<Mesh>>().len()
}

/// A source that stops until its gate is opened, and counts how often it was reached.
#[derive(Clone, Default)]
pub struct Gate {
    open: Arc<AtomicBool>,
    reached: Arc<Mutex<u32>>,
}

impl Gate {
    pub fn open(&self) {
        self.open.store(true, Ordering::Release);
    }

    /// How often the gate was reached.
    pub fn reached(&self) -> u32 {
        *self.reached.lock().unwrap()
    }

    /// Waits at the gate, at most 20 seconds.
    pub fn pass(&self) {
        *self.reached.lock().unwrap() += 1;
        for _ in 0..20_000 {
            if self.open.load(Ordering::Acquire) {
                return;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

/// Endless waves, with bounds that are certain far above and below.
pub struct Waves;

impl Source for Waves {
    fn fill(&self, region: &SourceRegion, distances: &mut [f32], materials: &mut [u8]) {
        let height = |[x, y, z]: [f64; 3]| y - 6.0 * (x * 0.1).sin() * (z * 0.07).cos();
        height.fill(region, distances, materials);
    }

    fn bound(&self, region: &SourceRegion) -> Bound {
        let (bottom, top) = (region.min[1], region.min[1] + region.size[1] as i32);
        if bottom > 6 {
            Bound::Outside
        } else if top < -6 {
            Bound::Inside { material: 0 }
        } else {
            Bound::Mixed
        }
    }
}

/// A terrain of endless waves, in chunks of 8 voxels.
pub fn world() -> Terrain {
    Terrain::endless(Waves).with_chunk_cells(8)
}

pub fn move_to(app: &mut App, viewer: Entity, to: Vec3) {
    app.world_mut().get_mut::<Transform>(viewer).unwrap().translation = to;
}
