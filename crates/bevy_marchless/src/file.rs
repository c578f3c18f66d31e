//! Terrain files: descriptions of terrains, read from `assets`, also while the game runs (feature `terrain_files`).
//!
//! A terrain file is [RON](https://docs.rs/ron) text whose name ends in `.terrain.ron`. This one describes endless
//! hills, 256 voxels high. Fields that a file leaves out have their defaults:
//!
//! ```
//! # use bevy_marchless::prelude::*;
//! # use bevy_marchless::source::prelude::*;
//! # use bevy_marchless::file::TerrainDescription;
//! let description = TerrainDescription::from_ron("
//! (
//!     source: NoiseHeights(
//!         noise: (seed: 7, zoom: 300.0, octaves: 6),
//!         amplitude: 80.0,
//!         strata: [(material: 2, steeper_than: 1.0), (material: 1, below_depth: 1.5)],
//!     ),
//!     extent: (y: (-2, 6)),
//!     keep: Nothing,
//! )
//! ")?;
//! assert_eq!(description.extent, Extent::ENDLESS.with_y(-2..6));
//! # Ok::<(), bevy_marchless::file::DescriptionError>(())
//! ```
//!
//! A terrain with a [`TerrainFile`] follows such a file:
//!
//! ```
//! use bevy_asset::AssetServer;
//! # use bevy_ecs::prelude::*;
//! use bevy_marchless::prelude::*;
//!
//! fn setup(mut commands: Commands, assets: Res<AssetServer>) {
//!     commands.spawn(TerrainFile(assets.load("terrains/valley.terrain.ron")));
//! }
//! ```
//!
//! # Changes while the game runs
//! When the asset changes, the terrain takes over the settings that changed: another palette only colours it again,
//! another source fills it again. An asset changes when its file is read again, or when a system changes it in
//! [`Assets`]. Bevy's feature `file_watcher` reads a file again when it is saved, [`AssetServer::reload`] on demand.
//!
//! While a file is loading for the first time, the terrain stays as it is and its stamps wait. They are applied to the
//! terrain that the file describes. If the file cannot be read, is cut short or holds bad settings, the terrain also
//! stays as it is. Each failure is logged once, with the line of the error. Settings that the game changes on the
//! [`Terrain`](crate::terrain::Terrain) itself stay until the file changes the same setting.
//!
//! # The format
//! The names are those of the settings' fields and variants, so the settings' documentation is also the format's.
//! Fields that are left out have their defaults; unknown fields are an error. `Some` may be left out, and so may the
//! inner parentheses of a variant with settings: `NoiseHeights(amplitude: 80.0)`, `mesher: Dual(smoothing: 2)`. An
//! [`Extent`](crate::terrain::Extent) gives the first chunk and one past the last for each axis along which it ends:
//! `(y: (-2, 6))`. Numbers may be `inf` and `-inf` where the settings allow it. [`TerrainDescription::to_ron`] writes
//! this format.

mod description;
mod error;
mod follow;
mod loader;

use bevy_app::{App, Plugin, PostUpdate};
use bevy_asset::{AssetApp as _, AssetServer, Assets, Handle};
use bevy_ecs::prelude::*;
use bevy_reflect::prelude::*;

#[cfg(feature = "png")]
pub use description::HeightMapDescription;
pub use description::{SourceDescription, TerrainDescription};
pub use error::DescriptionError;
pub use loader::DescriptionLoader;

use crate::schedule::MarchlessSystems;
use crate::terrain::Terrain;

/// Makes its entity's [`Terrain`] follow a [`TerrainDescription`], an asset.
///
/// The description sets the terrain's source, palette, voxel size, extent, [`Keep`](crate::terrain::Keep), levels and
/// mesher. All other settings (chunk size, isovalue, normals) stay the terrain's own.
#[derive(Component, Reflect, Clone, Debug, Default, PartialEq)]
#[reflect(Component, Default, Debug, PartialEq, Clone)]
#[require(Terrain, follow::FollowedFile)]
pub struct TerrainFile(pub Handle<TerrainDescription>);

/// Loads `*.terrain.ron`, and lets terrains follow their [`TerrainFile`].
///
/// Needs Bevy's `AssetPlugin`, added before or after; without it, nothing happens.
#[derive(Default)]
pub struct TerrainFilePlugin;

impl Plugin for TerrainFilePlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<TerrainFile>().add_observer(follow::forget_removed_file);
        register_asset(app);
    }

    fn finish(&self, app: &mut App) {
        register_asset(app);
    }
}

/// Registers the asset and its systems once, if there is an asset server.
fn register_asset(app: &mut App) {
    let world = app.world();
    if !world.contains_resource::<AssetServer>() || world.contains_resource::<Assets<TerrainDescription>>() {
        return;
    }
    app.init_asset::<TerrainDescription>()
        .register_asset_reflect::<TerrainDescription>()
        .register_asset_loader(DescriptionLoader)
        .add_systems(PostUpdate, (follow::follow_files, follow::report_failures).before(MarchlessSystems::Work));
}
