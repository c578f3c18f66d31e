//! [`run`]: the world without any renderer, dug, checked and written to a file.

use std::collections::HashMap;
use std::ops::ControlFlow;
use std::path::Path;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use bevy::prelude::*;
use bevy_marchless::marchless::MeshReport;
use bevy_marchless::prelude::*;
use marchless_examples::glb::{self, Mesh};

use crate::world::{Kind, World};

/// How long a step may take before something must be wrong.
const PATIENCE: Duration = Duration::from_secs(1800);
/// The time between two lines of progress.
const PROGRESS_INTERVAL: Duration = Duration::from_secs(2);
/// How far one stamp of the tunnel reaches along an axis at most. [Units: voxels]
const LONGEST_PIECE: f32 = 2000.0;

/// Builds the world, digs a tunnel through it, checks the mesh, writes it to `out` and prints counts and times.
///
/// Success where the mesh is closed and clean and the file is written.
pub(crate) fn run(world: &World, out: &Path) -> ExitCode {
    match try_run(world, out) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("sculpt: {error}");
            ExitCode::FAILURE
        }
    }
}

fn try_run(world: &World, out: &Path) -> Result<(), Box<dyn core::error::Error>> {
    let terrain = world.terrain()?;
    let size = terrain.size_in_voxels();
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, TransformPlugin, MarchlessPlugins));
    let entity = app.world_mut().spawn(terrain.clone()).id();
    app.finish();
    app.cleanup();

    let start = Instant::now();
    settle(&mut app, entity)?;
    let time = start.elapsed();
    println!("Built a world of {} × {} × {} voxels in {}.", size.x, size.y, size.z, milliseconds(time));
    report(&collect(&mut app, &terrain));

    let start = Instant::now();
    app.world_mut().write_message_batch(tunnel(entity, world, size.as_vec3()));
    let removed = settle(&mut app, entity)?;
    if removed == 0 && world.kind != Kind::Air {
        return Err("the tunnel has met no ground".into());
    }
    let time = start.elapsed();
    println!("Dug a tunnel of {removed} cubic voxels in {}.", milliseconds(time));
    let mesh = collect(&mut app, &terrain);
    let report = report(&mesh);
    if !report.is_closed() || !report.is_clean() {
        return Err(format!("the mesh is not as it should be: {report}").into());
    }

    let start = Instant::now();
    glb::write(out, &mesh).map_err(|error| format!("{} cannot be written: {error}", out.display()))?;
    println!("Wrote {} in {}.", out.display(), milliseconds(start.elapsed()));
    Ok(())
}

/// From wall to wall along x, just below the middle of the ground's relief, a little downhill. A long tunnel takes
/// several stamps, each within the length that brushes may have.
fn tunnel(terrain: Entity, world: &World, size: Vec3) -> Vec<Stamp> {
    let [low, high] = world.relief();
    let end = |x: f32, share: f32| Vec3::new(x, low + share * (high - low), 0.5 * size.z);
    let (start, end) = (end(-8.0, 0.35), end(size.x + 8.0, 0.15));
    let pieces = ((end - start).abs().max_element() / LONGEST_PIECE).ceil().max(1.0) as u32;
    let joint = |piece: u32| start.lerp(end, piece as f32 / pieces as f32);
    (0..pieces).map(|piece| Stamp::dig(terrain, BrushShape::capsule(joint(piece), joint(piece + 1), 7.0))).collect()
}

/// Updates until all is as it is drawn; returns how many cubic voxels were removed meanwhile.
fn settle(app: &mut App, terrain: Entity) -> Result<u64, &'static str> {
    let start = Instant::now();
    let mut removed = 0;
    loop {
        app.update();
        let edits = app.world_mut().resource_mut::<Messages<TerrainEdited>>().drain().collect::<Vec<_>>();
        removed += edits.iter().flat_map(|edit| edit.removed.values()).sum::<u64>();
        if app.world().get::<TerrainVolume>(terrain).is_some_and(TerrainVolume::is_settled) {
            return Ok(removed);
        }
        if start.elapsed() > PATIENCE {
            return Err("the world is not ready after half an hour");
        }
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// The meshes of all chunks as one, in metres; vertices on shared borders are equal bit for bit and become one.
fn collect(app: &mut App, terrain: &Terrain) -> Mesh {
    let mut mesh = Mesh::default();
    let mut known = HashMap::new();
    let mut chunks = app.world_mut().query::<(&Chunk, &ChunkGeometry)>();
    for (chunk, ChunkGeometry { mesh: piece }) in chunks.iter(app.world()) {
        let corner = (chunk.position * terrain.chunk_cells as i32).as_vec3();
        let indices: Vec<u32> = (0..piece.positions.len())
            .map(|vertex| {
                let position = corner + Vec3::from(piece.positions[vertex]);
                *known.entry(position.to_array().map(f32::to_bits)).or_insert_with(|| {
                    let color = terrain.palette.color(piece.materials[vertex]).with_alpha(1.0);
                    mesh.positions.push((position * terrain.voxel_size).to_array());
                    mesh.normals.push(piece.normals[vertex]);
                    mesh.colors.push(color.to_linear().to_u8_array());
                    mesh.positions.len() as u32 - 1
                })
            })
            .collect();
        mesh.indices.extend(piece.indices.iter().map(|&index| indices[index as usize]));
    }
    mesh
}

/// Examines a mesh; prints a line now and then where that takes long, and what it finds.
fn report(mesh: &Mesh) -> MeshReport {
    let start = Instant::now();
    let mut last = start;
    let report = MeshReport::with_progress(&mesh.positions, &mesh.indices, |done| {
        if last.elapsed() >= PROGRESS_INTERVAL {
            println!("Checking the mesh: {:.0} %", done * 100.0);
            last = Instant::now();
        }
        ControlFlow::Continue(())
    });
    let report = report.expect("progress never cancels");
    println!("Checked the mesh in {}: {report}.", milliseconds(start.elapsed()));
    report
}

fn milliseconds(time: Duration) -> String {
    format!("{:.1} ms", time.as_secs_f64() * 1e3)
}
