//! [`SculptPicturePlugin`]: the scene as a picture, perhaps dug first.

use bevy::prelude::*;
use bevy_marchless::prelude::*;
use marchless_examples::picture::{PicturePlugin, PictureReady};

use crate::args::{Args, Dig};

/// Renders the world once it is complete.
pub(crate) struct SculptPicturePlugin {
    picture: PicturePlugin,
    digs: Vec<Dig>,
}

impl SculptPicturePlugin {
    /// The picture that the command line asks for.
    pub(crate) fn new(args: &Args) -> Self {
        let picture = PicturePlugin { path: args.screenshot.clone().unwrap_or_default(), size: args.size };
        Self { picture, digs: args.dig.clone() }
    }
}

/// What is still to be dug, one after the other.
#[derive(Resource)]
struct Digs(Vec<Dig>);

impl Plugin for SculptPicturePlugin {
    fn build(&self, app: &mut App) {
        let PicturePlugin { path, size } = &self.picture;
        app.add_plugins(PicturePlugin { path: path.clone(), size: *size })
            .insert_resource(Digs(self.digs.iter().rev().copied().collect()))
            .add_systems(Update, dig_and_finish);
    }
}

fn dig_and_finish(
    volume: Single<(Entity, &TerrainVolume)>,
    camera: Single<(&Camera, &GlobalTransform)>,
    query: TerrainQuery,
    mut digs: ResMut<Digs>,
    mut stamps: MessageWriter<Stamp>,
    mut ready: ResMut<PictureReady>,
) {
    let (terrain, volume) = *volume;
    let (camera, eye) = *camera;
    if ready.0 || !volume.is_settled() {
        return;
    }
    let (Some(dig), Some(size)) = (digs.0.pop(), camera.logical_viewport_size()) else {
        ready.0 = true;
        return;
    };
    let ray = camera.viewport_to_world(eye, dig.place * size).ok();
    let Some(hit) = ray.and_then(|ray| query.ray_cast_terrain(terrain, ray, f32::MAX)) else {
        println!("Nothing to dig at {}.", dig.place);
        return;
    };
    stamps.write(Stamp::dig(terrain, BrushShape::sphere(hit.lattice, dig.radius)));
    // A voxel is a world unit.
    let rim = camera.world_to_viewport(eye, hit.position + eye.up() * dig.radius);
    if let (Ok(middle), Ok(rim)) = (camera.world_to_viewport(eye, hit.position), rim) {
        println!("Dug a ball at {:.0},{:.0} of {:.0} pixels radius.", middle.x, middle.y, middle.distance(rim));
    }
}
