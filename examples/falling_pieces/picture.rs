//! [`MomentPlugin`]: a picture before the stem is cut, while the island falls, or once it has come to rest.

use core::time::Duration;

use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_marchless::prelude::*;
use marchless_examples::picture::{PicturePlugin, PictureReady};

use crate::args::{Args, Moment};
use crate::bodies::Body;
use crate::scene;

/// How far the island has fallen when it is taken. [Units: voxels]
const ON_ITS_WAY: f32 = 4.0;

/// Renders the moment that the command line asks for.
pub(crate) struct MomentPlugin {
    picture: PicturePlugin,
    moment: Moment,
}

#[derive(Resource)]
struct Awaited(Moment);

impl MomentPlugin {
    /// The picture that the command line asks for.
    pub(crate) fn new(args: &Args) -> Self {
        let picture = PicturePlugin { path: args.screenshot.clone().unwrap_or_default(), size: args.size };
        Self { picture, moment: args.moment }
    }
}

impl Plugin for MomentPlugin {
    fn build(&self, app: &mut App) {
        let PicturePlugin { path, size } = &self.picture;
        app.add_plugins(PicturePlugin { path: path.clone(), size: *size })
            // The same picture however slow rendering is.
            .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(10)))
            .insert_resource(Awaited(self.moment))
            .add_systems(Update, cut_and_wait);
    }
}

fn cut_and_wait(
    terrain: Single<(Entity, &TerrainVolume)>,
    bodies: Query<&Body>,
    awaited: Res<Awaited>,
    mut is_cut: Local<bool>,
    mut updates: Local<u32>,
    mut stamps: MessageWriter<Stamp>,
    mut ready: ResMut<PictureReady>,
) {
    let (terrain, volume) = *terrain;
    if !volume.is_settled() {
        return;
    }
    // The text's font comes with the first updates.
    *updates += 1;
    ready.0 |= *updates > 3
        && match awaited.0 {
            Moment::Before => true,
            Moment::Falling => bodies.iter().any(|body| body.fallen > ON_ITS_WAY),
            Moment::Rest => !bodies.is_empty() && bodies.iter().all(|body| body.is_at_rest),
        };
    if awaited.0 != Moment::Before && !*is_cut {
        *is_cut = true;
        stamps.write(scene::cut(terrain));
    }
}
