//! [`TerrainDescription`]: the settings of a terrain, as plain data.

use bevy_asset::Asset;
use bevy_reflect::prelude::*;
use ron::Options;
use ron::extensions::Extensions;
use ron::ser::PrettyConfig;
use serde::{Deserialize, Serialize};

use super::DescriptionError;
use crate::source::{Air, Sdf};
#[cfg(feature = "png")]
use crate::source::{HeightMap, HeightMapSettings};
#[cfg(feature = "noise")]
use crate::source::{
    Landscape, LandscapeSettings, NoiseDensity, NoiseDensitySettings, NoiseHeights, NoiseHeightsSettings,
};
use crate::terrain::{Extent, Keep, Palette, SourceHandle, Terrain, TerrainLevels, TerrainMesher};

/// A description of a terrain: plain data, read from a file or written in code, kept as an asset.
#[derive(Asset, Reflect, Serialize, Deserialize, Clone, Debug, PartialEq)]
#[reflect(Debug, PartialEq, Clone)]
#[serde(deny_unknown_fields)]
pub struct TerrainDescription {
    /// The source of the terrain's samples before it is edited. A file must name it.
    pub source: SourceDescription,
    /// Sets [`Terrain::palette`]. Default: that of [`Palette`].
    #[serde(default)]
    pub palette: Palette,
    /// Sets [`Terrain::voxel_size`]. Default: 1.
    #[serde(default = "default_voxel_size")]
    pub voxel_size: f32,
    /// Sets [`Terrain::extent`]. Default: that of [`Terrain`], 8 × 4 × 8 chunks.
    #[serde(default = "default_extent")]
    pub extent: Extent,
    /// Sets [`Terrain::keep`]. Default: everything, which an endless extent does not allow.
    #[serde(default)]
    pub keep: Keep,
    /// Sets [`Terrain::levels`]. Default: one level.
    #[serde(default)]
    pub levels: TerrainLevels,
    /// Sets [`Terrain::mesher`]. Default: the primal one.
    #[serde(default)]
    pub mesher: TerrainMesher,
}

/// A description of a terrain's source: its samples before it is edited.
#[derive(Reflect, Serialize, Deserialize, Clone, Debug, PartialEq)]
#[reflect(Debug, PartialEq, Clone)]
#[non_exhaustive]
pub enum SourceDescription {
    /// [`Air`].
    Air,
    /// [`NoiseHeights`].
    #[cfg(feature = "noise")]
    NoiseHeights(NoiseHeightsSettings),
    /// [`NoiseDensity`].
    #[cfg(feature = "noise")]
    NoiseDensity(NoiseDensitySettings),
    /// [`Landscape`].
    #[cfg(feature = "noise")]
    Landscape(LandscapeSettings),
    /// An [`Sdf`].
    Sdf(Sdf),
    /// A [`HeightMap`].
    #[cfg(feature = "png")]
    HeightMap(HeightMapDescription),
}

/// A description of a height map: the path of its picture, and how the pixels become ground.
#[cfg(feature = "png")]
#[derive(Reflect, Serialize, Deserialize, Clone, Debug, PartialEq)]
#[reflect(Debug, PartialEq, Clone)]
#[serde(deny_unknown_fields)]
pub struct HeightMapDescription {
    /// The path of the picture, a 16-bit greyscale PNG file, in `assets`, as the asset server takes it. When the
    /// picture changes, the description is loaded again.
    pub picture: String,
    /// How its pixels become ground.
    #[serde(default)]
    pub settings: HeightMapSettings,
    /// The picture's samples; not written to files. The asset loader reads them; code must set them.
    #[serde(skip)]
    pub map: Option<HeightMap>,
}

impl TerrainDescription {
    /// A description with this source and the default settings.
    pub fn new(source: SourceDescription) -> Self {
        Self {
            source,
            palette: Palette::default(),
            voxel_size: default_voxel_size(),
            extent: default_extent(),
            keep: Keep::default(),
            levels: TerrainLevels::default(),
            mesher: TerrainMesher::default(),
        }
    }

    /// Parses the text of a terrain file. Does not read pictures.
    ///
    /// # Errors
    /// [`DescriptionError`] for text that is cut short, is not such RON, or holds settings that are out of range.
    pub fn from_ron(text: &str) -> Result<Self, DescriptionError> {
        let description: Self = options().from_str(text).map_err(|error| DescriptionError::from_ron(error, text))?;
        description.check().map_err(|error| error.in_text(text))?;
        Ok(description)
    }

    /// Parses the bytes of a terrain file, which must be UTF-8; see [`from_ron`](Self::from_ron).
    pub(super) fn from_bytes(bytes: &[u8]) -> Result<Self, DescriptionError> {
        let text = str::from_utf8(bytes).map_err(|error| {
            let valid = String::from_utf8_lossy(&bytes[..error.valid_up_to()]);
            DescriptionError::from_utf8(&valid, error.error_len().is_none())
        })?;
        Self::from_ron(text)
    }

    /// The text of a terrain file with this description.
    ///
    /// # Errors
    /// [`DescriptionError::Write`] for settings that are nested too deeply.
    pub fn to_ron(&self) -> Result<String, DescriptionError> {
        let pretty = PrettyConfig::new();
        options().to_string_pretty(self, pretty).map_err(|error| DescriptionError::Write { message: error.to_string() })
    }

    /// A terrain with these settings.
    ///
    /// # Errors
    /// [`DescriptionError`] for settings that are out of range and for a height map whose picture was not read.
    pub fn terrain(&self) -> Result<Terrain, DescriptionError> {
        let mut terrain = Terrain::default();
        self.apply(None, &mut terrain)?;
        Ok(terrain)
    }

    /// Sets those of a terrain's settings that differ from the description `before`, or all of them without one. On an
    /// error, the terrain stays as it is.
    pub(super) fn apply(&self, before: Option<&Self>, terrain: &mut Terrain) -> Result<(), DescriptionError> {
        let mut next = terrain.clone();
        if before.is_none_or(|before| before.source != self.source) {
            next.source = self.source.build()?;
        }
        if before.is_none_or(|before| before.palette != self.palette) {
            next.palette = self.palette.clone();
        }
        if before.is_none_or(|before| before.voxel_size != self.voxel_size) {
            next.voxel_size = self.voxel_size;
        }
        if before.is_none_or(|before| before.extent != self.extent) {
            next.extent = self.extent;
        }
        if before.is_none_or(|before| before.keep != self.keep) {
            next.keep = self.keep;
        }
        if before.is_none_or(|before| before.levels != self.levels) {
            next.levels = self.levels;
        }
        if before.is_none_or(|before| before.mesher != self.mesher) {
            next.mesher.clone_from(&self.mesher);
        }
        next.check()?;
        *terrain = next;
        Ok(())
    }

    /// Checks that all settings are in their ranges; a picture may still be missing.
    fn check(&self) -> Result<(), DescriptionError> {
        #[cfg(feature = "png")]
        if let SourceDescription::HeightMap(HeightMapDescription { settings, map: None, .. }) = &self.source {
            settings.validate()?;
            return Self { source: SourceDescription::Air, ..self.clone() }.check();
        }
        self.terrain().map(|_| ())
    }
}

impl SourceDescription {
    /// Builds the source.
    ///
    /// # Errors
    /// [`DescriptionError`] for settings that are out of range and for a height map whose picture was not read.
    pub fn build(&self) -> Result<SourceHandle, DescriptionError> {
        Ok(match self.clone() {
            Self::Air => SourceHandle::new(Air),
            #[cfg(feature = "noise")]
            Self::NoiseHeights(settings) => SourceHandle::new(NoiseHeights::new(settings)?),
            #[cfg(feature = "noise")]
            Self::NoiseDensity(settings) => SourceHandle::new(NoiseDensity::new(settings)?),
            #[cfg(feature = "noise")]
            Self::Landscape(settings) => SourceHandle::new(Landscape::new(settings)?),
            Self::Sdf(shape) => SourceHandle::new(shape.validate()?),
            #[cfg(feature = "png")]
            Self::HeightMap(HeightMapDescription { picture, settings, map }) => {
                let map = map.ok_or(DescriptionError::NoPicture { picture })?;
                SourceHandle::new(map.with_settings(settings)?)
            }
        })
    }
}

fn default_voxel_size() -> f32 {
    Terrain::default().voxel_size
}

fn default_extent() -> Extent {
    Terrain::default().extent
}

/// The RON options: extensions that make files shorter to write.
fn options() -> Options {
    Options::default().with_default_extension(Extensions::IMPLICIT_SOME | Extensions::UNWRAP_VARIANT_NEWTYPES)
}
