//! Terrain files as text: written files read back the same, and every error names its place.

use std::fmt::Debug;

use bevy_marchless::file::{DescriptionError, HeightMapDescription};
use bevy_marchless::file::{SourceDescription, TerrainDescription};
use bevy_marchless::prelude::*;
use bevy_marchless::source::prelude::*;
use bevy_math::{DVec2, DVec3, IVec3};
use proptest::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;

const EXAMPLE: &str = include_str!("../../../../assets/terrains/highlands.terrain.ron");

fn number() -> impl Strategy<Value = f64> {
    prop_oneof![-1e3..1e3, Just(0.0), Just(0.1), Just(1e-9), Just(-1e9)]
}

fn length() -> impl Strategy<Value = f64> {
    prop_oneof![1e-3..1e4, Just(1e9)]
}

fn fractal() -> impl Strategy<Value = Fractal> {
    (any::<u32>(), 1u32..17, length(), 0.01..1.0, 1.0..8.0, any::<bool>()).prop_map(
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

fn stratum() -> impl Strategy<Value = Stratum> {
    let above = prop_oneof![number(), Just(f64::NEG_INFINITY)];
    let steep = prop_oneof![number(), Just(f64::INFINITY)];
    (any::<u8>(), number(), above, steep).prop_map(|(material, below_depth, above_height, steeper_than)| Stratum {
        material,
        below_depth,
        above_height,
        steeper_than,
    })
}

fn strata() -> impl Strategy<Value = Vec<Stratum>> {
    prop::collection::vec(stratum(), 0..3)
}

fn heights() -> impl Strategy<Value = NoiseHeightsSettings> {
    (fractal(), number(), 0.0..1e4, strata()).prop_map(|(noise, base, amplitude, strata)| NoiseHeightsSettings {
        noise,
        base,
        amplitude,
        strata,
    })
}

fn density() -> impl Strategy<Value = NoiseDensitySettings> {
    (fractal(), -1.0..1.0, prop::option::of(heights()), strata())
        .prop_map(|(noise, threshold, ground, strata)| NoiseDensitySettings { noise, threshold, ground, strata })
}

fn point() -> impl Strategy<Value = DVec3> {
    (number(), number(), number()).prop_map(DVec3::from)
}

fn sdf() -> impl Strategy<Value = Sdf> {
    let shape = prop_oneof![
        (point(), length()).prop_map(|(center, radius)| Sdf::sphere(center, radius)),
        (point(), length()).prop_map(|(center, half)| Sdf::cuboid(center, DVec3::splat(half))),
        (point(), point(), length()).prop_map(|(a, b, radius)| Sdf::capsule(a, b, radius)),
        (point(), length(), length()).prop_map(|(center, major, minor)| Sdf::torus(center, major, minor)),
        point().prop_map(|point| Sdf::HalfSpace { point, normal: DVec3::Y, material: 0 }),
    ];
    (shape, any::<u8>()).prop_map(|(shape, material)| shape.with_material(material)).prop_recursive(3, 8, 3, |part| {
        let parts = || prop::collection::vec(part.clone(), 0..3);
        prop_oneof![
            parts().prop_map(Sdf::Union),
            parts().prop_map(Sdf::Intersection),
            parts().prop_map(Sdf::Subtraction),
            (parts(), length()).prop_map(|(parts, radius)| Sdf::SmoothUnion { parts, radius }),
        ]
    })
}

fn layer() -> impl Strategy<Value = Layer> {
    let leaf = prop_oneof![
        number().prop_map(Layer::Constant),
        (fractal(), number()).prop_map(|(noise, amplitude)| Layer::noise(noise, amplitude)),
    ];
    leaf.prop_recursive(4, 12, 3, |part| {
        let parts = || prop::collection::vec(part.clone(), 1..3);
        prop_oneof![
            parts().prop_map(Layer::Sum),
            parts().prop_map(Layer::Product),
            parts().prop_map(Layer::Minimum),
            parts().prop_map(Layer::Maximum),
            (parts(), number(), length()).prop_map(|(of, min, more)| Layer::Clamp { of, min, max: min + more }),
            (parts(), length(), 0.0..0.99).prop_map(|(of, step, sharpness)| Layer::Terraces { of, step, sharpness }),
            (parts(), fractal(), length()).prop_map(|(of, noise, reach)| Layer::Warp { of, noise, reach }),
            (parts(), number(), number()).prop_map(|(of, x, y)| Layer::Curve { of, points: vec![DVec2::new(x, y)] }),
        ]
    })
}

fn solid() -> impl Strategy<Value = Solid> {
    let leaf = prop_oneof![
        Just(Solid::Everything),
        layer().prop_map(Solid::Ground),
        sdf().prop_map(Solid::Shape),
        (fractal(), -1.0..1.0, 1u32..16)
            .prop_map(|(noise, threshold, lattice)| { Solid::Caves(Caves { noise, threshold, lattice }) }),
        (fractal(), length(), 1u32..16)
            .prop_map(|(noise, radius, lattice)| { Solid::Tunnels(Tunnels { noise, radius, lattice }) }),
    ];
    leaf.prop_recursive(3, 8, 3, |part| {
        let parts = || prop::collection::vec(part.clone(), 0..3);
        prop_oneof![
            parts().prop_map(Solid::Union),
            parts().prop_map(Solid::Intersection),
            parts().prop_map(Solid::Subtraction),
        ]
    })
}

fn landscape() -> impl Strategy<Value = LandscapeSettings> {
    let patches = prop::option::of((fractal(), -1.0..1.0).prop_map(|(noise, above)| Patches { noise, above }));
    let rule = (stratum(), patches).prop_map(|(stratum, patches)| MaterialRule { stratum, patches });
    (solid(), prop::collection::vec(rule, 0..3)).prop_map(|(solid, materials)| LandscapeSettings { solid, materials })
}

fn height_map() -> impl Strategy<Value = HeightMapDescription> {
    let settings = (length(), length(), prop::option::of(number()), strata()).prop_map(|(x, y, floor, strata)| {
        HeightMapSettings { metres_per_pixel: DVec2::splat(x), metres_per_unit: y, exaggeration: y, floor, strata }
    });
    (".*", settings).prop_map(|(picture, settings)| HeightMapDescription { picture, settings, map: None })
}

fn extent() -> impl Strategy<Value = Extent> {
    let end = || prop_oneof![Just(None), (-9i32..9, 1i32..9).prop_map(Some)];
    [end(), end(), end()].prop_map(|ends| {
        let ends = ends.map(|ends| ends.map_or((i32::MIN, i32::MAX), |(min, size)| (min, min + size)));
        Extent::new(ends.map(|(min, _)| min).into(), ends.map(|(_, max)| max).into())
    })
}

fn keep() -> impl Strategy<Value = Keep> {
    prop_oneof![Just(Keep::Nothing), extent().prop_map(Keep::Chunks), Just(Keep::Everything)]
}

fn description() -> impl Strategy<Value = TerrainDescription> {
    let source = prop_oneof![
        Just(SourceDescription::Air),
        heights().prop_map(SourceDescription::NoiseHeights),
        density().prop_map(SourceDescription::NoiseDensity),
        landscape().prop_map(SourceDescription::Landscape),
        sdf().prop_map(SourceDescription::Sdf),
        height_map().prop_map(SourceDescription::HeightMap),
    ];
    let color = prop::array::uniform4(0f32..1.0).prop_map(|[r, g, b, a]| bevy_color::Color::srgba(r, g, b, a));
    let color = prop_oneof![color, Just(bevy_color::Color::hsl(20.0, 0.5, 0.5))];
    let palette = prop::collection::vec(color, 0..3).prop_map(Palette::new);
    let levels = (1..8u8, 1.75..64.0f32, 0.0..1.0f32).prop_map(|(count, falloff, hysteresis)| TerrainLevels {
        count,
        falloff,
        hysteresis,
    });
    let sharp = prop_oneof![
        Just(SharpMaterials::None),
        Just(SharpMaterials::All),
        prop::collection::vec(any::<u8>(), 0..4).prop_map(SharpMaterials::Only),
    ];
    let dual = (0..12u32, sharp, prop::option::of(0.0..180.0f32));
    let dual = dual.prop_map(|(smoothing, sharp, crease)| DualMesher { smoothing, sharp, crease });
    let mesher = prop_oneof![Just(TerrainMesher::Primal), dual.prop_map(TerrainMesher::from)];
    let all = (source, palette, 1e-3f32..1e3, extent(), keep(), levels, mesher);
    all.prop_map(|(source, palette, voxel_size, extent, keep, levels, mesher)| TerrainDescription {
        source,
        palette,
        voxel_size,
        extent,
        keep,
        levels,
        mesher,
    })
}

/// Through plain RON text, without the short forms of terrain files.
fn round_trip<T: Serialize + DeserializeOwned + PartialEq + Debug>(value: &T) {
    let text = ron::to_string(value).unwrap();
    assert_eq!(&ron::from_str::<T>(&text).unwrap_or_else(|error| panic!("{error} in {text}")), value, "{text}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn a_written_description_is_read_again(description in description()) {
        let text = description.to_ron().unwrap();
        match TerrainDescription::from_ron(&text) {
            Ok(read) => {
                prop_assert_eq!(&read, &description);
                prop_assert_eq!(read.to_ron().unwrap(), text);
            }
            // Values that are not valid settings are refused after they are read.
            Err(DescriptionError::Source { .. } | DescriptionError::Terrain { .. }) => round_trip(&description),
            Err(error) => panic!("{error} in {text}"),
        }
    }

    #[test]
    fn settings_alone_are_read_again(source in (heights(), density(), landscape(), sdf()), extent in extent(), radius in 1f32..1e6) {
        let (heights, density, landscape, sdf) = source;
        round_trip(&heights);
        round_trip(&density);
        round_trip(&landscape);
        round_trip(&sdf);
        round_trip(&extent);
        round_trip(&TerrainViewer::new(radius).with_sample_radius(radius / 2.0));
        round_trip(&TerrainViewer::new(radius));
    }
}

#[test]
fn what_is_left_out_has_its_default() {
    fn check<T: DeserializeOwned + Default + PartialEq + Debug>() {
        assert_eq!(ron::from_str::<T>("()").unwrap(), T::default());
    }
    check::<Fractal>();
    check::<Stratum>();
    check::<NoiseHeightsSettings>();
    check::<NoiseDensitySettings>();
    check::<LandscapeSettings>();
    check::<MaterialRule>();
    check::<Patches>();
    check::<Caves>();
    check::<Tunnels>();
    check::<HeightMapSettings>();
    check::<Extent>();
    check::<Palette>();
    check::<TerrainViewer>();
    assert_eq!(
        TerrainDescription::from_ron("(source: NoiseHeights())").unwrap(),
        TerrainDescription::new(SourceDescription::NoiseHeights(NoiseHeightsSettings::default()))
    );
    assert_eq!(
        ron::from_str::<Sdf>("Sphere(center: (1, 2, 3), radius: 4)").unwrap(),
        Sdf::sphere([1.0, 2.0, 3.0], 4.0)
    );
    let terrain = TerrainDescription::new(SourceDescription::Air).terrain().unwrap();
    assert_eq!((terrain.extent, terrain.keep), (Terrain::default().extent, Keep::Everything));
}

#[test]
fn short_forms_are_read() {
    let description = TerrainDescription::from_ron(
        "(source: NoiseDensity(ground: (base: 40.0)), extent: (y: (-2, 6)), keep: Chunks(x: (0, 1), y: (0, 1), z: (0, 1)))",
    );
    let description = description.unwrap();
    let SourceDescription::NoiseDensity(NoiseDensitySettings { ground: Some(ground), .. }) = &description.source else {
        panic!("{description:?}")
    };
    assert_eq!(ground.base, 40.0);
    assert_eq!(description.extent, Extent::ENDLESS.with_y(-2..6));
    assert_eq!(description.keep, Keep::Chunks(Extent::new(IVec3::ZERO, IVec3::ONE)));
}

#[test]
fn wrong_text_is_refused_where_it_is_wrong() {
    for (text, place, word) in [
        ("(source: NoiseHeights(noise: (\n  zom: 3.0)))", (2, 3), "`zom`"),
        ("(source: Air, scale: 2.0)", (1, 15), "`scale`"),
        ("(source: Air,\n\n extent: (w: (0, 1)))", (3, 11), "`w`"),
        ("(source: Sdf(Sphere(centre: (0, 0, 0), radius: 2)))", (1, 21), "`centre`"),
        ("(source: Ari)", (1, 10), "`Ari`"),
        ("(source: Sdf(Sphere(center: (0, 0, 0))))", (1, 38), "`radius`"),
        ("(\nvoxel_size: 1.0)", (2, 16), "`source`"),
        ("(source: Air, voxel_size: \"1\")", (1, 27), "float"),
        ("(source: NoiseHeights(strata: [(material: 2.5)]))", (1, 44), "comma"),
        ("(source: Air, source: Air)", (1, 15), "`source`"),
        ("(source: Air))", (1, 14), "after"),
        ("(source: Air) # comment", (1, 15), "after"),
        ("{source: Air}", (1, 1), "("),
    ] {
        match TerrainDescription::from_ron(text) {
            Err(DescriptionError::Text { line, column, message }) => {
                assert!(message.contains(word), "{message:?} about {text}");
                assert_eq!((line, column), place, "{message:?} about {text}");
            }
            other => panic!("{other:?} about {text}"),
        }
    }
}

#[test]
fn settings_out_of_range_are_refused_with_their_lines() {
    for (text, lines, words) in [
        ("(source: NoiseHeights(\n noise: (\n  zoom: -2.5)))", &[3][..], "line 3: zoom must be more than 0"),
        ("(source: NoiseDensity(threshold: 7))", &[1], "line 1: the threshold"),
        ("(source: NoiseHeights(noise: (zoom: 0, // 0\n octaves: 3), // 0\n base: 0.0))", &[1, 3], "line 1 or 3: zoom"),
        ("(source: NoiseHeights(noise: (zoom: NaN)))", &[1], "zoom"),
        ("(source: Landscape(solid:\nGround(Minimum([]))))", &[], "at least 1"),
        ("(source: Sdf(Sphere(center: (0, 0, 0),\n radius: -1)))", &[2], "line 2: a sphere's radius"),
        ("(source: HeightMap(picture: \"x.png\",\n settings: (exaggeration: -3.25)))", &[2], "exaggeration"),
    ] {
        match TerrainDescription::from_ron(text) {
            Err(DescriptionError::Source { lines: found, error }) => {
                assert_eq!(found, lines, "{error} about {text}");
                let message = DescriptionError::Source { lines: found, error }.to_string();
                assert!(message.contains(words), "{message:?} about {text}");
            }
            other => panic!("{other:?} about {text}"),
        }
    }
    for (text, lines, words) in [
        ("(source: Air,\nvoxel_size: -0.1)", &[2][..], "line 2: a terrain's voxel size"),
        ("(source: Air, levels: (count: 8))", &[], "levels.count"),
        ("(source: Air, mesher: Dual(smoothing: 9))", &[], "0 to 8 steps"),
        ("(source: Air, mesher: Dual(), levels: (count: 2))", &[], "one level of detail"),
        ("(source: Air, extent: (y: (0, 4)))", &[], "keep"),
        ("(source: Air, extent: (y: (4, 4)), keep: Nothing)", &[], "extent"),
    ] {
        match TerrainDescription::from_ron(text) {
            Err(DescriptionError::Terrain { lines: found, error }) => {
                assert_eq!(found, lines, "{error} about {text}");
                let message = DescriptionError::Terrain { lines: found, error }.to_string();
                assert!(message.contains(words), "{message:?} about {text}");
            }
            other => panic!("{other:?} about {text}"),
        }
    }
}

#[test]
fn a_file_that_is_cut_short_anywhere_says_so() {
    TerrainDescription::from_ron(EXAMPLE).unwrap();
    let other = "(source: HeightMap(picture: \"a b(\\\"\", settings: (floor: -inf, strata: [(above_height: -inf)])),
        /* a /* nested */ comment */ keep: Chunks(y: (-2, 0x10)), // the end
        voxel_size: 1.5e-3, palette: (colors: []))";
    assert!(!matches!(
        TerrainDescription::from_ron(other),
        Err(DescriptionError::Text { .. } | DescriptionError::CutShort { .. })
    ));
    for text in [EXAMPLE.trim_end(), other] {
        for end in (0..text.len()).filter(|end| text.is_char_boundary(*end)) {
            match TerrainDescription::from_ron(&text[..end]) {
                Err(DescriptionError::CutShort { line, .. }) => {
                    assert_eq!(line, text[..end].trim_end().matches('\n').count() + 1);
                }
                other => panic!("{other:?} about the first {end} bytes: {:?}", &text[..end]),
            }
        }
    }
}

#[test]
fn a_file_nested_without_end_is_refused() {
    let deep = format!("(source: Landscape(solid: {}))", "Union([".repeat(5_000));
    assert!(matches!(TerrainDescription::from_ron(&deep), Err(DescriptionError::Text { .. })));
    let mut shape = Sdf::sphere([0.0; 3], 1.0);
    for _ in 0..300 {
        shape = Sdf::Union(vec![shape]);
    }
    assert!(matches!(
        TerrainDescription::new(SourceDescription::Sdf(shape)).to_ron(),
        Err(DescriptionError::Write { .. })
    ));
}
