//! Observers run when chunks are spawned, when their mesh changes, and when they are despawned.

use crate::common::*;
use bevy_app::App;
use bevy_camera::primitives::Aabb;
use bevy_color::Color;
use bevy_ecs::prelude::*;
use bevy_marchless::prelude::*;
use bevy_math::Vec3;
use bevy_transform::components::Transform;

/// The number of chunks spawned, of geometries inserted, and of chunks despawned.
#[derive(Resource, Default, Clone, Copy, Debug, PartialEq)]
struct Seen {
    come: usize,
    shown: usize,
    gone: usize,
}

fn app_with_observers() -> App {
    let mut app = app_with_budget(2);
    app.init_resource::<Seen>()
        .add_observer(
            |added: On<Add, Chunk>, chunks: Query<(&ChunkGeometry, &Transform, &Aabb)>, mut seen: ResMut<Seen>| {
                assert!(chunks.get(added.entity).is_ok_and(|(geometry, ..)| !geometry.mesh.is_empty()));
                seen.come += 1;
            },
        )
        .add_observer(|shown: On<Insert, ChunkGeometry>, chunks: Query<&Chunk>, mut seen: ResMut<Seen>| {
            seen.shown += usize::from(chunks.contains(shown.entity));
        })
        .add_observer(|_: On<Remove, Chunk>, mut seen: ResMut<Seen>| seen.gone += 1);
    app
}

fn seen(app: &App) -> Seen {
    *app.world().resource::<Seen>()
}

#[test]
fn they_see_chunks_come_change_and_go() {
    let mut app = app_with_observers();
    let terrain = settled(&mut app, ball());
    assert_eq!(seen(&app), Seen { come: 8, shown: 8, gone: 0 });

    app.world_mut().write_message(Stamp::dig(terrain, BrushShape::sphere(Vec3::splat(7.0), 4.0)));
    app.update();
    settle(&mut app, terrain);
    assert_eq!(seen(&app), Seen { come: 8, shown: 9, gone: 0 }, "one chunk has changed");

    app.world_mut().get_mut::<Terrain>(terrain).unwrap().palette = Palette::new([Color::BLACK]);
    app.update();
    settle(&mut app, terrain);
    assert_eq!(seen(&app), Seen { come: 8, shown: 9, gone: 0 }, "colours are no geometry");

    app.world_mut().get_mut::<Terrain>(terrain).unwrap().isovalue = 1.0;
    app.update();
    settle(&mut app, terrain);
    assert_eq!(seen(&app), Seen { come: 8, shown: 17, gone: 0 });

    app.world_mut().despawn(terrain);
    assert_eq!(seen(&app).gone, 8);
}
