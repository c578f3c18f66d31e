//! Nothing leaks, however long a viewer flies, teleports and digs.
//!
//! Run it with `cargo test --release -p bevy_marchless --test suite stream_soak -- --ignored --nocapture`.

use std::sync::Arc;
use std::time::Instant;

use crate::common::stream::*;
use crate::common::*;
use bevy_ecs::prelude::*;
use bevy_marchless::prelude::*;
use bevy_marchless::stats::TerrainStats;
use bevy_math::Vec3;
use bevy_transform::components::Transform;

/// The counts when everything around the origin is drawn.
#[derive(Clone, Copy, Debug)]
struct Counts {
    /// All entities except chunks.
    others: usize,
    chunks: usize,
    mesh_assets: usize,
    /// Chunks with samples.
    samples: usize,
    /// The references to the source; each job holds one.
    source: usize,
}

/// Keeps only one viewer, at the origin, waits until everything is drawn, and counts.
fn counts_at_home(flight: &mut Flight) -> Counts {
    for viewer in core::mem::take(&mut flight.viewers) {
        flight.app.world_mut().despawn(viewer);
    }
    flight.settle();
    let stats = *flight.app.world().resource::<TerrainStats>();
    assert_eq!(stats.loaded, stats.unloaded, "nobody looks: {stats:?}");
    flight.spawn(Vec3::ZERO, Vec3::splat(2.0), 0.5);
    flight.settle_and_compare();
    for _ in 0..4 {
        flight.update();
    }
    let world = flight.app.world_mut();
    let chunks = world.query::<&Chunk>().iter(world).count();
    Counts {
        others: world.query::<Entity>().iter(world).count() - chunks,
        chunks,
        mesh_assets: mesh_assets(&flight.app),
        samples: volume(&flight.app, flight.terrain).grid().chunks().count(),
        source: Arc::strong_count(volume(&flight.app, flight.terrain).settings().expect("good settings").source.get()),
    }
}

/// The resident bytes of this process, if the system reports them.
fn resident_bytes() -> Option<u64> {
    let pages = std::fs::read_to_string("/proc/self/statm").ok()?;
    Some(pages.split(' ').nth(1)?.parse::<u64>().ok()? * 4096)
}

/// Flies `legs` random legs within an area of 24 × 24 columns of chunks.
fn soak(legs: usize, seed: u64) {
    println!("{legs} legs of seed {seed}");
    let terrain = Terrain::endless(Hills::default()).with_chunk_cells(8);
    let mut flight = Flight::new(app(), terrain, Transform::IDENTITY);
    flight.area = 12.0;
    // Threads lag behind, and the main thread has little time.
    flight.lags = true;
    let start = Instant::now();
    let before = counts_at_home(&mut flight);
    let mut warm = None;
    for (number, leg) in legs_of_seed(seed).take(legs).enumerate() {
        flight.fly(&leg);
        flight.stamps.clear();
        if (number + 1) % (legs / 10).max(1) == 0 {
            let resident = resident_bytes();
            warm = warm.or(resident);
            println!(
                "{:5.0} s: {:7} legs, {:4} MB resident, {:5} chunks edited, {:?}",
                start.elapsed().as_secs_f64(),
                number + 1,
                resident.unwrap_or(0) >> 20,
                flight.fresh.edited_chunks(),
                *flight.app.world().resource::<TerrainStats>(),
            );
        }
    }
    let after = counts_at_home(&mut flight);
    println!("before: {before:?}\nafter:  {after:?}");
    assert_eq!(after.others, before.others, "entities leak");
    assert_eq!(after.chunks, after.mesh_assets, "meshes leak");
    assert_eq!(after.source, before.source, "jobs leak");
    let kept = flight.fresh.edited_chunks();
    assert!(after.samples <= before.samples + kept, "samples leak: {after:?}, {kept} chunks were edited");
    if let (Some(warm), Some(now)) = (warm, resident_bytes()) {
        let grown = now.saturating_sub(warm);
        assert!(grown < 48 << 20, "{} MB more than after a tenth of the flight", grown >> 20);
    }
}

#[test]
fn a_short_soak() {
    soak(300, 11);
}

#[test]
#[ignore = "takes minutes, in release"]
fn a_long_soak() {
    soak(100_000, 12);
}
