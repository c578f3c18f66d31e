//! Edits outlive the samples around them: a hole is there when its chunk is loaded again.

use std::time::Duration;

use crate::common::stream::*;
use crate::common::*;
use bevy_app::App;
use bevy_ecs::message::{MessageCursor, Messages};
use bevy_marchless::prelude::*;
use bevy_marchless::stats::TerrainStats;
use bevy_marchless::stream::{Leaf, LeafState};
use bevy_math::{IVec3, Vec3};
use bevy_transform::components::Transform;

fn patient_app() -> App {
    let mut app = app_with_budget(16);
    app.world_mut().resource_mut::<MarchlessSettings>().streaming_budget = Duration::from_secs(5);
    app
}

fn flight() -> Flight {
    Flight::new(patient_app(), Terrain::endless(Hills::default()).with_chunk_cells(8), Transform::IDENTITY)
}

/// The edit reports since the last call.
fn reported(app: &App, cursor: &mut MessageCursor<TerrainEdited>) -> Vec<TerrainEdited> {
    cursor.read(app.world().resource::<Messages<TerrainEdited>>()).cloned().collect()
}

/// A place from which no viewer of these tests sees the origin.
const FAR: Vec3 = Vec3::new(40.0, 0.0, 0.0);

#[test]
fn a_hole_is_there_after_coming_back() {
    for sample_radius in [f32::INFINITY, 8.0, 0.0] {
        let mut flight = flight();
        let viewer = flight.viewers[0];
        flight.app.world_mut().get_mut::<TerrainViewer>(viewer).unwrap().sample_radius = sample_radius;
        flight.settle();
        let untouched = flight.drawn();
        flight.edit(Vec3::new(0.4, 0.0, 0.3), 0.7, BrushOperation::Dig);
        flight.edit(Vec3::new(0.9, 0.1, 0.3), 0.3, BrushOperation::Add);
        flight.settle_and_compare();
        let before = flight.drawn();
        assert_ne!(before, untouched, "it was dug");
        for _ in 0..3 {
            flight.place(viewer, FAR);
            flight.settle_and_compare();
            assert_eq!(volume(&flight.app, flight.terrain).leaf_at(IVec3::ZERO), None);
            flight.place(viewer, Vec3::ZERO);
            flight.settle_and_compare();
            assert_eq!(flight.drawn(), before);
        }
    }
}

#[test]
fn no_samples_of_what_was_dug_stay_where_nobody_is() {
    let mut flight = flight();
    let viewer = flight.viewers[0];
    flight.edit(Vec3::new(0.5, 0.0, 0.5), 0.25, BrushOperation::Dig);
    flight.settle();
    flight.place(viewer, FAR);
    flight.settle_and_compare();
    assert_eq!(samples_at_the_origin(&flight), 0);
    flight.place(viewer, Vec3::ZERO);
    flight.settle_and_compare();
}

#[test]
fn samples_that_many_stamps_have_changed_stay() {
    let mut flight = flight();
    let viewer = flight.viewers[0];
    flight.settle();
    for index in 0..80 {
        let operation = if index % 2 == 0 { BrushOperation::Dig } else { BrushOperation::Add };
        let at = Vec3::new(0.5, 0.1, 0.5) + 0.2 * Vec3::new((index as f32).sin(), 0.0, (index as f32).cos());
        flight.edit(at, 0.2 + 0.1 * (index % 4) as f32, operation);
    }
    flight.settle_and_compare();
    let before = flight.drawn();
    for _ in 0..2 {
        flight.place(viewer, FAR);
        flight.settle_and_compare();
        let kept = samples_at_the_origin(&flight);
        assert!((1..=flight.fresh.edited_chunks()).contains(&kept), "{kept} chunks");
        flight.place(viewer, Vec3::ZERO);
        flight.settle_and_compare();
        assert_eq!(flight.drawn(), before);
    }
}

/// The number of chunks near the origin.
fn samples_at_the_origin(flight: &Flight) -> usize {
    let is_near = |[x, _, z]: [i32; 3]| (-2..=2).contains(&x) && (-2..=2).contains(&z);
    volume(&flight.app, flight.terrain).grid().chunks().filter(|(position, _)| is_near(*position)).count()
}

#[test]
fn stamps_on_chunks_that_are_not_loaded_wait() {
    let mut flight = flight();
    flight.settle();
    let mut cursor = MessageCursor::default();
    assert_eq!(reported(&flight.app, &mut cursor), []);
    flight.edit(FAR, 0.8, BrushOperation::Dig);
    flight.edit(FAR + Vec3::X, 0.4, BrushOperation::Add);
    for _ in 0..10 {
        flight.update();
        assert_eq!(reported(&flight.app, &mut cursor), [], "nothing has changed yet");
    }
    assert!(volume(&flight.app, flight.terrain).is_settled(), "nobody waits for them");
    flight.place(flight.viewers[0], FAR);
    let mut edits = Vec::new();
    for _ in 0..500 {
        flight.update();
        edits.extend(reported(&flight.app, &mut cursor));
        if volume(&flight.app, flight.terrain).is_settled() {
            break;
        }
    }
    flight.settle_and_compare();
    let removed: u64 = edits.iter().flat_map(|edit| edit.removed.values()).sum();
    let added: u64 = edits.iter().flat_map(|edit| edit.added.values()).sum();
    assert!(edits.iter().all(|edit| edit.terrain == flight.terrain));
    assert!(removed > 500 && added > 10, "{removed} removed, {added} added");
    let viewer = flight.viewers[0];
    flight.place(viewer, Vec3::ZERO);
    flight.settle();
    flight.place(viewer, FAR);
    flight.settle_and_compare();
    assert_eq!(reported(&flight.app, &mut cursor), [], "they take effect once");
}

#[test]
fn many_stamps_on_one_chunk_that_is_not_loaded() {
    let mut flight = flight();
    flight.settle();
    for index in 0..200 {
        let at = FAR + Vec3::new((index as f32 * 0.37).sin(), 0.0, (index as f32 * 0.61).cos()) * 0.4 + 0.5;
        let operation = match index % 3 {
            0 => BrushOperation::Add,
            1 => BrushOperation::Dig,
            _ => BrushOperation::Paint,
        };
        flight.edit(at.with_y((index as f32).sin() * 0.3), 0.2 + 0.1 * (index % 4) as f32, operation);
        if index % 20 == 0 {
            flight.update();
        }
    }
    flight.update();
    for place in [FAR, Vec3::ZERO, FAR] {
        flight.place(flight.viewers[0], place);
        flight.settle_and_compare();
    }
}

#[test]
fn stamps_on_chunks_that_are_being_filled() {
    let gate = Gate::default();
    let source = {
        let gate = gate.clone();
        move |[x, y, z]: [f64; 3]| {
            if [x, y, z] == [0.0; 3] {
                gate.pass();
            }
            y - 2.5
        }
    };
    let mut flight = Flight::new(app(), Terrain::endless(source).with_chunk_cells(8), Transform::IDENTITY);
    for _ in 0..2_000 {
        flight.update();
        if gate.reached() > 0 {
            break;
        }
        std::thread::sleep(Duration::from_micros(500));
    }
    assert!(gate.reached() > 0);
    let mut cursor = MessageCursor::default();
    let terrain = flight.terrain;
    flight.stamp(Stamp::dig(terrain, BrushShape::sphere(Vec3::new(2.0, 2.0, 2.0), 5.0)));
    flight.update();
    flight.stamp(Stamp::add(terrain, BrushShape::sphere(Vec3::new(3.0, 4.0, 2.0), 3.0), 4));
    for _ in 0..20 {
        flight.update();
    }
    reported(&flight.app, &mut cursor);
    let solid =
        |flight: &Flight| flight.app.world().get::<TerrainVolume>(terrain).unwrap().grid().get([3, 4, 2]).weight < 0;
    assert!(!solid(&flight), "its chunk is still being filled");
    gate.open();
    flight.settle_and_compare();
    assert!(solid(&flight));
}

#[test]
fn an_edit_where_samples_were_dropped_shows_after_they_are_filled_again() {
    let mut flight = flight();
    let viewer = flight.viewers[0];
    flight.app.world_mut().get_mut::<TerrainViewer>(viewer).unwrap().sample_radius = 0.0;
    flight.settle_and_compare();
    let at = Vec3::new(1.6, 0.0, 0.4);
    let before = flight.drawn();
    flight.edit(at, 0.6, BrushOperation::Dig);
    flight.settle_and_compare();
    assert_ne!(flight.drawn(), before);
}

#[test]
fn an_edit_shows_in_the_update_that_reads_it_while_others_load() {
    let mut flight = flight();
    // Chunks this small: even a small stamp touches many.
    let mut settings = flight.app.world_mut().resource_mut::<MarchlessSettings>();
    (settings.max_jobs_per_update, settings.max_inline_chunks) = (Some(1), 27);
    let viewer = flight.viewers[0];
    let far = Vec3::new(20.0, 0.0, 0.0);
    flight.place(viewer, far);
    let here = IVec3::new(20, 0, 0);
    let around = || (0..27).map(|i| IVec3::new(i % 3, i / 3 % 3, i / 9) - 1 + here);
    for _ in 0..2_000 {
        flight.update();
        let volume = volume(&flight.app, flight.terrain);
        let state = |position| volume.leaf_at(position).map(|leaf: Leaf| leaf.state);
        if around().all(|position| !matches!(state(position), None | Some(LeafState::Waiting))) {
            break;
        }
    }
    let waiting = volume(&flight.app, flight.terrain).coverage().waiting;
    assert!(waiting > 0, "the farther ones come later");
    let before = flight.drawn();
    flight.edit((far + 0.5).with_y(0.0), 0.3, BrushOperation::Dig);
    flight.update();
    assert_ne!(flight.drawn(), before, "it shows at once");
    flight.settle_and_compare();
}

#[test]
fn going_to_and_fro_over_a_border_loads_nothing_twice() {
    for (margin, again) in [(1.0, false), (0.0, true)] {
        let mut flight = flight();
        let viewer = flight.viewers[0];
        flight.app.world_mut().get_mut::<TerrainViewer>(viewer).unwrap().margin = margin * 8.0;
        let to_and_fro = |flight: &mut Flight, times: u32| {
            for _ in 0..times {
                for step in [-3, -2, -1, 0, 1, 2, 3, 2, 1, 0, -1, -2, -3] {
                    flight.place(viewer, Vec3::new(step as f32 * 0.13, step as f32 * 0.05, 0.0));
                    flight.update();
                }
                flight.settle();
            }
        };
        to_and_fro(&mut flight, 1);
        let before = *flight.app.world().resource::<TerrainStats>();
        to_and_fro(&mut flight, 20);
        let after = *flight.app.world().resource::<TerrainStats>();
        let work = |stats: TerrainStats| (stats.loaded, stats.unloaded, stats.filled, stats.bounded, stats.meshed);
        if again {
            assert!(
                after.loaded > before.loaded && after.unloaded > before.unloaded,
                "without a margin it loads: {after:?}"
            );
        } else {
            assert_eq!(work(after), work(before));
        }
        flight.settle_and_compare();
    }
}
