//! The mesh is the same, byte for byte, on every backend, slab by slab, and on any number of threads.

#[cfg(feature = "std")]
use std::num::NonZero;

#[cfg(feature = "std")]
use marchless::ThreadedMesher;
use marchless::{Backend, MeshBuffer, MeshError, MeshSettings, Mesher, Samples, Shape, SlabMesher, Topology};
use proptest::prelude::*;

use crate::support::{Field, TestWeight};

/// A mesh down to the last bit, including the signs of zeros.
#[derive(Debug, PartialEq)]
struct Bits {
    positions: Vec<[u32; 3]>,
    normals: Vec<[u32; 3]>,
    materials: Vec<u8>,
    indices: Vec<u32>,
    bounds: Option<[[u32; 3]; 2]>,
}

fn bits(mesh: &MeshBuffer) -> Bits {
    let vectors = |vectors: &[[f32; 3]]| vectors.iter().map(|vector| vector.map(f32::to_bits)).collect();
    Bits {
        positions: vectors(&mesh.positions),
        normals: vectors(&mesh.normals),
        materials: mesh.materials.clone(),
        indices: mesh.indices.clone(),
        bounds: mesh.bounds.map(|bounds| bounds.map(|corner| corner.map(f32::to_bits))),
    }
}

fn meshed<W: TestWeight>(mut mesher: Mesher, samples: Samples<'_, W>, settings: &MeshSettings) -> Bits {
    let mut mesh = MeshBuffer::new();
    mesher.mesh(samples, settings, &mut mesh).expect("the samples can be meshed");
    bits(&mesh)
}

/// The mesh made slab by slab. The output is moved out of the buffer after every `taken_every` slabs.
fn streamed<W: TestWeight>(samples: Samples<'_, W>, settings: &MeshSettings, taken_every: usize) -> Bits {
    let [nx, ny, _] = samples.shape().size();
    let mut mesher = SlabMesher::new([nx, ny], *settings).expect("the slabs have cells");
    let (mut piece, mut whole) = (MeshBuffer::new(), MeshBuffer::new());
    let mut take = |piece: &mut MeshBuffer| {
        whole.positions.append(&mut piece.positions);
        whole.normals.append(&mut piece.normals);
        whole.indices.append(&mut piece.indices);
        whole.bounds = match (whole.bounds, piece.bounds.take()) {
            (Some([min, max]), Some([low, high])) => {
                Some([[0, 1, 2].map(|k| min[k].min(low[k])), [0, 1, 2].map(|k| max[k].max(high[k]))])
            }
            (bounds, None) | (None, bounds) => bounds,
        };
    };
    for (z, slab) in samples.weights().chunks(nx as usize * ny as usize).enumerate() {
        mesher.push(slab, &mut piece).expect("the slab is whole");
        if z % taken_every == 0 {
            take(&mut piece);
        }
    }
    mesher.finish(&mut piece).expect("there are slabs enough");
    take(&mut piece);
    bits(&whole)
}

/// Checks a field with the trilinear topology if `exact`, otherwise with the separated one.
fn check<W: TestWeight>(field: &Field<W>, normals: bool, exact: bool, taken_every: usize) -> Result<(), TestCaseError> {
    let topology = if exact { Topology::Trilinear } else { Topology::Separated };
    let settings = MeshSettings { isovalue: field.isovalue, normals, topology };
    let portable = meshed(Mesher::with_backend(Backend::Portable), field.samples(), &settings);
    for backend in Backend::ALL.iter().copied().filter(|backend| backend.is_available()) {
        let mesh = meshed(Mesher::with_backend(backend), field.samples(), &settings);
        prop_assert_eq!(&mesh, &portable, "{}", backend.name());
    }
    #[cfg(feature = "std")]
    for threads in 1..=3 {
        let mut mesh = MeshBuffer::new();
        let mut mesher = ThreadedMesher::new(NonZero::new(threads).expect("there is a thread"));
        // A mesher and a buffer must not remember earlier samples.
        let turned_over = MeshSettings { isovalue: -field.isovalue, ..settings };
        mesher.mesh(Samples::new(field.shape, &field.weights)?, &turned_over, &mut mesh)?;
        mesher.mesh(field.samples(), &settings, &mut mesh)?;
        prop_assert_eq!(&bits(&mesh), &portable, "{} threads", threads);
    }

    let unpadded = Samples::new(field.shape, &field.weights)?;
    let whole = meshed(Mesher::new(), unpadded, &settings);
    prop_assert_eq!(&streamed(unpadded, &settings, taken_every), &whole);
    Ok(())
}

proptest! {
    #[test]
    fn fields_of_i8_are_the_same(field in Field::<i8>::any(), normals: bool, exact: bool, taken_every in 1usize..9) {
        check(&field, normals, exact, taken_every)?;
    }

    #[test]
    fn fields_of_i16_are_the_same(field in Field::<i16>::any(), normals: bool, exact: bool, taken_every in 1usize..9) {
        check(&field, normals, exact, taken_every)?;
    }

    #[test]
    fn fields_of_f32_are_the_same(field in Field::<f32>::any(), normals: bool, exact: bool, taken_every in 1usize..9) {
        check(&field, normals, exact, taken_every)?;
    }
}

/// All signs of 3 × 2 × 2 samples: every case of a cell, beside every case of its neighbour that fits.
#[test]
fn all_pairs_of_cases_are_the_same() {
    let shape = Shape::new([3, 2, 2]).expect("the size is small");
    for signs in 0..1u32 << 12 {
        let weights: Vec<f32> =
            (0..12).map(|index| if signs >> index & 1 == 1 { -1.0 } else { 0.5 + index as f32 }).collect();
        let samples = Samples::new(shape, &weights).expect("one weight a sample");
        for topology in [Topology::Separated, Topology::Trilinear] {
            let settings = MeshSettings { topology, ..MeshSettings::default() };
            let portable = meshed(Mesher::with_backend(Backend::Portable), samples, &settings);
            for backend in Backend::ALL.iter().copied().filter(|backend| backend.is_available()) {
                assert_eq!(meshed(Mesher::with_backend(backend), samples, &settings), portable, "{}", backend.name());
            }
        }
    }
}

#[test]
fn unavailable_backends_fall_back_to_others() {
    let weights = [-1.0f32, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0];
    let samples = Samples::new(Shape::cube(2).expect("the size is small"), &weights).expect("one weight a sample");
    let plain = meshed(Mesher::with_backend(Backend::Portable), samples, &MeshSettings::default());
    for &backend in Backend::ALL {
        assert_eq!(meshed(Mesher::with_backend(backend), samples, &MeshSettings::default()), plain);
    }
}

#[test]
fn the_fastest_backend_is_the_last_that_is_available() {
    let available: Vec<_> = Backend::ALL.iter().copied().filter(|backend| backend.is_available()).collect();
    assert_eq!(available.first(), Some(&Backend::Portable));
    assert_eq!(available.last(), Some(&Backend::fastest()));
    assert_eq!(
        Backend::ALL.iter().map(|backend| backend.name()).collect::<Vec<_>>(),
        ["portable", "sse2", "avx2", "avx512"]
    );
    #[cfg(all(target_arch = "x86_64", feature = "std"))]
    assert_eq!(Backend::Avx2.is_available(), ["avx2", "bmi2", "lzcnt"].iter().all(|&name| processor_has(name)));
}

#[cfg(all(target_arch = "x86_64", feature = "std"))]
fn processor_has(name: &str) -> bool {
    match name {
        "avx2" => is_x86_feature_detected!("avx2"),
        "bmi2" => is_x86_feature_detected!("bmi2"),
        _ => is_x86_feature_detected!("lzcnt"),
    }
}

#[cfg(feature = "std")]
#[test]
fn threads_return_the_errors_of_a_single_thread() {
    let mut mesher = ThreadedMesher::new(NonZero::new(2).expect("two are some"));
    let mut mesh = MeshBuffer { positions: vec![[0.0; 3]], ..MeshBuffer::new() };
    let weights = [-1.0f32, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0];
    let samples = Samples::new(Shape::cube(2).expect("the size is small"), &weights).expect("one weight a sample");
    let refused = mesher.mesh(samples, &MeshSettings { isovalue: f32::NAN, ..MeshSettings::default() }, &mut mesh);
    assert!(matches!(refused, Err(MeshError::Isovalue { found }) if found.is_nan()) && mesh.positions.is_empty());
    let refused = mesher.mesh(samples.padded(), &MeshSettings::default(), &mut mesh);
    assert_eq!(refused, Err(MeshError::TooSmall { shape: samples.shape(), least: 4 }));
    assert_eq!(mesh, MeshBuffer::new());
}

/// A game may have moved the mesh of earlier slabs.
#[test]
fn slabs_widen_existing_bounds() {
    let mut mesh = MeshBuffer { bounds: Some([[-3.0, -2.0, 0.5], [-1.0, 9.0, 1.5]]), ..MeshBuffer::new() };
    let mut mesher = SlabMesher::<f32>::new([3, 2], MeshSettings::default()).expect("the slabs have cells");
    mesher.push(&[1.0; 6], &mut mesh).expect("the slab is whole");
    mesher.push(&[-1.0; 6], &mut mesh).expect("the slab is whole");
    mesher.finish(&mut mesh).expect("there are two slabs");
    assert_eq!(mesh.bounds, Some([[-3.0, -2.0, 0.5], [2.0, 9.0, 1.5]]));
}

#[test]
fn slabs_that_do_not_fit_are_typed_errors() {
    let settings = MeshSettings::default();
    for size in [[1, 5], [5, 1], [0, 5], [u32::MAX; 2]] {
        assert_eq!(SlabMesher::<i8>::new(size, settings).err(), Some(MeshError::SlabSize { size }));
    }
    let infinite = MeshSettings { isovalue: f32::INFINITY, ..settings };
    assert_eq!(SlabMesher::<i8>::new([2; 2], infinite).err(), Some(MeshError::Isovalue { found: f32::INFINITY }));

    let mut mesh = MeshBuffer::new();
    let mut mesher = SlabMesher::<i8>::new([3, 2], settings).expect("the slabs have cells");
    let refused = MeshError::SlabLength { size: [3, 2], expected: 6, found: 7 };
    assert_eq!(mesher.push(&[1; 7], &mut mesh), Err(refused));
    assert_eq!(mesher.clone().finish(&mut mesh), Err(MeshError::TooFewSlabs { found: 0 }));
    mesher.push(&[1; 6], &mut mesh).expect("the slab is whole");
    assert_eq!(mesher.clone().finish(&mut mesh), Err(MeshError::TooFewSlabs { found: 1 }));
    mesher.push(&[-1; 6], &mut mesh).expect("the slab is whole");
    mesher.finish(&mut mesh).expect("there are two slabs");
    assert_eq!((mesh.positions.len(), mesh.triangle_count()), (6, 4));
}
