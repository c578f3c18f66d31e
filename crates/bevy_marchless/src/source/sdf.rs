//! [`Sdf`]: shapes with signed distance functions, and their unions, intersections and differences.

use bevy_math::DVec3;
use bevy_reflect::Reflect;
use marchless::{Bound, Source, SourceRegion};

use super::{BOUND_MARGIN, SourceError, check, check_length, check_position, rows, world_box};

/// A solid composed of simple shapes. Lengths and positions are in world units in the terrain's space.
///
/// The distance of a single shape is exact. That of combined shapes is exact outside a union, and a lower bound
/// elsewhere. So distances never change faster than the position, and chunks away from the surface are skipped without
/// sampling. Each shape has a material, which is 0 until [`with_material`](Self::with_material) sets it.
///
/// A shape with a NaN length is air; [`validate`](Self::validate) reports it.
///
/// ```
/// use bevy_marchless::source::Sdf;
///
/// let planet = Sdf::sphere([64.0, 64.0, 64.0], 40.0);
/// let tunnel = Sdf::capsule([0.0, 64.0, 64.0], [128.0, 70.0, 64.0], 8.0);
/// let ring = Sdf::torus([64.0, 64.0, 64.0], 55.0, 3.0).with_material(1);
/// let scene = planet.subtraction(tunnel).union(ring).validate()?;
/// # Ok::<(), bevy_marchless::source::SourceError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Reflect)]
#[reflect(no_field_bounds)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub enum Sdf {
    /// A ball.
    Sphere {
        /// Its middle.
        center: DVec3,
        /// Its radius. Limit: > 0.
        radius: f64,
        /// Its material.
        #[cfg_attr(feature = "serde", serde(default))]
        material: u8,
    },
    /// A box along the axes.
    Box {
        /// Its middle.
        center: DVec3,
        /// The distances from the middle to its faces. Limit: > 0.
        half_size: DVec3,
        /// Its material.
        #[cfg_attr(feature = "serde", serde(default))]
        material: u8,
    },
    /// A rod with round ends: all points near a line segment.
    Capsule {
        /// One end of the line.
        a: DVec3,
        /// The other end.
        b: DVec3,
        /// The distance from the line to the surface. Limit: > 0.
        radius: f64,
        /// Its material.
        #[cfg_attr(feature = "serde", serde(default))]
        material: u8,
    },
    /// A ring that lies flat, around the y axis.
    Torus {
        /// The middle of the hole.
        center: DVec3,
        /// The distance from the middle of the hole to the middle of the tube. Limit: > 0.
        major: f64,
        /// The tube's radius. Limit: > 0.
        minor: f64,
        /// Its material.
        #[cfg_attr(feature = "serde", serde(default))]
        material: u8,
    },
    /// Everything on one side of a plane.
    HalfSpace {
        /// A point on the plane.
        point: DVec3,
        /// The plane's normal, pointing away from the solid side. Limit: length 1.
        normal: DVec3,
        /// Its material.
        #[cfg_attr(feature = "serde", serde(default))]
        material: u8,
    },
    /// All points in any part. Where parts overlap, the part that reaches out farthest gives the material.
    Union(Vec<Sdf>),
    /// A union with filled seams between its parts.
    SmoothUnion {
        /// The parts.
        parts: Vec<Sdf>,
        /// The distance from a seam to the edge of the filling. Limit: > 0.
        radius: f64,
    },
    /// The points that lie in all parts, with the first part's material. An intersection without parts is air.
    Intersection(Vec<Sdf>),
    /// The points of the first part that lie in no other part, with the first part's material.
    Subtraction(Vec<Sdf>),
}

impl Sdf {
    /// A ball.
    pub fn sphere(center: impl Into<DVec3>, radius: f64) -> Self {
        Self::Sphere { center: center.into(), radius, material: 0 }
    }

    /// A box along the axes, given by its middle and half of its size.
    pub fn cuboid(center: impl Into<DVec3>, half_size: impl Into<DVec3>) -> Self {
        Self::Box { center: center.into(), half_size: half_size.into(), material: 0 }
    }

    /// A rod with round ends, from `a` to `b`.
    pub fn capsule(a: impl Into<DVec3>, b: impl Into<DVec3>, radius: f64) -> Self {
        Self::Capsule { a: a.into(), b: b.into(), radius, material: 0 }
    }

    /// A ring that lies flat: `major` from the middle to the middle of the tube, `minor` the tube's radius.
    pub fn torus(center: impl Into<DVec3>, major: f64, minor: f64) -> Self {
        Self::Torus { center: center.into(), major, minor, material: 0 }
    }

    /// Everything behind the plane through `point`. Its `normal` points away from the solid, and has any length but
    /// zero.
    pub fn half_space(point: impl Into<DVec3>, normal: impl Into<DVec3>) -> Self {
        // The quotient has length 1 or is NaN, which `validate` reports.
        let normal: DVec3 = normal.into();
        Self::HalfSpace { point: point.into(), normal: normal / normal.length(), material: 0 }
    }

    /// The union of both solids.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        match self {
            Self::Union(parts) => Self::Union(with(parts, other)),
            first => Self::Union(vec![first, other]),
        }
    }

    /// The union of both solids, with the seam between them filled up to `radius` away from it.
    #[must_use]
    pub fn smooth_union(self, other: Self, radius: f64) -> Self {
        match self {
            Self::SmoothUnion { parts, radius: same } if same == radius => {
                Self::SmoothUnion { parts: with(parts, other), radius }
            }
            first => Self::SmoothUnion { parts: vec![first, other], radius },
        }
    }

    /// The intersection of both solids, with this one's material.
    #[must_use]
    pub fn intersection(self, other: Self) -> Self {
        match self {
            Self::Intersection(parts) => Self::Intersection(with(parts, other)),
            first => Self::Intersection(vec![first, other]),
        }
    }

    /// This solid without `other`.
    #[must_use]
    pub fn subtraction(self, other: Self) -> Self {
        match self {
            Self::Subtraction(parts) => Self::Subtraction(with(parts, other)),
            first => Self::Subtraction(vec![first, other]),
        }
    }

    /// This solid, moved by `by`.
    #[must_use]
    pub fn translated(mut self, by: impl Into<DVec3>) -> Self {
        let by = by.into();
        self.for_each_shape(&mut |shape| match shape {
            Self::Sphere { center, .. } | Self::Box { center, .. } | Self::Torus { center, .. } => *center += by,
            Self::Capsule { a, b, .. } => {
                *a += by;
                *b += by;
            }
            Self::HalfSpace { point, .. } => *point += by,
            Self::Union(_) | Self::SmoothUnion { .. } | Self::Intersection(_) | Self::Subtraction(_) => {}
        });
        self
    }

    /// This solid, all of material `new`.
    #[must_use]
    pub fn with_material(mut self, new: u8) -> Self {
        self.for_each_shape(&mut |shape| {
            if let Self::Sphere { material, .. }
            | Self::Box { material, .. }
            | Self::Capsule { material, .. }
            | Self::Torus { material, .. }
            | Self::HalfSpace { material, .. } = shape
            {
                *material = new;
            }
        });
        self
    }

    /// Checks all numbers of the solid, and returns it.
    ///
    /// # Errors
    /// [`SourceError::Setting`] for a length that is not positive, a position that is not finite or a normal of length
    /// zero.
    pub fn validate(self) -> Result<Self, SourceError> {
        self.check()?;
        Ok(self)
    }

    /// The distance to the surface (negative inside; a lower bound of it for combined shapes) and the material.
    ///
    /// Units: world.
    pub fn sample(&self, position: DVec3) -> (f64, u8) {
        let (distance, material) = match self {
            Self::Sphere { center, radius, material } => (position.distance(*center) - radius, *material),
            Self::Box { center, half_size, material } => {
                let beyond = (position - center).abs() - half_size;
                // `max` ignores NaN, so this sum carries NaN along.
                let unknown = 0.0 * (beyond.x + beyond.y + beyond.z);
                (beyond.max(DVec3::ZERO).length() + beyond.max_element().min(0.0) + unknown, *material)
            }
            Self::Capsule { a, b, radius, material } => {
                let line = b - a;
                let along = ((position - a).dot(line) / line.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
                (position.distance(a + line * along) - radius, *material)
            }
            Self::Torus { center, major, minor, material } => {
                let from = position - center;
                let ring = from.x.hypot(from.z) - major;
                (ring.hypot(from.y) - minor, *material)
            }
            Self::HalfSpace { point, normal, material } => ((position - point).dot(*normal), *material),
            Self::Union(parts) => parts.iter().map(|part| part.sample(position)).fold(AIR, nearer),
            Self::SmoothUnion { parts, radius } => {
                parts.iter().map(|part| part.sample(position)).fold(AIR, |so_far, next| {
                    let overlap = ((radius - (so_far.0 - next.0).abs()) / radius).max(0.0);
                    let (distance, material) = nearer(so_far, next);
                    (distance - overlap * overlap * radius / 4.0, material)
                })
            }
            Self::Intersection(parts) => cut(parts, position, 1.0),
            Self::Subtraction(parts) => cut(parts, position, -1.0),
        };
        if distance.is_nan() { AIR } else { (distance, material) }
    }

    /// This solid without the parts that cannot matter within `reach` of `center`. Samples there keep the same bits.
    pub(super) fn pruned(&self, center: DVec3, reach: f64) -> Self {
        // Two distances that differ by more than this at the centre keep their order all around.
        let apart = 2.0 * reach + (reach + center.length()) * 1e-9;
        let keep_near = |parts: &[Self], filling: f64| {
            let distances: Vec<f64> = parts.iter().map(|part| part.sample(center).0).collect();
            let nearest = distances.iter().copied().fold(f64::INFINITY, f64::min);
            let near = parts.iter().zip(distances).filter(|(_, distance)| *distance <= nearest + apart + filling);
            near.map(|(part, _)| part.pruned(center, reach)).collect()
        };
        let keep_cutting = |parts: &[Self], sign: f64| {
            let deepest = cut(parts, center, sign).0;
            let cuts = |(index, part): &(usize, &Self)| *index == 0 || sign * part.sample(center).0 >= deepest - apart;
            parts.iter().enumerate().filter(cuts).map(|(_, part)| part.pruned(center, reach)).collect()
        };
        match self {
            Self::Union(parts) => Self::Union(keep_near(parts, 0.0)),
            Self::SmoothUnion { parts, radius } => {
                // A part fills seams with parts up to the radius away, and each part may lower distances by a fourth
                // of the radius first.
                let filling = radius * (1.0 + parts.len() as f64 / 4.0);
                Self::SmoothUnion { parts: keep_near(parts, filling), radius: *radius }
            }
            Self::Intersection(parts) => Self::Intersection(keep_cutting(parts, 1.0)),
            Self::Subtraction(parts) => Self::Subtraction(keep_cutting(parts, -1.0)),
            shape => shape.clone(),
        }
    }

    /// The one material that all points of the solid have; `None` if there may be several.
    fn only_material(&self) -> Option<u8> {
        match self {
            Self::Sphere { material, .. }
            | Self::Box { material, .. }
            | Self::Capsule { material, .. }
            | Self::Torus { material, .. }
            | Self::HalfSpace { material, .. } => Some(*material),
            Self::Union(parts) | Self::SmoothUnion { parts, .. } => {
                let mut materials = parts.iter().map(Self::only_material);
                let first = materials.next()??;
                materials.all(|material| material == Some(first)).then_some(first)
            }
            Self::Intersection(parts) | Self::Subtraction(parts) => parts.first()?.only_material(),
        }
    }

    /// The one material that solid points within `reach` of `center` can have; `None` if there may be several.
    #[cfg(feature = "noise")]
    pub(super) fn only_material_around(&self, center: DVec3, reach: f64) -> Option<u8> {
        self.pruned(center, reach).only_material()
    }

    fn parts(&self) -> &[Self] {
        match self {
            Self::Union(parts)
            | Self::SmoothUnion { parts, .. }
            | Self::Intersection(parts)
            | Self::Subtraction(parts) => parts,
            _ => &[],
        }
    }

    fn for_each_shape(&mut self, change: &mut impl FnMut(&mut Self)) {
        match self {
            Self::Union(parts)
            | Self::SmoothUnion { parts, .. }
            | Self::Intersection(parts)
            | Self::Subtraction(parts) => parts.iter_mut().for_each(|part| part.for_each_shape(change)),
            shape => change(shape),
        }
    }

    pub(super) fn check(&self) -> Result<(), SourceError> {
        let position =
            |name, position: DVec3| position.to_array().into_iter().try_for_each(|v| check_position(name, v).map(drop));
        match self {
            Self::Sphere { center, radius, .. } => {
                position("a sphere's centre", *center)?;
                check_length("a sphere's radius", *radius)?;
            }
            Self::Box { center, half_size, .. } => {
                position("a box's centre", *center)?;
                for half in half_size.to_array() {
                    check_length("half of a box's size", half)?;
                }
            }
            Self::Capsule { a, b, radius, .. } => {
                position("a capsule's end", *a)?;
                position("a capsule's end", *b)?;
                check_length("a capsule's radius", *radius)?;
            }
            Self::Torus { center, major, minor, .. } => {
                position("a torus's centre", *center)?;
                check_length("a torus's major radius", *major)?;
                check_length("a torus's minor radius", *minor)?;
            }
            Self::HalfSpace { point, normal, .. } => {
                position("a half-space's point", *point)?;
                check("the length of a half-space's normal", "1", normal.length(), |v| (v - 1.0).abs() < 1e-6)?;
            }
            Self::SmoothUnion { radius, .. } => {
                check_length("a smooth union's radius", *radius)?;
            }
            Self::Union(_) | Self::Intersection(_) | Self::Subtraction(_) => {}
        }
        self.parts().iter().try_for_each(Self::check)
    }
}

/// The sample where there is no shape.
const AIR: (f64, u8) = (f64::INFINITY, 0);

fn with(mut parts: Vec<Sdf>, other: Sdf) -> Vec<Sdf> {
    parts.push(other);
    parts
}

fn nearer(a: (f64, u8), b: (f64, u8)) -> (f64, u8) {
    if b.0 < a.0 { b } else { a }
}

/// The first part, cut by each other part's distance times `sign`: 1 for an intersection, −1 for a subtraction.
fn cut(parts: &[Sdf], position: DVec3, sign: f64) -> (f64, u8) {
    let Some((first, others)) = parts.split_first() else { return AIR };
    let (distance, material) = first.sample(position);
    let cut = others.iter().map(|part| sign * part.sample(position).0).fold(distance, f64::max);
    (cut, material)
}

impl Source for Sdf {
    fn fill(&self, region: &SourceRegion, distances: &mut [f32], materials: &mut [u8]) {
        let (center, radius) = ball_around(region);
        let shapes = if self.check().is_ok() { self.pruned(center, radius) } else { self.clone() };
        for ([y, z], distances, materials) in rows(region, distances, materials) {
            for ((x, distance), material) in (0u32..).zip(distances).zip(materials) {
                let sample = shapes.sample(region.position([x, y, z]).into());
                *distance = (sample.0 / region.spacing) as f32;
                if sample.0 < 0.0 {
                    *material = sample.1;
                }
            }
        }
    }

    fn bound(&self, region: &SourceRegion) -> Bound {
        let (center, radius) = ball_around(region);
        let far = radius + BOUND_MARGIN * region.spacing;
        let (distance, _) = self.sample(center);
        if self.check().is_err() {
            Bound::Mixed
        } else if distance > far {
            Bound::Outside
        } else if distance < -far
            && let Some(material) = self.pruned(center, radius).only_material()
        {
            Bound::Inside { material }
        } else {
            Bound::Mixed
        }
    }

    fn bound_closely(&self, region: &SourceRegion) -> Bound {
        // This bound already includes the margin of distance.
        self.bound(region)
    }
}

/// The middle and radius of the smallest ball that holds all samples of a region.
fn ball_around(region: &SourceRegion) -> (DVec3, f64) {
    let [x, y, z] = world_box(region);
    let [min, max] = [0, 1].map(|end| DVec3::new(x[end], y[end], z[end]));
    ((min + max) / 2.0, min.distance(max) / 2.0)
}
