//! The fields that benches mesh: they differ in how much surface there is, and in how it lies.

use noise::{Fbm, MultiFractal, NoiseFn, Perlin};

/// A kind of field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Field {
    /// Air alone: what it costs to find out that there is nothing.
    Empty,
    /// A level plane.
    Plane,
    /// A ball that fills a good part of the box.
    Sphere,
    /// Hills from five octaves of noise.
    Terrain,
    /// Caverns all through the box, from three octaves of noise.
    Caves,
    /// Every sample for itself: the most surface that there can be.
    WhiteNoise,
}

impl Field {
    /// All of them, the ones with less surface first.
    pub const ALL: [Self; 6] = [Self::Empty, Self::Plane, Self::Sphere, Self::Terrain, Self::Caves, Self::WhiteNoise];

    /// The name that reports show.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Empty => "empty",
            Self::Plane => "plane",
            Self::Sphere => "sphere",
            Self::Terrain => "terrain",
            Self::Caves => "caves",
            Self::WhiteNoise => "white noise",
        }
    }

    /// Distances in voxels, `[size³]`, x fastest. Hills and caverns are as wide in all sizes; a larger box holds more of them.
    pub fn distances(self, size: u32) -> Vec<f32> {
        let middle = f64::from(size) / 2.0;
        match self {
            Self::Empty => fill(size, |_| 4.0),
            Self::Plane => fill(size, |[_, _, z]| z - middle - 0.3),
            Self::Sphere => {
                fill(size, |p| p.map(|v| (v - middle).powi(2)).iter().sum::<f64>().sqrt() - 0.4 * f64::from(size))
            }
            Self::Terrain => {
                let hills = Fbm::<Perlin>::new(1).set_octaves(5);
                let column = |x, y| middle + 12.0 * hills.get([x / 64.0 + 0.1, y / 64.0 + 0.1]);
                let heights = fill_plane(size, column);
                fill(size, |[x, y, z]| z - heights[x as usize + y as usize * size as usize])
            }
            Self::Caves => {
                let caverns = Fbm::<Perlin>::new(2).set_octaves(3);
                fill(size, |p| 8.0 * caverns.get(p.map(|v| v / 24.0 + 0.1)))
            }
            Self::WhiteNoise => {
                let mut state = 0x2545_f491_4f6c_dd1du64;
                fill(size, |_| {
                    // Marsaglia's xorshift.
                    state ^= state << 13;
                    state ^= state >> 7;
                    state ^= state << 17;
                    (state >> 40) as f64 / f64::from(1 << 23) - 1.0
                })
            }
        }
    }
}

fn fill(size: u32, mut distance: impl FnMut([f64; 3]) -> f64) -> Vec<f32> {
    let axis = || (0..size).map(f64::from);
    axis().flat_map(|z| axis().flat_map(move |y| axis().map(move |x| [x, y, z]))).map(|p| distance(p) as f32).collect()
}

fn fill_plane(size: u32, height: impl Fn(f64, f64) -> f64) -> Vec<f64> {
    let axis = || (0..size).map(f64::from);
    axis().flat_map(|y| axis().map(move |x| [x, y])).map(|[x, y]| height(x, y)).collect()
}
