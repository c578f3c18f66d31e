//! Functions that mesh chunks, on any thread.

use core::cell::RefCell;
use core::error::Error;
use core::iter;
use core::sync::atomic::{AtomicUsize, Ordering};
use std::sync::Arc;

use bevy_asset::RenderAssetUsages;
use bevy_math::bounding::Aabb3d;
use bevy_mesh::{Indices, Mesh, PrimitiveTopology};
use bevy_platform::time::Instant;
use bevy_tasks::ComputeTaskPool;
use marchless::{MeshBuffer, MeshMethod};

use super::ATTRIBUTE_MATERIAL;
use super::pool::{MeshPool, PooledAsset, PooledMesh};
use crate::chunk::ChunkKey;
use crate::volume::{ChunkMesh, Colors, MeshInput, MeshScratch};

/// The style of a mesh asset.
#[derive(Clone)]
pub(crate) struct AssetStyle {
    /// The colours of its vertices.
    pub(crate) colors: Colors,
    /// The worlds that keep it: main, render or both.
    pub(crate) usages: RenderAssetUsages,
}

/// Meshes a chunk.
///
/// `style`: of its asset; with `None` no asset is made. `pool`: memory for the mesh; without it, memory of exactly the
/// mesh's size is allocated.
pub(crate) fn mesh_chunk(
    input: &MeshInput,
    key: ChunkKey,
    settings: &MeshMethod,
    style: Option<&AssetStyle>,
    pool: Option<&MeshPool>,
) -> ChunkMesh {
    mesh_with(key, style, pool, |scratch, out| input.mesh(scratch, settings, out))
}

/// Meshes chunks and waits for them, with the help of the compute pool if there is one. Meshes are sorted by key.
pub(crate) fn mesh_now(
    chunks: &[(ChunkKey, MeshInput)],
    settings: &MeshMethod,
    style: Option<&AssetStyle>,
    pool: &MeshPool,
) -> Vec<ChunkMesh> {
    let next = AtomicUsize::new(0);
    // Each thread takes the next chunk when it is free. Waking a thread for each chunk would take longer.
    let take = || {
        let (key, input) = chunks.get(next.fetch_add(1, Ordering::Relaxed))?;
        Some(mesh_chunk(input, *key, settings, style, Some(pool)))
    };
    let Some(pool) = ComputeTaskPool::try_get().filter(|_| chunks.len() > 1) else {
        return iter::from_fn(take).collect();
    };
    let mut meshed = Vec::with_capacity(chunks.len());
    let helped = pool.scope(|scope| {
        for _ in 0..pool.thread_num().min(chunks.len() - 1) {
            scope.spawn(async { iter::from_fn(take).collect::<Vec<_>>() });
        }
        meshed.extend(iter::from_fn(take));
    });
    meshed.extend(helped.into_iter().flatten());
    meshed.sort_by_key(|meshed| meshed.key);
    meshed
}

/// Makes a new asset of a mesh, in the colours of `style`.
pub(crate) fn recolor(key: ChunkKey, geometry: Arc<MeshBuffer>, style: Option<&AssetStyle>) -> ChunkMesh {
    let start = Instant::now();
    let mesh = style.map(|style| to_asset(&geometry, style, PooledAsset::default()));
    ChunkMesh { key, geometry, mesh, time: start.elapsed() }
}

/// Runs `mesh` with this thread's scratch memory, and makes an asset of the result. An error is logged, and gives an
/// empty mesh.
pub(super) fn mesh_with(
    key: ChunkKey,
    style: Option<&AssetStyle>,
    pool: Option<&MeshPool>,
    mesh: impl FnOnce(&mut MeshScratch, &mut MeshBuffer) -> Result<(), Box<dyn Error>>,
) -> ChunkMesh {
    thread_local! {
        static SCRATCH: RefCell<(MeshScratch, MeshBuffer)> =
            RefCell::new((MeshScratch::default(), MeshBuffer::new()));
    }
    let start = Instant::now();
    // Copy the mesh: scratch buffers only grow, while the copy takes the memory that it needs or that the pool gave it.
    let pooled = SCRATCH.with_borrow_mut(|(scratch, geometry)| match mesh(scratch, geometry) {
        Ok(()) => {
            let mut pooled = pool.map_or_else(PooledMesh::default, |pool| pool.take_for(geometry));
            copy(geometry, &mut pooled.geometry);
            pooled
        }
        Err(error) => {
            bevy_log::error!("chunk {:?} of level {} cannot be meshed: {error}", key.position, key.level);
            PooledMesh::default()
        }
    });
    let PooledMesh { geometry, asset } = pooled;
    let mesh = style.filter(|_| !geometry.is_empty()).map(|style| to_asset(&geometry, style, asset));
    let geometry = Arc::new(geometry);
    ChunkMesh { key, geometry, mesh, time: start.elapsed() }
}

fn copy(from: &MeshBuffer, to: &mut MeshBuffer) {
    let MeshBuffer { positions, normals, materials, indices, bounds } = from;
    to.positions.clone_from(positions);
    to.normals.clone_from(normals);
    to.materials.clone_from(materials);
    to.indices.clone_from(indices);
    to.bounds = *bounds;
}

/// Makes a mesh asset: positions in voxels, normals, colours and materials per vertex, and indices. The indices are
/// 16-bit if there are few enough vertices, else 32-bit.
fn to_asset(geometry: &MeshBuffer, style: &AssetStyle, pooled: PooledAsset) -> Mesh {
    let MeshBuffer { positions, normals, materials, indices, bounds } = geometry;
    let indices = if positions.len() <= usize::from(u16::MAX) {
        Indices::U16(fill_pooled(pooled.indices, indices.iter().map(|&index| index as u16)))
    } else {
        Indices::U32(indices.clone())
    };
    let mut mesh = Mesh::new(PrimitiveTopology::TriangleList, style.usages)
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, fill_pooled(pooled.positions, positions.iter().copied()))
        .with_inserted_indices(indices);
    if !normals.is_empty() {
        mesh.insert_attribute(Mesh::ATTRIBUTE_NORMAL, fill_pooled(pooled.normals, normals.iter().copied()));
    }
    if !materials.is_empty() {
        let vertex_colors = materials.iter().map(|&material| style.colors[usize::from(material)]);
        mesh.insert_attribute(Mesh::ATTRIBUTE_COLOR, fill_pooled(pooled.colors, vertex_colors));
        mesh.insert_attribute(
            ATTRIBUTE_MATERIAL,
            fill_pooled(pooled.materials, materials.iter().copied().map(u32::from)),
        );
    }
    mesh.final_aabb = bounds.map(|[min, max]| Aabb3d::from_min_max(min, max));
    mesh
}

/// Fills an empty pooled vector with `items`.
fn fill_pooled<T>(mut pooled: Vec<T>, items: impl ExactSizeIterator<Item = T>) -> Vec<T> {
    pooled.reserve_exact(items.len());
    pooled.extend(items);
    pooled
}
