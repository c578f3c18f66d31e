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
/// The most vertices of a word of cells.
const ROOM: usize = 4 * 64;

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
        let needed = self.len + ROOM;
        if self.x.len() < needed {
            let len = 2 * needed;
            self.x.resize(len, 0);
            self.y.resize(len, 0);
            self.edges.resize(len, 0);
            self.cases.resize(len, 0);
        }
    }

    /// The room for the vertices of the next word of cells.
    #[inline(always)]
    fn word(&mut self) -> WordOfVertices<'_> {
        self.reserve_word();
        let chunks = (
            self.x[self.len..].first_chunk_mut(),
            self.y[self.len..].first_chunk_mut(),
            self.edges[self.len..].first_chunk_mut(),
            self.cases[self.len..].first_chunk_mut(),
        );
        let (Some(x), Some(y), Some(edges), Some(cases)) = chunks else { unreachable!("a word's vertices fit") };
        WordOfVertices { x, y, edges, cases, len: 0 }
    }
}

/// The vertices of one word of cells, in arrays of fixed length: they need no bounds checks.
struct WordOfVertices<'a> {
    x: &'a mut [u32; ROOM],
    y: &'a mut [u32; ROOM],
    edges: &'a mut [u16; ROOM],
    cases: &'a mut [u8; ROOM],
    len: usize,
}

impl WordOfVertices<'_> {
    /// Writes a vertex behind the others. It is one of them from the next [`advance`](Self::advance) on.
    #[inline(always)]
    fn write(&mut self, [x, y]: [u32; 2], case: u8, edges: u16) {
        let at = self.len % ROOM;
        (self.x[at], self.y[at], self.cases[at], self.edges[at]) = (x, y, case, edges);
    }

    #[inline(always)]
    fn advance(&mut self, is_vertex: bool) {
        self.len += usize::from(is_vertex);
    }
}

/// The low ends of the crossed edges with quads along one axis that begin on one slab, row by row.
#[derive(Clone, Debug)]
pub(super) struct EdgeList {
    /// The first `len` of both are in use.
    x: Vec<u32>,
    y: Vec<u32>,
    len: usize,
}

impl EdgeList {
    pub(super) const fn new() -> Self {
        Self { x: Vec::new(), y: Vec::new(), len: 0 }
    }

    pub(super) fn x(&self) -> &[u32] {
        &self.x[..self.len]
    }

    pub(super) fn y(&self) -> &[u32] {
        &self.y[..self.len]
    }

    /// Appends the edges of one word. `x`: where that of its lowest bit begins.
    #[inline(always)]
    fn push_word<S: Simd>(&mut self, word: u64, [x, y]: [u32; 2]) {
        if self.x.len() < self.len + 64 {
            let len = 2 * (self.len + 64);
            self.x.resize(len, 0);
            self.y.resize(len, 0);
        }
        let chunks = (self.x[self.len..].first_chunk_mut(), self.y[self.len..].first_chunk_mut());
        let (Some(xs), Some(ys)) = chunks else { unreachable!("a word's edges fit") };
        self.len += S::positions(word, x, y, xs, ys);
    }
}

/// The vertices of each active cell of a slab, by the cell's place: the number of its first vertex; for each of its
/// crossings which of its vertices that belongs to, in two bits each from bit 32 on; and in bit 63 whether its lowest
/// corner is inside.
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

    /// Whether the lowest corner of the cell with this [place](place) is inside.
    #[inline(always)]
    pub(super) fn is_inside(&self, place: usize) -> bool {
        self.0[place] >> 63 != 0
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

/// The cells of a slab to be searched.
#[derive(Clone, Copy)]
pub(super) struct CellRows<'a> {
    pub(super) layout: &'a SlabLayout,
    pub(super) extent: &'a Extent,
    pub(super) z: usize,
    /// The signs of the slabs from `z − 1` to `z + 2`, so far as they exist.
    pub(super) signs: &'a [SlabSigns; 4],
}

impl CellSearch {
    pub(super) const fn new() -> Self {
        Self { active: [0; WORDS], x: [0; 64], y: [0; 64], cases: [0; 64] }
    }

    /// Appends the vertices of the cells between a slab and the next to `list`, numbered from `first` on, and lists the
    /// edges with quads that begin on the slab.
    #[inline(always)]
    pub(super) fn find<S: Simd>(
        &mut self,
        rows: CellRows<'_>,
        first: u32,
        cells: &mut CellVertices,
        list: &mut VertexList,
        edges: &mut [EdgeList; 3],
    ) {
        let CellRows { layout, extent, z, signs } = rows;
        cells.resize(layout);
        edges.iter_mut().for_each(|list| list.len = 0);
        let base = first.wrapping_sub(list.len as u32);
        let [x_cells, [first_row, end_row], _] = extent.cells;
        let words = layout.words;
        let (start_word, end_word) = (first_row * words, end_row * words);
        let lacking_z = extent.lacking(2, z);
        let begins = |along: usize, axis: usize, at: usize| extent.first_edge(along, axis) <= at;
        let edges_on_slab = [begins(0, 2, z), begins(1, 2, z), begins(2, 2, z)];
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
                let columns = bits_between(x as usize, x_cells);
                let active = self.active[i % WORDS] & columns;
                if active == 0 {
                    continue;
                }
                let found = S::positions(active, x, y, &mut self.x, &mut self.y);
                S::cases([a[i], b[i], c[i], d[i], e[i], f[i], g[i], h[i]], active, &mut self.cases);
                let lacking_row = lacking_z | extent.lacking(1, y as usize);
                let row = &mut cells.0[place(layout, 0, y)..][..layout.size[0]];
                let first = base.wrapping_add(list.len as u32);
                let mut word = list.word();
                for (&x, &case) in self.x[..found].iter().zip(&self.cases) {
                    let (case, shape) = (case as u8, SHAPES[usize::from(case as u8)]);
                    let lacking = lacking_row | extent.lacking(0, x as usize);
                    let number = first.wrapping_add(word.len as u32);
                    let is_special = shape & SPECIAL != 0 || extent.is_open && shape & lacking != 0;
                    let numbers = if is_special {
                        write_loops(&rows, [x, y], case, lacking, &mut word)
                    } else {
                        word.write([x, y], case, shape);
                        word.advance(shape & !lacking & EDGES != 0);
                        0
                    };
                    row[x as usize] = u64::from(number) | u64::from(numbers) << 32 | u64::from(case) << 63;
                }
                list.len += word.len;

                let crossings = [a[i] ^ b[i], a[i] ^ c[i], a[i] ^ e[i]];
                for along in 0..3 {
                    if edges_on_slab[along] && begins(along, 1, y as usize) {
                        let is_begin = bits_between(x as usize, [extent.first_edge(along, 0), usize::MAX]);
                        edges[along].push_word::<S>(crossings[along] & columns & is_begin, [x, y]);
                    }
                }
            }
        }
    }
}

/// The crossed edges of each case, and [`SPECIAL`].
static SHAPES: [u16; 256] = {
    let (mut shapes, mut case) = ([0; 256], 0);
    while case < 256 {
        let is_special = LOOPS[case].count > 1 || LOOPS[case].whole_face != 0;
        shapes[case] = CROSSED_EDGES[case] | if is_special { SPECIAL } else { 0 };
        case += 1;
    }
    shapes
};

/// All edges, a bit each.
const EDGES: u16 = 0xFFF;
/// The bit of cases with several loops, or with a face that may make them those of the complemented case.
const SPECIAL: u16 = 0x8000;

/// Appends the vertices of a cell with any loops, at most four. `lacking`: its edges without quads, a bit each. Returns
/// the vertices of its crossings, two bits each.
#[inline(never)]
fn write_loops(rows: &CellRows<'_>, cell: [u32; 2], own_case: u8, lacking: u16, word: &mut WordOfVertices<'_>) -> u32 {
    let CellRows { layout, extent, z, signs } = *rows;
    let (mut case, crossed) = (own_case, CROSSED_EDGES[usize::from(own_case)]);
    if LOOPS[usize::from(case)].whole_face != 0
        && is_complemented(layout, signs, case, [cell[0] as usize, cell[1] as usize, z])
    {
        case = !case;
    }
    let mut write = |edges: u16| {
        word.write(cell, own_case, edges);
        word.advance(true);
    };
    let loops = &LOOPS[usize::from(case)];
    let of_loops = &loops.edges[..usize::from(loops.count)];
    if lacking & crossed == 0 {
        of_loops.iter().for_each(|&edges| write(edges));
        return loops.numbers;
    }
    let (mut numbers, mut count) = (0, 0);
    let mut left = crossed & !lacking;
    if extent.is_open {
        while left != 0 {
            let edges = run(case, left & left.wrapping_neg(), left);
            write(edges);
            numbers |= numbered(edges, count);
            count += 1;
            left &= !edges;
        }
    } else {
        // A border that others continue: the vertex is that of the whole loop.
        for &edges in of_loops.iter().filter(|&&edges| left & edges != 0) {
            write(edges);
            numbers |= numbered(edges, count);
            count += 1;
        }
    }
    numbers
}

/// The bits of a word that stand for cells from `start` to `end`. `x`: the cell of the lowest bit.
#[inline(always)]
const fn bits_between(x: usize, [start, end]: [usize; 2]) -> u64 {
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
