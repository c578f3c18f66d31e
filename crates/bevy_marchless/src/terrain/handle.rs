//! [`SourceHandle`]: a terrain's source, held directly or by name. [`TerrainSources`]: the registered names.

use core::fmt;
use std::sync::Arc;

use bevy_ecs::prelude::*;
use bevy_platform::collections::HashMap;
use bevy_reflect::prelude::*;
use marchless::Source;

use super::TerrainError;
use crate::source::Air;

/// A shared [`Source`], or the name of one in [`TerrainSources`].
///
/// With the feature `serde`, handles are serialisable, so that terrains can be part of scenes. [`Air`],
/// [`NoiseHeights`](crate::source::NoiseHeights), [`NoiseDensity`](crate::source::NoiseDensity),
/// [`Landscape`](crate::source::Landscape) and [`Sdf`](crate::source::Sdf) are written as their settings, other sources
/// by name. A source with neither settings nor a name, such as a closure, cannot be written.
#[derive(Reflect, Clone)]
#[reflect(opaque)]
#[reflect(Default, Debug, PartialEq, Clone)]
#[cfg_attr(feature = "serde", reflect(Serialize, Deserialize))]
pub struct SourceHandle {
    /// The source; air until the name is resolved.
    source: Arc<dyn Source>,
    name: Option<Arc<str>>,
}

impl SourceHandle {
    /// Creates a handle to `source`.
    pub fn new(source: impl Source) -> Self {
        Self { source: Arc::new(source), name: None }
    }

    /// Creates a handle to the source that [`TerrainSources`] holds under `name` when the terrain is prepared.
    ///
    /// A terrain with an unregistered source name is refused with [`TerrainError::Source`] until the name is
    /// registered. Meanwhile it stays as it is; a new one stays empty. Another source under the same name fills the
    /// terrain anew.
    ///
    /// ```
    /// use bevy_marchless::prelude::*;
    /// use bevy_marchless::terrain::{SourceHandle, TerrainSources};
    /// # use bevy_ecs::prelude::*;
    ///
    /// fn setup(mut commands: Commands, mut sources: ResMut<TerrainSources>) {
    ///     sources.insert("waves", |[x, y, _]: [f64; 3]| y - 20.0 - 5.0 * (0.1 * x).sin());
    ///     commands.spawn(Terrain { source: SourceHandle::named("waves"), ..Terrain::default() });
    /// }
    /// ```
    pub fn named(name: impl Into<Arc<str>>) -> Self {
        Self { source: Arc::new(Air), name: Some(name.into()) }
    }

    /// The source. A handle by name returns [`Air`]; the handle in
    /// [`TerrainVolume::settings`](super::TerrainVolume::settings) has the source of that name.
    pub const fn get(&self) -> &Arc<dyn Source> {
        &self.source
    }

    /// The name of the source, if the handle has one.
    pub fn name(&self) -> Option<&str> {
        self.name.as_deref()
    }

    /// Resolves the handle's name to its source.
    ///
    /// # Errors
    /// [`TerrainError::Source`] if no source has this name.
    pub(super) fn resolved(&self, sources: &TerrainSources) -> Result<Self, TerrainError> {
        let Some(name) = &self.name else { return Ok(self.clone()) };
        match sources.0.get(name) {
            Some(source) => Ok(Self { source: source.clone(), name: self.name.clone() }),
            None => Err(TerrainError::Source { name: name.to_string() }),
        }
    }
}

impl From<Arc<dyn Source>> for SourceHandle {
    fn from(source: Arc<dyn Source>) -> Self {
        Self { source, name: None }
    }
}

impl Default for SourceHandle {
    fn default() -> Self {
        Self::new(Air)
    }
}

impl fmt::Debug for SourceHandle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.name {
            Some(name) => write!(f, "SourceHandle({name:?})"),
            None => f.write_str("SourceHandle(..)"),
        }
    }
}

/// Handles are equal if they share one source or one name.
impl PartialEq for SourceHandle {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name && (self.name.is_some() || Arc::ptr_eq(&self.source, &other.source))
    }
}

/// The game's own sources by name, for [`SourceHandle::named`]; scenes and files can refer to them.
#[derive(Resource, Default)]
pub struct TerrainSources(HashMap<Arc<str>, Arc<dyn Source>>);

impl TerrainSources {
    /// Registers a source under a name. Terrains with this source name are filled with it; existing ones are filled
    /// anew.
    pub fn insert(&mut self, name: impl Into<Arc<str>>, source: impl Source) {
        self.0.insert(name.into(), Arc::new(source));
    }

    /// The source registered under `name`.
    pub fn get(&self, name: &str) -> Option<&Arc<dyn Source>> {
        self.0.get(name)
    }
}

/// Serialisation of handles.
#[cfg(feature = "serde")]
mod written {
    use core::any::Any;

    use serde::de::Error as _;
    use serde::ser::Error as _;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    use super::SourceHandle;
    use crate::source::{Air, Sdf, SourceError};
    #[cfg(feature = "noise")]
    use crate::source::{
        Landscape, LandscapeSettings, NoiseDensity, NoiseDensitySettings, NoiseHeights, NoiseHeightsSettings,
    };

    /// The serialised form of a source.
    #[derive(Serialize, Deserialize)]
    #[serde(rename = "Source")]
    enum SerializedSource {
        Air,
        Named(String),
        #[cfg(feature = "noise")]
        NoiseHeights(NoiseHeightsSettings),
        #[cfg(feature = "noise")]
        NoiseDensity(NoiseDensitySettings),
        #[cfg(feature = "noise")]
        Landscape(LandscapeSettings),
        Sdf(Sdf),
    }

    impl SerializedSource {
        /// The serialised form of a handle; `None` if the source has none.
        fn of(handle: &SourceHandle) -> Option<Self> {
            if let Some(name) = handle.name() {
                return Some(Self::Named(name.to_owned()));
            }
            let source: &dyn Any = handle.source.as_ref();
            #[cfg(feature = "noise")]
            if let Some(source) = source.downcast_ref::<NoiseHeights>() {
                return Some(Self::NoiseHeights(source.settings().clone()));
            } else if let Some(source) = source.downcast_ref::<NoiseDensity>() {
                return Some(Self::NoiseDensity(source.settings().clone()));
            } else if let Some(source) = source.downcast_ref::<Landscape>() {
                return Some(Self::Landscape(source.settings().clone()));
            }
            if let Some(shape) = source.downcast_ref::<Sdf>() {
                return Some(Self::Sdf(shape.clone()));
            }
            source.is::<Air>().then_some(Self::Air)
        }

        fn handle(self) -> Result<SourceHandle, SourceError> {
            Ok(match self {
                Self::Air => SourceHandle::new(Air),
                Self::Named(name) => SourceHandle::named(name),
                #[cfg(feature = "noise")]
                Self::NoiseHeights(settings) => SourceHandle::new(NoiseHeights::new(settings)?),
                #[cfg(feature = "noise")]
                Self::NoiseDensity(settings) => SourceHandle::new(NoiseDensity::new(settings)?),
                #[cfg(feature = "noise")]
                Self::Landscape(settings) => SourceHandle::new(Landscape::new(settings)?),
                Self::Sdf(shape) => SourceHandle::new(shape.validate()?),
            })
        }
    }

    impl Serialize for SourceHandle {
        fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
            let written = SerializedSource::of(self).ok_or_else(|| {
                S::Error::custom(
                    "a terrain's source can be written where it has settings or goes by a name; give this one a name \
                     (`TerrainSources::insert` and `SourceHandle::named`)",
                )
            })?;
            written.serialize(serializer)
        }
    }

    impl<'de> Deserialize<'de> for SourceHandle {
        fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
            SerializedSource::deserialize(deserializer)?.handle().map_err(D::Error::custom)
        }
    }
}
