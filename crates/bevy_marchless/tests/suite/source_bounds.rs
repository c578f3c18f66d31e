//! The guarantees of all sources: bounds are true, and samples depend only on their position.

use bevy_marchless::source::{
    Air, Bound, Fractal, HeightMap, HeightMapSettings, NoiseDensity, NoiseDensitySettings, NoiseHeights,
    NoiseHeightsSettings, Sdf, Source, SourceError, SourceRegion, Stratum,
};
use bevy_math::{DVec2, DVec3};
use proptest::prelude::*;

fn filled(source: &dyn Source, region: &SourceRegion) -> (Vec<f32>, Vec<u8>) {
    let (mut distances, mut materials) = (vec![f32::NAN; region.len()], vec![0; region.len()]);
    source.fill(region, &mut distances, &mut materials);
    (distances, materials)
}

fn region() -> impl Strategy<Value = SourceRegion> {
    let min = [-40..40, -20..90, -40..40]
        .map(|range| prop::num::i32::ANY.prop_map(move |v| range.start + v.rem_euclid(range.end - range.start)));
    (min, [1u32..12, 1..12, 1..12], 0u8..8, prop_oneof![Just(1.0), Just(0.3), Just(2.5)])
        .prop_map(|(min, size, level, spacing)| SourceRegion { min, size, level, spacing })
}

fn fractal() -> impl Strategy<Value = Fractal> {
    (any::<u32>(), 1u32..6, 0.5..80.0, 0.1..=1.0, 1.0..3.0, any::<bool>()).prop_map(
        |(seed, octaves, zoom, persistence, lacunarity, ridged)| Fractal {
            seed,
            octaves,
            zoom,
            persistence,
            lacunarity,
            ridged,
        },
    )
}

fn strata() -> impl Strategy<Value = Vec<Stratum>> {
    let one =
        (0u8..3, 0.0..20.0, -20.0..60.0, 0.0..2.0).prop_map(|(material, below_depth, above_height, steeper_than)| {
            Stratum { material, below_depth, above_height, steeper_than }
        });
    prop::collection::vec(one, 0..4)
}

fn hills() -> impl Strategy<Value = NoiseHeightsSettings> {
    (fractal(), -10.0..60.0, 0.0..30.0, strata()).prop_map(|(noise, base, amplitude, strata)| NoiseHeightsSettings {
        noise,
        base,
        amplitude,
        strata,
    })
}

fn caves() -> impl Strategy<Value = NoiseDensitySettings> {
    (fractal(), -1.0..=1.0, prop::option::of(hills()), strata())
        .prop_map(|(noise, threshold, ground, strata)| NoiseDensitySettings { noise, threshold, ground, strata })
}

fn height_map() -> impl Strategy<Value = HeightMap> {
    ([1u32..9, 1..9], prop::collection::vec(any::<u16>(), 64), 0.2..40.0, 0.2..40.0, 0.0..30.0, strata()).prop_map(
        |(size, mut samples, along_x, along_z, floor, strata)| {
            samples.truncate((size[0] * size[1]) as usize);
            let metres_per_pixel = DVec2::new(along_x, along_z);
            let settings = HeightMapSettings {
                metres_per_pixel,
                metres_per_unit: 0.001,
                exaggeration: 1.0,
                floor: Some(floor),
                strata,
            };
            HeightMap::from_samples(size, samples, settings).expect("the settings are in range")
        },
    )
}

fn shape() -> impl Strategy<Value = Sdf> {
    let point = || [-40.0..40.0, -20.0..90.0, -40.0..40.0].prop_map(DVec3::from);
    let normal = [-1.0..1.0, 0.1..1.0, -1.0..1.0].prop_map(DVec3::from);
    let single = prop_oneof![
        (point(), 1.0..40.0).prop_map(|(center, radius)| Sdf::sphere(center, radius)),
        (point(), [1.0..40.0, 1.0..40.0, 1.0..40.0]).prop_map(|(center, half)| Sdf::cuboid(center, half)),
        (point(), point(), 1.0..20.0).prop_map(|(a, b, radius)| Sdf::capsule(a, b, radius)),
        (point(), 1.0..40.0, 1.0..20.0).prop_map(|(center, major, minor)| Sdf::torus(center, major, minor)),
        (point(), normal).prop_map(|(point, normal)| Sdf::half_space(point, normal)),
    ];
    let leaf = (single, 0u8..3).prop_map(|(shape, material)| shape.with_material(material));
    leaf.prop_recursive(4, 24, 2, |inner| {
        (inner.clone(), inner, 0..4, 0.1..20.0).prop_map(|(a, b, operation, radius)| match operation {
            0 => a.union(b),
            1 => a.smooth_union(b, radius),
            2 => a.intersection(b),
            _ => a.subtraction(b),
        })
    })
}

/// A certain bound agrees with sampling, and points sampled alone equal those of the whole region.
fn check(source: &dyn Source, region: &SourceRegion) -> Result<(), TestCaseError> {
    let (distances, materials) = filled(source, region);
    match source.bound(region) {
        Bound::Mixed => {}
        Bound::Outside => prop_assert!(distances.iter().all(|d| *d >= 0.0)),
        Bound::Inside { material } => {
            prop_assert!(distances.iter().all(|d| *d < 0.0));
            prop_assert!(materials.iter().all(|m| *m == material), "{:?} are not all {}", materials, material);
        }
    }
    let shape = region.shape().expect("it has points");
    for index in [[0; 3], region.size.map(|size| size / 2), region.size.map(|size| size - 1)] {
        let min = [0, 1, 2].map(|axis| region.min[axis] + index[axis] as i32);
        let alone = filled(source, &SourceRegion { min, size: [1; 3], ..*region });
        let index = shape.index(index);
        prop_assert_eq!(alone, (vec![distances[index]], vec![materials[index]]));
    }
    Ok(())
}

proptest! {
    #[test]
    fn hills_keep_their_bounds(settings in hills(), region in region()) {
        check(&NoiseHeights::new(settings).expect("in range"), &region)?;
    }

    #[test]
    fn caves_keep_their_bounds(settings in caves(), region in region()) {
        check(&NoiseDensity::new(settings).expect("in range"), &region)?;
    }

    #[test]
    fn height_maps_keep_their_bounds(map in height_map(), region in region()) {
        check(&map, &region)?;
    }

    #[test]
    fn shapes_keep_their_bounds(shape in shape(), region in region()) {
        check(&shape, &region)?;
    }

    #[test]
    fn distances_to_shapes_change_no_faster_than_the_position(
        shape in shape(),
        a in [-60.0..60.0, -60.0..60.0, -60.0..60.0].prop_map(DVec3::from),
        step in [-9.0..9.0, -9.0..9.0, -9.0..9.0].prop_map(DVec3::from),
    ) {
        let change = (shape.sample(a).0 - shape.sample(a + step).0).abs();
        prop_assert!(change <= step.length() + 1e-9, "{} over {}", change, step.length());
    }

    #[test]
    fn unvalidated_shapes_never_panic(
        mut numbers in [any::<f64>(), any::<f64>(), any::<f64>(), any::<f64>()],
        weird in prop::sample::select(vec![f64::NAN, f64::INFINITY, -1.0, 0.0, f64::MAX]),
        which in 0usize..4,
        region in region(),
    ) {
        numbers[which] = weird;
        let [x, y, z, r] = numbers;
        let scene = Sdf::sphere([x, y, z], r)
            .smooth_union(Sdf::torus([z, x, y], r, x), r)
            .union(Sdf::cuboid([x, y, z], [r, x, y]))
            .union(Sdf::half_space([x, y, z], [r, r, x]))
            .subtraction(Sdf::capsule([x, y, z], [z, y, x], r));
        check(&scene, &region)?;
        let scene = scene.intersection(Sdf::sphere([0.0; 3], 1e6));
        check(&scene, &region)?;
    }
}

/// Bounds that always say "mixed" would pass the tests above.
#[test]
fn far_regions_are_skipped() {
    let at = |y: i32| SourceRegion { min: [0, y, 0], size: [36; 3], level: 0, spacing: 1.0 };
    let hills = NoiseHeights::default();
    assert_eq!(hills.bound(&at(113)), Bound::Outside);
    assert_eq!(hills.bound(&at(60)), Bound::Mixed);
    assert_eq!(hills.bound(&at(-70)), Bound::Inside { material: 2 });
    assert_eq!(hills.bound_closely(&at(-40)), Bound::Inside { material: 2 });
    let ground = Some(NoiseHeightsSettings::default());
    let caves = NoiseDensity::new(NoiseDensitySettings { ground, ..Default::default() }).expect("in range");
    assert_eq!(caves.bound(&at(113)), Bound::Outside);
    assert_eq!(caves.bound(&at(0)), Bound::Mixed);
    let settings = HeightMapSettings { floor: Some(60.0), ..Default::default() };
    let map = HeightMap::from_samples([64, 64], (0..4096u16).map(|v| v % 20).collect(), settings).expect("in range");
    assert_eq!(map.bound(&at(96)), Bound::Outside);
    assert_eq!(map.bound(&at(40)), Bound::Mixed);
    assert_eq!(map.bound(&at(0)), Bound::Inside { material: 0 });
    let shapes = Sdf::sphere([18.0, 0.0, 18.0], 90.0).with_material(1).union(Sdf::sphere([18.0, 150.0, 18.0], 2.0));
    assert_eq!(shapes.bound(&at(-18)), Bound::Inside { material: 1 });
    assert_eq!(shapes.bound(&at(70)), Bound::Mixed);
    assert_eq!(shapes.bound(&at(200)), Bound::Outside);
    assert_eq!(Air.bound(&at(0)), Bound::Outside);
    assert!(filled(&Air, &at(0)).0.iter().all(|d| *d > 0.0));
}

/// The distance to the nearest point of the hills' surface, found by brute force, is about that of the samples.
#[test]
fn distances_to_hills_are_nearly_true() {
    let noise = Fractal { zoom: 50.0, octaves: 4, ..Fractal::default() };
    let hills = NoiseHeights::new(NoiseHeightsSettings { noise, ..Default::default() }).expect("in range");
    let mut checked = 0;
    for x in (0..40).step_by(2) {
        let height = hills.height(f64::from(x), 7.0);
        let around: Vec<DVec3> = (-60..=60)
            .flat_map(|dx| (-60..=60).map(move |dz| [f64::from(dx) * 0.1, f64::from(dz) * 0.1]))
            .map(|[dx, dz]| DVec3::new(dx, hills.height(f64::from(x) + dx, 7.0 + dz), dz))
            .collect();
        for y in (height as i32 - 3)..(height as i32 + 4) {
            let region = SourceRegion { min: [x, y, 7], size: [1; 3], level: 0, spacing: 1.0 };
            let distance = f64::from(filled(&hills, &region).0[0]);
            let here = DVec3::new(0.0, f64::from(y), 0.0);
            let nearest = around.iter().map(|ground| ground.distance(here)).fold(f64::INFINITY, f64::min);
            if nearest < 1.5 {
                assert!((distance.abs() - nearest).abs() < 0.1 + 0.25 * nearest, "{distance} is {nearest}");
                checked += 1;
            }
        }
    }
    assert!(checked > 20, "only {checked} points lie near the surface");
}

/// Along the vertical through a cave's wall, distances grow by about one voxel per voxel times the wall's tilt.
#[test]
fn distances_to_caves_have_gradients_of_about_one() {
    let caves = NoiseDensity::default();
    let region = SourceRegion { min: [0; 3], size: [40; 3], level: 0, spacing: 1.0 };
    let (distances, materials) = filled(&caves, &region);
    let shape = region.shape().expect("it has points");
    let at = |index: [u32; 3]| f64::from(distances[shape.index(index)]);
    let mut lengths = Vec::new();
    for index in (1..39).flat_map(|z| (1..39).flat_map(move |y| (1..39).map(move |x| [x, y, z]))) {
        if at(index).abs() < 1.0 {
            let gradient = [0, 1, 2].map(|axis| {
                let [mut low, mut high] = [index; 2];
                low[axis] -= 1;
                high[axis] += 1;
                (at(high) - at(low)) / 2.0
            });
            lengths.push(DVec3::from(gradient).length());
        }
    }
    lengths.sort_by(f64::total_cmp);
    assert!(lengths.len() > 1000, "only {} samples lie near the surface", lengths.len());
    let [low, middle, high] = [5, 50, 95].map(|percent| lengths[lengths.len() * percent / 100]);
    assert!(low > 0.6 && (0.9..1.1).contains(&middle) && high < 1.5, "gradients of {low}, {middle}, {high}");
    assert!(materials.contains(&1) && materials.contains(&2));
}

#[test]
fn another_seed_is_another_world_and_the_same_seed_the_same() {
    let region = SourceRegion { min: [0, 40, 0], size: [16; 3], level: 0, spacing: 1.0 };
    let hills = |seed| filled(&NoiseHeights::from_seed(seed), &region);
    assert_eq!(hills(1), hills(1));
    assert_ne!(hills(1), hills(2));
}

/// Noise works far away, where an integer cannot hold positions of its lattice.
#[test]
fn noise_goes_on_far_away() {
    let noise = Fractal { octaves: 16, zoom: 1e-9, lacunarity: 8.0, ..Fractal::default() };
    let hills = NoiseHeights::new(NoiseHeightsSettings { noise, ..Default::default() }).expect("in range");
    for v in [i32::MIN, i32::MAX - 3] {
        let region = SourceRegion { min: [v; 3], size: [2; 3], level: 0, spacing: 1e9 };
        assert!(filled(&hills, &region).0.iter().all(|d| d.is_finite()));
        filled(&NoiseDensity::default(), &region);
    }
}

#[test]
fn settings_out_of_range_are_named() {
    let says = |noise: Fractal, message: &str| {
        let error = NoiseHeights::new(NoiseHeightsSettings { noise, ..Default::default() }).expect_err(message);
        assert_eq!(error.to_string(), message);
        assert!(NoiseDensity::new(NoiseDensitySettings { noise, ..Default::default() }).is_err());
    };
    let noise = Fractal::default();
    says(Fractal { octaves: 0, ..noise }, "the number of octaves must be from 1 to 16, but it is 0");
    says(Fractal { octaves: 17, ..noise }, "the number of octaves must be from 1 to 16, but it is 17");
    says(Fractal { zoom: f64::NAN, ..noise }, "zoom must be more than 0 and at most 1e9, but it is NaN");
    says(Fractal { zoom: 0.0, ..noise }, "zoom must be more than 0 and at most 1e9, but it is 0");
    says(Fractal { persistence: 0.0, ..noise }, "persistence must be more than 0 and at most 1, but it is 0");
    says(Fractal { lacunarity: 0.5, ..noise }, "lacunarity must be from 1 to 8, but it is 0.5");
    for (base, amplitude) in [(f64::INFINITY, 1.0), (0.0, -1.0), (0.0, f64::NAN)] {
        assert!(NoiseHeights::new(NoiseHeightsSettings { base, amplitude, ..Default::default() }).is_err());
    }
    assert!(NoiseDensity::new(NoiseDensitySettings { threshold: f64::NAN, ..Default::default() }).is_err());

    let error = Sdf::sphere([0.0; 3], 1.0).union(Sdf::sphere([0.0; 3], f64::NAN)).validate().expect_err("NaN");
    assert_eq!(error.to_string(), "a sphere's radius must be more than 0 and at most 1e9, but it is NaN");
    for shape in [
        Sdf::sphere([f64::NAN, 0.0, 0.0], 1.0),
        Sdf::cuboid([0.0; 3], [1.0, 0.0, 1.0]),
        Sdf::capsule([0.0; 3], [0.0, f64::INFINITY, 0.0], 1.0),
        Sdf::torus([0.0; 3], 5.0, -1.0),
        Sdf::half_space([0.0; 3], [0.0; 3]),
        Sdf::sphere([0.0; 3], 1.0).smooth_union(Sdf::sphere([0.0; 3], 2.0), 0.0),
    ] {
        assert!(matches!(shape.clone().validate(), Err(SourceError::Setting { .. })), "{shape:?}");
        let nested = Sdf::sphere([0.0; 3], 1.0).subtraction(Sdf::sphere([0.0; 3], 0.5).intersection(shape));
        assert!(nested.validate().is_err());
    }
}

#[test]
fn shapes_combine() {
    let ball = Sdf::sphere([0.0; 3], 10.0);
    let other = Sdf::sphere([10.0, 0.0, 0.0], 10.0).with_material(1);
    let at = |shape: &Sdf, x: f64| shape.sample(DVec3::new(x, 0.0, 0.0));
    let both = ball.clone().union(other.clone());
    assert_eq!([at(&both, -5.0), at(&both, 15.0), at(&both, 25.0)], [(-5.0, 0), (-5.0, 1), (5.0, 1)]);
    let common = ball.clone().intersection(other.clone());
    assert_eq!([at(&common, -5.0).0, at(&common, 5.0).0, at(&common, 15.0).0], [5.0, -5.0, 5.0]);
    let rest = ball.clone().subtraction(other.clone());
    assert_eq!([at(&rest, -5.0), at(&rest, 5.0)], [(-5.0, 0), (5.0, 0)]);
    let smooth = ball.clone().smooth_union(other, 4.0);
    let seam = DVec3::new(5.0, 75.0_f64.sqrt(), 0.0);
    assert!((smooth.sample(seam).0 + 1.0).abs() < 1e-9 && both.sample(seam).0.abs() < 1e-9);
    assert_eq!(at(&smooth, -5.0).0, -5.0, "the filling stays near the seam");
    assert_eq!(at(&ball.translated([3.0, 0.0, 0.0]), 3.0).0, -10.0);
    let box_at = |x, y, z| Sdf::cuboid([1.0, 0.0, 0.0], [2.0, 3.0, 4.0]).sample(DVec3::new(x, y, z)).0;
    assert_eq!([box_at(1.0, 0.0, 0.0), box_at(1.0, 0.0, 9.0), box_at(6.0, 7.0, 0.0)], [-2.0, 5.0, 5.0]);
    let rod = Sdf::capsule([0.0; 3], [0.0, 8.0, 0.0], 2.0);
    assert_eq!(rod.sample(DVec3::new(3.0, 4.0, 0.0)).0, 1.0);
    assert_eq!(rod.sample(DVec3::new(0.0, 13.0, 0.0)).0, 3.0);
    assert_eq!(Sdf::capsule([0.0; 3], [0.0; 3], 2.0).sample(DVec3::X * 3.0).0, 1.0, "a line of no length is a ball");
    let ring = Sdf::torus([0.0; 3], 10.0, 2.0);
    assert_eq!([ring.sample(DVec3::ZERO).0, ring.sample(DVec3::new(0.0, 0.0, 10.0)).0], [8.0, -2.0]);
    let slope = Sdf::half_space([0.0, 5.0, 0.0], [0.0, 2.0, 0.0]);
    assert_eq!([slope.sample(DVec3::ZERO).0, slope.sample(DVec3::Y * 7.0).0], [-5.0, 2.0]);
    for nothing in [Sdf::Union(Vec::new()), Sdf::Intersection(Vec::new()), Sdf::Subtraction(Vec::new())] {
        assert_eq!(nothing.sample(DVec3::ZERO).0, f64::INFINITY);
    }
}
