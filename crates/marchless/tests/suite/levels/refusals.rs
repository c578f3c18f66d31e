//! What is not the samples of a leaf is refused with an error that says why.

use fastrand::Rng;
use marchless::{
    FinerNeighbours, LeafError, LeafSamples, MeshBuffer, MeshError, MeshSettings, Mesher, Samples, Shape, Topology,
    cell::Face,
};

use super::{
    cover::Cover,
    field::{Block, Field},
};

/// A leaf of 4 cells with finer neighbours beyond its high faces along x and y.
fn block() -> Block<i16> {
    let cover = Cover::of_places([2, 2, 1], 4, |place| place != [0, 0, 0]);
    let leaf = cover.leaves().next().expect("the first leaf is the coarse one");
    Field::random(&mut Rng::with_seed(7)).block(&cover, leaf)
}

fn refusal(block: &Block<i16>) -> LeafError {
    block.leaf().expect_err("the samples are not a leaf's")
}

#[test]
fn sizes_and_missing_faces_are_refused() {
    let (x, y, z) = (Face::new(1), Face::new(3), Face::new(5));
    let mut missing = block();
    missing.faces[y.index()] = None;
    assert_eq!(refusal(&missing), LeafError::MissingFace { face: y });

    let mut unneeded = block();
    unneeded.faces[z.index()] = unneeded.faces[y.index()].take();
    unneeded.finer = FinerNeighbours::from_fn(|direction| direction[0] == 1);
    assert_eq!(refusal(&unneeded), LeafError::UnneededFace { face: z });

    let mut swapped = block();
    swapped.faces.swap(x.index(), y.index());
    let [expected, found] = [[3, 11, 11], [11, 3, 11]].map(|size| Shape::new(size).unwrap());
    assert_eq!(refusal(&swapped), LeafError::FaceShape { face: x, expected, found });
    assert_eq!(refusal(&swapped).to_string(), "Face(1) needs 3 × 11 × 11 finer samples, but there are 11 × 3 × 11");

    let block = block();
    let unpadded = LeafSamples::new(block.own.samples(), FinerNeighbours::NONE, [None; 6]).unwrap_err();
    assert_eq!(
        unpadded.to_string(),
        "a leaf needs padded samples, 4 to 65 per axis, but there are 7 × 7 × 7 without padding"
    );
    let weights = vec![0i16; 66 * 4 * 4];
    let long = Samples::new(Shape::new([66, 4, 4]).unwrap(), &weights).unwrap().padded();
    assert!(matches!(LeafSamples::new(long, FinerNeighbours::NONE, [None; 6]), Err(LeafError::Samples { .. })));

    let mut faces = block.faces.each_ref().map(|face| face.as_ref().map(|face| face.samples()));
    let face = block.faces[1].as_ref().unwrap();
    faces[1] = Some(Samples::new(face.shape, &face.weights).unwrap());
    assert_eq!(
        LeafSamples::new(block.samples(), block.finer, faces).unwrap_err(),
        LeafError::FaceMaterials { face: x }
    );
}

#[test]
fn every_lattice_point_with_two_samples_is_found() {
    // By face: the middle layer's points.
    for (face, strides) in [(Face::new(1), [3, 33]), (Face::new(3), [1, 33])] {
        for v in 0..11usize {
            for u in 0..11usize {
                let mut block = block();
                let middle = if face.axis() == 0 { 1 } else { 11 };
                let samples = block.faces[face.index()].as_mut().unwrap();
                samples.weights[middle + u * strides[0] + v * strides[1]] ^= 1;
                let [u, v] = [u, v].map(|v| v.wrapping_sub(1));
                let on_leaf = u <= 8 && v <= 8 && u % 2 == 0 && v % 2 == 0;
                // The edge that both faces share is at their high end.
                let on_rim = u == 8 && v <= 8;
                match block.leaf() {
                    Ok(_) => assert!(!on_leaf && !on_rim, "{face:?} at {u}, {v}"),
                    Err(error) => {
                        assert!(on_leaf || on_rim, "{face:?} at {u}, {v}");
                        assert!(matches!(error, LeafError::PointsDiffer { .. }), "{error}");
                    }
                }
            }
        }
    }
    let mut block = block();
    block.faces[3].as_mut().unwrap().materials[11 + 1 + 33] += 1;
    assert_eq!(refusal(&block), LeafError::PointsDiffer { face: Face::new(3), point: [0, 8, 0] });
}

#[test]
fn settings_that_leaves_cannot_have_are_refused() {
    let (block, mut mesher, mut mesh) = (block(), Mesher::new(), MeshBuffer::new());
    let leaf = block.leaf().unwrap();
    mesher.mesh_leaf(&leaf, &MeshSettings::default(), &mut mesh).unwrap();
    assert!(!mesh.is_empty());
    let trilinear = MeshSettings { topology: Topology::Trilinear, ..MeshSettings::default() };
    assert_eq!(mesher.mesh_leaf(&leaf, &trilinear, &mut mesh), Err(MeshError::LeafTopology));
    assert_eq!(mesh, MeshBuffer::new());
    let isovalue = MeshSettings { isovalue: f32::INFINITY, ..MeshSettings::default() };
    assert_eq!(mesher.mesh_leaf(&leaf, &isovalue, &mut mesh), Err(MeshError::Isovalue { found: f32::INFINITY }));
}
