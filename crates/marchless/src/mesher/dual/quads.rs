//! The quads around crossed edges, and their diagonals.

use alloc::vec::Vec;

use super::{
    Extent, Offset, STEPS, VertexKind,
    cells::{CellVertices, bits_between, place},
    quadric::Quadric,
};
use crate::{
    signs::SlabLayout,
    simd::{Simd, nonzero_words},
};

/// Words of edges that are searched together.
const WORDS: usize = 64;

/// A quad around a crossed edge.
#[derive(Clone, Copy, Debug)]
pub(super) struct Quad {
    /// The vertices of the four cells around the edge, in the order of the quadrants (−, −), (+, −), (+, +), (−, +) of
    /// the two axes that follow the edge's.
    pub(super) vertices: [u32; 4],
    pub(super) axis: u8,
    /// Whether the edge's low end is inside.
    pub(super) low_inside: bool,
    /// Whether the second of two equally good diagonals is taken: the coordinates of the edge's low end have an odd
    /// sum, and diagonals alternate.
    pub(super) is_odd: bool,
    /// Whether the quad is part of the mesh, and not only of what its vertices are smoothed by.
    pub(super) is_own: bool,
}

impl Quad {
    /// The two triangles.
    ///
    /// Of the two diagonals it takes the one whose smaller triangle is larger, as seen along the edge: then both
    /// triangles face the edge. With vertices strictly within their cells, one diagonal always has such triangles. If
    /// both have, and a vertex lies on a crease, the planes of the vertices choose. `quadrics`: those of all vertices;
    /// none if no vertex is sharp.
    #[inline(always)]
    pub(super) fn triangles<const AXIS: usize>(&self, offsets: &[Offset], quadrics: &[Quadric]) -> [u32; 6] {
        let [a, b, c, d] = self.vertices;
        let flat = |vertex: u32, [u, v]: [i32; 2]| {
            let offset = offsets[vertex as usize];
            [i32::from(offset[(AXIS + 1) % 3]) + u, i32::from(offset[(AXIS + 2) % 3]) + v]
        };
        let far = -STEPS;
        let places = [flat(a, [far, far]), flat(b, [0, far]), flat(c, [0, 0]), flat(d, [far, 0])];
        // The sum of a diagonal's two areas is that of the quad, so the smaller one is largest where they are most
        // alike.
        let [to_b, to_c, to_d] =
            [1, 2, 3].map(|corner: usize| [places[corner][0] - places[0][0], places[corner][1] - places[0][1]]);
        let cross = |p: [i32; 2], q: [i32; 2]| p[0] * q[1] - p[1] * q[0];
        let (abc, acd, abd) = (cross(to_b, to_c), cross(to_c, to_d), cross(to_b, to_d));
        let whole = abc + acd;
        let (first, second) = ((abc - acd).abs(), (2 * abd - whole).abs());
        let mut is_second = (second < first) | ((second == first) & self.is_odd);
        if !quadrics.is_empty() && abc.min(acd).min(abd).min(whole - abd) > 0 {
            is_second = self.follows_crease(is_second, offsets, quadrics);
        }
        // A table, since no predictor knows the diagonal.
        let order = &ORDERS[usize::from(self.low_inside) << 1 | usize::from(is_second)];
        order.map(|corner| self.vertices[usize::from(corner % 4)])
    }

    /// [`Self::triangles`], for an axis that is not known yet.
    pub(super) fn any_triangles(&self, offsets: &[Offset], quadrics: &[Quadric]) -> [u32; 6] {
        match self.axis {
            0 => self.triangles::<0>(offsets, quadrics),
            1 => self.triangles::<1>(offsets, quadrics),
            _ => self.triangles::<2>(offsets, quadrics),
        }
    }

    /// The places of the four vertices, in steps from the edge's low end.
    pub(super) fn places(&self, offsets: &[Offset]) -> [[i32; 3]; 4] {
        let mut places = self.lowest();
        for (place, vertex) in places.iter_mut().zip(self.vertices) {
            for (at, steps) in place.iter_mut().zip(offsets[vertex as usize]) {
                *at += i32::from(steps);
            }
        }
        places
    }

    /// The lowest corners of the four cells, in steps from the edge's low end.
    fn lowest(&self) -> [[i32; 3]; 4] {
        let (u, v) = ((usize::from(self.axis) + 1) % 3, (usize::from(self.axis) + 2) % 3);
        let mut lowest = [[0; 3]; 4];
        (lowest[0][u], lowest[0][v]) = (-STEPS, -STEPS);
        lowest[1][v] = -STEPS;
        lowest[3][u] = -STEPS;
        lowest
    }

    /// Whether to take the second diagonal, of two that are possible: the one whose middle is nearer to the planes of
    /// the four vertices, if one is clearly nearer. Otherwise, and without a crease, it stays as it `is_second`.
    #[inline(never)]
    fn follows_crease(&self, is_second: bool, offsets: &[Offset], quadrics: &[Quadric]) -> bool {
        let vertices = self.vertices.map(|vertex| vertex as usize);
        if vertices.iter().all(|&vertex| offsets[vertex][3] != VertexKind::Crease as u16) {
            return is_second;
        }
        let (places, lowest) = (self.places(offsets), self.lowest());
        let error = |from: usize, to: usize| {
            let mut error = 0.0;
            for (vertex, lowest) in vertices.into_iter().zip(lowest) {
                let along = |axis: usize| {
                    let doubled = places[from][axis] + places[to][axis] - 2 * lowest[axis] - STEPS;
                    doubled as f32 / (2 * STEPS) as f32
                };
                error += quadrics[vertex].error([along(0), along(1), along(2)]);
            }
            error
        };
        let (first, second) = (error(0, 2), error(1, 3));
        if is_second { first + CLEARLY >= second } else { second + CLEARLY < first }
    }
}

/// Squared distances to planes that differ by less than this do not choose a diagonal: a thirty-second of a cell, once.
const CLEARLY: f32 = 1.0 / 1024.0;

/// The corners of both triangles, counter-clockwise as seen from outside: where the edge's low end is outside, with the
/// first and with the second diagonal; then where it is inside.
const ORDERS: [[u8; 6]; 4] = [[0, 3, 2, 0, 2, 1], [3, 2, 1, 3, 1, 0], [0, 1, 2, 0, 2, 3], [1, 2, 3, 1, 3, 0]];

/// Scratch memory, kept because zeroing it on every call would take time.
#[derive(Clone, Debug)]
pub(super) struct QuadSearch {
    crossed: [u64; WORDS],
    x: [u32; 64],
    y: [u32; 64],
}

impl QuadSearch {
    pub(super) const fn new() -> Self {
        Self { crossed: [0; WORDS], x: [0; 64], y: [0; 64] }
    }

    /// Calls `emit` with all quads around edges along `AXIS` whose low ends are on slab `z`, row by row. `low` and
    /// `high`: the signs of the edges' ends. `cells`: the vertices of the cells below the slab, and of those above it.
    #[inline(always)]
    pub(super) fn find<S: Simd, const AXIS: usize>(
        &mut self,
        layout: &SlabLayout,
        extent: &Extent,
        z: usize,
        [low, high]: [&[u64]; 2],
        cells: [&CellVertices; 2],
        mut emit: impl FnMut(Quad),
    ) {
        let [columns, [first_row, end_row], slabs] = [0, 1, 2].map(|axis| extent.edges(AXIS, axis));
        if !(slabs[0]..slabs[1]).contains(&z) {
            return;
        }
        let words = layout.words;
        let (start_word, end_word) = (first_row * words, end_row * words);
        for start in (start_word..end_word).step_by(WORDS) {
            let count = (end_word - start).min(WORDS);
            let (low, high) = (&low[start..][..count], &high[start..][..count]);
            for ((crossed, low), high) in self.crossed.iter_mut().zip(low).zip(high) {
                *crossed = low ^ high;
            }
            let mut nonzero = nonzero_words::<S>(&mut self.crossed, count);
            while nonzero != 0 {
                let i = nonzero.trailing_zeros() as usize;
                nonzero &= nonzero - 1;
                let (y, x) = layout.word_position(start + i);
                let crossed = self.crossed[i % WORDS] & bits_between(x as usize, columns);
                if crossed == 0 {
                    continue;
                }
                let found = S::positions(crossed, x, y, &mut self.x, &mut self.y);
                let is_own_row = extent.is_own(1, y as usize) && extent.is_own(2, z);
                for &x_edge in &self.x[..found] {
                    let low_inside = low[i] >> (x_edge - x) & 1 == 1;
                    emit(Quad {
                        vertices: vertices_around::<AXIS>(layout, cells, x_edge, y),
                        axis: AXIS as u8,
                        low_inside,
                        is_odd: extent.alternates && (x_edge as usize + y as usize + z + 3 * extent.origin) % 2 == 1,
                        is_own: is_own_row && extent.is_own(0, x_edge as usize),
                    });
                }
            }
        }
    }
}

/// The vertices of the four cells around an edge along `AXIS` whose low end is at `x`, `y`.
#[inline(always)]
fn vertices_around<const AXIS: usize>(
    layout: &SlabLayout,
    [below, above]: [&CellVertices; 2],
    x: u32,
    y: u32,
) -> [u32; 4] {
    let at = place(layout, x, y);
    let row = layout.size[0];
    match AXIS {
        0 => [below.vertex(at - row, 3), below.vertex(at, 2), above.vertex(at, 0), above.vertex(at - row, 1)],
        1 => [below.vertex(at - 1, 7), above.vertex(at - 1, 5), above.vertex(at, 4), below.vertex(at, 6)],
        _ => [above.vertex(at - row - 1, 11), above.vertex(at - row, 10), above.vertex(at, 8), above.vertex(at - 1, 9)],
    }
}

/// Appends the triangles of a quad.
#[inline(always)]
pub(super) fn write<const AXIS: usize>(quad: &Quad, offsets: &[Offset], quadrics: &[Quadric], indices: &mut Vec<u32>) {
    indices.extend_from_slice(&quad.triangles::<AXIS>(offsets, quadrics));
}
