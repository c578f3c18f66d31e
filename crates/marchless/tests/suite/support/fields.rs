//! Random fields for property tests: shapes, weights, isovalues and padding of all kinds.

use marchless::{Samples, Shape, Weight};
use proptest::{collection::vec, prelude::*, sample::select};

/// Samples to be meshed, and how.
#[derive(Clone, Debug)]
pub(crate) struct Field<W> {
    pub(crate) shape: Shape,
    /// A boxed slice of exactly their length, so that a sanitizer sees a read past the last one.
    pub(crate) weights: Box<[W]>,
    pub(crate) materials: Box<[u8]>,
    pub(crate) padded: bool,
    pub(crate) isovalue: f32,
}

impl<W: TestWeight> Field<W> {
    /// Any field: white noise of a few or of all weights, sparse or dense; or layers of slabs that are all inside or
    /// all outside, except for about one sample.
    pub(crate) fn any() -> impl Strategy<Value = Self> {
        (sizes(), any::<bool>(), 0..5usize).prop_flat_map(|(size, padded, kind)| {
            let shape = Shape::new(size.map(|n| n + 2 * u32::from(padded))).expect("the sizes are small");
            let weight = match kind {
                0 => select(W::NEAR_ZERO).boxed(),
                1 => prop_oneof![9 => Just(W::OUTSIDE), 1 => select(W::NEAR_ZERO)].boxed(),
                2 => prop_oneof![3 => W::all(), 1 => select(W::EXTREMES)].boxed(),
                _ => prop_oneof![9 => select(W::NEAR_ZERO), 1 => select(W::EXTREMES)].boxed(),
            };
            let isovalue = prop_oneof![
                Just(0.0f32),
                select(W::NEAR_ZERO).prop_map(W::to_voxels),
                -2.0f32..2.0,
                W::all().prop_map(W::to_voxels),
                select(vec![f32::MIN, f32::MAX, 1e-40]),
            ];
            let len = shape.len();
            let layers = (vec(0..10u8, shape.size()[2] as usize), vec((0..len, select(W::NEAR_ZERO)), 0..4));
            (vec(weight, len), layers, vec(0..4u8, len), isovalue).prop_map(
                move |(mut weights, (turns, exceptions), materials, isovalue)| {
                    if kind == 4 {
                        layer(&mut weights, shape, &turns);
                        exceptions.into_iter().for_each(|(index, weight)| weights[index] = weight);
                    }
                    let isovalue = if isovalue.is_finite() { isovalue } else { 0.0 };
                    Self { shape, weights: weights.into(), materials: materials.into(), padded, isovalue }
                },
            )
        })
    }

    pub(crate) fn samples(&self) -> Samples<'_, W> {
        let samples = Samples::new(self.shape, &self.weights).expect("one weight a sample");
        let samples = samples.with_materials(&self.materials).expect("one material a sample");
        if self.padded { samples.padded() } else { samples }
    }

    /// Meshed samples per axis.
    pub(crate) fn meshed_size(&self) -> [u32; 3] {
        self.shape.size().map(|n| n - 2 * u32::from(self.padded))
    }
}

/// Fills each slab with one weight, mostly that of the slab below.
fn layer<W: Weight>(weights: &mut [W], shape: Shape, turns: &[u8]) {
    let mut weight = W::OUTSIDE;
    for (slab, &turn) in weights.chunks_mut(shape.strides()[2]).zip(turns) {
        if turn >= 7 {
            weight = if weight == W::OUTSIDE { W::INSIDE } else { W::OUTSIDE };
        }
        slab.fill(weight);
    }
}

/// Meshed samples per axis: rows of less than a word, of about half a word, a word and two, the other axes short.
fn sizes() -> impl Strategy<Value = [u32; 3]> {
    let row = prop_oneof![4 => 2..8u32, 1 => 30..40u32, 1 => 62..68u32, 1 => 126..131u32];
    let any = (row, 2..6u32, 2..6u32, 0..3usize).prop_map(|(long, a, b, turn)| {
        let mut size = [long, a, b];
        size.rotate_right(turn);
        size
    });
    // Words of rows beyond a block of 64.
    let broad = (126..131u32, 24..30u32, 2..4u32).prop_map(|(x, y, z)| [x, y, z]);
    prop_oneof![12 => any, 1 => broad]
}

/// Weights worth testing.
pub(crate) trait TestWeight: Weight {
    /// A few weights of both signs, some of them equal to an isovalue.
    const NEAR_ZERO: &'static [Self];
    const EXTREMES: &'static [Self];
    fn all() -> BoxedStrategy<Self>;
}

impl TestWeight for i8 {
    const NEAR_ZERO: &'static [Self] = &[-40, -2, -1, 0, 1, 2, 40];
    const EXTREMES: &'static [Self] = &[Self::MIN, Self::MAX];

    fn all() -> BoxedStrategy<Self> {
        any::<Self>().boxed()
    }
}

impl TestWeight for i16 {
    const NEAR_ZERO: &'static [Self] = &[-300, -2, -1, 0, 1, 2, 300];
    const EXTREMES: &'static [Self] = &[Self::MIN, Self::MAX];

    fn all() -> BoxedStrategy<Self> {
        any::<Self>().boxed()
    }
}

impl TestWeight for f32 {
    const NEAR_ZERO: &'static [Self] = &[-1.5, -0.5, -0.0, 0.0, 0.25, 1.0];
    const EXTREMES: &'static [Self] =
        &[Self::NAN, Self::INFINITY, Self::NEG_INFINITY, Self::MIN, Self::MAX, 1e-42, -1e-42, 1e20, -1e20];

    fn all() -> BoxedStrategy<Self> {
        proptest::num::f32::ANY.boxed()
    }
}
