//! What the fuzz targets share: volumes and leaves made from a fuzzer's bytes, and meshes down to the last bit; plain
//! grids of bits.

mod leaves;
mod plain;

use libfuzzer_sys::arbitrary::{Arbitrary, Result, Unstructured};
use marchless::{MeshBuffer, MeshSettings, Samples, Shape, Topology, Weight};

pub use leaves::{Block, Leaf, Leaves, SampleBox};
pub use plain::{Plain, neighbours, points};

/// Every volume is meshed with both.
pub const TOPOLOGIES: [Topology; 2] = [Topology::Separated, Topology::Trilinear];

/// Samples of a small volume, and how to mesh them.
#[derive(Clone, Debug)]
pub struct Volume<W> {
    /// All samples per axis, padding included: up to 140 along one axis, up to 5 along the others.
    pub shape: Shape,
    /// In memory of just their size, so that AddressSanitizer sees a read behind the last one.
    pub weights: Box<[W]>,
    /// As many, or none.
    pub materials: Option<Box<[u8]>>,
    /// Whether the outermost layer is padding.
    pub padded: bool,
    /// Any at all; often one of the weights, often not finite.
    pub isovalue: f32,
    /// Whether to compute normals.
    pub normals: bool,
}

impl<W: FuzzWeight> Volume<W> {
    /// The samples, as the mesher takes them.
    pub fn samples(&self) -> Samples<'_, W> {
        let mut samples = Samples::new(self.shape, &self.weights).expect("one weight a sample");
        if let Some(materials) = &self.materials {
            samples = samples.with_materials(materials).expect("one material a sample");
        }
        if self.padded { samples.padded() } else { samples }
    }

    /// How to mesh them.
    pub fn settings(&self, topology: Topology) -> MeshSettings {
        MeshSettings { isovalue: self.isovalue, normals: self.normals, topology }
    }
}

impl<'a, W: FuzzWeight> Arbitrary<'a> for Volume<W> {
    fn arbitrary(u: &mut Unstructured<'a>) -> Result<Self> {
        let mut size = [u.int_in_range(1..=140)?, u.int_in_range(1..=5)?, u.int_in_range(1..=5)?];
        size.rotate_right(u.int_in_range(0..=2)?);
        let shape = Shape::new(size).expect("the size is small");
        let [padded, normals, has_materials, shuffled] = u.arbitrary()?;
        let seed: u32 = u.arbitrary()?;
        let (iso_kind, iso_bits) = (u.int_in_range(0..=3)?, u.arbitrary()?);

        let given: Vec<W> = any_weights(u, shape.len())?;
        let mut random = seed | 1;
        let weights = (0..shape.len())
            .map(|index| {
                random = xorshift(random);
                given[if shuffled { random as usize } else { index } % given.len()]
            })
            .collect();
        let materials = has_materials.then(|| (0..shape.len()).map(|index| index as u8).collect());
        let isovalue = any_isovalue(iso_kind, iso_bits, &given);
        Ok(Self { shape, weights, materials, padded, isovalue, normals })
    }
}

/// As many weights as there are bytes for, which is all of a small volume's; they are repeated in the others.
fn any_weights<W: FuzzWeight>(u: &mut Unstructured<'_>, most: usize) -> Result<Vec<W>> {
    let mut given = vec![weight(u)?];
    while !u.is_empty() && given.len() < most {
        given.push(weight(u)?);
    }
    Ok(given)
}

/// Any isovalue; by `kind` zero, one of the weights, a few voxels, or any number.
fn any_isovalue<W: FuzzWeight>(kind: u8, bits: u32, given: &[W]) -> f32 {
    match kind % 4 {
        0 => 0.0,
        1 => given[bits as usize % given.len()].to_voxels(),
        2 => f32::from(bits as i8) / 16.0,
        _ => f32::from_bits(bits),
    }
}

/// Any weight: a distance of a few voxels, any bits, or a limit.
fn weight<W: FuzzWeight>(u: &mut Unstructured<'_>) -> Result<W> {
    let kind: u8 = u.arbitrary()?;
    Ok(match kind % 4 {
        0 | 1 => W::from_voxels(f32::from(u.arbitrary::<i8>()?) / 16.0),
        2 => W::from_bytes(u.arbitrary()?),
        _ => W::LIMITS[usize::from(kind / 4) % W::LIMITS.len()],
    })
}

fn xorshift(mut random: u32) -> u32 {
    random ^= random << 13;
    random ^= random >> 17;
    random ^ random << 5
}

/// Weights to be made from bytes.
pub trait FuzzWeight: Weight {
    /// What a fuzzer should not need luck to find.
    const LIMITS: &'static [Self];
    /// Any weight that there is.
    fn from_bytes(bytes: [u8; 4]) -> Self;
}

impl FuzzWeight for i8 {
    const LIMITS: &'static [Self] = &[Self::MIN, Self::MAX];

    fn from_bytes([byte, ..]: [u8; 4]) -> Self {
        Self::from_le_bytes([byte])
    }
}

impl FuzzWeight for i16 {
    const LIMITS: &'static [Self] = &[Self::MIN, Self::MAX];

    fn from_bytes([low, high, ..]: [u8; 4]) -> Self {
        Self::from_le_bytes([low, high])
    }
}

impl FuzzWeight for f32 {
    const LIMITS: &'static [Self] =
        &[Self::NAN, Self::INFINITY, Self::NEG_INFINITY, Self::MIN, Self::MAX, -0.0, 1e-42, -1e-42, 1e20, -1e20];

    fn from_bytes(bytes: [u8; 4]) -> Self {
        Self::from_le_bytes(bytes)
    }
}

/// A volume of any of the three types.
#[derive(Debug)]
pub enum AnyVolume {
    /// Weights of 8 bits.
    I8(Volume<i8>),
    /// Weights of 16 bits.
    I16(Volume<i16>),
    /// Floating-point weights.
    F32(Volume<f32>),
}

impl<'a> Arbitrary<'a> for AnyVolume {
    fn arbitrary(u: &mut Unstructured<'a>) -> Result<Self> {
        Ok(match u.int_in_range(0..=3)? {
            0 => Self::I8(u.arbitrary()?),
            1 => Self::I16(u.arbitrary()?),
            // There is more to go wrong.
            _ => Self::F32(u.arbitrary()?),
        })
    }
}

/// A mesh down to the last bit, signs of zeros and all.
#[derive(Debug, Default, PartialEq)]
pub struct Bits {
    positions: Vec<[u32; 3]>,
    normals: Vec<[u32; 3]>,
    materials: Vec<u8>,
    indices: Vec<u32>,
    bounds: Option<[[u32; 3]; 2]>,
}

impl Bits {
    /// The bits of `mesh`.
    pub fn of(mesh: &MeshBuffer) -> Self {
        let vectors = |vectors: &[[f32; 3]]| vectors.iter().map(|vector| vector.map(f32::to_bits)).collect();
        Self {
            positions: vectors(&mesh.positions),
            normals: vectors(&mesh.normals),
            materials: mesh.materials.clone(),
            indices: mesh.indices.clone(),
            bounds: mesh.bounds.map(|bounds| bounds.map(|corner| corner.map(f32::to_bits))),
        }
    }
}
