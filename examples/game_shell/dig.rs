//! A drill in `FixedUpdate`: a timed stroke, cut into stamps of one step each.

use core::time::Duration;

use bevy::math::DVec3;
use bevy::prelude::*;
use bevy_marchless::prelude::*;
use marchless_examples::camera::FlyCamera;

/// What is drilled at the moment.
#[derive(Resource, Default)]
pub(crate) struct Drill {
    /// How many there have been.
    stroke: u64,
    at: Option<(Entity, DVec3)>,
    /// For how long, in the game's time.
    pub(crate) elapsed: Duration,
}

pub(crate) fn plugin(app: &mut App) {
    app.init_resource::<Drill>().add_systems(FixedUpdate, drill);
}

/// The stamps say when they begin and end, in a time of their own: virtual time may be slowed down or stand still, and
/// the same time drills the same hole.
fn drill(
    keys: Res<ButtonInput<KeyCode>>,
    time: Res<Time>,
    camera: Single<&Transform, With<FlyCamera>>,
    terrains: TerrainQuery,
    mut drill: ResMut<Drill>,
    mut stamps: MessageWriter<Stamp>,
) {
    if !keys.pressed(KeyCode::KeyF) {
        (drill.at, drill.elapsed) = (None, Duration::ZERO);
        return;
    }
    if drill.at.is_none() {
        let hit = terrains.ray_cast(Ray3d::new(camera.translation, camera.forward()), 1000.0);
        drill.at = hit.map(|hit| (hit.terrain, hit.lattice));
        drill.stroke += u64::from(hit.is_some());
    }
    let Some((terrain, place)) = drill.at else { return };
    let (start, end) = (drill.elapsed, drill.elapsed + time.delta());
    let stroke = Stroke { id: drill.stroke, rate: 16.0, falloff: 2.0, start, end };
    stamps.write(Stamp::dig(terrain, BrushShape::sphere(place, 8.0)).with_stroke(stroke));
    drill.elapsed = end;
}
