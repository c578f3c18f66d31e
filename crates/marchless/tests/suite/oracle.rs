//! The mesher against a plain marching cubes, cell by cell: equal triangles in equal order, and vertices in equal
//! places.

use std::collections::HashMap;

use marchless::cell::CaseIndex;
use marchless::{MeshBuffer, MeshSettings, Mesher, Weight};
use proptest::prelude::*;

use crate::support::{Field, TestWeight};

/// The lattice edge of a vertex: the meshed sample at its lower end, and its axis.
type LatticeEdge = ([u32; 3], usize);

struct OracleVertex {
    edge: LatticeEdge,
    /// The fraction before rounding.
    fraction: f64,
    /// The gradients at both ends of the edge.
    slopes: [[f64; 3]; 2],
    material: u8,
}

impl OracleVertex {
    /// The normal of a vertex at `fraction` of the edge, of any length. `None` if its differences cancel out so much
    /// that rounding decides it.
    fn normal(&self, fraction: f64) -> Option<[f64; 3]> {
        let [a, b] = self.slopes;
        let normal: [f64; 3] = core::array::from_fn(|k| a[k] + (b[k] - a[k]) * fraction);
        let largest = |v: &[f64]| v.iter().fold(0.0f64, |largest, v| largest.max(v.abs()));
        (largest(&normal) > 0.01 * largest(&[a, b].concat())).then_some(normal)
    }
}

/// The plain marching cubes: each cell by itself, with vertices looked up by their edges.
fn march<W: TestWeight>(field: &Field<W>) -> (Vec<OracleVertex>, Vec<u32>) {
    let [nx, ny, nz] = field.meshed_size();
    let (mut vertices, mut indices) = (Vec::new(), Vec::new());
    let mut known: HashMap<LatticeEdge, u32> = HashMap::new();
    for z in 0..nz - 1 {
        for y in 0..ny - 1 {
            for x in 0..nx - 1 {
                let at = |corner: u32| [x + (corner & 1), y + (corner >> 1 & 1), z + (corner >> 2)];
                let case = (0..8).filter(|&corner| is_inside(field, at(corner))).map(|corner| 1 << corner).sum();
                for edge in CaseIndex(case).triangles().iter().flatten() {
                    let key = (at(edge.corners()[0].index() as u32), edge.axis());
                    let index = *known.entry(key).or_insert_with(|| {
                        vertices.push(vertex(field, key));
                        vertices.len() as u32 - 1
                    });
                    indices.push(index);
                }
            }
        }
    }
    (vertices, indices)
}

fn vertex<W: TestWeight>(field: &Field<W>, edge: LatticeEdge) -> OracleVertex {
    let (low, axis) = edge;
    let mut high = low;
    high[axis] += 1;
    let (a, b, isovalue) = (distance(field, low), distance(field, high), f64::from(field.isovalue));
    let fraction = (isovalue - a) / (b - a);
    // Both ends can be the same where one was infinite.
    let fraction = if fraction.is_nan() { 0.0 } else { fraction }.clamp(1.0 / 1024.0, 1023.0 / 1024.0);
    let slopes = [gradient(field, low), gradient(field, high)];
    let inside = if is_inside(field, low) { low } else { high };
    OracleVertex { edge, fraction, slopes, material: field.materials[index(field, inside, [0; 3])] }
}

/// The central difference, or the one-sided one at a border without padding.
fn gradient<W: TestWeight>(field: &Field<W>, at: [u32; 3]) -> [f64; 3] {
    core::array::from_fn(|axis| {
        let mut step = [0; 3];
        step[axis] = 1;
        let below = if field.padded || at[axis] > 0 { step.map(|s| -s) } else { [0; 3] };
        let above = if field.padded || at[axis] + 1 < field.meshed_size()[axis] { step } else { [0; 3] };
        let [low, high] = [below, above].map(|step| finite(field.weights[index(field, at, step)]));
        (high - low) / f64::from(above[axis] - below[axis])
    })
}

fn is_inside<W: TestWeight>(field: &Field<W>, at: [u32; 3]) -> bool {
    field.weights[index(field, at, [0; 3])].to_voxels() < field.isovalue
}

fn distance<W: TestWeight>(field: &Field<W>, at: [u32; 3]) -> f64 {
    finite(field.weights[index(field, at, [0; 3])])
}

/// A weight in voxels. NaN is outside; infinite weights become the largest finite ones.
fn finite<W: Weight>(weight: W) -> f64 {
    let distance = f64::from(weight.to_voxels());
    if distance.is_nan() { f32::MAX.into() } else { distance.clamp(f32::MIN.into(), f32::MAX.into()) }
}

fn index<W: TestWeight>(field: &Field<W>, at: [u32; 3], step: [i32; 3]) -> usize {
    let padding = i32::from(field.padded);
    field.shape.index(core::array::from_fn(|axis| (at[axis] as i32 + step[axis] + padding) as u32))
}

/// The lattice edge of one of the mesher's vertices, and the fraction along it. Clamped crossings never reach a lattice
/// point.
fn edge_of(position: [f32; 3]) -> (LatticeEdge, f64) {
    let axis = (0..3).find(|&axis| position[axis].fract() != 0.0).expect("a vertex is no lattice point");
    assert!((0..3).all(|other| other == axis || position[other].fract() == 0.0), "{position:?} is on no edge");
    ((position.map(|v| v as u32), axis), f64::from(position[axis].fract()))
}

fn compare<W: TestWeight>(field: &Field<W>) -> Result<(), TestCaseError> {
    let (vertices, indices) = march(field);
    let mut mesh = MeshBuffer::new();
    // A mesher and a buffer that have seen other samples must not remember them.
    let mut mesher = Mesher::new();
    let turned_over = MeshSettings { isovalue: -field.isovalue, normals: false, ..MeshSettings::default() };
    mesher.mesh(field.samples(), &turned_over, &mut mesh)?;
    mesher.mesh(field.samples(), &MeshSettings { isovalue: field.isovalue, ..MeshSettings::default() }, &mut mesh)?;

    prop_assert_eq!(mesh.positions.len(), vertices.len());
    prop_assert_eq!((mesh.normals.len(), mesh.materials.len()), (vertices.len(), vertices.len()));
    prop_assert_eq!(mesh.indices.len(), indices.len());
    for (&ours, &oracle) in mesh.indices.iter().zip(&indices) {
        let (ours, oracle) = (ours as usize, &vertices[oracle as usize]);
        let (edge, fraction) = edge_of(mesh.positions[ours]);
        prop_assert_eq!(edge, oracle.edge);
        let steps = fraction * 16_384.0;
        let off = (steps - oracle.fraction * 16_384.0).abs();
        prop_assert!(steps.fract() == 0.0 && off < 0.52, "{:?}: {} for {}", edge, fraction, oracle.fraction);
        prop_assert_eq!(mesh.materials[ours], oracle.material);
        if let Some(normal) = oracle.normal(fraction) {
            let length = normal.iter().map(|v| v * v).sum::<f64>().sqrt();
            for axis in 0..3 {
                let difference = f64::from(mesh.normals[ours][axis]) - normal[axis] / length;
                prop_assert!(difference.abs() < 1e-3, "{:?} for {:?}", mesh.normals[ours], normal);
            }
        }
    }
    let bounds = mesh.positions.iter().fold(None, |bounds: Option<[[f32; 3]; 2]>, &p| {
        let [min, max] = bounds.unwrap_or([p, p]);
        Some([[0, 1, 2].map(|k| min[k].min(p[k])), [0, 1, 2].map(|k| max[k].max(p[k]))])
    });
    prop_assert_eq!(mesh.bounds, bounds);
    Ok(())
}

proptest! {
    #[test]
    fn fields_of_i8_equal_the_plain_ones(field in Field::<i8>::any()) {
        compare(&field)?;
    }

    #[test]
    fn fields_of_i16_equal_the_plain_ones(field in Field::<i16>::any()) {
        compare(&field)?;
    }

    #[test]
    fn fields_of_f32_equal_the_plain_ones(field in Field::<f32>::any()) {
        compare(&field)?;
    }
}
