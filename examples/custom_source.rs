//! A custom source: an endless staircase of terraces with a shaft through it, and a bound that spares the chunks
//! above from being sampled.
//!
//! Click to grab the mouse; W, A, S, D, Space and Shift fly, Esc frees it. `--screenshot FILE.png` renders a picture
//! and exits.

use bevy::prelude::*;
use bevy_marchless::prelude::*;
use bevy_marchless::source::prelude::*;
use marchless_examples::camera::fly_camera;
use marchless_examples::small::sun;

/// Ground that rises in terraces from a shaft in the middle.
struct Terraces {
    /// The middle of the shaft, in world units along x and z.
    middle: [f64; 2],
    /// How high each terrace is, in world units.
    step: f64,
}

impl Terraces {
    const SHAFT: f64 = 20.0;
    const LOWEST: f64 = 24.0;
    const HIGHEST: f64 = 96.0;

    /// Height of the ground at a distance from the middle.
    fn height(&self, distance: f64) -> f64 {
        let slope = (distance - Self::SHAFT) * 0.6 / self.step;
        // Flat for most of each step, then steep.
        let terrace = slope.floor() + (slope.fract() * 4.0 - 3.0).max(0.0);
        (Self::LOWEST + terrace * self.step).clamp(Self::LOWEST, Self::HIGHEST)
    }
}

impl Source for Terraces {
    fn fill(&self, region: &SourceRegion, distances: &mut [f32], materials: &mut [u8]) {
        let [nx, ny, nz] = region.size;
        let points = (0..nz).flat_map(|z| (0..ny).flat_map(move |y| (0..nx).map(move |x| [x, y, z])));
        for ((point, distance), material) in points.zip(distances).zip(materials) {
            let [x, y, z] = region.position(point);
            let from_middle = (x - self.middle[0]).hypot(z - self.middle[1]);
            let above_ground = (y - self.height(from_middle)) * 0.5;
            let into_shaft = Self::SHAFT - from_middle;
            *distance = (above_ground.max(into_shaft) / region.spacing) as f32;
            *material = ((y / self.step).max(0.0) as u8) % 8;
        }
    }

    fn bound(&self, region: &SourceRegion) -> Bound {
        let bottom = region.position([0; 3])[1];
        if bottom > Self::HIGHEST { Bound::Outside } else { Bound::Mixed }
    }
}

fn main() -> AppExit {
    marchless_examples::small::app("Marchless: a source of one's own")
        .add_plugins(MarchlessPlugins)
        .add_systems(Startup, setup)
        .run()
}

fn setup(mut commands: Commands) {
    commands.spawn(Terrain::new(Terraces { middle: [128.0; 2], step: 9.0 }));
    commands.spawn(fly_camera(Vec3::new(128.0, 190.0, 290.0), Vec3::new(128.0, 30.0, 120.0)));
    commands.spawn(sun(Vec3::new(-0.5, -0.8, -0.3)));
}
