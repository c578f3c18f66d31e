//! [`MeshPool`]: prepared memory for the meshes that edits show at once.

use core::hint::black_box;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use bevy_ecs::prelude::*;
use bevy_tasks::AsyncComputeTaskPool;
use marchless::MeshBuffer;

/// Memory that tasks have prepared for the meshes that edits show at once. At most 7 MB.
///
/// The system maps new memory page by page on the first write, which can take longer than all other work of an edit.
#[derive(Resource, Clone, Default)]
pub(crate) struct MeshPool(Arc<Mutex<[Vec<PooledMesh>; SIZES]>>);

/// The vertices that the smallest size holds; each further size holds twice as many.
const SMALLEST: usize = 256;
/// The number of sizes. Larger meshes are rare, and take long anyway.
const SIZES: usize = 5;
/// The number of meshes that are prepared of each size: as many as a small edit may take.
const OF_EACH: usize = 8;
/// A closed surface has two triangles per vertex, with three indices each.
const INDICES_PER_VERTEX: usize = 6;

/// Memory for a chunk's mesh and its asset. Vectors without prepared memory allocate it when needed.
#[derive(Debug, Default)]
pub(crate) struct PooledMesh {
    pub(crate) geometry: MeshBuffer,
    pub(crate) asset: PooledAsset,
}

/// Memory for the parts of a mesh asset.
#[derive(Debug, Default)]
pub(crate) struct PooledAsset {
    pub(crate) positions: Vec<[f32; 3]>,
    pub(crate) normals: Vec<[f32; 3]>,
    pub(crate) colors: Vec<[f32; 4]>,
    pub(crate) materials: Vec<u32>,
    pub(crate) indices: Vec<u16>,
}

impl MeshPool {
    /// Takes memory in which a mesh fits, at most four times as large as needed. It is empty if none is prepared.
    pub(crate) fn take_for(&self, mesh: &MeshBuffer) -> PooledMesh {
        let least = size(mesh);
        let mut pool = self.lock();
        let mut fitting = pool.iter_mut().skip(least).take(2).filter_map(Vec::pop);
        if mesh.is_empty() { None } else { fitting.next() }.unwrap_or_default()
    }

    /// Starts a task that fills the pool up, for meshes up to the size of the largest of these. `assets`: whether to
    /// prepare memory for their assets, too. Without a task pool, nothing is prepared.
    pub(crate) fn prepare<'a>(&self, meshes: impl Iterator<Item = &'a MeshBuffer>, assets: bool) {
        let Some(largest) = meshes.filter(|mesh| !mesh.is_empty()).max_by_key(|mesh| size(mesh)) else { return };
        let last = size(largest).min(SIZES - 1);
        let Some(tasks) = AsyncComputeTaskPool::try_get() else { return };
        if self.lock()[..=last].iter().all(|pool| pool.len() >= OF_EACH) {
            return;
        }
        let (pool, normals, materials) = (self.clone(), !largest.normals.is_empty(), !largest.materials.is_empty());
        let prepare = async move {
            for size in 0..=last {
                while pool.lock()[size].len() < OF_EACH {
                    let pooled = PooledMesh::new(SMALLEST << size, normals, materials, assets);
                    pool.lock()[size].push(pooled);
                }
            }
        };
        tasks.spawn(prepare).detach();
    }

    fn lock(&self) -> MutexGuard<'_, [Vec<PooledMesh>; SIZES]> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The index of the smallest size in which a mesh fits; it may be out of range.
fn size(mesh: &MeshBuffer) -> usize {
    let vertices = mesh.positions.len().max(mesh.indices.len().div_ceil(INDICES_PER_VERTEX));
    vertices.div_ceil(SMALLEST).next_power_of_two().ilog2() as usize
}

impl PooledMesh {
    /// Allocates memory for `vertices` vertices, and writes to all of it.
    fn new(vertices: usize, normals: bool, materials: bool, assets: bool) -> Self {
        let indices = INDICES_PER_VERTEX * vertices;
        let geometry = MeshBuffer {
            positions: written(vertices, true),
            normals: written(vertices, normals),
            materials: written(vertices, materials),
            indices: written(indices, true),
            bounds: None,
        };
        let asset = PooledAsset {
            positions: written(vertices, assets),
            normals: written(vertices, assets && normals),
            colors: written(vertices, assets && materials),
            materials: written(vertices, assets && materials),
            indices: written(indices, assets),
        };
        Self { geometry, asset }
    }
}

/// An empty vector with memory for `items` items that has been written to, or without memory if none is `wanted`.
fn written<T: Copy + Default>(items: usize, wanted: bool) -> Vec<T> {
    let mut pooled = Vec::new();
    if wanted {
        pooled.reserve_exact(items);
        // Hide from the compiler that the items are zeros: zeroed memory would not be written to.
        pooled.resize(items, black_box(T::default()));
        pooled.clear();
    }
    pooled
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh(vertices: usize) -> MeshBuffer {
        MeshBuffer {
            positions: vec![[1.0; 3]; vertices],
            normals: vec![[0.0; 3]; vertices],
            materials: vec![3; vertices],
            indices: vec![0; 5 * vertices],
            bounds: None,
        }
    }

    fn capacities(pooled: &PooledMesh) -> [usize; 9] {
        let PooledMesh { geometry, asset } = pooled;
        [
            geometry.positions.capacity(),
            geometry.normals.capacity(),
            geometry.materials.capacity(),
            geometry.indices.capacity(),
            asset.positions.capacity(),
            asset.normals.capacity(),
            asset.colors.capacity(),
            asset.materials.capacity(),
            asset.indices.capacity(),
        ]
    }

    /// Prepares the pool, and waits until it holds this many of each size.
    fn prepare(pool: &MeshPool, meshes: &[MeshBuffer], assets: bool, there: [usize; SIZES]) {
        AsyncComputeTaskPool::get_or_init(Default::default);
        pool.prepare(meshes.iter(), assets);
        while pool.lock().each_ref().map(Vec::len) != there {
            std::thread::yield_now();
        }
    }

    #[test]
    fn memory_is_prepared_up_to_the_size_of_the_largest_mesh() {
        let pool = MeshPool::default();
        assert_eq!(capacities(&pool.take_for(&mesh(100))), [0; 9], "nothing is prepared");
        prepare(&pool, &[mesh(10), mesh(300), mesh(1), mesh(0)], true, [8, 8, 0, 0, 0]);
        let pooled = pool.take_for(&mesh(256));
        assert_eq!(capacities(&pooled), [256, 256, 256, 6 * 256, 256, 256, 256, 256, 6 * 256]);
        assert!(pooled.geometry.is_empty() && pooled.asset.positions.is_empty());
        assert_eq!(pool.take_for(&mesh(257)).geometry.positions.capacity(), 512);
        assert_eq!(
            pool.take_for(&MeshBuffer { indices: vec![0; 1537], ..mesh(256) }).asset.indices.capacity(),
            6 * 512
        );
        assert_eq!(capacities(&pool.take_for(&mesh(0))), [0; 9]);
        assert_eq!(capacities(&pool.take_for(&mesh(513))), [0; 9], "nothing that large");
        for _ in 1..OF_EACH {
            pool.take_for(&mesh(10));
        }
        assert_eq!(pool.take_for(&mesh(10)).geometry.positions.capacity(), 512, "the next size");
        prepare(&pool, &[mesh(5000)], true, [8; SIZES]);
        assert_eq!(capacities(&pool.take_for(&mesh(4097))), [0; 9]);
        pool.lock()[0].clear();
        for taken in 0..OF_EACH {
            assert_eq!(pool.take_for(&mesh(10)).geometry.positions.capacity(), 512, "{taken}");
        }
        assert_eq!(capacities(&pool.take_for(&mesh(10))), [0; 9], "the others would be too large");
    }

    #[test]
    fn what_meshes_lack_is_not_prepared() {
        let pool = MeshPool::default();
        let bare = MeshBuffer { normals: Vec::new(), materials: Vec::new(), ..mesh(9) };
        prepare(&pool, &[bare], false, [8, 0, 0, 0, 0]);
        assert_eq!(capacities(&pool.take_for(&mesh(9))), [256, 0, 0, 6 * 256, 0, 0, 0, 0, 0]);
    }
}
