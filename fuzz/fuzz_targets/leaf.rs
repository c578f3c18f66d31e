//! Leaves of two levels around a point or around a leaf: together a closed surface, or a typed error. And samples that
//! have been tampered with: refused exactly if they are not a leaf's.

#![no_main]

use std::collections::HashMap;

use libfuzzer_sys::{
    arbitrary::{Arbitrary, Result, Unstructured},
    fuzz_target,
};
use marchless::{FinerNeighbours, LeafError, MeshBuffer, MeshError, MeshUnion, Mesher, Shape, Topology, cell::Face};
use marchless_fuzz::{Block, FuzzWeight, Leaf, Leaves, SampleBox, points};

fuzz_target!(|data: &[u8]| {
    // Out of bytes: done.
    let _ = check_any(&mut Unstructured::new(data));
});

fn check_any(u: &mut Unstructured<'_>) -> Result<()> {
    if u.arbitrary()? { check::<i8>(u) } else { check::<f32>(u) }
}

fn check<W: FuzzWeight>(u: &mut Unstructured<'_>) -> Result<()> {
    let tampering: Vec<Tampering> =
        if u.ratio(1, 4)? { (0..3).map(|_| u.arbitrary()).collect::<Result<_>>()? } else { Vec::new() };
    let leaves: Leaves<W> = u.arbitrary()?;
    if tampering.is_empty() {
        check_union(&leaves);
    } else if let Some(leaf) = leaves.all().find(|leaf| leaf.level == 1) {
        let mut block = leaves.block(leaf);
        for tampering in tampering {
            tampering.apply(&mut block);
            check_block(&block, &leaves);
        }
    }
    Ok(())
}

/// Meshes all leaves, and checks their union.
fn check_union<W: FuzzWeight>(leaves: &Leaves<W>) {
    let settings = leaves.settings(Topology::Separated);
    let (mut mesher, mut mesh, mut union) = (Mesher::new(), MeshBuffer::new(), MeshUnion::new());
    let mut vertices = HashMap::new();
    let mut refused = false;
    for leaf in leaves.all() {
        let block = leaves.block(leaf);
        let samples = match block.leaf() {
            Ok(samples) => samples,
            Err(error) => {
                let LeafError::AlternatingEdge { direction } = error else { panic!("{error} in {leaves:?}") };
                assert!(alternates(block.finer, direction));
                refused = true;
                continue;
            }
        };
        assert!(!points([3; 3]).any(|at| alternates(block.finer, at.map(|v| v as i32 - 1))));
        let meshed = mesher.mesh_leaf(&samples, &settings, &mut mesh);
        if !leaves.isovalue.is_finite() {
            assert!(matches!(meshed, Err(MeshError::Isovalue { .. })));
            assert_eq!(mesh, MeshBuffer::new());
            return;
        }
        meshed.expect("the samples can be meshed");
        check_mesh(leaves.cells, leaves.normals, &mesh);
        let origin = leaf.min.map(i64::from);
        union.add(&mesh, origin, leaf.level);
        for (index, &position) in mesh.positions.iter().enumerate() {
            let shown =
                (mesh.normals.get(index).map(|normal| normal.map(f32::to_bits)), mesh.materials.get(index).copied());
            // Common vertices of leaves are the same to the last bit.
            assert_eq!(*vertices.entry(place(leaf, position)).or_insert(shown), shown);
        }
    }
    if refused {
        return;
    }
    let mut report = union.report();
    assert!(report.is_closed(), "{report}");
    // Triangles of cells with a moved corner may cross.
    report.crossing_triangles = 0;
    assert!(report.is_clean(), "{report}");
}

/// A position in the world.
fn place(leaf: Leaf, position: [f32; 3]) -> [u64; 3] {
    let cell = f64::from(1 << leaf.level);
    [0, 1, 2].map(|axis| (f64::from(leaf.min[axis]) + f64::from(position[axis]) * cell).to_bits())
}

/// What each mesh of a leaf is, whatever its neighbours are.
fn check_mesh(cells: [u32; 3], normals: bool, mesh: &MeshBuffer) {
    let vertices = mesh.positions.len();
    assert_eq!(mesh.normals.len(), if normals { vertices } else { 0 });
    assert!(mesh.materials.is_empty() || mesh.materials.len() == vertices);
    assert!(mesh.indices.iter().all(|&index| (index as usize) < vertices));
    for normal in &mesh.normals {
        let length = normal.iter().map(|v| v * v).sum::<f32>().sqrt();
        assert!((length - 1.0).abs() < 1e-5, "{normal:?} is no unit normal");
    }
    let room = 0.125;
    for position in &mesh.positions {
        let within = |axis: usize| (-room..=cells[axis] as f32 + room).contains(&position[axis]);
        assert!((0..3).all(within), "{position:?} is out of bounds");
    }
    let bounds = mesh.positions.iter().fold(None, |bounds: Option<[[f32; 3]; 2]>, &p| {
        let [min, max] = bounds.unwrap_or([p, p]);
        Some([[0, 1, 2].map(|k| min[k].min(p[k])), [0, 1, 2].map(|k| max[k].max(p[k]))])
    });
    assert_eq!(mesh.bounds, bounds);
}

/// Whether finer and coarser leaves alternate at the edge of a leaf in a direction.
fn alternates(finer: FinerNeighbours, direction: [i32; 3]) -> bool {
    let axes: Vec<usize> = (0..3).filter(|&axis| direction[axis] != 0).collect();
    let [a, b] = axes[..] else { return false };
    let face = |axis: usize| {
        let mut face = [0; 3];
        face[axis] = direction[axis];
        finer.contains(face)
    };
    face(a) && face(b) && !finer.contains(direction)
}

/// A change to the samples of a leaf, which may leave them sound.
enum Tampering {
    /// Other samples of the leaf, of any small size.
    Own { size: [u8; 3], padded: bool, materials: bool },
    /// Other neighbours.
    Finer { set: u32 },
    /// No samples for a face.
    NoFace { face: u8 },
    /// Other samples for a face: of the right size, or of any.
    Face { face: u8, size: Option<[u8; 3]>, padded: bool, materials: bool },
    /// Another weight, for a face or in the leaf.
    Weight { face: u8, at: [u8; 3], bytes: [u8; 4] },
    /// Another material.
    Material { face: u8, at: [u8; 3] },
    /// Two faces change their samples.
    Swap { faces: [u8; 2] },
}

impl<'a> Arbitrary<'a> for Tampering {
    fn arbitrary(u: &mut Unstructured<'a>) -> Result<Self> {
        Ok(match u.int_in_range(0..=6)? {
            0 => Self::Own { size: u.arbitrary()?, padded: u.arbitrary()?, materials: u.arbitrary()? },
            1 => Self::Finer { set: u.arbitrary()? },
            2 => Self::NoFace { face: u.arbitrary()? },
            3 => {
                let (face, size) = (u.arbitrary()?, u.arbitrary()?);
                Self::Face { face, size, padded: u.arbitrary()?, materials: u.arbitrary()? }
            }
            4 => Self::Weight { face: u.arbitrary()?, at: u.arbitrary()?, bytes: u.arbitrary()? },
            5 => Self::Material { face: u.arbitrary()?, at: u.arbitrary()? },
            _ => Self::Swap { faces: u.arbitrary()? },
        })
    }
}

impl Tampering {
    fn apply<W: FuzzWeight>(self, block: &mut Block<W>) {
        match self {
            Self::Own { size, padded, materials } => {
                block.own = filled(size.map(|v| u32::from(v % 70)), padded, materials)
            }
            Self::Finer { set } => {
                block.finer = FinerNeighbours::from_fn(|[x, y, z]| set >> (x + 1 + 3 * (y + 1 + 3 * (z + 1))) & 1 == 1);
            }
            Self::NoFace { face } => block.faces[usize::from(face % 6)] = None,
            Self::Face { face, size, padded, materials } => {
                let face = Face::new(face % 6);
                let fitting = face_size(block.own.shape, face);
                let size = size.map_or(fitting, |size| size.map(|v| u32::from(v % 12)));
                block.faces[face.index()] = Some(filled(size, padded, materials));
            }
            Self::Weight { face, at, bytes } => {
                let samples = any_box(block, face);
                samples.weights[any_index(samples.shape, at)] = W::from_bytes(bytes);
            }
            Self::Material { face, at } => {
                let samples = any_box(block, face);
                let index = any_index(samples.shape, at);
                if let Some(materials) = &mut samples.materials {
                    materials[index] ^= 1;
                }
            }
            Self::Swap { faces } => block.faces.swap(usize::from(faces[0] % 6), usize::from(faces[1] % 6)),
        }
    }
}

/// Samples of one kind.
fn filled<W: FuzzWeight>(size: [u32; 3], padded: bool, materials: bool) -> SampleBox<W> {
    let size = size.map(|v| v.max(1));
    let shape = Shape::new(size).expect("it is small");
    let materials = materials.then(|| vec![0; shape.len()].into());
    SampleBox { shape, weights: vec![W::OUTSIDE; shape.len()].into(), materials, padded }
}

/// The samples of a face, or the leaf's own.
fn any_box<W>(block: &mut Block<W>, face: u8) -> &mut SampleBox<W> {
    block.faces.get_mut(usize::from(face % 7)).and_then(Option::as_mut).unwrap_or(&mut block.own)
}

/// Any sample; often one on the edges of the leaf, which faces share.
fn any_index(shape: Shape, at: [u8; 3]) -> usize {
    let size = shape.size().map(|size| size as usize);
    let [x, y, z] = [0, 1, 2].map(|axis| match at[axis] {
        ..64 => 1 % size[axis],
        64..128 => size[axis].saturating_sub(2),
        at => usize::from(at) % size[axis],
    });
    x + size[0] * (y + size[1] * z)
}

/// The size of the samples that a face of a leaf needs.
fn face_size(own: Shape, face: Face) -> [u32; 3] {
    let mut size = own.size().map(|size| 2 * size.saturating_sub(3) + 3);
    size[face.axis()] = 3;
    size
}

/// Samples are refused exactly if they are not a leaf's. Others can be meshed.
fn check_block<W: FuzzWeight>(block: &Block<W>, leaves: &Leaves<W>) {
    let sound = is_sound(block);
    let leaf = match block.leaf() {
        Ok(leaf) => leaf,
        Err(error) => {
            assert!(!sound, "{error}");
            return;
        }
    };
    assert!(sound);
    let mut mesh = MeshBuffer::new();
    for topology in marchless_fuzz::TOPOLOGIES {
        let meshed = Mesher::new().mesh_leaf(&leaf, &leaves.settings(topology), &mut mesh);
        let expected = if !block.finer.is_empty() && topology != Topology::Separated {
            Err(MeshError::LeafTopology)
        } else if leaves.isovalue.is_finite() {
            Ok(())
        } else {
            Err(MeshError::Isovalue { found: leaves.isovalue })
        };
        // NaN equals nothing, not even itself.
        assert_eq!(format!("{meshed:?}"), format!("{expected:?}"));
        if meshed.is_ok() {
            let cells = block.own.shape.size().map(|size| size - 3);
            check_mesh(cells, leaves.normals, &mesh);
        } else {
            assert_eq!(mesh, MeshBuffer::new());
        }
    }
}

/// What `LeafSamples::new` asks for.
fn is_sound<W: FuzzWeight>(block: &Block<W>) -> bool {
    let Block { own, finer, faces } = block;
    if !own.padded || own.shape.size().iter().any(|size| !(4..=65).contains(size)) {
        return false;
    }
    if points([3; 3]).any(|at| alternates(*finer, at.map(|v| v as i32 - 1))) {
        return false;
    }
    let fits = |face: Face| match &faces[face.index()] {
        None => !finer.contains_face(face),
        Some(samples) => {
            finer.contains_face(face)
                && samples.shape.size() == face_size(own.shape, face)
                && samples.materials.is_some() == own.materials.is_some()
        }
    };
    Face::ALL.into_iter().all(fits) && points_agree(block)
}

/// Whether each lattice point of the leaf has one sample.
fn points_agree<W: FuzzWeight>(block: &Block<W>) -> bool {
    let cells = block.own.shape.size().map(|size| size as i32 - 3);
    let mut known = HashMap::new();
    // In finer steps from the leaf's corner.
    let mut agrees = |point: [i32; 3], samples: &SampleBox<W>, index: usize| {
        if !(0..3).all(|axis| (0..=2 * cells[axis]).contains(&point[axis])) {
            return true;
        }
        let weight = samples.weights[index].to_voxels();
        // All NaN are one, and so are both zeros.
        let weight = if weight.is_nan() { f32::NAN } else { weight + 0.0 };
        let shown = (weight.to_bits(), samples.materials.as_ref().map(|materials| materials[index]));
        *known.entry(point).or_insert(shown) == shown
    };
    let own = points(block.own.shape.size()).enumerate();
    let mut all = own.fold(true, |all, (index, at)| agrees(at.map(|v| 2 * v as i32 - 2), &block.own, index) && all);
    for face in Face::ALL {
        let Some(samples) = &block.faces[face.index()] else { continue };
        for (index, at) in points(samples.shape.size()).enumerate().filter(|(_, at)| at[face.axis()] == 1) {
            let mut point = at.map(|v| v as i32 - 1);
            point[face.axis()] += if face.is_high() { 2 * cells[face.axis()] } else { 0 };
            all &= agrees(point, samples, index);
        }
    }
    all
}
