//! Where vertices lie in their cells, and their normals: the pass over batches of vertices.
//!
//! As in the primal mesher, one loop copies the samples around each cell to arrays, and others compute many vertices
//! side by side, in a form that the compiler vectorises. Each crossing is computed in every cell that it belongs to:
//! that is quicker than looking it up.

use alloc::vec::Vec;
use core::{mem::MaybeUninit, ops::Range};

use super::{Offset, STEPS, VertexKind, cells::VertexList, plain};
use crate::{
    buffer::MeshBuffer,
    math::sqrt,
    mesher::{
        crossing::{interpolated, snapped},
        gather::{four, two},
        output::{VertexBounds, commit, reserve},
    },
    sample::{Weight, is_sound},
    signs::{EdgeSlabs, SlabLayout},
};

/// Vertices of one batch; a multiple of 16.
pub(super) const BATCH: usize = 128;

/// What the vertices of one slab of cells are made from.
pub(super) struct CellSlabs<'a, W> {
    pub(super) layout: SlabLayout,
    /// The slabs of the edges along z.
    pub(super) edges: EdgeSlabs<'a, W>,
    pub(super) isovalue: f32,
    /// Whether all neighbours of the cells' corners exist.
    pub(super) is_inner: bool,
    /// The lattice point that positions count from, on each axis.
    pub(super) origin: usize,
}

/// The samples around the cells of a batch, and the places of its vertices.
pub(super) struct Batch<W: Weight> {
    /// For each of the four corners at low x: the sample before it along x, it, and the two after it. Corners 0, 2, 4
    /// and 6.
    pub(super) rows: [([W::Left; BATCH], [W::Right; BATCH]); 4],
    /// The two samples below the cell along y and the two above it, at low z; then the same at high z.
    pub(super) y_sides: [[W::Pair; BATCH]; 4],
    /// The two samples below the cell along z and the two above it, at low y; then the same at high y.
    pub(super) z_sides: [[W::Pair; BATCH]; 4],
    /// The offset of each vertex in its cell, in steps.
    pub(super) offsets: [[f32; BATCH]; 3],
    /// The bounds of all vertices made, counted from the first sample.
    bounds: VertexBounds,
}

impl<W: Weight> Batch<W> {
    pub(super) fn new() -> Self {
        Self {
            rows: [([W::Left::default(); BATCH], [W::Right::default(); BATCH]); 4],
            y_sides: [[W::Pair::default(); BATCH]; 4],
            z_sides: [[W::Pair::default(); BATCH]; 4],
            offsets: [[0.0; BATCH]; 3],
            bounds: VertexBounds::NONE,
        }
    }

    /// Widens a mesh's bounds to include all positions made. `origin`: the lattice point that they count from.
    pub(super) fn widen(&self, origin: usize, mesh: &mut MeshBuffer) {
        self.bounds.widen(mesh);
        if let Some(bounds) = &mut mesh.bounds {
            bounds.as_flattened_mut().iter_mut().for_each(|v| *v -= origin as f32);
        }
    }

    /// Copies the samples around the cells of these vertices, at most [`BATCH`].
    #[inline(always)]
    pub(super) fn gather(&mut self, slabs: &CellSlabs<'_, W>, list: &VertexList, range: Range<usize>) {
        if slabs.is_inner {
            self.gather_cells::<true>(slabs, &list.x[range.clone()], &list.y[range]);
        } else {
            self.gather_cells::<false>(slabs, &list.x[range.clone()], &list.y[range]);
        }
    }

    #[inline(always)]
    fn gather_cells<const INNER: bool>(&mut self, slabs: &CellSlabs<'_, W>, xs: &[u32], ys: &[u32]) {
        let CellSlabs { layout, edges, .. } = *slabs;
        let [below, low, high, above] = edges.slabs;
        assert!(edges.slabs.iter().all(|slab| slab.len() == layout.len), "all slabs are whole");
        let count = xs.len();
        let ys = &ys[..count];
        let [row_0, row_2, row_4, row_6] = &mut self.rows;
        let [y0, y1, y2, y3] = &mut self.y_sides;
        let [z0, z1, z2, z3] = &mut self.z_sides;
        for i in 0..count.min(BATCH) {
            let (x, y) = (xs[i], ys[i]);
            let near = layout.index(x, y);
            let far = near + layout.stride;
            let before = if INNER || y > 0 { near - layout.stride } else { near };
            let after = if INNER || (y as usize + 2) < layout.size[1] { far + layout.stride } else { far };
            // SAFETY: the slabs are whole, all corners of a cell are samples, and the corners stand in for neighbours
            // beyond an open border.
            #[expect(unsafe_code, reason = "a dozen reads a vertex, in the loops that take most of the time")]
            unsafe {
                (row_0.0[i], row_0.1[i]) = four::<W, INNER>(&layout, low, near, x);
                (row_2.0[i], row_2.1[i]) = four::<W, INNER>(&layout, low, far, x);
                (row_4.0[i], row_4.1[i]) = four::<W, INNER>(&layout, high, near, x);
                (row_6.0[i], row_6.1[i]) = four::<W, INNER>(&layout, high, far, x);
                (y0[i], y1[i]) = (two(low, before), two(low, after));
                (y2[i], y3[i]) = (two(high, before), two(high, after));
                (z0[i], z1[i]) = (two(below, near), two(above, near));
                (z2[i], z3[i]) = (two(below, far), two(above, far));
            }
        }
    }

    /// Places the gathered vertices at the means of their crossings.
    #[inline(always)]
    pub(super) fn place(&mut self, slabs: &CellSlabs<'_, W>, list: &VertexList, range: Range<usize>) {
        let count = range.len();
        let len = count.next_multiple_of(16);
        let edges = &list.edges[range.start..][..len];
        if !self.place_at_means(slabs.isovalue * W::SCALE, edges, count) {
            for (i, vertex) in range.enumerate() {
                let offset = plain::mean(slabs, [list.x[vertex], list.y[vertex]], list.edges[vertex]);
                for (of_axis, steps) in self.offsets.iter_mut().zip(offset) {
                    of_axis[i] = steps;
                }
            }
        }
    }

    /// Returns false if some difference was out of the range in which `f32` computes well.
    #[inline(always)]
    fn place_at_means(&mut self, isovalue: f32, edges: &[u16], count: usize) -> bool {
        let len = edges.len().min(BATCH);
        let edges = &edges[..len];
        let [(l0, r0), (l2, r2), (l4, r4), (l6, r6)] = &self.rows;
        let (l0, l2, l4, l6) = (&l0[..len], &l2[..len], &l4[..len], &l6[..len]);
        let (r0, r2, r4, r6) = (&r0[..len], &r2[..len], &r4[..len], &r6[..len]);
        let [x_offsets, y_offsets, z_offsets] = &mut self.offsets;
        let (x_offsets, y_offsets, z_offsets) = (&mut x_offsets[..len], &mut y_offsets[..len], &mut z_offsets[..len]);
        let mut unsound = false;
        for i in 0..len {
            let rows =
                [W::joined(l0[i], r0[i]), W::joined(l2[i], r2[i]), W::joined(l4[i], r4[i]), W::joined(l6[i], r6[i])];
            let bits = u32::from(edges[i]);
            let mut crossings = Crossings { sum: [0.0; 3], count: 0.0, unsound: false };
            // Written out: compilers do not unroll a loop of this size, and vectorise nothing around it.
            crossings.add::<W, 0>(&rows, bits, isovalue);
            crossings.add::<W, 1>(&rows, bits, isovalue);
            crossings.add::<W, 2>(&rows, bits, isovalue);
            crossings.add::<W, 3>(&rows, bits, isovalue);
            crossings.add::<W, 4>(&rows, bits, isovalue);
            crossings.add::<W, 5>(&rows, bits, isovalue);
            crossings.add::<W, 6>(&rows, bits, isovalue);
            crossings.add::<W, 7>(&rows, bits, isovalue);
            crossings.add::<W, 8>(&rows, bits, isovalue);
            crossings.add::<W, 9>(&rows, bits, isovalue);
            crossings.add::<W, 10>(&rows, bits, isovalue);
            crossings.add::<W, 11>(&rows, bits, isovalue);
            unsound |= (i < count) & crossings.unsound;
            let Crossings { sum, count, .. } = crossings;
            x_offsets[i] = rounded_mean(sum[0], count);
            y_offsets[i] = rounded_mean(sum[1], count);
            z_offsets[i] = rounded_mean(sum[2], count);
        }
        !unsound
    }

    /// Takes the places of the vertices from `offsets`.
    #[inline(always)]
    pub(super) fn set_offsets(&mut self, offsets: &[Offset]) {
        for (i, offset) in offsets[..offsets.len().min(BATCH)].iter().enumerate() {
            for (of_axis, &steps) in self.offsets.iter_mut().zip(offset) {
                of_axis[i] = f32::from(steps);
            }
        }
    }

    /// Appends the places of the first `count` vertices to `offsets`.
    #[inline(always)]
    pub(super) fn append_offsets(&self, count: usize, offsets: &mut Vec<Offset>) {
        let count = count.min(BATCH);
        let [x, y, z] = &self.offsets;
        offsets.extend((0..count).map(|i| [whole(x[i]), whole(y[i]), whole(z[i]), VertexKind::Smooth as u16]));
    }

    /// Appends the positions and normals of the gathered and placed vertices to `out`.
    #[inline(always)]
    pub(super) fn append(
        &mut self,
        slabs: &CellSlabs<'_, W>,
        list: &VertexList,
        range: Range<usize>,
        normals: bool,
        out: &mut MeshBuffer,
    ) {
        let count = range.len();
        let len = count.next_multiple_of(16);
        let (xs, ys) = (&list.x[range.start..][..len], &list.y[range.start..][..len]);
        self.append_positions(slabs, xs, ys, count, out);
        if !normals {
            return;
        }
        let written = &mut reserve(&mut out.normals, len)[..len];
        let sound = if slabs.is_inner {
            self.compute_normals::<true>(slabs, xs, ys, count, written)
        } else {
            self.compute_normals::<false>(slabs, xs, ys, count, written)
        };
        if !sound {
            for (i, (vertex, normal)) in range.zip(written).enumerate() {
                let offset = [self.offsets[0][i], self.offsets[1][i], self.offsets[2][i]];
                normal.write(plain::normal(slabs, [list.x[vertex], list.y[vertex]], list.edges[vertex], offset));
            }
        }
        // SAFETY: all of them have been written.
        #[expect(unsafe_code, reason = "spares filling the vector with zeros first")]
        unsafe {
            commit(&mut out.normals, count);
        }
    }

    #[inline(always)]
    fn append_positions(
        &mut self,
        slabs: &CellSlabs<'_, W>,
        xs: &[u32],
        ys: &[u32],
        count: usize,
        out: &mut MeshBuffer,
    ) {
        let len = xs.len().min(BATCH);
        let (xs, ys) = (&xs[..len], &ys[..len]);
        let [x_offsets, y_offsets, z_offsets] = &self.offsets;
        let (x_offsets, y_offsets, z_offsets) = (&x_offsets[..len], &y_offsets[..len], &z_offsets[..len]);
        let (z, origin) = (slabs.edges.z as f32, slabs.origin as f32);
        let written = &mut reserve(&mut out.positions, len)[..len];
        let VertexBounds { mut min, mut max } = self.bounds;
        for i in 0..len {
            let scale = 1.0 / STEPS as f32;
            let position =
                [xs[i] as f32 + x_offsets[i] * scale, ys[i] as f32 + y_offsets[i] * scale, z + z_offsets[i] * scale];
            written[i].write([position[0] - origin, position[1] - origin, position[2] - origin]);
            // Before the origin is subtracted they are positive, so their bits are in the same order.
            let within = i < count;
            let mut axis = 0;
            while axis < 3 {
                let bits = position[axis].to_bits();
                min[axis] = min[axis].min(if within { bits } else { u32::MAX });
                max[axis] = max[axis].max(if within { bits } else { 0 });
                axis += 1;
            }
        }
        self.bounds = VertexBounds { min, max };
        // SAFETY: all of them have been written.
        #[expect(unsafe_code, reason = "spares filling the vector with zeros first")]
        unsafe {
            commit(&mut out.positions, count);
        }
    }

    /// Writes the gradients of the gathered vertices, scaled to length 1: the trilinear interpolation of those at the
    /// corners of their cells. Returns false if some gradient was out of the range in which `f32` computes well.
    #[inline(always)]
    fn compute_normals<const INNER: bool>(
        &self,
        slabs: &CellSlabs<'_, W>,
        xs: &[u32],
        ys: &[u32],
        count: usize,
        written: &mut [MaybeUninit<[f32; 3]>],
    ) -> bool {
        let len = written.len().min(BATCH);
        let (xs, ys, written) = (&xs[..len], &ys[..len], &mut written[..len]);
        let [(l0, r0), (l2, r2), (l4, r4), (l6, r6)] = &self.rows;
        let (l0, l2, l4, l6) = (&l0[..len], &l2[..len], &l4[..len], &l6[..len]);
        let (r0, r2, r4, r6) = (&r0[..len], &r2[..len], &r4[..len], &r6[..len]);
        let [y0, y1, y2, y3] = &self.y_sides;
        let (y0, y1, y2, y3) = (&y0[..len], &y1[..len], &y2[..len], &y3[..len]);
        let [z0, z1, z2, z3] = &self.z_sides;
        let (z0, z1, z2, z3) = (&z0[..len], &z1[..len], &z2[..len], &z3[..len]);
        let [x_offsets, y_offsets, z_offsets] = &self.offsets;
        let (x_offsets, y_offsets, z_offsets) = (&x_offsets[..len], &y_offsets[..len], &z_offsets[..len]);
        let [last_x, last_y] = [0, 1].map(|axis| (slabs.layout.size[axis] - 2) as u32);
        let [z_low, z_high] = slabs.edges.one_sided.map(|one_sided| if one_sided { 2.0 } else { 1.0 });
        let scale = 1.0 / STEPS as f32;
        let mut unsound = false;
        for i in 0..len {
            let rows =
                [W::joined(l0[i], r0[i]), W::joined(l2[i], r2[i]), W::joined(l4[i], r4[i]), W::joined(l6[i], r6[i])];
            let y_sides = [W::both(y0[i]), W::both(y1[i]), W::both(y2[i]), W::both(y3[i])];
            let z_sides = [W::both(z0[i]), W::both(z1[i]), W::both(z2[i]), W::both(z3[i])];
            let (at_x, at_y, at_z) = (x_offsets[i] * scale, y_offsets[i] * scale, z_offsets[i] * scale);
            // Twice the gradient at each corner.
            let (mut dx, mut dy, mut dz) = ([0.0; 8], [0.0; 8], [0.0; 8]);
            let mut corner = 0;
            while corner < 8 {
                let (x, y, z) = (corner & 1, corner >> 1 & 1, corner >> 2);
                let row = &rows[corner >> 1];
                dx[corner] = W::to_f32(W::difference(row[2 + x], row[x]));
                dy[corner] = W::to_f32(if y == 0 {
                    W::difference(rows[2 * z + 1][1 + x], y_sides[2 * z][x])
                } else {
                    W::difference(y_sides[2 * z + 1][x], rows[2 * z][1 + x])
                });
                dz[corner] = W::to_f32(if z == 0 {
                    W::difference(rows[2 + y][1 + x], z_sides[2 * y][x])
                } else {
                    W::difference(z_sides[2 * y + 1][x], rows[y][1 + x])
                });
                if !INNER {
                    let is_first = [xs[i] == 0, ys[i] == 0];
                    let is_last = [xs[i] == last_x, ys[i] == last_y];
                    dx[corner] *= if (x == 0 && is_first[0]) | (x == 1 && is_last[0]) { 2.0 } else { 1.0 };
                    dy[corner] *= if (y == 0 && is_first[1]) | (y == 1 && is_last[1]) { 2.0 } else { 1.0 };
                    dz[corner] *= if z == 0 { z_low } else { z_high };
                }
                corner += 1;
            }
            let x = trilinear(&dx, at_x, at_y, at_z);
            let y = trilinear(&dy, at_x, at_y, at_z);
            let z = trilinear(&dz, at_x, at_y, at_z);
            let squared = x * x + y * y + z * z;
            unsound |= (i < count) & !is_sound(squared);
            let scale = 1.0 / sqrt(squared);
            written[i].write([x * scale, y * scale, z * scale]);
        }
        !unsound
    }
}

/// The crossings of one vertex.
struct Crossings {
    /// The sum of their places in the cell; exact, since all of them are multiples of 2⁻¹⁴.
    sum: [f32; 3],
    count: f32,
    /// Whether the place of one was not computed well.
    unsound: bool,
}

impl Crossings {
    /// Adds the crossing on edge `EDGE`, if its bit in `bits` is set. `rows`: as in [`Batch`].
    #[inline(always)]
    fn add<W: Weight, const EDGE: usize>(&mut self, rows: &[[W; 4]; 4], bits: u32, isovalue: f32) {
        let (axis, [low, high]) = (EDGE / 4, CORNERS[EDGE]);
        let (a, b) = (rows[low / 2][1 + low % 2], rows[high / 2][1 + high % 2]);
        let (fraction, sound) = W::quick_fraction(a.wide(), b.wide(), isovalue);
        let is_crossed = bits >> EDGE & 1 != 0;
        let one = if is_crossed { 1.0 } else { 0.0 };
        self.unsound |= is_crossed & !sound;
        self.count += one;
        let along = if is_crossed { snapped(fraction) } else { 0.0 };
        self.sum[0] += if axis == 0 {
            along
        } else if low & 1 == 1 {
            one
        } else {
            0.0
        };
        self.sum[1] += if axis == 1 {
            along
        } else if low >> 1 & 1 == 1 {
            one
        } else {
            0.0
        };
        self.sum[2] += if axis == 2 {
            along
        } else if low >> 2 & 1 == 1 {
            one
        } else {
            0.0
        };
    }
}

/// The trilinear interpolation of what is known at the corners of a cell.
#[inline(always)]
pub(super) fn trilinear(corners: &[f32; 8], x: f32, y: f32, z: f32) -> f32 {
    let [a, b, c, d, e, f, g, h] = *corners;
    let (low, next) = (interpolated(a, b, x), interpolated(c, d, x));
    let (high, next_high) = (interpolated(e, f, x), interpolated(g, h, x));
    interpolated(interpolated(low, next, y), interpolated(high, next_high, y), z)
}

/// The corners of each edge.
pub(super) const CORNERS: [[usize; 2]; 12] = {
    let (mut corners, mut edge) = ([[0; 2]; 12], 0);
    while edge < 12 {
        let [low, high] = crate::cell::Edge::ALL[edge].corners();
        corners[edge] = [low.index(), high.index()];
        edge += 1;
    }
    corners
};

/// A mean in steps, rounded to the nearest one and moved off the cell's faces; halves are rounded up. `sum`: in cells, a
/// multiple of 2⁻¹⁴ below 8; `count`: up to 12.
#[inline(always)]
pub(super) fn rounded_mean(sum: f32, count: f32) -> f32 {
    // The quotient is a half or at least 1/48 away from one, so a little less than that rounds halves up.
    let mean = sum * STEPS as f32 / count;
    // Beyond 2²³ numbers of `f32` are whole.
    within_cell(((mean + 1.0 / 64.0) + 8_388_608.0) - 8_388_608.0)
}

/// Moves a coordinate off the faces of the cell, into which the crossings of a vertex can all lie at an open border.
#[inline(always)]
pub(super) const fn within_cell(steps: f32) -> f32 {
    let steps = if steps > 1.0 { steps } else { 1.0 };
    if steps < (STEPS - 1) as f32 { steps } else { (STEPS - 1) as f32 }
}

/// A whole number of steps, 0 to 4096.
#[inline(always)]
pub(super) const fn whole(steps: f32) -> u16 {
    (steps + 8_388_608.0).to_bits() as u16
}
