//! [`KnownSigns`]: the samples of a chunk that are known to lie on one side of the surface.

use marchless::{GridChunk, Weight as _};

/// The side of the surface on which a chunk's samples lie: for its lowest layer along each axis, and for all samples.
/// `true`: inside; `None`: on both sides, or not known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct KnownSigns {
    lowest: [Option<bool>; 3],
    all: Option<bool>,
    /// The isovalue for which the signs hold.
    isovalue: f32,
}

impl KnownSigns {
    pub(crate) const UNKNOWN: Self = Self { lowest: [None; 3], all: None, isovalue: 0.0 };

    /// The signs, if they hold for this isovalue; else unknown ones.
    pub(crate) fn at(self, isovalue: f32) -> Self {
        if self.isovalue == isovalue { self } else { Self::UNKNOWN }
    }

    /// The signs of a chunk's samples.
    pub(crate) fn of(chunk: &GridChunk<i16>, isovalue: f32) -> Self {
        match chunk {
            GridChunk::Uniform(voxel) => {
                let inside = Some(voxel.weight.to_voxels() < isovalue);
                Self { lowest: [inside; 3], all: inside, isovalue }
            }
            GridChunk::Samples(samples) => {
                let weights = &samples.weights[..];
                let cells = (1..).take_while(|n| n * n * n <= weights.len()).last().unwrap_or(0);
                if cells == 0 {
                    return Self::UNKNOWN;
                }
                let side = |mut weights: &mut dyn Iterator<Item = &i16>| {
                    let first = weights.next()?.to_voxels() < isovalue;
                    (&mut weights).all(|weight| (weight.to_voxels() < isovalue) == first).then_some(first)
                };
                let layer = cells * cells;
                Self {
                    lowest: [
                        side(&mut weights.iter().step_by(cells)),
                        side(&mut weights.chunks(layer).flat_map(|layer| &layer[..cells.min(layer.len())])),
                        side(&mut weights[..layer].iter()),
                    ],
                    all: side(&mut weights.iter()),
                    isovalue,
                }
            }
        }
    }

    /// Whether the chunk may have samples on both sides.
    pub(crate) const fn may_have_surface(&self) -> bool {
        self.all.is_none()
    }

    /// Whether no cell of the chunk has a surface, by its own signs and those of the chunks behind it. `behind(step)`:
    /// the signs of the chunk one step behind along the axes whose step is 1; `None` if unknown.
    pub(crate) fn are_without_surface(&self, behind: impl Fn([i32; 3]) -> Option<Self>) -> bool {
        let Some(inside) = self.all else { return false };
        (1..8).all(|step| {
            let step = [step & 1, step >> 1 & 1, step >> 2];
            let Some(signs) = behind(step) else { return false };
            // Only the samples that are lowest along all these axes matter; each of the layers has them.
            (0..3).any(|axis| step[axis] == 1 && signs.lowest[axis] == Some(inside))
        })
    }
}

#[cfg(test)]
mod tests {
    use marchless::{Grid, MeshBuffer, MeshSettings, Mesher, Region};
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn chunks_without_surface_have_no_triangles(
            normal in prop::array::uniform3(-1.0..1.0f64),
            offset in -20.0..20.0f64,
        ) {
            let plane = move |p: [f64; 3]| (0..3).map(|i| p[i] * normal[i]).sum::<f64>() + offset;
            let mut grid = Grid::<i16>::new(8).unwrap();
            let all = Region::new([-1; 3], [3; 3]);
            for position in all.points() {
                grid.fill(position, &plane, 1.0).unwrap();
            }
            let signs = |position: [i32; 3]| grid.chunk(position).map(|chunk| KnownSigns::of(chunk, 0.0));
            let (mut mesher, mut mesh) = (Mesher::new(), MeshBuffer::new());
            for position in Region::new([0; 3], [2; 3]).points() {
                grid.mesh_chunk(position, &mut mesher, MeshSettings::default(), &mut mesh).unwrap();
                let behind = |step: [i32; 3]| signs([0, 1, 2].map(|i| position[i] + step[i]));
                let without = signs(position).unwrap().are_without_surface(behind);
                prop_assert!(!without || mesh.is_empty());
            }
        }
    }

    #[test]
    fn flat_ground_has_its_surface_in_one_layer_of_chunks() {
        let signs =
            |y: i32| KnownSigns::of(&GridChunk::from_source(&|[_, y, _]: [f64; 3]| y - 12.0, [0, y, 0], 8, 1.0), 0.0);
        let without = |y: i32| signs(y).are_without_surface(|step| Some(signs(y + step[1])));
        assert_eq!([-1, 0, 1, 2, 3].map(without), [true, true, false, true, true]);
    }

    #[test]
    fn signs_of_layers() {
        let n = 8;
        let weights = |f: &dyn Fn(usize, usize, usize) -> i16| {
            let mut weights = Vec::new();
            for z in 0..n {
                for y in 0..n {
                    weights.extend((0..n).map(|x| f(x, y, z)));
                }
            }
            GridChunk::from_samples(weights, vec![0; n * n * n], n as u32).unwrap()
        };
        let y_lowest = KnownSigns::of(&weights(&|_, y, _| if y == 0 { -5 } else { 5 }), 0.0);
        assert_eq!(y_lowest, KnownSigns { lowest: [None, Some(true), None], all: None, isovalue: 0.0 });
        let one = KnownSigns::of(&weights(&|x, y, z| if [x, y, z] == [3, 2, 0] { -5 } else { 5 }), 0.0);
        assert_eq!(one, KnownSigns { lowest: [Some(false), Some(false), None], all: None, isovalue: 0.0 });
        let none = KnownSigns::of(&weights(&|x, _, _| 5 + x as i16), 0.0);
        assert_eq!(none, KnownSigns { lowest: [Some(false); 3], all: Some(false), isovalue: 0.0 });
        assert_eq!(KnownSigns::of(&GridChunk::AIR, 0.0), none);
    }
}
