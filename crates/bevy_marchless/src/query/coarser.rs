//! Rays through leaves of coarser levels, which have meshes but no samples.

use bevy_math::DVec3;
use marchless::{LeafKey, Region};

use super::LatticeHit;
use super::triangles::MeshRay;
use crate::volume::Heart;

/// The first triangle of a coarser leaf that a ray hits, from either side.
pub(super) fn cast(heart: &Heart, ray: MeshRay) -> Option<LatticeHit> {
    let cells = f64::from(heart.samples().shown().chunk_cells());
    let clip = |ray: MeshRay, chunks: Region| {
        let [min, max] = [chunks.min, chunks.max].map(|end| DVec3::from_array(end.map(f64::from)) * cells);
        ray.clip(min, max)
    };
    let [mut at, end] = clip(ray, heart.levels_region()?)?;
    while at < end {
        let chunk = ((ray.origin + ray.direction * at) / cells).floor().as_ivec3().to_array();
        let leaf = heart.drawn_leaf_at(chunk);
        // Where nothing is drawn, the ray goes on chunk by chunk of the finest level.
        let place = leaf.map_or(LeafKey { level: 0, position: chunk }, LeafKey::from);
        if let Some(drawn) = leaf.filter(|leaf| leaf.level > 0).and_then(|leaf| heart.table().drawn(leaf)) {
            let size = f64::from(1u32 << place.level);
            let corner = DVec3::from_array(place.region().min.map(f64::from)) * cells;
            let local = MeshRay { origin: (ray.origin - corner) / size, reach: ray.reach / size, ..ray };
            if let Some(hit) = local.cast(&drawn.geometry) {
                return Some(LatticeHit::of_mesh(&ray, hit, size, place.level, drawn.entity));
            }
        }
        let [_, beyond] = clip(MeshRay { reach: f64::INFINITY, ..ray }, place.region()).unwrap_or([at; 2]);
        // A step over the border, also where rounding would keep it from moving.
        at = beyond.max(at) + 1e-6 * (1.0 + at);
    }
    None
}
