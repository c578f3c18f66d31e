//! [`ChunkSamples`]: standalone chunks, whose samples the game provides on any entity.

use std::sync::Arc;

use bevy_camera::primitives::Aabb;
use bevy_camera::visibility::{NoAutoAabb, Visibility};
use bevy_ecs::change_detection::Tick;
use bevy_ecs::prelude::*;
use bevy_math::UVec3;
use bevy_mesh::Mesh3d;
use bevy_reflect::prelude::*;
use bevy_transform::components::Transform;
use marchless::{MeshMethod, Samples, SamplesError, Shape, ShapeError, Weight};
use thiserror::Error;

use super::MeshPresenter;
use super::job::mesh_with;
use crate::chunk::{ChunkGeometry, ChunkKey};
use crate::jobs::{Priority, Results, Ticket, WorkQueue};
use crate::terrain::{Palette, TerrainMesher};
use crate::volume::ChunkMesh;

/// A standalone chunk: samples that you insert on any entity. The plugin meshes them, and again after each change.
///
/// The mesh is in voxels from the first sample. The entity's `Transform` and its material are yours; an entity without
/// a material gets a plain one (feature `pbr`). The mesh stays open where the surface meets the samples' border. A
/// standalone chunk takes no stamps.
///
/// ```
/// use bevy_marchless::prelude::*;
/// use bevy_marchless::mesh::ChunkSamples;
/// # use bevy_ecs::prelude::*;
/// # use bevy_math::UVec3;
///
/// fn setup(mut commands: Commands) {
///     // A plane at height 1.5 in 4 × 4 × 4 samples.
///     let distances: Vec<f32> = (0..64).map(|index| (index / 4 % 4) as f32 - 1.5).collect();
///     let samples = ChunkSamples::from_distances(UVec3::splat(4), &distances).expect("64 distances");
///     commands.spawn(samples);
/// }
/// ```
#[derive(Component, Reflect, Clone, Debug)]
#[reflect(Component, Default, Debug, Clone)]
#[require(ChunkGeometry, Transform, Visibility, NoAutoAabb, MeshingState)]
pub struct ChunkSamples {
    data: SharedSamples,
    /// The surface lies where the weight equals this. [Limit: finite] [Units: voxels] Default: 0.
    pub isovalue: f32,
    /// How the samples become triangles. Default: with the primal mesher. With the dual one, the surface ends up to one
    /// cell before the samples' border; more than 8 steps of smoothing are an error in the log, and give no mesh.
    pub mesher: TerrainMesher,
    /// Whether the mesh has normals. Default: true.
    pub normals: bool,
    /// The colours of the materials.
    pub palette: Palette,
}

/// The samples, shared with the jobs that mesh them.
#[derive(Reflect, Clone, Debug)]
#[reflect(opaque)]
#[reflect(Default, Debug, Clone)]
#[cfg_attr(feature = "serde", reflect(Serialize, Deserialize))]
struct SharedSamples(Arc<Data>);

#[derive(Debug)]
struct Data {
    shape: Shape,
    weights: Vec<i16>,
    /// Empty, or one per sample.
    materials: Vec<u8>,
}

impl SharedSamples {
    fn new(shape: UVec3, weights: Vec<i16>, materials: Vec<u8>) -> Result<Self, ChunkSamplesError> {
        if shape.min_element() < 2 {
            return Err(ChunkSamplesError::TooSmall { found: shape });
        }
        let shape = Shape::new(shape.to_array())?;
        let samples = Samples::new(shape, &weights)?;
        if !materials.is_empty() {
            samples.with_materials(&materials)?;
        }
        Ok(Self(Arc::new(Data { shape, weights, materials })))
    }
}

/// Air, of 2 × 2 × 2 samples.
impl Default for SharedSamples {
    fn default() -> Self {
        Self::new(UVec3::splat(2), vec![i16::MAX; 8], Vec::new()).expect("8 weights of 2 × 2 × 2 samples")
    }
}

/// The serialized form of samples: shape, weights and materials.
#[cfg(feature = "serde")]
type SerializedSamples = (UVec3, Vec<i16>, Vec<u8>);

#[cfg(feature = "serde")]
impl serde::Serialize for SharedSamples {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let Data { shape, weights, materials } = &*self.0;
        (UVec3::from(shape.size()), weights, materials).serialize(serializer)
    }
}

#[cfg(feature = "serde")]
impl<'de> serde::Deserialize<'de> for SharedSamples {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let (shape, weights, materials) = SerializedSamples::deserialize(deserializer)?;
        Self::new(shape, weights, materials).map_err(serde::de::Error::custom)
    }
}

impl ChunkSamples {
    /// A standalone chunk of `shape` samples per axis, all of material 0.
    ///
    /// `weights`: signed distances in 1/256 voxel, negative inside; `[x·y·z]` of `shape`, x fastest.
    ///
    /// # Errors
    /// [`ChunkSamplesError`] if an axis has fewer than 2 samples or the length is not the shape's.
    pub fn new(shape: UVec3, weights: Vec<i16>) -> Result<Self, ChunkSamplesError> {
        Ok(Self { data: SharedSamples::new(shape, weights, Vec::new())?, ..Self::default() })
    }

    /// A standalone chunk from signed distances in voxels, rounded to 1/256 and saturated at ±128 voxels.
    ///
    /// `distances`: `[x·y·z]` of `shape`, x fastest.
    ///
    /// # Errors
    /// As [`ChunkSamples::new`].
    pub fn from_distances(shape: UVec3, distances: &[f32]) -> Result<Self, ChunkSamplesError> {
        Self::new(shape, distances.iter().map(|&distance| i16::from_voxels(distance)).collect())
    }

    /// Gives each sample its material from `materials`, x fastest. Without them, all samples have material 0.
    ///
    /// # Errors
    /// [`ChunkSamplesError::Samples`] if the length is not the shape's.
    pub fn with_materials(self, materials: Vec<u8>) -> Result<Self, ChunkSamplesError> {
        let data = &self.data.0;
        Samples::new(data.shape, &data.weights)?.with_materials(&materials)?;
        let data = Data { shape: data.shape, weights: data.weights.clone(), materials };
        Ok(Self { data: SharedSamples(Arc::new(data)), ..self })
    }

    /// Samples per axis.
    pub fn shape(&self) -> UVec3 {
        self.data.0.shape.size().into()
    }

    /// The weights, in 1/256 voxel, x fastest.
    pub fn weights(&self) -> &[i16] {
        &self.data.0.weights
    }

    /// The materials, x fastest; empty if none were given.
    pub fn materials(&self) -> &[u8] {
        &self.data.0.materials
    }

    /// A job that meshes the current samples.
    fn mesh_job(&self, presenter: &MeshPresenter) -> impl FnOnce() -> ChunkMesh + Send + 'static {
        let SharedSamples(data) = self.data.clone();
        let method = self.mesher.method(self.isovalue).with_normals(self.normals);
        let style = presenter.style(&Arc::new(self.palette.to_vertex_colors()));
        move || {
            let zeros;
            let materials = if data.materials.is_empty() {
                zeros = vec![0; data.weights.len()];
                &zeros
            } else {
                &data.materials
            };
            let samples = Samples::new(data.shape, &data.weights)
                .and_then(|samples| samples.with_materials(materials))
                .expect("the lengths have been checked");
            mesh_with(ChunkKey::finest([0; 3]), style.as_ref(), None, |scratch, out| {
                match &method {
                    MeshMethod::Primal(settings) => scratch.mesher.mesh(samples, settings, out)?,
                    MeshMethod::Dual(settings) => scratch.mesher.mesh_dual(samples, settings, out)?,
                }
                Ok(())
            })
        }
    }
}

/// Air, of 2 × 2 × 2 samples.
impl Default for ChunkSamples {
    fn default() -> Self {
        Self {
            data: SharedSamples::default(),
            isovalue: 0.0,
            mesher: TerrainMesher::default(),
            normals: true,
            palette: Palette::default(),
        }
    }
}

/// An error in the shape or length of [`ChunkSamples`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum ChunkSamplesError {
    /// An axis has fewer than two samples, so there is no cell.
    #[error("a chunk needs at least 2 samples per axis, but there are {found}")]
    TooSmall {
        /// The shape that was given.
        found: UVec3,
    },
    /// There are too many samples.
    #[error(transparent)]
    Shape(#[from] ShapeError),
    /// The number of weights or materials is not the shape's.
    #[error(transparent)]
    Samples(#[from] SamplesError),
}

/// The meshing state of an entity's samples.
#[derive(Component, Default)]
pub(super) struct MeshingState {
    /// The change tick of the samples that were seen last. With it, no change is missed while the entity is disabled.
    seen: Option<Tick>,
    /// Whether the seen samples still have to be meshed.
    changed: bool,
    /// The job that meshes earlier samples, and its result. The result is shown before the newest samples are meshed.
    job: Option<(Ticket, Results<ChunkMesh>)>,
}

/// Meshes changed samples: small chunks at once, others in jobs, one at a time for each entity.
pub(super) fn mesh_samples(
    mut chunks: Query<(Entity, Ref<ChunkSamples>, &mut MeshingState)>,
    queue: Res<WorkQueue>,
    mut presenter: MeshPresenter,
) {
    let mut cells_left = presenter.settings.max_inline_chunks.saturating_mul(32 * 32 * 32);
    for (entity, samples, mut state) in &mut chunks {
        let changed_at = samples.last_changed();
        if state.seen == Some(changed_at) && !state.changed && state.job.is_none() {
            continue;
        }
        let state = &mut *state;
        state.changed |= state.seen.replace(changed_at) != Some(changed_at);
        if let Some(meshed) = state.job.as_ref().and_then(|(_, results)| results.take().pop()) {
            state.job = None;
            show(entity, &samples, meshed, &mut presenter);
        }
        if !state.changed || state.job.is_some() {
            continue;
        }
        state.changed = false;
        let job = samples.mesh_job(&presenter);
        if samples.weights().len() <= cells_left {
            cells_left -= samples.weights().len();
            show(entity, &samples, job(), &mut presenter);
        } else {
            let results = Results::default();
            let made = results.clone();
            state.job = Some((queue.push(Priority::Edit, move || made.push(job())), results));
        }
    }
}

fn show(entity: Entity, samples: &ChunkSamples, meshed: ChunkMesh, presenter: &mut MeshPresenter) {
    presenter.stats.count_mesh(meshed.time);
    presenter.show(entity, meshed, (samples.shape() - 1).to_array());
}

/// Removes the mesh of an entity that loses its samples.
pub(super) fn forget_removed_samples(removed: On<Remove, ChunkSamples>, mut commands: Commands) {
    commands.entity(removed.entity).try_remove::<(Mesh3d, ChunkGeometry, Aabb, NoAutoAabb, MeshingState)>();
}
