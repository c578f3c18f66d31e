//! Height maps: samples become ground, and every bad picture gives one clear sentence.

use bevy_marchless::source::{HeightMap, HeightMapError, HeightMapSettings, SourceError};
use bevy_math::{DVec2, UVec3};
use png::{BitDepth, ColorType};
use proptest::prelude::*;

fn picture(size: [u32; 2], color: ColorType, depth: BitDepth, data: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, size[0], size[1]);
    encoder.set_color(color);
    encoder.set_depth(depth);
    let mut writer = encoder.write_header().expect("a header");
    writer.write_image_data(data).expect("the data fit");
    writer.finish().expect("the end");
    bytes
}

fn grey16(size: [u32; 2], sample: impl Fn(u32, u32) -> u16) -> Vec<u8> {
    let samples = (0..size[1]).flat_map(|z| (0..size[0]).map(move |x| [x, z])).map(|[x, z]| sample(x, z));
    let data: Vec<u8> = samples.flat_map(u16::to_be_bytes).collect();
    picture(size, ColorType::Grayscale, BitDepth::Sixteen, &data)
}

fn settings() -> HeightMapSettings {
    HeightMapSettings { floor: Some(0.0), ..Default::default() }
}

fn message(bytes: &[u8]) -> String {
    HeightMap::from_bytes(bytes, settings()).expect_err("this is no height map").to_string()
}

#[test]
fn a_plane_stays_a_plane() {
    let bytes = grey16([9, 7], |x, z| (300 * x + 50 * z) as u16);
    let settings = HeightMapSettings {
        metres_per_pixel: DVec2::new(4.0, 8.0),
        metres_per_unit: 0.1,
        exaggeration: 2.0,
        floor: Some(5.0),
        ..Default::default()
    };
    let map = HeightMap::from_bytes(&bytes, settings).expect("a height map");
    assert_eq!((map.size(), map.size_in_world()), ([9, 7], DVec2::new(36.0, 56.0)));
    assert_eq!((map.min_height(), map.max_height()), (5.0, 5.0 + 2700.0 * 0.2));
    for [x, z] in [[2.0, 3.0], [2.5, 2.25], [6.875, 4.0], [4.9, 4.1]] {
        let expected = 5.0 + 0.2 * (300.0 * x + 50.0 * z);
        let found = map.height((x + 0.5) * 4.0, (z + 0.5) * 8.0);
        assert!((found - expected).abs() < 1e-9, "{found} is not {expected} at {x}, {z}");
    }
    // Beyond the border its heights continue.
    assert_eq!(map.height(-1e12, -1e12), 5.0);
    assert_eq!(map.height(1e12, f64::MAX), 5.0 + 0.2 * 2700.0);
}

#[test]
fn the_default_voxel_makes_the_longer_side_512_voxels() {
    let settings = HeightMapSettings { metres_per_pixel: DVec2::new(74.0, 93.0), ..Default::default() };
    let map = HeightMap::from_samples([403, 344], vec![7; 403 * 344], settings).expect("a height map");
    assert_eq!(map.default_voxel_size(), 344.0 * 93.0 / 512.0);
    assert_eq!(map.min_height(), 8.0 * map.default_voxel_size());
    let extent = map.extent_in_chunks(map.default_voxel_size(), 32).expect("a voxel size");
    assert_eq!(extent, UVec3::new(15, 1, 16));
    for (voxel_size, cells) in [(0.0, 32), (f64::NAN, 32), (-1.0, 32), (1.0, 0)] {
        assert!(matches!(map.extent_in_chunks(voxel_size, cells), Err(SourceError::Setting { .. })));
    }
}

#[test]
fn pictures_that_are_none_are_named() {
    assert!(message(b"GIF89a, not a PNG").starts_with("a height map must be a PNG picture"));
    assert!(message(b"").starts_with("a height map must be a PNG picture"));
    let eight = picture([2, 2], ColorType::Grayscale, BitDepth::Eight, &[0; 4]);
    assert_eq!(message(&eight), "a height map must be 16-bit grey, but this picture is 8-bit grey");
    let colour = picture([2, 2], ColorType::Rgb, BitDepth::Sixteen, &[0; 24]);
    assert_eq!(message(&colour), "a height map must be 16-bit grey, but this picture is 16-bit RGB");
    let whole = grey16([64, 64], |x, z| (x * z * 7919) as u16);
    let cut = "the height map of 64 × 64 samples is cut short: its file ends before the picture does";
    assert_eq!(message(&whole[..whole.len() / 2]), cut);
    let error = HeightMap::from_path("no/such/file.png", settings()).expect_err("no file");
    assert!(error.to_string().starts_with("the height map no/such/file.png cannot be opened: "), "{error}");
}

#[test]
fn samples_and_settings_out_of_range_are_named() {
    let of = |size, count, settings| HeightMap::from_samples(size, vec![1; count], settings);
    assert!(matches!(of([0, 4], 0, settings()), Err(HeightMapError::Empty { size: [0, 4] })));
    assert!(matches!(of([3, 4], 11, settings()), Err(HeightMapError::SampleCount { expected: 12, found: 11, .. })));
    assert!(matches!(of([u32::MAX; 2], 1, settings()), Err(HeightMapError::SampleCount { .. })));
    for bad in [f64::NAN, f64::INFINITY, 0.0, -74.0, 1e300] {
        for settings in [
            HeightMapSettings { metres_per_pixel: DVec2::new(bad, 1.0), ..Default::default() },
            HeightMapSettings { metres_per_pixel: DVec2::new(1.0, bad), ..Default::default() },
            HeightMapSettings { metres_per_unit: bad, ..Default::default() },
            HeightMapSettings { exaggeration: bad, ..Default::default() },
        ] {
            let error = of([3, 4], 12, settings).expect_err("out of range");
            assert!(error.to_string().ends_with(&format!("but it is {bad}")), "{error}");
        }
    }
    for bad in [f64::NAN, f64::INFINITY, 1e300] {
        assert!(of([3, 4], 12, HeightMapSettings { floor: Some(bad), ..Default::default() }).is_err());
    }
}

proptest! {
    #[test]
    fn damaged_files_never_panic(cut in 0usize..400, flips in prop::collection::vec((0usize..400, 1u8..), 0..4)) {
        let mut bytes = grey16([16, 12], |x, z| (x * x * 251 + z * 977) as u16);
        for (at, flip) in flips {
            let at = at % bytes.len();
            bytes[at] ^= flip;
        }
        bytes.truncate(bytes.len().saturating_sub(cut % bytes.len()));
        if let Ok(map) = HeightMap::from_bytes(&bytes, settings()) {
            prop_assert!(map.height(3.0, 4.0).is_finite());
        }
    }
}

#[test]
fn real_elevation_is_read() {
    let Some(folder) = std::env::var_os("MARCHLESS_TEST_DATA") else {
        println!("skipped: MARCHLESS_TEST_DATA does not name the folder with jacksboro_dem.png");
        return;
    };
    let path = std::path::Path::new(&folder).join("jacksboro_dem.png");
    if !path.exists() {
        println!("skipped: there is no {}", path.display());
        return;
    }
    let metres_per_pixel = DVec2::new(74.0, 93.0);
    let map = HeightMap::from_path(&path, HeightMapSettings { metres_per_pixel, ..settings() }).expect("a height map");
    assert_eq!((map.size(), map.min_height(), map.max_height()), ([403, 344], 0.0, 1076.0 - 236.0));
}
