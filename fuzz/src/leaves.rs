//! Leaves of two levels that fill a box, with samples for every lattice point and level.

use libfuzzer_sys::arbitrary::{Arbitrary, Result, Unstructured};
use marchless::{FinerNeighbours, LeafError, LeafSamples, MeshSettings, Samples, Shape, Topology, cell::Face};

use super::{FuzzWeight, any_isovalue, any_weights, points, xorshift};

/// A box of 2³ or 3³ places, each of them one leaf of level 1, or eight of level 0. Lattice points and widths are in
/// voxels of level 0, from the corner of the box.
#[derive(Clone, Debug)]
pub struct Leaves<W> {
    /// Cells of a leaf per axis.
    pub cells: [u32; 3],
    /// Places per axis.
    places: u32,
    /// A bit for each place, x fastest: whether its leaves are of level 0.
    finer: u32,
    /// What the samples are made of.
    given: Box<[W]>,
    /// Mixes what is given; 0: the samples are in its order.
    seed: u32,
    has_materials: bool,
    /// Any at all; often one of the weights, often not finite.
    pub isovalue: f32,
    /// Whether to compute normals.
    pub normals: bool,
}

/// A leaf of a box.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Leaf {
    /// Its lowest lattice point.
    pub min: [i32; 3],
    /// Its level, 0 or 1.
    pub level: u8,
}

impl<'a, W: FuzzWeight> Arbitrary<'a> for Leaves<W> {
    fn arbitrary(u: &mut Unstructured<'a>) -> Result<Self> {
        let cells = [u.int_in_range(1..=4)?, u.int_in_range(1..=4)?, u.int_in_range(1..=4)?];
        // All that can be around a point is in 2³ places; a leaf with all of its neighbours takes 3³.
        let places = if u.ratio(3, 4)? { 2 } else { 3 };
        let finer = u.arbitrary()?;
        let [has_materials, normals, shuffled] = u.arbitrary()?;
        let seed = if shuffled { u.arbitrary::<u32>()? | 1 } else { 0 };
        let (iso_kind, iso_bits) = (u.arbitrary()?, u.arbitrary()?);
        let given = any_weights(u, 2 * cells.iter().map(|cells| (2 * places * cells) as usize).product::<usize>())?;
        let isovalue = any_isovalue(iso_kind, iso_bits, &given);
        Ok(Self { cells, places, finer, given: given.into(), seed, has_materials, isovalue, normals })
    }
}

impl<W: FuzzWeight> Leaves<W> {
    /// All leaves.
    pub fn all(&self) -> impl Iterator<Item = Leaf> {
        points([2 * self.places; 3])
            .map(|chunk| (chunk, self.level(chunk)))
            .filter(|(chunk, level)| chunk.iter().all(|v| v % (1 << level) == 0))
            .map(|(chunk, level)| Leaf { min: [0, 1, 2].map(|axis| (chunk[axis] * self.cells[axis]) as i32), level })
    }

    /// How to mesh them.
    pub fn settings(&self, topology: Topology) -> MeshSettings {
        MeshSettings { isovalue: self.isovalue, normals: self.normals, topology }
    }

    /// The level of the leaf at a chunk of level 0.
    fn level(&self, chunk: [u32; 3]) -> u8 {
        let [x, y, z] = chunk.map(|v| v / 2);
        u8::from(self.finer >> (x + self.places * (y + self.places * z)) & 1 == 0)
    }

    /// The level at the cell of level 0 above a lattice point; `None` outside the box.
    fn level_at(&self, cell: [i32; 3]) -> Option<u8> {
        let chunk = [0, 1, 2].map(|axis| cell[axis].div_euclid(self.cells[axis] as i32));
        let within = chunk.iter().all(|v| (0..2 * self.places as i32).contains(v));
        within.then(|| self.level(chunk.map(|v| v as u32)))
    }

    /// The level of the finest leaf that touches a lattice point; `None` on or beyond the border of the box.
    fn finest(&self, point: [i32; 3]) -> Option<u8> {
        let octants = (0..8).map(|octant| [0, 1, 2].map(|axis| point[axis] - (octant >> axis & 1)));
        octants.map(|cell| self.level_at(cell)).min().flatten()
    }

    /// Whether the neighbour in a direction is finer.
    fn is_finer(&self, leaf: Leaf, direction: [i32; 3]) -> bool {
        let beside = [0, 1, 2].map(|axis| match direction[axis] {
            1 => leaf.min[axis] + self.width(leaf)[axis],
            step => leaf.min[axis] + step,
        });
        self.level_at(beside).is_some_and(|level| level < leaf.level)
    }

    /// The width of a leaf.
    fn width(&self, leaf: Leaf) -> [i32; 3] {
        self.cells.map(|cells| (cells << leaf.level) as i32)
    }

    /// The weight and material of a lattice point at a level. The border of the box is air, and so is all beyond it.
    fn at(&self, point: [i32; 3], level: u8) -> (W, u8) {
        let Some(finest) = self.finest(point) else { return (W::OUTSIDE, 0) };
        let [nx, ny, nz] = self.cells.map(|cells| (2 * self.places * cells) as i32);
        let index = point[0] + nx * (point[1] + ny * (point[2] + nz * i32::from(finest.min(level))));
        let index = if self.seed == 0 { index as u32 } else { xorshift(xorshift(self.seed ^ index as u32)) };
        (self.given[index as usize % self.given.len()], index as u8 % 4)
    }

    /// The samples from which a leaf is meshed.
    pub fn block(&self, leaf: Leaf) -> Block<W> {
        let sampled = |min: [i32; 3], size: [u32; 3], step: i32, level: u8| {
            let points = points(size).map(|at| [0, 1, 2].map(|axis| min[axis] + step * at[axis] as i32));
            let (weights, materials): (Vec<W>, Vec<u8>) = points.map(|point| self.at(point, level)).unzip();
            let shape = Shape::new(size).expect("a leaf's samples are few");
            let materials = self.has_materials.then(|| materials.into());
            SampleBox { shape, weights: weights.into(), materials, padded: false }
        };
        let step = 1 << leaf.level;
        let mut own = sampled(leaf.min.map(|v| v - step), self.cells.map(|cells| cells + 3), step, leaf.level);
        own.padded = true;
        let finer = FinerNeighbours::from_fn(|direction| self.is_finer(leaf, direction));
        let faces = Face::ALL.map(|face| {
            finer.contains_face(face).then(|| {
                let axis = face.axis();
                let (mut min, mut size) = (leaf.min.map(|v| v - 1), self.cells.map(|cells| 2 * cells + 3));
                min[axis] += if face.is_high() { self.width(leaf)[axis] } else { 0 };
                size[axis] = 3;
                sampled(min, size, 1, 0)
            })
        });
        Block { own, finer, faces }
    }
}

/// A box of samples.
#[derive(Clone, Debug)]
pub struct SampleBox<W> {
    /// Samples per axis.
    pub shape: Shape,
    /// In memory of just their size, so that AddressSanitizer sees a read behind the last one.
    pub weights: Box<[W]>,
    /// As many, or none.
    pub materials: Option<Box<[u8]>>,
    /// Whether the outermost layer is padding.
    pub padded: bool,
}

impl<W: FuzzWeight> SampleBox<W> {
    /// The samples, as the mesher takes them.
    pub fn samples(&self) -> Samples<'_, W> {
        let mut samples = Samples::new(self.shape, &self.weights).expect("one weight a sample");
        if let Some(materials) = &self.materials {
            samples = samples.with_materials(materials).expect("one material a sample");
        }
        if self.padded { samples.padded() } else { samples }
    }
}

/// What a leaf is meshed from.
#[derive(Clone, Debug)]
pub struct Block<W> {
    /// The leaf's own samples.
    pub own: SampleBox<W>,
    /// Its finer neighbours.
    pub finer: FinerNeighbours,
    /// The finer samples, by face.
    pub faces: [Option<SampleBox<W>>; 6],
}

impl<W: FuzzWeight> Block<W> {
    /// The samples of the leaf, checked.
    pub fn leaf(&self) -> Result<LeafSamples<'_, W>, LeafError> {
        let faces = self.faces.each_ref().map(|face| face.as_ref().map(SampleBox::samples));
        LeafSamples::new(self.own.samples(), self.finer, faces)
    }
}
