//! A cheap test of which terrains a ray may hit: a few products per terrain.

use bevy_math::{DAffine3, DVec3, IVec3, Ray3d};

use crate::placement::PlacementItem;
use crate::terrain::TerrainVolume;

/// True if a ray may hit a terrain. Never false for a terrain that it hits; true for endless ones, whose boxes are
/// huge.
pub(super) fn may_hit(volume: &TerrainVolume, place: &PlacementItem, ray: Ray3d, max_distance: f32) -> bool {
    let Some(settings) = volume.settings() else { return false };
    let Some(planes) = volume.shown().planes() else { return true };
    let voxel_size = f64::from(settings.voxel_size);
    let corners = [planes.min, planes.max].map(|corner| IVec3::from(corner).as_dvec3() * voxel_size);
    may_hit_box(ray, max_distance, &place.to_world(), corners)
}

/// True if a ray comes near the bounding sphere of a box, given by its lowest and its highest corner.
///
/// The sphere is computed in world space, so the terrain's transform need not be inverted. Its centre is the box's
/// centre, its radius reaches the farthest corner. If a number is not finite, either result is correct: nothing is hit.
fn may_hit_box(ray: Ray3d, max_distance: f32, to_world: &DAffine3, [min, max]: [DVec3; 2]) -> bool {
    let matrix = to_world.matrix3;
    let (middle, half) = (matrix * ((min + max) * 0.5), (max - min) * 0.5);
    let [x, y, z] = [matrix.x_axis * half.x, matrix.y_axis * half.y, matrix.z_axis * half.z];
    // Four of the eight corners; the opposite ones are equally far from the centre.
    let corners = [x + y + z, x + y - z, x - y + z, x - y - z];
    let radius = corners.into_iter().map(DVec3::length_squared).fold(0.0, f64::max);

    let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let way = to_world.translation + middle - origin;
    let along = (way.dot(direction) / direction.length_squared()).max(0.0).min(f64::from(max_distance));
    let apart = (way - direction * along).length_squared();
    // These margins far exceed rounding errors: a millionth of the distances from the origin, and a share of the
    // radius.
    let distances = to_world.translation.length_squared() + middle.length_squared() + origin.length_squared();
    apart <= 1.001 * radius + 1e-12 * distances
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy_math::{DMat3, Dir3, Vec3};

    const BOX: [DVec3; 2] = [DVec3::splat(-1.0), DVec3::splat(1.0)];

    fn may_hit(origin: Vec3, direction: Dir3, max_distance: f32, to_world: DAffine3) -> bool {
        may_hit_box(Ray3d::new(origin, direction), max_distance, &to_world, BOX)
    }

    #[test]
    fn rays_that_pass_end_before_or_look_away_are_told() {
        let at = DAffine3::from_translation(DVec3::new(100.0, 0.0, 0.0));
        assert!(may_hit(Vec3::ZERO, Dir3::X, f32::INFINITY, at));
        assert!(may_hit(Vec3::ZERO, Dir3::X, 99.0, at));
        assert!(!may_hit(Vec3::ZERO, Dir3::X, 98.0, at), "too short");
        assert!(!may_hit(Vec3::ZERO, Dir3::NEG_X, f32::INFINITY, at), "behind");
        assert!(!may_hit(Vec3::ZERO, Dir3::new(Vec3::new(1.0, 0.02, 0.0)).unwrap(), 1000.0, at), "beside");
        assert!(may_hit(Vec3::new(100.0, 0.5, 0.0), Dir3::Y, 0.0, at), "within");
    }

    #[test]
    fn the_sphere_reaches_to_the_farthest_corner_of_a_sheared_box() {
        let matrix = DMat3::from_cols(DVec3::X, DVec3::new(3.0, 1.0, 0.0), DVec3::new(0.0, 0.0, -2.0));
        let corner = (matrix * DVec3::ONE).as_vec3();
        let sheared = DAffine3::from_mat3(matrix);
        // Straight at the corner, from the side.
        let beside = corner.normalize().any_orthonormal_vector();
        assert!(may_hit(corner + beside * 10.0, Dir3::new(-beside).unwrap(), 10.0, sheared));
        assert!(!may_hit(corner * 1.01 + beside * 10.0, Dir3::new(-beside).unwrap(), 20.0, sheared));
    }

    #[test]
    fn lengths_that_are_none_do_no_harm() {
        assert!(!may_hit(Vec3::new(-9.0, 0.0, 0.0), Dir3::X, -1.0, DAffine3::IDENTITY));
        // It must not panic; the ray cast itself refuses it.
        may_hit(Vec3::new(-9.0, 0.0, 0.0), Dir3::X, f32::NAN, DAffine3::IDENTITY);
    }
}
