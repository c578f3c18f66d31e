//! Rays through leaves of coarser levels, which have meshes but no samples.

use bevy_math::DVec3;
use marchless::{LeafKey, MeshBuffer, Region};

use super::LatticeHit;
use crate::volume::Heart;

/// The first triangle of a coarser leaf that a ray hits, from either side. `direction`: of length 1.
pub(super) fn cast(heart: &Heart, origin: DVec3, direction: DVec3, reach: f64) -> Option<LatticeHit> {
    let cells = f64::from(heart.samples().shown().chunk_cells());
    let [mut at, end] = clip(origin, direction, reach, heart.levels_region()?, cells)?;
    while at < end {
        let chunk = ((origin + direction * at) / cells).floor().as_ivec3().to_array();
        let leaf = heart.drawn_leaf_at(chunk);
        // Where nothing is drawn, the ray goes on chunk by chunk of the finest level.
        let place = leaf.map_or(LeafKey { level: 0, position: chunk }, LeafKey::from);
        if let Some(drawn) = leaf.filter(|leaf| leaf.level > 0).and_then(|leaf| heart.table().drawn(leaf)) {
            let size = f64::from(1u32 << place.level);
            let corner = DVec3::from_array(place.region().min.map(f64::from)) * cells;
            let local = (origin - corner) / size;
            if let Some((distance, triangle)) = first_triangle(&drawn.geometry, local, direction, reach / size) {
                let (normal, material) = surface_at(&drawn.geometry, triangle, local + direction * distance);
                return Some(LatticeHit {
                    chunk: drawn.entity,
                    level: place.level,
                    distance: distance * size,
                    lattice: origin + direction * (distance * size),
                    normal,
                    material,
                });
            }
        }
        let [_, beyond] = clip(origin, direction, f64::INFINITY, place.region(), cells).unwrap_or([at; 2]);
        // A step over the border, also where rounding would keep it from moving.
        at = beyond.max(at) + 1e-6 * (1.0 + at);
    }
    None
}

/// The part of a ray in a box of chunks.
fn clip(origin: DVec3, direction: DVec3, reach: f64, chunks: Region, cells: f64) -> Option<[f64; 2]> {
    let [min, max] = [chunks.min, chunks.max].map(|end| DVec3::from_array(end.map(f64::from)) * cells);
    let (mut enters, mut leaves) = (0.0f64, reach);
    for axis in 0..3 {
        let [a, b] = [min[axis], max[axis]].map(|plane| (plane - origin[axis]) / direction[axis]);
        if direction[axis] == 0.0 {
            if !(min[axis]..max[axis]).contains(&origin[axis]) {
                return None;
            }
            continue;
        }
        (enters, leaves) = (enters.max(a.min(b)), leaves.min(a.max(b)));
    }
    (enters <= leaves).then_some([enters, leaves])
}

/// The first triangle that a ray hits, and its distance (Tomas Möller and Ben Trumbore, "Fast, Minimum Storage
/// Ray/Triangle Intersection", 1997).
fn first_triangle(mesh: &MeshBuffer, origin: DVec3, direction: DVec3, reach: f64) -> Option<(f64, usize)> {
    let hit = |triangle: usize| {
        let [a, b, c] = corners(mesh, triangle);
        let (ab, ac) = (b - a, c - a);
        let across = direction.cross(ac);
        let determinant = ab.dot(across);
        let from = origin - a;
        let u = from.dot(across) / determinant;
        let side = from.cross(ab);
        let v = direction.dot(side) / determinant;
        let distance = ac.dot(side) / determinant;
        // A little beyond the sides, so that rays do not slip through between two triangles.
        let slack = 1e-9;
        let is_hit = u >= -slack && v >= -slack && u + v <= 1.0 + slack && (0.0..=reach).contains(&distance);
        is_hit.then_some((distance, triangle))
    };
    (0..mesh.triangle_count()).filter_map(hit).min_by(|(a, _), (b, _)| a.total_cmp(b))
}

/// The unit normal of a triangle, and the material at its corner nearest to a point.
fn surface_at(mesh: &MeshBuffer, triangle: usize, point: DVec3) -> (DVec3, u8) {
    let corners = corners(mesh, triangle);
    let [a, b, c] = corners;
    let distance = |corner: usize| corners[corner].distance_squared(point);
    let nearest = (0..3).min_by(|a, b| distance(*a).total_cmp(&distance(*b))).unwrap_or(0);
    let vertex = mesh.indices[3 * triangle + nearest] as usize;
    ((b - a).cross(c - a).normalize_or_zero(), mesh.materials.get(vertex).copied().unwrap_or(0))
}

fn corners(mesh: &MeshBuffer, triangle: usize) -> [DVec3; 3] {
    [0, 1, 2]
        .map(|corner| DVec3::from_array(mesh.positions[mesh.indices[3 * triangle + corner] as usize].map(f64::from)))
}
