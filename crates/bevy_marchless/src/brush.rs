//! [`Stamp`] messages in, [`TerrainEdited`] messages out.

mod apply;

use core::time::Duration;
use std::collections::BTreeMap;

use bevy_app::{App, Plugin, PostUpdate};
use bevy_ecs::prelude::*;
use bevy_math::{DVec3, IVec3, Vec3};
use bevy_reflect::prelude::*;
use marchless::BrushError;

use crate::schedule::{MarchlessSystems, NewEdits, UpdatePhase};
use crate::stats::count_update;

/// One application of a brush to a terrain, asked for by a message.
///
/// It is rounded to 1/256 voxel as it is read and applied in integers from then on: the same stamps in the same order
/// give the same samples, bit for bit, on any machine. What it changes shows in the same update where it is
/// small ([`MarchlessSettings::max_inline_chunks`](crate::schedule::MarchlessSettings::max_inline_chunks)), updates later where it is not, and never in part.
///
/// A stamp with numbers out of range, or for an entity without a terrain, is dropped with a warning.
///
/// ```
/// use bevy_marchless::prelude::*;
/// # use bevy_ecs::prelude::*;
/// # use bevy_math::Vec3;
///
/// fn dig(terrain: Single<Entity, With<Terrain>>, mut stamps: MessageWriter<Stamp>) {
///     stamps.write(Stamp::dig(*terrain, BrushShape::sphere(Vec3::new(64.0, 40.0, 64.0), 6.0)));
/// }
/// ```
#[derive(Message, Reflect, Clone, Copy, Debug, PartialEq)]
#[reflect(Message, Debug, PartialEq, Clone)]
pub struct Stamp {
    /// The terrain's entity.
    pub terrain: Entity,
    /// Where.
    pub shape: BrushShape,
    /// What.
    pub operation: BrushOperation,
    /// What the samples that become solid or are painted are made of; digging does not use it.
    pub material: u8,
    /// The part of a timed stroke that it is; `None`: the whole shape at once.
    pub stroke: Option<Stroke>,
}

impl Stamp {
    /// Makes the shape air.
    pub const fn dig(terrain: Entity, shape: BrushShape) -> Self {
        Self { terrain, shape, operation: BrushOperation::Dig, material: 0, stroke: None }
    }

    /// Makes the shape solid, of `material`.
    pub const fn add(terrain: Entity, shape: BrushShape, material: u8) -> Self {
        Self { terrain, shape, operation: BrushOperation::Add, material, stroke: None }
    }

    /// Gives the solid samples in the shape `material`.
    pub const fn paint(terrain: Entity, shape: BrushShape, material: u8) -> Self {
        Self { terrain, shape, operation: BrushOperation::Paint, material, stroke: None }
    }

    /// The same stamp as a part of a timed stroke; painting does not use it.
    #[must_use]
    pub const fn with_stroke(self, stroke: Stroke) -> Self {
        Self { stroke: Some(stroke), ..self }
    }

    /// The same stamp in lattice integers, on the surface at isovalue 0; the terrain's own counts where it is applied.
    ///
    /// # Errors
    /// [`BrushError`] about the first number out of range.
    pub fn quantised(&self) -> Result<marchless::QuantisedStamp, BrushError> {
        let operation = match self.operation {
            BrushOperation::Add => marchless::Operation::Add,
            BrushOperation::Dig => marchless::Operation::Dig,
            BrushOperation::Paint => marchless::Operation::Paint,
        };
        let stamp = marchless::QuantisedStamp::new(self.shape.quantised()?, operation, self.material);
        match &self.stroke {
            Some(stroke) => Ok(stamp.with_stroke(stroke.quantised()?)),
            None => Ok(stamp),
        }
    }
}

/// A shape in the terrain's lattice: all numbers in voxels, from the terrain's lowest corner
/// ([`TerrainQuery::to_lattice`](crate::query::TerrainQuery::to_lattice) gives them). Positions are in double precision, so that a
/// brush is as exact ten million voxels away as it is at the origin, and reach to 2³⁰ (a thousand million voxels) either way. Radii and
/// half sizes lie above 0 and reach to 1,024.
#[derive(Reflect, Clone, Copy, Debug, PartialEq)]
#[reflect(Debug, PartialEq, Clone)]
pub enum BrushShape {
    /// A ball.
    Sphere {
        /// Its middle.
        center: DVec3,
        /// Its radius.
        radius: f32,
    },
    /// A box along the lattice's axes.
    Box {
        /// Its middle.
        center: DVec3,
        /// From the middle to the faces.
        half_size: Vec3,
    },
    /// What a ball sweeps on its way from one point to another, at most 2,048 voxels apart on each axis.
    Capsule {
        /// From here.
        a: DVec3,
        /// To here; may be the same point.
        b: DVec3,
        /// The ball's radius.
        radius: f32,
    },
}

impl BrushShape {
    /// A ball; in voxels.
    pub fn sphere(center: impl Into<DVec3>, radius: f32) -> Self {
        Self::Sphere { center: center.into(), radius }
    }

    /// A box along the axes, from `center - half_size` to `center + half_size`; in voxels.
    pub fn cuboid(center: impl Into<DVec3>, half_size: Vec3) -> Self {
        Self::Box { center: center.into(), half_size }
    }

    /// What a ball sweeps on its way from `a` to `b`; in voxels.
    pub fn capsule(a: impl Into<DVec3>, b: impl Into<DVec3>, radius: f32) -> Self {
        Self::Capsule { a: a.into(), b: b.into(), radius }
    }

    fn quantised(&self) -> Result<marchless::QuantisedShape, BrushError> {
        match *self {
            Self::Sphere { center, radius } => marchless::QuantisedShape::sphere(center.to_array(), radius.into()),
            Self::Box { center, half_size } => {
                marchless::QuantisedShape::cuboid(center.to_array(), half_size.as_dvec3().to_array())
            }
            Self::Capsule { a, b, radius } => {
                marchless::QuantisedShape::capsule(a.to_array(), b.to_array(), radius.into())
            }
        }
    }
}

/// What a stamp does to the samples of its shape.
#[derive(Reflect, Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[reflect(Debug, PartialEq, Hash, Clone)]
pub enum BrushOperation {
    /// Makes solid.
    Add,
    /// Makes air.
    Dig,
    /// Changes the material of what is solid.
    Paint,
}

/// The part of a timed stroke that a stamp applies: what a brush at a rate does from `start` to `end`.
///
/// Times are rounded down to microseconds and samples move by the difference of whole steps, so it makes no difference
/// into how many stamps a stroke is cut, as long as each starts where the one before ends.
#[derive(Reflect, Clone, Copy, Debug, PartialEq)]
#[reflect(Debug, PartialEq, Clone)]
pub struct Stroke {
    /// Your number for the stroke; it has no effect on the samples.
    pub id: u64,
    /// How fast the surface moves where the falloff does not reach, in voxels per second; at most 65,536.
    pub rate: f32,
    /// The width of the rim within the shape over which the rate falls to 0, in voxels; at most 1,024.
    pub falloff: f32,
    /// When the part begins, since the stroke began.
    pub start: Duration,
    /// When it ends; not before it begins.
    pub end: Duration,
}

impl Stroke {
    fn quantised(&self) -> Result<marchless::QuantisedStroke, BrushError> {
        marchless::QuantisedStroke::new(self.id, self.rate.into(), self.falloff.into(), self.start, self.end)
    }
}

/// What the stamps of one update have changed of one region of a terrain; sent in the update that applied them.
///
/// Stamps whose chunks overlap are one region; of others, each has a message of its own.
/// Stamps on chunks that are still being filled are reported when they take effect.
#[derive(Message, Reflect, Clone, Debug, PartialEq, Eq)]
#[reflect(Message, Debug, PartialEq, Clone)]
pub struct TerrainEdited {
    /// The terrain's entity.
    pub terrain: Entity,
    /// The lowest changed lattice point.
    pub min: IVec3,
    /// One past the highest changed lattice point.
    pub max: IVec3,
    /// What became solid: cubic voxels by the material that it has now.
    pub added: BTreeMap<u8, u64>,
    /// What became air: cubic voxels by the material that it was.
    pub removed: BTreeMap<u8, u64>,
}

/// Reads and applies stamps.
#[derive(Default)]
pub struct BrushPlugin;

impl Plugin for BrushPlugin {
    fn build(&self, app: &mut App) {
        app.add_message::<Stamp>()
            .add_message::<TerrainEdited>()
            .register_type::<Stamp>()
            .register_type::<TerrainEdited>()
            .init_resource::<NewEdits>()
            .init_resource::<apply::StampQueue>()
            .add_systems(PostUpdate, apply::read_stamps.after(count_update).in_set(MarchlessSystems::ReadStamps))
            .add_systems(PostUpdate, apply::apply_stamps.in_set(UpdatePhase::Edit));
    }
}
