//! Pass 3: the triangles between two slabs, with vertex indices from running counters.
//!
//! No map and no search. The vertices of a slab are numbered by their edges' axis, then row by row; every crossing
//! belongs to an active cell; so counters that each active cell advances by its own crossings always stand at the next
//! vertex, and run on from row to row. There are eight: four for the cell's edges along x, and four for those along y and z on its low
//! side. The high side needs none: there the next vertex is the one behind the low side's. Behind each row comes a code that
//! is no cell: it takes the counters past the crossings on the row's last samples, which are on no cell's low side.

use alloc::vec::Vec;

use super::{
    classify::Signs,
    output::{keep, room},
    slabs::{Lattice, shifted},
};
use crate::{
    cases::{CROSSED_EDGES, TRIANGLE_COUNTS, TRIANGLES},
    simd::{CODES, Simd, Tables},
};

/// Codes of cells are their cases; behind these come those that close a row, one for each set of signs of its four last samples.
const CLOSING: u16 = 256;

/// Codes that are gathered before they become triangles: enough to make the loop over them long, few enough to stay in the first cache.
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
    let (words, last_bit) = (lattice.words, (lattice.size[0] - 1) % 64);
    let (low, high) = (&low.words()[..words * lattice.size[1]], &high.words()[..words * lattice.size[1]]);

    let in_first_row = |crossed: fn(&Lattice, &[u64], &[u64], usize) -> u64, a: &[u64], b: &[u64]| {
        (0..words).map(|word| crossed(lattice, a, b, word).count_ones()).sum::<u32>()
    };
    let along_x = |lattice: &Lattice, row: &[u64], _: &[u64], word| lattice.crossed_x(row, word);
    let along_z = |_: &Lattice, low: &[u64], high: &[u64], word: usize| low[word] ^ high[word];
    let mut counters = [
        first.x[0],
        first.x[0].wrapping_add(in_first_row(along_x, &low[..words], &[])),
        first.x[1],
        first.x[1].wrapping_add(in_first_row(along_x, &high[..words], &[])),
        first.y[0],
        first.y[1],
        first.z,
        first.z.wrapping_add(in_first_row(along_z, low, high)),
    ];

    let (mut codes, mut gathered) = ([0u16; GATHERED + 65], 0);
    for y in 0..lattice.size[1] - 1 {
        let at = y * words;
        let rows =
            [&low[at..][..words], &low[at + words..][..words], &high[at..][..words], &high[at + words..][..words]];
        for word in 0..words {
            let signs = rows.map(|row| row[word]);
            let next = rows.map(|row| shifted(row, word));
            let any = signs.iter().chain(&next).fold(0, |any, word| any | word);
            let all = signs.iter().chain(&next).fold(u64::MAX, |all, word| all & word);
            let active = any & !all & lattice.x_edges(word);
            if active != 0 {
                let corners = [signs[0], next[0], signs[1], next[1], signs[2], next[2], signs[3], next[3]];
                let codes = codes[gathered..].first_chunk_mut().expect("there is room for another word's codes");
                gathered += S::cases(corners, active, codes);
            }
            if word + 1 == words {
                let [a, b, c, d] = signs.map(|signs| (signs >> last_bit & 1) as u16);
                let set = a | b << 1 | c << 2 | d << 3;
                codes[gathered] = CLOSING + set;
                gathered += usize::from(set != 0 && set != 15);
            }
            if gathered >= GATHERED {
                flush::<S>(&codes[..gathered], &mut counters, indices);
                gathered = 0;
            }
        }
    }
    flush::<S>(&codes[..gathered], &mut counters, indices);
}

#[inline(always)]
fn flush<S: Simd>(codes: &[u16], counters: &mut [u32; 8], indices: &mut Vec<u32>) {
    let kept = S::triangles(&TABLES, codes, counters, room(indices, 16 * codes.len()));
    // SAFETY: the backend has written them.
    #[expect(unsafe_code, reason = "spares filling the vector with zeros first")]
    unsafe {
        keep(indices, kept);
    }
}

/// What each code adds to the mesh.
pub(crate) static TABLES: Tables = {
    let mut tables = Tables { vertices: [[0; 16]; CODES], steps: [[0; 8]; CODES], counts: [0; CODES] };
    let mut case = 0;
    while case < 256 {
        let crossed = CROSSED_EDGES[case];
        let mut index = 0;
        while index < 15 {
            let edge = TRIANGLES[case][index / 3][index % 3].index();
            tables.vertices[case][index] = if edge < 4 {
                edge as u8
            } else {
                let (low, high) = (edge & !1, edge & 1);
                (4 + (low - 4) / 2 | high << 3 | (high & (crossed >> low & 1) as usize) << 4) as u8
            };
            index += 1;
        }
        let mut lane = 0;
        while lane < 4 {
            tables.steps[case][lane] = (crossed >> lane & 1) as u8;
            tables.steps[case][4 + lane] = (crossed >> (4 + 2 * lane) & 1) as u8;
            lane += 1;
        }
        tables.counts[case] = 3 * TRIANGLE_COUNTS[case];
        case += 1;
    }
    let mut set = 0;
    while set < 16 {
        let [a, b, c, d] = [set & 1, set >> 1 & 1, set >> 2 & 1, set >> 3];
        tables.steps[CLOSING as usize + set] = [0, 0, 0, 0, (a ^ b) as u8, (c ^ d) as u8, (a ^ c) as u8, (b ^ d) as u8];
        set += 1;
    }
    tables
};
