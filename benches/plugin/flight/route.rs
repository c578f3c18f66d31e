//! [`Route`]: the paths of viewers through worlds.

use bevy_math::Vec3;
use bevy_transform::components::Transform;
use marchless_plugin_benches::PACE;

/// The path of viewers through a world.
pub(crate) struct Route {
    pub(crate) name: &'static str,
    pub(crate) viewers: usize,
    /// The place of a viewer after so many seconds, in voxels.
    pub(crate) place: fn(seconds: f32, viewer: usize) -> Vec3,
    /// Seconds between two teleports, which go so far that the views before and after share no chunk.
    pub(crate) teleport: Option<u32>,
    /// Updates between two balls of radius 5 dug in front of the viewer.
    pub(crate) dig: Option<u32>,
}

const STRAIGHT: Route = Route {
    name: "straight, 64 voxels/s",
    viewers: 1,
    place: |seconds, _| Vec3::new(64.0 * seconds, 80.0, 0.0),
    teleport: None,
    dig: None,
};

pub(crate) const ROUTES: [Route; 6] = [
    STRAIGHT,
    Route { name: "straight, 256 voxels/s", place: |seconds, _| Vec3::new(256.0 * seconds, 80.0, 0.0), ..STRAIGHT },
    Route {
        name: "spiral",
        place: |seconds, _| {
            let (sin, cos) = (0.6 * seconds).sin_cos();
            Vec3::new(cos, 0.0, sin) * (40.0 + 6.0 * seconds) + Vec3::Y * (60.0 + 20.0 * (0.3 * seconds).sin())
        },
        ..STRAIGHT
    },
    Route {
        name: "teleports",
        place: |seconds, _| Vec3::new(3_000.0 * (seconds / 5.0).floor(), 70.0, 0.0),
        teleport: Some(5),
        ..STRAIGHT
    },
    Route {
        name: "two viewers",
        viewers: 2,
        place: |seconds, viewer| {
            let side = if viewer == 0 { 1.0 } else { -1.0 };
            Vec3::new(side * (500.0 + 48.0 * seconds), 80.0, 16.0 * seconds)
        },
        ..STRAIGHT
    },
    Route { name: "digging", place: |seconds, _| Vec3::new(32.0 * seconds, 70.0, 0.0), dig: Some(6), ..STRAIGHT },
];

impl Route {
    /// The transform of a viewer in an update; it faces its direction of flight.
    pub(crate) fn transform(&self, update: u32, viewer: usize) -> Transform {
        let place = |update: u32| (self.place)(update as f32 / PACE as f32, viewer);
        let (from, ahead) = (place(update), place(update + 1));
        let forward = (ahead - from).try_normalize().filter(|_| self.teleport.is_none()).unwrap_or(Vec3::X);
        Transform::from_translation(from).looking_to(forward, Vec3::Y)
    }

    /// True if the viewers teleport in this update.
    pub(crate) fn teleports(&self, update: u32) -> bool {
        self.teleport.is_some_and(|seconds| update > 0 && update.is_multiple_of(seconds * PACE))
    }
}
