//! The fields that benches mesh. They differ in the amount and the shape of their surface.

mod table;
mod times;

use std::thread;

use noise::{Fbm, MultiFractal, NoiseFn, Perlin};

pub use table::{aligned, duration};
pub use times::Times;

/// A kind of field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Field {
    /// Air only: the cost of finding no surface.
    Empty,
    /// Ground only: no surface either, with every sign set.
    Solid,
    /// A level plane.
    Plane,
    /// A ball that fills a good part of the box.
    Sphere,
    /// Hills from five octaves of noise.
    Terrain,
    /// Caverns all through the box, from five octaves of noise in three dimensions.
    Caves,
    /// Independent samples: the most surface possible.
    WhiteNoise,
}

impl Field {
    /// All fields, those with less surface first.
    pub const ALL: [Self; 7] =
        [Self::Empty, Self::Solid, Self::Plane, Self::Sphere, Self::Terrain, Self::Caves, Self::WhiteNoise];

    /// The name that reports show.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Empty => "empty",
            Self::Solid => "solid",
            Self::Plane => "plane",
            Self::Sphere => "sphere",
            Self::Terrain => "terrain",
            Self::Caves => "caves",
            Self::WhiteNoise => "white noise",
        }
    }

    /// Distances in voxels, `[size³]`, x fastest; the same on every call. Hills and caverns have the same width in all
    /// sizes; a larger box holds more of them. All processors share the sampling: five octaves at 256³ would take a
    /// single one some seconds.
    pub fn distances(self, size: u32) -> Vec<f32> {
        let middle = f64::from(size) / 2.0;
        match self {
            Self::Empty => fill(size, |_| 4.0),
            Self::Solid => fill(size, |_| -4.0),
            Self::Plane => fill(size, |[_, _, z]| f64::from(z) - middle - 0.3),
            Self::Sphere => fill(size, |p| {
                p.map(|v| (f64::from(v) - middle).powi(2)).iter().sum::<f64>().sqrt() - 0.4 * f64::from(size)
            }),
            Self::Terrain => {
                let hills = Fbm::<Perlin>::new(1).set_octaves(5);
                let height = |x, y| middle + 12.0 * hills.get([x, y].map(|v| f64::from(v) / 64.0 + 0.1));
                let heights: Vec<f64> = (0..size).flat_map(|y| (0..size).map(move |x| height(x, y))).collect();
                fill(size, |[x, y, z]| f64::from(z) - heights[x as usize + y as usize * size as usize])
            }
            Self::Caves => {
                let caverns = Fbm::<Perlin>::new(2).set_octaves(5);
                fill(size, |p| 8.0 * caverns.get(p.map(|v| f64::from(v) / 24.0 + 0.1)))
            }
            Self::WhiteNoise => fill(size, |[x, y, z]| {
                let index = (u64::from(z) * u64::from(size) + u64::from(y)) * u64::from(size) + u64::from(x);
                (split_mix(index) >> 40) as f64 / f64::from(1 << 23) - 1.0
            }),
        }
    }
}

/// The distances at all `size³` lattice points, x fastest.
fn fill(size: u32, distance: impl Fn([u32; 3]) -> f64 + Sync) -> Vec<f32> {
    let layer = size as usize * size as usize;
    let mut distances = vec![0.0; layer * size as usize];
    let workers = thread::available_parallelism().map_or(1, usize::from);
    let layers_each = (size as usize).div_ceil(workers).max(1);
    thread::scope(|scope| {
        for (first_z, part) in (0..size).step_by(layers_each).zip(distances.chunks_mut((layer * layers_each).max(1))) {
            let distance = &distance;
            scope.spawn(move || {
                let points =
                    (first_z..size).flat_map(|z| (0..size).flat_map(move |y| (0..size).map(move |x| [x, y, z])));
                for (slot, point) in part.iter_mut().zip(points) {
                    *slot = distance(point) as f32;
                }
            });
        }
    });
    distances
}

/// The output of Sebastiano Vigna's `SplitMix64` at a place in its sequence.
pub fn split_mix(index: u64) -> u64 {
    let mut bits = index.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^ (bits >> 31)
}
