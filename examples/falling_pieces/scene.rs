//! The terrain: a meadow with a mushroom, a gate and a few pillars.

use bevy::math::DVec3;
use bevy::prelude::*;
use bevy_marchless::prelude::*;
use bevy_marchless::source::prelude::*;
use marchless_examples::camera::fly_camera;
use marchless_examples::look::{GROUND, Ground, LOOKS, ROCK, Scene};

use crate::bodies::Body;

/// Where the mushroom's stem is cut when nobody digs, and how wide. [Units: voxels]
const CUT: (Vec3, f32) = (Vec3::new(48.0, 33.0, 62.0), 8.0);

/// Which of the looks it wears.
const LOOK: usize = 0;

pub(crate) fn plugin(app: &mut App) {
    app.add_systems(Startup, set_up).add_systems(Update, dress_bodies);
}

/// The stamp that cuts the stem.
pub(crate) fn cut(terrain: Entity) -> Stamp {
    Stamp::dig(terrain, BrushShape::sphere(CUT.0, CUT.1))
}

/// 4 × 3 × 4 chunks of 32 voxels.
pub(crate) fn terrain() -> Terrain {
    Terrain::new(solids()).with_extent(UVec3::new(4, 3, 4)).with_palette(LOOKS[LOOK].palette())
}

fn solids() -> Sdf {
    let upright = |x: f64, z: f64, height: f64, radius: f64| {
        Sdf::capsule(DVec3::new(x, 6.0, z), DVec3::new(x, height, z), radius)
    };
    let meadow = Sdf::cuboid(DVec3::new(64.0, 4.0, 64.0), DVec3::new(58.0, 12.0, 58.0)).with_material(GROUND);
    let hill = Sdf::sphere(DVec3::new(48.0, -14.0, 62.0), 34.0).with_material(GROUND);
    let cap = Sdf::sphere(DVec3::new(48.0, 52.0, 62.0), 19.0)
        .intersection(Sdf::cuboid(DVec3::new(48.0, 64.0, 62.0), DVec3::new(30.0, 12.0, 30.0)))
        .with_material(3);
    let mushroom = upright(48.0, 62.0, 56.0, 5.0).with_material(2).smooth_union(cap, 3.0);
    let gate = upright(94.0, 44.0, 44.0, 6.0)
        .smooth_union(upright(94.0, 88.0, 44.0, 6.0), 4.0)
        .smooth_union(Sdf::capsule(DVec3::new(94.0, 48.0, 36.0), DVec3::new(94.0, 48.0, 96.0), 7.0), 6.0)
        .with_material(ROCK);
    let pillars = [(22.0, 30.0, 34.0), (12.0, 96.0, 44.0), (68.0, 104.0, 28.0)];
    let pillars = pillars.map(|(x, z, height)| upright(x, z, height, 4.5).with_material(ROCK));
    let meadow = meadow.smooth_union(hill, 10.0);
    pillars
        .into_iter()
        .fold(meadow.smooth_union(mushroom, 3.0).smooth_union(gate, 4.0), |all, pillar| all.smooth_union(pillar, 3.0))
}

fn set_up(mut commands: Commands, mut scene: ResMut<Scene>, ground: Res<Ground>) {
    *scene = Scene { look: LOOK, relief: [-12.0, 110.0], size: 150.0, ..default() };
    commands.spawn((terrain(), MeshMaterial3d(ground.0.clone())));
    commands.spawn(fly_camera(Vec3::new(16.0, 62.0, 158.0), Vec3::new(62.0, 34.0, 58.0)));
}

/// Bodies look as the terrain does.
fn dress_bodies(bodies: Query<Entity, Added<Body>>, ground: Res<Ground>, mut commands: Commands) {
    for body in &bodies {
        commands.entity(body).insert(MeshMaterial3d(ground.0.clone()));
    }
}
