//! Shapes: distances, regions and constructors.

use super::*;

/// The distance by the textbook formula, in units.
fn distance_oracle(shape: &QuantisedShape, point: [i32; 3]) -> f64 {
    let from = |p: [i64; 3]| [0, 1, 2].map(|i| f64::from(point[i]) * 256.0 - p[i] as f64);
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let length = |a: [f64; 3]| dot(a, a).sqrt();
    match *shape {
        QuantisedShape::Sphere { center, radius } => length(from(center)) - f64::from(radius),
        QuantisedShape::Box { center, half_size } => {
            let offset = from(center);
            let q = [0, 1, 2].map(|i| offset[i].abs() - f64::from(half_size[i]));
            length(q.map(|v| v.max(0.0))) + q[0].max(q[1]).max(q[2]).min(0.0)
        }
        QuantisedShape::Capsule { a, b, radius } => {
            let (from_a, along) = (from(a), [0, 1, 2].map(|i| (b[i] - a[i]) as f64));
            let t = if a == b { 0.0 } else { (dot(from_a, along) / dot(along, along)).clamp(0.0, 1.0) };
            length([0, 1, 2].map(|i| from_a[i] - along[i] * t)) - f64::from(radius)
        }
    }
}

proptest! {
    #[test]
    fn distances_equal_the_textbook_formulas(shape in small_shape(), point in prop::array::uniform3(-60i32..60)) {
        let (found, exact) = (f64::from(shape.distance(point)), distance_oracle(&shape, point));
        prop_assert!((found - exact).abs() <= 1.0, "{found}, not {exact}");
        prop_assert!(exact.abs() < 1e-6 || (found < 0.0) == (exact < 0.0), "{found}, not {exact}");
    }

    #[test]
    fn far_distances_equal_the_textbook_formulas_or_saturate(
        center in prop::array::uniform3(-(1i64 << 38)..1 << 38),
        length in prop::array::uniform3(-(1i64 << 19)..1 << 19),
        radius in 1u32..1 << 18,
        points in prop::array::uniform2(prop::array::uniform3(any::<i32>())),
        step in prop::array::uniform3(-100_000i32..100_000),
    ) {
        let near = [0, 1, 2].map(|i| (center[i] / 256) as i32 + step[i]);
        let b = [0, 1, 2].map(|i| (center[i] + length[i]).clamp(-(1 << 38), 1 << 38));
        for shape in [
            QuantisedShape::Sphere { center, radius },
            QuantisedShape::Box { center, half_size: [radius, 100, radius] },
            QuantisedShape::Capsule { a: center, b, radius },
        ] {
            for point in [near, points[0], points[1]] {
                let (found, exact) = (f64::from(shape.distance(point)), distance_oracle(&shape, point));
                prop_assert!((found - exact.min(f64::from(1 << 30))).abs() <= 1.01, "{shape:?} {point:?}: {found}, not {exact}");
            }
        }
    }

    #[test]
    fn clamped_distances_are_distances_clamped(
        shape in small_shape(), point in prop::array::uniform3(-60i32..60), low in -3000i32..=0, high in 0i32..3000,
    ) {
        prop_assert_eq!(shape.distance_within(point, low, high), shape.distance(point).clamp(low, high));
    }

    #[test]
    fn regions_hold_exactly_the_points_near_enough(shape in small_shape(), margin in 0u32..6) {
        let region = shape.region(margin);
        let mut near = Edit::NONE.region;
        for point in region.grown(2, 2).points() {
            if shape.distance(point) < margin as i32 * 256 {
                prop_assert!(region.contains(point), "{point:?} is near, but outside of {region:?}");
                near = near.union(&Region::new(point, point.map(|v| v + 1)));
            }
        }
        if let QuantisedShape::Box { .. } = shape && margin == 0 && !near.is_empty() {
            prop_assert_eq!(near, region);
        }
    }
}

#[test]
fn constructors_round_to_the_nearest_step() {
    let shape = QuantisedShape::capsule([0.5, -0.5, 1.0 / 300.0], [-1.0 / 600.0, 7.0, 0.0], 1e-9).unwrap();
    assert_eq!(shape, QuantisedShape::Capsule { a: [128, -128, 1], b: [0, 1792, 0], radius: 1 });
    let stroke = QuantisedStroke::new(7, 1.5, 0.0, Duration::from_nanos(1999), Duration::MAX).unwrap();
    assert_eq!(stroke, QuantisedStroke { id: 7, rate: 384, falloff: 0, start_us: 1, end_us: u64::MAX });
}

#[test]
fn constructors_refuse_bad_numbers_in_a_sentence() {
    let origin = [0.0; 3];
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0, -0.0, -1.0, 1024.1] {
        assert!(matches!(QuantisedShape::sphere(origin, bad), Err(BrushError::Size { name: "radius", .. })), "{bad}");
        assert!(matches!(QuantisedShape::capsule(origin, origin, bad), Err(BrushError::Size { name: "radius", .. })));
        let found = QuantisedShape::cuboid(origin, [1.0, bad, 1.0]);
        assert!(matches!(found, Err(BrushError::Size { name: "half size", .. })));
    }
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1.1e9, -1.1e9] {
        for position in [[bad, 0.0, 0.0], [0.0, 0.0, bad]] {
            assert!(matches!(QuantisedShape::sphere(position, 1.0), Err(BrushError::Position { .. })), "{bad}");
            assert!(matches!(QuantisedShape::cuboid(position, [1.0; 3]), Err(BrushError::Position { .. })));
            assert!(matches!(QuantisedShape::capsule(origin, position, 1.0), Err(BrushError::Position { .. })));
        }
    }
    for bad in [f64::NAN, f64::INFINITY, -1.0, 70_000.0] {
        let (start, end) = (Duration::ZERO, Duration::from_secs(1));
        assert!(matches!(QuantisedStroke::new(0, bad, 1.0, start, end), Err(BrushError::Rate { .. })), "{bad}");
        assert!(matches!(QuantisedStroke::new(0, 1.0, bad, start, end), Err(BrushError::Falloff { .. })), "{bad}");
        assert!(matches!(QuantisedStroke::new(0, 1.0, 1.0, end, start), Err(BrushError::Time { .. })));
    }
    let far = QuantisedShape::capsule(origin, [0.0, 0.0, 2049.0], 1.0).unwrap_err();
    assert_eq!(far, BrushError::Length { found: 2049.0 });
    assert_eq!(
        QuantisedShape::sphere(origin, f64::NAN).unwrap_err().to_string(),
        "a brush's radius must be above 0 and at most 1024 voxels, but it is NaN"
    );
    assert_eq!(
        QuantisedShape::sphere([f64::INFINITY; 3], 1.0).unwrap_err().to_string(),
        "a brush's coordinates must lie within ±1073741824 voxels of the origin, but one is inf"
    );
}
