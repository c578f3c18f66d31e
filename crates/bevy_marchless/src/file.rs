//! Worlds as files: what a terrain is made of, read from `assets`, also while the game runs (feature `terrain_files`).
//!
//! A world file is [RON](https://docs.rs/ron) text whose name ends in `.terrain.ron`. This one is a hilly country without
//! end, 256 voxels high; what a file does not name has its default:
//!
//! ```
//! # use bevy_marchless::prelude::*;
//! # use bevy_marchless::source::prelude::*;
//! # use bevy_marchless::file::TerrainDescription;
//! let world = TerrainDescription::from_ron("
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
//! assert_eq!(world.extent, Extent::ENDLESS.with_y(-2..6));
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
//! # While the game runs
//! When the asset changes, the terrain takes over what has changed in it: another palette only colours it anew, another source
//! fills it anew. Assets change when their file is read again (Bevy's feature `file_watcher` does so when it is saved,
//! [`AssetServer::reload`] when it is asked to), and when a system changes them in [`Assets`].
//!
//! Stamps wait while a file is loading for the first time, and are applied to its world. Meanwhile, and if it cannot be read, is cut short or holds bad settings, the terrain stays as it is;
//! each failure is told once in the log, with the line where it is. What was changed on the [`Terrain`](crate::terrain::Terrain)
//! by hand stays until the file changes the same.
//!
//! # The format
//! Names are those of the settings' fields and variants, so their documentation is the format's. Fields that are left
//! out have their defaults; unknown ones are refused. `Some` need not be written, nor the
//! parentheses of settings inside those of a variant: `NoiseHeights(amplitude: 80.0)`. An [`Extent`](crate::terrain::Extent)
//! names, for the axes along which it ends, the first chunk and one past the last: `(y: (-2, 6))`. Numbers may be `inf`
//! and `-inf` where the settings allow it. [`TerrainDescription::to_ron`] writes the same format.

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

/// Makes its entity's [`Terrain`] what a [`TerrainDescription`] says, and keeps it so when that changes.
///
/// The terrain's other settings (chunk size, isovalue, normals) stay its own.
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
        app.register_type::<TerrainFile>().add_observer(follow::forget_removed_world);
        register_asset(app);
    }

    fn finish(&self, app: &mut App) {
        register_asset(app);
    }
}

/// Registers the asset and its systems, where there is an asset server and it has not been done yet.
fn register_asset(app: &mut App) {
    let world = app.world();
    if !world.contains_resource::<AssetServer>() || world.contains_resource::<Assets<TerrainDescription>>() {
        return;
    }
    app.init_asset::<TerrainDescription>()
        .register_asset_reflect::<TerrainDescription>()
        .register_asset_loader(DescriptionLoader)
        .add_systems(PostUpdate, (follow::follow_worlds, follow::report_failures).before(MarchlessSystems::Work));
}
