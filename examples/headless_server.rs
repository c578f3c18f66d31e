//! A server without window and renderer: it replays what two players dug, once as it came in and once all in one
//! update, and prints that samples and meshes are the same.
//!
//! No keys; it exits by itself, with an error if the two differ or a mesh has a defect.

use bevy::prelude::*;
use bevy_marchless::marchless::{Grid, MeshReport};
use bevy_marchless::prelude::*;
use bevy_marchless::source::prelude::*;
use core::fmt;
use core::time::Duration;
use std::time::Instant;

fn main() -> AppExit {
    let (Some(as_they_came), Some(all_at_once)) = (replay(1), replay(usize::MAX)) else {
        eprintln!("The terrain is not ready after two minutes.");
        return AppExit::error();
    };
    println!("One stamp an update: {as_they_came}");
    println!("All in one update:   {all_at_once}");
    let sound = as_they_came.sound == as_they_came.chunks;
    if sound && as_they_came == all_at_once { AppExit::Success } else { AppExit::error() }
}

/// What the two players did, in the order in which the server received it.
fn received(terrain: Entity) -> Vec<Stamp> {
    let frame = Duration::from_millis(16);
    let tunneller = |step: u32| {
        let head = Vec3::new(20.0 + step as f32 * 2.0, 40.0, 64.0);
        Stamp::dig(terrain, BrushShape::capsule(head - Vec3::X * 2.0, head, 5.0))
    };
    let builder = |step: u32| {
        let stroke = Stroke { id: 1, rate: 20.0, falloff: 4.0, start: frame * step, end: frame * (step + 1) };
        Stamp::add(terrain, BrushShape::sphere(Vec3::new(64.0, 60.0, 40.0), 12.0), 5).with_stroke(stroke)
    };
    (0..40).flat_map(|step| [tunneller(step), builder(step)]).collect()
}

/// What has become of a terrain.
#[derive(PartialEq)]
struct Summary {
    /// Of all samples.
    hash: u64,
    chunks: usize,
    /// How many chunks' meshes have no defect.
    sound: usize,
    triangles: usize,
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { hash, chunks, sound, triangles } = self;
        write!(f, "samples {hash:016x}, {sound} of {chunks} chunks sound, {triangles} triangles")
    }
}

/// Runs a server that applies so many stamps an update, and sums up its terrain when all is done; `None` where that
/// takes longer than two minutes.
fn replay(stamps_an_update: usize) -> Option<Summary> {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, TransformPlugin, MarchlessPlugins));
    let terrain = Terrain::new(NoiseHeights::from_seed(7)).with_extent(UVec3::new(4, 3, 4));
    let terrain = app.world_mut().spawn(terrain).id();
    let stamps = received(terrain);
    for stamps in stamps.chunks(stamps_an_update.min(stamps.len())) {
        app.world_mut().write_message_batch(stamps.iter().copied());
        app.update();
    }
    let start = Instant::now();
    while !app.world().get::<TerrainVolume>(terrain)?.is_settled() {
        if start.elapsed() > Duration::from_secs(120) {
            return None;
        }
        app.update();
    }

    let hash = hash(app.world().get::<TerrainVolume>(terrain)?.grid());
    let mut chunks = app.world_mut().query::<&ChunkGeometry>();
    let meshes: Vec<_> = chunks.iter(app.world()).map(|geometry| &geometry.mesh).collect();
    let reports = meshes.iter().map(|mesh| MeshReport::new(&mesh.positions, &mesh.indices));
    let defects = |report: &MeshReport| report.non_manifold_edges + report.zero_area_triangles;
    let sound = reports.filter(|report| defects(report) == 0).count();
    let triangles: usize = meshes.iter().map(|mesh| mesh.indices.len() / 3).sum();
    Some(Summary { hash, chunks: meshes.len(), sound, triangles })
}

/// FNV-1a over all samples.
fn hash(grid: &Grid<i16>) -> u64 {
    let samples = grid.chunk_cells().pow(3) as usize;
    let voxels = grid.chunks().flat_map(|(_, chunk)| (0..samples).map(|index| chunk.voxel(index)));
    let bytes = voxels.flat_map(|voxel| voxel.weight.to_le_bytes().into_iter().chain([voxel.material]));
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}
