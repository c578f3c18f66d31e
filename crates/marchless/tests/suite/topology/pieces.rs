//! A surface up to deformation: its connected pieces, each identified by the lattice edges that it crosses.

use core::fmt;
use std::collections::HashMap;

use marchless::MeshBuffer;

use super::disjoint::Disjoint;

/// An edge of the lattice: the sample at its lower end, and its axis.
pub(crate) type LatticeEdge = ([u32; 3], usize);

/// A connected piece of a surface.
#[derive(Clone, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Piece {
    /// The lattice edges that it crosses, in order. There is at least one: a piece that crossed none would enclose an
    /// extremum of the interpolant within a cell, and extrema are at corners only.
    pub(crate) crossings: Vec<LatticeEdge>,
    /// Its Euler characteristic.
    pub(crate) euler: i64,
    /// The number of loops of its rim.
    pub(crate) rims: usize,
}

/// Short enough to see what differs.
impl fmt::Debug for Piece {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Euler characteristic {}, {} rims, crosses", self.euler, self.rims)?;
        self.crossings.iter().try_for_each(|([x, y, z], axis)| write!(f, " {}{x},{y},{z}", ["x", "y", "z"][*axis]))
    }
}

/// The pieces of a mesh, in order.
pub(crate) fn pieces_of(mesh: &MeshBuffer) -> Vec<Piece> {
    let mut sides: HashMap<[u32; 2], usize> = HashMap::new();
    let mut joined = Disjoint::new(mesh.positions.len());
    for [a, b, c] in mesh.triangles() {
        for [from, to] in [[a, b], [b, c], [c, a]] {
            *sides.entry([from.min(to), from.max(to)]).or_insert(0) += 1;
            joined.join(from as usize, to as usize);
        }
    }
    let mut rim = Disjoint::new(mesh.positions.len());
    let mut pieces: HashMap<usize, Piece> = HashMap::new();
    let mut on_rim = vec![false; mesh.positions.len()];
    for (&[a, b], &triangles) in &sides {
        pieces.entry(joined.root(a as usize)).or_default().euler -= 1;
        if triangles == 1 {
            rim.join(a as usize, b as usize);
            (on_rim[a as usize], on_rim[b as usize]) = (true, true);
        }
    }
    for (vertex, &position) in mesh.positions.iter().enumerate() {
        let piece = pieces.entry(joined.root(vertex)).or_default();
        piece.euler += 1;
        piece.rims += usize::from(on_rim[vertex] && rim.root(vertex) == vertex);
        piece.crossings.extend(lattice_edge(position));
    }
    for [first, ..] in mesh.triangles() {
        pieces.entry(joined.root(first as usize)).or_default().euler += 1;
    }
    in_order(pieces.into_values().collect())
}

/// The lattice edge of a vertex; `None` if it lies inside a cell.
fn lattice_edge(position: [f32; 3]) -> Option<LatticeEdge> {
    let mut along = (0..3).filter(|&axis| position[axis].fract() != 0.0);
    let axis = along.next().expect("crossings keep away from samples");
    along.next().is_none().then_some((position.map(|coordinate| coordinate as u32), axis))
}

pub(crate) fn in_order(mut pieces: Vec<Piece>) -> Vec<Piece> {
    pieces.iter_mut().for_each(|piece| piece.crossings.sort_unstable());
    pieces.sort_unstable();
    pieces
}
