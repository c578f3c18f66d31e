//! A server without window and renderer: it replays what two players dug, once as it came in and once all in one
//! update, and prints that samples and meshes are the same.
//!
//! No keys; it exits by itself, with an error if the two differ.

use bevy::prelude::*;
use bevy_marchless::marchless::{Grid, MeshReport};
use bevy_marchless::prelude::*;
use core::time::Duration;

fn main() -> AppExit {
    let as_they_came = replay(1);
    let all_at_once = replay(usize::MAX);
    println!("One stamp an update: {as_they_came}");
    println!("All in one update:   {all_at_once}");
    if as_they_came == all_at_once { AppExit::Success } else { AppExit::error() }
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

/// Runs a server that applies so many stamps an update, and sums up its terrain when all is done.
fn replay(stamps_an_update: usize) -> String {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, TransformPlugin, MarchlessPlugins));
    let terrain = Terrain::new(NoiseHeights::from_seed(7)).with_extent(UVec3::new(4, 3, 4));
    let terrain = app.world_mut().spawn(terrain).id();
    let stamps = received(terrain);
    for stamps in stamps.chunks(stamps_an_update.min(stamps.len())) {
        app.world_mut().write_message_batch(stamps.iter().copied());
        app.update();
    }
    while !app.world().get::<TerrainVolume>(terrain).is_some_and(TerrainVolume::is_settled) {
        app.update();
    }

    let hash = app.world().get::<TerrainVolume>(terrain).map_or(0, |volume| hash(volume.grid()));
    let mut chunks = app.world_mut().query::<&ChunkGeometry>();
    let meshes: Vec<_> = chunks.iter(app.world()).map(|geometry| &geometry.mesh).collect();
    let reports = meshes.iter().map(|mesh| MeshReport::new(&mesh.positions, &mesh.indices));
    let sound = reports.filter(|report| report.non_manifold_edges == 0 && report.degenerate_triangles == 0).count();
    let triangles: usize = meshes.iter().map(|mesh| mesh.indices.len() / 3).sum();
    format!("samples {hash:016x}, {sound} of {} chunks sound, {triangles} triangles", meshes.len())
}

/// FNV-1a over all samples.
fn hash(grid: &Grid<i16>) -> u64 {
    let samples = grid.chunk_cells().pow(3) as usize;
    let voxels = grid.chunks().flat_map(|(_, chunk)| (0..samples).map(|index| chunk.voxel(index)));
    let bytes = voxels.flat_map(|voxel| voxel.weight.to_le_bytes().into_iter().chain([voxel.material]));
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}
