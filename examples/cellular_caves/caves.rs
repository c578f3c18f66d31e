//! [`Settings`], and the [`Caves`] that grow from them.

use core::error::Error;
use core::ops::RangeInclusive;
use std::time::{Duration, Instant};

use bevy::prelude::*;
use marchless::bits::{BitGrid, Connectivity, Rule};
use marchless::{Region, Shape};
use marchless_examples::solid::Solid;

/// What the caves grow from, and how they are shown.
#[derive(Resource, Clone, Debug, PartialEq)]
pub(crate) struct Settings {
    pub(crate) seed: u32,
    /// How large the block is along each axis. [Units: points]
    pub(crate) edge: u32,
    /// The share of rock in the noise, 0 to 1.
    pub(crate) fill: f32,
    /// Air with at least so many neighbours of rock becomes rock, 0 to 27.
    pub(crate) birth: u8,
    /// Rock with at least so many neighbours of rock stays, 0 to 27.
    pub(crate) survival: u8,
    pub(crate) steps: u8,
    /// How far the block is cut open, 0 to 1.
    pub(crate) cut: f32,
    pub(crate) view: View,
}

/// What is meshed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum View {
    /// The rock, cut open.
    Rock,
    /// The largest cave, as a body.
    Caves,
}

/// What the block's edge may be. [Units: points]
pub(crate) const EDGES: RangeInclusive<u32> = 16..=256;

impl Default for Settings {
    fn default() -> Self {
        Self { seed: 1, edge: 80, fill: 0.51, birth: 14, survival: 13, steps: 5, cut: 0.6, view: View::Rock }
    }
}

/// Caves, ready to be shown.
#[derive(Clone, Debug)]
pub(crate) struct Caves {
    pub(crate) solid: Solid,
    /// The vertices before they were smoothed.
    pub(crate) midpoints: Vec<[f32; 3]>,
    pub(crate) figures: Figures,
    settings: Settings,
}

/// What growing took, and what came of it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Figures {
    noise: Duration,
    growing: Duration,
    filling: Duration,
    meshing: Duration,
    smoothing: Duration,
    /// How many separate caves there were.
    caves: usize,
    /// The share of air before and after all but the largest were filled.
    air: [f32; 2],
    triangles: usize,
}

impl Caves {
    /// Grows, fills, cuts, meshes and smooths.
    ///
    /// # Errors
    /// Where memory does not hold it.
    pub(crate) fn grow(settings: &Settings) -> Result<Self, Box<dyn Error + Send + Sync>> {
        let mut figures = Figures::default();
        let mut clock = Clock(Instant::now());

        let shape = Shape::cube(settings.edge.clamp(*EDGES.start(), *EDGES.end())).expect("it is above 0");
        let mut rock = BitGrid::from_fn(shape, |point| noise(point, settings.seed) < settings.fill)?;
        figures.noise = clock.lap();

        let at_least = |count: u8| (count..=26).collect::<Vec<_>>();
        let rule = Rule::new(&at_least(settings.birth), &at_least(settings.survival))?.with_outside(true);
        for _ in 0..settings.steps {
            rock = rock.stepped(&rule);
        }
        figures.growing = clock.lap();

        let mut air = rock;
        air.invert();
        let caves = air.components(Connectivity::Six);
        figures.caves = caves.len();
        let largest = match caves.largest() {
            Some(index) => caves.mask(index),
            None => BitGrid::new(shape)?,
        };
        figures.air = [&air, &largest].map(|bits| bits.count() as f32 / shape.len() as f32);
        figures.filling = clock.lap();

        let bits = match settings.view {
            View::Caves => largest,
            View::Rock => {
                let mut rock = largest;
                rock.invert();
                rock.fill(Region::new(settings.cut_from(), [settings.edge as i32; 3]), false);
                rock
            }
        };
        let mut solid = Solid::new(&bits)?;
        figures.triangles = solid.mesh.triangle_count();
        figures.meshing = clock.lap();

        let midpoints = solid.mesh.positions.clone();
        solid.smooth(3, |position| settings.flat(position));
        figures.smoothing = clock.lap();
        Ok(Self { solid, midpoints, figures, settings: settings.clone() })
    }

    /// Rock in layers where it is cut, and walls that are the bluer the deeper they lie; sRGB.
    pub(crate) fn color(&self, position: Vec3) -> [f32; 3] {
        let settings = &self.settings;
        if settings.flat(position.to_array()).contains(&true) && settings.view == View::Rock {
            let layer = (0.35 * position.y + (0.11 * position.x).sin() + (0.13 * position.z).sin()).sin();
            return Vec3::new(0.66, 0.55, 0.43).lerp(Vec3::new(0.56, 0.44, 0.34), 0.5 + 0.5 * layer).to_array();
        }
        let depth = 1.0 - position.y / settings.edge as f32;
        let stops = [Vec3::new(0.93, 0.67, 0.30), Vec3::new(0.72, 0.36, 0.34), Vec3::new(0.24, 0.32, 0.58)];
        let place = (2.0 * depth).clamp(0.0, 1.999);
        stops[place as usize].lerp(stops[place as usize + 1], place.fract()).to_array()
    }
}

impl Settings {
    /// Where the part that is cut away begins on x, y and z; it ends with the block.
    fn cut_from(&self) -> [i32; 3] {
        [((1.0 - self.cut) * self.edge as f32).round() as i32; 3]
    }

    /// On which axes a vertex lies on an outer face of the block or on a face of the cut.
    fn flat(&self, position: [f32; 3]) -> [bool; 3] {
        let (end, from) = (self.edge as f32 - 0.5, self.cut_from().map(|v| v as f32 - 0.5));
        let is_open = core::array::from_fn(|axis: usize| position[axis] >= from[axis]);
        core::array::from_fn(|axis| {
            let is_cut = is_open == [true; 3] && position[axis] == from[axis];
            position[axis] <= -0.5 || position[axis] >= end || is_cut
        })
    }
}

impl Figures {
    /// Names and values.
    pub(crate) fn lines(&self) -> [(&'static str, String); 8] {
        let milliseconds = |time: Duration| format!("{:.1} ms", time.as_secs_f64() * 1e3);
        let [before, after] = self.air.map(|share| 100.0 * share);
        [
            ("noise", milliseconds(self.noise)),
            ("growing", milliseconds(self.growing)),
            ("filling", milliseconds(self.filling)),
            ("meshing", milliseconds(self.meshing)),
            ("smoothing", milliseconds(self.smoothing)),
            ("caves", self.caves.to_string()),
            ("air", format!("{before:.2} %, of which {after:.2} % are the largest cave")),
            ("triangles", self.triangles.to_string()),
        ]
    }
}

/// Tells the time since it was asked last.
struct Clock(Instant);

impl Clock {
    fn lap(&mut self) -> Duration {
        let now = Instant::now();
        now - core::mem::replace(&mut self.0, now)
    }
}

/// A number from 0 to 1 that a point and the seed decide: the finaliser of `MurmurHash3` over them.
fn noise([x, y, z]: [u32; 3], seed: u32) -> f32 {
    let mut hash = seed.wrapping_mul(0x9e37_79b9) ^ (x | y << 10 | z << 20);
    for factor in [0x85eb_ca6b, 0xc2b2_ae35] {
        hash = (hash ^ hash >> 16).wrapping_mul(factor);
        hash ^= hash >> 13;
    }
    (hash >> 8) as f32 / (1u32 << 24) as f32
}
