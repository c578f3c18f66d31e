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
use super::spare::{AssetRoom, SpareMeshes};

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
    let room = || spare.map_or_else(AssetRoom::default, |spare| spare.room_for(&geometry));
    let mesh = colors.filter(|_| !geometry.is_empty()).map(|colors| to_asset(&geometry, colors, room()));
    Meshed { position, geometry, mesh, time: start.elapsed() }
}

/// A mesh for the render world: positions in voxels, colours and materials a vertex, and the indices, in half the bytes
/// where there are few enough vertices.
fn to_asset(geometry: &MeshBuffer, colors: &Colors, room: AssetRoom) -> Mesh {
    let MeshBuffer { positions, normals, materials, indices, bounds } = geometry;
    let indices = if positions.len() <= usize::from(u16::MAX) {
        Indices::U16(filled(room.indices, indices.iter().map(|&index| index as u16)))
    } else {
        Indices::U32(indices.clone())
    };
    let mut mesh = Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::RENDER_WORLD)
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, filled(room.positions, positions.iter().copied()))
        .with_inserted_indices(indices);
    if !normals.is_empty() {
        mesh.insert_attribute(Mesh::ATTRIBUTE_NORMAL, filled(room.normals, normals.iter().copied()));
    }
    if !materials.is_empty() {
        let vertex_colors = materials.iter().map(|&material| colors[usize::from(material)]);
        mesh.insert_attribute(Mesh::ATTRIBUTE_COLOR, filled(room.colors, vertex_colors));
        mesh.insert_attribute(ATTRIBUTE_MATERIAL, filled(room.materials, materials.iter().copied().map(u32::from)));
    }
    mesh.final_aabb = bounds.map(|[min, max]| Aabb3d::from_min_max(min, max));
    mesh
}

/// The items, in a room that is empty.
fn filled<T>(mut room: Vec<T>, items: impl ExactSizeIterator<Item = T>) -> Vec<T> {
    room.reserve_exact(items.len());
    room.extend(items);
    room
}
