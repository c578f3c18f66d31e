//! Pass 3: the triangles between two slabs, with vertex indices from running counters.
//!
//! No map and no search. The vertices of a slab are numbered by their edges' axis, then row by row; every crossing
//! belongs to an active cell; so counters that each active cell advances by its own crossings always stand at the next
//! vertex, and run on from row to row. There are eight: four for the cell's edges along x, and four for those along y
//! and z on its low side. The high side needs none: there the next vertex is the one behind the low side's. Behind each
//! row comes a code that is no cell: it takes the counters past the crossings on the row's last samples, which are on
//! no cell's low side. It is the case of a cell whose high side repeats these samples, moved up.

use alloc::vec::Vec;

use super::{
    classify::Signs,
    exact::{self, EXTRA_CODES, Exact, OpenCell, extra_case, extra_triangles},
    output::{keep, room},
    slabs::Lattice,
    vertices::filled,
};
use crate::{
    cases::{CROSSED_EDGES, TRIANGLE_COUNTS, TRIANGLES},
    cell::Edge,
    simd::{CODES, Recipe, Simd},
};

/// Codes of cells are their cases; behind these come those that close a row.
const CLOSING: u16 = 256;
/// Behind these come those of cases whose faces were decided otherwise.
pub(super) const FIRST_EXTRA: u16 = 512;

/// Codes that become triangles at once: enough to make the loop over them long, few enough not to ask for much more
/// room than they need.
const AT_ONCE: usize = 256;

/// Words that are looked at together.
const WORDS: usize = 64;

/// The first vertices of two neighbouring slabs on their edges along x and y, and on those along z between them.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct FirstVertices {
    pub(super) x: [u32; 2],
    pub(super) y: [u32; 2],
    pub(super) z: u32,
}

/// The codes of the cells that the surface crosses, in order.
#[derive(Clone, Debug)]
pub(super) struct Codes {
    /// The first `count` count.
    codes: Vec<u16>,
    count: usize,
    /// Of some words of cells: which the surface crosses, which are open, and where each word's first code is. Kept, since
    /// filling them with zeros first would take its time.
    active: [u64; WORDS],
    open: [u64; WORDS],
    firsts: [usize; WORDS],
}

impl Codes {
    pub(super) const fn new() -> Self {
        Self { codes: Vec::new(), count: 0, active: [0; WORDS], open: [0; WORDS], firsts: [0; WORDS] }
    }

    pub(super) fn get_mut(&mut self) -> &mut [u16] {
        &mut self.codes[..self.count]
    }

    /// Takes in all cells between the slabs `low` and `high`, row by row, and lists those that are open if asked to.
    #[inline(always)]
    pub(super) fn fill<S: Simd>(
        &mut self,
        lattice: &Lattice,
        low: &Signs,
        high: &Signs,
        mut open_cells: Option<&mut Vec<OpenCell>>,
    ) {
        let words = lattice.words;
        let last_bit = lattice.last_word ^ lattice.last_word >> 1;
        let Self { active, open, firsts, .. } = self;
        let cells = words * (lattice.size[1] - 1);
        let mut gathered = 0;
        for start in (0..cells).step_by(WORDS) {
            let count = (cells - start).min(WORDS);
            let [a, b, c, d, e, f, g, h] = corner_words(low, high, start, count, words);
            if open_cells.is_some() {
                // In one loop: the corners are loaded once.
                for i in 0..count {
                    let corners = [a[i], b[i], c[i], d[i], e[i], f[i], g[i], h[i]];
                    (active[i], open[i]) = (active_cells(corners), exact::open_cells(corners));
                }
            } else {
                for i in 0..count {
                    active[i] = active_cells([a[i], b[i], c[i], d[i], e[i], f[i], g[i], h[i]]);
                }
            }
            let ends_row = |i: usize| words == 1 || (start + i + 1).is_multiple_of(words);
            if self.codes.len() < gathered + 64 * count {
                self.codes.resize(gathered + 64 * count, 0);
            }
            let codes = &mut self.codes[..];
            let mut nonzero = S::nonzero(filled(active, count));
            while nonzero != 0 {
                let i = nonzero.trailing_zeros() as usize;
                nonzero &= nonzero - 1;
                firsts[i % WORDS] = gathered;
                let corners = [a[i], b[i], c[i], d[i], e[i], f[i], g[i], h[i]];
                let room = codes[gathered..].first_chunk_mut().expect("there is room for another word's codes");
                let found = S::cases(corners, active[i % WORDS], room);
                room[(found - 1) % 64] += if ends_row(i) && active[i % WORDS] & last_bit != 0 { CLOSING } else { 0 };
                gathered += found;
            }
            let Some(open_cells) = &mut open_cells else { continue };
            let mut nonzero = S::nonzero(filled(open, count));
            while nonzero != 0 {
                let i = nonzero.trailing_zeros() as usize;
                nonzero &= nonzero - 1;
                // Behind a row's last cell, its last samples stand for those that are missing.
                let mut bits = open[i % WORDS] & if ends_row(i) { !last_bit } else { u64::MAX };
                let (y, x) = lattice.place_of(start + i);
                let at = lattice.index(x, y);
                while bits != 0 {
                    let below = bits ^ (bits - 1);
                    let place = firsts[i % WORDS] + (active[i % WORDS] & below >> 1).count_ones() as usize;
                    open_cells.push(OpenCell::new(at + bits.trailing_zeros() as usize, place as u32));
                    bits &= bits - 1;
                }
            }
        }
        self.count = gathered;
    }
}

/// Writes the triangles of all cells between the slabs `low` and `high`.
#[inline(always)]
pub(super) fn join<S: Simd>(
    lattice: &Lattice,
    low: &Signs,
    high: &Signs,
    first_vertices: &FirstVertices,
    codes: &mut Codes,
    exact: &Exact,
    indices: &mut Vec<u32>,
) {
    let words = lattice.words;
    let row = |signs: &[u64], next: &[u64]| crossings(&signs[..words], &next[..words]) as u32;
    let mut counters = [
        first_vertices.x[0],
        first_vertices.x[0].wrapping_add(row(low.signs(), low.next())),
        first_vertices.x[1],
        first_vertices.x[1].wrapping_add(row(high.signs(), high.next())),
        first_vertices.y[0],
        first_vertices.y[1],
        first_vertices.z,
        first_vertices.z.wrapping_add(row(low.signs(), high.signs())),
    ];
    let (codes, mut done) = (codes.get_mut(), 0);
    for cell in exact.made_cells() {
        write::<S>(&codes[done..cell.place], &mut counters, indices);
        add(codes[cell.place].into(), exact.triangles(cell), cell.first_interior, &mut counters, indices);
        done = cell.place + 1;
    }
    write::<S>(&codes[done..], &mut counters, indices);
}

/// The bits of the cells that the surface crosses. Bit `x` of `corners[k]` is corner `k` of cell `x`.
#[inline(always)]
const fn active_cells([a, b, c, d, e, f, g, h]: [u64; 8]) -> u64 {
    (a | b | c | d | e | f | g | h) & !(a & b & c & d & e & f & g & h)
}

/// The signs of the eight corners of cells, a word each for `count` words of cells from `start` on.
#[inline(always)]
fn corner_words<'a>(low: &'a Signs, high: &'a Signs, start: usize, count: usize, words: usize) -> [&'a [u64]; 8] {
    let [a, c] = of_rows(low.signs(), start, count, words);
    let [b, d] = of_rows(low.next(), start, count, words);
    let [e, g] = of_rows(high.signs(), start, count, words);
    let [f, h] = of_rows(high.next(), start, count, words);
    [a, b, c, d, e, f, g, h]
}

/// The words from `start` on of a row and of the next one.
#[inline(always)]
fn of_rows(signs: &[u64], start: usize, count: usize, words: usize) -> [&[u64]; 2] {
    [&signs[start..][..count], &signs[start + words..][..count]]
}

/// How many edges between samples of these signs the surface crosses.
#[inline(always)]
pub(super) fn crossings(low: &[u64], high: &[u64]) -> u64 {
    low.iter().zip(high).map(|(low, high)| u64::from((low ^ high).count_ones())).sum()
}

#[inline(always)]
fn write<S: Simd>(codes: &[u16], counters: &mut [u32; 8], indices: &mut Vec<u32>) {
    for codes in codes.chunks(AT_ONCE) {
        let kept = S::triangles(&RECIPES, codes, counters, room(indices, 16 * codes.len()));
        // SAFETY: the backend has written them.
        #[expect(unsafe_code, reason = "spares filling the vector with zeros first")]
        unsafe {
            keep(indices, kept);
        }
    }
}

/// Writes the triangles of a cell that was made, and takes the counters past it.
fn add(case: usize, triangles: &[[u8; 3]], first_interior: u32, counters: &mut [u32; 8], indices: &mut Vec<u32>) {
    let mut vertices = [0; 32];
    for (edge, index) in vertices[..12].iter_mut().enumerate() {
        let vertex = vertex(case, edge);
        *index = counters[usize::from(vertex % 8)].wrapping_add(u32::from(vertex >> 4));
    }
    for (interior, index) in (0..).zip(&mut vertices[12..]) {
        *index = first_interior.wrapping_add(interior);
    }
    indices.extend(triangles.iter().flat_map(|corners| corners.map(|corner| vertices[usize::from(corner % 32)])));
    for (counter, step) in counters.iter_mut().zip(RECIPES[case].steps) {
        *counter = counter.wrapping_add(step.into());
    }
}

/// Which counter an edge's vertex has in a case, as in [`Recipe::vertices`].
const fn vertex(case: usize, edge: usize) -> u8 {
    if edge < 4 {
        return edge as u8;
    }
    let (low, high) = (edge & !1, edge & 1);
    ((4 + (low - 4) / 2) | high << 3 | (high & (CROSSED_EDGES[case] >> low & 1) as usize) << 4) as u8
}

/// The recipe of a cell with these triangles, the first `count` of which count.
const fn recipe(case: usize, count: u8, triangles: &[[Edge; 3]; 5]) -> Recipe {
    let mut recipe = Recipe { vertices: [0; 16], steps: [0; 8], count: 3 * count };
    let mut index = 0;
    while index < 15 {
        recipe.vertices[index] = vertex(case, triangles[index / 3][index % 3].index());
        index += 1;
    }
    let mut lane = 0;
    while lane < 4 {
        recipe.steps[lane] = (CROSSED_EDGES[case] >> lane & 1) as u8;
        recipe.steps[4 + lane] = (CROSSED_EDGES[case] >> (4 + 2 * lane) & 1) as u8;
        lane += 1;
    }
    recipe
}

/// What each code adds to the mesh.
static RECIPES: [Recipe; CODES] = {
    let mut rows = [Recipe { vertices: [0; 16], steps: [0; 8], count: 0 }; CODES];
    let mut case = 0;
    while case < 256 {
        rows[case] = recipe(case, TRIANGLE_COUNTS[case], &TRIANGLES[case]);
        case += 1;
    }
    let mut case = 0;
    while case < 256 {
        let [a, b, c, d] = [case & 1, case >> 2 & 1, case >> 4 & 1, case >> 6 & 1];
        rows[CLOSING as usize + case].steps = [0, 0, 0, 0, (a ^ b) as u8, (c ^ d) as u8, (a ^ c) as u8, (b ^ d) as u8];
        case += 1;
    }
    let mut number = 0;
    while number < EXTRA_CODES {
        let (count, triangles) = extra_triangles(number);
        rows[FIRST_EXTRA as usize + number] = recipe(extra_case(number).0 as usize, count, &triangles);
        number += 1;
    }
    rows
};

/// What the backends rely on.
const _: () = {
    let mut code = 0;
    while code < CODES {
        assert!(RECIPES[code].count <= 15);
        let mut index = 0;
        while index < 16 {
            assert!(RECIPES[code].vertices[index] < 32);
            index += 1;
        }
        code += 1;
    }
};
