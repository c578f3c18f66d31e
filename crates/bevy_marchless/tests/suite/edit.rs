//! A stamp changes only the chunks it touches, and all of them in the update that read it.

use crate::common::*;
use bevy_app::App;
use bevy_ecs::prelude::*;
use bevy_marchless::prelude::*;
use bevy_marchless::stats::TerrainStats;
use bevy_math::{IVec3, Vec3};
use std::sync::Arc;

/// Applies a stamp, updates once, and returns the positions of the chunks whose geometry changed.
fn changed_by(app: &mut App, stamp: Stamp) -> Vec<IVec3> {
    let before = geometry(app, stamp.terrain);
    app.world_mut().write_message(stamp);
    app.update();
    let after = geometry(app, stamp.terrain);
    let both = before.iter().zip(&after);
    both.filter(|((_, old), (_, new))| !Arc::ptr_eq(old, new)).map(|((position, _), _)| *position).collect()
}

#[test]
fn a_stamp_within_a_chunk_changes_only_that_one() {
    let mut app = app();
    let terrain = settled(&mut app, ground());
    let stamp = Stamp::dig(terrain, BrushShape::sphere(Vec3::new(24.0, 22.0, 24.0), 2.0));
    assert_eq!(changed_by(&mut app, stamp), [], "there is nothing but air");
    let stamp = Stamp::add(terrain, BrushShape::sphere(Vec3::new(25.0, 24.0, 24.0), 2.0), 3);
    assert_eq!(changed_by(&mut app, stamp), [IVec3::new(1, 1, 1)]);
    assert_drawn(&mut app, terrain);
}

#[test]
fn a_stamp_at_a_corner_of_chunks_changes_all_of_them_at_once() {
    let mut app = app();
    let terrain = settled(&mut app, ground());
    let stamp = Stamp::dig(terrain, BrushShape::sphere(Vec3::new(16.0, 16.0, 16.0), 4.0));
    assert_eq!(changed_by(&mut app, stamp).len(), 8);
    assert_drawn(&mut app, terrain);
    assert!(volume(&app, terrain).is_settled());
}

#[test]
fn what_changes_out_of_sight_is_shown_without_meshing() {
    let mut app = app();
    let terrain = settled(&mut app, ground());
    let meshed = |app: &App| app.world().resource::<TerrainStats>().meshed;
    let before = meshed(&app);
    let ball = |y: f32, radius: f32| BrushShape::sphere(Vec3::new(14.0, y, 14.0), radius);
    assert_eq!(changed_by(&mut app, Stamp::paint(terrain, ball(7.0, 3.0), 4)), [], "deep below ground");
    assert_eq!(meshed(&app), before);
    assert!(volume(&app, terrain).is_settled());
    assert_eq!(volume(&app, terrain).shown().get([14, 7, 14]).material, 4);
    // An edit out of sight, in the same update, does not take drawn chunks off the screen.
    app.world_mut().write_message(Stamp::dig(terrain, ball(16.0, 5.0)));
    changed_by(&mut app, Stamp::paint(terrain, ball(4.0, 2.0), 5));
    assert!(meshed(&app) > before);
    assert_drawn(&mut app, terrain);
    assert!(!changed_by(&mut app, Stamp::dig(terrain, ball(10.0, 5.0))).is_empty());
    assert_drawn(&mut app, terrain);
}

#[test]
fn a_group_too_large_for_the_update_changes_in_one_later_update() {
    let mut app = app();
    app.insert_resource(MarchlessSettings { max_inline_chunks: 3, ..MarchlessSettings::default() });
    let terrain = settled(&mut app, ground());
    let before = geometry(&mut app, terrain);
    let stamp = Stamp::dig(terrain, BrushShape::sphere(Vec3::splat(16.0), 6.0));
    app.world_mut().write_message(stamp);
    for update in 0.. {
        assert!(update < 2_000);
        app.update();
        let now = geometry(&mut app, terrain);
        let changed = before.iter().zip(&now).filter(|((_, old), (_, new))| !Arc::ptr_eq(old, new)).count();
        if changed > 0 {
            assert_eq!(changed, 8, "all at once");
            assert!(update > 0, "in tasks");
            break;
        }
        std::thread::sleep(core::time::Duration::from_micros(100));
    }
    assert_drawn(&mut app, terrain);
}

#[test]
fn edits_are_reported_by_region_and_material() {
    #[derive(Resource, Default)]
    struct Reports(Vec<TerrainEdited>);
    let mut app = app();
    app.init_resource::<Reports>();
    let read = |mut messages: MessageReader<TerrainEdited>, mut reports: ResMut<Reports>| {
        reports.0.extend(messages.read().cloned());
    };
    app.add_systems(bevy_app::Last, read);
    let terrain = settled(&mut app, ground());
    let shape = BrushShape::cuboid(Vec3::new(24.0, 24.0, 24.0), Vec3::splat(1.5));
    app.world_mut().write_message(Stamp::add(terrain, shape, 5));
    app.world_mut().write_message(Stamp::dig(terrain, shape));
    app.update();
    app.update();
    let reports = &app.world().resource::<Reports>().0;
    let [report] = &reports[..] else { panic!("one report for both: {reports:?}") };
    assert_eq!((report.terrain, report.added.get(&5), report.removed.get(&5)), (terrain, Some(&27), Some(&27)));
    assert!(report.min.cmple(IVec3::splat(23)).all() && report.max.cmpge(IVec3::splat(26)).all(), "{report:?}");
    assert_drawn(&mut app, terrain);
}
