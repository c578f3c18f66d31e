//! The quads around crossed edges, and their diagonals.

use alloc::vec::Vec;

use super::{
    Extent, Offset, STEPS, VertexKind,
    cells::{CellVertices, EdgeList, place},
    quadric::Quadric,
};
use crate::signs::SlabLayout;

/// Quads of one batch; a multiple of 16.
const BATCH: usize = 128;

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
    /// The two triangles. `quadrics`: those of all vertices; none if no vertex is sharp.
    pub(super) fn triangles(&self, offsets: &[Offset], quadrics: &[Quadric]) -> [u32; 6] {
        let flats = match self.axis {
            0 => self.vertices.map(|vertex| flat::<0>(offsets[vertex as usize])),
            1 => self.vertices.map(|vertex| flat::<1>(offsets[vertex as usize])),
            _ => self.vertices.map(|vertex| flat::<2>(offsets[vertex as usize])),
        };
        let Diagonal { mut is_second, is_free } = Diagonal::of(flats, self.is_odd);
        if is_free && !quadrics.is_empty() {
            is_second = self.follows_crease(is_second, offsets, quadrics);
        }
        let order = &ORDERS[usize::from(self.low_inside) << 1 | usize::from(is_second)];
        order.map(|corner| self.vertices[usize::from(corner % 4)])
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

/// Where a vertex lies in its cell as seen along `AXIS`: the steps along the two axes that follow, 16 bits each.
#[inline(always)]
fn flat<const AXIS: usize>(offset: Offset) -> u32 {
    u32::from(offset[(AXIS + 1) % 3]) | u32::from(offset[(AXIS + 2) % 3]) << 16
}

/// One of the two diagonals of a quad.
struct Diagonal {
    is_second: bool,
    /// Whether both diagonals are possible.
    is_free: bool,
}

impl Diagonal {
    /// The diagonal whose smaller triangle is larger, as seen along the edge: then both triangles face the edge. With
    /// vertices strictly within their cells, one diagonal always has such triangles. If both have, and a vertex lies on
    /// a crease, the planes of the vertices choose ([`Quad::follows_crease`]). `flats`: see [`flat`].
    ///
    /// It has no branch, so that a loop over many quads runs on vectors.
    #[inline(always)]
    fn of([a, b, c, d]: [u32; 4], is_odd: bool) -> Self {
        let u = |flat: u32| (flat & 0xFFFF) as i32;
        let v = |flat: u32| (flat >> 16) as i32;
        let (to_b, to_c, to_d) = (
            [u(b) - u(a) + STEPS, v(b) - v(a)],
            [u(c) - u(a) + STEPS, v(c) - v(a) + STEPS],
            [u(d) - u(a), v(d) - v(a) + STEPS],
        );
        // The sum of a diagonal's two areas is that of the quad, so the smaller one is largest where they are most
        // alike.
        let (abc, acd, abd) = (cross(to_b, to_c), cross(to_c, to_d), cross(to_b, to_d));
        let whole = abc + acd;
        let (first, second) = ((abc - acd).abs(), (2 * abd - whole).abs());
        let is_second = (second < first) | ((second == first) & is_odd);
        Self { is_second, is_free: (abc > 0) & (acd > 0) & (abd > 0) & (whole - abd > 0) }
    }
}

#[inline(always)]
const fn cross(p: [i32; 2], q: [i32; 2]) -> i32 {
    p[0] * q[1] - p[1] * q[0]
}

/// Turns crossed edges into quads, batch by batch. Scratch memory, kept because zeroing it on every call would take
/// time.
#[derive(Clone, Debug)]
pub(super) struct QuadBatch {
    vertices: [[u32; 4]; BATCH],
    /// Where the vertices lie; see [`flat`].
    flats: [[u32; BATCH]; 4],
    low_inside: [bool; BATCH],
    diagonals: [u8; BATCH],
    triangles: [[u32; 6]; BATCH],
}

impl QuadBatch {
    pub(super) const fn new() -> Self {
        Self {
            vertices: [[0; 4]; BATCH],
            flats: [[0; BATCH]; 4],
            low_inside: [false; BATCH],
            diagonals: [0; BATCH],
            triangles: [[0; 6]; BATCH],
        }
    }

    /// Appends the triangles of the quads around edges along `AXIS`. `quadrics`: those of all vertices; none if no vertex
    /// is sharp.
    #[inline(always)]
    pub(super) fn append<const AXIS: usize>(
        &mut self,
        edges: &QuadEdges<'_>,
        list: &EdgeList,
        offsets: &[Offset],
        quadrics: &[Quadric],
        indices: &mut Vec<u32>,
    ) {
        for (xs, ys) in list.x().chunks(BATCH).zip(list.y().chunks(BATCH)) {
            let count = xs.len().min(BATCH);
            let ys = &ys[..count];
            let [a, b, c, d] = &mut self.flats;
            for i in 0..count {
                let at = place(edges.layout, xs[i], ys[i]);
                let vertices = edges.vertices::<AXIS>(at);
                self.vertices[i] = vertices;
                self.low_inside[i] = edges.low_inside(at);
                let flat = |corner: usize| flat::<AXIS>(offsets[vertices[corner] as usize]);
                (a[i], b[i], c[i], d[i]) = (flat(0), flat(1), flat(2), flat(3));
            }
            for i in 0..count {
                let is_odd = edges.is_odd(xs[i], ys[i]);
                let diagonal = Diagonal::of([a[i], b[i], c[i], d[i]], is_odd);
                self.diagonals[i] = u8::from(diagonal.is_second) | u8::from(diagonal.is_free) << 1;
            }
            if !quadrics.is_empty() {
                for i in 0..count {
                    if self.diagonals[i] & 2 != 0 {
                        let quad = Quad {
                            vertices: self.vertices[i],
                            axis: AXIS as u8,
                            low_inside: self.low_inside[i],
                            is_odd: edges.is_odd(xs[i], ys[i]),
                            is_own: true,
                        };
                        let is_second = self.diagonals[i] & 1 != 0;
                        self.diagonals[i] = quad.follows_crease(is_second, offsets, quadrics).into();
                    }
                }
            }
            for i in 0..count {
                // A table, since no predictor knows the diagonal.
                let order = &ORDERS[usize::from(self.low_inside[i]) << 1 | usize::from(self.diagonals[i] & 1)];
                self.triangles[i] = order.map(|corner| self.vertices[i][usize::from(corner % 4)]);
            }
            indices.extend_from_slice(self.triangles[..count].as_flattened());
        }
    }
}

/// The edges that begin on a slab.
pub(super) struct QuadEdges<'a> {
    pub(super) layout: &'a SlabLayout,
    pub(super) extent: &'a Extent,
    pub(super) z: usize,
    /// The vertices of the cells below the slab, and of those above it.
    pub(super) cells: &'a [CellVertices; 2],
}

impl QuadEdges<'_> {
    /// Appends the quads around edges along `AXIS` to `quads`.
    pub(super) fn list<const AXIS: usize>(&self, list: &EdgeList, quads: &mut Vec<Quad>) {
        let Self { layout, extent, z, .. } = *self;
        quads.extend(list.x().iter().zip(list.y()).map(|(&x, &y)| {
            let at = place(layout, x, y);
            let is_own = [x as usize, y as usize, z].iter().enumerate().all(|(axis, &at)| extent.is_own(axis, at));
            let (low_inside, is_odd) = (self.low_inside(at), self.is_odd(x, y));
            Quad { vertices: self.vertices::<AXIS>(at), axis: AXIS as u8, low_inside, is_odd, is_own }
        }));
    }

    /// Whether the coordinates of an edge's low end have an odd sum, and diagonals alternate.
    #[inline(always)]
    fn is_odd(&self, x: u32, y: u32) -> bool {
        let rest = (self.z + 3 * self.extent.origin) as u32;
        self.extent.alternates & (x.wrapping_add(y).wrapping_add(rest) & 1 == 1)
    }

    /// Whether the low end of an edge is inside. `at`: the place of the cell whose lowest corner it is.
    #[inline(always)]
    fn low_inside(&self, at: usize) -> bool {
        self.cells[1].is_inside(at)
    }

    /// The vertices of the four cells around an edge along `AXIS`. `at`: the place of the cell whose lowest corner is
    /// the edge's low end.
    #[inline(always)]
    fn vertices<const AXIS: usize>(&self, at: usize) -> [u32; 4] {
        let row = self.layout.size[0];
        let [below, above] = self.cells;
        match AXIS {
            0 => [below.vertex(at - row, 3), below.vertex(at, 2), above.vertex(at, 0), above.vertex(at - row, 1)],
            1 => [below.vertex(at - 1, 7), above.vertex(at - 1, 5), above.vertex(at, 4), below.vertex(at, 6)],
            _ => [
                above.vertex(at - row - 1, 11),
                above.vertex(at - row, 10),
                above.vertex(at, 8),
                above.vertex(at - 1, 9),
            ],
        }
    }
}
