//! The vertex pass: one vertex for each crossing, with its position, normal and material.
//!
//! The pass first lists the crossings of many rows, so that long loops without branches follow: one that copies the
//! samples around each crossing to arrays, and one that computes up to sixteen vertices side by side. The second is a
//! plain loop in a form that the compiler vectorises (arrays of fixed length, no closures, conditions as selections).
//!
//! Refused, with times of a padded chunk of 35³ `i16` samples (caves, AVX-512, Zen 4, 3.7 GHz; 42 µs as it is), each
//! beside the time of its day:
//! - computing each vertex as it is found, from slices of rows: 141 µs;
//! - taking the gradients' differences while gathering, which writes eight numbers a vertex: 50 µs, and 330 instead of
//!   260 µs on white noise; stores bound the loop;
//! - `f32` samples in pairs like the integers' (51 instead of 45 µs), and integers in fours like `f32`'s (59 instead of
//!   53 µs with AVX2): compilers take these apart badly;
//! - listing the crossings of all words instead of the nonzero ones: 59 instead of 56 µs.

use core::mem::MaybeUninit;

use super::mend::mend;
use crate::mesher::{
    crossing::{interpolated, snapped},
    gather::{at, four, two},
    output::{VertexBounds, commit, reserve},
    settings::MeshSettings,
};
use crate::{
    buffer::MeshBuffer,
    math::sqrt,
    sample::{Weight, is_sound},
    signs::{EdgeSlabs, SlabLayout},
    simd::{Simd, nonzero_words},
};

/// Crossings of one batch: from this many on they become vertices.
const BATCH: usize = 128;
/// The capacity of a batch: the word that completes it may add 63 crossings, and `compute` rounds up to sixteen.
const BATCH_CAPACITY: usize = BATCH + 64;

/// Gathers crossings in batches and turns them into vertices.
///
/// Samples are copied in as few pieces as possible: four neighbours along x at once, or two. The arithmetic is left to
/// [`VertexPass::compute`].
pub(in crate::mesher) struct VertexPass<W: Weight> {
    /// The bounds of all vertices made.
    pub(in crate::mesher) bounds: VertexBounds,
    /// The lattice positions of the edges' low ends.
    x: [u32; BATCH_CAPACITY],
    y: [u32; BATCH_CAPACITY],
    /// The four samples around the low and around the high end along x: one below the end, the end, and two above. On
    /// an edge along x, the low end's hold the high end.
    rows: [([W::Left; BATCH_CAPACITY], [W::Right; BATCH_CAPACITY]); 2],
    /// On an edge along x: both ends' neighbours below along y, above along y, below along z, and above along z.
    pairs: [[W::Pair; BATCH_CAPACITY]; 4],
    /// On an edge along y or z: the sample below the low end, and the one above the high end.
    outer: [[W; BATCH_CAPACITY]; 2],
    /// On an edge along y: twice the gradient along z at both ends; on an edge along z, that along y.
    across: [[W::Wide; BATCH_CAPACITY]; 2],
}

impl<W: Weight> VertexPass<W> {
    pub(in crate::mesher) fn new() -> Self {
        Self {
            bounds: VertexBounds::NONE,
            x: [0; BATCH_CAPACITY],
            y: [0; BATCH_CAPACITY],
            rows: [([W::Left::default(); BATCH_CAPACITY], [W::Right::default(); BATCH_CAPACITY]); 2],
            pairs: [[W::Pair::default(); BATCH_CAPACITY]; 4],
            outer: [[W::OUTSIDE; BATCH_CAPACITY]; 2],
            across: [[W::Wide::default(); BATCH_CAPACITY]; 2],
        }
    }

    /// Appends the vertices on all edges along `AXIS`, row by row, and returns their number. `low` and `high`: the
    /// signs of the edges' ends.
    #[inline(always)]
    pub(in crate::mesher) fn add<S: Simd, const AXIS: usize>(
        &mut self,
        layout: &SlabLayout,
        edges: &EdgeSlabs<'_, W>,
        settings: &MeshSettings,
        low: &[u64],
        high: &[u64],
        out: &mut MeshBuffer,
    ) -> u64 {
        let mut made = 0;
        let mut blocks = low.chunks(64).zip(high.chunks(64)).enumerate();
        // The present block of words: its number, its crossings, and its nonzero words that are still to be done.
        let (mut block, mut crossed, mut words) = (0, [0; 64], 0u64);
        loop {
            let mut gathered = 0;
            while gathered < BATCH {
                if words == 0 {
                    let Some((number, (low, high))) = blocks.next() else { break };
                    for (crossed, (low, high)) in crossed.iter_mut().zip(low.iter().zip(high)) {
                        *crossed = low ^ high;
                    }
                    words = nonzero_words::<S>(&mut crossed, low.len());
                    block = number;
                    continue;
                }
                let word = words.trailing_zeros() as usize;
                words &= words - 1;
                let (y, x) = layout.word_position(64 * block + word);
                let (xs, ys) = (self.x[gathered..].first_chunk_mut(), self.y[gathered..].first_chunk_mut());
                let (xs, ys) = xs.zip(ys).expect("another word's crossings fit");
                gathered += S::positions(crossed[word % 64], x, y, xs, ys);
            }
            if gathered == 0 {
                return made;
            }
            self.append_batch::<AXIS>(layout, edges, settings, gathered, out);
            made += gathered as u64;
        }
    }

    /// Appends the vertices of the first `count` crossings that were gathered.
    #[inline(always)]
    fn append_batch<const AXIS: usize>(
        &mut self,
        layout: &SlabLayout,
        edges: &EdgeSlabs<'_, W>,
        settings: &MeshSettings,
        count: usize,
        out: &mut MeshBuffer,
    ) {
        if layout.padded {
            self.gather::<AXIS, true>(layout, edges, count);
        } else {
            self.gather::<AXIS, false>(layout, edges, count);
        }
        let computed = count.next_multiple_of(16);
        let positions = &mut reserve(&mut out.positions, computed)[..computed];
        let sound = if !settings.normals {
            self.compute::<AXIS, false, true>(layout, edges, settings, count, positions, &mut [])
        } else {
            let normals = &mut reserve(&mut out.normals, computed)[..computed];
            if layout.padded {
                self.compute::<AXIS, true, true>(layout, edges, settings, count, positions, normals)
            } else {
                self.compute::<AXIS, true, false>(layout, edges, settings, count, positions, normals)
            }
        };
        if !sound {
            let positions = [&self.x[..count], &self.y[..count]];
            mend::<AXIS, W>(layout, edges, settings, positions, &mut self.bounds, out);
        }
        // SAFETY: `compute` has written all of them.
        #[expect(unsafe_code, reason = "spares filling the vectors with zeros first")]
        unsafe {
            commit(&mut out.positions, count);
            if settings.normals {
                commit(&mut out.normals, count);
            }
        }
        if let Some(materials) = edges.materials {
            let threshold = W::threshold(settings.isovalue);
            out.materials.extend(self.x[..count].iter().zip(&self.y[..count]).map(|(&x, &y)| {
                let low = layout.index(x, y);
                if edges.slabs[1][low].inside(threshold) {
                    materials[0][low]
                } else {
                    materials[1][low + layout.step::<AXIS>()]
                }
            }));
        }
    }

    /// Copies the samples that the first `count` vertices need.
    #[inline(always)]
    fn gather<const AXIS: usize, const PADDED: bool>(
        &mut self,
        layout: &SlabLayout,
        edges: &EdgeSlabs<'_, W>,
        count: usize,
    ) {
        let [below, low, high, above] = edges.slabs;
        assert!(edges.slabs.iter().all(|slab| slab.len() == layout.len), "all slabs are whole");
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
            let a = layout.index(x, y);
            let b = a + layout.step::<AXIS>();
            let y_high = y + u32::from(AXIS == 1);
            // SAFETY: the slabs are whole, both ends of a crossing are meshed samples, and the ends stand in for
            // neighbours beyond an open border.
            #[expect(unsafe_code, reason = "a dozen reads a vertex, in the loop that takes most of the time")]
            unsafe {
                let down = |index: usize, y: u32| if PADDED || y > 0 { index - layout.stride } else { index };
                let up = |index: usize, y: u32| {
                    if PADDED || (y as usize + 1) < layout.size[1] { index + layout.stride } else { index }
                };
                (low_left[i], low_right[i]) = four::<W, PADDED>(layout, low, a, x);
                if AXIS == 0 {
                    y_below[i] = two(low, down(a, y));
                    y_above[i] = two(low, up(a, y));
                    z_below[i] = two(below, a);
                    z_above[i] = two(above, a);
                } else {
                    (high_left[i], high_right[i]) = four::<W, PADDED>(layout, high, b, x);
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

    /// Computes the gathered vertices, `count` rounded up to a multiple of 16 of them.
    ///
    /// Returns false if some difference was out of the range in which `f32` computes well; [`mend`] must then write all
    /// vertices again.
    ///
    /// The function is long on purpose: with its loop's reads in a helper, AVX2 takes a tenth more instructions.
    #[inline(always)]
    fn compute<const AXIS: usize, const NORMALS: bool, const PADDED: bool>(
        &mut self,
        layout: &SlabLayout,
        edges: &EdgeSlabs<'_, W>,
        settings: &MeshSettings,
        count: usize,
        positions: &mut [MaybeUninit<[f32; 3]>],
        normals: &mut [MaybeUninit<[f32; 3]>],
    ) -> bool {
        let (z, isovalue) = (edges.z as f32, settings.isovalue * W::SCALE);
        let [last_x, last_y] = [0, 1].map(|axis| (layout.size[axis] - 1) as u32);
        let [z_low, z_high] = edges.one_sided.map(|one_sided| if one_sided { 2.0 } else { 1.0 });
        let len = positions.len();
        let (xs, ys) = (&self.x[..len], &self.y[..len]);
        let [(low_left, low_right), (high_left, high_right)] = &self.rows;
        let (low_left, low_right) = (&low_left[..len], &low_right[..len]);
        let (high_left, high_right) = (&high_left[..len], &high_right[..len]);
        let [y_below, y_above, z_below, z_above] = &self.pairs;
        let (y_below, y_above) = (&y_below[..len], &y_above[..len]);
        let (z_below, z_above) = (&z_below[..len], &z_above[..len]);
        let [outer_low, outer_high] = &self.outer;
        let (outer_low, outer_high) = (&outer_low[..len], &outer_high[..len]);
        let [across_low, across_high] = &self.across;
        let (across_low, across_high) = (&across_low[..len], &across_high[..len]);
        if NORMALS {
            assert_eq!(normals.len(), len);
        }
        let VertexBounds { mut min, mut max } = self.bounds;
        let mut unsound = false;
        for i in 0..len {
            let within = i < count;
            let row = W::joined(low_left[i], low_right[i]);
            let high_row = W::joined(high_left[i], high_right[i]);
            let (a, b) = (row[1], if AXIS == 0 { row[2] } else { high_row[1] });
            let (fraction, mut sound) = W::quick_fraction(a.wide(), b.wide(), isovalue);
            let fraction = snapped(fraction);
            let mut position = [xs[i] as f32, ys[i] as f32, z];
            position[AXIS] += fraction;
            positions[i].write(position);
            // Positions are not negative, so their bits are in the same order.
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
                let (x, y, z) =
                    (interpolated(ax, bx, fraction), interpolated(ay, by, fraction), interpolated(az, bz, fraction));
                let squared = x * x + y * y + z * z;
                sound &= is_sound(squared);
                let scale = 1.0 / sqrt(squared);
                normals[i].write([x * scale, y * scale, z * scale]);
            }
            unsound |= within & !sound;
        }
        if !unsound {
            self.bounds = VertexBounds { min, max };
        }
        !unsound
    }
}

/// The factor that makes the difference at `at` twice the gradient: 2 at an open border, where it is one-sided.
#[inline(always)]
const fn span(at: u32, last: u32) -> f32 {
    if (at == 0) | (at == last) { 2.0 } else { 1.0 }
}
