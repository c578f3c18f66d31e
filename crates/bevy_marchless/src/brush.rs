//! [`Stamp`] messages change terrains; [`TerrainEdited`] messages report the changes.

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

/// A message that applies a brush to a terrain once.
///
/// A stamp is rounded to 1/256 voxel when it is read, and applied in integers. The same stamps in the same order
/// therefore give the same samples, bit for bit, on any machine.
///
/// A small change shows in the same update
/// ([`MarchlessSettings::max_inline_chunks`](crate::schedule::MarchlessSettings::max_inline_chunks)), a larger one some
/// updates later, but never in part.
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
    /// The samples that the stamp affects.
    pub shape: BrushShape,
    /// The change to these samples.
    pub operation: BrushOperation,
    /// The material of samples that become solid or are painted; digging ignores it.
    pub material: u8,
    /// The part of a timed stroke that this stamp applies; `None` applies the whole shape at once.
    pub stroke: Option<Stroke>,
}

impl Stamp {
    /// A stamp that makes the shape air.
    pub const fn dig(terrain: Entity, shape: BrushShape) -> Self {
        Self { terrain, shape, operation: BrushOperation::Dig, material: 0, stroke: None }
    }

    /// A stamp that makes the shape solid, of `material`.
    pub const fn add(terrain: Entity, shape: BrushShape, material: u8) -> Self {
        Self { terrain, shape, operation: BrushOperation::Add, material, stroke: None }
    }

    /// A stamp that gives the solid samples in the shape `material`.
    pub const fn paint(terrain: Entity, shape: BrushShape, material: u8) -> Self {
        Self { terrain, shape, operation: BrushOperation::Paint, material, stroke: None }
    }

    /// Makes the stamp a part of a timed stroke; painting ignores it.
    #[must_use]
    pub const fn with_stroke(self, stroke: Stroke) -> Self {
        Self { stroke: Some(stroke), ..self }
    }

    /// Converts the stamp to lattice integers, for the surface at isovalue 0. When a terrain applies a stamp, its own
    /// isovalue counts.
    ///
    /// # Errors
    /// [`BrushError`] for the first number out of range.
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

/// A shape in the terrain's lattice: all numbers are in voxels, from the lattice's origin
/// ([`TerrainQuery::to_lattice`](crate::query::TerrainQuery::to_lattice) converts positions).
///
/// Positions are in double precision, so that a brush ten million voxels away is as exact as at the origin. They range
/// to 2³⁰ (a thousand million voxels) either way. Radii and half sizes lie above 0 and range to 1,024.
#[derive(Reflect, Clone, Copy, Debug, PartialEq)]
#[reflect(Debug, PartialEq, Clone)]
pub enum BrushShape {
    /// A ball.
    Sphere {
        /// The ball's centre.
        center: DVec3,
        /// The ball's radius.
        radius: f32,
    },
    /// A box along the lattice's axes.
    Box {
        /// The box's centre.
        center: DVec3,
        /// The distances from the centre to the faces.
        half_size: Vec3,
    },
    /// The volume that a ball sweeps between two points, at most 2,048 voxels apart on each axis.
    Capsule {
        /// The first point.
        a: DVec3,
        /// The second point; may equal the first.
        b: DVec3,
        /// The ball's radius.
        radius: f32,
    },
}

impl BrushShape {
    /// A ball, in voxels.
    pub fn sphere(center: impl Into<DVec3>, radius: f32) -> Self {
        Self::Sphere { center: center.into(), radius }
    }

    /// A box along the axes, from `center - half_size` to `center + half_size`, in voxels.
    pub fn cuboid(center: impl Into<DVec3>, half_size: Vec3) -> Self {
        Self::Box { center: center.into(), half_size }
    }

    /// The volume that a ball sweeps between `a` and `b`, in voxels.
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

/// The change that a stamp makes to the samples in its shape.
#[derive(Reflect, Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[reflect(Debug, PartialEq, Hash, Clone)]
pub enum BrushOperation {
    /// Makes the samples solid.
    Add,
    /// Makes the samples air.
    Dig,
    /// Changes the material of solid samples.
    Paint,
}

/// The part of a timed stroke that a stamp applies: the effect of a brush with a rate from `start` to `end`.
///
/// Times are rounded down to microseconds, and samples move by differences of whole steps. A stroke therefore has the
/// same effect however it is cut into stamps, as long as each stamp starts where the one before ends.
#[derive(Reflect, Clone, Copy, Debug, PartialEq)]
#[reflect(Debug, PartialEq, Clone)]
pub struct Stroke {
    /// A number of your choice for the stroke; it has no effect on the samples.
    pub id: u64,
    /// The speed of the surface outside the falloff rim, in voxels per second; at most 65,536.
    pub rate: f32,
    /// The width of the rim within the shape over which the rate falls to 0, in voxels; at most 1,024.
    pub falloff: f32,
    /// The start of the part, in time since the stroke began.
    pub start: Duration,
    /// The end of the part; at or after `start`.
    pub end: Duration,
}

impl Stroke {
    fn quantised(&self) -> Result<marchless::QuantisedStroke, BrushError> {
        marchless::QuantisedStroke::new(self.id, self.rate.into(), self.falloff.into(), self.start, self.end)
    }
}

/// A message about the changes that one update's stamps made in one region of a terrain; sent in the update that
/// applies them.
///
/// Stamps whose chunks overlap share one message; every other stamp has its own. Stamps on chunks that are still being
/// filled are reported when they take effect.
#[derive(Message, Reflect, Clone, Debug, PartialEq, Eq)]
#[reflect(Message, Debug, PartialEq, Clone)]
pub struct TerrainEdited {
    /// The terrain's entity.
    pub terrain: Entity,
    /// The lowest changed lattice point.
    pub min: IVec3,
    /// One past the highest changed lattice point.
    pub max: IVec3,
    /// The volume that became solid, in cubic voxels by its new material.
    pub added: BTreeMap<u8, u64>,
    /// The volume that became air, in cubic voxels by its former material.
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
