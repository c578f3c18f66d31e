//! Between vertices and triangles, where asked for: the cells that the signs of their corners leave open, decided as the
//! trilinear interpolant of the corners' weights has it.
//!
//! 128 of the 256 cases are open: 120 have an ambiguous face, and in the other 8, two corners at the ends of a diagonal
//! of the cell may be joined through its middle. Word operations find them among all cells. Most are settled by the
//! faces: the weights of an ambiguous face's corners, multiplied diagonal by diagonal, tell which two are joined (the
//! asymptotic decider), and the same products come out of both cells at the face. A table then has the code of the
//! triangles, as for any other case. Left over are cells of which some loop has no fan, those of more than five
//! triangles, and those whose sheets are joined by a tunnel. These few are made one by one, most of them with vertices in
//! their interior.
//!
//! In a face's products, ties and weights that are not finite leave the inside separated, as in all other meshes.
//!
//! Gregory M. Nielson and Bernd Hamann, "The Asymptotic Decider: Resolving the Ambiguity in Marching Cubes" (1991);
//! Evgeni V. Chernyaev, "Marching Cubes 33: Construction of Topologically Correct Isosurfaces" (1995); Roberto Grosso,
//! "Construction of Topologically Correct and Manifold Isosurfaces" (2016).

mod made;
mod table;
mod tunnel;

use alloc::vec::Vec;

use table::FACE_CORNERS;
pub(super) use table::{EXTRA_CODES, extra_case, extra_triangles};

use super::{
    MeshSettings,
    classify::Signs,
    output::Bounds,
    slabs::Lattice,
    triangles::{WORDS, corner_words},
    vertices::{Planes, filled},
};
use crate::{buffer::MeshBuffer, cell::CaseIndex, sample::Weight, simd::Simd};

/// The decided cells between two slabs, in the order of all cells.
#[derive(Clone, Debug)]
pub(super) struct Exact {
    cells: Vec<ExactCell>,
    /// Of the cells that are made one by one, corners named as in [`Exact::triangles`].
    triangles: Vec<[u8; 3]>,
}

/// A cell whose triangles are not those of its case.
#[derive(Clone, Copy, Debug)]
pub(super) struct ExactCell {
    /// The number of the word of signs that it is in, and of its bit there.
    pub(super) word: usize,
    pub(super) bit: u32,
    /// What to do with it.
    pub(super) change: Change,
}

/// What takes the place of a case.
#[derive(Clone, Copy, Debug)]
pub(super) enum Change {
    /// Another code.
    Code(u16),
    /// Triangles made for this cell.
    Made {
        /// The cell's first vertex in its interior.
        first_interior: u32,
        /// From `start` on, so many of [`Exact::triangles`].
        start: usize,
        count: u8,
    },
}

impl Exact {
    pub(super) const fn new() -> Self {
        Self { cells: Vec::new(), triangles: Vec::new() }
    }

    pub(super) fn clear(&mut self) {
        self.cells.clear();
        self.triangles.clear();
    }

    pub(super) fn cells(&self) -> &[ExactCell] {
        &self.cells
    }

    /// The word of the cell with this number, or a number that no word has.
    pub(super) fn word_of(&self, number: usize) -> usize {
        self.cells.get(number).map_or(usize::MAX, |cell| cell.word)
    }

    /// The triangles of a cell that was made. Corners are named by the edge that they lie on, 0–11, and behind these by
    /// the vertex in the cell's interior.
    pub(super) fn triangles(&self, start: usize, count: u8) -> &[[u8; 3]] {
        &self.triangles[start..][..count.into()]
    }

    /// Decides all open cells between the slabs `low` and `high`; makes their vertices that are on no edge, which are
    /// numbered from `first_vertex` on, and returns how many there are.
    #[inline(always)]
    pub(super) fn decide<S: Simd, W: Weight>(
        &mut self,
        lattice: &Lattice,
        planes: &Planes<'_, W>,
        settings: &MeshSettings,
        [low, high]: [&Signs; 2],
        first_vertex: u64,
        bounds: &mut Bounds,
        out: &mut MeshBuffer,
    ) -> u64 {
        self.clear();
        let mut made = 0;
        let (words, last_bit) = (lattice.words, lattice.last_word ^ lattice.last_word >> 1);
        let mut open = [0; WORDS];
        let cells = words * (lattice.size[1] - 1);
        for start in (0..cells).step_by(WORDS) {
            let count = (cells - start).min(WORDS);
            let [a, b, c, d, e, f, g, h] = corner_words(low, high, start, count, words);
            for i in 0..count {
                open[i] = open_cells([a[i], b[i], c[i], d[i], e[i], f[i], g[i], h[i]]);
            }
            let mut nonzero = S::nonzero(filled(&mut open, count));
            while nonzero != 0 {
                let i = nonzero.trailing_zeros() as usize;
                nonzero &= nonzero - 1;
                let ends_row = words == 1 || (start + i + 1).is_multiple_of(words);
                // Behind a row's last cell, its last samples stand for those that are missing.
                let mut bits = open[i % WORDS] & if ends_row { !last_bit } else { u64::MAX };
                while bits != 0 {
                    let (word, bit) = (start + i, bits.trailing_zeros());
                    bits &= bits - 1;
                    made += self.cell(lattice, planes, settings, word, bit, first_vertex + made, bounds, out);
                }
            }
        }
        made
    }

    /// Decides one cell; returns how many vertices it got in its interior.
    #[inline(never)]
    fn cell<W: Weight>(
        &mut self,
        lattice: &Lattice,
        planes: &Planes<'_, W>,
        settings: &MeshSettings,
        word: usize,
        bit: u32,
        first_vertex: u64,
        bounds: &mut Bounds,
        out: &mut MeshBuffer,
    ) -> u64 {
        let (y, x) = lattice.place_of(word);
        let weights = weights(lattice, planes, settings, x + bit, y);
        let case = case_of(&weights);
        let joined = joined_faces(&weights, case);
        let outcome = table::outcome(case, joined);
        if !outcome.differs_from(case) {
            return 0;
        }
        let waist = if outcome.may_have_tunnel() { tunnel::waist(&weights) } else { None };
        let (mut change, mut made) = (Change::Code(outcome.code()), 0);
        if waist.is_some() || outcome.is_made() {
            let (first_interior, start) = (first_vertex as u32, self.triangles.len());
            let cell = Open { lattice, planes, settings, x: x + bit, y, case, weights };
            made = cell.make(joined, outcome, waist, &mut self.triangles, bounds, out);
            change = Change::Made { first_interior, start, count: (self.triangles.len() - start) as u8 };
        }
        self.cells.push(ExactCell { word, bit, change });
        made
    }
}

/// A cell that is made.
struct Open<'a, W> {
    lattice: &'a Lattice,
    planes: &'a Planes<'a, W>,
    settings: &'a MeshSettings,
    /// The lattice position of its lowest corner.
    x: u32,
    y: u32,
    case: CaseIndex,
    weights: [f64; 8],
}

/// The bits of the cells whose case leaves something open. Bit `x` of `corners[k]` is corner `k` of cell `x`.
#[inline(always)]
const fn open_cells([a, b, c, d, e, f, g, h]: [u64; 8]) -> u64 {
    // Alternating around a face: alike along both diagonals, and not all alike.
    let across_x = !(a ^ g | c ^ e) & (a ^ c) | !(b ^ h | d ^ f) & (b ^ d);
    let across_y = !(a ^ f | b ^ e) & (a ^ b) | !(c ^ h | d ^ g) & (c ^ d);
    let across_z = !(a ^ d | b ^ c) & (a ^ b) | !(e ^ h | f ^ g) & (e ^ f);
    // Alike along all four diagonals of the cell, and one of them unlike the others.
    let diagonal = !(a ^ h | b ^ g | c ^ f | d ^ e) & (a ^ b ^ c ^ d);
    across_x | across_y | across_z | diagonal
}

/// The weights at a cell's corners, less the isovalue, in voxels.
#[inline(always)]
fn weights<W: Weight>(lattice: &Lattice, planes: &Planes<'_, W>, settings: &MeshSettings, x: u32, y: u32) -> [f64; 8] {
    let (at, isovalue) = (lattice.index(x, y), f64::from(settings.isovalue));
    let [_, low, high, _] = planes.slabs;
    let (a, c) = (&low[at..][..2], &low[at + lattice.stride..][..2]);
    let (e, g) = (&high[at..][..2], &high[at + lattice.stride..][..2]);
    let (mut weights, mut corner) =
        ([a[0], a[1], c[0], c[1], e[0], e[1], g[0], g[1]].map(W::to_voxels).map(f64::from), 0);
    while corner < 8 {
        weights[corner] -= isovalue;
        corner += 1;
    }
    weights
}

#[inline(always)]
fn case_of(weights: &[f64; 8]) -> CaseIndex {
    let mut case = 0;
    for (corner, &weight) in weights.iter().enumerate() {
        case |= u8::from(weight < 0.0) << corner;
    }
    CaseIndex(case)
}

/// A bit for each ambiguous face whose inside corners are joined.
#[inline(always)]
fn joined_faces(weights: &[f64; 8], case: CaseIndex) -> u8 {
    let (mut joined, mut face) = (0, 0);
    // Written so that the compiler unrolls it.
    while face < 6 {
        let [a, b, c, d] = FACE_CORNERS[face];
        let (along, across) = (weights[a] * weights[c], weights[b] * weights[d]);
        let (inside, outside) = if case.0 >> a & 1 == 1 { (along, across) } else { (across, along) };
        // Comparisons with NaN are false.
        joined |= u8::from((inside > outside) & (inside < f64::INFINITY)) << face;
        face += 1;
    }
    joined & table::ambiguous_faces(case)
}
