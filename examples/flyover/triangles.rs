//! The edges of all triangles, in the colours of their chunks' levels of detail.

use bevy::pbr::wireframe::{WireframeColor, WireframeConfig, WireframePlugin};
use bevy::prelude::*;
use bevy_marchless::gizmos::ChunkBoundsGizmos;
use bevy_marchless::prelude::*;

/// Draws them while [`WireframeConfig::global`] is true.
pub(crate) fn plugin(app: &mut App) {
    app.add_plugins(WireframePlugin::default()).add_observer(color_triangles);
}

/// Whether they are drawn from the start.
pub(crate) fn show_if(shown: bool) -> impl FnMut(ResMut<WireframeConfig>) {
    move |mut config| config.global = shown
}

pub(crate) fn show_or_hide(mut config: ResMut<WireframeConfig>) {
    config.global = !config.global;
}

/// Gives a new chunk the colour that its bounds have with [`ChunkColors::Levels`].
fn color_triangles(added: On<Add, Chunk>, chunks: Query<&Chunk>, mut commands: Commands) {
    let colors = ChunkBoundsGizmos::default().levels;
    if let Ok(chunk) = chunks.get(added.entity)
        && let Some(&color) = colors.get(usize::from(chunk.level))
    {
        commands.entity(added.entity).insert(WireframeColor { color });
    }
}
