//! An edit during a running task is not lost, and a stale result never overwrites a newer one.

use crate::common::*;
use bevy_marchless::prelude::*;
use bevy_math::Vec3;

/// A source that waits behind the gate while it samples.
fn gated_ground(gate: &Gate) -> Terrain {
    let gate = gate.clone();
    small(Terrain::new(move |[x, y, z]: [f64; 3]| {
        if [x, y, z] == [0.0; 3] {
            gate.pass();
        }
        y - 16.5
    }))
}

#[test]
fn an_edit_while_a_chunk_is_being_filled_is_not_lost() {
    let mut app = app();
    let gate = Gate::default();
    let terrain = app.world_mut().spawn(gated_ground(&gate)).id();
    update_until(&mut app, |_| gate.reached() == 1);
    assert!(!volume(&app, terrain).is_filled());
    app.world_mut().write_message(Stamp::add(terrain, BrushShape::sphere(Vec3::splat(16.0), 5.0), 2));
    app.world_mut().write_message(Stamp::dig(terrain, BrushShape::sphere(Vec3::splat(14.0), 5.0)));
    app.update();
    gate.open();
    settle(&mut app, terrain);
    assert_drawn(&mut app, terrain);

    let mut other = crate::common::app();
    let late = settled(&mut other, ground());
    other.world_mut().write_message(Stamp::add(late, BrushShape::sphere(Vec3::splat(16.0), 5.0), 2));
    other.world_mut().write_message(Stamp::dig(late, BrushShape::sphere(Vec3::splat(14.0), 5.0)));
    other.update();
    for point in volume(&app, terrain).grid().planes().unwrap().points() {
        let (early, late) = (volume(&app, terrain).grid().get(point), volume(&other, late).grid().get(point));
        assert_eq!(early, late, "at {point:?}");
    }
}

#[test]
fn edits_while_a_group_is_being_meshed_show_after_it() {
    // One job per update, so that a group of eight takes eight updates.
    let mut app = app_with_budget(1);
    app.world_mut().resource_mut::<MarchlessSettings>().max_inline_chunks = 0;
    let terrain = settled(&mut app, ground());
    app.world_mut().write_message(Stamp::dig(terrain, BrushShape::sphere(Vec3::splat(16.0), 6.0)));
    for _ in 0..4 {
        app.update();
    }
    let before = geometry(&mut app, terrain);
    app.world_mut().write_message(Stamp::add(terrain, BrushShape::sphere(Vec3::splat(17.0), 4.0), 1));
    let mut versions = vec![before];
    for _ in 0..40 {
        app.update();
        let now = geometry(&mut app, terrain);
        if now != *versions.last().unwrap() {
            versions.push(now);
        }
    }
    assert_eq!(versions.len(), 3, "the first group, then the second, each at once");
    assert!(volume(&app, terrain).is_settled());
    assert_drawn(&mut app, terrain);
}

#[test]
fn samples_of_a_former_source_are_dropped() {
    let mut app = app();
    let gate = Gate::default();
    let terrain = app.world_mut().spawn(gated_ground(&gate)).id();
    update_until(&mut app, |_| gate.reached() == 1);
    app.world_mut().get_mut::<Terrain>(terrain).unwrap().set_source(|[_, y, _]: [f64; 3]| 8.5 - y);
    app.update();
    gate.open();
    settle(&mut app, terrain);
    assert!(volume(&app, terrain).grid().get([5, 5, 5]).weight > 0, "the new source is air there");
    assert!(volume(&app, terrain).grid().get([5, 20, 5]).weight < 0);
    assert_drawn(&mut app, terrain);
}

#[test]
fn samples_of_a_removed_terrain_are_dropped() {
    for with_volume in [false, true] {
        let mut app = app();
        let gate = Gate::default();
        let terrain = app.world_mut().spawn(gated_ground(&gate)).id();
        update_until(&mut app, |_| gate.reached() == 1);
        let mut entity = app.world_mut().entity_mut(terrain);
        if with_volume {
            entity.remove::<(Terrain, TerrainVolume)>();
        } else {
            entity.remove::<Terrain>();
        }
        // The first chunk stops at a gate again, so that its former result arrives while the new one is pending.
        let second = Gate::default();
        entity.insert(gated_ground(&second).with_chunk_cells(8));
        app.update();
        gate.open();
        update_until(&mut app, |_| second.reached() == 1);
        for _ in 0..50 {
            app.update();
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        assert!(volume(&app, terrain).grid().chunk([0; 3]).is_none(), "nobody has sampled it yet");
        second.open();
        settle(&mut app, terrain);
        assert_drawn(&mut app, terrain);
    }
}
