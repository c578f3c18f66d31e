//! Settings change the radius within which viewers keep samples: the terrain settles, and digs still show in their
//! update.

use std::time::Duration;

use crate::common::stream::Fresh;
use crate::common::*;
use bevy_app::App;
use bevy_color::Color;
use bevy_ecs::prelude::*;
use bevy_marchless::prelude::*;
use bevy_marchless::stream::LeafState;
use bevy_math::{IVec3, Vec3};
use bevy_transform::components::Transform;

/// An endless terrain, drawn, whose samples are dropped except near the origin.
fn far_seeing() -> (App, Entity) {
    let mut app = app_with_budget(16);
    let terrain = app.world_mut().spawn(world()).id();
    let viewer = TerrainViewer::new(48.0).with_margin(4.0).with_sample_radius(20.0);
    app.world_mut().spawn((viewer, Transform::default()));
    settle(&mut app, terrain);
    let far = IVec3::new(4, -1, 0);
    update_until(&mut app, |app| volume(app, terrain).grid().chunk(far.to_array()).is_none());
    settle(&mut app, terrain);
    assert!(volume(&app, terrain).leaf_at(far).is_some_and(|leaf| leaf.state == LeafState::Drawn));
    (app, terrain)
}

fn change(app: &mut App, terrain: Entity, change: impl FnOnce(&mut Terrain)) {
    change(&mut app.world_mut().get_mut::<Terrain>(terrain).expect("a terrain"));
}

/// Digs near the viewer, and returns whether that showed in the same update.
fn dig_shows(app: &mut App, terrain: Entity, at: Vec3) -> (Stamp, bool) {
    let shown = |app: &App| volume(app, terrain).shown().get(at.as_ivec3().to_array());
    assert!(shown(app).weight < 0, "solid at {at}");
    let before = geometry(app, terrain);
    let stamp = Stamp::dig(terrain, BrushShape::sphere(at, 2.5));
    app.world_mut().write_message(stamp);
    app.update();
    let shows = shown(app).weight > 0 && geometry(app, terrain) != before;
    (stamp, shows)
}

/// Asserts that every chunk is drawn as on a fresh terrain.
fn assert_as_fresh(app: &mut App, terrain: Entity, stamps: &[Stamp]) {
    let mut fresh = Fresh::new(app.world().get::<Terrain>(terrain).expect("a terrain"));
    for stamp in stamps {
        fresh.stamp(&stamp.quantised().expect("numbers in range"));
    }
    let drawn = geometry(app, terrain);
    assert!(drawn.len() > 100);
    for (position, mesh) in drawn {
        assert!(*mesh == fresh.mesh(position.to_array()), "the chunk at {position} is not as in a fresh world");
    }
    assert_coloured(app, terrain);
}

#[test]
fn a_dig_shows_in_its_update_after_another_palette() {
    let shares = [Duration::ZERO, MarchlessSettings::default().streaming_budget];
    for (updates, streaming_budget) in shares.into_iter().flat_map(|share| [0, 10].map(|updates| (updates, share))) {
        let (mut app, terrain) = far_seeing();
        app.world_mut().resource_mut::<MarchlessSettings>().streaming_budget = streaming_budget;
        let (first, shows) = dig_shows(&mut app, terrain, Vec3::new(4.0, -2.0, 4.0));
        assert!(shows, "before");
        settle(&mut app, terrain);
        change(&mut app, terrain, |terrain| terrain.palette = Palette::new([Color::BLACK]));
        (0..updates).for_each(|_| app.update());
        let (second, shows) = dig_shows(&mut app, terrain, Vec3::new(-6.0, -5.0, 1.0));
        assert!(shows, "{updates} updates after another palette");
        settle(&mut app, terrain);
        assert_as_fresh(&mut app, terrain, &[first, second]);
    }
}

#[test]
fn other_settings_take_effect_on_all_that_is_drawn() {
    let changes: [fn(&mut Terrain); 4] = [
        |terrain| terrain.isovalue = 1.25,
        |terrain| terrain.normals = false,
        |terrain| terrain.palette = Palette::new([Color::BLACK, Color::WHITE]),
        |terrain| terrain.set_source(|[x, y, z]: [f64; 3]| y - 5.0 * (x * 0.08).cos() * (z * 0.09).cos()),
    ];
    for by in changes {
        let (mut app, terrain) = far_seeing();
        change(&mut app, terrain, by);
        app.update();
        settle(&mut app, terrain);
        assert_as_fresh(&mut app, terrain, &[]);
    }
}
