//! The same stamps give the same samples wherever viewers are, even if only the source's close bound leaves a chunk to
//! sampling.

use crate::common::stream::Fresh;
use crate::common::*;
use bevy_app::App;
use bevy_ecs::prelude::*;
use bevy_marchless::prelude::*;
use bevy_marchless::source::prelude::*;
use bevy_math::{IVec3, Vec3};
use bevy_transform::components::Transform;
use std::time::Duration;

const CELLS: u32 = 16;

/// Flat ground, 4.5 voxels below the middle layers of chunks. Its bound is certain of regions above and below the
/// surface; its close bound leaves everything to sampling.
struct Plain;

const HEIGHT: f64 = -4.5;

impl Source for Plain {
    fn fill(&self, region: &SourceRegion, distances: &mut [f32], materials: &mut [u8]) {
        (|[_, y, _]: [f64; 3]| y - HEIGHT).fill(region, distances, materials);
    }

    fn bound(&self, region: &SourceRegion) -> Bound {
        let [_, size, _] = region.size;
        if region.position([0; 3])[1] >= HEIGHT {
            Bound::Outside
        } else if region.position([0, size.saturating_sub(1), 0])[1] < HEIGHT {
            Bound::Inside { material: 0 }
        } else {
            Bound::Mixed
        }
    }

    fn bound_closely(&self, _: &SourceRegion) -> Bound {
        Bound::Mixed
    }
}

/// 80 stamps within one chunk: whole ones and strokes of every operation, one per update if `slowly`.
fn stamps(terrain: Entity, chunk: IVec3) -> Vec<Stamp> {
    let corner = (chunk * CELLS as i32).as_vec3();
    let stamp = |step: u8| {
        let at = |factor: u8, range: u8| 4.0 + f32::from(step.wrapping_mul(factor) % range);
        let shape = BrushShape::sphere(corner + Vec3::new(at(37, 9), at(53, 9), at(71, 9)), 1.0 + at(11, 3) / 4.0);
        let stroke =
            |rate: f32| Stroke { id: 1, rate, falloff: 1.0, start: Duration::ZERO, end: Duration::from_secs(1) };
        match step % 5 {
            0 => Stamp::add(terrain, shape, step),
            1 => Stamp::dig(terrain, shape),
            2 => Stamp::add(terrain, shape, step).with_stroke(stroke(30.0)),
            3 => Stamp::dig(terrain, shape).with_stroke(stroke(25.5)),
            _ => Stamp::paint(terrain, shape, step),
        }
    };
    (0..80).map(stamp).collect()
}

/// The viewer's place while the stamps are applied.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Viewer {
    There,
    Arriving,
    Away,
}

const AWAY: Vec3 = Vec3::new(100_000.0, 0.0, 0.0);

/// Applies the stamps, some per update, and returns the app once the chunk is loaded for a viewer.
fn play(terrain: &Terrain, chunk: IVec3, stamped: Viewer, an_update: usize, sample_radius: f32) -> (App, Entity) {
    let mut app = app_with_budget(16);
    let terrain = app.world_mut().spawn(terrain.clone()).id();
    let there = ((chunk * CELLS as i32).as_vec3()) + CELLS as f32 / 2.0;
    let viewer = TerrainViewer::new(8.0).with_margin(0.0).with_sample_radius(sample_radius);
    let place = Transform::from_translation(if stamped == Viewer::There { there } else { AWAY });
    let viewer = app.world_mut().spawn((viewer, place)).id();
    app.update();
    settle(&mut app, terrain);
    if stamped == Viewer::Arriving {
        move_to(&mut app, viewer, there);
    }
    for some in stamps(terrain, chunk).chunks(an_update) {
        app.world_mut().write_message_batch(some.iter().copied());
        app.update();
    }
    for place in [there, AWAY, there] {
        move_to(&mut app, viewer, place);
        app.update();
        settle(&mut app, terrain);
        (0..20).for_each(|_| app.update());
    }
    settle(&mut app, terrain);
    (app, terrain)
}

/// Asserts that a chunk has the samples that the core alone computes, wherever viewers were.
fn assert_same_samples(terrain: &Terrain, chunk: IVec3) {
    let mut fresh = Fresh::new(terrain);
    for stamp in stamps(Entity::PLACEHOLDER, chunk) {
        fresh.stamp(&stamp.quantised().expect("numbers in range"));
    }
    let expected = fresh.chunk(chunk.to_array()).clone();
    for stamped in [Viewer::There, Viewer::Arriving, Viewer::Away] {
        for (an_update, sample_radius) in [(80, f32::INFINITY), (1, f32::INFINITY), (7, 0.0)] {
            let (app, terrain) = play(terrain, chunk, stamped, an_update, sample_radius);
            let found = volume(&app, terrain).grid().chunk(chunk.to_array()).expect("a viewer is there");
            let samples = 0..(CELLS as usize).pow(3);
            let differ = samples.filter(|index| found.voxel(*index) != expected.voxel(*index)).count();
            assert_eq!(differ, 0, "chunk {chunk}, {stamped:?}, {an_update} stamps an update, {sample_radius}");
        }
    }
}

#[test]
fn a_source_that_looks_closely_only_by_sampling() {
    let terrain = Terrain::endless(Plain).with_chunk_cells(CELLS);
    for chunk in [IVec3::new(1, 0, -2), IVec3::new(0, 3, 0), IVec3::new(2, -2, 1)] {
        assert_same_samples(&terrain, chunk);
    }
}

#[cfg(feature = "noise")]
#[test]
fn a_rough_landscape() {
    let noise = Fractal { zoom: 10.0, ..Fractal::default() };
    let solid = Solid::Ground(56.0 + Layer::noise(noise, 150.0));
    let landscape = Landscape::new(LandscapeSettings { solid, ..LandscapeSettings::default() }).expect("in range");
    let is_in_question = |chunk: &IVec3| {
        let min = (*chunk * CELLS as i32).to_array();
        let region = SourceRegion { min, size: [CELLS; 3], level: 0, spacing: 1.0 };
        landscape.bound(&region.grown(4)) != Bound::Mixed && landscape.bound_closely(&region) == Bound::Mixed
    };
    let chunks = marchless::Region::new([-4, -8, -4], [4, 16, 4]).points().map(IVec3::from);
    let chunks: Vec<_> = chunks.filter(is_in_question).collect();
    let terrain = Terrain::endless(landscape.clone()).with_chunk_cells(CELLS);
    assert!(chunks.len() > 8, "{} chunks of which only the quick bound is certain", chunks.len());
    for chunk in chunks.iter().step_by(chunks.len() / 3) {
        assert_same_samples(&terrain, *chunk);
    }
}
