//! Random flights, and the apps that fly them.

use std::sync::Arc;
use std::time::Duration;

use bevy_app::App;
use bevy_ecs::prelude::*;
use bevy_marchless::prelude::*;
use bevy_marchless::stream::LeafState;
use bevy_math::{DVec3, IVec3, Quat, Vec3};
use bevy_transform::components::Transform;
use marchless::{GridChunk as Samples, MeshBuffer};
use proptest::prelude::*;
use proptest::strategy::ValueTree as _;
use proptest::test_runner::{RngAlgorithm, TestRng, TestRunner};

use super::cover::drawn_chunks;
use super::{Cover, Fresh, Hills, View};
use crate::common::{geometry, volume};

/// A part of a flight. All lengths are in chunks.
#[derive(Clone, Debug)]
pub enum Leg {
    /// A viewer flies straight on, `step` chunks per update.
    Fly { viewer: usize, step: Vec3, updates: u32 },
    /// A viewer jumps to another place.
    Teleport { viewer: usize, to: Vec3 },
    /// A viewer is added, up to three.
    Spawn { at: Vec3, radii: Vec3, margin: f32 },
    /// A viewer is removed.
    Despawn { viewer: usize },
    /// An edit at a place relative to a viewer; its height counts from the ground.
    Edit { viewer: usize, offset: Vec3, radius: f32, operation: BrushOperation },
    /// Some updates pass.
    Wait { updates: u32 },
    /// Updates pass until everything is drawn, and the result is compared with a fresh terrain.
    Settle,
}

/// Any part of a flight.
pub fn leg() -> impl Strategy<Value = Leg> {
    let viewer = || 0usize..3;
    let turn = (0.0f32..6.2, -0.4f32..0.4, prop_oneof![0.02f32..0.3, 0.3f32..1.5]);
    let fly = (viewer(), turn, 1u32..16).prop_map(|(viewer, (yaw, pitch, speed), updates)| {
        let step = Quat::from_rotation_y(yaw) * Quat::from_rotation_x(pitch) * Vec3::NEG_Z * speed;
        Leg::Fly { viewer, step, updates }
    });
    let within = |far: f32, high: f32| (-far..far, -high..high, -far..far).prop_map(Vec3::from);
    let teleport = (viewer(), prop_oneof![4 => within(10.0, 2.5), 1 => within(20_000.0, 2.0)])
        .prop_map(|(viewer, to)| Leg::Teleport { viewer, to });
    let radii = (0.5f32..2.6, 0.5f32..2.0, 0.5f32..2.6).prop_map(Vec3::from);
    let spawn = (within(8.0, 2.0), radii, prop_oneof![Just(0.0f32), 0.0f32..1.5])
        .prop_map(|(at, radii, margin)| Leg::Spawn { at, radii, margin });
    let operation = prop_oneof![
        4 => Just(BrushOperation::Dig), 2 => Just(BrushOperation::Add), 1 => Just(BrushOperation::Paint)
    ];
    let edit = (viewer(), within(4.5, 1.2), 0.15f32..1.2, operation)
        .prop_map(|(viewer, offset, radius, operation)| Leg::Edit { viewer, offset, radius, operation });
    prop_oneof![
        6 => fly,
        2 => teleport,
        1 => spawn,
        1 => viewer().prop_map(|viewer| Leg::Despawn { viewer }),
        4 => edit,
        1 => (1u32..8).prop_map(|updates| Leg::Wait { updates }),
        1 => Just(Leg::Settle),
    ]
}

/// A random flight, with a number of legs in this range.
pub fn legs(count: core::ops::Range<usize>) -> impl Strategy<Value = Vec<Leg>> {
    prop::collection::vec(leg(), count)
}

/// Endless random legs; the same seed gives the same legs.
pub fn legs_of_seed(seed: u64) -> impl Iterator<Item = Leg> {
    let mut bytes = [0; 32];
    bytes[..8].copy_from_slice(&seed.to_le_bytes());
    let rng = TestRng::from_seed(RngAlgorithm::ChaCha, &bytes);
    let mut runner = TestRunner::new_with_rng(proptest::test_runner::Config::default(), rng);
    let leg = leg();
    core::iter::repeat_with(move || leg.new_tree(&mut runner).expect("nothing is filtered").current())
}

/// A flight through a terrain that checks every update.
pub struct Flight {
    pub app: App,
    pub terrain: Entity,
    pub viewers: Vec<Entity>,
    /// The fresh terrain to compare with.
    pub fresh: Fresh,
    /// All stamps, in order.
    pub stamps: Vec<Stamp>,
    /// The viewers' distance within which samples stay.
    pub sample_radius: f32,
    /// The greatest distance of viewers from the origin along x and z, in chunks.
    pub area: f32,
    /// Whether chunks out of range may go some updates later.
    pub lags: bool,
    /// The time that other threads get between two updates.
    pub pause: Duration,
    cover: Cover,
}

impl Flight {
    /// A flight with one viewer at the origin that sees two chunks far.
    pub fn new(mut app: App, terrain: Terrain, place: Transform) -> Self {
        let fresh = Fresh::new(&terrain);
        let terrain = app.world_mut().spawn((terrain, place)).id();
        let mut flight = Self {
            app,
            terrain,
            viewers: Vec::new(),
            fresh,
            stamps: Vec::new(),
            sample_radius: f32::INFINITY,
            area: f32::INFINITY,
            lags: false,
            pause: Duration::ZERO,
            cover: Cover::default(),
        };
        flight.spawn(Vec3::ZERO, Vec3::splat(2.0), 0.5);
        flight
    }

    /// Runs an update, and checks everything that must hold in each.
    pub fn update(&mut self) {
        self.app.update();
        self.cover.check(&mut self.app, self.terrain, &self.fresh, self.lags);
        if !self.pause.is_zero() {
            std::thread::sleep(self.pause);
        }
    }

    pub fn fly(&mut self, leg: &Leg) {
        match *leg {
            Leg::Fly { viewer, step, updates } => {
                for _ in 0..updates {
                    if let Some(viewer) = self.viewer(viewer) {
                        let to = self.position(viewer) + step;
                        let forward = self.direction(step);
                        self.place(viewer, to);
                        self.app.world_mut().get_mut::<Transform>(viewer).unwrap().look_to(forward, Vec3::Y);
                    }
                    self.update();
                }
            }
            Leg::Teleport { viewer, to } => {
                if let Some(viewer) = self.viewer(viewer) {
                    self.place(viewer, to);
                }
                self.update();
            }
            Leg::Spawn { at, radii, margin } => {
                if self.viewers.len() < 3 {
                    self.spawn(at, radii, margin);
                }
                self.update();
            }
            Leg::Despawn { viewer } => {
                if let Some(entity) = self.viewer(viewer) {
                    self.viewers.retain(|viewer| *viewer != entity);
                    self.app.world_mut().despawn(entity);
                }
                self.update();
            }
            Leg::Edit { viewer, offset, radius, operation } => {
                let near = self.viewer(viewer).map_or(Vec3::ZERO, |viewer| self.position(viewer));
                self.edit(near.with_y(0.0) + offset, radius, operation);
                self.update();
            }
            Leg::Wait { updates } => (0..updates).for_each(|_| self.update()),
            Leg::Settle => self.settle_and_compare(),
        }
    }

    /// Spawns a viewer; lengths in chunks.
    pub fn spawn(&mut self, at: Vec3, radii: Vec3, margin: f32) -> Entity {
        let cells = self.cells();
        let viewer = TerrainViewer { radii: radii * cells, margin: margin * cells, sample_radius: self.sample_radius };
        let entity = self.app.world_mut().spawn(viewer).id();
        self.viewers.push(entity);
        self.place(entity, at);
        entity
    }

    /// Moves a viewer to a place, in chunks from the terrain's origin.
    pub fn place(&mut self, viewer: Entity, to: Vec3) {
        let to = if self.area.is_finite() {
            let fold = |v: f32| (v + self.area).rem_euclid(2.0 * self.area) - self.area;
            Vec3::new(fold(to.x), to.y.clamp(-4.0, 4.0), fold(to.z))
        } else {
            to.with_y(to.y.clamp(-6.0, 6.0))
        };
        let position = self.terrain_place().transform_point(to * self.chunk_size());
        self.app.world_mut().get_mut::<Transform>(viewer).expect("a viewer has a place").translation = position;
    }

    /// Writes a stamp; lengths in chunks, and the height from the ground.
    pub fn edit(&mut self, at: Vec3, radius: f32, operation: BrushOperation) {
        let world = (at * self.chunk_size()).as_dvec3();
        let ground = Hills::height(world.x, world.z) / f64::from(self.voxel_size());
        let center = (at * self.cells()).as_dvec3() + DVec3::Y * ground;
        let shape = BrushShape::sphere(center, radius * self.cells());
        self.stamp(Stamp { terrain: self.terrain, shape, operation, material: 3, stroke: None });
    }

    pub fn stamp(&mut self, stamp: Stamp) {
        self.fresh.stamp(&stamp.quantised().expect("numbers in range"));
        self.stamps.push(stamp);
        self.app.world_mut().write_message(stamp);
    }

    /// Updates until everything in range is drawn and up to date, at most 5,000 times, with a check in each.
    pub fn settle(&mut self) -> u32 {
        for updates in 0..5_000 {
            self.update();
            if volume(&self.app, self.terrain).is_settled() {
                return updates;
            }
            if self.app.world().resource::<MarchlessSettings>().max_jobs_per_update.is_none() {
                std::thread::sleep(Duration::from_micros(500));
            }
        }
        panic!("not settled in 5,000 updates: {:?}", volume(&self.app, self.terrain).coverage());
    }

    /// Settles, and asserts that all chunks in range and all drawn ones equal those of the fresh terrain.
    pub fn settle_and_compare(&mut self) {
        self.settle();
        let lags = core::mem::replace(&mut self.lags, false);
        self.update();
        self.lags = lags;
        let drawn = drawn_chunks(&mut self.app, self.terrain);
        let cells = volume(&self.app, self.terrain).grid().chunk_cells();
        let mut seen: Vec<_> =
            View::all(&mut self.app, self.terrain).iter().flat_map(|view| view.chunks(cells, 0.0)).collect();
        seen.retain(|position| self.fresh.extent().contains(*position));
        seen.extend(drawn.keys());
        seen.sort();
        seen.dedup();
        for position in seen {
            let expected = self.fresh.mesh(position);
            let state = volume(&self.app, self.terrain).leaf_at(position.into()).map(|leaf| leaf.state);
            let wanted = if expected.is_empty() { LeafState::Empty } else { LeafState::Drawn };
            assert_eq!(state, Some(wanted), "{position:?}");
            if let Some(entity) = drawn.get(&position) {
                let geometry = self.app.world().get::<ChunkGeometry>(*entity).expect("a chunk has geometry");
                assert_eq!(*geometry.mesh, expected, "the chunk at {position:?} is not as in a fresh world");
            }
            if let Some(samples) = volume(&self.app, self.terrain).grid().chunk(position) {
                assert!(same_samples(samples, self.fresh.chunk(position), cells), "samples of {position:?}");
            }
        }
    }

    /// The geometry of every chunk with a mesh, in order of position.
    pub fn drawn(&mut self) -> Vec<(IVec3, Arc<MeshBuffer>)> {
        let mut all = geometry(&mut self.app, self.terrain);
        all.retain(|(_, mesh)| !mesh.is_empty());
        all
    }

    /// Forgets the chunks drawn before, because the terrain's settings have changed.
    pub fn forget_what_was_drawn(&mut self) {
        self.cover = Cover::default();
    }

    fn viewer(&self, number: usize) -> Option<Entity> {
        (!self.viewers.is_empty()).then(|| self.viewers[number % self.viewers.len()])
    }

    /// A viewer's place, in chunks from the terrain's origin.
    pub fn position(&self, viewer: Entity) -> Vec3 {
        let world = self.app.world().get::<Transform>(viewer).expect("a viewer has a place").translation;
        let place = self.terrain_place();
        place.rotation.inverse() * (world - place.translation) / place.scale / self.chunk_size()
    }

    fn direction(&self, step: Vec3) -> Vec3 {
        self.terrain_place().rotation * step
    }

    fn terrain_place(&self) -> Transform {
        *self.app.world().get::<Transform>(self.terrain).expect("a terrain has a place")
    }

    fn settings(&self) -> &Terrain {
        self.app.world().get::<Terrain>(self.terrain).expect("a terrain")
    }

    fn voxel_size(&self) -> f32 {
        self.settings().voxel_size
    }

    fn cells(&self) -> f32 {
        self.settings().chunk_cells as f32
    }

    /// The length of a chunk in the terrain's own space.
    fn chunk_size(&self) -> f32 {
        self.cells() * self.voxel_size()
    }
}

/// Whether two chunks have the same samples, in whatever form.
pub fn same_samples(a: &Samples<i16>, b: &Samples<i16>, cells: u32) -> bool {
    a == b || (0..cells.pow(3) as usize).all(|index| a.voxel(index) == b.voxel(index))
}
