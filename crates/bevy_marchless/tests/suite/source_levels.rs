//! Sources at coarse levels of detail: the materials of level 0, and no noise that samples cannot show.

use std::collections::BTreeMap;

use bevy_marchless::source::{
    Bound, Caves, Fractal, HeightMap, HeightMapSettings, Landscape, LandscapeSettings, Layer, MaterialRule,
    NoiseHeights, Solid, Source, SourceRegion, Stratum, Tunnels,
};

fn filled(source: &dyn Source, region: &SourceRegion) -> (Vec<f32>, Vec<u8>) {
    let (mut distances, mut materials) = (vec![f32::NAN; region.len()], vec![0; region.len()]);
    source.fill(region, &mut distances, &mut materials);
    (distances, materials)
}

/// The shares of the materials of the vertices that are seen from above, in percent: those on edges along y, which are
/// even over the map, and those on all edges, which are even over the surface.
///
/// There is a vertex for each edge of the lattice that the surface crosses. It has the material of the edge's inside
/// end. Edges from `points`² places are counted, which are 32 voxels apart, and lie in the lattices of levels 0 to 5.
fn shares(source: &dyn Source, level: u8, voxel: f64, points: i32, heights: [f64; 2]) -> [BTreeMap<u8, f64>; 2] {
    let spacing = voxel * f64::from(1u32 << level);
    let [bottom, top] = [(heights[0] / spacing).floor() as i32 - 1, (heights[1] / spacing).ceil() as i32 + 1];
    let rows = (top - bottom + 1) as u32;
    let mut counts = [const { BTreeMap::<u8, u32>::new() }; 2];
    for (x, z) in (0..points).flat_map(|x| (0..points).map(move |z| (x, z))) {
        let min = [(32 * x) >> level, bottom, (32 * z) >> level];
        let region = SourceRegion { min, size: [2, rows, 2], level, spacing };
        let (distances, materials) = filled(source, &region);
        let shape = region.shape().expect("it has points");
        let solid = |point: [u32; 3]| distances[shape.index(point)] < 0.0;
        let mut count = |edges: usize, inside: [u32; 3]| {
            *counts[edges].entry(materials[shape.index(inside)]).or_default() += 1;
        };
        // The columns of the place and of its neighbours, from the sky down to the ground.
        let columns = [[0, 0], [1, 0], [0, 1]];
        let mut open = [true; 3];
        for y in (0..rows).rev() {
            let point = |column: usize| [columns[column][0], y, columns[column][1]];
            let above = open;
            for (open, column) in open.iter_mut().zip(0..) {
                *open &= !solid(point(column));
            }
            if above[0] && !open[0] {
                count(0, point(0));
                count(1, point(0));
            }
            for column in [1, 2] {
                match [open[0], open[column]] {
                    [true, false] if solid(point(column)) => count(1, point(column)),
                    [false, true] if solid(point(0)) => count(1, point(0)),
                    _ => {}
                }
            }
        }
    }
    counts.map(|counts| {
        let all = f64::from(counts.values().sum::<u32>());
        counts.into_iter().map(|(material, count)| (material, 100.0 * f64::from(count) / all)).collect()
    })
}

fn of(material: u8) -> Stratum {
    Stratum { material, ..Stratum::default() }
}

/// The highlands of the repository's terrain file.
fn highlands(with_caves: bool) -> Landscape {
    let noise = |seed, zoom, octaves| Fractal { seed, zoom, octaves, ..Fractal::default() };
    let ground = Layer::Sum(vec![
        Layer::Constant(64.0),
        Layer::noise(noise(3, 240.0, 5), 48.0),
        Layer::ridges(noise(8, 600.0, 4), 60.0).terraced(12.0, 0.7),
    ]);
    let caves = Caves { noise: noise(21, 45.0, 2), threshold: 0.3, lattice: 2 };
    let solid = if with_caves { Solid::from(ground).subtraction(caves) } else { ground.into() };
    let materials = vec![
        Stratum { below_depth: 5.0, ..of(2) }.into(),
        Stratum { steeper_than: 1.0, ..of(2) }.into(),
        Stratum { above_height: 120.0, ..of(4) }.into(),
        Stratum { below_depth: 1.5, ..of(1) }.into(),
        MaterialRule::from(of(7)).in_patches(noise(5, 60.0, 3), 0.1),
    ];
    Landscape::new(LandscapeSettings { solid, materials }).expect("in range")
}

/// Mountains with sand, meadows, woods, rock and snow, as in the documentation.
fn mountains() -> Landscape {
    let [grass, rock, sand, snow, ore, woods] = [0, 2, 3, 4, 5, 8];
    let noise = |seed, zoom| Fractal { seed, zoom, octaves: 3, ..Fractal::default() };
    let materials = vec![
        MaterialRule::from(Stratum { below_depth: 6.0, ..of(ore) }).in_patches(noise(8, 30.0), 0.3),
        Stratum { below_depth: 3.0, ..of(rock) }.into(),
        Stratum { steeper_than: 1.8, ..of(rock) }.into(),
        Stratum { above_height: 195.0, ..of(snow) }.into(),
        Stratum { steeper_than: 1.0, ..of(rock) }.into(),
        MaterialRule::from(Stratum { above_height: 90.0, ..of(woods) }).in_patches(noise(6, 40.0), 0.15),
        Stratum { above_height: 90.0, ..of(grass) }.into(),
        of(sand).into(),
    ];
    let noise = Fractal { seed: 6, zoom: 550.0, persistence: 0.4, ..Fractal::default() };
    let solid = (110.0 + Layer::ridges(noise, 125.0)).into();
    Landscape::new(LandscapeSettings { solid, materials }).expect("in range")
}

/// A map of 1,536 pixels a side, each of two voxels, with rock, snow and grass.
fn map() -> HeightMap {
    let noise = Fractal { seed: 4, zoom: 300.0, octaves: 5, ridged: true, ..Fractal::default() };
    let hills =
        Landscape::new(LandscapeSettings { solid: Layer::noise(noise, 90.0).into(), ..LandscapeSettings::default() })
            .expect("in range");
    let size = 1536;
    let samples = (0..size * size).map(|index| {
        let [x, z] = [index % size, index / size].map(|pixel| 2.0 * f64::from(pixel));
        (10.0 * (hills.height(x, z).unwrap_or_default() + 200.0)) as u16
    });
    let strata = vec![
        Stratum { below_depth: 3.0, ..of(2) },
        Stratum { steeper_than: 0.9, ..of(2) },
        Stratum { above_height: 120.0, ..of(4) },
        Stratum { below_depth: 1.0, ..of(1) },
    ];
    let settings = HeightMapSettings {
        metres_per_pixel: [2.0; 2].into(),
        metres_per_unit: 0.1,
        floor: Some(10.0),
        strata,
        ..HeightMapSettings::default()
    };
    HeightMap::from_samples([size; 2], samples.collect(), settings).expect("in range")
}

/// The greatest difference of shares, in percentage points.
fn difference(a: &BTreeMap<u8, f64>, b: &BTreeMap<u8, f64>) -> f64 {
    let share = |shares: &BTreeMap<u8, f64>, material: u8| shares.get(&material).copied().unwrap_or_default();
    (0..=255).map(|material| (share(a, material) - share(b, material)).abs()).fold(0.0, f64::max)
}

/// Rules by depth, height, slope and patches. The ground is flatter at coarse levels, which have fewer edges across;
/// so the share of what is steep falls over all edges, but not over the map.
#[test]
fn coarse_levels_have_the_materials_of_level_0() {
    let map = map();
    let sources: [(&str, &dyn Source, [f64; 2]); 4] = [
        ("hills", &NoiseHeights::default(), [0.0, 112.0]),
        ("highlands", &highlands(false), [-50.0, 180.0]),
        ("mountains", &mountains(), [-20.0, 240.0]),
        ("map", &map, [map.min_height() - 20.0, map.max_height() + 20.0]),
    ];
    for (name, source, heights) in sources {
        let finest = shares(source, 0, 1.0, 96, heights);
        assert!(finest[0].values().filter(|share| **share > 4.0).count() > 1, "{finest:?}");
        for level in 1..=5 {
            let coarse = shares(source, level, 1.0, 96, heights);
            let [over_map, over_surface] = [0, 1].map(|edges| difference(&finest[edges], &coarse[edges]));
            assert!(over_map < 5.0 && over_surface < 12.0, "{name} at level {level}: {coarse:.1?}, not {finest:.1?}");
        }
    }
}

/// The height at which a column of samples of a level crosses the surface, from below.
fn height_at(source: &dyn Source, level: u8, [x, z]: [i32; 2], [bottom, top]: [i32; 2]) -> f64 {
    let spacing = f64::from(1u32 << level);
    let [bottom, top] = [bottom >> level, (top >> level) + 1];
    let region = SourceRegion { min: [x, bottom, z], size: [1, (top - bottom) as u32, 1], level, spacing };
    let (distances, _) = filled(source, &region);
    let above = distances.iter().position(|distance| *distance >= 0.0).expect("the sky is open");
    let [below, here] = [above - 1, above].map(|index| f64::from(distances[index]));
    (f64::from(bottom) + above as f64 - 1.0 + below / (below - here)) * spacing
}

/// Octaves finer than a spacing are replaced by their mean: 0, and 0.308 for ridges in two dimensions.
#[test]
fn fine_noise_is_left_out_of_coarse_levels() {
    let noise = Fractal { zoom: 7.0, octaves: 2, ..Fractal::default() };
    for (layer, mean) in [(Layer::noise(noise, 10.0), 0.0), (Layer::ridges(noise, 10.0), 3.08)] {
        let source = Landscape::new(LandscapeSettings { solid: (37.0 + layer).into(), ..Default::default() });
        let source = source.expect("in range");
        let spread = |level: u8| {
            let heights = (0..64).map(|place| height_at(&source, level, [place, 3 * place], [0, 80]));
            let [low, high] = heights
                .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], height| [low.min(height), high.max(height)]);
            [low, high]
        };
        let [finest, faded, flat] = [0, 2, 3].map(spread);
        assert!(finest[1] - finest[0] > 8.0, "{finest:?}");
        assert!(faded[1] - faded[0] < 0.8 * (finest[1] - finest[0]) && faded[1] - faded[0] > 2.0, "{faded:?}");
        assert!(flat.iter().all(|height| (height - 37.0 - mean).abs() < 1e-3), "{flat:?}");
    }
}

/// Mountains keep their height as a whole, whatever is left out of them.
#[test]
fn mountains_are_as_high_at_all_levels() {
    let source = mountains();
    let mean = |level: u8| {
        let places = (0..64).flat_map(|x| (0..64).map(move |z| [(32 * x) >> level, (32 * z) >> level]));
        places.map(|place| height_at(&source, level, place, [-64, 320])).sum::<f64>() / 4096.0
    };
    let finest = mean(0);
    for level in 1..=5 {
        let coarse = mean(level);
        assert!((coarse - finest).abs() < 2.0, "{coarse} at level {level}, {finest} at level 0");
    }
}

/// Caves and tunnels that a level cannot show are not there, and cost nothing.
#[test]
fn caves_and_tunnels_vanish_at_coarse_levels() {
    let solid = |level: u8, solid: Solid| {
        let source = Landscape::new(LandscapeSettings { solid, ..Default::default() }).expect("in range");
        let spacing = f64::from(1u32 << level);
        let region = SourceRegion { min: [-20, -40, 7], size: [24; 3], level, spacing };
        let inside = filled(&source, &region).0.iter().filter(|distance| **distance < 0.0).count();
        (inside as f64 / region.len() as f64, source.bound(&region), source.noise_calls())
    };
    let caves = |noise: Fractal| Solid::Everything.subtraction(Caves { noise, ..Default::default() });
    let fine = Fractal { zoom: 15.0, octaves: 2, ..Fractal::default() };
    assert!(solid(0, caves(fine)).0 < 0.9);
    for (level, of) in [
        (4, caves(fine)),
        (6, caves(Fractal { ridged: true, ..Caves::default().noise }).intersection(Layer::Constant(-9e3))),
        (3, Solid::Everything.subtraction(Tunnels::default())),
        (6, Solid::Everything.subtraction(Tunnels::default())),
    ] {
        let (share, bound, calls) = solid(level, of.clone());
        // Ridges have a mean above the threshold: all of it is a cave.
        let expected = if matches!(of, Solid::Intersection(_)) { 0.0 } else { 1.0 };
        assert_eq!((share, calls), (expected, 0), "at level {level}");
        assert_ne!(bound, Bound::Mixed);
    }
    let (share, bound, _) = solid(2, Solid::Everything.subtraction(Tunnels::default()));
    assert!(share < 1.0 && bound == Bound::Mixed);
}

/// The same spacing at another level is another ground: heights are kept for each level.
#[test]
fn heights_are_kept_for_each_level() {
    let source = NoiseHeights::default();
    let region = |level| SourceRegion { min: [0, 20, 0], size: [20; 3], level, spacing: 4.0 };
    let [finest, coarse] = [0, 2].map(|level| filled(&source, &region(level)));
    assert_ne!(finest, coarse);
    assert_eq!(coarse, filled(&NoiseHeights::default(), &region(2)));
    assert_eq!(finest, filled(&source, &region(0)));
}

#[test]
fn coarse_regions_far_from_the_ground_are_skipped() {
    let hills = NoiseHeights::default();
    for level in 1..=6 {
        let at = |y: i32| SourceRegion { min: [0, y, 0], size: [36; 3], level, spacing: f64::from(1u32 << level) };
        let top = (112 >> level) + 5;
        assert_eq!(hills.bound(&at(top)), Bound::Outside);
        assert_eq!(hills.bound(&at(-18)), Bound::Mixed);
        assert_eq!(hills.bound(&at(-80)), Bound::Inside { material: 2 });
        assert_eq!(hills.bound_closely(&at(-42)), Bound::Inside { material: 2 });
    }
}

/// A slope of level 0 gives the material at all levels: that of the same point.
#[test]
fn rules_by_slope_see_the_slopes_of_level_0() {
    let materials = vec![Stratum { steeper_than: 0.8, ..of(2) }.into()];
    let solid = (60.0 + Layer::noise(Fractal::default(), 52.0)).warped(Fractal::default(), 20.0).into();
    let source = Landscape::new(LandscapeSettings { solid, materials }).expect("in range");
    let at = |level: u8, point: [i32; 3]| {
        let region = SourceRegion { min: point, size: [1; 3], level, spacing: 0.7 * f64::from(1u32 << level) };
        filled(&source, &region).1[0]
    };
    let mut found = [0; 2];
    for (level, place) in (1..=6).flat_map(|level| (-200..200).map(move |place| (level, place))) {
        let coarse = at(level, [place, -8, 7 - place]);
        let finest = at(0, [place, -8, 7 - place].map(|v| v << level));
        assert_eq!(coarse, finest, "at {place} of level {level}");
        found[usize::from(coarse == 2)] += 1;
    }
    assert!(found.iter().all(|count| *count > 200), "{found:?}");
}
