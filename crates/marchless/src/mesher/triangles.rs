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
    output::{keep, room},
    slabs::Lattice,
    vertices::filled,
};
use crate::{
    cases::{CROSSED_EDGES, TRIANGLE_COUNTS, TRIANGLES},
    simd::{CODES, Recipe, Simd},
};

/// Codes of cells are their cases; behind these come those that close a row.
const CLOSING: u16 = 256;

/// Codes that are gathered before they become triangles: enough to make the loop over them long, few enough to stay in
/// the first cache.
const GATHERED: usize = 256;

/// The first vertices of two neighbouring slabs on their edges along x and y, and on those along z between them.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct FirstVertices {
    pub(super) x: [u32; 2],
    pub(super) y: [u32; 2],
    pub(super) z: u32,
}

/// Writes the triangles of all cells between the slabs `low` and `high`, row by row.
#[inline(always)]
pub(super) fn join<S: Simd>(
    lattice: &Lattice,
    low: &Signs,
    high: &Signs,
    first: &FirstVertices,
    indices: &mut Vec<u32>,
) {
    let words = lattice.words;
    let row = |signs: &[u64], next: &[u64]| crossings(&signs[..words], &next[..words]) as u32;
    let mut counters = [
        first.x[0],
        first.x[0].wrapping_add(row(low.signs(), low.next())),
        first.x[1],
        first.x[1].wrapping_add(row(high.signs(), high.next())),
        first.y[0],
        first.y[1],
        first.z,
        first.z.wrapping_add(row(low.signs(), high.signs())),
    ];
    let last_bit = lattice.last_word ^ lattice.last_word >> 1;
    let (mut codes, mut gathered) = ([0u16; GATHERED + 64], 0);
    let mut active = [0; 64];
    let cells = words * (lattice.size[1] - 1);
    for start in (0..cells).step_by(64) {
        let count = (cells - start).min(64);
        // The eight corners of the cells, one word each.
        let [a, c] = of_rows(low.signs(), start, count, words);
        let [b, d] = of_rows(low.next(), start, count, words);
        let [e, g] = of_rows(high.signs(), start, count, words);
        let [f, h] = of_rows(high.next(), start, count, words);
        for i in 0..count {
            let any = a[i] | b[i] | c[i] | d[i] | e[i] | f[i] | g[i] | h[i];
            let all = a[i] & b[i] & c[i] & d[i] & e[i] & f[i] & g[i] & h[i];
            active[i] = any & !all;
        }
        let mut nonzero = S::nonzero(filled(&mut active, count));
        while nonzero != 0 {
            let i = nonzero.trailing_zeros() as usize;
            nonzero &= nonzero - 1;
            let corners = [a[i], b[i], c[i], d[i], e[i], f[i], g[i], h[i]];
            let room = codes[gathered..].first_chunk_mut().expect("there is room for another word's codes");
            gathered += S::cases(corners, active[i % 64], room);
            let ends_row = words == 1 || (start + i + 1).is_multiple_of(words);
            codes[gathered - 1] += if ends_row && active[i % 64] & last_bit != 0 { CLOSING } else { 0 };
            if gathered >= GATHERED {
                flush::<S>(&codes[..gathered], &mut counters, indices);
                gathered = 0;
            }
        }
    }
    flush::<S>(&codes[..gathered], &mut counters, indices);
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
fn flush<S: Simd>(codes: &[u16], counters: &mut [u32; 8], indices: &mut Vec<u32>) {
    let kept = S::triangles(&RECIPES, codes, counters, room(indices, 16 * codes.len()));
    // SAFETY: the backend has written them.
    #[expect(unsafe_code, reason = "spares filling the vector with zeros first")]
    unsafe {
        keep(indices, kept);
    }
}

/// What each code adds to the mesh.
static RECIPES: [Recipe; CODES] = {
    let mut rows = [Recipe { vertices: [0; 16], steps: [0; 8], count: 0 }; CODES];
    let mut case = 0;
    while case < 256 {
        let crossed = CROSSED_EDGES[case];
        let mut index = 0;
        while index < 15 {
            let edge = TRIANGLES[case][index / 3][index % 3].index();
            rows[case].vertices[index] = if edge < 4 {
                edge as u8
            } else {
                let (low, high) = (edge & !1, edge & 1);
                ((4 + (low - 4) / 2) | high << 3 | (high & (crossed >> low & 1) as usize) << 4) as u8
            };
            index += 1;
        }
        let mut lane = 0;
        while lane < 4 {
            rows[case].steps[lane] = (crossed >> lane & 1) as u8;
            rows[case].steps[4 + lane] = (crossed >> (4 + 2 * lane) & 1) as u8;
            lane += 1;
        }
        rows[case].count = 3 * TRIANGLE_COUNTS[case];
        case += 1;
    }
    let mut case = 0;
    while case < 256 {
        let [a, b, c, d] = [case & 1, case >> 2 & 1, case >> 4 & 1, case >> 6 & 1];
        rows[CLOSING as usize + case].steps = [0, 0, 0, 0, (a ^ b) as u8, (c ^ d) as u8, (a ^ c) as u8, (b ^ d) as u8];
        case += 1;
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
