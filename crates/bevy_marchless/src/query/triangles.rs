//! Rays against the triangles of one mesh.

use bevy_math::DVec3;
use marchless::MeshBuffer;

/// A ray in the space of a mesh.
#[derive(Clone, Copy)]
pub(super) struct MeshRay {
    pub(super) origin: DVec3,
    /// Of length 1.
    pub(super) direction: DVec3,
    /// The greatest distance from the origin.
    pub(super) reach: f64,
}

/// Where a ray hits a mesh first.
pub(super) struct MeshHit {
    pub(super) distance: f64,
    /// The unit normal of the triangle.
    pub(super) normal: DVec3,
    /// The material at the nearest corner of the triangle.
    pub(super) material: u8,
}

impl MeshRay {
    /// The distances at which the ray enters and leaves a box; `None` where it passes.
    pub(super) fn clip(&self, min: DVec3, max: DVec3) -> Option<[f64; 2]> {
        let (mut enters, mut leaves) = (0.0f64, self.reach);
        for axis in 0..3 {
            let [a, b] = [min[axis], max[axis]].map(|plane| (plane - self.origin[axis]) / self.direction[axis]);
            if self.direction[axis] == 0.0 {
                if !(min[axis]..=max[axis]).contains(&self.origin[axis]) {
                    return None;
                }
                continue;
            }
            (enters, leaves) = (enters.max(a.min(b)), leaves.min(a.max(b)));
        }
        (enters <= leaves).then_some([enters, leaves])
    }

    /// The first triangle that the ray hits, from either side.
    pub(super) fn cast(&self, mesh: &MeshBuffer) -> Option<MeshHit> {
        let (distance, triangle) = self.first_triangle(mesh)?;
        let corners = corners(mesh, triangle);
        let [a, b, c] = corners;
        let point = self.origin + self.direction * distance;
        let apart = |corner: usize| corners[corner].distance_squared(point);
        let nearest = (0..3).min_by(|a, b| apart(*a).total_cmp(&apart(*b))).unwrap_or(0);
        let vertex = mesh.indices[3 * triangle + nearest] as usize;
        let normal = (b - a).cross(c - a).normalize_or_zero();
        Some(MeshHit { distance, normal, material: mesh.materials.get(vertex).copied().unwrap_or(0) })
    }

    /// The first triangle that the ray hits, and its distance (Tomas Möller and Ben Trumbore, "Fast, Minimum Storage
    /// Ray/Triangle Intersection", 1997).
    fn first_triangle(&self, mesh: &MeshBuffer) -> Option<(f64, usize)> {
        let Self { origin, direction, reach } = *self;
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
}

fn corners(mesh: &MeshBuffer, triangle: usize) -> [DVec3; 3] {
    [0, 1, 2]
        .map(|corner| DVec3::from_array(mesh.positions[mesh.indices[3 * triangle + corner] as usize].map(f64::from)))
}
