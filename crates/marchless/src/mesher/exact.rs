//! Between vertices and triangles, where asked for: the cells that the signs of their corners leave open, decided as the
//! trilinear interpolant of the corners' weights has it.
//!
//! 128 of the 256 cases are open: 120 have an ambiguous face, and in the other 8, two corners at the ends of a diagonal
//! of the cell may be joined through its middle. Word operations find them among all cells. Most are settled by the
//! faces: the weights of an ambiguous face's corners, multiplied diagonal by diagonal, tell which two are joined (the
//! asymptotic decider), and the same products come out of both cells at the face. A [table](table) then has the code of
//! the triangles, as for any other case. Left over are cells of which some loop has no fan or too many triangles, or
//! whose sheets are joined by a [tunnel](tunnel). Those few are made here one by one, with vertices in their interior.
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

pub(super) use table::{EXTRA_CODES, extra_case, extra_triangles};
use table::{FACE_CORNERS, Outcome};

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
#[derive(Clone, Debug, Default)]
pub(super) struct Exact {
    cells: Vec<ExactCell>,
    /// Of the cells that are made one by one, corners named as in [`ExactCell::triangles`].
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
        /// From here on, so many of [`Exact::triangles`].
        triangles: [u32; 2],
    },
}

/// A cell that is to be decided.
struct Open<'a, W> {
    lattice: &'a Lattice,
    planes: &'a Planes<'a, W>,
    settings: &'a MeshSettings,
    /// The lattice position of its lowest corner.
    x: u32,
    y: u32,
    case: CaseIndex,
    /// Its corners' weights less the isovalue, in voxels.
    weights: [f64; 8],
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
    pub(super) fn triangles(&self, [start, count]: [u32; 2]) -> &[[u8; 3]] {
        &self.triangles[start as usize..][..count as usize]
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
        let open = Open::new(lattice, planes, settings, x + bit, y);
        let (joined, outcome) = open.decide_faces();
        let waist = if outcome.may_have_tunnel() { tunnel::waist(&open.weights) } else { None };
        if waist.is_none() && !outcome.is_made() {
            if outcome.code() != u16::from(open.case.0) {
                self.cells.push(ExactCell { word, bit, change: Change::Code(outcome.code()) });
            }
            return 0;
        }
        let start = self.triangles.len() as u32;
        let vertices = open.make(joined, waist, &mut self.triangles, bounds, out);
        let triangles = [start, self.triangles.len() as u32 - start];
        let change = Change::Made { first_interior: first_vertex as u32, triangles };
        self.cells.push(ExactCell { word, bit, change });
        vertices
    }
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

impl<'a, W: Weight> Open<'a, W> {
    fn new(lattice: &'a Lattice, planes: &'a Planes<'a, W>, settings: &'a MeshSettings, x: u32, y: u32) -> Self {
        let at = lattice.index(x, y);
        let pair = |corner: usize| {
            let row = &planes.slabs[1 + corner / 4][at + corner / 2 % 2 * lattice.stride..][..2];
            [row[0], row[1]].map(W::to_voxels)
        };
        let ([a, b], [c, d], [e, f], [g, h]) = (pair(0), pair(2), pair(4), pair(6));
        let mut weights = [a, b, c, d, e, f, g, h].map(f64::from);
        let mut case = 0;
        for (corner, weight) in weights.iter_mut().enumerate() {
            *weight -= f64::from(settings.isovalue);
            case |= u8::from(*weight < 0.0) << corner;
        }
        Self { lattice, planes, settings, x, y, case: CaseIndex(case), weights }
    }

    /// A bit for each face whose inside corners are joined, and what that comes to.
    fn decide_faces(&self) -> (u8, Outcome) {
        let (mut faces, mut joined, mut number, mut place) = (table::ambiguous_faces(self.case), 0, 0, 0);
        while faces != 0 {
            let face = faces.trailing_zeros() as usize;
            faces &= faces - 1;
            let [a, b, c, d] = FACE_CORNERS[face].map(|corner| self.weights[corner]);
            let (along, across) = (a * c, b * d);
            let (inside, outside) = if a < 0.0 { (along, across) } else { (across, along) };
            // Comparisons with NaN are false.
            let is_joined = u8::from(inside > outside && inside < f64::INFINITY);
            joined |= is_joined << face;
            number |= usize::from(is_joined) << place;
            place += 1;
        }
        (joined, table::outcome(self.case, number))
    }
}
