//! [`TerrainQuery`]: ray casts, distances to the surface, and conversions between world and lattice.

mod bounds;
mod coarser;
mod dual;
mod transforms;
mod triangles;
mod visibility;

use bevy_app::{App, Plugin, PostUpdate};
use bevy_ecs::prelude::*;
use bevy_ecs::system::SystemParam;
use bevy_math::{DVec3, IVec3, Ray3d, Vec3};
use bevy_reflect::prelude::*;
use bevy_transform::TransformSystems;
use marchless::{MeshMethod, Region};

use crate::chunk::ChunkKey;
use crate::placement::{Placement, PlacementItem};
use crate::terrain::{TerrainVolume, give_to_terrains};
use triangles::{MeshHit, MeshRay};
use visibility::IsHidden;

/// Supports [`TerrainQuery`]: registers its types, records which terrains are hidden, and updates terrains'
/// `GlobalTransform` in apps without `TransformPlugin`.
#[derive(Default)]
pub struct QueryPlugin;

impl Plugin for QueryPlugin {
    fn build(&self, app: &mut App) {
        let keep_transforms = transforms::keep_transforms.run_if(transforms::may_lack_propagation);
        give_to_terrains::<IsHidden>(app);
        app.register_type::<TerrainHit>()
            .add_systems(PostUpdate, (keep_transforms, visibility::note_visibility).after(TransformSystems::Propagate));
    }
}

/// A system parameter with spatial queries about all terrains, in world space.
///
/// Queries use the transforms as last propagated. Rays hit the meshes that are drawn, not those of pending edits. There
/// is one exception: after a change of the extent, walls and chunks that are about to go may be drawn for some updates
/// and not be hit.
///
/// In an app that does not propagate transforms, such as one with only Bevy's `MinimalPlugins`, the plugin updates the
/// `GlobalTransform` of terrains itself, at the end of `PostUpdate`. It does so for no other entities.
///
/// ```
/// use bevy_marchless::prelude::*;
/// # use bevy_ecs::prelude::*;
/// # use bevy_math::{Dir3, Ray3d, Vec3};
///
/// fn dig_below(terrains: TerrainQuery, mut stamps: MessageWriter<Stamp>) {
///     let down = Ray3d::new(Vec3::new(50.0, 200.0, 50.0), Dir3::NEG_Y);
///     if let Some(hit) = terrains.ray_cast(down, 500.0) {
///         stamps.write(Stamp::dig(hit.terrain, BrushShape::sphere(hit.lattice, 4.0)));
///     }
/// }
/// ```
#[derive(SystemParam)]
pub struct TerrainQuery<'w, 's> {
    terrains: Query<'w, 's, (Entity, &'static TerrainVolume, Placement)>,
    hidden: Query<'w, 's, &'static IsHidden>,
}

/// The point where a ray hits a terrain.
#[derive(Reflect, Clone, Copy, Debug, PartialEq)]
#[reflect(Debug, PartialEq, Clone)]
pub struct TerrainHit {
    /// The terrain's entity.
    pub terrain: Entity,
    /// The entity of the chunk whose triangle was hit.
    pub chunk: Entity,
    /// The chunk's level of detail; 0 is the finest.
    pub level: u8,
    /// The position of the hit in world space.
    pub position: Vec3,
    /// The triangle's unit normal in world space, pointing outside.
    pub normal: Vec3,
    /// The position of the hit in the terrain's lattice, as stamps take it. [Units: voxels from the lowest corner]
    pub lattice: DVec3,
    /// The material at the nearest corner of the triangle.
    pub material: u8,
    /// The distance from the ray's origin. [Units: world]
    pub distance: f32,
}

impl TerrainQuery<'_, '_> {
    /// The first triangle of any [visible](Self::is_visible) terrain that a ray hits, from either side.
    ///
    /// `max_distance`: in world units.
    pub fn ray_cast(&self, ray: Ray3d, max_distance: f32) -> Option<TerrainHit> {
        self.ray_cast_where(ray, max_distance, |terrain| self.is_visible(terrain))
    }

    /// The first triangle that a ray hits among the terrains that `filter` accepts, hidden ones included.
    ///
    /// `max_distance`: in world units. The filter is called only for terrains near the ray.
    ///
    /// ```
    /// use bevy_marchless::prelude::*;
    /// # use bevy_ecs::prelude::*;
    /// # use bevy_math::Ray3d;
    ///
    /// # #[derive(Component)]
    /// # struct Water;
    /// /// Finds the ground below the water.
    /// fn cast_below_water(ray: Ray3d, terrains: &TerrainQuery, water: &Query<(), With<Water>>) -> Option<TerrainHit> {
    ///     let is_ground = |terrain| terrains.is_visible(terrain) && !water.contains(terrain);
    ///     terrains.ray_cast_where(ray, 500.0, is_ground)
    /// }
    /// ```
    pub fn ray_cast_where(&self, ray: Ray3d, max_distance: f32, filter: impl Fn(Entity) -> bool) -> Option<TerrainHit> {
        let found = self
            .terrains
            .iter()
            .filter(|(terrain, volume, place)| bounds::may_hit(volume, place, ray, max_distance) && filter(*terrain));
        let hits = found.filter_map(|found| cast(found, ray, max_distance));
        hits.min_by(|a, b| a.distance.total_cmp(&b.distance))
    }

    /// The first triangle of one terrain that a ray hits, whether the terrain is visible or hidden.
    pub fn ray_cast_terrain(&self, terrain: Entity, ray: Ray3d, max_distance: f32) -> Option<TerrainHit> {
        cast(self.terrains.get(terrain).ok()?, ray, max_distance)
    }

    /// True if a terrain's own or inherited `Visibility` let it be drawn in the latest update, or if it has none.
    ///
    /// This needs no renderer. The visibility of single chunks does not count.
    pub fn is_visible(&self, terrain: Entity) -> bool {
        !self.hidden.get(terrain).is_ok_and(|is_hidden| is_hidden.0)
    }

    /// The signed distance from a position in world space to the surface, negative inside, with all edits; interpolated
    /// between samples. [Units: voxels]
    ///
    /// This is the surface of the samples, whichever mesher draws it. Meshes come close to it; smoothed ones less so.
    ///
    /// `None` if there is no such terrain, or if a chunk that holds the samples around the position is not filled yet.
    /// Outside the terrain's extent is air.
    pub fn weight_at(&self, terrain: Entity, position: Vec3) -> Option<f32> {
        let (_, volume, _) = self.terrains.get(terrain).ok()?;
        let lattice = self.to_lattice(terrain, position)?;
        // The eight samples around the position may be in up to eight chunks.
        let corner = lattice.floor().as_ivec3();
        let ends = [corner, corner.saturating_add(IVec3::ONE)];
        let [low, high] = ends.map(|end| volume.grid().chunk_of(end.to_array()));
        let unfilled = |chunk| is_unfilled(volume, chunk);
        if Region::new(low, high.map(|v| v + 1)).points().any(unfilled) {
            return None;
        }
        volume.grid().weight_at(volume.settings()?.isovalue, lattice.to_array())
    }

    /// Converts a position from world space to the terrain's lattice: voxels from its lowest corner, as stamps take it.
    ///
    /// `None` if there is no such terrain or the result is not finite.
    pub fn to_lattice(&self, terrain: Entity, position: Vec3) -> Option<DVec3> {
        let (_, volume, place) = self.terrains.get(terrain).ok()?;
        let local = place.to_terrain().transform_point3(position.as_dvec3());
        let lattice = local / f64::from(volume.settings()?.voxel_size);
        lattice.is_finite().then_some(lattice)
    }

    /// Converts a position from the terrain's lattice, in voxels from its lowest corner, to world space.
    ///
    /// `None` if there is no such terrain.
    pub fn to_world(&self, terrain: Entity, lattice: impl Into<DVec3>) -> Option<Vec3> {
        let (_, volume, place) = self.terrains.get(terrain).ok()?;
        let local = lattice.into() * f64::from(volume.settings()?.voxel_size);
        Some(place.to_world().transform_point3(local).as_vec3())
    }

    /// Converts a length from world units to voxels of the terrain, as brushes take it.
    ///
    /// If the terrain's transform scales its axes differently, the scale is the cube root of the determinant, which is
    /// the factor by which volumes grow. `None` if there is no such terrain, if it is scaled to nothing, or if a number
    /// is not finite.
    ///
    /// ```
    /// use bevy_marchless::prelude::*;
    /// # use bevy_math::Vec3;
    ///
    /// /// Digs a ball with a radius of 2 world units, whatever the size of a voxel.
    /// fn dig(at: Vec3, hit: &TerrainHit, terrains: &TerrainQuery) -> Option<Stamp> {
    ///     let middle = terrains.to_lattice(hit.terrain, at)?;
    ///     let radius = terrains.to_lattice_length(hit.terrain, 2.0)?;
    ///     Some(Stamp::dig(hit.terrain, BrushShape::sphere(middle, radius)))
    /// }
    /// ```
    pub fn to_lattice_length(&self, terrain: Entity, world_length: f32) -> Option<f32> {
        let length = (f64::from(world_length) / self.voxel_length(terrain)?) as f32;
        length.is_finite().then_some(length)
    }

    /// Converts a length from voxels of the terrain to world units: the inverse of
    /// [`to_lattice_length`](Self::to_lattice_length).
    ///
    /// ```
    /// use bevy_marchless::prelude::*;
    ///
    /// /// The distance to the surface, in world units.
    /// fn height(hit: &TerrainHit, at: bevy_math::Vec3, terrains: &TerrainQuery) -> Option<f32> {
    ///     terrains.to_world_length(hit.terrain, terrains.weight_at(hit.terrain, at)?)
    /// }
    /// ```
    pub fn to_world_length(&self, terrain: Entity, voxels: f32) -> Option<f32> {
        let length = (f64::from(voxels) * self.voxel_length(terrain)?) as f32;
        length.is_finite().then_some(length)
    }

    /// The length of a voxel in world units; finite and above 0.
    fn voxel_length(&self, terrain: Entity) -> Option<f64> {
        let (_, volume, place) = self.terrains.get(terrain).ok()?;
        let scale = place.to_world().matrix3.determinant().abs().cbrt();
        let length = scale * f64::from(volume.settings()?.voxel_size);
        (length.is_finite() && length > 0.0).then_some(length)
    }
}

/// True if a chunk in the terrain's extent has no samples: they are not filled yet, not loaded, or were dropped.
fn is_unfilled(volume: &TerrainVolume, chunk: [i32; 3]) -> bool {
    let is_there = volume.grid().chunk(chunk).is_some();
    !is_there && volume.grid().bounds().is_none_or(|bounds| bounds.contains(chunk))
}

/// A hit in the terrain's lattice; its distance in voxels.
struct LatticeHit {
    chunk: Entity,
    level: u8,
    distance: f64,
    lattice: DVec3,
    normal: DVec3,
    material: u8,
}

impl LatticeHit {
    /// A hit of a mesh whose cells are `size` voxels wide. `ray`: in the lattice.
    fn of_mesh(ray: &MeshRay, hit: MeshHit, size: f64, level: u8, chunk: Entity) -> Self {
        let MeshHit { distance, normal, material } = hit;
        let distance = distance * size;
        Self { chunk, level, distance, lattice: ray.origin + ray.direction * distance, normal, material }
    }
}

/// The first drawn triangle of one terrain that a ray hits.
fn cast(
    (terrain, volume, place): (Entity, &TerrainVolume, PlacementItem),
    ray: Ray3d,
    max_distance: f32,
) -> Option<TerrainHit> {
    let voxel_size = f64::from(volume.settings()?.voxel_size);
    let (to_world, to_terrain) = (place.to_world(), place.to_terrain());
    let origin = to_terrain.transform_point3(ray.origin.as_dvec3()) / voxel_size;
    let step = to_terrain.transform_vector3(ray.direction.as_dvec3()) / voxel_size;
    // Voxels per world unit along the ray.
    let scale = step.length();
    let direction = step / scale;
    let reach = f64::from(max_distance) * scale;
    let finest = match volume.heart().mesh_method() {
        MeshMethod::Primal(_) => cast_finest(volume, origin, direction, reach),
        MeshMethod::Dual(_) => dual::cast(volume, MeshRay { origin, direction, reach }),
    };
    let nearer = finest.as_ref().map_or(reach, |hit| hit.distance);
    let hit = coarser::cast(volume.heart(), MeshRay { origin, direction, reach: nearer }).or(finest)?;
    let normal = to_terrain.matrix3.transpose() * hit.normal;
    Some(TerrainHit {
        terrain,
        chunk: hit.chunk,
        level: hit.level,
        position: to_world.transform_point3(hit.lattice * voxel_size).as_vec3(),
        normal: normal.as_vec3().normalize_or_zero(),
        lattice: hit.lattice,
        material: hit.material,
        distance: (hit.distance / scale) as f32,
    })
}

/// The first drawn triangle of the finest level, with the primal mesher.
fn cast_finest(volume: &TerrainVolume, origin: DVec3, direction: DVec3, reach: f64) -> Option<LatticeHit> {
    let (shown, isovalue) = (volume.shown(), volume.shown_isovalue());
    let mut start = 0.0;
    loop {
        let from = origin + direction * start;
        let hit = shown.ray_cast(isovalue, from.to_array(), direction.to_array(), reach - start)?;
        let Some(chunk) = volume.heart().entity(ChunkKey::finest(hit.chunk)) else {
            // This chunk is not drawn; its samples serve its neighbours. Continue behind the hit.
            start += hit.distance + 1e-3;
            continue;
        };
        let (distance, normal) = (start + hit.distance, Vec3::from(hit.normal).as_dvec3());
        let lattice = DVec3::from(hit.position);
        return Some(LatticeHit { chunk, level: 0, distance, lattice, normal, material: hit.material });
    }
}
