//! [`run`]: cuts the stem without a renderer, and watches the falling part until it rests.

use core::time::Duration;
use std::process::ExitCode;
use std::time::Instant;

use bevy::ecs::message::MessageCursor;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_marchless::prelude::*;

use crate::bodies::{self, Body};
use crate::scene;

/// How long a step may take before something must be wrong.
const PATIENCE: Duration = Duration::from_secs(120);

/// Cuts the stem, and waits until the island rests on the ground.
///
/// Success where it does, and the terrain has lost as much as the island has.
pub(crate) fn run() -> ExitCode {
    match try_run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("falling_pieces: {error}");
            ExitCode::FAILURE
        }
    }
}

fn try_run() -> Result<(), String> {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, TransformPlugin, MarchlessPlugins, bodies::plugin))
        .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(10)));
    let terrain = app.world_mut().spawn(scene::terrain()).id();
    app.finish();
    app.cleanup();
    update_until(&mut app, "the terrain is not ready", |world| {
        world.get::<TerrainVolume>(terrain).is_some_and(TerrainVolume::is_settled)
    })?;

    let mut edits = MessageCursor::default();
    app.world_mut().write_message(scene::cut(terrain));
    app.update();
    println!("Cut the stem: {} cubic voxels.", removed(&app, &mut edits));
    app.update();
    let volumes: Vec<usize> = bodies(app.world_mut()).map(|body| body.volume).collect();
    let dug = removed(&app, &mut edits);
    if volumes.is_empty() || volumes.iter().sum::<usize>() as u64 != dug {
        return Err(format!("the terrain has lost {dug} cubic voxels, but the bodies have {volumes:?}"));
    }
    update_until(&mut app, "the island does not come to rest", |world| bodies(world).all(|body| body.is_at_rest))?;
    let falls: Vec<f32> = bodies(app.world_mut()).map(|body| body.fallen).collect();
    if falls.len() != volumes.len() || falls.iter().any(|fallen| *fallen < 1.0) {
        return Err(format!("islands have fallen by {falls:?} voxels"));
    }
    Ok(())
}

fn bodies(world: &mut World) -> impl Iterator<Item = &Body> {
    world.query::<&Body>().iter(world).collect::<Vec<_>>().into_iter()
}

/// How many cubic voxels edits have removed since the last time.
fn removed(app: &App, edits: &mut MessageCursor<TerrainEdited>) -> u64 {
    edits.read(app.world().resource::<Messages<TerrainEdited>>()).flat_map(|edit| edit.removed.values()).sum()
}

fn update_until(app: &mut App, otherwise: &str, done: impl Fn(&mut World) -> bool) -> Result<(), String> {
    let start = Instant::now();
    while !done(app.world_mut()) {
        if start.elapsed() > PATIENCE {
            return Err(format!("{otherwise} after two minutes"));
        }
        app.update();
    }
    Ok(())
}
