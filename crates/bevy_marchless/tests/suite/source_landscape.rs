//! Composed landscapes: true bounds, samples that depend only on position, refused settings, and the effects of
//! features.

use bevy_marchless::source::{
    Bound, Caves, Fractal, Landscape, LandscapeSettings, Layer, MaterialRule, NoiseHeights, Sdf, Solid, Source,
    SourceRegion, Stratum, Tunnels,
};
use bevy_math::DVec3;
use proptest::prelude::*;

/// The margin of close bounds, in voxels.
const CLOSE: f32 = 3.0;

fn filled(source: &dyn Source, region: &SourceRegion) -> (Vec<f32>, Vec<u8>) {
    let (mut distances, mut materials) = (vec![f32::NAN; region.len()], vec![0; region.len()]);
    source.fill(region, &mut distances, &mut materials);
    (distances, materials)
}

fn landscape(solid: impl Into<Solid>) -> Landscape {
    Landscape::new(LandscapeSettings { solid: solid.into(), ..Default::default() }).expect("in range")
}

fn at(min: [i32; 3], size: u32) -> SourceRegion {
    SourceRegion { min, size: [size; 3], level: 0, spacing: 1.0 }
}

fn fractal() -> impl Strategy<Value = Fractal> {
    (any::<u32>(), 1u32..4, 5.0..200.0, 0.1..=1.0, 1.0..3.0, any::<bool>()).prop_map(
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

fn layer() -> impl Strategy<Value = Layer> {
    let leaf = prop_oneof![
        (-20.0..60.0).prop_map(Layer::Constant),
        (fractal(), -30.0..30.0).prop_map(|(noise, amplitude)| Layer::noise(noise, amplitude)),
        (fractal(), 0.0..30.0).prop_map(|(noise, amplitude)| Layer::ridges(noise, amplitude)),
    ];
    leaf.prop_recursive(4, 16, 2, |inner| {
        prop_oneof![
            (inner.clone(), inner.clone()).prop_map(|(a, b)| a + b),
            (inner.clone(), inner.clone()).prop_map(|(a, b)| a * b.clamped(-2.0, 2.0)),
            (inner.clone(), inner.clone()).prop_map(|(a, b)| a.min(b)),
            (inner.clone(), inner.clone()).prop_map(|(a, b)| a.max(b)),
            (inner.clone(), -30.0..30.0, 0.0..30.0).prop_map(|(a, min, more)| a.clamped(min, min + more)),
            (inner.clone(), 0.5..20.0, 0.0..=0.99).prop_map(|(a, step, sharpness)| a.terraced(step, sharpness)),
            (inner.clone(), fractal(), 0.0..30.0).prop_map(|(a, noise, reach)| a.warped(noise, reach)),
            (inner, prop::collection::vec((0.5..30.0, -30.0..60.0), 1..4)).prop_map(|(a, steps)| {
                let mut x = -30.0;
                a.curved(steps.into_iter().map(|(step, y)| {
                    x += step;
                    [x, y]
                }))
            }),
        ]
    })
}

fn solid() -> impl Strategy<Value = Solid> {
    let position = || [-40.0..40.0, -20.0..90.0, -40.0..40.0].prop_map(DVec3::from);
    let lattice = || prop_oneof![Just(1u32), Just(2), Just(3), Just(4)];
    let leaf = prop_oneof![
        1 => Just(Solid::Everything),
        4 => layer().prop_map(Solid::Ground),
        3 => (fractal(), -1.0..=1.0, lattice())
            .prop_map(|(noise, threshold, lattice)| Solid::Caves(Caves { noise, threshold, lattice })),
        3 => (fractal(), 1.0..9.0, lattice())
            .prop_map(|(noise, radius, lattice)| Solid::Tunnels(Tunnels { noise, radius, lattice })),
        2 => (position(), 1.0..40.0, 0u8..4)
            .prop_map(|(center, radius, material)| Sdf::sphere(center, radius).with_material(material).into()),
    ];
    leaf.prop_recursive(3, 8, 2, |inner| {
        (inner.clone(), inner, 0..3).prop_map(|(a, b, operation)| match operation {
            0 => a.union(b),
            1 => a.intersection(b),
            _ => a.subtraction(b),
        })
    })
}

fn rules() -> impl Strategy<Value = Vec<MaterialRule>> {
    let stratum =
        (0u8..3, 0.0..9.0, -20.0..60.0, 0.0..2.0).prop_map(|(material, below_depth, above_height, steeper_than)| {
            Stratum { material, below_depth, above_height, steeper_than }
        });
    let rule = (stratum, prop::option::of((fractal(), -0.5..0.5))).prop_map(|(stratum, patches)| {
        let rule = MaterialRule::from(stratum);
        patches.map_or(rule, |(noise, above)| rule.in_patches(noise, above))
    });
    prop::collection::vec(rule, 0..4)
}

fn settings() -> impl Strategy<Value = LandscapeSettings> {
    (solid(), rules()).prop_map(|(solid, materials)| LandscapeSettings { solid, materials })
}

/// Regions near the ground, at negative positions, and ten million samples away.
fn region() -> impl Strategy<Value = SourceRegion> {
    let middle = || prop_oneof![3 => Just(0), 1 => Just(10_000_000), 1 => Just(-10_000_000)];
    let min = (middle(), middle(), [-40..40, -40..90, -40..40]).prop_map(|(x, z, [dx, dy, dz])| [x + dx, dy, z + dz]);
    let level = prop_oneof![Just(0u8), 0u8..7];
    (min, [1u32..20, 1..20, 1..20], level, prop_oneof![Just(1.0), Just(0.3), Just(2.5)]).prop_map(
        |(min, size, level, spacing)| SourceRegion { min, size, level, spacing: spacing * f64::from(1 << level) },
    )
}

/// A certain bound agrees with sampling, and a close one with a margin for isovalues of ±3.
fn check_bounds(source: &Landscape, region: &SourceRegion) -> Result<(), TestCaseError> {
    let (distances, materials) = filled(source, region);
    prop_assert!(distances.iter().all(|distance| !distance.is_nan()));
    for (bound, least) in [(source.bound(region), 0.0), (source.bound_closely(region), CLOSE - 1e-3)] {
        match bound {
            Bound::Mixed => {}
            Bound::Outside => {
                let nearest = distances.iter().copied().fold(f32::INFINITY, f32::min);
                prop_assert!(nearest >= least, "{} is not outside", nearest);
            }
            Bound::Inside { material } => {
                let nearest = distances.iter().copied().fold(f32::NEG_INFINITY, f32::max);
                prop_assert!(nearest < 0.0 && nearest <= -least, "{} is not inside", nearest);
                prop_assert!(materials.iter().all(|found| *found == material), "{:?}: {}", materials, material);
            }
        }
    }
    Ok(())
}

proptest! {
    #[test]
    fn bounds_are_true(settings in settings(), region in region()) {
        check_bounds(&Landscape::new(settings).expect("in range"), &region)?;
    }

    #[test]
    fn samples_are_the_same_whoever_asks(
        settings in settings(),
        region in region(),
        from in [0u32..14, 0..14, 0..14],
        size in [1u32..14, 1..14, 1..14],
    ) {
        let source = Landscape::new(settings.clone()).expect("in range");
        let (distances, materials) = filled(&source, &region);
        let from: [u32; 3] = core::array::from_fn(|axis| from[axis] % region.size[axis]);
        let size: [u32; 3] = core::array::from_fn(|axis| size[axis].min(region.size[axis] - from[axis]));
        let min = core::array::from_fn(|axis| region.min[axis] + from[axis] as i32);
        // Another landscape with the same settings, which has evaluated nothing yet.
        let other = Landscape::new(settings).expect("in range");
        let part = SourceRegion { min, size, ..region };
        let (part_distances, part_materials) = filled(&other, &part);
        let (whole, shape) = (region.shape().expect("it has points"), part.shape().expect("it has points"));
        for z in 0..size[2] {
            for y in 0..size[1] {
                for x in 0..size[0] {
                    let here = whole.index([from[0] + x, from[1] + y, from[2] + z]);
                    let there = shape.index([x, y, z]);
                    prop_assert_eq!(distances[here].to_bits(), part_distances[there].to_bits());
                    prop_assert_eq!(materials[here], part_materials[there]);
                }
            }
        }
    }
}

/// Bounds that always say "mixed" would pass the tests above.
#[test]
fn bounds_are_close() {
    let ground = 10.0 + Layer::noise(Fractal::default(), 52.0).clamped(-5.0, 5.0);
    let hollow = Solid::from(ground).subtraction(Sdf::sphere([16.0, -200.0, 16.0], 60.0)).subtraction(Tunnels {
        noise: Fractal { zoom: 4000.0, octaves: 1, ..Fractal::default() },
        ..Default::default()
    });
    let source = landscape(hollow);
    assert_eq!(source.bound(&at([0, 20, 0], 40)), Bound::Outside);
    assert_eq!(source.bound(&at([0, -20, 0], 40)), Bound::Mixed);
    assert_eq!(source.bound(&at([0, -90, 0], 40)), Bound::Inside { material: 2 });
    assert_eq!(source.bound(&at([0, -160, 0], 40)), Bound::Mixed);
    assert_eq!(source.bound(&at([0, -220, 0], 40)), Bound::Outside);
    // The ground below a column is known as soon as the column is.
    let hills = landscape(Solid::default());
    let height = hills.height(16.0, 16.0).expect("there is ground") as i32;
    assert_eq!(hills.bound(&at([12, height + 8, 12], 8)), Bound::Mixed);
    assert_eq!(hills.bound_closely(&at([12, height + 8, 12], 8)), Bound::Outside);
    assert_eq!(hills.bound_closely(&at([12, height - 24, 12], 8)), Bound::Inside { material: 2 });
}

#[test]
fn the_default_is_the_default_hills() {
    let region = at([-5, 40, 3], 30);
    assert_eq!(filled(&Landscape::default(), &region), filled(&NoiseHeights::default(), &region));
}

#[test]
fn layers_do_what_they_say() {
    let height = |layer: Layer| landscape(layer).height(3.0, 4.0).expect("there is ground");
    let of = |value: f64| Layer::Constant(value);
    assert_eq!(height(2.0 + of(3.0) * 4.0), 14.0);
    assert_eq!(height(of(2.0).min(1.0).max(-3.0)), 1.0);
    assert_eq!(height((of(2.0) + 5.0).clamped(0.0, 6.0)), 6.0);
    assert_eq!(height(Layer::Sum(Vec::new())), 0.0);
    assert_eq!(height(Layer::Product(Vec::new())), 1.0);
    for (from, to) in [(0.0, 0.0), (3.0, 0.0), (7.0, 10.0), (13.0, 10.0), (-3.0, 0.0), (5.0, 5.0)] {
        assert_eq!(height(of(from).terraced(10.0, 0.9)), to, "of {from}");
        assert!((height(of(from).terraced(10.0, 0.0)) - from).abs() < 1e-12);
    }
    for (from, to) in [(-9.0, 1.0), (0.0, 1.0), (1.0, 3.0), (2.0, 5.0), (3.0, 4.0), (9.0, 3.0)] {
        assert_eq!(height(of(from).curved([[0.0, 1.0], [2.0, 5.0], [4.0, 3.0]])), to, "of {from}");
    }
    let noise = Layer::noise(Fractal::default(), 50.0);
    let warp = Fractal { seed: 3, ..Fractal::default() };
    assert_ne!(height(noise.clone().warped(warp, 40.0)), height(noise.clone()));
    assert_eq!(height(noise.clone().warped(warp, 0.0)), height(noise));
}

/// Two kinds of caves leave a part of a block of rock, and a lattice changes this part a little.
#[test]
fn caves_are_hollow_and_a_lattice_changes_them_little() {
    let solid_share = |solid: Solid| {
        let distances = filled(&landscape(solid), &at([-20, -300, 7], 64)).0;
        let inside: Vec<bool> = distances.iter().map(|distance| *distance < 0.0).collect();
        let share = inside.iter().filter(|inside| **inside).count() as f64 / inside.len() as f64;
        (share, inside)
    };
    for (of, expected) in [
        (&(|lattice| Solid::from(Caves { lattice, ..Default::default() })) as &dyn Fn(u32) -> Solid, 0.1..0.5),
        (&|lattice| Solid::from(Tunnels { lattice, ..Default::default() }), 0.002..0.1),
    ] {
        let (share, inside) = solid_share(of(1));
        assert!(expected.contains(&share), "{share}");
        for (lattice, most) in [(2, 0.02), (4, 0.08)] {
            let (_, coarse) = solid_share(of(lattice));
            let different = inside.iter().zip(&coarse).filter(|(a, b)| a != b).count() as f64 / inside.len() as f64;
            assert!(different > 0.0 && different < most * (1.0 + share), "{different} with every {lattice}th");
        }
    }
}

#[test]
fn shapes_keep_their_materials_and_rules_hold_for_the_rest() {
    let ore = Sdf::sphere([8.0, 8.0, 8.0], 5.0).with_material(7);
    let solid = Solid::from(Layer::Constant(8.0)).union(ore);
    let materials = vec![MaterialRule::from(Stratum { material: 3, ..Stratum::default() })];
    let source = Landscape::new(LandscapeSettings { solid, materials }).expect("in range");
    let material = |position: [i32; 3]| filled(&source, &at(position, 1)).1[0];
    assert_eq!([material([8, 10, 8]), material([8, 7, 8]), material([30, 7, 8])], [7, 7, 3]);
    assert_eq!(source.bound_closely(&at([5, 4, 5], 6)), Bound::Mixed);
}

#[test]
fn patches_cover_a_part() {
    let rule = MaterialRule::from(Stratum { material: 1, ..Stratum::default() });
    let materials = vec![rule.in_patches(Fractal { zoom: 10.0, ..Fractal::default() }, 0.1)];
    let settings = LandscapeSettings { solid: Solid::Everything, materials };
    let source = Landscape::new(settings).expect("in range");
    let region = at([0; 3], 32);
    let share = filled(&source, &region).1.iter().filter(|material| **material == 1).count() as f64 / 32_768.0;
    assert!((0.1..0.5).contains(&share), "{share}");
    assert_eq!(source.bound_closely(&region), Bound::Mixed);
}

#[test]
fn settings_out_of_range_are_named() {
    let says = |solid: Solid, message: &str| {
        let error = Landscape::new(LandscapeSettings { solid, ..Default::default() }).expect_err(message);
        assert_eq!(error.to_string(), message);
    };
    let layer = || Layer::Constant(1.0);
    let noise = Fractal { octaves: 0, ..Fractal::default() };
    let octaves = "the number of octaves must be from 1 to 16, but it is 0";
    says(Layer::noise(noise, 1.0).into(), octaves);
    says(layer().warped(noise, 1.0).into(), octaves);
    says(Caves { noise, ..Default::default() }.into(), octaves);
    says(Tunnels { noise, ..Default::default() }.into(), octaves);
    says(Layer::Constant(f64::NAN).into(), "a constant layer must be from -1e9 to 1e9, but it is NaN");
    let none = "the number of layers in a minimum or maximum must be at least 1, but it is 0";
    says(Layer::Minimum(Vec::new()).into(), none);
    says(layer().clamped(2.0, 1.0).into(), "the lower end of a clamp must be at most its upper end, but it is 2");
    says(layer().terraced(0.0, 0.5).into(), "the step of terraces must be more than 0 and at most 1e9, but it is 0");
    says(layer().terraced(1.0, 1.0).into(), "the sharpness of terraces must be from 0 to 0.99, but it is 1");
    says(layer().warped(Fractal::default(), -1.0).into(), "the reach of a warp must be from 0 to 1e9, but it is -1");
    says(
        layer().curved([[0.0; 2]; 2]).into(),
        "what goes into a curve must be more than at the point before, but it is 0",
    );
    says(layer().curved([[0.0; 2]; 0]).into(), "the number of points of a curve must be at least 1, but it is 0");
    says(Caves { lattice: 0, ..Default::default() }.into(), "the lattice must be from 1 to 16, but it is 0");
    says(
        Tunnels { radius: f64::INFINITY, ..Default::default() }.into(),
        "the radius of tunnels must be more than 0 and at most 1e9, but it is inf",
    );
    says(
        Sdf::sphere([0.0; 3], f64::NAN).into(),
        "a sphere's radius must be more than 0 and at most 1e9, but it is NaN",
    );
    let deep = (0..99).fold(layer(), |layer, _| layer.terraced(1.0, 0.5));
    says(deep.into(), "layers and solids must be nested at most 32 deep, but they are deeper");
    let rule = MaterialRule::default().in_patches(noise, 0.0);
    assert!(Landscape::new(LandscapeSettings { materials: vec![rule], ..Default::default() }).is_err());
}

/// Extreme settings that are allowed, and positions at the ends of the lattice, never give NaN.
#[test]
fn the_ends_of_the_world_are_sampled() {
    let noise = Fractal { octaves: 16, zoom: 1e-9, lacunarity: 8.0, ..Fractal::default() };
    let layer = (Layer::noise(noise, 1e9) * 1e9).terraced(1e-9, 0.99).warped(noise, 1e9).curved([[-1e9, 1e9]]);
    let solid = Solid::from(layer).subtraction(Caves { noise, lattice: 16, ..Default::default() });
    let source = landscape(solid.subtraction(Tunnels { noise, radius: 1e9, lattice: 3 }));
    for v in [i32::MIN, i32::MAX - 3, 0] {
        let region = SourceRegion { min: [v; 3], size: [3; 3], level: 0, spacing: 1e9 };
        assert!(filled(&source, &region).0.iter().all(|distance| !distance.is_nan()));
        source.bound(&region.grown(4));
        source.bound_closely(&region.grown(4));
    }
    filled(&source, &SourceRegion { size: [0, 5, 5], ..at([0; 3], 1) });
}
