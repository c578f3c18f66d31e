//! [`FarEdits`]: digs near and far into a view with several levels of detail.

use bevy_ecs::system::SystemState;
use bevy_marchless::prelude::*;
use bevy_marchless::stats::TerrainStats;
use bevy_math::{Dir3, Ray3d, Vec3};
use bevy_transform::components::Transform;
use marchless_plugin_benches::{Game, PACE, Times, World};

use crate::measure::Sight;

/// The digs: their radius, and how far away they are. [Units: voxels]
const DIGS: [(f32, f32); 3] = [(6.0, 80.0), (6.0, 560.0), (24.0, 2_200.0)];
/// The most updates that a dig may take to show.
const PATIENCE: u32 = 120;

/// Digs of one radius at one distance.
pub(crate) struct FarEdits {
    pub(crate) radius: f32,
    pub(crate) distance: f32,
    /// The lowest and the highest level of the ground that was dug, 0 if nothing was.
    pub(crate) levels: [u8; 2],
    /// CPU time of the updates that read the stamps.
    pub(crate) updates: Times,
    /// By how many updates later each was shown, ascending.
    pub(crate) late: Vec<u32>,
}

impl FarEdits {
    /// Digs so many holes of each kind, all around a viewer. With `paced`, the view is complete before.
    pub(crate) fn measure(count: u32, paced: bool) -> Vec<Self> {
        let mut game = Game::new(Sight::Far.terrain(World::Hills), paced);
        game.spawn_viewer(Sight::Far.viewer(), Transform::from_xyz(0.0, 80.0, 0.0));
        if paced {
            game.settle(60 * PACE);
        } else {
            game.update();
        }
        let dig = |&(radius, distance): &(f32, f32)| Self::dig(&mut game, radius, distance, count);
        DIGS.iter().map(dig).collect()
    }

    fn dig(game: &mut Game, radius: f32, distance: f32, count: u32) -> Self {
        let (mut times, mut late, mut levels) = (Vec::new(), Vec::new(), Vec::new());
        for number in 0..count {
            let (sin, cos) = (2.4 * number as f32).sin_cos();
            let place = Vec3::new(distance * cos, 0.0, distance * sin);
            let Some(hit) = ground(game, place) else { continue };
            levels.push(hit.level);
            let shown = stats(game).edits_shown;
            game.dig(hit.position.as_dvec3(), radius);
            times.push(game.update());
            let mut waited = 0;
            while stats(game).edits_shown == shown && waited < PATIENCE {
                game.update();
                waited += 1;
            }
            late.push(waited);
        }
        late.sort_unstable();
        let levels = [levels.iter().min(), levels.iter().max()].map(|level| level.copied().unwrap_or(0));
        Self { radius, distance, levels, updates: times.into_iter().collect(), late }
    }
}

/// What is drawn above or below a place.
fn ground(game: &mut Game, place: Vec3) -> Option<TerrainHit> {
    let terrain = game.terrain;
    let mut state = SystemState::<TerrainQuery>::new(game.app.world_mut());
    let query = state.get(game.app.world()).ok()?;
    query.ray_cast_terrain(terrain, Ray3d::new(place + 500.0 * Vec3::Y, Dir3::NEG_Y), 1_000.0)
}

fn stats(game: &Game) -> TerrainStats {
    *game.app.world().resource::<TerrainStats>()
}
