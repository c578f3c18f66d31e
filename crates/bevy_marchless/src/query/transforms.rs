//! Updates terrains' `GlobalTransform` in apps that do not propagate transforms, such as servers with only Bevy's
//! `MinimalPlugins`. Without it, rays would look for each terrain at the origin.

use bevy_ecs::entity::EntityHashMap;
use bevy_ecs::entity_disabling::Disabled;
use bevy_ecs::prelude::*;
use bevy_ecs::query::Allow;
use bevy_transform::components::GlobalTransform;
use bevy_transform::helper::TransformHelper;
use bevy_transform::systems::StaticTransformOptimizations;

use crate::terrain::TerrainVolume;

/// True if Bevy's `TransformPlugin`, which inserts this resource, may be missing.
pub(super) fn may_lack_propagation(propagation: Option<Res<StaticTransformOptimizations>>) -> bool {
    propagation.is_none()
}

/// Computes terrains' `GlobalTransform` from their `Transform` and those of their ancestors.
///
/// A `GlobalTransform` that something else has written stays: another plugin propagates it in its own way. Terrains in
/// a big space, whose root has no `Transform`, also stay as they are.
pub(super) fn keep_transforms(
    mut terrains: Query<(Entity, &mut GlobalTransform), (With<TerrainVolume>, Allow<Disabled>)>,
    transforms: TransformHelper,
    mut written: Local<EntityHashMap<GlobalTransform>>,
) {
    let mut count = 0;
    for (terrain, mut global) in &mut terrains {
        count += 1;
        let Ok(computed) = transforms.compute_global_transform(terrain) else { continue };
        if is_same(&global, &computed) {
            continue;
        }
        let is_untouched = global.last_changed() == global.added();
        let is_ours = is_untouched || written.get(&terrain).is_some_and(|written| is_same(written, &global));
        if is_ours {
            *global = computed;
            written.insert(terrain, computed);
        }
    }
    if written.len() > count {
        written.retain(|terrain, _| terrains.contains(*terrain));
    }
}

/// True if both are equal bit for bit, NaN included.
fn is_same(a: &GlobalTransform, b: &GlobalTransform) -> bool {
    let [a, b] = [a, b].map(|transform| transform.affine().to_cols_array().map(f32::to_bits));
    a == b
}
