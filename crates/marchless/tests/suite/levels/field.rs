//! [`Field`]: samples for every lattice point and level, as different from level to level as they may be.

use fastrand::Rng;
use marchless::{FinerNeighbours, LeafError, LeafSamples, Samples, Shape, cell::Face};

use super::cover::{Cover, Leaf};
use crate::support::{TestWeight, random};

/// A field of samples, with air on and beyond the border of the box.
#[derive(Clone, Debug)]
pub(super) struct Field<W> {
    kind: Kind<W>,
    seed: u64,
    pub(super) isovalue: f32,
}

#[derive(Clone, Debug)]
enum Kind<W> {
    /// White noise of these weights, unlike at each level.
    Noise(Vec<W>),
    /// A plane, whose offset differs a little from level to level.
    Plane { slope: [f32; 3], offset: f32, jump: f32 },
    /// Rolling ground, which differs from level to level by up to half a voxel.
    Hills,
}

impl<W: TestWeight> Field<W> {
    pub(super) fn random(random: &mut Rng) -> Self {
        let seed = random.u64(..);
        let kind = match random.u8(..8) {
            0..3 => Kind::Noise(W::NEAR_ZERO.to_vec()),
            3 => Kind::Noise([&[W::OUTSIDE; 12], W::NEAR_ZERO].concat()),
            4 => Kind::Noise([W::NEAR_ZERO, W::EXTREMES].concat()),
            5 => Kind::Noise((0..64).map(|_| W::from_voxels((random.f32() - 0.5) * 4.0)).collect()),
            _ => return Self::plane(random),
        };
        let isovalue = if random.bool() { 0.0 } else { random.f32() - 0.5 };
        Self { kind, seed, isovalue }
    }

    pub(super) fn plane(random: &mut Rng) -> Self {
        let slope = [(); 3].map(|()| if random.u8(..3) == 0 { 0.0 } else { random.f32() * 2.0 - 1.0 });
        let offset = -(0..3).map(|axis| slope[axis] * 8.0 * random.f32()).sum::<f32>();
        let jump = if random.bool() { 0.0 } else { 0.4 };
        Self { kind: Kind::Plane { slope, offset, jump }, seed: 0, isovalue: 0.0 }
    }

    pub(super) const fn is_plane(&self) -> bool {
        matches!(self.kind, Kind::Plane { .. })
    }

    pub(super) const fn hills() -> Self {
        Self { kind: Kind::Hills, seed: 0, isovalue: 0.0 }
    }

    /// Whether all samples of a box of voxels, borders included, are outside, or all inside if that may be, at all
    /// levels.
    pub(super) fn is_empty(&self, min: [i32; 3], max: [i32; 3], may_be_inside: bool) -> bool {
        let mut columns = (min[2]..=max[2]).flat_map(|z| (min[0]..=max[0]).map(move |x| [x, z]));
        let is_within =
            |[x, z]: [i32; 2], y: i32, from: f32, to: f32| (from..to).contains(&self.at([x, y, z], 0).0.to_voxels());
        columns.clone().all(|column| is_within(column, min[1], 3.0, f32::MAX))
            || may_be_inside && columns.all(|column| is_within(column, max[1], f32::MIN, -3.0))
    }

    /// Level ground at this height.
    pub(super) fn ground(height: f32) -> Self {
        let kind = Kind::Plane { slope: [0.0, 0.0, 1.0], offset: -height, jump: 0.0 };
        Self { kind, seed: 0, isovalue: 0.0 }
    }

    /// The sample of a lattice point at a level.
    fn at(&self, point: [i32; 3], level: u8) -> (W, u8) {
        let mut random = Rng::with_seed(random(self.seed ^ u64::from(level) << 40, point));
        let material = random.u8(..4);
        let weight = match &self.kind {
            Kind::Noise(weights) => weights[random.usize(..weights.len())],
            Kind::Plane { slope, offset, jump } => {
                let distance = (0..3).map(|axis| slope[axis] * point[axis] as f32).sum::<f32>() + offset;
                W::from_voxels(distance + jump * f32::from(level))
            }
            Kind::Hills => {
                let [x, y, z] = point.map(|v| v as f32);
                let ground = 24.0 + 9.0 * (x / 11.0).sin() + 6.0 * (z / 8.0).cos() + 2.0 * ((x + z) / 3.0).sin();
                W::from_voxels(y - ground + random.f32() * f32::from(level.min(1)) / 2.0)
            }
        };
        (weight, material)
    }

    /// The samples from which a leaf is meshed.
    pub(super) fn block(&self, cover: &Cover, leaf: Leaf) -> Block<W> {
        // A leaf of this level sees a point's finest sample where a finer leaf touches it, and its own level's elsewhere.
        let sampled = |min: [i32; 3], size: [u32; 3], step: i32, level: u8| {
            let shape = Shape::new(size).expect("a leaf's samples are few");
            let [nx, ny, _] = size.map(|size| size as i32);
            let (weights, materials) = (0..shape.len() as i32)
                .map(|i| [i % nx, i / nx % ny, i / (nx * ny)])
                .map(|at| [0, 1, 2].map(|axis| min[axis] + step * at[axis]))
                .map(|point| match cover.finest(point) {
                    Some(finest) => self.at(point, finest.min(level)),
                    None => (W::OUTSIDE, 0),
                })
                .unzip();
            SampleBox { shape, weights, materials }
        };
        let step = 1 << leaf.level;
        let own = sampled(leaf.min.map(|v| v - step), [cover.cells as u32 + 3; 3], step, leaf.level);
        let is_finer =
            |direction| cover.neighbour(&leaf, direction).is_some_and(|neighbour| neighbour.level < leaf.level);
        let finer = FinerNeighbours::from_fn(is_finer);
        let faces = Face::ALL.map(|face| {
            finer.contains_face(face).then(|| {
                let half = step / 2;
                let (mut min, mut size) = (leaf.min.map(|v| v - half), [2 * cover.cells as u32 + 3; 3]);
                size[face.axis()] = 3;
                min[face.axis()] += if face.is_high() { cover.width(&leaf) } else { 0 };
                sampled(min, size, half, leaf.level - 1)
            })
        });
        Block { own, finer, faces }
    }
}

/// A box of samples.
pub(super) struct SampleBox<W> {
    pub(super) shape: Shape,
    pub(super) weights: Vec<W>,
    pub(super) materials: Vec<u8>,
}

impl<W: TestWeight> SampleBox<W> {
    pub(super) fn samples(&self) -> Samples<'_, W> {
        let samples = Samples::new(self.shape, &self.weights).expect("one weight a sample");
        samples.with_materials(&self.materials).expect("one material a sample")
    }
}

/// The samples of a leaf.
pub(super) struct Block<W> {
    pub(super) own: SampleBox<W>,
    pub(super) finer: FinerNeighbours,
    pub(super) faces: [Option<SampleBox<W>>; 6],
}

impl<W: TestWeight> Block<W> {
    pub(super) fn samples(&self) -> Samples<'_, W> {
        self.own.samples().padded()
    }

    pub(super) fn leaf(&self) -> Result<LeafSamples<'_, W>, LeafError> {
        LeafSamples::new(self.samples(), self.finer, self.faces.each_ref().map(|f| f.as_ref().map(SampleBox::samples)))
    }
}
