//! Meshing chunks, on any thread.

use core::cell::RefCell;
use core::time::Duration;
use std::sync::Arc;

use bevy_asset::RenderAssetUsages;
use bevy_math::bounding::Aabb3d;
use bevy_mesh::{Indices, Mesh, PrimitiveTopology};
use bevy_platform::time::Instant;
use bevy_tasks::ComputeTaskPool;
use marchless::{Block, Grid, MeshBuffer, MeshError, MeshSettings, Mesher, NeighbourhoodView};

use super::ATTRIBUTE_MATERIAL;
use super::spare::SpareMeshes;

/// The linear colours of all materials.
pub(crate) type Colors = Arc<[[f32; 4]; 256]>;

/// A chunk's new mesh.
pub(crate) struct Meshed {
    pub(crate) position: [i32; 3],
    pub(crate) geometry: Arc<MeshBuffer>,
    /// The same as an asset, where assets are wanted and there is something to draw.
    pub(crate) mesh: Option<Mesh>,
    /// How long it took.
    pub(crate) time: Duration,
}

impl Meshed {
    /// Nothing to draw.
    pub(crate) fn empty(position: [i32; 3]) -> Self {
        Self { position, geometry: Arc::default(), mesh: None, time: Duration::ZERO }
    }
}

/// Meshes a chunk. `colors`: of its vertices; `None` where no asset is wanted. `spare`: memory for the mesh; without it,
/// the mesh takes no more than it needs.
pub(crate) fn mesh_chunk(
    samples: &NeighbourhoodView<'_>,
    position: [i32; 3],
    settings: &MeshSettings,
    colors: Option<&Colors>,
    spare: Option<&SpareMeshes>,
) -> Meshed {
    mesh_with(position, colors, spare, |mesher, block, out| samples.mesh(mesher, block, settings, out))
}

/// Meshes chunks at once, on the compute pool where there is one.
pub(crate) fn mesh_now(
    grid: &Grid,
    positions: &[[i32; 3]],
    settings: &MeshSettings,
    colors: Option<&Colors>,
    spare: &SpareMeshes,
) -> Vec<Meshed> {
    let mesh = |position| mesh_chunk(&grid.neighbourhood_view(position), position, settings, colors, Some(spare));
    match ComputeTaskPool::try_get() {
        Some(pool) if positions.len() > 1 => pool.scope(|scope| {
            for &position in positions {
                scope.spawn(async move { mesh(position) });
            }
        }),
        _ => positions.iter().copied().map(mesh).collect(),
    }
}

/// Runs `mesh` with this thread's scratch memory, and makes an asset of what comes out. A failure is reported and
/// leaves nothing to draw.
pub(super) fn mesh_with(
    position: [i32; 3],
    colors: Option<&Colors>,
    spare: Option<&SpareMeshes>,
    mesh: impl FnOnce(&mut Mesher, &mut Block<i16>, &mut MeshBuffer) -> Result<(), MeshError>,
) -> Meshed {
    thread_local! {
        static SCRATCH: RefCell<(Mesher, Block<i16>, MeshBuffer)> =
            RefCell::new((Mesher::new(), Block::new(), MeshBuffer::new()));
    }
    let start = Instant::now();
    // A copy takes no more memory than the mesh needs; a buffer that has grown does.
    let geometry = SCRATCH.with_borrow_mut(|(mesher, block, geometry)| match mesh(mesher, block, geometry) {
        Ok(()) => spare.map_or_else(|| Arc::new(geometry.clone()), |spare| spare.copy(geometry)),
        Err(error) => {
            bevy_log::error!("chunk {position:?} cannot be meshed: {error}");
            Arc::default()
        }
    });
    let mesh = colors.filter(|_| !geometry.is_empty()).map(|colors| to_asset(&geometry, colors));
    Meshed { position, geometry, mesh, time: start.elapsed() }
}

/// The indices, in half the bytes where there are few enough vertices.
fn indices(geometry: &MeshBuffer) -> Indices {
    if geometry.positions.len() <= usize::from(u16::MAX) {
        Indices::U16(geometry.indices.iter().map(|&index| index as u16).collect())
    } else {
        Indices::U32(geometry.indices.clone())
    }
}

/// A mesh for the render world: positions in voxels, colours and materials a vertex.
fn to_asset(geometry: &MeshBuffer, colors: &Colors) -> Mesh {
    let mut mesh = Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::RENDER_WORLD)
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, geometry.positions.clone())
        .with_inserted_indices(indices(geometry));
    if !geometry.normals.is_empty() {
        mesh.insert_attribute(Mesh::ATTRIBUTE_NORMAL, geometry.normals.clone());
    }
    let materials = || geometry.materials.iter().copied();
    if !geometry.materials.is_empty() {
        let vertex_colors: Vec<_> = materials().map(|material| colors[usize::from(material)]).collect();
        mesh.insert_attribute(Mesh::ATTRIBUTE_COLOR, vertex_colors);
        mesh.insert_attribute(ATTRIBUTE_MATERIAL, materials().map(u32::from).collect::<Vec<_>>());
    }
    mesh.final_aabb = geometry.bounds.map(|[min, max]| Aabb3d::from_min_max(min, max));
    mesh
}
