//! Any number of digs far apart in one update all show in it, and each region is reported separately.

use std::collections::BTreeMap;

use crate::common::*;
use bevy_app::App;
use bevy_ecs::prelude::*;
use bevy_marchless::prelude::*;
use bevy_math::{IVec3, UVec3, Vec3};
use marchless::{Grid, Region};

/// Flat ground of `size` × 1 × `size` chunks of 8 voxels, its surface 4.5 voxels high.
fn ground_of(size: u32) -> Terrain {
    Terrain::new(|[_, y, _]: [f64; 3]| y - 4.5).with_extent(UVec3::new(size, 1, size)).with_chunk_cells(8)
}

/// Digs in a square, `apart` voxels from each other.
fn digs(terrain: Entity, count: u32, apart: f32) -> Vec<Stamp> {
    let side = count.isqrt().max(2);
    let at = |index: u32| Vec3::new((index % side) as f32 * apart + 4.25, 4.5, (index / side) as f32 * apart + 3.75);
    (0..count).map(|index| Stamp::dig(terrain, BrushShape::sphere(at(index), 2.0))).collect()
}

/// Writes stamps, updates once, and returns the reports, sorted by place.
fn apply(app: &mut App, stamps: &[Stamp]) -> Vec<TerrainEdited> {
    app.world_mut().write_message_batch(stamps.iter().copied());
    app.update();
    let messages = app.world().resource::<Messages<TerrainEdited>>();
    let mut edits: Vec<_> = messages.iter_current_update_messages().cloned().collect();
    edits.sort_by_key(|edit| (edit.terrain, edit.min.to_array()));
    edits
}

/// The report of a region: the box around all changed samples, and how many became air or solid.
fn expected(terrain: Entity, before: &Grid<i16>, after: &Grid<i16>, region: Region) -> TerrainEdited {
    let mut edit =
        TerrainEdited { terrain, min: IVec3::MAX, max: IVec3::MIN, added: BTreeMap::new(), removed: BTreeMap::new() };
    for point in region.points() {
        let (before, after) = (before.get(point), after.get(point));
        if before == after {
            continue;
        }
        edit.min = edit.min.min(point.into());
        edit.max = edit.max.max(IVec3::from(point) + 1);
        match (before.weight < 0, after.weight < 0) {
            (true, false) => *edit.removed.entry(before.material).or_default() += 1,
            (false, true) => *edit.added.entry(after.material).or_default() += 1,
            _ => {}
        }
    }
    edit
}

/// Asserts that each stamp's region is reported exactly, and nothing else.
fn assert_reported(before: &Grid<i16>, app: &App, stamps: &[Stamp], edits: &[TerrainEdited]) {
    let region = |stamp: &Stamp| stamp.quantised().expect("numbers in range").region();
    let after = |stamp: &Stamp| volume(app, stamp.terrain).grid();
    let mut wanted: Vec<_> =
        stamps.iter().map(|stamp| expected(stamp.terrain, before, after(stamp), region(stamp))).collect();
    wanted.sort_by_key(|edit| (edit.terrain, edit.min.to_array()));
    assert_eq!(edits.len(), wanted.len(), "as many regions as digs");
    assert_eq!(edits, wanted);
    assert!(edits.iter().all(|edit| edit.removed.values().sum::<u64>() > 10 && edit.added.is_empty()));
}

#[test]
fn digs_far_apart_show_in_their_update_and_are_reported_by_region() {
    for (count, size) in [(1, 4), (2, 8), (4, 8), (100, 30)] {
        let mut app = app();
        let terrain = settled(&mut app, ground_of(size));
        let before = volume(&app, terrain).grid().clone();
        let stamps = digs(terrain, count, 24.0);
        let edits = apply(&mut app, &stamps);
        assert_drawn(&mut app, terrain);
        assert!(volume(&app, terrain).is_settled(), "{count} digs");
        assert_reported(&before, &app, &stamps, &edits);
    }
}

#[test]
fn digs_at_corners_of_chunks_show_in_their_update() {
    let mut app = app();
    let ground = Terrain::new(|[_, y, _]: [f64; 3]| y - 8.5).with_extent(UVec3::new(16, 2, 16)).with_chunk_cells(8);
    let terrain = settled(&mut app, ground);
    let at = |x: u8, z: u8| Vec3::new(32.0 * f32::from(x) + 16.0, 8.0, 32.0 * f32::from(z) + 16.0);
    let dig = |at: Vec3| Stamp::dig(terrain, BrushShape::sphere(at, 3.0));
    let stamps: Vec<_> = (0..16).map(|index| dig(at(index % 4, index / 4))).collect();
    let before = volume(&app, terrain).grid().clone();
    let edits = apply(&mut app, &stamps);
    assert_drawn(&mut app, terrain);
    assert_reported(&before, &app, &stamps, &edits);
}

#[test]
fn digs_that_overlap_are_one_region() {
    let mut app = app();
    let terrain = settled(&mut app, ground_of(8));
    let dig = |x: f32| Stamp::dig(terrain, BrushShape::sphere(Vec3::new(x, 4.5, 12.0), 2.0));
    let [left, right] = [[dig(10.0), dig(12.5)], [dig(50.0), dig(52.0)]];
    let before = volume(&app, terrain).grid().clone();
    let edits = apply(&mut app, &[left[0], right[0], right[1], left[1]]);
    let both = |[a, b]: [Stamp; 2]| {
        let [a, b] = [a, b].map(|stamp| stamp.quantised().expect("numbers in range").region());
        expected(terrain, &before, volume(&app, terrain).grid(), a.union(&b))
    };
    assert_eq!(edits, [both(left), both(right)]);
    assert_drawn(&mut app, terrain);
}

#[test]
fn each_terrain_is_reported_by_itself() {
    let mut app = app();
    let terrains = [settled(&mut app, ground_of(8)), settled(&mut app, ground_of(8))];
    let before = volume(&app, terrains[0]).grid().clone();
    let stamps: Vec<_> = terrains.iter().flat_map(|terrain| digs(*terrain, 3, 24.0)).collect();
    let edits = apply(&mut app, &stamps);
    assert_reported(&before, &app, &stamps, &edits);
    for terrain in terrains {
        assert_drawn(&mut app, terrain);
    }
}

#[test]
fn a_large_dig_does_not_hold_up_a_small_one() {
    let mut app = app_with_budget(1);
    let terrain = settled(&mut app, ground_of(16));
    let large = Stamp::dig(terrain, BrushShape::sphere(Vec3::new(32.0, 4.0, 32.0), 20.0));
    let small = Stamp::dig(terrain, BrushShape::sphere(Vec3::new(116.0, 4.5, 116.0), 2.0));
    apply(&mut app, &[large, small]);
    let shown = |app: &App, point: [i32; 3]| volume(app, terrain).shown().get(point).weight;
    assert!(shown(&app, [116, 4, 116]) > 0, "the small one shows at once");
    assert!(shown(&app, [32, 3, 32]) < 0, "the large one takes some updates");
    settle(&mut app, terrain);
    assert_drawn(&mut app, terrain);
}
