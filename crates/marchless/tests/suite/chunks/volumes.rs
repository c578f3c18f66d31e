//! Endless random volumes from which any box can be cut: a sample depends on its position and a seed only.

use marchless::{Samples, Shape, Weight};
use proptest::{prelude::*, sample::select};

use crate::support::random;

/// The kind of the samples.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Kind {
    /// Random signs, uniform magnitudes.
    Signs,
    /// Waves of a few voxels' length.
    Smooth,
    /// One step inside or outside.
    Ones,
    /// One step inside, one outside, or equal to the isovalue.
    Ties,
    /// Any magnitude that the type of weights has.
    Magnitudes,
    /// Not finite, or next to such samples.
    NotFinite,
}

/// A box of cells in a random volume.
#[derive(Clone, Debug)]
pub(crate) struct Volume {
    pub(crate) kind: Kind,
    pub(crate) seed: u64,
    /// Cells per axis: 2 to 32.
    pub(crate) cells: [u32; 3],
    /// True if the samples at the border of the box and beyond are air.
    pub(crate) enclosed: bool,
    /// In voxels.
    pub(crate) isovalue: f32,
}

impl Volume {
    pub(crate) fn any() -> impl Strategy<Value = Self> {
        let kinds = [Kind::Signs, Kind::Smooth, Kind::Ones, Kind::Ties, Kind::Magnitudes, Kind::NotFinite];
        let cells = || prop_oneof![12 => 2..=9u32, 3 => 10..=16u32, 1 => 17..=32u32];
        // Multiples of the steps of all weights.
        let isovalue = prop_oneof![3 => Just(0.0f32), 1 => select(vec![0.5f32, -1.25, 2.0])];
        (select(kinds.to_vec()), any::<u64>(), [cells(), cells(), cells()], any::<bool>(), isovalue)
            .prop_map(|(kind, seed, cells, enclosed, isovalue)| Self { kind, seed, cells, enclosed, isovalue })
    }

    fn weight<W: VolumeWeight>(&self, point: [i32; 3]) -> W {
        let within = |axis: usize| point[axis] > 0 && point[axis] < self.cells[axis] as i32;
        if self.enclosed && !(0..3).all(within) {
            return W::OUTSIDE;
        }
        let bits = random(self.seed, point);
        let sign = if bits >> 63 == 1 { -1.0 } else { 1.0 };
        let step = 1.0 / W::SCALE;
        match self.kind {
            Kind::Signs => W::from_voxels(self.isovalue + sign * ((bits & 0xffff) as f32 + 0.5) / 65536.0),
            Kind::Smooth => {
                let wave = |axis: usize| {
                    let phase = (self.seed >> (8 * axis) & 255) as f32;
                    (point[axis] as f32 * (0.3 + phase / 256.0) + phase).sin()
                };
                W::from_voxels(self.isovalue + wave(0) + wave(1) * wave(2) + 0.5 * wave(2))
            }
            Kind::Ones => W::from_voxels(self.isovalue + sign * step),
            Kind::Ties => W::from_voxels(self.isovalue + (bits % 3) as f32 * step - step),
            Kind::Magnitudes => W::of_any_magnitude(bits),
            Kind::NotFinite => W::extreme(bits),
        }
    }

    /// The samples from `min` up to, but without, `max`.
    pub(crate) fn cut<W: VolumeWeight>(&self, min: [i32; 3], max: [i32; 3]) -> Cut<W> {
        let points = marchless::Region::new(min, max);
        let shape = Shape::new(points.size()).expect("a small shape");
        let weights = points.points().map(|point| self.weight(point)).collect();
        let materials = points.points().map(|point| (random(self.seed, point) >> 20) as u8).collect();
        Cut { shape, weights, materials }
    }
}

/// Samples of a box.
pub(crate) struct Cut<W> {
    shape: Shape,
    weights: Vec<W>,
    materials: Vec<u8>,
}

impl<W> Cut<W> {
    pub(crate) fn samples(&self) -> Samples<'_, W> {
        let samples = Samples::new(self.shape, &self.weights).expect("one weight a sample");
        samples.with_materials(&self.materials).expect("one material a sample")
    }
}

/// Weights that volumes are made of.
pub(crate) trait VolumeWeight: Weight {
    fn of_any_magnitude(bits: u64) -> Self;
    /// The extreme weights of the type, and values between them.
    fn extreme(bits: u64) -> Self;
}

macro_rules! integer {
    ($type:ty) => {
        impl VolumeWeight for $type {
            fn of_any_magnitude(bits: u64) -> Self {
                (bits >> 32) as $type >> (bits % 8)
            }

            fn extreme(bits: u64) -> Self {
                [<$type>::MIN, <$type>::MAX, -1, 0, (bits >> 32) as $type][(bits % 5) as usize]
            }
        }
    };
}

integer!(i8);
integer!(i16);

impl VolumeWeight for f32 {
    /// 1e-40 to 3e38.
    fn of_any_magnitude(bits: u64) -> Self {
        let magnitude = Self::from_bits(71_362 + (bits >> 32) as u32 % (0x7f61_b1e6 - 71_362));
        if bits & 1 == 1 { -magnitude } else { magnitude }
    }

    fn extreme(bits: u64) -> Self {
        let extremes = [Self::NAN, Self::INFINITY, Self::NEG_INFINITY, Self::MAX, Self::MIN, -0.0, 0.0, -1e-45];
        let ordinary = (bits >> 40) as Self / (1 << 23) as Self - 1.0;
        extremes.get((bits % 16) as usize).copied().unwrap_or(ordinary)
    }
}
