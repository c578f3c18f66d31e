//! The vertices of a slab of cells: which cells have how many, and by which crossings they are placed.

use alloc::vec::Vec;

use super::{
    Extent,
    table::{LOOPS, run},
};
use crate::{
    active::{active_cells, corner_words},
    cases::CROSSED_EDGES,
    signs::{SlabLayout, SlabSigns},
    simd::{Simd, nonzero_words},
};

/// Words of cells that are searched together.
const WORDS: usize = 64;

/// The vertices of some cells, in order.
#[derive(Clone, Debug)]
pub(super) struct VertexList {
    /// The cells of the vertices. These vectors have room for one word of cells more than are in use, as their length.
    pub(super) x: Vec<u32>,
    pub(super) y: Vec<u32>,
    /// The crossings that place each vertex, a bit each.
    pub(super) edges: Vec<u16>,
    /// The cases of the cells.
    pub(super) cases: Vec<u8>,
    pub(super) len: usize,
}

impl VertexList {
    pub(super) const fn new() -> Self {
        Self { x: Vec::new(), y: Vec::new(), edges: Vec::new(), cases: Vec::new(), len: 0 }
    }

    /// Makes room for the vertices of one word of cells.
    #[inline(always)]
    pub(super) fn reserve_word(&mut self) {
        let needed = self.len + 4 * 64;
        if self.x.len() < needed {
            let len = 2 * needed;
            self.x.resize(len, 0);
            self.y.resize(len, 0);
            self.edges.resize(len, 0);
            self.cases.resize(len, 0);
        }
    }

    #[inline(always)]
    pub(super) fn push(&mut self, x: u32, y: u32, case: u8, edges: u16) {
        let at = self.len;
        (self.x[at], self.y[at], self.cases[at], self.edges[at]) = (x, y, case, edges);
        self.len += 1;
    }
}

/// The vertices of each active cell of a slab, by the cell's place: the number of its first vertex, and for each of its
/// crossings which of its vertices that belongs to, in two bits each from bit 32 on.
#[derive(Clone, Debug)]
pub(super) struct CellVertices(Vec<u64>);

impl CellVertices {
    pub(super) const fn new() -> Self {
        Self(Vec::new())
    }

    pub(super) fn resize(&mut self, layout: &SlabLayout) {
        self.0.resize(layout.size[0] * layout.size[1], 0);
    }

    /// The vertex on `edge` of the cell with this [place](place).
    #[inline(always)]
    pub(super) fn vertex(&self, place: usize, edge: u32) -> u32 {
        let cell = self.0[place];
        (cell as u32).wrapping_add((cell >> (32 + 2 * edge)) as u32 & 3)
    }
}

/// The place of a cell in its slab.
#[inline(always)]
pub(super) const fn place(layout: &SlabLayout, x: u32, y: u32) -> usize {
    y as usize * layout.size[0] + x as usize
}

/// Scratch memory, kept because zeroing it on every call would take time.
#[derive(Clone, Debug)]
pub(super) struct CellSearch {
    active: [u64; WORDS],
    x: [u32; 64],
    y: [u32; 64],
    cases: [u16; 64],
}

impl CellSearch {
    pub(super) const fn new() -> Self {
        Self { active: [0; WORDS], x: [0; 64], y: [0; 64], cases: [0; 64] }
    }

    /// Appends the vertices of the cells between slab `z` and the next, numbered from `first` on. `signs`: those of the
    /// slabs from `z − 1` to `z + 2`, so far as they exist.
    #[inline(always)]
    pub(super) fn find<S: Simd>(
        &mut self,
        layout: &SlabLayout,
        extent: &Extent,
        z: usize,
        signs: &[SlabSigns; 4],
        first: u32,
        cells: &mut CellVertices,
        list: &mut VertexList,
    ) {
        cells.resize(layout);
        let base = first.wrapping_sub(list.len as u32);
        let [x_cells, [first_row, end_row], _] = extent.cells;
        let words = layout.words;
        let (start_word, end_word) = (first_row * words, end_row * words);
        let lacking_z = extent.lacking(2, z);
        for start in (start_word..end_word).step_by(WORDS) {
            let count = (end_word - start).min(WORDS);
            let corners = corner_words(&signs[1], &signs[2], start, count, words);
            let [a, b, c, d, e, f, g, h] = corners;
            for i in 0..count {
                self.active[i] = active_cells([a[i], b[i], c[i], d[i], e[i], f[i], g[i], h[i]]);
            }
            let mut nonzero = nonzero_words::<S>(&mut self.active, count);
            while nonzero != 0 {
                let i = nonzero.trailing_zeros() as usize;
                nonzero &= nonzero - 1;
                let (y, x) = layout.word_position(start + i);
                let active = self.active[i % WORDS] & bits_between(x as usize, x_cells);
                if active == 0 {
                    continue;
                }
                let found = S::positions(active, x, y, &mut self.x, &mut self.y);
                S::cases([a[i], b[i], c[i], d[i], e[i], f[i], g[i], h[i]], active, &mut self.cases);
                list.reserve_word();
                let lacking_row = lacking_z | extent.lacking(1, y as usize);
                for (&x, &case) in self.x[..found].iter().zip(&self.cases) {
                    let (mut case, crossed) = (case as u8, CROSSED_EDGES[usize::from(case as u8)]);
                    let own_case = case;
                    if LOOPS[usize::from(case)].whole_face != 0
                        && is_complemented(layout, signs, case, [x as usize, y as usize, z])
                    {
                        case = !case;
                    }
                    let loops = &LOOPS[usize::from(case)];
                    let lacking = lacking_row | extent.lacking(0, x as usize);
                    let number = base.wrapping_add(list.len as u32);
                    let mut numbers = loops.numbers;
                    if lacking & crossed == 0 {
                        list.push(x, y, own_case, loops.edges[0]);
                        for &edges in &loops.edges[1..usize::from(loops.count)] {
                            list.push(x, y, own_case, edges);
                        }
                    } else {
                        numbers = 0;
                        let mut left = crossed & !lacking;
                        let mut count = 0;
                        for &edges in &loops.edges[..usize::from(loops.count)] {
                            // A border that others continue: the vertex is that of the whole loop.
                            if !extent.is_open && left & edges != 0 {
                                list.push(x, y, own_case, edges);
                                numbers |= numbered(edges, count);
                                count += 1;
                            }
                        }
                        while extent.is_open && left != 0 {
                            let edges = run(case, left & left.wrapping_neg(), left);
                            list.push(x, y, own_case, edges);
                            numbers |= numbered(edges, count);
                            count += 1;
                            left &= !edges;
                        }
                    }
                    cells.0[place(layout, x, y)] = u64::from(number) | u64::from(numbers) << 32;
                }
            }
        }
    }
}

/// The bits of a word that stand for cells from `start` to `end`. `x`: the cell of the lowest bit.
#[inline(always)]
pub(super) const fn bits_between(x: usize, [start, end]: [usize; 2]) -> u64 {
    let low = start.saturating_sub(x);
    let high = end.saturating_sub(x);
    if low >= 64 || high <= low {
        return 0;
    }
    let above = if high >= 64 { 0 } else { u64::MAX << high };
    (u64::MAX << low) & !above
}

/// The number of a vertex of a cell, at all of its edges: two bits each.
const fn numbered(edges: u16, number: u32) -> u32 {
    let (mut numbers, mut edge) = (0, 0);
    while edge < 12 {
        numbers |= ((edges as u32 >> edge & 1) * number) << (2 * edge);
        edge += 1;
    }
    numbers
}

/// Whether a cell takes the loops of its complemented case: all crossings of an ambiguous face lie in one of its loops,
/// and all lie in one loop of the cell across that face, too.
///
/// Four quads would otherwise share the side between the two vertices. This is the rule of Rephael Wenger,
/// "Isosurfaces: Geometry, Topology, and Algorithms" (2013), section 3.3.5.
#[cold]
#[inline(never)]
fn is_complemented(layout: &SlabLayout, signs: &[SlabSigns; 4], case: u8, [x, y, z]: [usize; 3]) -> bool {
    let face = LOOPS[usize::from(case)].whole_face - 1;
    let axis = usize::from(face / 2);
    let mut neighbour = [x, y, z];
    neighbour[axis] = neighbour[axis].wrapping_add(if face & 1 == 1 { 1 } else { usize::MAX });
    if neighbour[axis] >= layout.size[axis] - 1 {
        return false;
    }
    let [x, y, slab] = [neighbour[0], neighbour[1], (neighbour[2] + 1).wrapping_sub(z)];
    let inside = |corner: usize| signs[slab + (corner >> 2)].is_inside(layout, x + (corner & 1), y + (corner >> 1 & 1));
    let other = (0..8).fold(0, |case, corner| case | usize::from(inside(corner)) << corner);
    LOOPS[other].whole_face == (face ^ 1) + 1
}
