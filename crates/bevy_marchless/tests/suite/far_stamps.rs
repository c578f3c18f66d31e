//! Stamps far from the origin have the same effect as at the origin.

use bevy_ecs::entity::Entity;
use bevy_marchless::prelude::*;
use bevy_math::{DVec3, IVec3, Vec3};
use marchless::{Grid, Region};

/// Ten million voxels, in whole chunks; an `f32` there has steps of a voxel.
const FAR: IVec3 = IVec3::new(10_000_000, -10_000_000, 10_000_000);

/// Every shape and operation, at positions between the lattice's points.
fn stamps(terrain: Entity, offset: DVec3) -> [Stamp; 4] {
    let place = DVec3::new(0.25, -0.375, 0.5) + offset;
    [
        Stamp::add(terrain, BrushShape::sphere(place, 9.3), 3),
        Stamp::dig(terrain, BrushShape::capsule(place, place + DVec3::new(4.125, 7.0, -2.75), 2.6)),
        Stamp::add(terrain, BrushShape::cuboid(place - DVec3::splat(5.625), Vec3::new(1.25, 3.5, 2.0)), 7),
        Stamp::paint(terrain, BrushShape::sphere(place + DVec3::Y * 0.875, 3.1), 9),
    ]
}

#[test]
fn a_stamp_ten_million_voxels_away_changes_the_same_samples() {
    let samples = |offset: IVec3| {
        let mut grid = Grid::<i16>::new(16).expect("chunks of 16 cells");
        for stamp in stamps(Entity::PLACEHOLDER, offset.as_dvec3()) {
            grid.apply(&stamp.quantised().expect("all numbers within their ranges"));
        }
        let points = Region::new([-20; 3], [20; 3]).points();
        points.map(|point| grid.get((IVec3::from(point) + offset).to_array())).collect::<Vec<_>>()
    };
    let near = samples(IVec3::ZERO);
    assert!(near.iter().any(|voxel| voxel.weight < 0 && voxel.material == 9), "something was added and painted");
    assert!(samples(FAR) == near);
}

#[test]
fn positions_of_single_precision_go_on_working() {
    let place = Vec3::new(1.5, 2.25, -3.0);
    assert_eq!(BrushShape::sphere(place, 2.0), BrushShape::sphere(place.as_dvec3(), 2.0));
    assert_eq!(BrushShape::cuboid(place, Vec3::ONE), BrushShape::cuboid(place.as_dvec3(), Vec3::ONE));
    assert_eq!(BrushShape::capsule(place, Vec3::X, 2.0), BrushShape::capsule(place.as_dvec3(), DVec3::X, 2.0));
}
