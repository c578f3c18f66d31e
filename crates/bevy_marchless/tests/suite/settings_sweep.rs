//! Settings that only change how samples look do not delay digs: colours and normals sweep over the chunks, an isovalue
//! is shown in one update when all chunks are meshed for it.

use std::sync::Arc;

use crate::common::*;
use bevy_app::App;
use bevy_color::Color;
use bevy_ecs::prelude::*;
use bevy_marchless::prelude::*;
use bevy_math::{IVec3, UVec3, Vec3};
use marchless::MeshBuffer;

/// Waves of 6 × 2 × 6 chunks, about as high as the border between both layers of chunks.
fn waves() -> Terrain {
    let source = |[x, y, z]: [f64; 3]| y - 16.3 - 2.0 * (x * 0.2).sin() * (z * 0.15).cos();
    Terrain::new(source).with_extent(UVec3::new(6, 2, 6)).with_chunk_cells(16)
}

fn change(app: &mut App, terrain: Entity, change: impl FnOnce(&mut Terrain)) {
    change(&mut app.world_mut().get_mut::<Terrain>(terrain).expect("a terrain"));
}

fn black() -> Palette {
    Palette::new([Color::BLACK])
}

/// A small dig, which touches at most eight chunks.
fn dig(terrain: Entity, x: f32, z: f32) -> Stamp {
    Stamp::dig(terrain, BrushShape::sphere(Vec3::new(x, 16.0, z), 2.5))
}

/// The places of digs: at corners of chunks, far apart and close together.
const PLACES: [(f32, f32); 3] = [(16.0, 16.0), (48.0, 32.0), (48.0, 36.0)];

/// The meshes of the newest samples at an isovalue, without normals.
fn surface(app: &App, terrain: Entity, isovalue: f32) -> Vec<(IVec3, MeshBuffer)> {
    let grid = volume(app, terrain).grid();
    let settings = marchless::MeshSettings { isovalue, normals: false, ..Default::default() };
    let mut mesher = marchless::Mesher::new();
    let mesh = |position| {
        let mut mesh = MeshBuffer::new();
        grid.mesh_chunk(position, &mut mesher, settings, &mut mesh).expect("samples of a chunk");
        (IVec3::from(position), mesh)
    };
    grid.bounds().expect("bounded").points().map(mesh).filter(|(_, mesh)| !mesh.is_empty()).collect()
}

/// The drawn meshes, without normals.
fn drawn(app: &mut App, terrain: Entity) -> Vec<(IVec3, MeshBuffer)> {
    let without_normals = |mesh: &MeshBuffer| MeshBuffer { normals: Vec::new(), ..mesh.clone() };
    let mut drawn = geometry(app, terrain);
    drawn.retain(|(_, mesh)| !mesh.is_empty());
    drawn.into_iter().map(|(position, mesh)| (position, without_normals(&mesh))).collect()
}

/// Asserts that the drawn meshes are those of the newest samples at this isovalue, with any colours and normals.
fn assert_surface(app: &mut App, terrain: Entity, isovalue: f32) {
    let (mut expected, mut drawn) = (surface(app, terrain, isovalue), drawn(app, terrain));
    expected.sort_by_key(|(position, _)| position.to_array());
    drawn.sort_by_key(|(position, _)| position.to_array());
    assert!(drawn == expected, "isovalue {isovalue}: what is drawn is not what the samples ask for");
}

#[test]
fn a_dig_shows_in_its_update_while_nothing_else_changes() {
    let mut app = app_with_budget(2);
    let terrain = settled(&mut app, waves());
    for (x, z) in PLACES {
        app.world_mut().write_message(dig(terrain, x, z));
        app.update();
        assert_surface(&mut app, terrain, 0.0);
    }
    assert_drawn(&mut app, terrain);
}

#[test]
fn another_palette_leaves_the_geometry() {
    let mut app = app_with_budget(4);
    let terrain = settled(&mut app, waves());
    assert_coloured(&mut app, terrain);
    let before = geometry(&mut app, terrain);
    change(&mut app, terrain, |terrain| terrain.palette = black());
    for _ in 0..200 {
        app.update();
    }
    assert!(volume(&app, terrain).is_settled());
    assert_coloured(&mut app, terrain);
    let after = geometry(&mut app, terrain);
    assert_eq!(before.len(), after.len());
    for ((position, before), (_, after)) in before.iter().zip(&after) {
        assert!(Arc::ptr_eq(before, after), "the chunk at {position} was meshed again");
    }
    assert_eq!(mesh_assets(&app), after.iter().filter(|(_, mesh)| !mesh.is_empty()).count());
}

#[test]
fn a_dig_shows_in_its_update_while_a_palette_sweeps() {
    for updates in [0, 1, 3] {
        let mut app = app_with_budget(2);
        let terrain = settled(&mut app, waves());
        change(&mut app, terrain, |terrain| terrain.palette = black());
        (0..updates).for_each(|_| app.update());
        for (x, z) in PLACES {
            app.world_mut().write_message(dig(terrain, x, z));
            app.update();
            assert_drawn(&mut app, terrain);
        }
        settle(&mut app, terrain);
        assert_drawn(&mut app, terrain);
        assert_coloured(&mut app, terrain);
    }
}

#[test]
fn a_dig_shows_in_its_update_while_a_colour_is_dragged() {
    let mut app = app_with_budget(2);
    let terrain = settled(&mut app, waves());
    for step in 0..30u8 {
        let color = Color::srgb_u8(step, 100, 50);
        change(&mut app, terrain, |terrain| terrain.palette = Palette::new([color]));
        let at = 12.0 + 2.0 * f32::from(step);
        app.world_mut().write_message(dig(terrain, at, 92.0 - at));
        app.update();
        assert_drawn(&mut app, terrain);
    }
    settle(&mut app, terrain);
    assert_drawn(&mut app, terrain);
    assert_coloured(&mut app, terrain);
}

#[test]
fn a_dig_shows_in_its_update_while_normals_sweep() {
    for updates in [0, 1, 3] {
        let mut app = app_with_budget(2);
        let terrain = settled(&mut app, waves());
        change(&mut app, terrain, |terrain| terrain.normals = false);
        (0..updates).for_each(|_| app.update());
        for (x, z) in PLACES {
            app.world_mut().write_message(dig(terrain, x, z));
            app.update();
            assert_surface(&mut app, terrain, 0.0);
        }
        settle(&mut app, terrain);
        assert_drawn(&mut app, terrain);
        assert_coloured(&mut app, terrain);
    }
}

#[test]
fn an_isovalue_is_shown_in_one_update_and_digs_meanwhile_in_theirs() {
    let mut app = app_with_budget(2);
    let terrain = settled(&mut app, waves());
    change(&mut app, terrain, |terrain| terrain.isovalue = 1.25);
    let (mut digs, mut updates) = (0, 0);
    while volume(&app, terrain).shown_isovalue() == 0.0 {
        if updates % 4 == 1 && digs < 3 {
            app.world_mut().write_message(dig(terrain, 16.0 + 16.0 * digs as f32, 32.0));
            digs += 1;
        }
        app.update();
        updates += 1;
        assert!(updates < 500, "the isovalue never shows");
        let isovalue = volume(&app, terrain).shown_isovalue();
        assert!(isovalue == 0.0 || isovalue == 1.25, "{isovalue}");
        assert_surface(&mut app, terrain, isovalue);
    }
    assert_eq!(digs, 3, "digs came while it was meshed");
    settle(&mut app, terrain);
    assert_drawn(&mut app, terrain);
    assert_eq!(volume(&app, terrain).shown_isovalue(), 1.25);
}

#[test]
fn the_last_isovalue_of_many_is_shown() {
    let mut app = app_with_budget(2);
    let terrain = settled(&mut app, waves());
    for step in 1..=40u8 {
        change(&mut app, terrain, |terrain| terrain.isovalue = 0.05 * f32::from(step));
        if step % 10 == 0 {
            app.world_mut().write_message(dig(terrain, 2.0 * f32::from(step), 32.0));
        }
        app.update();
        let isovalue = volume(&app, terrain).shown_isovalue();
        assert_surface(&mut app, terrain, isovalue);
    }
    settle(&mut app, terrain);
    assert_drawn(&mut app, terrain);
    assert_eq!(volume(&app, terrain).shown_isovalue(), 2.0);
}
