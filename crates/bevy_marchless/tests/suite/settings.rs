//! Bad settings are refused with a sentence; changed settings take effect.

use crate::common::*;
use bevy_marchless::prelude::*;
use bevy_marchless::stream::Coverage;
use bevy_marchless::terrain::TerrainError;
use bevy_math::UVec3;

#[test]
fn bad_settings_are_refused_without_a_panic() {
    let mut app = app();
    for (bad, word) in [
        (ground().with_chunk_cells(0), "cells"),
        (ground().with_chunk_cells(63), "cells"),
        (ground().with_extent(UVec3::new(4, 0, 4)), "extent"),
        (ground().with_extent(UVec3::MAX), "extent"),
        (ground().with_voxel_size(f32::NAN), "voxel size"),
        (ground().with_voxel_size(0.0), "voxel size"),
        (ground().with_isovalue(f32::INFINITY), "isovalue"),
    ] {
        let terrain = app.world_mut().spawn(bad).id();
        app.world_mut().write_message(Stamp::dig(terrain, BrushShape::sphere(bevy_math::Vec3::ONE, 2.0)));
        app.update();
        let error = app.world().get::<TerrainError>(terrain).expect("an error on the entity").to_string();
        assert!(error.contains(word), "{error}");
        assert_eq!(geometry(&mut app, terrain).len(), 0);

        *app.world_mut().get_mut::<Terrain>(terrain).unwrap() = ground();
        settle(&mut app, terrain);
        assert!(app.world().get::<TerrainError>(terrain).is_none());
        assert_drawn(&mut app, terrain);
        app.world_mut().despawn(terrain);
    }
}

#[test]
fn a_bad_change_leaves_what_was() {
    let mut app = app();
    let terrain = settled(&mut app, ball());
    let before = geometry(&mut app, terrain);
    app.world_mut().get_mut::<Terrain>(terrain).unwrap().chunk_cells = 63;
    app.update();
    assert!(app.world().get::<TerrainError>(terrain).is_some());
    assert_eq!(geometry(&mut app, terrain), before);
    app.world_mut().write_message(Stamp::dig(terrain, BrushShape::sphere(bevy_math::Vec3::splat(16.0), 6.0)));
    app.update();
    assert!(volume(&app, terrain).grid().get([16; 3]).weight > 0, "edits go on");
}

#[test]
fn changed_settings_take_effect() {
    let mut app = app();
    let terrain = settled(&mut app, ball());
    app.world_mut().write_message(Stamp::dig(terrain, BrushShape::sphere(bevy_math::Vec3::splat(16.0), 6.0)));
    app.update();
    let change = |app: &mut bevy_app::App, change: fn(&mut Terrain)| {
        change(&mut app.world_mut().get_mut::<Terrain>(terrain).unwrap());
        settle(app, terrain);
        assert_drawn(app, terrain);
        assert!(report(app, terrain).is_closed());
    };
    change(&mut app, |terrain| terrain.isovalue = -1.0);
    assert!(volume(&app, terrain).grid().get([16; 3]).weight > 0, "what was dug stays");
    change(&mut app, |terrain| terrain.normals = false);
    assert!(geometry(&mut app, terrain).iter().all(|(_, mesh)| mesh.normals.is_empty()));
    change(&mut app, |terrain| terrain.palette = Palette::new([bevy_color::Color::BLACK]));
    change(&mut app, |terrain| terrain.voxel_size = 2.0);
    change(&mut app, |terrain| terrain.extent = UVec3::new(1, 3, 2).into());
    let Coverage { waiting, empty, drawn } = volume(&app, terrain).coverage();
    assert_eq!((waiting, empty + drawn), (0, 6));
    change(&mut app, |terrain| terrain.chunk_cells = 20);
    change(&mut app, Terrain::clear);
    assert!(geometry(&mut app, terrain).iter().all(|(_, mesh)| mesh.is_empty()));
    app.update();
    assert_eq!(mesh_assets(&app), 0);
}

#[test]
fn a_source_that_panics_leaves_air_and_the_app_running() {
    let mut app = app();
    let source = |[x, y, _]: [f64; 3]| {
        assert!(x < 16.0, "on purpose");
        y - 16.5
    };
    let terrain = settled(&mut app, small(Terrain::new(source)));
    assert!(volume(&app, terrain).grid().get([8, 8, 8]).weight < 0);
    assert!(volume(&app, terrain).grid().get([24, 8, 8]).weight > 0);
    assert!(report(&mut app, terrain).is_closed());
}

#[test]
fn without_its_component_a_terrain_is_gone() {
    let mut app = app();
    let terrain = settled(&mut app, ball());
    app.world_mut().entity_mut(terrain).remove::<Terrain>();
    app.update();
    assert_eq!(geometry(&mut app, terrain).len(), 0);
    app.world_mut().entity_mut(terrain).insert(ground());
    settle(&mut app, terrain);
    assert_drawn(&mut app, terrain);
}
