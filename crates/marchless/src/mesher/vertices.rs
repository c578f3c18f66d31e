//! Pass 2: one vertex for each crossing of a slab, with its position, normal and material.
//!
//! The crossings of many rows are listed first, so that what follows are long loops without branches: one that copies
//! what each vertex is made of from the samples to arrays, and one that computes up to sixteen vertices side by side.
//! The second is a plain loop, written so that the compiler makes vector instructions of it (arrays of fixed length, no
//! closures, conditions as selections).
//!
//! Refused, with times of a padded chunk of 35³ `i16` samples (caves, AVX-512, Zen 4, 3.7 GHz; 42 µs as it is), each
//! beside what stood then:
//! - each vertex computed as it is found, from slices of rows: 141 µs;
//! - gradients' differences taken while gathering, which writes eight numbers a vertex: 50 µs, and 330 instead of
//!   260 µs on white noise; the loop is bound by its stores;
//! - `f32` samples in pairs like the integers' (51 instead of 45 µs), and integers in fours like `f32`'s (59 instead of
//!   53 µs with AVX2): compilers take these apart badly;
//! - listing the crossings of all words, without looking for those that have any: 59 instead of 56 µs.

mod mend;

use core::mem::MaybeUninit;

use super::{
    MeshSettings,
    output::{Bounds, keep, room},
    slabs::Lattice,
};
use crate::{
    buffer::MeshBuffer,
    math::sqrt,
    sample::{Weight, is_sound},
    simd::Simd,
};

/// Crossings stay this far from the ends of their edge.
pub(super) const MARGIN: f32 = 1.0 / 1024.0;

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
///
/// What a vertex is made of is copied from the samples in as few pieces as possible: four neighbours along x at once,
/// or two; the arithmetic is left to [`Vertices::finish`].
pub(super) struct Vertices<W: Weight> {
    /// Of all vertices made.
    pub(super) bounds: Bounds,
    x: [u32; ROOM],
    y: [u32; ROOM],
    /// The samples around the low and the high end along x, from one below the end on. (On an edge along x, the high
    /// end is in the low one's.)
    rows: [([W::Left; ROOM], [W::Right; ROOM]); 2],
    /// On an edge along x: the neighbours of both ends below along y, above along y, below along z, above along z.
    pairs: [[W::Pair; ROOM]; 4],
    /// On other edges: the sample below the low end, and the one above the high end.
    outer: [[W; ROOM]; 2],
    /// On edges along y and z: twice the gradient along the other of the two, at both ends.
    across: [[W::Wide; ROOM]; 2],
}

impl<W: Weight> Vertices<W> {
    pub(super) fn new() -> Self {
        Self {
            bounds: Bounds::NONE,
            x: [0; ROOM],
            y: [0; ROOM],
            rows: [([W::Left::default(); ROOM], [W::Right::default(); ROOM]); 2],
            pairs: [[W::Pair::default(); ROOM]; 4],
            outer: [[W::OUTSIDE; ROOM]; 2],
            across: [[W::Wide::default(); ROOM]; 2],
        }
    }

    /// Makes the vertices on all edges along `AXIS`, row by row, and returns how many there are. `low` and `high`: the
    /// signs of the edges' ends.
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
        let mut blocks = low.chunks(64).zip(high.chunks(64)).enumerate();
        // Of the present block of words: its number, their crossings, and which are not zero and not done.
        let (mut block, mut crossed, mut words) = (0, [0; 64], 0u64);
        loop {
            let mut gathered = 0;
            while gathered < GATHERED {
                if words == 0 {
                    let Some((number, (low, high))) = blocks.next() else { break };
                    for (crossed, (low, high)) in crossed.iter_mut().zip(low.iter().zip(high)) {
                        *crossed = low ^ high;
                    }
                    words = S::nonzero(filled(&mut crossed, low.len()));
                    block = number;
                    continue;
                }
                let word = words.trailing_zeros() as usize;
                words &= words - 1;
                let (y, x) = lattice.place_of(64 * block + word);
                let (xs, ys) = (self.x[gathered..].first_chunk_mut(), self.y[gathered..].first_chunk_mut());
                let (xs, ys) = xs.zip(ys).expect("there is room for another word's");
                gathered += S::positions(crossed[word % 64], x, y, xs, ys);
            }
            if gathered == 0 {
                return made;
            }
            self.flush::<AXIS>(lattice, planes, settings, gathered, out);
            made += gathered as u64;
        }
    }

    /// Makes vertices of the first `count` crossings that were gathered.
    #[inline(always)]
    fn flush<const AXIS: usize>(
        &mut self,
        lattice: &Lattice,
        planes: &Planes<'_, W>,
        settings: &MeshSettings,
        count: usize,
        out: &mut MeshBuffer,
    ) {
        if lattice.padded {
            self.gather::<AXIS, true>(lattice, planes, count);
        } else {
            self.gather::<AXIS, false>(lattice, planes, count);
        }
        let side_by_side = count.next_multiple_of(16);
        let positions = &mut room(&mut out.positions, side_by_side)[..side_by_side];
        let sound = if !settings.normals {
            self.finish::<AXIS, false, true>(lattice, planes, settings, count, positions, &mut [])
        } else {
            let normals = &mut room(&mut out.normals, side_by_side)[..side_by_side];
            if lattice.padded {
                self.finish::<AXIS, true, true>(lattice, planes, settings, count, positions, normals)
            } else {
                self.finish::<AXIS, true, false>(lattice, planes, settings, count, positions, normals)
            }
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
    }

    /// Copies what the first `count` vertices are made of.
    #[inline(always)]
    fn gather<const AXIS: usize, const PADDED: bool>(
        &mut self,
        lattice: &Lattice,
        planes: &Planes<'_, W>,
        count: usize,
    ) {
        let [below, low, high, above] = planes.slabs;
        assert!(planes.slabs.iter().all(|slab| slab.len() == lattice.len), "all slabs are whole");
        let (xs, ys) = (&self.x[..count], &self.y[..count]);
        let [(low_left, low_right), (high_left, high_right)] = &mut self.rows;
        let (low_left, low_right) = (&mut low_left[..count], &mut low_right[..count]);
        let (high_left, high_right) = (&mut high_left[..count], &mut high_right[..count]);
        let [y_below, y_above, z_below, z_above] = &mut self.pairs;
        let (y_below, y_above) = (&mut y_below[..count], &mut y_above[..count]);
        let (z_below, z_above) = (&mut z_below[..count], &mut z_above[..count]);
        let [outer_low, outer_high] = &mut self.outer;
        let (outer_low, outer_high) = (&mut outer_low[..count], &mut outer_high[..count]);
        let [across_low, across_high] = &mut self.across;
        let (across_low, across_high) = (&mut across_low[..count], &mut across_high[..count]);
        for i in 0..count {
            let (x, y) = (xs[i], ys[i]);
            let a = lattice.index(x, y);
            let b = a + lattice.step::<AXIS>();
            let y_high = y + u32::from(AXIS == 1);
            // SAFETY: the slabs are whole, both ends of a crossing are meshed samples, and where samples beside them
            // are beyond an open border, the ends stand in for those.
            #[expect(unsafe_code, reason = "a dozen reads a vertex, in the loop that takes most of the time")]
            unsafe {
                let down = |index: usize, y: u32| if PADDED || y > 0 { index - lattice.stride } else { index };
                let up = |index: usize, y: u32| {
                    if PADDED || (y as usize + 1) < lattice.size[1] { index + lattice.stride } else { index }
                };
                (low_left[i], low_right[i]) = four::<W, PADDED>(lattice, low, a, x);
                if AXIS == 0 {
                    y_below[i] = two(low, down(a, y));
                    y_above[i] = two(low, up(a, y));
                    z_below[i] = two(below, a);
                    z_above[i] = two(above, a);
                } else {
                    (high_left[i], high_right[i]) = four::<W, PADDED>(lattice, high, b, x);
                    if AXIS == 1 {
                        (outer_low[i], outer_high[i]) = (at(low, down(a, y)), at(high, up(b, y_high)));
                        across_low[i] = W::difference(at(above, a), at(below, a));
                        across_high[i] = W::difference(at(above, b), at(below, b));
                    } else {
                        (outer_low[i], outer_high[i]) = (at(below, a), at(above, b));
                        across_low[i] = W::difference(at(low, up(a, y)), at(low, down(a, y)));
                        across_high[i] = W::difference(at(high, up(b, y)), at(high, down(b, y)));
                    }
                }
            }
        }
    }

    /// Computes the vertices from what was gathered, into slices of the next multiple of 16 of `count`. Returns whether
    /// all of them are sound; where they are not, a difference was out of the range in which `f32` computes well.
    #[inline(always)]
    fn finish<const AXIS: usize, const NORMALS: bool, const PADDED: bool>(
        &mut self,
        lattice: &Lattice,
        planes: &Planes<'_, W>,
        settings: &MeshSettings,
        count: usize,
        positions: &mut [MaybeUninit<[f32; 3]>],
        normals: &mut [MaybeUninit<[f32; 3]>],
    ) -> bool {
        let (z, isovalue) = (planes.z as f32, settings.isovalue * W::SCALE);
        let [last_x, last_y] = [0, 1].map(|axis| (lattice.size[axis] - 1) as u32);
        let [z_low, z_high] = planes.one_sided.map(|one_sided| if one_sided { 2.0 } else { 1.0 });
        let room = positions.len();
        let (xs, ys) = (&self.x[..room], &self.y[..room]);
        let [(low_left, low_right), (high_left, high_right)] = &self.rows;
        let (low_left, low_right) = (&low_left[..room], &low_right[..room]);
        let (high_left, high_right) = (&high_left[..room], &high_right[..room]);
        let [y_below, y_above, z_below, z_above] = &self.pairs;
        let (y_below, y_above) = (&y_below[..room], &y_above[..room]);
        let (z_below, z_above) = (&z_below[..room], &z_above[..room]);
        let [outer_low, outer_high] = &self.outer;
        let (outer_low, outer_high) = (&outer_low[..room], &outer_high[..room]);
        let [across_low, across_high] = &self.across;
        let (across_low, across_high) = (&across_low[..room], &across_high[..room]);
        if NORMALS {
            assert_eq!(normals.len(), room);
        }
        let Bounds { mut min, mut max } = self.bounds;
        let mut unsound = false;
        for i in 0..room {
            let within = i < count;
            let row = W::joined(low_left[i], low_right[i]);
            let high_row = W::joined(high_left[i], high_right[i]);
            let (a, b) = (row[1], if AXIS == 0 { row[2] } else { high_row[1] });
            let (fraction, mut sound) = W::quick_fraction(a.wide(), b.wide(), isovalue);
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
                // Twice the gradients at both ends.
                let mut ax = W::to_f32(W::difference(row[2], row[0]));
                let mut bx = if AXIS == 0 {
                    W::to_f32(W::difference(row[3], row[1]))
                } else {
                    W::to_f32(W::difference(high_row[2], high_row[0]))
                };
                let (mut ay, mut by, mut az, mut bz);
                if AXIS == 0 {
                    let (below, above) = (W::both(y_below[i]), W::both(y_above[i]));
                    ay = W::to_f32(W::difference(above[0], below[0]));
                    by = W::to_f32(W::difference(above[1], below[1]));
                    let (below, above) = (W::both(z_below[i]), W::both(z_above[i]));
                    az = W::to_f32(W::difference(above[0], below[0]));
                    bz = W::to_f32(W::difference(above[1], below[1]));
                } else {
                    let a_along = W::to_f32(W::difference(b, outer_low[i]));
                    let b_along = W::to_f32(W::difference(outer_high[i], a));
                    let (a_across, b_across) = (W::to_f32(across_low[i]), W::to_f32(across_high[i]));
                    (ay, by, az, bz) = if AXIS == 1 {
                        (a_along, b_along, a_across, b_across)
                    } else {
                        (a_across, b_across, a_along, b_along)
                    };
                }
                if !PADDED {
                    ax *= span(xs[i], last_x);
                    bx *= span(xs[i] + u32::from(AXIS == 0), last_x);
                    ay *= span(ys[i], last_y);
                    by *= span(ys[i] + u32::from(AXIS == 1), last_y);
                    az *= z_low;
                    bz *= z_high;
                }
                let (x, y, z) = (mixed(ax, bx, fraction), mixed(ay, by, fraction), mixed(az, bz, fraction));
                let squared = x * x + y * y + z * z;
                sound &= is_sound(squared);
                let scale = 1.0 / sqrt(squared);
                normals[i].write([x * scale, y * scale, z * scale]);
            }
            unsound |= within & !sound;
        }
        if !unsound {
            self.bounds = Bounds { min, max };
        }
        !unsound
    }
}

/// How much farther central differences reach than the one at `at`.
#[inline(always)]
const fn span(at: u32, last: u32) -> f32 {
    if (at == 0) | (at == last) { 2.0 } else { 1.0 }
}

/// Four samples along x, from the one before the meshed sample at `x` with index `index`.
///
/// # Safety
/// `x` and `index` are those of a meshed sample of a whole slab.
#[expect(unsafe_code, reason = "a dozen reads a vertex, in the loop that takes most of the time")]
#[inline(always)]
unsafe fn four<W: Weight, const PADDED: bool>(
    lattice: &Lattice,
    slab: &[W],
    index: usize,
    x: u32,
) -> (W::Left, W::Right) {
    // SAFETY: padding lies before and behind each row, and a row of it behind the last. Without padding, the row's
    // outermost samples stand in.
    unsafe {
        if PADDED {
            debug_assert!(index >= 1 && index + 2 < slab.len());
            return W::split(slab.as_ptr().add(index - 1).cast::<[W; 4]>().read());
        }
        let behind = lattice.size[0] - 1 - x as usize;
        let [first, second] = [1, 2].map(|step| index + behind.min(step));
        let before = index - usize::from(x > 0);
        W::split([at(slab, before), at(slab, index), at(slab, first), at(slab, second)])
    }
}

/// The sample of a slab at `index`.
///
/// # Safety
/// `index` is less than the slab's length.
#[expect(unsafe_code, reason = "a dozen reads a vertex, in the loop that takes most of the time")]
#[inline(always)]
unsafe fn at<W: Copy>(slab: &[W], index: usize) -> W {
    debug_assert!(index < slab.len());
    // SAFETY: as the caller promises.
    unsafe { *slab.get_unchecked(index) }
}

/// Two samples along x, from the one at `index` on.
///
/// # Safety
/// `index` and the next are less than the slab's length.
#[expect(unsafe_code, reason = "a dozen reads a vertex, in the loop that takes most of the time")]
#[inline(always)]
unsafe fn two<W: Weight>(slab: &[W], index: usize) -> W::Pair {
    debug_assert!(index + 1 < slab.len());
    // SAFETY: as the caller promises.
    W::pair(unsafe { slab.as_ptr().add(index).cast::<[W; 2]>().read() })
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
pub(crate) fn clamped(fraction: f32) -> f32 {
    let fraction = if fraction > MARGIN { fraction } else { MARGIN };
    if fraction < 1.0 - MARGIN { fraction } else { 1.0 - MARGIN }
}

#[inline(always)]
fn mixed(a: f32, b: f32, fraction: f32) -> f32 {
    a + (b - a) * fraction
}
