//! [`Topology::Trilinear`]: ambiguous cells, decided as the trilinear interpolant of their corners' weights has it.
//!
//! A cell is ambiguous if the signs of its corners leave open how its sheets are joined. 128 of the 256 cases are: 120
//! have an ambiguous face, and in the other 8 the cell's middle may join two corners at the ends of a diagonal. Word
//! operations find the ambiguous cells among all others.
//!
//! The faces settle most of them (the asymptotic decider): on an ambiguous face, the product of the weights at the ends
//! of each diagonal tells which two corners are joined, and both cells at the face compute the same products. A table
//! then has the code of the triangles, as for any other case. What is left are special cells: cells with a loop that
//! has no fan, cells of more than five triangles, and cells whose sheets a tunnel joins. They are meshed one by one,
//! most of them with vertices in their interior.
//!
//! In a face's products, ties and weights that are not finite leave the inside separated, as with
//! [`Topology::Separated`].
//!
//! Gregory M. Nielson and Bernd Hamann, "The Asymptotic Decider: Resolving the Ambiguity in Marching Cubes" (1991);
//! Evgeni V. Chernyaev, "Marching Cubes 33: Construction of Topologically Correct Isosurfaces" (1995); Roberto Grosso,
//! "Construction of Topologically Correct and Manifold Isosurfaces" (2016).

mod special;
mod table;
mod tunnel;

use alloc::vec::Vec;

pub(super) use table::{DECIDED_CODES, decided_case, decided_triangles};

#[cfg(doc)]
use super::settings::Topology;
use super::{output::VertexBounds, settings::MeshSettings};
use crate::{
    active::CellList,
    buffer::MeshBuffer,
    cell::CaseIndex,
    sample::Weight,
    signs::{EdgeSlabs, SlabLayout},
    simd::Simd,
};
use special::SpecialMesher;

/// The ambiguous cells between two slabs, and the triangles of the special ones.
#[derive(Clone, Debug)]
pub(super) struct TrilinearCells {
    ambiguous: AmbiguousCells,
    special: Vec<SpecialCell>,
    /// The triangles of all special cells; corners are named as in [`TrilinearCells::triangles`].
    triangles: Vec<[u8; 3]>,
}

/// The ambiguous cells, in the order of all cells.
#[derive(Clone, Debug)]
pub(super) struct AmbiguousCells(Vec<AmbiguousCell>);

#[derive(Clone, Copy, Debug)]
struct AmbiguousCell {
    /// The index of its lowest corner in the slab.
    lowest_corner: usize,
    /// The index of its code among all codes.
    code_index: u32,
    /// Its case and its [`joined_faces`](table::joined_faces), once decided.
    case: CaseIndex,
    joined: u8,
}

/// A cell whose triangles no code describes.
#[derive(Clone, Copy, Debug)]
pub(super) struct SpecialCell {
    /// The index of its code among all codes. The code is its case.
    pub(super) code_index: usize,
    /// The number of the first vertex in its interior.
    pub(super) first_interior: u32,
    /// Its triangles: `count` of [`TrilinearCells::triangles`] from `start` on.
    start: usize,
    count: u8,
}

impl CellList for AmbiguousCells {
    #[inline(always)]
    fn select([a, b, c, d, e, f, g, h]: [u64; 8]) -> u64 {
        // Alternating around a face: alike along both diagonals, and not all alike.
        let across_x = !(a ^ g | c ^ e) & (a ^ c) | !(b ^ h | d ^ f) & (b ^ d);
        let across_y = !(a ^ f | b ^ e) & (a ^ b) | !(c ^ h | d ^ g) & (c ^ d);
        let across_z = !(a ^ d | b ^ c) & (a ^ b) | !(e ^ h | f ^ g) & (e ^ f);
        // Alike along all four diagonals of the cell, and one of them unlike the others.
        let diagonal = !(a ^ h | b ^ g | c ^ f | d ^ e) & (a ^ b ^ c ^ d);
        across_x | across_y | across_z | diagonal
    }

    #[inline(always)]
    fn push(&mut self, lowest_corner: usize, code_index: u32) {
        self.0.push(AmbiguousCell { lowest_corner, code_index, case: CaseIndex(0), joined: 0 });
    }
}

impl TrilinearCells {
    pub(super) const fn new() -> Self {
        Self { ambiguous: AmbiguousCells(Vec::new()), special: Vec::new(), triangles: Vec::new() }
    }

    pub(super) fn clear(&mut self) {
        self.ambiguous.0.clear();
        self.special.clear();
        self.triangles.clear();
    }

    /// The list to fill with the ambiguous cells.
    pub(super) const fn ambiguous_mut(&mut self) -> &mut AmbiguousCells {
        &mut self.ambiguous
    }

    /// The special cells, in the order of all cells.
    pub(super) fn special_cells(&self) -> &[SpecialCell] {
        &self.special
    }

    /// The triangles of a special cell. A corner 0–11 is the vertex on that edge; the vertices in the cell's interior
    /// follow from 12 on.
    pub(super) fn triangles(&self, cell: &SpecialCell) -> &[[u8; 3]] {
        &self.triangles[cell.start..][..cell.count.into()]
    }

    /// Decides all ambiguous cells, changes their `codes`, and meshes the special ones. Returns the number of vertices
    /// in interiors of cells, which are numbered from `first_vertex` on.
    #[inline(always)]
    pub(super) fn decide<S: Simd, W: Weight>(
        &mut self,
        layout: &SlabLayout,
        edges: &EdgeSlabs<'_, W>,
        settings: &MeshSettings,
        codes: &mut [u16],
        first_vertex: u64,
        bounds: &mut VertexBounds,
        out: &mut MeshBuffer,
    ) -> u64 {
        // Without a branch, since no predictor knows how a cell is decided. Cells that need more work move to the
        // front.
        let corners = CornerSamples::new(layout, edges, settings);
        let cells = &mut self.ambiguous.0;
        let mut kept = 0;
        for index in 0..cells.len() {
            let cell = cells[index];
            let weights = corners.weights(cell.lowest_corner);
            let code = &mut codes[cell.code_index as usize];
            let case = CaseIndex(*code as u8);
            let larger = S::larger_products(&weights);
            let joined = table::joined_faces(case, larger);
            let outcome = table::outcome(case, joined);
            *code = outcome.code_or(case);
            cells[kept] = AmbiguousCell { case, joined, ..cell };
            kept += usize::from(outcome.is_special() | outcome.may_have_tunnel() & tunnel::is_possible(larger));
        }
        if kept == 0 {
            return 0;
        }
        cells.truncate(kept);
        self.mesh_special(layout, edges, &corners, settings, codes, first_vertex, bounds, out)
    }

    /// Meshes the special cells among those that [`TrilinearCells::decide`] kept.
    #[inline(never)]
    fn mesh_special<W: Weight>(
        &mut self,
        layout: &SlabLayout,
        edges: &EdgeSlabs<'_, W>,
        corners: &CornerSamples<'_, W>,
        settings: &MeshSettings,
        codes: &mut [u16],
        first_vertex: u64,
        bounds: &mut VertexBounds,
        out: &mut MeshBuffer,
    ) -> u64 {
        let mut made = 0;
        for &AmbiguousCell { lowest_corner, code_index, case, joined } in &self.ambiguous.0 {
            let weights = corners.weights(lowest_corner);
            let outcome = table::outcome(case, joined);
            let waist = if outcome.may_have_tunnel() { tunnel::waist(&weights) } else { None };
            if waist.is_some() || outcome.is_special() {
                let (first_interior, start) = ((first_vertex + made) as u32, self.triangles.len());
                let (x, y) = layout.position_of(lowest_corner);
                let mesher = SpecialMesher { layout, edges, settings, x, y, case, weights };
                made += mesher.mesh(joined, outcome, waist, &mut self.triangles, bounds, out);
                let (code_index, count) = (code_index as usize, (self.triangles.len() - start) as u8);
                codes[code_index] = case.0.into();
                self.special.push(SpecialCell { code_index, first_interior, start, count });
            }
        }
        made
    }
}

/// The samples of two slabs, arranged so that one index finds the eight corners of a cell.
struct CornerSamples<'a, W> {
    /// The corners 0, 2, 4 and 6; each is followed by the corner beside it along x.
    rows: [&'a [W]; 4],
    isovalue: f64,
}

impl<'a, W: Weight> CornerSamples<'a, W> {
    #[inline(always)]
    fn new(layout: &SlabLayout, edges: &EdgeSlabs<'a, W>, settings: &MeshSettings) -> Self {
        let [_, low, high, _] = edges.slabs;
        // Slices of one length, so that one comparison shows that an index is in all of them.
        let len = low.len().min(high.len()) - layout.stride;
        let rows = [&low[..len], &low[layout.stride..][..len], &high[..len], &high[layout.stride..][..len]];
        Self { rows, isovalue: settings.isovalue.into() }
    }

    /// The weights at a cell's corners minus the isovalue, in voxels. `lowest_corner`: its index in the slab.
    #[inline(always)]
    fn weights(&self, lowest_corner: usize) -> [f64; 8] {
        let [low, next, high, next_high] = self.rows;
        let ([a, b], [c, d]) = (pair(low, lowest_corner), pair(next, lowest_corner));
        let ([e, f], [g, h]) = (pair(high, lowest_corner), pair(next_high, lowest_corner));
        let (mut weights, mut corner) = ([a, b, c, d, e, f, g, h].map(W::to_voxels).map(f64::from), 0);
        while corner < 8 {
            weights[corner] -= self.isovalue;
            corner += 1;
        }
        weights
    }
}

/// The sample at `index` and its neighbour at +x.
#[inline(always)]
fn pair<W: Copy>(samples: &[W], index: usize) -> [W; 2] {
    *samples[index..].first_chunk().expect("a cell's corners are in its slabs")
}
