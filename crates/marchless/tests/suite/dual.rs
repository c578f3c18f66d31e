//! The dual mesher: its rule for pairs of cells by enumeration, the mesher against a plain reference, and its seams.

mod planes;
mod reference;
mod topology;

use std::collections::{BTreeMap, BTreeSet};

use fastrand::Rng;
use marchless::cell::{CaseIndex, Corner, Face};
use marchless::{
    Backend, DualSettings, MaterialSet, MeshBuffer, MeshError, MeshReport, Mesher, Samples, Shape, Weight,
};
use proptest::prelude::*;

use crate::support::{Field, TestWeight, random};
use reference::{STEPS, Volume, loops_of, opposite, sides_of, whole_faces};

#[test]
fn thirty_six_cases_have_a_whole_face_and_they_have_one() {
    let cases: Vec<_> = (0..=255).map(CaseIndex).filter(|&case| !whole_faces(case).is_empty()).collect();
    let of = |inside: u32| cases.iter().filter(|case| case.0.count_ones() == inside).count();
    assert_eq!((cases.len(), of(5), of(6)), (36, 24, 12));
    for case in cases {
        let ambiguous = Face::ALL.iter().filter(|&&face| case.is_ambiguous(face)).count();
        assert_eq!((whole_faces(case).len(), ambiguous, loops_of(case).len()), (1, 1, 1), "{case:?}");
        assert_eq!(loops_of(CaseIndex(!case.0)).len(), 2, "{case:?}");
    }
}

/// The most quads that have a common side between the vertices of two cells.
fn most_quads_at_a_side(cases: [CaseIndex; 2], face: Face) -> usize {
    let faces = [face, opposite(face)];
    let loops = cases.map(loops_of);
    let mut counts = BTreeMap::new();
    for side in sides_of(face) {
        let across = |corner: Corner| Corner::new(corner.index() as u8 ^ 1 << face.axis());
        let [low, high] = side.corners();
        let sides = [side, marchless::cell::Edge::between(across(low), across(high))];
        if cases[0].crosses(side) {
            let vertex = |cell: usize| loops[cell].iter().position(|crossings| crossings.contains(&sides[cell]));
            *counts.entry([vertex(0), vertex(1)]).or_insert(0) += 1;
        }
    }
    assert!(faces[1].holds(Corner::ALL[0]) != faces[0].holds(Corner::ALL[0]));
    counts.into_values().max().unwrap_or(0)
}

/// A face has at most four quads, of which two have a common side. Each quad has two sides across the face's edges, so
/// a side between two vertices belongs to as many quads as there are crossings of the face on both.
#[test]
fn all_pairs_of_face_neighbours_have_sides_of_two_quads() {
    let (mut pairs, mut bad) = (0, 0);
    for axis in 0..3 {
        let [face, bit] = [2 * axis + 1, 1 << axis];
        let face = Face::ALL[face];
        for signs in 0..1usize << 12 {
            // Three layers of four points across the axis.
            let case = |layer: usize| {
                let inside = |corner: usize| {
                    let [u, v] = [(axis + 1) % 3, (axis + 2) % 3].map(|other| corner >> other & 1);
                    let at = layer + usize::from(corner & bit != 0);
                    signs >> (4 * at + u + 2 * v) & 1
                };
                CaseIndex((0..8).map(|corner| (inside(corner) << corner) as u8).sum())
            };
            let cases = [case(0), case(1)];
            pairs += 1;
            bad += usize::from(most_quads_at_a_side(cases, face) > 2);
            let is_pair = whole_faces(cases[0]).contains(&face) && whole_faces(cases[1]).contains(&opposite(face));
            let cases = if is_pair { cases.map(|case| CaseIndex(!case.0)) } else { cases };
            assert!(most_quads_at_a_side(cases, face) <= 2, "{cases:?}");
        }
    }
    assert_eq!((pairs, bad), (12_288, 54));
}

/// Equal positions, indices and materials on every backend, and equal normals on all of them.
fn compare<W: Weight>(volume: &Volume<'_, W>) {
    let expected = volume.mesh();
    let shape = Shape::new(volume.size).expect("a small shape");
    let samples = Samples::new(shape, volume.weights).and_then(|samples| samples.with_materials(volume.materials));
    let samples = samples.expect("one weight and one material a sample");
    let samples = if volume.padded { samples.padded() } else { samples };
    let Volume { isovalue, smoothing, sharp, crease, .. } = *volume;
    let settings = DualSettings { isovalue, smoothing, sharp, crease, ..DualSettings::default() };
    let positions: Vec<_> = expected.positions.iter().map(|at| at.map(|v| v as f32 / STEPS as f32)).collect();
    let mut normals = None;
    for &backend in Backend::ALL.iter().filter(|backend| backend.is_available()) {
        let (mut mesher, mut mesh) = (Mesher::with_backend(backend), MeshBuffer::new());
        // A mesher must not remember other samples.
        let turned_over = DualSettings { isovalue: -settings.isovalue, ..settings };
        mesher.mesh_dual(samples, &turned_over, &mut mesh).expect("the samples can be meshed");
        mesher.mesh_dual(samples, &settings, &mut mesh).expect("the samples can be meshed");
        assert_eq!(mesh.positions, positions, "{}", backend.name());
        assert_eq!(mesh.indices, expected.indices, "{}", backend.name());
        assert_eq!(mesh.materials, expected.materials, "{}", backend.name());
        let bits: Vec<_> = mesh.normals.iter().map(|normal| normal.map(f32::to_bits)).collect();
        assert_eq!(bits.len(), positions.len());
        for (&vertex, normal) in &expected.normals {
            assert_eq!(bits[vertex], *normal, "{}: vertex {vertex}", backend.name());
        }
        assert_eq!(normals.get_or_insert_with(|| bits.clone()), &bits, "{}", backend.name());
        for normal in &mesh.normals {
            assert!((normal.iter().map(|v| v * v).sum::<f32>() - 1.0).abs() < 1e-5, "{normal:?}");
        }
        let bounds = mesh.positions.iter().fold(None, |bounds: Option<[[f32; 3]; 2]>, &p| {
            let [min, max] = bounds.unwrap_or([p, p]);
            Some([[0, 1, 2].map(|k| min[k].min(p[k])), [0, 1, 2].map(|k| max[k].max(p[k]))])
        });
        assert_eq!(mesh.bounds, bounds);
    }
}

/// No material, some of those that fields have, or all.
fn sharp_materials(number: u32) -> MaterialSet {
    match number % 4 {
        0 => MaterialSet::EMPTY,
        1 => [2, 250].into_iter().collect(),
        2 => (0..=255).filter(|material| material % 2 == 1).collect(),
        _ => MaterialSet::ALL,
    }
}

/// Mostly no creases; otherwise at any angle, at a common one, or nowhere.
fn crease_angle(number: u32) -> Option<f32> {
    [None, Some(0.0), Some(0.5), Some(1.2), Some(core::f32::consts::PI)].get(number as usize).copied().flatten()
}

fn compare_field<W: TestWeight>(field: &Field<W>, smoothing: u32, sharp: u32, crease: u32) {
    let (weights, materials) = (&field.weights, &field.materials);
    let volume = Volume {
        size: field.shape.size(),
        weights,
        materials,
        isovalue: field.isovalue,
        padded: false,
        smoothing: smoothing / 3,
        sharp: sharp_materials(sharp),
        crease: crease_angle(crease),
    };
    compare(&volume);
    if field.shape.size().iter().all(|&size| size >= if volume.crease.is_some() { 7 } else { 5 }) {
        compare(&Volume { padded: true, smoothing: 0, ..volume });
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, ..ProptestConfig::default() })]

    #[test]
    fn fields_of_i8_equal_the_reference(field in Field::<i8>::any(), smoothing in 0..6u32, sharp in 0..4u32, crease in 0..8u32) {
        compare_field(&field, smoothing, sharp, crease);
    }

    #[test]
    fn fields_of_i16_equal_the_reference(field in Field::<i16>::any(), smoothing in 0..6u32, sharp in 0..4u32, crease in 0..8u32) {
        compare_field(&field, smoothing, sharp, crease);
    }

    #[test]
    fn fields_of_f32_equal_the_reference(field in Field::<f32>::any(), smoothing in 0..6u32, sharp in 0..4u32, crease in 0..8u32) {
        compare_field(&field, smoothing, sharp, crease);
    }
}

/// A field without end: white noise of a few values, or hills.
fn weight(seed: u64, point: [i32; 3]) -> i16 {
    let bits = random(seed, point);
    let [x, y, z] = point.map(|v| v as f32);
    match seed % 3 {
        0 => (bits % 7) as i16 - 3,
        1 => bits as i16,
        _ => i16::from_voxels((x / 3.7).sin() * 3.0 + (y / 2.9).cos() * 2.0 + (z / 4.3).sin() * 3.0),
    }
}

/// The samples of a block: those from `min` on, `size` of them, and `layers` more around them; air outside of `extent`.
fn block(seed: u64, min: [i32; 3], size: i32, layers: i32, extent: [i32; 2]) -> (Shape, Vec<i16>, Vec<u8>) {
    let along = |axis: usize| min[axis] - layers..min[axis] + size + layers;
    let points = along(2).flat_map(|z| along(1).flat_map(move |y| along(0).map(move |x| [x, y, z])));
    let is_within = |point: [i32; 3]| point.iter().all(|&v| extent[0] < v && v < extent[1]);
    let sampled = points.map(|point| {
        let weight = if is_within(point) { weight(seed, point) } else { i16::OUTSIDE };
        (weight, (random(seed, point) >> 32) as u8)
    });
    let (weights, materials) = sampled.unzip();
    (Shape::cube((size + 2 * layers) as u32).expect("a small shape"), weights, materials)
}

#[test]
fn chunks_of_all_sizes_equal_the_reference() {
    for (cells, smoothing) in [(8, 0), (8, 6), (9, 1), (16, 0), (31, 0), (32, 2), (33, 0), (62, 0)] {
        for seed in [0, 2] {
            for (sharp, crease) in [(0, None), (2, None), (3, None), (2, Some(0.5))] {
                let layers = 2 + smoothing + i32::from(crease.is_some());
                if layers > cells {
                    continue;
                }
                let (shape, weights, materials) = block(seed, [0; 3], cells, layers, [-90, 90]);
                let (size, padded, smoothing, sharp) = (shape.size(), true, smoothing as u32, sharp_materials(sharp));
                let (weights, materials) = (&weights, &materials);
                compare(&Volume { size, weights, materials, isovalue: 0.25, padded, smoothing, sharp, crease });
            }
        }
    }
}

/// Chunks of one field: vertices of a cell are equal in all meshes that have them, and together the meshes are closed.
#[test]
fn borders_are_equal_and_the_union_is_closed() {
    let mut mesher = Mesher::new();
    for (cells, smoothing, seed) in (0..36).map(|i| (8 + i % 5, [0, 0, 1, 4][i as usize % 4], i as u64)) {
        let chunks = 2;
        // Air from the lowest lattice points on, as at the border of a bounded grid.
        let extent = [0, chunks * cells];
        let mut welded = BTreeMap::new();
        let (mut positions, mut indices) = (Vec::new(), Vec::new());
        for chunk in (0..chunks * chunks * chunks).map(|i| [i % 2, i / 2 % 2, i / 4]) {
            let min = chunk.map(|v| v * cells);
            let (shape, weights, materials) = block(seed, min, cells, 2 + smoothing, extent);
            let samples = Samples::new(shape, &weights).and_then(|samples| samples.with_materials(&materials));
            let samples = samples.expect("one weight and one material a sample").padded();
            let sharp = sharp_materials(seed as u32 / 4);
            let settings = DualSettings { smoothing: smoothing as u32, sharp, ..DualSettings::default() };
            let mut mesh = MeshBuffer::new();
            mesher.mesh_dual(samples, &settings, &mut mesh).expect("a chunk can be meshed");
            let ids: Vec<u32> = (0..mesh.positions.len())
                .map(|vertex| {
                    let place = [0, 1, 2]
                        .map(|axis| (f64::from(mesh.positions[vertex][axis]) + f64::from(min[axis])).to_bits());
                    let look = (mesh.normals[vertex].map(f32::to_bits), mesh.materials[vertex]);
                    let &mut (id, other) = welded.entry(place).or_insert_with(|| {
                        positions.push(place.map(|v| f64::from_bits(v) as f32));
                        (positions.len() as u32 - 1, look)
                    });
                    assert_eq!(look, other, "at {:?}", place.map(f64::from_bits));
                    id
                })
                .collect();
            indices.extend(mesh.indices.iter().map(|&index| ids[index as usize]));
        }
        let report = MeshReport::new(&positions, &indices);
        assert!(report.triangles > 100 && report.is_closed(), "{report}");
        let flaws = [report.non_manifold_edges, report.non_manifold_vertices, report.inconsistent_edges];
        // With smoothing and with planes, two vertices of a cell may meet, and welding joins them.
        if smoothing == 0 && seed / 4 % 4 == 0 || seed % 3 == 2 {
            assert_eq!(flaws, [0; 3], "{report}");
        }
        assert_eq!((report.zero_area_triangles, report.duplicate_triangles), (0, 0), "{report}");
    }
}

/// The triangles of a mesh, in world coordinates, each from its least corner on: positions, normals and materials.
fn triangles_of(mesh: &MeshBuffer, min: [i32; 3]) -> Vec<[([u64; 3], [u32; 3], u8); 3]> {
    let corner = |vertex: u32| {
        let vertex = vertex as usize;
        let place = [0, 1, 2].map(|axis| (f64::from(mesh.positions[vertex][axis]) + f64::from(min[axis])).to_bits());
        (place, mesh.normals[vertex].map(f32::to_bits), mesh.materials[vertex])
    };
    let from_least = |triangle: [u32; 3]| {
        let mut corners = triangle.map(corner);
        let least = (0..3).min_by_key(|&at| corners[at]).unwrap_or_default();
        corners.rotate_left(least);
        corners
    };
    mesh.triangles().map(from_least).collect()
}

/// Chunks of one field, with creases: their triangles are those of the whole field, with the same normals.
#[test]
fn sharp_chunks_are_parts_of_the_whole() {
    let mut mesher = Mesher::new();
    for (cells, smoothing, seed) in (0..18).map(|i| (8 + i % 4, [0, 2, 0][i as usize % 3], i as u64)) {
        let extent = [0, 2 * cells];
        let crease = if cells % 2 == 0 && seed % 4 == 0 { None } else { Some(0.4 + 0.1 * (seed % 5) as f32) };
        let sharp = sharp_materials(1 + seed as u32 % 3);
        let settings = DualSettings { smoothing, sharp, crease, ..DualSettings::default() };
        let mut triangles = |min: [i32; 3], size: i32| {
            let (shape, weights, materials) = block(seed, min, size, settings.padding() as i32, extent);
            let samples = Samples::new(shape, &weights).and_then(|samples| samples.with_materials(&materials));
            let samples = samples.expect("one weight and one material a sample").padded();
            let mut mesh = MeshBuffer::new();
            mesher.mesh_dual(samples, &settings, &mut mesh).expect("a chunk can be meshed");
            triangles_of(&mesh, min)
        };
        let mut whole = triangles([0; 3], 2 * cells);
        let chunks = (0..8).map(|i| [i % 2, i / 2 % 2, i / 4].map(|v| v * cells));
        let mut parts: Vec<_> = chunks.flat_map(|min| triangles(min, cells)).collect();
        whole.sort();
        parts.sort();
        assert!(whole.len() > 100);
        assert!(parts == whole, "{cells} cells, {smoothing} steps, seed {seed}, {crease:?}");
    }
}

/// Copies lie where their vertex lies, and otherwise nothing changes but normals.
#[test]
fn creases_change_normals_alone() {
    let (mut mesher, mut smooth, mut creased) = (Mesher::new(), MeshBuffer::new(), MeshBuffer::new());
    for seed in 0..12 {
        let (shape, weights, materials) = block(seed, [0; 3], 16, 0, [0, 15]);
        let samples = Samples::new(shape, &weights).and_then(|samples| samples.with_materials(&materials));
        let samples = samples.expect("one weight and one material a sample");
        let mut settings = DualSettings { sharp: sharp_materials(seed as u32), ..DualSettings::default() };
        settings.crease = Some(core::f32::consts::PI);
        mesher.mesh_dual(samples, &settings, &mut smooth).expect("there are cells");
        settings.crease = Some(0.3);
        mesher.mesh_dual(samples, &settings, &mut creased).expect("there are cells");
        let at = |mesh: &MeshBuffer| -> Vec<_> {
            mesh.indices
                .iter()
                .map(|&vertex| (mesh.positions[vertex as usize], mesh.materials[vertex as usize]))
                .collect()
        };
        assert_eq!(at(&smooth), at(&creased));
        let copies = creased.positions.len() - smooth.positions.len();
        if settings.sharp.is_empty() || settings.sharp == MaterialSet::ALL {
            assert_eq!(copies > 0, !settings.sharp.is_empty(), "seed {seed}");
        }
        assert_eq!(creased.positions[..smooth.positions.len()], smooth.positions);
        assert_eq!(creased.normals.len(), creased.positions.len());
        settings.normals = false;
        mesher.mesh_dual(samples, &settings, &mut creased).expect("there are cells");
        assert_eq!((&creased.positions, creased.normals.len()), (&smooth.positions, 0));
    }
}

/// Meshes of samples without materials are those of material 0.
#[test]
fn samples_without_materials_have_material_0() {
    let (mut mesher, mut plain, mut mesh) = (Mesher::new(), MeshBuffer::new(), MeshBuffer::new());
    let (shape, weights, _) = block(2, [0; 3], 16, 0, [0, 15]);
    let (samples, materials) = (Samples::new(shape, &weights).expect("one weight a sample"), vec![0; shape.len()]);
    for (sharp, is_sharp) in [(MaterialSet::EMPTY.with(0), true), (sharp_materials(2), false)] {
        let settings = DualSettings { sharp, crease: Some(0.5), ..DualSettings::default() };
        mesher.mesh_dual(samples, &settings, &mut mesh).expect("there are cells");
        let with_materials = samples.with_materials(&materials).expect("one material a sample");
        mesher.mesh_dual(with_materials, &settings, &mut plain).expect("there are cells");
        assert!(mesh.materials.is_empty());
        assert_eq!((&mesh.positions, &mesh.indices), (&plain.positions, &plain.indices));
        mesher.mesh_dual(samples, &DualSettings::default(), &mut plain).expect("there are cells");
        assert_eq!(mesh.positions != plain.positions, is_sharp);
    }
}

#[test]
fn a_million_patterns_of_3_by_3_by_3_cells_are_sound() {
    let (mut random, mut mesher, mut mesh) = (Rng::with_seed(36), Mesher::new(), MeshBuffer::new());
    let shape = Shape::cube(4).expect("a small shape");
    let (mut triangles, mut crossing) = (0, 0);
    for pattern in 0..1_000_000 {
        let share = 77 + random.u32(..168);
        let weights: [i8; 64] = core::array::from_fn(|_| {
            let inside = random.u32(..256) < share;
            let size = if pattern % 2 == 0 { 1 } else { 1 + random.i8(..100) };
            if inside { -size } else { size - i8::from(pattern % 8 == 1) }
        });
        let samples = Samples::new(shape, &weights).expect("one weight a sample");
        let sharp = if pattern % 3 == 0 { MaterialSet::ALL } else { MaterialSet::EMPTY };
        let settings = DualSettings { normals: false, sharp, ..DualSettings::default() };
        mesher.mesh_dual(samples, &settings, &mut mesh).expect("there are cells");
        let report = MeshReport::new(&mesh.positions, &mesh.indices);
        let mut flawless = report.clone();
        flawless.crossing_triangles = 0;
        if !sharp.is_empty() {
            flawless.duplicate_vertices = 0;
        }
        assert!(flawless.is_clean(), "{report}: {weights:?}");
        assert!(mesh.positions.as_flattened().iter().all(|v| v.fract() != 0.0), "on a face of its cell: {weights:?}");
        triangles += report.triangles;
        crossing += report.crossing_triangles;
    }
    println!("{triangles} triangles, {crossing} pairs cross");
    assert!(triangles > 10_000_000);
}

#[test]
fn enclosed_noise_is_closed_and_has_no_flaw() {
    let (mut mesher, mut mesh) = (Mesher::new(), MeshBuffer::new());
    for seed in 0..30 {
        let (shape, weights, _) = block(seed, [0; 3], 24, 0, [0, 23]);
        let samples = Samples::new(shape, &weights).expect("one weight a sample");
        let sharp = if seed >= 15 { MaterialSet::ALL } else { MaterialSet::EMPTY };
        mesher
            .mesh_dual(samples, &DualSettings { sharp, ..DualSettings::default() }, &mut mesh)
            .expect("there are cells");
        let report = MeshReport::new(&mesh.positions, &mesh.indices);
        let mut flawless = report.clone();
        flawless.crossing_triangles = 0;
        if !sharp.is_empty() {
            flawless.duplicate_vertices = 0;
        }
        assert!(report.is_closed() && flawless.is_clean() && report.triangles > 1000, "{report}");
    }
}

#[test]
fn samples_that_do_not_suffice_are_typed_errors() {
    let mut mesh = MeshBuffer { positions: vec![[0.0; 3]], ..MeshBuffer::new() };
    let mut refused = |size: u32, padded: bool, settings: DualSettings| {
        let shape = Shape::cube(size).expect("a small shape");
        let weights = vec![0i8; shape.len()];
        let samples = Samples::new(shape, &weights).expect("one weight a sample");
        let samples = if padded { samples.padded() } else { samples };
        let refused = Mesher::new().mesh_dual(samples, &settings, &mut mesh).err();
        assert_eq!(mesh, MeshBuffer::new());
        refused
    };
    let smoothing = |smoothing: u32| DualSettings { smoothing, ..DualSettings::default() };
    let too_small = |size, least| Some(MeshError::TooSmall { shape: Shape::cube(size).expect("a small shape"), least });
    assert_eq!(refused(1, false, smoothing(0)), too_small(1, 2));
    assert_eq!(refused(4, true, smoothing(0)), too_small(4, 5));
    assert_eq!(refused(8, true, smoothing(2)), too_small(8, 9));
    assert_eq!((refused(2, false, smoothing(8)), refused(5, true, smoothing(0))), (None, None));
    assert_eq!(refused(2, false, smoothing(9)), Some(MeshError::Smoothing { found: 9, most: 8 }));
    // A chunk of 8 cells takes up to 6 steps.
    assert_eq!(refused(8 + 2 * 8, true, smoothing(6)), None);
    assert_eq!(refused(8 + 2 * 9, true, smoothing(7)), Some(MeshError::Smoothing { found: 7, most: 6 }));
    let creased = |angle| DualSettings { crease: Some(angle), ..DualSettings::default() };
    assert_eq!(refused(6, true, creased(0.5)), too_small(6, 7));
    assert_eq!((refused(7, true, creased(0.0)), refused(2, false, creased(core::f32::consts::PI))), (None, None));
    assert_eq!(refused(8, true, creased(-0.1)), Some(MeshError::Crease { found: -0.1 }));
    assert_eq!(refused(8, true, creased(3.15)), Some(MeshError::Crease { found: 3.15 }));
    assert!(matches!(refused(8, true, creased(f32::NAN)), Some(MeshError::Crease { found }) if found.is_nan()));
    let both = |smoothing| DualSettings { smoothing, ..creased(0.5) };
    assert_eq!(refused(8 + 2 * 8, true, both(5)), None);
    assert_eq!(refused(8 + 2 * 9, true, both(6)), Some(MeshError::Smoothing { found: 6, most: 5 }));
    let infinite = DualSettings { isovalue: f32::INFINITY, ..DualSettings::default() };
    assert_eq!(refused(8, true, infinite), Some(MeshError::Isovalue { found: f32::INFINITY }));
}

/// The reference's own vertices: one for each loop, in different places of its cell.
#[test]
fn vertices_of_a_cell_lie_apart() {
    for seed in 0..3 {
        let (shape, weights, materials) = block(seed, [0; 3], 12, 0, [0, 11]);
        let (size, isovalue, padded, smoothing) = (shape.size(), 0.0, false, 0);
        let (weights, materials, sharp, crease) = (&weights, &materials, MaterialSet::EMPTY, None);
        let mesh = Volume { size, weights, materials, isovalue, padded, smoothing, sharp, crease }.mesh();
        let places: BTreeSet<_> = mesh.positions.iter().collect();
        assert_eq!(places.len(), mesh.positions.len());
        for (position, cell) in mesh.positions.iter().zip(&mesh.cells) {
            assert!((0..3).all(|axis| (1..STEPS).contains(&(position[axis] - STEPS * i64::from(cell[axis])))));
        }
    }
}
