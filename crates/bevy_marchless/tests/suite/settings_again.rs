//! Settings change again before their change is drawn: the terrain settles with the newest settings.

use std::time::Duration;

use crate::common::*;
use bevy_app::App;
use bevy_color::Color;
use bevy_ecs::prelude::*;
use bevy_marchless::prelude::*;
use bevy_math::{IVec3, UVec3, Vec3};
use proptest::prelude::*;

/// Waves of 8 × 2 × 8 chunks, about as high as the border between both layers of chunks.
fn waves(height: f64) -> Terrain {
    let source = move |[x, y, z]: [f64; 3]| y - height - 2.0 * (x * 0.2).sin() * (z * 0.15).cos();
    Terrain::new(source).with_extent(UVec3::new(8, 2, 8)).with_chunk_cells(8)
}

/// A palette of one colour, different for each number.
fn palette(number: u32) -> Palette {
    Palette::new([Color::srgb(0.25, 0.5, 1.0 / (2.0 + number as f32))])
}

fn change(app: &mut App, terrain: Entity, change: impl FnOnce(&mut Terrain)) {
    change(&mut app.world_mut().get_mut::<Terrain>(terrain).expect("a terrain"));
}

/// An app without threads and with hardly any main-thread budget: each update does little, and always the same.
fn slow_app() -> App {
    let mut app = app_with_budget(8);
    app.world_mut().resource_mut::<MarchlessSettings>().streaming_budget = Duration::ZERO;
    app
}

#[test]
fn another_palette_while_a_new_source_fills_the_terrain() {
    for updates in [0, 1, 5, 12] {
        let mut app = slow_app();
        let terrain = settled(&mut app, waves(8.0));
        let source = waves(9.5).source;
        change(&mut app, terrain, |terrain| terrain.source = source);
        (0..updates).for_each(|_| app.update());
        change(&mut app, terrain, |terrain| terrain.palette = palette(1));
        settle(&mut app, terrain);
        assert_as_new(&mut app, terrain, &[]);
    }
}

#[test]
fn another_isovalue_while_a_new_source_fills_the_terrain() {
    for updates in [0, 1, 5, 12] {
        let mut app = slow_app();
        let terrain = settled(&mut app, waves(8.0));
        let source = waves(9.5).source;
        change(&mut app, terrain, |terrain| terrain.source = source);
        (0..updates).for_each(|_| app.update());
        change(&mut app, terrain, |terrain| (terrain.isovalue, terrain.normals) = (1.25, false));
        settle(&mut app, terrain);
        assert_as_new(&mut app, terrain, &[]);
    }
}

#[test]
fn a_dig_while_a_new_source_fills_the_terrain() {
    for max_inline_chunks in [0, 8] {
        for updates in [1, 5, 12] {
            let mut app = slow_app();
            app.world_mut().resource_mut::<MarchlessSettings>().max_inline_chunks = max_inline_chunks;
            let terrain = settled(&mut app, waves(8.0));
            let source = waves(9.5).source;
            change(&mut app, terrain, |terrain| terrain.source = source);
            (0..updates).for_each(|_| app.update());
            let dig = Stamp::dig(terrain, BrushShape::sphere(Vec3::new(33.0, 9.0, 24.0), 5.0));
            app.world_mut().write_message(dig);
            app.update();
            settle(&mut app, terrain);
            assert_as_new(&mut app, terrain, &[dig]);
        }
    }
}

/// The highest vertex of each chunk, in voxels of the terrain.
fn heights(app: &mut App, terrain: Entity) -> Vec<(IVec3, f32)> {
    let highest = |position: IVec3, mesh: &marchless::MeshBuffer| {
        let heights = mesh.positions.iter().map(|[_, y, _]| y + 16.0 * position.y as f32);
        heights.fold(f32::NEG_INFINITY, f32::max)
    };
    geometry(app, terrain).into_iter().map(|(position, mesh)| (position, highest(position, &mesh))).collect()
}

#[test]
fn what_a_slider_asks_for_shows_while_it_is_dragged() {
    // The highest vertex of each chunk shows which plane it was meshed from.
    let plane = |step: u32| move |[_, y, _]: [f64; 3]| y - (3.0 + 0.03 * f64::from(step));
    for every in [1, 2, 5] {
        let mut app = app_with_budget(4);
        let terrain = Terrain::new(plane(0)).with_extent(UVec3::new(4, 1, 4)).with_chunk_cells(16);
        let terrain = settled(&mut app, terrain);
        let (mut before, mut shown) = (heights(&mut app, terrain), 0);
        for update in 0..300 {
            if update % every == 0 {
                change(&mut app, terrain, |terrain| terrain.set_source(plane(update + 1)));
            }
            app.update();
            let now = heights(&mut app, terrain);
            assert_eq!(now.len(), before.len(), "update {update}: chunks came or went");
            for ((position, before), (_, now)) in before.iter().zip(&now) {
                assert!(
                    now >= before,
                    "update {update}: the chunk at {position} shows an older source: {now}, {before}"
                );
            }
            shown += u32::from(now != before);
            before = now;
        }
        assert!(shown >= 30, "a source every {every} updates: only {shown} updates of 300 showed anything new");
        settle(&mut app, terrain);
        assert_as_new(&mut app, terrain, &[]);
    }
}

#[test]
fn each_kind_of_setting_may_change_in_every_update() {
    let changes: [(&str, fn(&mut Terrain, u32)); 7] = [
        ("palette", |terrain, step| terrain.palette = palette(step)),
        ("isovalue", |terrain, step| terrain.isovalue = 0.03 * step as f32 - 0.6),
        ("normals", |terrain, step| terrain.normals = step.is_multiple_of(2)),
        ("voxel size", |terrain, step| terrain.voxel_size = 1.0 + 0.01 * step as f32),
        ("chunk cells", |terrain, step| terrain.chunk_cells = 8 + step % 3),
        ("extent", |terrain, step| terrain.extent = UVec3::new(4 + step % 3, 2, 4).into()),
        ("source", |terrain, step| terrain.source = waves(6.0 + 0.1 * f64::from(step)).source),
    ];
    for (name, by) in changes {
        println!("{name}");
        let mut app = slow_app();
        let terrain = settled(&mut app, waves(8.0));
        for step in 0..41 {
            change(&mut app, terrain, |terrain| by(terrain, step));
            app.update();
        }
        settle(&mut app, terrain);
        assert_as_new(&mut app, terrain, &[]);
    }
}

/// A change of settings, or a stamp.
#[derive(Clone, Debug)]
enum Change {
    Palette,
    Isovalue(f32),
    Normals(bool),
    Extent(UVec3),
    /// The others fill the terrain again, with a voxel size that it has not had yet.
    VoxelSize,
    Cells(u32),
    Source(f64),
    Stamp {
        at: Vec3,
        radius: f32,
        digs: bool,
    },
}

fn changes() -> impl Strategy<Value = Change> {
    let side = || 1u32..4;
    prop_oneof![
        2 => Just(Change::Palette),
        2 => (-1.5f32..1.5).prop_map(Change::Isovalue),
        1 => any::<bool>().prop_map(Change::Normals),
        1 => Just(Change::VoxelSize),
        1 => (8u32..12).prop_map(Change::Cells),
        1 => (side(), side()).prop_map(|(x, z)| Change::Extent(UVec3::new(x, 2, z))),
        2 => (5.0..12.0).prop_map(Change::Source),
        // All stamps touch the first chunk, and some cross the border of the extent.
        4 => (0.0f32..9.0, 5.0f32..12.0, 0.0f32..9.0, 1.0f32..9.0, any::<bool>())
            .prop_map(|(x, y, z, radius, digs)| Change::Stamp { at: Vec3::new(x, y, z), radius, digs }),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, max_shrink_iters: 30, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_mix_of_changes_settles_to_the_newest(
        changes in prop::collection::vec((changes(), 0u32..4), 1..24),
        budget in 1usize..6,
        max_inline_chunks in prop_oneof![Just(0), Just(3), Just(8)],
        streaming_budget in prop_oneof![Just(Duration::ZERO), Just(Duration::from_secs(1))],
    ) {
        let mut app = app();
        app.insert_resource(MarchlessSettings { max_jobs_per_update: Some(budget), max_inline_chunks, streaming_budget, ..Default::default() });
        let terrain = settled(&mut app, waves(8.0).with_extent(UVec3::new(3, 2, 3)));
        let mut stamps = Vec::new();
        for (number, (change, updates)) in changes.into_iter().enumerate() {
            if let Change::Stamp { at, radius, digs } = change {
                let shape = BrushShape::sphere(at, radius);
                let stamp = if digs { Stamp::dig(terrain, shape) } else { Stamp::add(terrain, shape, 1) };
                app.world_mut().write_message(stamp);
                let isovalue = app.world().get::<Terrain>(terrain).expect("a terrain").isovalue;
                stamps.push(core_stamp(&stamp, isovalue));
            } else {
                // Stamps of the same update would come after the change.
                app.update();
                let mut settings = app.world_mut().get_mut::<Terrain>(terrain).expect("a terrain");
                let mut refill = true;
                match change {
                    Change::Cells(cells) => settings.chunk_cells = cells,
                    Change::Extent(extent) => (settings.extent, refill) = (extent.into(), false),
                    Change::Source(height) => settings.source = waves(height).source,
                    Change::VoxelSize => {}
                    Change::Palette => (settings.palette, refill) = (palette(number as u32), false),
                    Change::Isovalue(isovalue) => (settings.isovalue, refill) = (isovalue, false),
                    Change::Normals(normals) => (settings.normals, refill) = (normals, false),
                    Change::Stamp { .. } => unreachable!("done above"),
                }
                if refill {
                    settings.voxel_size = 1.0 + number as f32 / 64.0;
                    stamps.clear();
                }
            }
            (0..updates).for_each(|_| app.update());
        }
        settle(&mut app, terrain);
        assert_as_new_after(&mut app, terrain, &stamps);
    }
}
