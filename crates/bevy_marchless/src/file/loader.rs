//! [`DescriptionLoader`]: reads terrain files, and the pictures that they name.

use bevy_asset::io::Reader;
use bevy_asset::{AssetLoader, LoadContext};
use bevy_reflect::TypePath;

#[cfg(feature = "png")]
use super::SourceDescription;
use super::{DescriptionError, TerrainDescription};
#[cfg(feature = "png")]
use crate::source::{HeightMap, HeightMapSettings};

/// Loads a [`TerrainDescription`] from `*.terrain.ron`.
#[derive(Clone, Copy, Debug, Default, TypePath)]
pub struct DescriptionLoader;

impl AssetLoader for DescriptionLoader {
    type Asset = TerrainDescription;
    type Settings = ();
    type Error = DescriptionError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        (): &(),
        context: &mut LoadContext<'_>,
    ) -> Result<TerrainDescription, DescriptionError> {
        let mut bytes = Vec::new();
        reader.read_to_end(&mut bytes).await?;
        let mut description = TerrainDescription::from_bytes(&bytes)?;
        read_picture(&mut description, context).await?;
        Ok(description)
    }

    fn extensions(&self) -> &[&str] {
        &["terrain.ron"]
    }
}

/// Reads the picture of a height map, and so makes the description's asset depend on it.
#[cfg(feature = "png")]
async fn read_picture(
    description: &mut TerrainDescription,
    context: &mut LoadContext<'_>,
) -> Result<(), DescriptionError> {
    if let SourceDescription::HeightMap(height_map) = &mut description.source {
        let failed = |message: String| DescriptionError::Picture { picture: height_map.picture.clone(), message };
        let bytes = context.read_asset_bytes(&height_map.picture).await.map_err(|error| failed(error.to_string()))?;
        let map = HeightMap::from_bytes(&bytes, HeightMapSettings::default());
        height_map.map = Some(map.map_err(|error| failed(error.to_string()))?);
        description.source.build()?;
    }
    Ok(())
}

#[cfg(not(feature = "png"))]
async fn read_picture(
    _description: &mut TerrainDescription,
    _context: &mut LoadContext<'_>,
) -> Result<(), DescriptionError> {
    Ok(())
}
