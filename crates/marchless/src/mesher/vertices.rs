//! Pass 2: one vertex for each crossing of a slab, with its position, normal and material.
//!
//! The crossings of many rows are listed first, so that what follows are long loops without branches: one that copies what
//! each vertex is made of from the samples to arrays, and one that computes sixteen vertices side by side.

use core::mem::MaybeUninit;

use super::{
    MeshSettings,
    output::{Bounds, keep, room},
    slabs::{Lattice, at},
};
use crate::{
    buffer::MeshBuffer,
    math::{sqrt, sqrt_f64},
    sample::Weight,
    simd::Simd,
};

/// Crossings stay this far from the ends of their edge.
const MARGIN: f32 = 1.0 / 1024.0;

/// Crossings that are gathered before they become vertices.
const GATHERED: usize = 128;
/// Room for them, the rest of the word that makes them enough, and sixteen side by side.
const ROOM: usize = GATHERED + 64;

/// The samples that edges of one axis need: whole slabs, padding included.
#[derive(Clone, Copy)]
pub(super) struct Planes<'a, W> {
    /// The slab below the edges, those of their low and their high ends (the same for edges along x and y), and the one
    /// above. At an open border the outermost one stands in for what is missing.
    pub(super) slabs: [&'a [W]; 4],
    /// Whether the gradient along z is one-sided at the low, and at the high ends.
    pub(super) one_sided: [bool; 2],
    /// The materials of the low and the high ends' slabs, where there are any.
    pub(super) materials: Option<[&'a [u8]; 2]>,
    /// The low ends' lattice position along z.
    pub(super) z: usize,
}

/// Gathers crossings and turns them into vertices.
pub(super) struct Vertices<W: Weight> {
    /// Of all vertices made.
    pub(super) bounds: Bounds,
    gathered: usize,
    x: [u32; ROOM],
    y: [u32; ROOM],
    /// The weights at the edges' ends.
    ends: [[W::Wide; ROOM]; 2],
    /// Twice the gradients there.
    gradients: [[[W::Wide; ROOM]; 3]; 2],
}

impl<W: Weight> Vertices<W> {
    pub(super) fn new() -> Self {
        let none = [W::Wide::default(); ROOM];
        Self {
            bounds: Bounds::NONE,
            gathered: 0,
            x: [0; ROOM],
            y: [0; ROOM],
            ends: [none; 2],
            gradients: [[none; 3]; 2],
        }
    }

    /// Makes the vertices on all edges along `AXIS`, row by row, and returns how many there are. `low` and `high`: the signs of the edges' ends.
    #[inline(always)]
    pub(super) fn place<S: Simd, const AXIS: usize>(
        &mut self,
        lattice: &Lattice,
        planes: &Planes<'_, W>,
        settings: &MeshSettings,
        low: &[u64],
        high: &[u64],
        out: &mut MeshBuffer,
    ) -> u64 {
        let mut made = 0;
        let mut crossed = [0; 64];
        for (block, (low, high)) in low.chunks(64).zip(high.chunks(64)).enumerate() {
            for (crossed, (low, high)) in crossed.iter_mut().zip(low.iter().zip(high)) {
                *crossed = low ^ high;
            }
            let mut words = S::nonzero(filled(&mut crossed, low.len()));
            while words != 0 {
                let word = words.trailing_zeros() as usize;
                words &= words - 1;
                let (y, x) = lattice.place_of(64 * block + word);
                let (xs, ys) = (&mut self.x[self.gathered..], &mut self.y[self.gathered..]);
                let (xs, ys) =
                    xs.first_chunk_mut().zip(ys.first_chunk_mut()).expect("there is room for another word's");
                self.gathered += S::positions(crossed[word % 64], x, y, xs, ys);
                if self.gathered >= GATHERED {
                    made += self.flush::<AXIS>(lattice, planes, settings, out);
                }
            }
        }
        made + self.flush::<AXIS>(lattice, planes, settings, out)
    }

    #[inline(always)]
    fn flush<const AXIS: usize>(
        &mut self,
        lattice: &Lattice,
        planes: &Planes<'_, W>,
        settings: &MeshSettings,
        out: &mut MeshBuffer,
    ) -> u64 {
        let count = self.gathered;
        self.gathered = 0;
        if count == 0 {
            return 0;
        }
        if lattice.padded {
            self.gather::<AXIS, true>(lattice, planes, settings, count);
        } else {
            self.gather::<AXIS, false>(lattice, planes, settings, count);
        }
        let isovalue = settings.isovalue * W::SCALE;
        let side_by_side = count.next_multiple_of(16);
        let positions = &mut room(&mut out.positions, side_by_side)[..side_by_side];
        let sound = if settings.normals {
            let normals = &mut room(&mut out.normals, side_by_side)[..side_by_side];
            self.finish::<AXIS, true>(planes.z, isovalue, count, positions, normals)
        } else {
            self.finish::<AXIS, false>(planes.z, isovalue, count, positions, &mut [])
        };
        if !sound {
            self.mend::<AXIS>(lattice, planes, settings, count, out);
        }
        // SAFETY: `finish` has written all of them.
        #[expect(unsafe_code, reason = "spares filling the vectors with zeros first")]
        unsafe {
            keep(&mut out.positions, count);
            if settings.normals {
                keep(&mut out.normals, count);
            }
        }
        if let Some(materials) = planes.materials {
            let threshold = W::threshold(settings.isovalue);
            out.materials.extend(self.x[..count].iter().zip(&self.y[..count]).map(|(&x, &y)| {
                let low = lattice.index(x, y);
                if planes.slabs[1][low].inside(threshold) {
                    materials[0][low]
                } else {
                    materials[1][low + lattice.step::<AXIS>()]
                }
            }));
        }
        count as u64
    }

    /// Copies what the first `count` vertices are made of.
    #[inline(always)]
    fn gather<const AXIS: usize, const PADDED: bool>(
        &mut self,
        lattice: &Lattice,
        planes: &Planes<'_, W>,
        settings: &MeshSettings,
        count: usize,
    ) {
        let [below, low, high, above] = planes.slabs;
        assert!(planes.slabs.iter().all(|slab| slab.len() == lattice.len), "all slabs are whole");
        // Along z an end's neighbours lie in other slabs.
        let (next_to_low, next_to_high) = if AXIS == 2 { (high, low) } else { (above, below) };
        let [one_sided_low, one_sided_high] = planes.one_sided;
        let (xs, ys) = (&self.x[..count], &self.y[..count]);
        let [low_ends, high_ends] = &mut self.ends;
        let (low_ends, high_ends) = (&mut low_ends[..count], &mut high_ends[..count]);
        let [[ax, ay, az], [bx, by, bz]] = &mut self.gradients;
        let (ax, ay, az) = (&mut ax[..count], &mut ay[..count], &mut az[..count]);
        let (bx, by, bz) = (&mut bx[..count], &mut by[..count], &mut bz[..count]);
        for i in 0..count {
            let (x, y) = (xs[i], ys[i]);
            let a = lattice.index(x, y);
            let b = a + lattice.step::<AXIS>();
            let (xb, yb) = (x + u32::from(AXIS == 0), y + u32::from(AXIS == 1));
            // SAFETY: the slabs are whole, and both ends of a crossing are meshed samples.
            #[expect(unsafe_code, reason = "a dozen reads a vertex, in the loop that takes most of the time")]
            unsafe {
                low_ends[i] = at(low, a).wide();
                high_ends[i] = at(high, b).wide();
                if settings.normals {
                    [ax[i], ay[i], az[i]] =
                        lattice.gradient::<W, PADDED>([below, low, next_to_low], one_sided_low, a, x, y);
                    [bx[i], by[i], bz[i]] =
                        lattice.gradient::<W, PADDED>([next_to_high, high, above], one_sided_high, b, xb, yb);
                }
            }
        }
    }

    /// Computes the vertices from what was gathered, into slices of the next multiple of 16 of `count`. Returns whether all of them are sound;
    /// where they are not, a difference was out of the range in which `f32` computes well.
    #[inline(always)]
    fn finish<const AXIS: usize, const NORMALS: bool>(
        &mut self,
        z: usize,
        isovalue: f32,
        count: usize,
        positions: &mut [MaybeUninit<[f32; 3]>],
        normals: &mut [MaybeUninit<[f32; 3]>],
    ) -> bool {
        let z = z as f32;
        let room = positions.len();
        let (a, b, xs, ys) = (&self.ends[0][..room], &self.ends[1][..room], &self.x[..room], &self.y[..room]);
        let [ax, ay, az] = &self.gradients[0];
        let [bx, by, bz] = &self.gradients[1];
        let (ax, ay, az, bx, by, bz) = (&ax[..room], &ay[..room], &az[..room], &bx[..room], &by[..room], &bz[..room]);
        if NORMALS {
            assert_eq!(normals.len(), room);
        }
        let Bounds { mut min, mut max } = self.bounds;
        let mut unsound = false;
        for i in 0..room {
            let within = i < count;
            let (fraction, mut sound) = W::quick_fraction(a[i], b[i], isovalue);
            let fraction = clamped(fraction);
            let mut position = [xs[i] as f32, ys[i] as f32, z];
            position[AXIS] += fraction;
            positions[i].write(position);
            // Positions are not negative, so that their bits are in the same order.
            let mut axis = 0;
            while axis < 3 {
                let bits = position[axis].to_bits();
                min[axis] = min[axis].min(if within { bits } else { u32::MAX });
                max[axis] = max[axis].max(if within { bits } else { 0 });
                axis += 1;
            }
            if NORMALS {
                let x = mixed::<W>(ax[i], bx[i], fraction);
                let y = mixed::<W>(ay[i], by[i], fraction);
                let z = mixed::<W>(az[i], bz[i], fraction);
                let squared = x * x + y * y + z * z;
                sound &= is_sound(squared);
                let scale = 1.0 / sqrt(squared);
                normals[i].write([x * scale, y * scale, z * scale]);
            }
            unsound |= within & !sound;
        }
        let unsound = u32::from(unsound);
        if unsound == 0 {
            self.bounds = Bounds { min, max };
        }
        unsound == 0
    }

    /// Computes the vertices one by one, with care.
    #[cold]
    #[inline(never)]
    fn mend<const AXIS: usize>(
        &mut self,
        lattice: &Lattice,
        planes: &Planes<'_, W>,
        settings: &MeshSettings,
        count: usize,
        out: &mut MeshBuffer,
    ) {
        let [below, low, high, above] = planes.slabs;
        let (next_to_low, next_to_high) = if AXIS == 2 { (high, low) } else { (above, below) };
        for i in 0..count {
            let (x, y) = (self.x[i], self.y[i]);
            let a = lattice.index(x, y);
            let b = a + lattice.step::<AXIS>();
            let (xb, yb) = (x + u32::from(AXIS == 0), y + u32::from(AXIS == 1));
            let fraction = crossing_fraction(low[a], high[b], settings.isovalue * W::SCALE);
            let mut position = [x as f32, y as f32, planes.z as f32];
            position[AXIS] += fraction;
            room(&mut out.positions, count)[i].write(position);
            self.bounds.include(position);
            if settings.normals {
                let [ga, gb] = &self.gradients;
                let gradient = [0, 1, 2].map(|axis| mixed::<W>(ga[axis][i], gb[axis][i], fraction));
                let normal = unit(gradient).unwrap_or_else(|| {
                    let ends = [
                        lattice.steady_gradient([below, low, next_to_low], planes.one_sided[0], a, x, y),
                        lattice.steady_gradient([next_to_high, high, above], planes.one_sided[1], b, xb, yb),
                    ];
                    let mut fallback = [0.0; 3];
                    fallback[AXIS] = if low[a].inside(W::threshold(settings.isovalue)) { 1.0 } else { -1.0 };
                    steady_unit(ends, fraction, fallback)
                });
                room(&mut out.normals, count)[i].write(normal);
            }
        }
    }
}

/// The first `count` words of a block, made up with zeros to a multiple of eight.
#[inline(always)]
pub(super) fn filled(block: &mut [u64; 64], count: usize) -> &[u64] {
    let room = count.next_multiple_of(8);
    block[count..room].fill(0);
    &block[..room]
}

/// How far along the edge from `a` to `b` its vertex lies; `isovalue` in steps (voxels × `SCALE`).
#[inline(always)]
pub(crate) fn crossing_fraction<W: Weight>(a: W, b: W, isovalue: f32) -> f32 {
    clamped(W::fraction(a, b, isovalue))
}

/// A NaN (both ends at the same limit of `f32`) fails the first comparison.
#[inline(always)]
fn clamped(fraction: f32) -> f32 {
    let fraction = if fraction > MARGIN { fraction } else { MARGIN };
    if fraction < 1.0 - MARGIN { fraction } else { 1.0 - MARGIN }
}

#[inline(always)]
fn mixed<W: Weight>(a: W::Wide, b: W::Wide, fraction: f32) -> f32 {
    let (a, b) = (W::to_f32(a), W::to_f32(b));
    a + (b - a) * fraction
}

/// Whether `f32` computes well with a gradient whose squared length this is.
#[inline(always)]
const fn is_sound(squared: f32) -> bool {
    (squared >= 1e-30) & (squared < 1e30)
}

/// The direction of `gradient`, where its length can be computed well in `f32`.
fn unit(gradient: [f32; 3]) -> Option<[f32; 3]> {
    let [x, y, z] = gradient;
    let squared = x * x + y * y + z * z;
    let scale = 1.0 / sqrt(squared);
    is_sound(squared).then_some([x * scale, y * scale, z * scale])
}

/// The direction of a gradient that is tiny, huge, not finite or zero; `fallback` where it has none.
fn steady_unit([a, b]: [[f64; 3]; 2], fraction: f32, fallback: [f32; 3]) -> [f32; 3] {
    let gradient = [0, 1, 2].map(|k| a[k] + (b[k] - a[k]) * f64::from(fraction));
    let largest = gradient.iter().fold(0.0f64, |largest, v| largest.max(v.abs()));
    if largest == 0.0 {
        return fallback;
    }
    let [x, y, z] = gradient.map(|v| v / largest);
    let length = sqrt_f64(x * x + y * y + z * z);
    [x, y, z].map(|v| (v / length) as f32)
}
