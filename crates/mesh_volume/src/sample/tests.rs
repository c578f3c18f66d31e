//! No sample changes sides, for any isovalue.

use marchless::Weight as _;
use proptest::prelude::*;

use super::Sample;

/// Asserts that a weight lies below the weights' isovalue if and only if the sample lies below `iso`.
fn assert_same_side<S: Sample>(bytes: &[u8], sample: f64, iso: f64) {
    assert_side::<S>(bytes, sample < iso, iso);
}

/// Asserts that a weight lies below the weights' isovalue if and only if `is_below` is true.
fn assert_side<S: Sample>(bytes: &[u8], is_below: bool, iso: f64) {
    let mut weights = Vec::new();
    S::decode(bytes, iso, &mut weights);
    let isovalue = S::isovalue(iso);
    assert!(isovalue.is_finite() && weights.len() == 1);
    assert_eq!(weights[0].to_voxels() < isovalue, is_below, "{bytes:?} at {iso:e} became {:?}", weights[0]);
}

/// Any isovalue, often one close to the sample.
fn isovalue(sample: f64) -> impl Strategy<Value = f64> {
    let finite = |iso: &f64| iso.is_finite();
    prop_oneof![
        Just(sample),
        (-2.0..2.0).prop_map(move |step: f64| sample + step),
        any::<i8>().prop_map(move |step| sample + f64::from(step) * 1e-11),
        Just(sample.next_up()),
        Just(sample.next_down()),
        any::<f64>(),
        -70000.0..70000.0f64,
    ]
    .prop_map(move |iso| if finite(&iso) { iso } else { 0.0 })
}

proptest! {
    #[test]
    fn bytes_keep_their_side((sample, iso) in any::<i8>().prop_flat_map(|v| (Just(v), isovalue(v.into())))) {
        assert_same_side::<i8>(&sample.to_le_bytes(), sample.into(), iso);
        let unsigned = sample.cast_unsigned();
        assert_same_side::<u8>(&[unsigned], unsigned.into(), iso);
        assert_same_side::<u8>(&[unsigned], unsigned.into(), iso + 256.0);
    }

    #[test]
    fn words_keep_their_side((sample, iso) in any::<i16>().prop_flat_map(|v| (Just(v), isovalue(v.into())))) {
        assert_same_side::<i16>(&sample.to_le_bytes(), sample.into(), iso);
        let unsigned = sample.cast_unsigned();
        assert_same_side::<u16>(&unsigned.to_le_bytes(), unsigned.into(), iso);
        assert_same_side::<u16>(&unsigned.to_le_bytes(), unsigned.into(), iso + 65536.0);
    }

    #[test]
    fn long_integers_keep_their_side((sample, iso) in any::<i32>().prop_flat_map(|v| (Just(v), isovalue(v.into())))) {
        assert_same_side::<i32>(&sample.to_le_bytes(), sample.into(), iso);
        let unsigned = sample.cast_unsigned();
        assert_same_side::<u32>(&unsigned.to_le_bytes(), unsigned.into(), iso);
        assert_same_side::<u32>(&unsigned.to_le_bytes(), unsigned.into(), iso + 4294967296.0);
    }

    #[test]
    fn very_long_integers_keep_their_side(
        (sample, iso) in any::<i64>().prop_flat_map(|v: i64| (Just(v), isovalue(v as f64))),
        bits in 0..64u32,
    ) {
        // A whole number lies below `iso` if and only if it lies below the next whole number above `iso`.
        let is_below = |sample: i128, iso: f64| sample < iso.ceil() as i128;
        let unsigned = sample.cast_unsigned();
        for iso in [iso, iso + 18446744073709551616.0] {
            assert_side::<i64>(&sample.to_le_bytes(), is_below(sample.into(), iso), iso);
            assert_side::<u64>(&unsigned.to_le_bytes(), is_below(unsigned.into(), iso), iso);
        }
        // Small ones and those beside the isovalue, too.
        let iso = (sample >> bits) as f64 + iso.fract();
        for sample in [-1, 0, 1].map(|step| (sample >> bits).saturating_add(step)) {
            assert_side::<i64>(&sample.to_le_bytes(), is_below(sample.into(), iso), iso);
        }
    }

    #[test]
    fn truths_keep_their_side(byte: u8, iso in isovalue(1.0)) {
        assert_same_side::<bool>(&[byte], f64::from(u8::from(byte != 0)), iso);
        assert_same_side::<bool>(&[byte], f64::from(u8::from(byte != 0)), iso - 1.0);
    }

    #[test]
    fn floats_keep_their_side(
        (sample, iso) in proptest::num::f32::ANY.prop_flat_map(|v| (Just(v), isovalue(v.into()))),
    ) {
        assert_same_side::<f32>(&sample.to_le_bytes(), sample.into(), iso);
    }

    #[test]
    fn doubles_keep_their_side((sample, iso) in proptest::num::f64::ANY.prop_flat_map(|v| (Just(v), isovalue(v)))) {
        assert_same_side::<f64>(&sample.to_le_bytes(), sample, iso);
    }
}
