//! The hidden terrains, recorded once per update.
//!
//! Queries read this record. If they read `Visibility` itself, a system with a query could not change the `Visibility`
//! of any other entity. Bevy's own result, `InheritedVisibility`, is missing in apps without a renderer.

use bevy_camera::visibility::Visibility;
use bevy_ecs::prelude::*;

/// Records whether a terrain was hidden in the latest update.
#[derive(Component, Default, PartialEq)]
pub(super) struct IsHidden(pub(super) bool);

/// Records which terrains are hidden, by their own `Visibility` or an inherited one.
pub(super) fn note_visibility(
    mut terrains: Query<(Entity, &mut IsHidden)>,
    visibility: Query<(&Visibility, Option<&ChildOf>)>,
) {
    for (terrain, mut is_hidden) in &mut terrains {
        is_hidden.set_if_neq(IsHidden(!may_be_drawn(terrain, &visibility)));
    }
}

/// Resolves visibility as Bevy does: `Inherited` follows the parent, and means visible if the parent has no
/// `Visibility`.
fn may_be_drawn(terrain: Entity, all: &Query<(&Visibility, Option<&ChildOf>)>) -> bool {
    let mut next = Some(terrain);
    while let Some((visibility, parent)) = next.and_then(|entity| all.get(entity).ok()) {
        match visibility {
            Visibility::Visible => return true,
            Visibility::Hidden => return false,
            Visibility::Inherited => next = parent.map(ChildOf::parent),
        }
    }
    true
}
