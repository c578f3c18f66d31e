//! [`Closed`]: a layer of outside samples around the volume, so that the surface closes at its border.
//!
//! Each sample of the layer is as far from the isovalue as the nearest sample of the volume. So the walls lie half a
//! sample beyond the outermost samples, and normals are those of a surface that ends there. (Refused: one large number
//! all around. It would turn normals within the volume. Walls would meet in bevels of 1/1024 of a sample, which 32-bit
//! positions cannot resolve beyond 16,384 samples.)
//!
//! All weights become `f32`, since an integer type cannot negate its lowest number.

use marchless::Weight;

use crate::error::Error;

/// Slabs of the volume with the layer around them.
pub(crate) struct Closed {
    /// Samples along the two axes, without the layer.
    slab: [u32; 2],
    isovalue: f32,
    invert: bool,
    weights: Vec<f32>,
}

impl Closed {
    /// `slab`: samples along the two axes, from 2 to [`u32::MAX`] − 2. `isovalue`: the isovalue of the weights.
    /// `invert`: true if weights below it are outside.
    ///
    /// # Errors
    /// [`Error::Memory`].
    pub(crate) fn new(slab: [u32; 2], isovalue: f32, invert: bool) -> Result<Self, Error> {
        let mut weights = Vec::new();
        let [width, depth] = slab.map(|samples| samples as usize + 2);
        let reserved = width.checked_mul(depth).map(|samples| weights.try_reserve_exact(samples));
        match reserved {
            Some(Ok(())) => Ok(Self { slab, isovalue, invert, weights }),
            _ => Err(Error::Memory { slab }),
        }
    }

    /// Samples along the two axes, with the layer.
    pub(crate) fn size(&self) -> [u32; 2] {
        self.slab.map(|samples| samples + 2)
    }

    /// A slab and the layer around it, with an isovalue of 0.
    pub(crate) fn within<W: Weight>(&mut self, slab: &[W]) -> &[f32] {
        let [width, depth] = self.slab.map(|samples| samples as usize);
        let (isovalue, invert) = (self.isovalue, self.invert);
        self.weights.clear();
        for y in 0..depth + 2 {
            let nearest = y.saturating_sub(1).min(depth - 1);
            let row = &slab[nearest * width..][..width];
            let start = self.weights.len();
            // The difference of two numbers is 0 only where they are equal: no sample changes sides.
            let row = row[..1].iter().chain(row).chain(&row[width - 1..]);
            self.weights.extend(row.map(|weight| weight.to_voxels() - isovalue));
            let row = &mut self.weights[start..];
            if y == nearest + 1 {
                row[0] = outside(row[0], invert);
                row[width + 1] = outside(row[width + 1], invert);
            } else {
                row.iter_mut().for_each(|weight| *weight = outside(*weight, invert));
            }
        }
        &self.weights
    }

    /// The slab of the layer beyond the volume's first or last slab.
    pub(crate) fn beyond<W: Weight>(&mut self, slab: &[W]) -> &[f32] {
        self.within(slab);
        let invert = self.invert;
        self.weights.iter_mut().for_each(|weight| *weight = outside(*weight, invert));
        &self.weights
    }
}

/// A weight with the same distance from 0, but outside.
fn outside(weight: f32, invert: bool) -> f32 {
    const LEAST: f32 = f32::from_bits(1);
    // The mesher treats NaN as the largest number.
    let distance = if weight.is_nan() { f32::MAX } else { weight.abs().max(LEAST) };
    if invert { -distance } else { distance }
}
