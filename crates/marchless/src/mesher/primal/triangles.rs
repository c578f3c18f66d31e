//! The triangles between two slabs, with vertex indices from running counters.
//!
//! No map and no search. The vertices of a slab are numbered by the axis of their edges, then row by row, and every
//! crossing belongs to an active cell. So each active cell advances the counters by its own crossings, and the counters
//! always hold the index of the next vertex, from row to row. There are eight: four for a cell's edges along x, two for
//! the edges along y on its low side, and two for those along z on its low side. The high side along x needs none: its
//! next vertex is the one behind the low side's. The code at a row's end ([`ROW_END`]) advances the counters past the
//! crossings on the row's last samples, which are on no cell's low side.

use alloc::vec::Vec;

use crate::mesher::{
    output::{commit, reserve},
    trilinear::{DECIDED_CODES, TrilinearCells, decided_case, decided_triangles},
};
use crate::{
    active::{FIRST_FREE_CODE, ROW_END},
    cases::{CROSSED_EDGES, TRIANGLE_COUNTS, TRIANGLES},
    cell::Edge,
    signs::{SlabLayout, SlabSigns, crossing_count},
    simd::{CODES, Recipe, Simd},
};

/// Codes that become triangles in one call: enough for a long loop, few enough to reserve little more than it needs.
const BATCH: usize = 256;

/// The numbers of the first vertices between and on two neighbouring slabs: on edges along x and along y of the low and
/// of the high slab, and on edges along z between them.
#[derive(Clone, Copy, Debug)]
pub(in crate::mesher) struct FirstVertices {
    pub(in crate::mesher) x: [u32; 2],
    pub(in crate::mesher) y: [u32; 2],
    pub(in crate::mesher) z: u32,
}

/// Appends the triangles of all cells between the slabs `low` and `high`. `codes`: those of the active cells.
#[inline(always)]
pub(in crate::mesher) fn write_triangles<S: Simd>(
    layout: &SlabLayout,
    [low, high]: [&SlabSigns; 2],
    first_vertices: &FirstVertices,
    codes: &[u16],
    trilinear: &TrilinearCells,
    indices: &mut Vec<u32>,
) {
    let words = layout.words;
    let first_row = |signs: &[u64], next: &[u64]| crossing_count(&signs[..words], &next[..words]) as u32;
    let mut counters = [
        first_vertices.x[0],
        first_vertices.x[0].wrapping_add(first_row(low.signs(), low.next())),
        first_vertices.x[1],
        first_vertices.x[1].wrapping_add(first_row(high.signs(), high.next())),
        first_vertices.y[0],
        first_vertices.y[1],
        first_vertices.z,
        first_vertices.z.wrapping_add(first_row(low.signs(), high.signs())),
    ];
    let mut done = 0;
    for cell in trilinear.special_cells() {
        write_coded::<S>(&codes[done..cell.code_index], &mut counters, indices);
        let case = codes[cell.code_index].into();
        write_special(case, trilinear.triangles(cell), cell.first_interior, &mut counters, indices);
        done = cell.code_index + 1;
    }
    write_coded::<S>(&codes[done..], &mut counters, indices);
}

/// Appends the triangles of cells that their codes describe.
#[inline(always)]
fn write_coded<S: Simd>(codes: &[u16], counters: &mut [u32; 8], indices: &mut Vec<u32>) {
    for codes in codes.chunks(BATCH) {
        let written = S::triangles(&RECIPES, codes, counters, reserve(indices, 16 * codes.len()));
        // SAFETY: the backend has written them.
        #[expect(unsafe_code, reason = "spares filling the vector with zeros first")]
        unsafe {
            commit(indices, written);
        }
    }
}

/// Appends the triangles of a special cell, and advances the counters past it.
fn write_special(
    case: usize,
    triangles: &[[u8; 3]],
    first_interior: u32,
    counters: &mut [u32; 8],
    indices: &mut Vec<u32>,
) {
    let mut vertices = [0; 32];
    for (edge, index) in vertices[..12].iter_mut().enumerate() {
        let entry = recipe_entry(case, edge);
        *index = counters[usize::from(entry % 8)].wrapping_add(u32::from(entry >> 4));
    }
    for (interior, index) in (0..).zip(&mut vertices[12..]) {
        *index = first_interior.wrapping_add(interior);
    }
    indices.extend(triangles.iter().flat_map(|corners| corners.map(|corner| vertices[usize::from(corner % 32)])));
    for (counter, step) in counters.iter_mut().zip(RECIPES[case].steps) {
        *counter = counter.wrapping_add(step.into());
    }
}

/// The entry of [`Recipe::vertices`] for the vertex on an edge.
const fn recipe_entry(case: usize, edge: usize) -> u8 {
    if edge < 4 {
        return edge as u8;
    }
    let (low, high) = (edge & !1, edge & 1);
    ((4 + (low - 4) / 2) | high << 3 | (high & (CROSSED_EDGES[case] >> low & 1) as usize) << 4) as u8
}

/// The recipe of a cell with the first `count` of these triangles.
const fn recipe(case: usize, count: u8, triangles: &[[Edge; 3]; 5]) -> Recipe {
    let mut recipe = Recipe { vertices: [0; 16], steps: [0; 8], count: 3 * count };
    let mut index = 0;
    while index < 15 {
        recipe.vertices[index] = recipe_entry(case, triangles[index / 3][index % 3].index());
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

/// The triangles of each code, as a recipe for the backends.
static RECIPES: [Recipe; CODES] = {
    let mut recipes = [Recipe { vertices: [0; 16], steps: [0; 8], count: 0 }; CODES];
    let mut case = 0;
    while case < 256 {
        recipes[case] = recipe(case, TRIANGLE_COUNTS[case], &TRIANGLES[case]);
        case += 1;
    }
    let mut case = 0;
    while case < 256 {
        let [a, b, c, d] = [case & 1, case >> 2 & 1, case >> 4 & 1, case >> 6 & 1];
        let steps = [0, 0, 0, 0, (a ^ b) as u8, (c ^ d) as u8, (a ^ c) as u8, (b ^ d) as u8];
        recipes[ROW_END as usize + case].steps = steps;
        case += 1;
    }
    let mut number = 0;
    while number < DECIDED_CODES {
        let (count, triangles) = decided_triangles(number);
        recipes[FIRST_FREE_CODE as usize + number] = recipe(decided_case(number).0 as usize, count, &triangles);
        number += 1;
    }
    recipes
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
