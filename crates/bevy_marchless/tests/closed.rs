//! The union of all chunks drawn of a terrain is closed, its borders equal bit for bit.

mod common;

use bevy_marchless::prelude::*;
use bevy_math::Vec3;
use common::*;

#[test]
fn the_union_of_the_chunks_is_closed() {
    let mut app = app();
    let hills = |[x, y, z]: [f64; 3]| y - 14.0 - 5.0 * (x * 0.3).sin() * (z * 0.2).cos();
    let terrain = settled(&mut app, small(Terrain::new(hills)));
    let report_before = report(&mut app, terrain);
    assert!(report_before.is_closed(), "{report_before}");
    assert!(report_before.triangles > 1_000);

    let tunnel = BrushShape::capsule(Vec3::new(-4.0, 12.0, 9.0), Vec3::new(40.0, 15.0, 20.0), 4.0);
    app.world_mut().write_message(Stamp::dig(terrain, tunnel));
    settle(&mut app, terrain);
    let report_after = report(&mut app, terrain);
    assert!(report_after.is_closed(), "{report_after}");
    assert_ne!(report_after.triangles, report_before.triangles);
    assert_drawn(&mut app, terrain);
}
