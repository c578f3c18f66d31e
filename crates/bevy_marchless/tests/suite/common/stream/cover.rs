//! Checks of the cover in every update, computed from the viewers alone.

use std::collections::{BTreeMap, BTreeSet};

use bevy_app::App;
use bevy_asset::Assets;
use bevy_ecs::prelude::*;
use bevy_marchless::prelude::*;
use bevy_marchless::stream::{Coverage, LeafState};
use bevy_math::{DVec3, IVec3};
use bevy_mesh::{Mesh, Mesh3d};
use bevy_transform::components::Transform;
use marchless::Region;

use super::Fresh;
use crate::common::volume;

/// The extra distance in which the plugin may load and keep chunks. [Units: chunks]
pub const SLACK: f64 = 0.25;

/// The view of one viewer, in voxels of the terrain.
#[derive(Clone, Copy, Debug)]
pub struct View {
    pub center: DVec3,
    pub radii: DVec3,
    pub margin: f64,
}

impl View {
    /// The views of an app's viewers on a terrain; the viewers have no parent.
    pub fn all(app: &mut App, terrain: Entity) -> Vec<Self> {
        let world = app.world_mut();
        let place = world.get::<Transform>(terrain).expect("a terrain has a place").to_matrix().as_dmat4().inverse();
        let voxel = f64::from(world.get::<Terrain>(terrain).expect("a terrain").voxel_size);
        let mut viewers = world.query::<(&TerrainViewer, &Transform)>();
        viewers
            .iter(world)
            .map(|(viewer, transform)| Self {
                center: place.transform_point3(transform.translation.as_dvec3()) / voxel,
                radii: viewer.radii.as_dvec3(),
                margin: f64::from(viewer.margin),
            })
            .collect()
    }

    /// Whether any point of a chunk lies within the view's radii plus some voxels.
    pub fn reaches(&self, position: [i32; 3], cells: u32, more: f64) -> bool {
        let low = IVec3::from(position).as_dvec3() * f64::from(cells);
        let nearest = self.center.clamp(low, low + f64::from(cells));
        ((nearest - self.center) / (self.radii + more)).length_squared() <= 1.0
    }

    /// The chunks in range, with the range grown by some voxels.
    pub fn chunks(&self, cells: u32, more: f64) -> Vec<[i32; 3]> {
        let cell = f64::from(cells);
        let low = ((self.center - self.radii - more) / cell).floor().as_ivec3() - 1;
        let high = ((self.center + self.radii + more) / cell).floor().as_ivec3() + 2;
        let around = Region::new(low.to_array(), high.to_array());
        around.points().filter(|position| self.reaches(*position, cells, more)).collect()
    }
}

/// The chunks drawn in the last update, to find those that have gone.
#[derive(Default)]
pub struct Cover {
    drawn: BTreeMap<[i32; 3], Entity>,
    updates: u64,
}

impl Cover {
    /// Checks everything that must hold in every update. `lags`: chunks out of range may go some updates later.
    pub fn check(&mut self, app: &mut App, terrain: Entity, fresh: &Fresh, lags: bool) {
        let views = View::all(app, terrain);
        self.updates += 1;
        let (updates, cells) = (self.updates, volume(app, terrain).grid().chunk_cells());
        let slack = SLACK * f64::from(cells);
        let extent = fresh.extent();
        for view in &views {
            for position in view.chunks(cells, 0.0).into_iter().filter(|position| extent.contains(*position)) {
                let leaf = volume(app, terrain).leaf_at(position.into());
                let leaf =
                    leaf.unwrap_or_else(|| panic!("update {updates}: no leaf at {position:?}, seen by {view:?}"));
                assert_eq!((leaf.level, leaf.position), (0, position.into()), "update {updates}");
            }
        }
        let drawn = drawn_chunks(app, terrain);
        let volume = volume(app, terrain);
        let kept = |position: [i32; 3]| kept_region(volume).contains(position);
        for (&position, &entity) in &drawn {
            let leaf = volume.leaf_at(position.into());
            assert_eq!(
                leaf.map(|leaf| leaf.state),
                Some(LeafState::Drawn),
                "update {updates}: the chunk at {position:?} is on the screen"
            );
            assert_eq!(volume.chunk_entity(position.into()), Some(entity), "update {updates}: {position:?}");
            let near = views.iter().any(|view| view.reaches(position, cells, view.margin + slack));
            assert!(near || lags || kept(position), "update {updates}: {position:?} should have gone: {views:?}");
        }
        for (&position, &entity) in &self.drawn {
            let is_there = drawn.get(&position) == Some(&entity);
            let seen = kept(position) || views.iter().any(|view| view.reaches(position, cells, view.margin));
            let state = volume.leaf_at(position.into()).map(|leaf| leaf.state);
            let dug_away = state == Some(LeafState::Empty) && fresh.is_edited(position);
            assert!(
                is_there || !seen || dug_away,
                "update {updates}: the chunk at {position:?} went though it was in range: {state:?}, {views:?}"
            );
        }
        if updates % 16 == 0 {
            check_counts(volume, &views, &drawn);
        }
        self.drawn = drawn;
    }
}

/// The chunks that a terrain keeps without viewers.
fn kept_region(volume: &TerrainVolume) -> Region {
    let region = |extent: Extent| Region::new(extent.min.to_array(), extent.max.to_array());
    volume.settings().map_or(Region::new([0; 3], [0; 3]), |terrain| match terrain.keep {
        Keep::Everything => region(terrain.extent),
        Keep::Nothing => Region::new([0; 3], [0; 3]),
        Keep::Chunks(chunks) => region(chunks).intersection(&region(terrain.extent)),
    })
}

/// The entities of a terrain's chunks with a mesh, by position. No two chunks share a position. Where everything has
/// been dug away, the entity may stay without a mesh.
pub fn drawn_chunks(app: &mut App, terrain: Entity) -> BTreeMap<[i32; 3], Entity> {
    let world = app.world_mut();
    let mut chunks = world.query::<(Entity, &Chunk, &ChunkGeometry, Option<&Mesh3d>, &ChildOf)>();
    let assets = world.get_resource::<Assets<Mesh>>();
    let (mut drawn, mut places) = (BTreeMap::new(), BTreeSet::new());
    for (entity, chunk, geometry, mesh, parent) in chunks.iter(world).filter(|(_, chunk, ..)| chunk.terrain == terrain)
    {
        assert_eq!((parent.parent(), chunk.level), (terrain, 0));
        assert!(places.insert(chunk.position.to_array()), "two chunks at {}", chunk.position);
        if geometry.mesh.is_empty() {
            assert!(mesh.is_none(), "the chunk at {} has nothing to draw", chunk.position);
            continue;
        }
        if let Some(assets) = assets {
            let mesh = mesh.unwrap_or_else(|| panic!("the chunk at {} has no mesh", chunk.position));
            assert!(assets.contains(&mesh.0), "the mesh of the chunk at {} is gone", chunk.position);
        }
        drawn.insert(chunk.position.to_array(), entity);
    }
    drawn
}

/// Checks that the counts are those of the leaves.
fn check_counts(volume: &TerrainVolume, views: &[View], drawn: &BTreeMap<[i32; 3], Entity>) {
    let coverage = volume.coverage();
    assert_eq!(coverage.drawn, drawn.len(), "{coverage:?}");
    let cells = volume.grid().chunk_cells();
    let [first] = views else { return };
    let far = first.margin + 3.0 * f64::from(cells);
    let states = first.chunks(cells, far).into_iter().filter_map(|position| volume.leaf_at(position.into()));
    let mut counted = Coverage::default();
    for leaf in states {
        match leaf.state {
            LeafState::Waiting => counted.waiting += 1,
            LeafState::Empty => counted.empty += 1,
            LeafState::Drawn => counted.drawn += 1,
        }
    }
    // Chunks that lag or are kept may lie farther away.
    assert!(counted.drawn <= coverage.drawn && counted.waiting <= coverage.waiting && counted.empty <= coverage.empty);
}
