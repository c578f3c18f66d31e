//! Rays through chunks with dual meshes, whose triangles samples alone do not tell.

use core::array;

use bevy_math::DVec3;

use super::LatticeHit;
use super::triangles::MeshRay;
use crate::chunk::ChunkKey;
use crate::terrain::TerrainVolume;

/// The first drawn triangle that a ray hits, from either side.
pub(super) fn cast(volume: &TerrainVolume, ray: MeshRay) -> Option<LatticeHit> {
    let (shown, table) = (volume.shown(), volume.heart().table());
    let cells = f64::from(shown.chunk_cells());
    let mut nearest: Option<LatticeHit> = None;
    // The meshes that the ray has just been tested against.
    let mut latest = [[i32::MAX; 3]; 8];
    let find = |position: [i32; 3]| {
        // A mesh reaches one cell below its chunk. So what lies in this chunk's box belongs to it and to those above.
        let owners: [[i32; 3]; 8] =
            array::from_fn(|step| [0, 1, 2].map(|axis| position[axis].saturating_add((step >> axis & 1) as i32)));
        for owner in owners.iter().filter(|owner| !latest.contains(owner)) {
            let Some(drawn) = table.drawn(ChunkKey::finest(*owner)) else { continue };
            let Some([min, max]) = drawn.geometry.bounds else { continue };
            let corner = DVec3::from_array(owner.map(f64::from)) * cells;
            let reach = nearest.as_ref().map_or(ray.reach, |hit| hit.distance);
            let local = MeshRay { origin: ray.origin - corner, reach, ..ray };
            let is_near = local.clip(DVec3::from(min.map(f64::from)), DVec3::from(max.map(f64::from))).is_some();
            if let Some(hit) = is_near.then(|| local.cast(&drawn.geometry)).flatten() {
                nearest = Some(LatticeHit::of_mesh(&ray, hit, 1.0, 0, drawn.entity));
            }
        }
        latest = owners;
        // What lies in later boxes is farther away than the end of this one.
        let corner = DVec3::from_array(position.map(f64::from)) * cells;
        let leaves = ray.clip(corner, corner + cells).map_or(0.0, |[_, leaves]| leaves);
        nearest.as_ref().is_some_and(|hit| hit.distance <= leaves).then_some(())
    };
    _ = shown.find_along_ray(ray.origin.to_array(), ray.direction.to_array(), ray.reach, find);
    nearest
}
