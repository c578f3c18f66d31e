//! [`Transform`]: from the mesher's lattice to the user's space.

use marchless::MeshBuffer;

use crate::args::Args;
use crate::error::Error;
use crate::input::Volume;

/// The map from the mesher's lattice, whose axes are in the file's order, to positions: the origin plus the sample's
/// number times the spacing.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Transform {
    /// True if the file's fastest axis is z.
    z_fastest: bool,
    /// True if normals point to smaller values.
    invert: bool,
    spacing: [f64; 3],
    /// The first sample's position.
    origin: [f64; 3],
    /// Layers of samples around the volume.
    margin: f64,
}

impl Transform {
    /// # Errors
    /// [`Error::Spacing`] if the far end of the volume lies beyond 32-bit numbers, or if steps within a cell are too
    /// small for them; [`Error::Origin`] if the origin moves an end of the volume beyond 32-bit numbers.
    pub(crate) fn new(args: &Args, volume: &Volume) -> Result<Self, Error> {
        for axis in 0..3 {
            let (spacing, origin, samples) = (args.spacing[axis], args.origin[axis], volume.size[axis]);
            let far = f64::from(samples) * spacing;
            // Crossings stay 1/1024 of an edge apart.
            if far > f64::from(f32::MAX) || spacing / 1024.0 < f64::from(f32::MIN_POSITIVE) {
                return Err(Error::Spacing { spacing, samples });
            }
            if [origin - spacing, origin + far].iter().any(|end| end.abs() > f64::from(f32::MAX)) {
                return Err(Error::Origin { origin, samples });
            }
        }
        let (spacing, origin, margin) = (args.spacing, args.origin, f64::from(args.margin()));
        Ok(Self { z_fastest: volume.z_fastest, invert: args.invert, spacing, origin, margin })
    }

    /// Transforms a piece of the mesh.
    pub(crate) fn apply(&self, mesh: &mut MeshBuffer) {
        for position in &mut mesh.positions {
            *position = self.position(*position);
        }
        for normal in &mut mesh.normals {
            *normal = self.normal(self.ordered(*normal));
        }
        // Exchanging two axes is a reflection, which turns triangles over, too.
        if self.invert != self.z_fastest {
            for triangle in mesh.indices.as_chunks_mut::<3>().0 {
                triangle.swap(1, 2);
            }
        }
    }

    /// The positions of samples of the mesher's lattice, rounded exactly like those of vertices.
    pub(crate) fn corners(&self, samples: [[u32; 3]; 2]) -> [[f32; 3]; 2] {
        samples.map(|sample| self.position(sample.map(|v| v as f32)))
    }

    fn position(&self, lattice: [f32; 3]) -> [f32; 3] {
        let lattice = self.ordered(lattice);
        [0, 1, 2].map(|axis| {
            let sample = f64::from(lattice[axis]) - self.margin;
            (sample * self.spacing[axis] + self.origin[axis]) as f32
        })
    }

    /// The vector in the order x, y, z.
    fn ordered(&self, [a, b, c]: [f32; 3]) -> [f32; 3] {
        if self.z_fastest { [c, b, a] } else { [a, b, c] }
    }

    /// The transformed normal. It is a gradient, a difference per distance, so wider spacing makes it smaller.
    fn normal(&self, normal: [f32; 3]) -> [f32; 3] {
        let normal = if self.invert { normal.map(|v| -v) } else { normal };
        let [x, y, z] = self.spacing;
        if x == y && y == z {
            return normal;
        }
        // Relative to the smallest spacing, so that nothing overflows and the largest part of it stays.
        let least = x.min(y).min(z);
        let gradient = [0, 1, 2].map(|axis| f64::from(normal[axis]) * (least / self.spacing[axis]));
        let length = gradient.iter().map(|v| v * v).sum::<f64>().sqrt();
        gradient.map(|v| (v / length) as f32)
    }
}
