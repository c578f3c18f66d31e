//! Brushes, reports and queries use the surface that is drawn, at any isovalue.

use crate::common::*;
use bevy_app::App;
use bevy_ecs::prelude::*;
use bevy_ecs::system::RunSystemOnce as _;
use bevy_marchless::prelude::*;
use bevy_math::{DVec3, Vec3};

/// The height at which the surface of the flat ground is drawn.
const HEIGHT: f64 = 14.5;
const ISOVALUES: [f32; 4] = [0.0, 2.0, -2.25, 0.7];

fn ground_at(app: &mut App, isovalue: f32) -> Entity {
    let source = move |[_, y, _]: [f64; 3]| y - HEIGHT + f64::from(isovalue);
    settled(app, small(Terrain::new(source)).with_isovalue(isovalue))
}

fn apply(app: &mut App, stamp: Stamp) -> Vec<TerrainEdited> {
    app.world_mut().write_message(stamp);
    app.update();
    app.world().resource::<Messages<TerrainEdited>>().iter_current_update_messages().cloned().collect()
}

/// The points of a ball that are solid and drawn: above the lowest plane and below the surface.
fn points_in_ball(center: DVec3, radius: f64) -> u64 {
    let points = marchless::Region::new([1; 3], [32; 3]).points().map(|point| DVec3::from(point.map(f64::from)));
    points.filter(|point| point.y < HEIGHT && point.distance(center) < radius).count() as u64
}

#[test]
fn a_dig_takes_what_lies_in_it_below_the_drawn_surface() {
    for isovalue in ISOVALUES {
        let mut app = app();
        let terrain = ground_at(&mut app, isovalue);
        // Off the lattice, so that no point lies on the ball.
        for center in [DVec3::new(15.3, HEIGHT + 2.0, 15.2), DVec3::new(15.3, 9.4, 15.2)] {
            let before = points_in_ball(center, 3.0);
            let edits = apply(&mut app, Stamp::dig(terrain, BrushShape::sphere(center, 3.0)));
            assert_eq!(edits.len(), 1);
            let removed: u64 = edits[0].removed.values().sum();
            assert!(before > 5 && removed == before && edits[0].added.is_empty(), "{isovalue}: {removed}, {before}");
            assert_drawn(&mut app, terrain);
        }
        let above = Vec3::new(15.3, 30.0, 15.2);
        let hit = cast(&mut app, above, above - 30.0 * Vec3::Y, 100.0).expect("the hole's ground");
        assert!((hit.lattice.y - (HEIGHT - 1.0)).abs() < 0.1, "the floor of the upper hole, not {}", hit.lattice.y);
    }
}

#[test]
fn paint_and_additions_reach_the_drawn_surface() {
    for isovalue in ISOVALUES {
        let mut app = app();
        let terrain = ground_at(&mut app, isovalue);
        let above = Vec3::new(15.3, 30.0, 15.2);
        apply(&mut app, Stamp::paint(terrain, BrushShape::sphere(DVec3::new(15.3, HEIGHT, 15.2), 3.0), 5));
        let hit = cast(&mut app, above, above - 30.0 * Vec3::Y, 100.0).expect("the ground");
        assert_eq!((hit.material, (hit.lattice.y - HEIGHT).abs() < 0.01), (5, true), "isovalue {isovalue}");
        let edits = apply(&mut app, Stamp::add(terrain, BrushShape::sphere(hit.lattice, 4.0), 7));
        assert!(edits[0].removed.is_empty() && edits[0].added.keys().eq([&7]), "{edits:?}");
        let hit = cast(&mut app, above, above - 30.0 * Vec3::Y, 100.0).expect("the hill");
        assert_eq!((hit.material, (hit.lattice.y - HEIGHT - 4.0).abs() < 0.1), (7, true), "isovalue {isovalue}");
        assert_drawn(&mut app, terrain);
    }
}

#[test]
fn weights_are_distances_from_the_drawn_surface() {
    for isovalue in ISOVALUES {
        let mut app = app();
        let terrain = ground_at(&mut app, isovalue);
        let weight = move |terrains: TerrainQuery| {
            [10.0, 14.5, 20.0].map(|y| terrains.weight_at(terrain, Vec3::new(15.0, y, 15.0)).expect("it is filled"))
        };
        let found = app.world_mut().run_system_once(weight).expect("a system");
        for (found, expected) in found.into_iter().zip([-4.5, 0.0, 5.5]) {
            assert!((found - expected).abs() < 0.01, "isovalue {isovalue}: {found}");
        }
    }
}
