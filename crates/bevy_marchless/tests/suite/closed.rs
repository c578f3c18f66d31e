//! The union of a terrain's drawn chunks is closed, and their borders are equal bit for bit.

use crate::common::*;
use bevy_marchless::prelude::*;
use bevy_math::Vec3;

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

#[test]
fn chunks_share_positions_and_normals_on_their_borders() {
    let mut app = app();
    let terrain = settled(&mut app, ball());
    app.world_mut().write_message(Stamp::dig(terrain, BrushShape::sphere(Vec3::new(15.0, 20.0, 9.0), 6.0)));
    settle(&mut app, terrain);
    let mut normals = std::collections::HashMap::new();
    let mut shared = 0;
    for (chunk, mesh) in geometry(&mut app, terrain) {
        for (position, normal) in mesh.positions.iter().zip(&mesh.normals) {
            let position = (Vec3::from(*position) + (chunk * 16).as_vec3()).to_array().map(f32::to_bits);
            let normal = normal.map(f32::to_bits);
            shared += usize::from(normals.contains_key(&position));
            assert_eq!(*normals.entry(position).or_insert(normal), normal);
        }
    }
    assert!(shared > 200, "only {shared} vertices are shared");
}
