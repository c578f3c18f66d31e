//! [`HillPicturePlugin`]: the view from a hill, before and after a hole was dug, and after a journey.

use bevy::prelude::*;
use bevy_marchless::prelude::*;
use marchless_examples::camera::fly_camera;
use marchless_examples::picture::{PicturePlugin, PictureReady};

use crate::args::{Args, Moment};
use crate::world::World;

/// The hill that one stands on is the highest within so many voxels of the origin, and so far above it is the eye.
const WITHIN: i32 = 600;
const EYE_LEVEL: f32 = 12.0;
/// The hole's radius. [Units: voxels]
const HOLE: f32 = 14.0;
/// The hole is at most this far away, so that it is seen in a wide view, too. [Units: voxels]
const NEARBY: f32 = 230.0;
/// How fast the journey is. [Units: voxels per update]
const PACE: f32 = 64.0;
/// In so many updates everything has noticed that a viewer has moved.
const NOTICED: u32 = 4;

/// Renders the moment that the command line asks for.
pub(crate) struct HillPicturePlugin {
    picture: PicturePlugin,
    moment: Moment,
}

impl HillPicturePlugin {
    /// The picture that the command line asks for.
    pub(crate) fn new(args: &Args) -> Self {
        let picture = PicturePlugin { path: args.screenshot.clone().unwrap_or_default(), size: args.size };
        Self { picture, moment: args.moment }
    }
}

/// A visit to the hill.
#[derive(Resource)]
struct Visit {
    until: Moment,
    step: Step,
    /// How many updates the step has taken.
    updates: u32,
    /// Where the eye is, and the hole in the lattice.
    eye: Vec3,
    hole: Option<IVec3>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    Arriving,
    Digging,
    Leaving,
    Away,
    Returning,
    Done,
}

impl Plugin for HillPicturePlugin {
    fn build(&self, app: &mut App) {
        let PicturePlugin { path, size } = &self.picture;
        let visit = Visit { until: self.moment, step: Step::Arriving, updates: 0, eye: Vec3::ZERO, hole: None };
        app.add_plugins(PicturePlugin { path: path.clone(), size: *size })
            .insert_resource(visit)
            .add_systems(Startup, climb)
            .add_systems(Update, go_on);
    }
}

/// Stands on the hill.
fn climb(world: Res<World>, mut visit: ResMut<Visit>, mut commands: Commands) -> Result {
    let landscape = world.source()?;
    let line = || (-WITHIN..=WITHIN).step_by(12).map(f64::from);
    let places = line().flat_map(|x| line().map(move |z| [x, z]));
    let top = places.filter_map(|[x, z]| Some([x, landscape.height(x, z)?, z])).max_by(|a, b| a[1].total_cmp(&b[1]));
    let [x, y, z] = top.unwrap_or_default();
    visit.eye = Vec3::new(x as f32, y as f32 + EYE_LEVEL, z as f32);
    let camera = fly_camera(visit.eye, visit.eye + Vec3::new(0.0, -0.2, -1.0));
    commands.spawn((camera, world.viewer()));
    Ok(())
}

fn go_on(
    terrain: Single<(Entity, &TerrainVolume)>,
    viewer: Single<(&mut Transform, &GlobalTransform, &Camera), With<TerrainViewer>>,
    world: Res<World>,
    query: TerrainQuery,
    mut visit: ResMut<Visit>,
    mut stamps: MessageWriter<Stamp>,
    mut ready: ResMut<PictureReady>,
    mut exit: MessageWriter<AppExit>,
) {
    let (terrain, volume) = *terrain;
    let (mut transform, seen_from, camera) = viewer.into_inner();
    visit.updates += 1;
    let is_settled = visit.updates > NOTICED && volume.is_settled();
    let next = match visit.step {
        Step::Arriving if is_settled && visit.until == Moment::Arrived => Step::Done,
        Step::Arriving if is_settled => {
            // To the right and down, as little as meets ground nearby.
            let hit = (4..20).find_map(|steep| {
                let direction = Dir3::new(Vec3::new(0.3, -0.1 * steep as f32, -1.0)).ok()?;
                query.ray_cast_terrain(terrain, Ray3d::new(visit.eye, direction), NEARBY.min(0.6 * world.radius))
            });
            let Some(hit) = hit else {
                eprintln!("flyover: there is nothing to dig.");
                exit.write(AppExit::error());
                return;
            };
            stamps.write(Stamp::dig(terrain, BrushShape::sphere(hit.lattice, HOLE)));
            visit.hole = volume
                .settings()
                .map(|settings| hit.lattice.as_ivec3().div_euclid(IVec3::splat(settings.chunk_cells as i32)));
            let rim = hit.position + seen_from.up() * HOLE;
            if let [Ok(middle), Ok(rim)] = [hit.position, rim].map(|at| camera.world_to_viewport(seen_from, at)) {
                println!("Dug a ball at {:.0},{:.0} of {:.0} pixels radius.", middle.x, middle.y, middle.distance(rim));
            }
            Step::Digging
        }
        Step::Digging if is_settled && visit.until == Moment::Dug => Step::Done,
        Step::Digging if is_settled => Step::Leaving,
        Step::Leaving if transform.translation.distance(visit.eye) > 3.0 * world.radius => Step::Away,
        Step::Leaving => {
            transform.translation.x += PACE;
            Step::Leaving
        }
        Step::Away if is_settled => {
            let is_loaded = visit.hole.is_none_or(|hole| volume.leaf_at(hole).is_some());
            println!("Went away; the hole is {}.", if is_loaded { "still loaded" } else { "unloaded" });
            transform.translation = visit.eye;
            Step::Returning
        }
        Step::Returning if is_settled => Step::Done,
        step => step,
    };
    if next != visit.step {
        (visit.step, visit.updates) = (next, 0);
    }
    ready.0 |= next == Step::Done;
}
