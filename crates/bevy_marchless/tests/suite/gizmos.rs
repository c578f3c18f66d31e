//! Gizmos of chunks: each drawn chunk's bounds, in the colour of its state or its level.

use std::any::TypeId;

use bevy_app::App;
use bevy_asset::Assets;
use bevy_color::{Color, LinearRgba};
use bevy_gizmos::{GizmoAsset, GizmoHandles, GizmoPlugin};
use bevy_marchless::gizmos::{ChunkBoundsGizmos, ChunkColors};
use bevy_marchless::prelude::*;
use bevy_math::{IVec3, Vec3};
use bevy_transform::components::Transform;

use crate::common::stream::Hills;
use crate::common::*;

const CELLS: u32 = 8;
/// How far inside a chunk its bounds are drawn. [Units: voxels of its level]
const INSET: f32 = 0.25;

/// A box that is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Bounds {
    color: LinearRgba,
    min: Vec3,
    max: Vec3,
}

/// An app with hills at four levels of detail.
fn hills() -> App {
    let mut app = app();
    app.add_plugins(GizmoPlugin);
    app.finish();
    app.cleanup();
    let extent = Extent { min: IVec3::new(-16, -6, -16), max: IVec3::new(16, 6, 16) };
    let levels = TerrainLevels { falloff: 2.0, ..4.into() };
    app.world_mut().spawn((TerrainViewer::new(300.0), Transform::from_xyz(-60.0, 10.0, 20.0)));
    let terrain = Terrain::new(Hills::default()).with_extent(extent).with_chunk_cells(CELLS).with_levels(levels);
    settled(&mut app, terrain);
    app
}

/// The boxes that the latest update has drawn.
fn boxes(app: &App) -> Vec<Bounds> {
    let handles = app.world().resource::<GizmoHandles>().handles();
    let Some(handle) = handles.get(&TypeId::of::<ChunkBoundsGizmos>()).expect("a group of gizmos") else {
        return Vec::new();
    };
    let asset = app.world().resource::<Assets<GizmoAsset>>().get(handle).expect("the lines that are drawn");
    let lines = asset.buffer();
    // Bevy draws three edges of a box as a list, among their ends its lowest and its highest corner.
    let ends = lines.list_positions.chunks_exact(6).zip(lines.list_colors.chunks_exact(6));
    ends.map(|(ends, colors)| Bounds {
        color: colors[0],
        min: ends.iter().copied().reduce(Vec3::min).expect("six ends"),
        max: ends.iter().copied().reduce(Vec3::max).expect("six ends"),
    })
    .collect()
}

/// The bounds of all chunks with a mesh, each with its level.
fn drawn(app: &mut App) -> Vec<(u8, [Vec3; 2])> {
    let mut chunks = app.world_mut().query::<(&Chunk, &ChunkGeometry)>();
    let drawn = chunks.iter(app.world()).filter(|(_, geometry)| !geometry.mesh.is_empty());
    drawn
        .map(|(chunk, _)| {
            let [voxel, cells] = [(1 << chunk.level) as f32, CELLS as f32];
            let corner = chunk.position.as_vec3() * cells * voxel;
            (chunk.level, [INSET, cells - INSET].map(|v| corner + v * voxel))
        })
        .collect()
}

/// Asserts that every chunk with a mesh is drawn once, in the colour of its level; returns the other boxes.
fn assert_colored(app: &mut App, color: impl Fn(u8) -> Color) -> Vec<Bounds> {
    let mut boxes = boxes(app);
    for (level, [min, max]) in drawn(app) {
        let bounds = Bounds { color: color(level).to_linear(), min, max };
        let index = boxes.iter().position(|found| *found == bounds);
        boxes.swap_remove(index.unwrap_or_else(|| panic!("a chunk of level {level} without {bounds:?}")));
    }
    boxes
}

#[test]
fn nothing_is_drawn_by_default() {
    let mut app = hills();
    app.insert_resource(ChunkColors::Levels);
    app.update();
    assert_eq!(boxes(&app), []);
}

#[test]
fn colours_tell_states() {
    let mut app = hills();
    app.insert_resource(ShowChunkBounds(true));
    app.update();
    let colors = ChunkBoundsGizmos::default();
    let others = assert_colored(&mut app, |_| colors.drawn);
    let count = |color: Color| others.iter().filter(|found| found.color == color.to_linear()).count();
    assert!(count(colors.empty) > 0);
    assert_eq!((count(colors.waiting), count(colors.terrain)), (0, 1));
    assert_eq!(others.len(), count(colors.empty) + 1);
}

#[test]
fn colours_tell_levels() {
    let mut app = hills();
    app.insert_resource(ShowChunkBounds(true)).insert_resource(ChunkColors::Levels);
    app.update();
    for level in 0..4 {
        assert!(drawn(&mut app).iter().any(|(found, _)| *found == level), "no chunk of level {level} is drawn");
    }
    let colors = ChunkBoundsGizmos::default();
    let others = assert_colored(&mut app, |level| colors.levels[usize::from(level)]);
    // Chunks without a mesh are not shown.
    assert_eq!(others.iter().map(|found| found.color).collect::<Vec<_>>(), [colors.terrain.to_linear()]);
}
