//! `ExtractionReport`: every mesh has its vertices on the crossings of its samples, and the report counts those that
//! are missing, repeated or elsewhere.

use fastrand::Rng;
use marchless::{ExtractionReport, MeshBuffer, MeshSettings, Mesher, Samples, Shape, Topology, Weight};
use proptest::prelude::*;

use crate::support::{Field, TestWeight};

const TOPOLOGIES: [Topology; 2] = [Topology::Separated, Topology::Trilinear];

fn mesh<W: Weight>(samples: Samples<'_, W>, settings: &MeshSettings) -> MeshBuffer {
    let mut mesh = MeshBuffer::new();
    Mesher::new().mesh(samples, settings, &mut mesh).expect("the samples can be meshed");
    mesh
}

/// The number of lattice edges whose ends are on different sides, counted from the samples.
fn crossings<W: TestWeight>(field: &Field<W>) -> usize {
    let [nx, ny, nz] = field.meshed_size();
    let padding = u32::from(field.padded);
    let inside = |x: u32, y: u32, z: u32| {
        field.weights[field.shape.index([x + padding, y + padding, z + padding])].to_voxels() < field.isovalue
    };
    let mut count = 0;
    for z in 0..nz {
        for y in 0..ny {
            for x in 0..nx {
                let here = inside(x, y, z);
                count += usize::from(x + 1 < nx && inside(x + 1, y, z) != here);
                count += usize::from(y + 1 < ny && inside(x, y + 1, z) != here);
                count += usize::from(z + 1 < nz && inside(x, y, z + 1) != here);
            }
        }
    }
    count
}

fn check<W: TestWeight>(field: &Field<W>) -> Result<(), TestCaseError> {
    for topology in TOPOLOGIES {
        let settings = MeshSettings { isovalue: field.isovalue, topology, ..MeshSettings::default() };
        let mut mesh = mesh(field.samples(), &settings);
        let sound = ExtractionReport::new(field.samples(), &settings, &mesh);
        prop_assert!(sound.is_sound(), "{}", sound);
        prop_assert_eq!((sound.vertices, sound.crossings), (mesh.positions.len(), crossings(field)));
        prop_assert_eq!(sound.vertices, sound.crossings + sound.interior_vertices);
        prop_assert_eq!(topology == Topology::Separated && sound.interior_vertices > 0, false);

        // A vertex that is missing, and one that is repeated.
        let Some(vertex) = mesh.positions.iter().position(|p| p.iter().filter(|v| v.fract() == 0.0).count() == 2)
        else {
            continue;
        };
        let removed = mesh.positions.remove(vertex);
        let report = ExtractionReport::new(field.samples(), &settings, &mesh);
        let mut expected = sound.clone();
        (expected.vertices, expected.missing) = (sound.vertices - 1, 1);
        prop_assert_eq!(report, expected);
        mesh.positions.extend([removed; 2]);
        let report = ExtractionReport::new(field.samples(), &settings, &mesh);
        let mut expected = sound.clone();
        (expected.vertices, expected.repeated) = (sound.vertices + 1, 1);
        prop_assert_eq!(report, expected);
        mesh.positions.pop();

        // A vertex elsewhere on its edge; vertices on no edge, which leave their crossing without a vertex.
        let axis = removed.iter().position(|v| v.fract() != 0.0).expect("it lies on an edge");
        let mut moved = removed;
        moved[axis] = moved[axis].floor() + if moved[axis].fract() > 0.5 { 0.25 } else { 0.75 };
        for (position, missing) in [(moved, 0), (removed.map(f32::floor), 1), ([f32::NAN; 3], 1), ([-0.5; 3], 1)] {
            *mesh.positions.last_mut().expect("it was put there") = position;
            let report = ExtractionReport::new(field.samples(), &settings, &mesh);
            prop_assert!(!report.is_sound());
            let mut expected = sound.clone();
            (expected.off_crossing, expected.missing) = (1, missing);
            prop_assert_eq!(report, expected);
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, ..ProptestConfig::default() })]

    #[test]
    fn meshes_of_i8_are_sound(field in Field::<i8>::any()) {
        check(&field)?;
    }

    #[test]
    fn meshes_of_i16_are_sound(field in Field::<i16>::any()) {
        check(&field)?;
    }

    #[test]
    fn meshes_of_f32_are_sound(field in Field::<f32>::any()) {
        check(&field)?;
    }

    #[test]
    fn counts_of_random_vertices_are_consistent(
        field in Field::<f32>::any(),
        positions in proptest::collection::vec(
            proptest::array::uniform3(prop_oneof![proptest::num::f32::ANY, 0f32..5.0, (0..5u8).prop_map(f32::from)]),
            0..40,
        ),
        isovalue in proptest::num::f32::ANY,
        trilinear: bool,
    ) {
        let topology = TOPOLOGIES[usize::from(trilinear)];
        let settings = MeshSettings { isovalue, topology, ..MeshSettings::default() };
        let mesh = MeshBuffer { positions, ..MeshBuffer::default() };
        let report = ExtractionReport::new(field.samples(), &settings, &mesh);
        prop_assert!(report.off_crossing + report.repeated + report.interior_vertices <= report.vertices);
        prop_assert!(report.missing <= report.crossings);
        prop_assert!(report.crossings - report.missing <= report.vertices);
        prop_assert!(report.to_string().contains(" crossing"));
    }
}

/// Two cells, of which only the first is active: one of its corners is inside.
#[test]
fn interior_vertices_belong_to_active_cells_of_the_trilinear_topology() {
    let shape = Shape::new([3, 2, 2]).expect("a small shape");
    let mut weights = [1i16; 12];
    weights[0] = -1;
    let samples = Samples::new(shape, &weights).expect("one weight a sample");
    let report = |topology, position| {
        let settings = MeshSettings { topology, ..MeshSettings::default() };
        let mut mesh = mesh(samples, &settings);
        mesh.positions.push(position);
        let report = ExtractionReport::new(samples, &settings, &mesh);
        assert_eq!((report.crossings, report.missing, report.repeated), (3, 0, 0));
        [report.interior_vertices, report.off_crossing]
    };
    let [separated, trilinear] = TOPOLOGIES;
    assert_eq!(report(trilinear, [0.25, 0.5, 0.75]), [1, 0]);
    assert_eq!(report(separated, [0.25, 0.5, 0.75]), [0, 1], "the topology has none");
    assert_eq!(report(trilinear, [1.25, 0.5, 0.75]), [0, 1], "the surface does not come there");
    assert_eq!(report(trilinear, [0.25, 0.5, 0.0]), [0, 1], "on a face");
    assert_eq!(report(trilinear, [1.5, 0.0, 0.0]), [0, 1], "on an edge without a crossing");
    assert_eq!(report(trilinear, [2.25, 0.0, 0.0]), [0, 1], "beyond the last sample");
}

/// White noise has cells of every kind.
#[test]
fn only_the_trilinear_topology_has_interior_vertices() {
    let shape = Shape::cube(16).expect("a small shape");
    let mut random = Rng::with_seed(16);
    let weights: Vec<i16> = (0..shape.len()).map(|_| random.i16(..)).collect();
    let samples = Samples::new(shape, &weights).expect("one weight a sample");
    for topology in TOPOLOGIES {
        let settings = MeshSettings { topology, ..MeshSettings::default() };
        let report = ExtractionReport::new(samples, &settings, &mesh(samples, &settings));
        assert!(report.is_sound(), "{report}");
        assert_eq!(report.interior_vertices > 0, topology == Topology::Trilinear, "{report}");
        assert_eq!(report.vertices, report.crossings + report.interior_vertices, "{report}");
    }
}

#[test]
fn samples_that_cannot_be_meshed_have_no_crossings() {
    let weights = [-1.0f32, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0];
    let samples = Samples::new(Shape::cube(2).expect("a small shape"), &weights).expect("one weight a sample");
    let vertex = MeshBuffer { positions: vec![[0.5, 0.0, 0.0]], ..MeshBuffer::default() };
    let with = |isovalue| MeshSettings { isovalue, ..MeshSettings::default() };
    let counts = |samples, isovalue| {
        let report = ExtractionReport::new(samples, &with(isovalue), &vertex);
        [report.crossings, report.missing, report.off_crossing]
    };
    assert_eq!(counts(samples, 0.0), [3, 2, 0]);
    assert_eq!(counts(samples.padded(), 0.0), [0, 0, 1]);
    assert_eq!(counts(samples, f32::INFINITY), [0, 0, 1]);
    assert_eq!(counts(samples, f32::NAN), [0, 0, 1]);
}
