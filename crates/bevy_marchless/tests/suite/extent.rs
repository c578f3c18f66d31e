//! A change of the extent leaves everything inside the new one as it is, edits included.

use std::collections::HashMap;
use std::time::Duration;

use crate::common::*;
use bevy_app::App;
use bevy_ecs::prelude::*;
use bevy_marchless::prelude::*;
use bevy_marchless::stats::TerrainStats;
use bevy_math::{IVec3, UVec3, Vec3};

fn hills(size: UVec3) -> Terrain {
    Terrain::new(|[x, y, z]: [f64; 3]| y - 9.0 - 3.0 * (x * 0.2).sin() * (z * 0.15).cos())
        .with_extent(size)
        .with_chunk_cells(8)
}

fn resize(app: &mut App, terrain: Entity, extent: impl Into<Extent>) {
    app.world_mut().get_mut::<Terrain>(terrain).expect("a terrain").extent = extent.into();
}

fn entities(app: &mut App) -> HashMap<IVec3, Entity> {
    let mut chunks = app.world_mut().query::<(Entity, &Chunk)>();
    chunks.iter(app.world()).map(|(entity, chunk)| (chunk.position, entity)).collect()
}

fn dig(app: &mut App, terrain: Entity, at: Vec3, radius: f32) -> Stamp {
    let stamp = Stamp::dig(terrain, BrushShape::sphere(at, radius));
    app.world_mut().write_message(stamp);
    app.update();
    stamp
}

#[test]
fn a_layer_more_leaves_chunks_and_edits_as_they_are() {
    let mut app = app();
    let terrain = settled(&mut app, hills(UVec3::new(4, 2, 4)));
    // Stamps in the middle, and across the border that is about to move.
    let stamps = [
        dig(&mut app, terrain, Vec3::new(12.0, 9.0, 12.0), 4.0),
        dig(&mut app, terrain, Vec3::new(31.0, 9.0, 12.0), 5.0),
    ];
    settle(&mut app, terrain);
    let before = entities(&mut app);
    resize(&mut app, terrain, Extent::new(IVec3::new(-1, -1, -1), IVec3::new(5, 3, 5)));
    settle(&mut app, terrain);
    let after = entities(&mut app);
    assert!(after.len() > before.len() && before.iter().all(|(position, entity)| after[position] == *entity));
    assert_as_new(&mut app, terrain, &stamps);
}

#[test]
fn edits_come_back_with_their_chunks() {
    let mut app = app();
    let terrain = settled(&mut app, hills(UVec3::new(4, 2, 4)));
    let mut stamps = vec![dig(&mut app, terrain, Vec3::new(26.0, 9.0, 12.0), 4.0)];
    // Enough stamps that samples are kept instead.
    for step in 0u8..80 {
        stamps.push(dig(&mut app, terrain, Vec3::new(27.0, 9.0 - 0.05 * f32::from(step), 27.0), 3.0));
    }
    settle(&mut app, terrain);
    resize(&mut app, terrain, UVec3::new(3, 2, 3));
    settle(&mut app, terrain);
    assert_as_new(&mut app, terrain, &stamps);
    // A stamp across the border also counts beyond it; a stamp wholly beyond it does nothing.
    stamps.push(dig(&mut app, terrain, Vec3::new(23.0, 9.0, 27.0), 5.0));
    dig(&mut app, terrain, Vec3::new(200.0, 9.0, 12.0), 5.0);
    resize(&mut app, terrain, UVec3::new(5, 2, 4));
    settle(&mut app, terrain);
    assert_as_new(&mut app, terrain, &stamps);
}

#[test]
fn viewers_and_what_is_kept_follow_the_extent() {
    let mut app = app();
    let ends = Extent::new(IVec3::new(0, 0, 0), IVec3::new(4, 2, 4));
    let terrain = hills(UVec3::splat(4)).with_extent(ends).with_keep(Keep::Nothing);
    app.world_mut().spawn((TerrainViewer::new(40.0), bevy_transform::components::Transform::from_xyz(16.0, 9.0, 16.0)));
    let terrain = settled(&mut app, terrain);
    for extent in [Extent::ENDLESS, Extent::ENDLESS.with_y(0..2), ends, Extent::ENDLESS.with_x(-3..1)] {
        resize(&mut app, terrain, extent);
        settle(&mut app, terrain);
        let there = entities(&mut app);
        let is_within = |position: &IVec3| position.cmpge(extent.min).all() && position.cmplt(extent.max).all();
        assert!(there.len() > 8 && there.keys().all(is_within), "{extent:?}: {}", there.len());
        for (position, mesh) in geometry(&mut app, terrain) {
            let mut expected = marchless::MeshBuffer::new();
            let grid = volume(&app, terrain).grid();
            let settings = marchless::MeshSettings::default();
            grid.mesh_chunk(position.to_array(), &mut marchless::Mesher::new(), settings, &mut expected).unwrap();
            assert_eq!(*mesh, expected, "{extent:?}, {position}");
        }
    }
}

#[test]
fn many_chunks_are_passed_over_and_the_rest_is_budgeted() {
    let mut app = app();
    let terrain = settled(&mut app, hills(UVec3::new(48, 4, 48)));
    app.insert_resource(MarchlessSettings { streaming_budget: Duration::from_micros(600), ..Default::default() });
    let before = app.world().resource::<TerrainStats>().loaded;
    resize(&mut app, terrain, Extent::new(IVec3::new(-1, -1, -1), IVec3::new(49, 5, 49)));
    app.update();
    assert!(!volume(&app, terrain).is_settled());
    settle(&mut app, terrain);
    let loaded = app.world().resource::<TerrainStats>().loaded - before;
    assert_eq!(loaded, 50 * 6 * 50 - 48 * 4 * 48, "only what is new");
}

#[test]
fn a_viewer_that_is_nowhere_holds_nothing_up() {
    let mut app = app();
    let ends = Extent::new(IVec3::ZERO, IVec3::new(4, 2, 4));
    let viewer = (TerrainViewer::new(40.0), bevy_transform::components::Transform::from_xyz(16.0, 9.0, 16.0));
    let viewer = app.world_mut().spawn(viewer).id();
    let terrain = settled(&mut app, hills(UVec3::ONE).with_extent(ends).with_keep(Keep::Nothing));
    app.world_mut().get_mut::<TerrainViewer>(viewer).expect("it is there").radii = Vec3::ZERO;
    app.update();
    resize(&mut app, terrain, Extent::new(IVec3::new(-1, 0, 0), IVec3::new(6, 2, 5)));
    dig(&mut app, terrain, Vec3::new(1.0, 9.0, 12.0), 4.0);
    settle(&mut app, terrain);
    assert!(entities(&mut app).keys().any(|position| position.x == -1), "it sees what it saw, in the new extent");
    assert!(volume(&app, terrain).shown().get([1, 9, 12]).weight > 0);
}

#[test]
fn digs_at_a_wall_ask_for_nothing_beyond() {
    let mut app = app();
    let terrain = settled(&mut app, hills(UVec3::new(4, 2, 4)));
    let before = app.world().resource::<TerrainStats>().filled;
    for _ in 0..100 {
        dig(&mut app, terrain, Vec3::new(31.0, 4.0, 12.0), 3.0);
        assert!(volume(&app, terrain).is_filled());
    }
    settle(&mut app, terrain);
    assert_eq!(app.world().resource::<TerrainStats>().filled, before, "nothing is sampled");
}
