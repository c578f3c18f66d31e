//! Which terrains are hidden, noted in each update.
//!
//! Questions go by the note: if they read `Visibility` themselves, no system that asks one could change the `Visibility`
//! of anything else. Bevy's own result, `InheritedVisibility`, is missing where there is no renderer.

use bevy_camera::visibility::Visibility;
use bevy_ecs::prelude::*;

/// Whether a terrain was hidden when that was last noted.
#[derive(Component, Default, PartialEq)]
pub(super) struct IsHidden(pub(super) bool);

/// Notes which terrains are hidden: by their own `Visibility`, or by what they inherit.
pub(super) fn note_visibility(
    mut terrains: Query<(Entity, &mut IsHidden)>,
    visibility: Query<(&Visibility, Option<&ChildOf>)>,
) {
    for (terrain, mut is_hidden) in &mut terrains {
        is_hidden.set_if_neq(IsHidden(!may_be_drawn(terrain, &visibility)));
    }
}

/// As Bevy does it: what inherits goes by its parent, and counts as visible below one without any `Visibility`.
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
