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

pub(super) use table::{EXTRA_CODES, extra_case, extra_triangles};

use super::{MeshSettings, output::Bounds, slabs::Lattice, vertices::Planes};
use crate::{buffer::MeshBuffer, cell::CaseIndex, sample::Weight, simd::Simd};

/// The open cells between two slabs.
#[derive(Clone, Debug)]
pub(super) struct Exact {
    /// In the order of all cells.
    open: Vec<OpenCell>,
    made: Vec<MadeCell>,
    /// Of the cells that are made one by one, corners named as in [`Exact::triangles`].
    triangles: Vec<[u8; 3]>,
}

/// A cell that its signs leave open.
#[derive(Clone, Copy, Debug)]
pub(super) struct OpenCell {
    /// The index of its lowest corner in the slab.
    at: usize,
    /// The place of its code among all codes.
    place: u32,
    /// Its case and its [`joined_faces`], once decided.
    case: CaseIndex,
    joined: u8,
}

impl OpenCell {
    pub(super) const fn new(at: usize, place: u32) -> Self {
        Self { at, place, case: CaseIndex(0), joined: 0 }
    }
}

/// A cell whose triangles are those of no code.
#[derive(Clone, Copy, Debug)]
pub(super) struct MadeCell {
    /// The place of its code among all codes. That is its case.
    pub(super) place: usize,
    /// The first vertex in its interior.
    pub(super) first_interior: u32,
    /// From `start` on, so many of [`Exact::triangles`].
    start: usize,
    count: u8,
}

impl Exact {
    pub(super) const fn new() -> Self {
        Self { open: Vec::new(), made: Vec::new(), triangles: Vec::new() }
    }

    pub(super) fn clear(&mut self) {
        self.open.clear();
        self.made.clear();
        self.triangles.clear();
    }

    /// Where open cells are to be listed, in order.
    pub(super) fn open_cells(&mut self) -> &mut Vec<OpenCell> {
        &mut self.open
    }

    /// The cells that were made, in order.
    pub(super) fn made_cells(&self) -> &[MadeCell] {
        &self.made
    }

    /// The triangles of a cell that was made. Corners are named by the edge that they lie on, 0–11, and behind these by
    /// the vertex in the cell's interior.
    pub(super) fn triangles(&self, cell: &MadeCell) -> &[[u8; 3]] {
        &self.triangles[cell.start..][..cell.count.into()]
    }

    /// Decides all open cells between two slabs and changes their `codes`; makes their vertices that are on no edge,
    /// which are numbered from `first_vertex` on, and returns how many there are.
    #[inline(always)]
    pub(super) fn decide<S: Simd, W: Weight>(
        &mut self,
        lattice: &Lattice,
        planes: &Planes<'_, W>,
        settings: &MeshSettings,
        codes: &mut [u16],
        first_vertex: u64,
        bounds: &mut Bounds,
        out: &mut MeshBuffer,
    ) -> u64 {
        // Without a branch, for which way a cell goes is anyone's guess. Those with more to do move to the front.
        let (mut left, corners) = (0, Corners::new(lattice, planes, settings));
        for index in 0..self.open.len() {
            let cell = self.open[index];
            let weights = corners.weights(cell.at);
            let code = &mut codes[cell.place as usize];
            let case = CaseIndex(*code as u8);
            let larger = S::larger_products(&weights);
            let joined = table::joined_faces(case, larger);
            let outcome = table::outcome(case, joined);
            *code = outcome.code_or(case);
            self.open[left] = OpenCell { case, joined, ..cell };
            left += usize::from(outcome.is_made() | outcome.may_have_tunnel() & tunnel::is_possible(larger));
        }
        if left == 0 {
            return 0;
        }
        self.open.truncate(left);
        self.make(lattice, planes, &corners, settings, codes, first_vertex, bounds, out)
    }

    /// Makes those cells that have to be.
    #[inline(never)]
    fn make<W: Weight>(
        &mut self,
        lattice: &Lattice,
        planes: &Planes<'_, W>,
        corners: &Corners<'_, W>,
        settings: &MeshSettings,
        codes: &mut [u16],
        first_vertex: u64,
        bounds: &mut Bounds,
        out: &mut MeshBuffer,
    ) -> u64 {
        let mut made = 0;
        for &OpenCell { at, place, case, joined } in &self.open {
            let weights = corners.weights(at);
            let outcome = table::outcome(case, joined);
            let waist = if outcome.may_have_tunnel() { tunnel::waist(&weights) } else { None };
            if waist.is_some() || outcome.is_made() {
                let (first_interior, start) = ((first_vertex + made) as u32, self.triangles.len());
                let (x, y) = lattice.position_of(at);
                let cell = Open { lattice, planes, settings, x, y, case, weights };
                made += cell.make(joined, outcome, waist, &mut self.triangles, bounds, out);
                let (place, count) = (place as usize, (self.triangles.len() - start) as u8);
                codes[place] = case.0.into();
                self.made.push(MadeCell { place, first_interior, start, count });
            }
        }
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
pub(super) const fn open_cells([a, b, c, d, e, f, g, h]: [u64; 8]) -> u64 {
    // Alternating around a face: alike along both diagonals, and not all alike.
    let across_x = !(a ^ g | c ^ e) & (a ^ c) | !(b ^ h | d ^ f) & (b ^ d);
    let across_y = !(a ^ f | b ^ e) & (a ^ b) | !(c ^ h | d ^ g) & (c ^ d);
    let across_z = !(a ^ d | b ^ c) & (a ^ b) | !(e ^ h | f ^ g) & (e ^ f);
    // Alike along all four diagonals of the cell, and one of them unlike the others.
    let diagonal = !(a ^ h | b ^ g | c ^ f | d ^ e) & (a ^ b ^ c ^ d);
    across_x | across_y | across_z | diagonal
}

/// The samples of two slabs, such that those at the eight corners of a cell have one index.
struct Corners<'a, W> {
    /// Along x, y and z in turn; the next sample along x is behind each of them.
    rows: [&'a [W]; 4],
    isovalue: f64,
}

impl<'a, W: Weight> Corners<'a, W> {
    #[inline(always)]
    fn new(lattice: &Lattice, planes: &Planes<'a, W>, settings: &MeshSettings) -> Self {
        let [_, low, high, _] = planes.slabs;
        // Of one length, so that one comparison shows that an index is in all of them.
        let len = low.len().min(high.len()) - lattice.stride;
        let rows = [&low[..len], &low[lattice.stride..][..len], &high[..len], &high[lattice.stride..][..len]];
        Self { rows, isovalue: settings.isovalue.into() }
    }

    /// The weights at a cell's corners, less the isovalue, in voxels. `at`: the index of its lowest corner.
    #[inline(always)]
    fn weights(&self, at: usize) -> [f64; 8] {
        let [low, next, high, next_high] = self.rows;
        let ([a, b], [c, d], [e, f], [g, h]) = (pair(low, at), pair(next, at), pair(high, at), pair(next_high, at));
        let (mut weights, mut corner) = ([a, b, c, d, e, f, g, h].map(W::to_voxels).map(f64::from), 0);
        while corner < 8 {
            weights[corner] -= self.isovalue;
            corner += 1;
        }
        weights
    }
}

/// Two neighbouring samples.
#[inline(always)]
fn pair<W: Copy>(samples: &[W], at: usize) -> [W; 2] {
    *samples[at..].first_chunk().expect("a cell's corners are in its slabs")
}
