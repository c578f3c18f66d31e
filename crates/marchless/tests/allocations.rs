//! Once its buffers are warm, meshing allocates nothing.

use core::{
    alloc::{GlobalAlloc, Layout},
    cell::Cell,
};
use std::alloc::System;

use fastrand::Rng;
use marchless::{
    Block, DualSettings, Grid, GridChunk, MaterialSet, MeshBuffer, MeshMethod, MeshSettings, Mesher, Samples, Shape,
    Topology, Weight,
};

thread_local! {
    /// The number of allocations by this thread. Counted per thread, since the test harness has threads of its own.
    static ALLOCATIONS: Cell<usize> = const { Cell::new(0) };
    /// The number of bytes allocated by this thread.
    static BYTES: Cell<usize> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: all calls go to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        BYTES.set(BYTES.get() + layout.size());
        // SAFETY: the caller's promises are the same.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's promises are the same.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn allocations(work: impl FnOnce()) -> usize {
    let before = ALLOCATIONS.get();
    work();
    ALLOCATIONS.get() - before
}

/// A weight for every sample: `bumpiness` 0 is a ball, more adds noise.
fn weights<W: Weight>(shape: Shape, bumpiness: f32) -> Vec<W> {
    let [nx, ny, nz] = shape.size();
    let (mut weights, mut random) = (Vec::new(), Rng::with_seed(1));
    for (z, y, x) in (0..nz).flat_map(|z| (0..ny).flat_map(move |y| (0..nx).map(move |x| (z, y, x)))) {
        let from_middle = [(x, nx), (y, ny), (z, nz)].map(|(at, size)| at as f32 - size as f32 / 2.0);
        let ball = from_middle.iter().map(|v| v * v).sum::<f32>().sqrt() - ny as f32 / 3.0;
        weights.push(W::from_voxels(ball + bumpiness * (2.0 * random.f32() - 1.0)));
    }
    weights
}

fn mesh_all<W: Weight>(fields: &[(Shape, Vec<W>, Vec<u8>)], mesher: &mut Mesher, out: &mut MeshBuffer) {
    for (shape, weights, materials) in fields {
        let plain = Samples::new(*shape, weights).expect("one weight a sample");
        let with_materials = plain.with_materials(materials).expect("one material a sample");
        for samples in [plain, plain.padded(), with_materials, with_materials.padded()] {
            for (normals, topology) in
                [(true, Topology::Separated), (false, Topology::Separated), (true, Topology::Trilinear)]
            {
                let settings = MeshSettings { isovalue: 0.25, normals, topology };
                mesher.mesh(samples, &settings, out).expect("the shapes are large enough");
                assert!(!out.is_empty());
            }
        }
    }
}

fn mesh_all_dual<W: Weight>(fields: &[(Shape, Vec<W>, Vec<u8>)], mesher: &mut Mesher, out: &mut MeshBuffer) {
    for (shape, weights, materials) in fields {
        let plain = Samples::new(*shape, weights).expect("one weight a sample");
        let with_materials = plain.with_materials(materials).expect("one material a sample");
        for samples in [plain, with_materials, with_materials.padded()] {
            let none = MaterialSet::EMPTY;
            for (smoothing, sharp, crease) in
                [(0, none, None), (1, none, None), (0, none.with(1), None), (0, MaterialSet::ALL, Some(0.5))]
            {
                let settings = DualSettings { isovalue: 0.25, smoothing, sharp, crease, ..DualSettings::default() };
                mesher.mesh_dual(samples, &settings, out).expect("the shapes are large enough");
                assert!(!out.is_empty());
            }
        }
    }
}

fn warm_meshing_allocates_nothing<W: Weight>() {
    let shapes = [[35, 35, 35], [130, 9, 12], [12, 40, 7]].map(|size| Shape::new(size).expect("the sizes are small"));
    let fields: Vec<_> = shapes
        .iter()
        .flat_map(|&shape| [0.0, 8.0].map(|bumpiness| (shape, weights::<W>(shape, bumpiness), vec![1u8; shape.len()])))
        .collect();
    let (mut mesher, mut out) = (Mesher::new(), MeshBuffer::new());
    assert_ne!(allocations(|| mesh_all(&fields, &mut mesher, &mut out)), 0, "cold buffers must grow");
    assert_eq!(allocations(|| mesh_all(&fields, &mut mesher, &mut out)), 0);

    let fields: Vec<_> = fields.into_iter().filter(|(shape, ..)| shape.size().iter().all(|&size| size >= 9)).collect();
    let (mut mesher, mut out) = (Mesher::new(), MeshBuffer::new());
    assert_ne!(allocations(|| mesh_all_dual(&fields, &mut mesher, &mut out)), 0, "cold buffers must grow");
    assert_eq!(allocations(|| mesh_all_dual(&fields, &mut mesher, &mut out)), 0);
}

#[test]
fn warm_meshing_of_i8_allocates_nothing() {
    warm_meshing_allocates_nothing::<i8>();
}

#[test]
fn warm_meshing_of_i16_allocates_nothing() {
    warm_meshing_allocates_nothing::<i16>();
}

#[test]
fn warm_meshing_of_f32_allocates_nothing() {
    warm_meshing_allocates_nothing::<f32>();
}

#[test]
fn warm_meshing_of_a_chunk_allocates_nothing() {
    let shape = Shape::cube(16).expect("16 is small");
    let mut grid = Grid::<i16>::new(16).expect("16 is allowed");
    for position in [[0, 0, 0], [1, 0, 0], [0, -1, 1]] {
        let chunk = GridChunk::from_samples(weights(shape, 4.0), vec![2; shape.len()], 16).expect("the lengths fit");
        grid.insert(position, chunk).expect("the grid has no bounds");
    }
    let neighbourhood = grid.neighbourhood([0, 0, 0]);
    let (mut mesher, mut block, mut out) = (Mesher::new(), Block::new(), MeshBuffer::new());
    let dual = DualSettings { smoothing: 3, ..DualSettings::default() };
    for method in [MeshMethod::default(), dual.into()] {
        let mut mesh = || {
            neighbourhood.mesh(&mut mesher, &mut block, method, &mut out).expect("a chunk can be meshed");
            assert!(!out.is_empty());
        };
        assert_ne!(allocations(&mut mesh), 0, "cold buffers must grow");
        assert_eq!(allocations(&mut mesh), 0);
    }
}

/// Besides the samples and the mesh, a mesher keeps the signs of three slabs and the data of one batch of vertices.
#[test]
fn large_volumes_need_little_scratch_memory() {
    let shape = Shape::cube(256).expect("the size is small");
    let weights = weights::<i8>(shape, 0.0);
    let samples = Samples::new(shape, &weights).expect("one weight a sample");
    let (mut mesh, settings) = (MeshBuffer::new(), MeshSettings::default());
    Mesher::new().mesh(samples, &settings, &mut mesh).expect("there are cells to mesh");
    assert!(mesh.triangle_count() > 100_000);
    let before = BYTES.get();
    Mesher::new().mesh(samples, &settings, &mut mesh).expect("there are cells to mesh");
    let scratch = BYTES.get() - before;
    assert!((10_000..200_000).contains(&scratch), "{scratch} bytes");
}
