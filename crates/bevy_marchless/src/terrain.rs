//! [`Terrain`]: a terrain's settings and source. Insert it on an entity, and chunks appear.

mod error;
mod extent;
mod handle;
mod levels;
mod mesher;
mod prepare;
mod volume;

use bevy_app::{App, Plugin, PostUpdate};
use bevy_camera::visibility::Visibility;
use bevy_color::{Color, ColorToComponents as _, LinearRgba};
use bevy_ecs::prelude::*;
use bevy_math::{UVec3, Vec3};
use bevy_reflect::prelude::*;
use bevy_transform::components::Transform;
use marchless::{DEFAULT_CHUNK_CELLS, MeshMethod, Region, Source};

pub use error::TerrainError;
pub use extent::{Extent, Keep};
pub use handle::{SourceHandle, TerrainSources};
pub use levels::TerrainLevels;
pub use mesher::{DualMesher, SharpMaterials, TerrainMesher};
pub use volume::TerrainVolume;

use crate::chunk::{Chunk, ChunkGeometry};
use crate::cover::{Coverage, Leaf, LeafState};
use crate::schedule::UpdatePhase;
use crate::source::Air;
use crate::volume::SamplingSettings;

/// A terrain: its settings and its source.
///
/// Samples lie on a lattice, one voxel apart. The terrain's origin is lattice point 0, the lowest corner of chunk 0.
/// The entity's `Transform` moves, turns and scales the whole terrain. Several terrains may exist side by side.
///
/// A terrain [of a fixed extent](Terrain::new) is loaded as a whole. An [endless](Terrain::endless) one is loaded
/// around [`TerrainViewer`](crate::stream::TerrainViewer)s.
///
/// Changing `source`, `chunk_cells` or `voxel_size` fills the terrain anew and discards all edits. The world under way
/// is shown before the newest settings take effect, however often they change. Stamps wait for it.
///
/// Other `levels` draw all chunks anew; edits stay. With several levels, another source or extent does so too.
///
/// Changing `extent` or `keep` loads and unloads chunks. Chunks that stay inside the extent keep their state, and edits
/// come back with their chunks, even where a brush reached across the border. Another `isovalue` or `mesher` shows in
/// one update, as soon as every chunk is meshed for it. Other `normals` and another `palette` show chunk by chunk.
///
/// Settings out of range are refused with an error in the log and a [`TerrainError`] component; the previous settings
/// stay in effect.
///
/// Outside the extent there is air: the surface is closed there by flat walls.
///
/// ```
/// use bevy_marchless::prelude::*;
/// # use bevy_ecs::prelude::*;
/// # use bevy_math::UVec3;
///
/// fn setup(mut commands: Commands) {
///     // A ball of radius 40 in the middle of 128³ voxels: the distance to its surface at each position.
///     let ball = |[x, y, z]: [f64; 3]| ((x - 64.0).powi(2) + (y - 64.0).powi(2) + (z - 64.0).powi(2)).sqrt() - 40.0;
///     commands.spawn(Terrain::new(ball).with_extent(UVec3::splat(4)));
/// }
/// ```
#[derive(Component, Reflect, Clone, Debug)]
#[reflect(Component, Default, Debug, Clone)]
#[require(Transform, Visibility, TerrainVolume)]
pub struct Terrain {
    /// The chunks that the terrain has, at least 1 per axis. Default: 8 × 4 × 8, starting at chunk 0.
    pub extent: Extent,
    /// The chunks of the extent that are loaded even without a viewer; at most [`Terrain::MAX_CHUNKS`]. Default: all.
    pub keep: Keep,
    /// How detail falls off with distance. Default: it does not; there is one level.
    pub levels: TerrainLevels,
    /// Cells of a chunk per axis, from 8 to 62. Default 32.
    pub chunk_cells: u32,
    /// The distance between neighbouring samples, in world units; above 0. Default 1.
    pub voxel_size: f32,
    /// The surface lies where the weight equals this many voxels; finite. Default 0.
    ///
    /// Brushes dig into, add to and paint the surface at this isovalue, up to ±124 voxels. They write weights within 4
    /// voxels of it, so earlier edits are invisible at an isovalue farther away. Sources skip chunks more than 4 voxels
    /// from their surface, so isovalues beyond about ±3 may show seams there.
    pub isovalue: f32,
    /// How samples become triangles. Default: with the primal mesher. The dual one needs a single level.
    pub mesher: TerrainMesher,
    /// Whether meshes have normals. Default true.
    pub normals: bool,
    /// The colours of materials.
    pub palette: Palette,
    /// The source of the samples before any edit. Default: air.
    pub source: SourceHandle,
}

impl Terrain {
    /// The most chunks that a terrain may keep loaded, and the most that may be loaded around one viewer.
    pub const MAX_CHUNKS: u64 = 65_536;

    /// Creates a terrain from `source`, with the default settings.
    pub fn new(source: impl Source) -> Self {
        Self {
            extent: UVec3::new(8, 4, 8).into(),
            keep: Keep::Everything,
            levels: TerrainLevels::default(),
            chunk_cells: DEFAULT_CHUNK_CELLS,
            voxel_size: 1.0,
            isovalue: 0.0,
            mesher: TerrainMesher::default(),
            normals: true,
            palette: Palette::default(),
            source: SourceHandle::new(source),
        }
    }

    /// Creates a terrain without borders from `source`; it is loaded near viewers.
    pub fn endless(source: impl Source) -> Self {
        Self { extent: Extent::ENDLESS, keep: Keep::Nothing, ..Self::new(source) }
    }

    /// Sets the extent: a number of chunks per axis, starting at chunk 0, or an [`Extent`].
    #[must_use]
    pub fn with_extent(self, extent: impl Into<Extent>) -> Self {
        Self { extent: extent.into(), ..self }
    }

    /// Sets the chunks that are loaded even without a viewer.
    #[must_use]
    pub fn with_keep(self, keep: Keep) -> Self {
        Self { keep, ..self }
    }

    /// Sets how detail falls off with distance: a number of levels, or [`TerrainLevels`].
    #[must_use]
    pub fn with_levels(self, levels: impl Into<TerrainLevels>) -> Self {
        Self { levels: levels.into(), ..self }
    }

    /// Sets the number of cells of a chunk per axis.
    #[must_use]
    pub fn with_chunk_cells(self, chunk_cells: u32) -> Self {
        Self { chunk_cells, ..self }
    }

    /// Sets the distance between neighbouring samples, in world units.
    #[must_use]
    pub fn with_voxel_size(self, voxel_size: f32) -> Self {
        Self { voxel_size, ..self }
    }

    /// Sets the isovalue, in voxels.
    #[must_use]
    pub fn with_isovalue(self, isovalue: f32) -> Self {
        Self { isovalue, ..self }
    }

    /// Sets how samples become triangles: a [`TerrainMesher`], or the settings of the dual one.
    #[must_use]
    pub fn with_mesher(self, mesher: impl Into<TerrainMesher>) -> Self {
        Self { mesher: mesher.into(), ..self }
    }

    /// Sets whether meshes have normals.
    #[must_use]
    pub fn with_normals(self, normals: bool) -> Self {
        Self { normals, ..self }
    }

    /// Sets the colours of materials.
    #[must_use]
    pub fn with_palette(self, palette: Palette) -> Self {
        Self { palette, ..self }
    }

    /// Replaces the source; all edits are discarded.
    pub fn set_source(&mut self, source: impl Source) {
        self.source = SourceHandle::new(source);
    }

    /// Replaces the source by air; all edits are discarded.
    pub fn clear(&mut self) {
        self.set_source(Air);
    }

    /// The terrain's size in voxels per axis; saturates for endless terrains.
    pub fn size_in_voxels(&self) -> UVec3 {
        self.extent.size().saturating_mul(UVec3::splat(self.chunk_cells))
    }

    /// The terrain's size in its own space, in world units per axis.
    pub fn size(&self) -> Vec3 {
        self.size_in_voxels().as_vec3() * self.voxel_size
    }

    /// Checks that all settings are within their ranges.
    ///
    /// # Errors
    /// [`TerrainError`] for the first setting out of range.
    pub fn check(&self) -> Result<(), TerrainError> {
        if marchless::Grid::<i16>::new(self.chunk_cells).is_err() {
            return Err(TerrainError::ChunkCells { found: self.chunk_cells });
        }
        if self.chunk_region().is_empty() {
            return Err(TerrainError::Extent { min: self.extent.min, max: self.extent.max });
        }
        let kept = self.kept_region().size().into_iter().map(u128::from).product::<u128>();
        if kept > u128::from(Self::MAX_CHUNKS) {
            return Err(TerrainError::Keep { found: u64::try_from(kept).unwrap_or(u64::MAX) });
        }
        self.levels.check()?;
        self.mesher.check(self.chunk_cells)?;
        if self.mesher != TerrainMesher::Primal && self.levels.count > 1 {
            return Err(TerrainError::DualLevels { levels: self.levels.count });
        }
        if !(self.voxel_size > 0.0 && self.voxel_size.is_finite()) {
            return Err(TerrainError::VoxelSize { found: self.voxel_size });
        }
        if !self.isovalue.is_finite() {
            return Err(TerrainError::Isovalue { found: self.isovalue });
        }
        Ok(())
    }

    /// The chunks of the extent that can be addressed.
    pub(crate) fn chunk_region(&self) -> Region {
        self.extent.region(self.chunk_cells)
    }

    /// The chunks that are loaded even without a viewer.
    pub(crate) fn kept_region(&self) -> Region {
        self.keep.region(self.chunk_region(), self.chunk_cells)
    }

    /// Resolves a named source; the other settings stay the same.
    ///
    /// # Errors
    /// [`TerrainError::Source`] if no source of that name is registered.
    fn resolved(&self, sources: &TerrainSources) -> Result<Self, TerrainError> {
        Ok(Self { source: self.source.resolved(sources)?, ..self.clone() })
    }

    /// The settings that determine the samples before any edit.
    pub(crate) fn sampling_settings(&self) -> SamplingSettings {
        SamplingSettings {
            source: self.source.get().clone(),
            extent: self.chunk_region(),
            cells: self.chunk_cells,
            spacing: f64::from(self.voxel_size),
        }
    }

    /// How meshes are made, apart from their appearance: with normals.
    pub(crate) fn mesh_method(&self) -> MeshMethod {
        self.mesher.method(self.isovalue)
    }

    /// Whether both terrains have the same samples before any edit.
    fn has_samples_of(&self, other: &Self) -> bool {
        self.sampling_settings().has_samples_of(&other.sampling_settings())
    }

    /// Copies the settings of `other` that do not change the samples.
    fn take_all_but_samples(&mut self, other: &Self) {
        // They were checked with the chunk size of `other`. Levels and mesher go together.
        if self.chunk_cells == other.chunk_cells {
            (self.extent, self.keep) = (other.extent, other.keep);
            self.levels = other.levels;
            self.mesher.clone_from(&other.mesher);
        }
        (self.isovalue, self.normals) = (other.isovalue, other.normals);
        self.palette.clone_from(&other.palette);
    }
}

/// A terrain of air.
impl Default for Terrain {
    fn default() -> Self {
        Self::new(Air)
    }
}

/// The colours of materials, by material number. With fewer than 256 they repeat; with none, everything is white.
#[derive(Reflect, Clone, Debug, PartialEq)]
#[reflect(Default, Debug, PartialEq, Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct Palette {
    /// One colour per material.
    pub colors: Vec<Color>,
}

impl Palette {
    /// Creates a palette of `colors`.
    pub fn new<C: Into<Color>>(colors: impl IntoIterator<Item = C>) -> Self {
        Self { colors: colors.into_iter().map(Into::into).collect() }
    }

    /// The colour of `material`.
    pub fn color(&self, material: u8) -> Color {
        match self.colors.len() {
            0 => Color::WHITE,
            count => self.colors[usize::from(material) % count],
        }
    }

    /// The linear colours of all materials, in the format of vertex attributes.
    pub(crate) fn to_vertex_colors(&self) -> [[f32; 4]; 256] {
        core::array::from_fn(|material| LinearRgba::from(self.color(material as u8)).to_f32_array())
    }
}

/// Grass, earth, rock, sand, snow, clay, slate and moss.
impl Default for Palette {
    fn default() -> Self {
        Self::new(
            [
                [0.35, 0.52, 0.22],
                [0.45, 0.33, 0.22],
                [0.50, 0.49, 0.47],
                [0.82, 0.73, 0.52],
                [0.94, 0.95, 0.97],
                [0.66, 0.36, 0.25],
                [0.30, 0.32, 0.36],
                [0.42, 0.48, 0.28],
            ]
            .map(|[red, green, blue]| Color::srgb(red, green, blue)),
        )
    }
}

/// Adds component `C` to all terrains, both existing and future ones.
pub(crate) fn give_to_terrains<C: Component + Default>(app: &mut App) {
    let world = app.world_mut();
    let there: Vec<Entity> = world.query_filtered::<Entity, With<TerrainVolume>>().iter(world).collect();
    for terrain in there {
        world.entity_mut(terrain).insert(C::default());
    }
    app.add_observer(|added: On<Add, TerrainVolume>, mut commands: Commands| {
        commands.entity(added.entity).try_insert_if_new(C::default());
    });
}

/// Creates terrains' volumes and applies changes of their settings.
#[derive(Default)]
pub struct TerrainPlugin;

impl Plugin for TerrainPlugin {
    fn build(&self, app: &mut App) {
        crate::source::register_types(app);
        app.init_resource::<TerrainSources>()
            .init_resource::<prepare::CopiedChunks>()
            .register_type::<Terrain>()
            .register_type::<TerrainVolume>()
            .register_type::<TerrainError>()
            .register_type::<Chunk>()
            .register_type::<ChunkGeometry>()
            .register_type::<TerrainLevels>()
            .register_type::<TerrainMesher>()
            .register_type::<Leaf>()
            .register_type::<LeafState>()
            .register_type::<Coverage>()
            .register_type::<SourceHandle>()
            .add_observer(prepare::note_copied_chunk)
            .add_observer(prepare::forget_despawned_chunk)
            .add_observer(prepare::forget_removed_terrain)
            .add_systems(
                PostUpdate,
                (prepare::despawn_copied_chunks, prepare::prepare_terrains).in_set(UpdatePhase::Prepare),
            );
    }
}
