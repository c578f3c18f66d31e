//! [`Chunk`] and [`ChunkGeometry`]: components of the child entities that mirror what is drawn of a terrain.

use core::hash::{Hash, Hasher};
use std::sync::Arc;

use bevy_camera::primitives::Aabb;
use bevy_camera::visibility::{NoAutoAabb, Visibility};
use bevy_ecs::prelude::*;
use bevy_math::{DVec3, IVec3, UVec3, Vec3};
use bevy_reflect::prelude::*;
use bevy_transform::components::Transform;
use marchless::{LeafKey, MeshBuffer};

/// One chunk of a terrain, on its own entity, a child of the terrain.
///
/// The plugin spawns chunks where there is something to draw, and gives each its `Transform`, `Aabb` and `Mesh3d`.
/// Samples live in the terrain's [`TerrainVolume`](crate::terrain::TerrainVolume). Despawning a chunk removes its mesh
/// from the screen, not its samples.
///
/// Only the plugin creates chunks. It despawns foreign ones, such as the copies under a cloned terrain, which spawns
/// its own, and those that came with a scene.
#[derive(Component, Reflect, Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[reflect(Component, Debug, PartialEq, Hash, Clone)]
#[component(immutable)]
#[require(ChunkGeometry, Transform, Visibility, NoAutoAabb)]
pub struct Chunk {
    /// The terrain's entity.
    #[entities]
    pub terrain: Entity,
    /// The chunk's level of detail; 0 is the finest. A chunk of level `k` is as wide as 2ᵏ chunks of level 0.
    pub level: u8,
    /// The chunk's position in the terrain, in chunks of its level; may be negative.
    pub position: IVec3,
}

impl Chunk {
    pub(crate) const fn key(&self) -> ChunkKey {
        ChunkKey { level: self.level, position: self.position.to_array() }
    }
}

/// The level and position of a chunk.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct ChunkKey {
    pub(crate) level: u8,
    pub(crate) position: [i32; 3],
}

impl Hash for ChunkKey {
    /// Writes two words. Keys are looked up in every update, and hashers need as long for a part of one or four bytes
    /// as for a word.
    #[inline]
    fn hash<H: Hasher>(&self, state: &mut H) {
        let [x, y, z] = self.position.map(|v| u64::from(v.cast_unsigned()));
        state.write_u64(x | y << 32);
        state.write_u64(z | u64::from(self.level) << 32);
    }
}

impl From<LeafKey> for ChunkKey {
    fn from(LeafKey { level, position }: LeafKey) -> Self {
        Self { level, position }
    }
}

impl From<ChunkKey> for LeafKey {
    fn from(ChunkKey { level, position }: ChunkKey) -> Self {
        Self { level, position }
    }
}

impl ChunkKey {
    /// The key of a chunk of the finest level.
    pub(crate) const fn finest(position: [i32; 3]) -> Self {
        Self { level: 0, position }
    }

    /// The 3 × 3 × 3 chunks of the same level around the chunk, itself included.
    pub(crate) fn around(self) -> impl Iterator<Item = Self> {
        let Self { level, position: [x, y, z] } = self;
        let near = |v: i32, step: i32| v.saturating_add(step - 1);
        (0..27).map(move |index| Self {
            level,
            position: [near(x, index % 3), near(y, index / 3 % 3), near(z, index / 9)],
        })
    }
}

/// The mesh of a chunk as shown now, in voxels of its level from the chunk's lowest corner. It exists without a renderer.
///
/// It lies within the chunk, or with the dual mesher up to one voxel below it on each axis.
///
/// Empty if nothing is left to draw, because everything was dug away. Where `Assets<Mesh>` exists, the entity's
/// `Mesh3d` holds the same mesh.
#[derive(Component, Reflect, Clone, Debug, Default)]
#[reflect(Component, Default, Debug, Clone)]
#[component(immutable)]
pub struct ChunkGeometry {
    /// The mesh; replaced as a whole, never modified.
    #[reflect(ignore)]
    pub mesh: Arc<MeshBuffer>,
}

/// The bundle of a new chunk, without its mesh.
pub(crate) fn new_chunk(terrain: Entity, key: ChunkKey, cells: u32, voxel_size: f32) -> impl Bundle {
    let ChunkKey { level, position } = key;
    (Chunk { terrain, level, position: position.into() }, chunk_transform(key, cells, voxel_size), ChildOf(terrain))
}

/// The transform from a chunk's own space, in voxels of its level, to the terrain's.
pub(crate) fn chunk_transform(key: ChunkKey, cells: u32, voxel_size: f32) -> Transform {
    let (corner, size) = chunk_place(key, cells, voxel_size);
    Transform::from_translation(corner.as_vec3()).with_scale(Vec3::splat(size))
}

/// A chunk's lowest corner in the terrain's space, and the size of a voxel of its level. `voxel_size`: that of the finest
/// one.
pub(crate) fn chunk_place(ChunkKey { level, position }: ChunkKey, cells: u32, voxel_size: f32) -> (DVec3, f32) {
    let size = voxel_size * f32::from(1u8 << level.min(7));
    (IVec3::from(position).as_dvec3() * f64::from(cells) * f64::from(size), size)
}

/// The bounding box of a whole chunk, in voxels.
pub(crate) fn chunk_bounds(cells: [u32; 3]) -> Aabb {
    Aabb::from_min_max(Vec3::ZERO, UVec3::from(cells).as_vec3())
}

/// The bounding box of a mesh, in voxels; the whole chunk's box for an empty mesh.
pub(crate) fn mesh_bounds(mesh: &MeshBuffer, cells: [u32; 3]) -> Aabb {
    match mesh.bounds {
        Some([min, max]) => Aabb::from_min_max(min.into(), max.into()),
        None => chunk_bounds(cells),
    }
}
