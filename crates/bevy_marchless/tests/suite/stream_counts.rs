//! The work of a flight over the default hills, in counts: chunks loaded, sampled and meshed, and the updates that a
//! view takes. Without threads, these counts are the same on every machine.

use std::collections::BTreeSet;
use std::time::Duration;

use crate::common::stream::*;
use crate::common::*;
use bevy_app::App;
use bevy_ecs::prelude::*;
use bevy_marchless::prelude::*;
use bevy_marchless::source::prelude::*;
use bevy_marchless::stats::TerrainStats;
use bevy_math::Vec3;
use bevy_transform::components::Transform;

/// Jobs per update.
const BUDGET: usize = 16;
/// The viewer's radius: 4 chunks. [Units: voxels]
const RADIUS: f32 = 128.0;

/// Endless hills, and a viewer above them.
fn hills() -> (App, Entity, Entity) {
    let mut app = app_with_budget(BUDGET);
    app.world_mut().resource_mut::<MarchlessSettings>().streaming_budget = Duration::from_secs(5);
    let terrain = app.world_mut().spawn(Terrain::endless(NoiseHeights::default())).id();
    let viewer = app.world_mut().spawn((TerrainViewer::new(RADIUS), Transform::from_xyz(0.0, 70.0, 0.0))).id();
    (app, terrain, viewer)
}

fn stats(app: &App) -> TerrainStats {
    *app.world().resource::<TerrainStats>()
}

/// The number of updates until everything is drawn.
fn updates_until_settled(app: &mut App, terrain: Entity) -> u64 {
    for update in 1..5_000 {
        app.update();
        if volume(app, terrain).is_settled() {
            return update;
        }
    }
    panic!("not settled: {:?}", volume(app, terrain).coverage());
}

#[test]
fn a_view_is_complete_as_soon_as_its_jobs_are_done() {
    let (mut app, terrain, viewer) = hills();
    for place in [Vec3::new(0.0, 70.0, 0.0), Vec3::new(5_000.0, 70.0, 0.0), Vec3::new(5_000.0, 60.0, 9_000.0)] {
        app.world_mut().get_mut::<Transform>(viewer).unwrap().translation = place;
        let before = stats(&app);
        let updates = updates_until_settled(&mut app, terrain);
        let after = stats(&app);
        let (filled, meshed) = (after.filled - before.filled, after.meshed - before.meshed);
        println!("{updates} updates, {filled} sampled, {meshed} meshed, {:?}", volume(&app, terrain).coverage());
        let drawn = volume(&app, terrain).coverage().drawn as u64;
        assert!(drawn > 50 && filled >= drawn);
        let jobs = filled + meshed;
        assert!(updates <= 2 * jobs.div_ceil(BUDGET as u64) + 20, "{updates} updates for {jobs} jobs");
    }
}

#[test]
fn a_flight_loads_what_comes_into_range_and_little_more() {
    let (mut app, terrain, viewer) = hills();
    updates_until_settled(&mut app, terrain);
    let before = stats(&app);
    let ring = |app: &mut App| {
        let view = View::all(app, terrain)[0];
        view.chunks(32, 0.0)
    };
    let mut seen: BTreeSet<_> = ring(&mut app).into_iter().collect();
    let seen_before = seen.len();
    for update in 0..300 {
        app.world_mut().get_mut::<Transform>(viewer).unwrap().translation.x = update as f32 * 2.0;
        app.update();
        seen.extend(ring(&mut app));
    }
    updates_until_settled(&mut app, terrain);
    let after = stats(&app);
    let [loaded, filled, empty, meshed, bounded] = [
        after.loaded - before.loaded,
        after.filled - before.filled,
        after.filled_empty - before.filled_empty,
        after.meshed - before.meshed,
        after.bounded - before.bounded,
    ];
    let come = (seen.len() - seen_before) as u64;
    println!(
        "{come} came into range: {loaded} loaded, {bounded} by bound, {filled} sampled, {empty} of them empty, {meshed} meshed"
    );
    // The chunks around those in range are loaded, too: a shell.
    assert!(loaded >= come && loaded <= 2 * come, "{loaded} loaded, {come} came into range");
    // The others were settled by a close bound, in a job.
    assert!(bounded + filled <= loaded && bounded > filled, "{bounded} by bound, {filled} sampled");
    assert!(meshed <= come + come / 4, "{meshed} meshed, {come} came into range");
    let (sampled, without_surface) = sampled_chunks(volume(&app, terrain));
    println!("of {sampled} chunks with samples {without_surface} have no surface in them or beside them");
    // Chunks beside the surface are sampled in vain within four voxels of it, which stamps and isovalues reach.
    assert!(without_surface * 100 <= sampled * 18, "{without_surface} of {sampled} sampled chunks are empty");
}

/// The number of sampled chunks, and of those sampled in vain: all samples that their meshes read are on one side.
fn sampled_chunks(volume: &TerrainVolume) -> (usize, usize) {
    let grid = volume.grid();
    let is_sampled = |chunk: &marchless::GridChunk<i16>| matches!(chunk, marchless::GridChunk::Samples(_));
    let sampled = grid.chunks().filter(|(_, chunk)| is_sampled(chunk));
    let in_vain = |position: &[i32; 3]| {
        let block = grid.chunk_region(*position).grown(1, 2);
        let first = grid.get(block.min).weight < 0;
        block.points().all(|point| (grid.get(point).weight < 0) == first)
    };
    let positions: Vec<_> = sampled.map(|(position, _)| position).collect();
    (positions.len(), positions.iter().filter(|position| in_vain(position)).count())
}
