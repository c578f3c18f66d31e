//! A stroke of 60 updates shows in each of them, and gives the same samples for any division into stamps.

use crate::common::*;
use bevy_ecs::prelude::*;
use bevy_marchless::prelude::*;
use bevy_math::Vec3;
use std::time::Duration;

fn part(terrain: Entity, start_ms: u64, end_ms: u64) -> Stamp {
    let (start, end) = (Duration::from_millis(start_ms), Duration::from_millis(end_ms));
    let stroke = Stroke { id: 1, rate: 2.0, falloff: 3.0, start, end };
    Stamp::dig(terrain, BrushShape::sphere(Vec3::new(16.0, 16.0, 16.0), 6.0)).with_stroke(stroke)
}

#[test]
fn a_stroke_shows_in_every_update() {
    let mut app = app();
    let terrain = settled(&mut app, ground());
    for step in 0..60 {
        let before = geometry(&mut app, terrain);
        app.world_mut().write_message(part(terrain, step * 16, (step + 1) * 16));
        app.update();
        assert_ne!(geometry(&mut app, terrain), before, "update {step}");
        assert!(volume(&app, terrain).is_settled());
    }
    assert_drawn(&mut app, terrain);

    let mut other = crate::common::app();
    let at_once = settled(&mut other, ground());
    other.world_mut().write_message(part(at_once, 0, 960));
    other.update();
    assert_eq!(geometry(&mut other, at_once), geometry(&mut app, terrain));
}

#[test]
fn a_stroke_too_large_for_one_update_makes_progress_while_it_lasts() {
    let mut app = app_with_budget(3);
    app.world_mut().resource_mut::<MarchlessSettings>().max_inline_chunks = 0;
    let terrain = settled(&mut app, ground());
    let mut shown = 0;
    for step in 0..60 {
        let before = geometry(&mut app, terrain);
        app.world_mut().write_message(part(terrain, step * 16, (step + 1) * 16));
        app.update();
        if geometry(&mut app, terrain) != before {
            shown += 1;
            let report = report(&mut app, terrain);
            assert!(report.is_closed(), "a crack: {report}");
        }
    }
    assert!(shown >= 10, "shown only {shown} times");
    // One group is being meshed and one waits: eight chunks each, three per update.
    for _ in 0..8 {
        app.update();
    }
    assert!(volume(&app, terrain).is_settled(), "the stroke has left a queue behind");
    assert_drawn(&mut app, terrain);
}
