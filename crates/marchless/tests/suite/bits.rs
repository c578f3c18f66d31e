//! Constructors of grids of bits, and getting and setting single bits.

use marchless::{
    Samples, Shape, Weight,
    bits::{BitGrid, BitsError},
};
use proptest::prelude::*;

use crate::support::{points, random};

/// Sizes around those of words and of vector registers.
const SIZES: [u32; 12] = [1, 2, 31, 32, 33, 63, 64, 65, 127, 130, 250, 600];

fn shapes() -> impl Strategy<Value = Shape> {
    (proptest::sample::select(&SIZES[..]), 1..5u32, 1..5u32, 0..3usize).prop_map(|(long, a, b, turn)| {
        let mut size = [long, a, b];
        size.rotate_right(turn);
        Shape::new(size).expect("no size is 0")
    })
}

fn same_as_samples<W: Weight + PartialOrd>(shape: Shape, seed: u64, weight: impl Fn(u64) -> W, padded: bool) {
    let weights: Vec<W> = points(shape.size()).map(|point| weight(random(seed, point))).collect();
    let mut samples = Samples::new(shape, &weights).expect("as many as points");
    let mut origin = 0;
    if padded {
        (samples, origin) = (samples.padded(), 1);
    }
    let grid = BitGrid::from_samples(samples, 0.0).expect("it is small");
    for point in points(grid.shape().size()) {
        let weight = weights[shape.index(point.map(|v| v + origin))];
        assert_eq!(grid.get(point), weight < W::from_voxels(0.0), "at {point:?}");
    }
}

proptest! {
    #[test]
    fn bits_are_the_signs_of_samples(shape in shapes(), seed: u64) {
        for padded in [false, true] {
            if !padded || shape.size().iter().all(|&size| size > 2) {
                same_as_samples(shape, seed, |coin| coin as i8, padded);
                same_as_samples(shape, seed, |coin| coin as i16, padded);
                same_as_samples(shape, seed, |coin| if coin & 7 == 0 { f32::NAN } else { (coin as i32) as f32 }, padded);
            }
        }
    }

    #[test]
    fn set_bits_are_found_again(shape in shapes(), seed: u64) {
        let is_set = |point| random(seed, point) & 1 == 1;
        let grid = BitGrid::from_fn(shape, is_set).unwrap();
        let expected: Vec<_> = points(shape.size()).filter(|&point| is_set(point)).collect();
        prop_assert_eq!(grid.count(), expected.len());
        prop_assert!(grid.iter().eq(expected.iter().copied()));
        prop_assert!(points(shape.size()).all(|point| grid.get(point) == is_set(point)));
        let mut built = BitGrid::new(shape).unwrap();
        prop_assert!(built.is_empty());
        let mut cleared = BitGrid::filled(shape, true).unwrap();
        prop_assert_eq!(cleared.count(), shape.len());
        for point in points(shape.size()) {
            if is_set(point) {
                built.set(point, true).unwrap();
            } else {
                cleared.set(point, false).unwrap();
            }
        }
        prop_assert!(built == grid && cleared == grid);
    }
}

#[test]
fn invalid_arguments_are_typed_errors() {
    let huge = Shape::new([1, u32::MAX, 1 << 28]).unwrap();
    assert_eq!(BitGrid::new(huge), Err(BitsError::TooLarge { shape: huge }));
    let shape = Shape::new([3, 4, 5]).unwrap();
    let mut grid = BitGrid::new(shape).unwrap();
    for position in [[3, 0, 0], [0, 4, 0], [0, 0, 5], [u32::MAX; 3]] {
        assert!(!grid.get(position));
        assert_eq!(grid.set(position, true), Err(BitsError::OutOfRange { position, shape }));
    }
    assert!(grid.is_empty());
    let weights = [0i8; 60];
    let samples = Samples::new(shape, &weights).unwrap();
    assert_eq!(BitGrid::from_samples(samples.padded(), 0.0).unwrap().shape(), Shape::new([1, 2, 3]).unwrap());
    for isovalue in [f32::NAN, f32::INFINITY] {
        let error = BitGrid::from_samples(samples, isovalue).unwrap_err();
        assert!(matches!(error, BitsError::IsovalueNotFinite { .. }), "{error}");
    }
    let shape = Shape::new([2, 5, 6]).unwrap();
    let samples = Samples::new(shape, &weights).unwrap().padded();
    assert_eq!(BitGrid::from_samples(samples, 0.0), Err(BitsError::OnlyPadding { shape }));
}
