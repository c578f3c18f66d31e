//! Two apps in one process, a server's and a client's, do not affect each other: the same stamps give the same terrain.

use crate::common::*;
use bevy_ecs::prelude::*;
use bevy_marchless::prelude::*;
use bevy_math::Vec3;

#[test]
fn a_server_and_a_client() {
    // One without meshes, one with.
    let (mut server, mut client) = (bare_app(), app());
    let on_server = server.world_mut().spawn(ball()).id();
    let on_client = client.world_mut().spawn(ball()).id();
    let stamp = |terrain: Entity, step: u32| {
        Stamp::dig(terrain, BrushShape::sphere(Vec3::new(4.0 + step as f32, 16.0, 16.0), 4.0))
    };
    for step in 0..12 {
        server.world_mut().write_message(stamp(on_server, step));
        server.update();
        client.world_mut().write_message(stamp(on_client, step));
        client.update();
    }
    settle(&mut server, on_server);
    settle(&mut client, on_client);
    let expected = expected_geometry(&server, on_server);
    assert!(expected == expected_geometry(&client, on_client));
    assert_drawn(&mut client, on_client);
    let on_server = geometry(&mut server, on_server);
    assert!(on_server == geometry(&mut client, on_client));

    // One app continues after the other has ended.
    drop(server);
    let other = settled(&mut client, ground());
    assert_drawn(&mut client, other);
}
