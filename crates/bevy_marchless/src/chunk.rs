//! [`Chunk`] and [`ChunkGeometry`]: the entities that mirror what is drawn of a terrain, its children.

use core::hash::{Hash, Hasher};
use std::sync::Arc;

use bevy_camera::primitives::Aabb;
use bevy_camera::visibility::{NoAutoAabb, Visibility};
use bevy_ecs::prelude::*;
use bevy_math::{IVec3, UVec3, Vec3};
use bevy_reflect::prelude::*;
use bevy_transform::components::Transform;
use marchless::MeshBuffer;

/// One chunk of a terrain, on an entity of its own, a child of the terrain.
///
/// The plugin spawns these where there is something to draw, and gives each its place, its `Aabb` and its `Mesh3d`.
/// Samples live in the terrain's [`TerrainVolume`](crate::terrain::TerrainVolume). Despawning one ends its drawing, not its samples.
///
/// Chunks are made, never copied: the plugin despawns those that it has not made, such as those of a cloned terrain, which
/// makes its own, or those that were written with a scene.
#[derive(Component, Reflect, Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[reflect(Component, Debug, PartialEq, Hash, Clone)]
#[component(immutable)]
#[require(ChunkGeometry, Transform, Visibility, NoAutoAabb)]
pub struct Chunk {
    /// The terrain it belongs to.
    #[entities]
    pub terrain: Entity,
    /// The level of detail that it is drawn in; 0 is the finest, and at present there is no other.
    pub level: u8,
    /// Its place in the terrain, in chunks of its level; may be negative.
    pub position: IVec3,
}

/// Which chunk of which level.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct ChunkKey {
    pub(crate) level: u8,
    pub(crate) position: [i32; 3],
}

impl Hash for ChunkKey {
    /// Two words: keys are looked up in every update, and parts of a byte or four take hashers as long as a word.
    #[inline]
    fn hash<H: Hasher>(&self, state: &mut H) {
        let [x, y, z] = self.position.map(|v| u64::from(v.cast_unsigned()));
        state.write_u64(x | y << 32);
        state.write_u64(z | u64::from(self.level) << 32);
    }
}

impl ChunkKey {
    /// A chunk of the finest level.
    pub(crate) const fn finest(position: [i32; 3]) -> Self {
        Self { level: 0, position }
    }

    /// The 3 × 3 × 3 chunks around it, itself included, of the same level.
    pub(crate) fn around(self) -> impl Iterator<Item = Self> {
        let Self { level, position: [x, y, z] } = self;
        let near = |v: i32, step: i32| v.saturating_add(step - 1);
        (0..27).map(move |index| Self {
            level,
            position: [near(x, index % 3), near(y, index / 3 % 3), near(z, index / 9)],
        })
    }
}

/// What a chunk looks like at the moment: the mesh in voxels from the chunk's lowest corner, without any renderer.
///
/// Empty where nothing is left to draw: all was dug away. The same entity's `Mesh3d` holds the same mesh, where there are `Assets<Mesh>`.
#[derive(Component, Reflect, Clone, Debug, Default)]
#[reflect(Component, Default, Debug, Clone)]
#[component(immutable)]
pub struct ChunkGeometry {
    /// The mesh; replaced, never changed.
    #[reflect(ignore)]
    pub mesh: Arc<MeshBuffer>,
}

/// The bundle of a chunk without its mesh.
pub(crate) fn new_chunk(
    terrain: Entity,
    ChunkKey { level, position }: ChunkKey,
    cells: u32,
    voxel_size: f32,
) -> impl Bundle {
    (
        Chunk { terrain, level, position: position.into() },
        chunk_transform(position, cells, voxel_size),
        ChildOf(terrain),
    )
}

/// From a chunk's own space, in voxels, to the terrain's.
pub(crate) fn chunk_transform(position: [i32; 3], cells: u32, voxel_size: f32) -> Transform {
    let corner = IVec3::from(position).as_dvec3() * f64::from(cells) * f64::from(voxel_size);
    Transform::from_translation(corner.as_vec3()).with_scale(Vec3::splat(voxel_size))
}

/// The box of a whole chunk, in voxels.
pub(crate) fn chunk_bounds(cells: [u32; 3]) -> Aabb {
    Aabb::from_min_max(Vec3::ZERO, UVec3::from(cells).as_vec3())
}

/// The box of a mesh, in voxels; that of the whole chunk where it is empty.
pub(crate) fn mesh_bounds(mesh: &MeshBuffer, cells: [u32; 3]) -> Aabb {
    match mesh.bounds {
        Some([min, max]) => Aabb::from_min_max(min.into(), max.into()),
        None => chunk_bounds(cells),
    }
}
