//! A spawned terrain gets meshes.

use crate::common::*;
use bevy_asset::Assets;
use bevy_camera::primitives::Aabb;
use bevy_ecs::prelude::*;
use bevy_marchless::mesh::ATTRIBUTE_MATERIAL;
use bevy_marchless::prelude::*;
use bevy_marchless::stream::Coverage;
use bevy_mesh::{Mesh, Mesh3d};
use bevy_transform::components::{GlobalTransform, Transform};

#[test]
fn a_spawned_terrain_gets_meshes() {
    let mut app = app();
    let terrain = settled(&mut app, ball());
    assert_drawn(&mut app, terrain);
    assert_eq!(geometry(&mut app, terrain).iter().filter(|(_, mesh)| !mesh.is_empty()).count(), 8);
    assert_eq!(mesh_assets(&app), 8);

    let mut chunks = app.world_mut().query::<(&ChunkGeometry, &Mesh3d, &Aabb, &ChildOf)>();
    for (geometry, handle, bounds, parent) in chunks.iter(app.world()) {
        assert_eq!(parent.parent(), terrain);
        let mesh = app.world().resource::<Assets<Mesh>>().get(handle).expect("the asset is there");
        assert_eq!(mesh.count_vertices(), geometry.mesh.positions.len());
        for attribute in [Mesh::ATTRIBUTE_NORMAL, Mesh::ATTRIBUTE_COLOR, ATTRIBUTE_MATERIAL] {
            assert!(mesh.contains_attribute(attribute), "{}", attribute.name);
        }
        let [min, max] = geometry.mesh.bounds.expect("not empty");
        assert_eq!(*bounds, Aabb::from_min_max(min.into(), max.into()));
    }
}

#[test]
fn chunks_without_a_surface_have_no_entity() {
    let mut app = app();
    let terrain = settled(&mut app, small(Terrain::default()));
    assert_eq!(volume(&app, terrain).coverage(), Coverage { waiting: 0, empty: 8, drawn: 0 });
    assert_eq!(geometry(&mut app, terrain).len(), 0);
    assert_eq!(app.world_mut().query::<&Mesh3d>().iter(app.world()).count(), 0);
    assert_eq!(mesh_assets(&app), 0);
}

#[test]
fn chunks_lie_where_their_transforms_say() {
    let mut app = app();
    let moved = Transform::from_xyz(100.0, 0.0, 0.0);
    let terrain = app.world_mut().spawn((ball().with_voxel_size(0.5), moved)).id();
    settle(&mut app, terrain);
    let mut chunks = app.world_mut().query::<(&Chunk, &GlobalTransform)>();
    for (chunk, transform) in chunks.iter(app.world()) {
        assert_eq!(transform.translation(), moved.translation + chunk.position.as_vec3() * 8.0);
        assert_eq!(transform.scale(), bevy_math::Vec3::splat(0.5));
    }
}
