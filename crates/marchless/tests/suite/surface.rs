//! The guarantees for every surface, with any samples and in both topologies: closed within the box, 2-manifold,
//! consistently oriented, nothing degenerate, vertices on the crossings, normals of length 1. Smooth fields have
//! further ones.

use std::collections::HashMap;

use fastrand::Rng;
use marchless::{ExtractionReport, MeshBuffer, MeshReport, MeshSettings, Mesher, Samples, Shape, Topology, Weight};
use proptest::{prelude::*, sample::select};

use crate::support::{Field, TestWeight};

const TOPOLOGIES: [Topology; 2] = [Topology::Separated, Topology::Trilinear];

fn mesh<W: Weight>(samples: Samples<'_, W>, settings: &MeshSettings) -> MeshBuffer {
    let mut mesh = MeshBuffer::new();
    Mesher::new().mesh(samples, settings, &mut mesh).expect("the samples can be meshed");
    mesh
}

fn settings(isovalue: f32, topology: Topology) -> MeshSettings {
    MeshSettings { isovalue, topology, ..MeshSettings::default() }
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    (0..3).map(|axis| a[axis] * b[axis]).sum()
}

fn minus(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [0, 1, 2].map(|axis| a[axis] - b[axis])
}

fn unit(v: [f32; 3]) -> [f32; 3] {
    v.map(|component| component / dot(v, v).sqrt())
}

/// The sides of triangles whose reverse is no side of another triangle.
fn open_sides(mesh: &MeshBuffer) -> Vec<[u32; 2]> {
    let mut sides = HashMap::new();
    for [a, b, c] in mesh.triangles() {
        for [from, to] in [[a, b], [b, c], [c, a]] {
            if sides.remove(&[to, from]).is_none() {
                sides.insert([from, to], ());
            }
        }
    }
    sides.into_keys().collect()
}

fn check<W: TestWeight>(field: &Field<W>, topology: Topology) -> Result<(), TestCaseError> {
    let settings = settings(field.isovalue, topology);
    let mesh = mesh(field.samples(), &settings);
    let report = MeshReport::new(&mesh.positions, &mesh.indices);
    prop_assert!(report.is_clean(), "{}", report);
    let report_of_places = ExtractionReport::new(field.samples(), &settings, &mesh);
    prop_assert!(report_of_places.is_sound(), "{}", report_of_places);

    let open = open_sides(&mesh);
    prop_assert_eq!(open.len(), report.boundary_edges);
    for side in open {
        let ends = side.map(|vertex| mesh.positions[vertex as usize]);
        let on_border = (0..3).any(|axis| {
            let last = (field.meshed_size()[axis] - 1) as f32;
            ends.iter().all(|end| end[axis] == 0.0) || ends.iter().all(|end| end[axis] == last)
        });
        prop_assert!(on_border, "open within the box, between {:?}", ends);
    }
    for &normal in &mesh.normals {
        prop_assert!((dot(normal, normal) - 1.0).abs() < 1e-5, "{:?} is no unit vector", normal);
    }
    Ok(())
}

/// The field with air in its outermost samples.
fn enclosed<W: TestWeight>(mut field: Field<W>) -> Field<W> {
    let size = field.shape.size();
    let depth = 1 + u32::from(field.padded);
    for index in 0..field.weights.len() as u32 {
        let at = [index % size[0], index / size[0] % size[1], index / size[0] / size[1]];
        if (0..3).any(|axis| at[axis] < depth || at[axis] + depth >= size[axis]) {
            field.weights[index as usize] = W::OUTSIDE;
        }
    }
    field
}

fn check_enclosed<W: TestWeight>(field: &Field<W>, topology: Topology) -> Result<(), TestCaseError> {
    let mesh = mesh(field.samples(), &settings(field.isovalue, topology));
    let report = MeshReport::new(&mesh.positions, &mesh.indices);
    prop_assert!(report.is_closed() && report.is_clean(), "{}", report);
    prop_assert_eq!(report.euler % 2, 0);
    Ok(())
}

fn check_both<W: TestWeight>(field: Field<W>) -> Result<(), TestCaseError> {
    for topology in TOPOLOGIES {
        check(&field, topology)?;
    }
    let field = enclosed(field);
    TOPOLOGIES.into_iter().try_for_each(|topology| check_enclosed(&field, topology))
}

proptest! {
    #[test]
    fn fields_of_i8_have_sound_surfaces(field in Field::<i8>::any()) {
        check_both(field)?;
    }

    #[test]
    fn fields_of_i16_have_sound_surfaces(field in Field::<i16>::any()) {
        check_both(field)?;
    }

    #[test]
    fn fields_of_f32_have_sound_surfaces(field in Field::<f32>::any()) {
        check_both(field)?;
    }

    /// The plane's distances are whole steps, so that the samples are exact. Crossings are rounded to 2⁻¹⁴ of their
    /// edges.
    #[test]
    fn planes_are_exact(
        slope in proptest::array::uniform3(-200i16..=200),
        offset in -1500i16..1500,
        padded: bool,
        topology in select(&TOPOLOGIES[..]),
    ) {
        prop_assume!(slope != [0; 3]);
        let shape = Shape::new([9, 6, 7]).expect("the sizes are small");
        let padding = i16::from(padded);
        let weights: Vec<i16> = (0..shape.len() as i16)
            .map(|index| {
                let at = [index % 9, index / 9 % 6, index / 54].map(|at| at - padding);
                offset + (0..3).map(|axis| slope[axis] * at[axis]).sum::<i16>()
            })
            .collect();
        let samples = Samples::new(shape, &weights).expect("one weight a sample");
        let mesh = mesh(if padded { samples.padded() } else { samples }, &settings(0.0, topology));

        let slope = slope.map(f32::from);
        let normal = unit(slope);
        for (&position, &found) in mesh.positions.iter().zip(&mesh.normals) {
            for axis in 0..3 {
                prop_assert!((found[axis] - normal[axis]).abs() < 1e-6, "{:?} for {:?}", found, normal);
            }
            let along = position.iter().map(|v| v.fract()).fold(0.0, f32::max);
            // Clamped crossings are not on the plane.
            if (0.001..0.999).contains(&along) {
                let distance = (dot(position, slope) + f32::from(offset)) / dot(slope, slope).sqrt();
                prop_assert!(distance.abs() < 0.5 / 16_384.0 + 1e-5, "{:?} is {} off the plane", position, distance);
            }
        }
    }

    #[test]
    fn balls_face_outside(
        center in proptest::array::uniform3(6.0f32..9.0),
        radius in 2.5f32..5.0,
        isovalue in -0.5f32..0.5,
        topology in select(&TOPOLOGIES[..]),
    ) {
        let shape = Shape::cube(16).expect("16 is small");
        let weights: Vec<f32> = (0..shape.len())
            .map(|index| {
                let from_center = minus([index % 16, index / 16 % 16, index / 256].map(|at| at as f32), center);
                dot(from_center, from_center).sqrt() - radius
            })
            .collect();
        let samples = Samples::new(shape, &weights).expect("one weight a sample");
        let mesh = mesh(samples, &settings(isovalue, topology));
        let report = MeshReport::new(&mesh.positions, &mesh.indices);
        prop_assert!(report.is_closed() && report.is_clean(), "{}", report);
        prop_assert_eq!((report.components, report.euler), (1, 2));
        for (&position, &normal) in mesh.positions.iter().zip(&mesh.normals) {
            let from_center = minus(position, center);
            let off = dot(from_center, from_center).sqrt() - radius - isovalue;
            prop_assert!(off.abs() < 0.1, "{:?} is {} off the ball", position, off);
            prop_assert!(dot(normal, unit(from_center)) > 0.98, "{:?} at {:?}", normal, from_center);
        }
        // The volume enclosed is positive only where triangles turn counter-clockwise, and close to the ball's.
        let volume: f32 = mesh
            .triangles()
            .map(|triangle| {
                let [[ax, ay, az], [bx, by, bz], c] = triangle.map(|v| minus(mesh.positions[v as usize], center));
                dot([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], c) / 6.0
            })
            .sum();
        let expected = 4.0 / 3.0 * core::f32::consts::PI * (radius + isovalue).powi(3);
        prop_assert!((0.8..1.01).contains(&(volume / expected)), "{} for {}", volume, expected);
    }
}

/// `f32` resolves the clamp of crossings even at the far end of the longest row with guarantees.
#[test]
fn rows_of_4096_cells_are_sound() {
    let shape = Shape::new([4097, 3, 3]).expect("it fits in memory");
    let mut random = Rng::with_seed(4096);
    let weights: Vec<i16> = (0..shape.len()).map(|_| random.i16(-1..=1)).collect();
    for size in [[4097, 3, 3], [3, 4097, 3], [3, 3, 4097]] {
        let shape = Shape::new(size).expect("it fits in memory");
        let samples = Samples::new(shape, &weights).expect("one weight a sample");
        for topology in TOPOLOGIES {
            let mesh = mesh(samples, &settings(0.0, topology));
            let report = MeshReport::new(&mesh.positions, &mesh.indices);
            assert!(report.is_clean() && report.triangles > 10_000, "{report}");
        }
    }
}

/// A ball in a cube of samples.
fn ball(size: u32) -> Vec<f32> {
    let middle = (size as f32 - 1.0) / 2.0;
    let axis = || (0..size).map(move |v| v as f32 - middle);
    axis()
        .flat_map(|z| axis().flat_map(move |y| axis().map(move |x| (x * x + y * y + z * z).sqrt() - 0.7 * middle)))
        .collect()
}

#[test]
fn refused_samples_are_typed_errors_and_clear_the_buffer() {
    let cube = |size| Shape::cube(size).expect("small");
    let weights = ball(8);
    let (mut mesher, mut mesh) = (Mesher::new(), MeshBuffer::new());
    let good = Samples::new(cube(8), &weights).expect("one weight a sample");
    let mut refused = |samples: Samples<'_, f32>, isovalue, expected: &str| {
        mesher.mesh(good, &MeshSettings::default(), &mut mesh).expect("a ball");
        assert!(!mesh.is_empty());
        let settings = MeshSettings { isovalue, ..MeshSettings::default() };
        let error = mesher.mesh(samples, &settings, &mut mesh).expect_err("it cannot be meshed");
        assert_eq!(error.to_string(), expected);
        assert_eq!(mesh, MeshBuffer::new());
    };
    refused(good, f32::NAN, "the isovalue must be finite, but it is NaN");
    refused(good, f32::INFINITY, "the isovalue must be finite, but it is inf");
    let flat = Samples::new(Shape::new([1, 2, 2]).expect("small"), &weights[..4]).expect("one weight a sample");
    refused(flat, 0.0, "meshing needs at least 2 samples per axis, but there are 1 × 2 × 2");
    let thin = Samples::new(cube(3), &weights[..27]).expect("one weight a sample").padded();
    refused(thin, 0.0, "meshing needs at least 4 samples per axis, but there are 3 × 3 × 3");
}

#[test]
fn a_reused_buffer_holds_only_the_requested_attributes() {
    let (weights, materials) = (ball(12), vec![7; 12 * 12 * 12]);
    let samples = Samples::new(Shape::cube(12).expect("small"), &weights).expect("one weight a sample");
    let with_materials = samples.with_materials(&materials).expect("one material a sample");
    let (mut mesher, mut mesh) = (Mesher::new(), MeshBuffer::new());
    let mut lengths = |samples, normals| {
        mesher.mesh(samples, &MeshSettings { normals, ..MeshSettings::default() }, &mut mesh).expect("a ball");
        [mesh.positions.len(), mesh.normals.len(), mesh.materials.len()]
    };
    let [count, ..] = lengths(with_materials, true);
    assert!(count > 0);
    assert_eq!(lengths(with_materials, true), [count, count, count]);
    assert_eq!(lengths(samples, true), [count, count, 0]);
    assert_eq!(lengths(with_materials, false), [count, 0, count]);
    assert_eq!(lengths(samples, false), [count, 0, 0]);
}

/// The meshes of a cell, and of the cell scaled by a power of two. The scale rounds nothing, so all decisions and all
/// triangles must be equal.
fn cell_and_scaled(weights: [f32; 8], isovalue: f32) -> [MeshBuffer; 2] {
    [1.0, 2f32.powi(-60)].map(|scale| {
        let weights = weights.map(|weight| weight * scale);
        let samples = Samples::new(Shape::cube(2).expect("small"), &weights).expect("one weight a sample");
        mesh(samples, &settings(isovalue * scale, Topology::Trilinear))
    })
}

proptest! {
    #[test]
    fn the_scale_of_weights_does_not_change_triangles(
        weights in proptest::array::uniform8(prop_oneof![-3.4e38f32..3.4e38, -1e37f32..1e37]),
        isovalue in prop_oneof![Just(0.0), -3e38f32..3e38],
    ) {
        let [cell, scaled] = cell_and_scaled(weights, isovalue);
        prop_assert_eq!(cell.indices, scaled.indices);
    }
}

/// A weight and an isovalue near opposite ends of `f32` have a difference that overflows `f32`.
#[test]
fn tunnels_are_found_at_the_limits_of_f32() {
    let (max, min) = (f32::MAX, f32::MIN);
    let wide = [
        2.435_109_1e38,
        -1.339_752_2e37,
        -1.099_354_9e38,
        2.903_498_7e38,
        6.965_222_3e37,
        7.400_441_3e37,
        -3.039_153_4e38,
        2.426_889_9e38,
    ];
    for (weights, isovalue) in [(wide, 7.251_333_6e37), ([min, min, min, max, max, min, min, min], -1.712_367_4e38)] {
        let [cell, scaled] = cell_and_scaled(weights, isovalue);
        assert_eq!(cell.indices, scaled.indices);
        let report = MeshReport::new(&cell.positions, &cell.indices);
        assert!(report.is_clean() && (report.components, report.euler) == (1, 0), "{report}");
    }
}
