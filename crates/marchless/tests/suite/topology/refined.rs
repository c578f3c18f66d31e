//! The surface of the trilinear interpolant, by refinement: each cell becomes 16 × 16 × 16 small cells, and each of
//! those six simplices. The reference counts changes of sign; it has no cases, no face rule and no saddles.
//!
//! The simplices surround a small cell's diagonal from its lowest to its highest corner, one for each order of the
//! axes; they fit from cell to cell (Freudenthal, Kuhn). Where the ends of a simplex edge have different signs, the
//! surface has a vertex; in a triangle with both signs it has a line, in such a tetrahedron a triangle or a
//! quadrilateral. So the Euler characteristic is edges − triangles + tetrahedra, counting those with both signs.

use std::collections::HashMap;

use super::{
    disjoint::Disjoint,
    pieces::{LatticeEdge, Piece, in_order},
};

/// Small cells per cell and axis.
const STEPS: usize = 16;

/// Samples of a lattice, with so few digits that the refinement is exact.
#[derive(Clone, Debug)]
pub(crate) struct Lattice {
    /// Samples per axis.
    pub(crate) size: [usize; 3],
    /// Negative is inside, zero is outside; x fastest.
    pub(crate) values: Vec<f64>,
}

impl Lattice {
    pub(crate) fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        x + self.size[0] * (y + self.size[1] * z)
    }

    /// The values at the corners of a cell; bit 0 of a corner is its x.
    pub(crate) fn corners(&self, cell: [usize; 3]) -> [f64; 8] {
        core::array::from_fn(|corner| {
            self.values[self.index(core::array::from_fn(|axis| cell[axis] + (corner >> axis & 1)))]
        })
    }

    /// The lowest corners of all cells.
    pub(crate) fn cells(&self) -> impl Iterator<Item = [usize; 3]> + use<> {
        let [nx, ny, nz] = self.size.map(|n| n - 1);
        (0..nz).flat_map(move |z| (0..ny).flat_map(move |y| (0..nx).map(move |x| [x, y, z])))
    }
}

/// The pieces of the surface where the interpolant is zero, in order.
pub(crate) fn pieces_of(lattice: &Lattice) -> Vec<Piece> {
    pieces_in_steps(lattice, STEPS)
}

/// [`pieces_of`] with any number of small cells per cell and axis.
pub(crate) fn pieces_in_steps(lattice: &Lattice, steps: usize) -> Vec<Piece> {
    let refined = Refined::of(lattice, steps);
    let mut surface = Surface::new(&refined);
    surface.cross_tetrahedra();
    surface.cross_faces();
    surface.pieces(lattice, steps)
}

/// The signs at all points of the refined lattice.
struct Refined {
    size: [usize; 3],
    inside: Vec<bool>,
}

impl Refined {
    fn of(lattice: &Lattice, steps: usize) -> Self {
        let size = lattice.size.map(|n| (n - 1) * steps + 1);
        let mut inside = vec![false; size.iter().product()];
        for cell in lattice.cells() {
            let corners = lattice.corners(cell);
            // A mean of positive numbers is positive.
            if corners.iter().all(|&corner| corner > 0.0) {
                continue;
            }
            // Several cells compute the points that they share. The results are equal, since all is exact.
            let mix = |a: f64, b: f64, at: usize| a * (steps - at) as f64 + b * at as f64;
            for z in 0..=steps {
                let [v0, v1, v2, v3] = [0, 1, 2, 3].map(|corner| mix(corners[corner], corners[corner + 4], z));
                for y in 0..=steps {
                    let (low, high) = (mix(v0, v2, y), mix(v1, v3, y));
                    let [i, j, k] = [cell[0] * steps, cell[1] * steps + y, cell[2] * steps + z];
                    let row = &mut inside[i + size[0] * (j + size[1] * k)..][..=steps];
                    for (x, inside) in row.iter_mut().enumerate() {
                        *inside = mix(low, high, x) < 0.0;
                    }
                }
            }
        }
        Self { size, inside }
    }

    /// The distance in memory between the ends of a simplex edge; bit 0 of its direction is a step along x.
    fn step(&self, direction: usize) -> usize {
        (direction & 1) + (direction >> 1 & 1) * self.size[0] + (direction >> 2) * self.size[0] * self.size[1]
    }

    /// The indices of all points from which a step along each of `axes` stays in the lattice.
    fn points(&self, axes: [bool; 3]) -> impl Iterator<Item = usize> + use<> {
        let [nx, ny, _] = self.size;
        let [x_end, y_end, z_end] = core::array::from_fn(|axis| self.size[axis] - usize::from(axes[axis]));
        (0..z_end).flat_map(move |z| (0..y_end).flat_map(move |y| (0..x_end).map(move |x| x + nx * (y + ny * z))))
    }
}

/// The paths from a small cell's lowest corner to its highest, a step along each axis: one for each order of the axes.
const WAYS: [[usize; 4]; 6] = [[0, 1, 3, 7], [0, 1, 5, 7], [0, 2, 3, 7], [0, 2, 6, 7], [0, 4, 5, 7], [0, 4, 6, 7]];

/// The surface: a vertex for each simplex edge with both signs, and the lines and faces between them.
struct Surface<'a> {
    refined: &'a Refined,
    /// One more than a vertex's number, by its edge's lower end and direction (times 7); 0 where there is none.
    numbers: Vec<u32>,
    vertices: usize,
    /// The two vertices of each line; they belong to one piece.
    lines: Vec<[usize; 2]>,
    /// The lines of the rim.
    rim: Vec<[usize; 2]>,
    /// For each triangle or quadrilateral, one of its vertices and its number of sides.
    faces: Vec<(usize, usize)>,
}

impl<'a> Surface<'a> {
    fn new(refined: &'a Refined) -> Self {
        let numbers = vec![0; refined.inside.len() * 7];
        Self { refined, numbers, vertices: 0, lines: Vec::new(), rim: Vec::new(), faces: Vec::new() }
    }

    /// The vertices on a simplex whose `N` points are corners of the small cell at `base`.
    fn vertices_on<const N: usize>(&mut self, base: usize, corners: [usize; N]) -> Vec<usize> {
        let mut vertices = Vec::with_capacity(4);
        let points = corners.map(|corner| base + self.refined.step(corner));
        for high in 1..N {
            for low in 0..high {
                if self.refined.inside[points[low]] != self.refined.inside[points[high]] {
                    let number = &mut self.numbers[points[low] * 7 + (corners[high] - corners[low]) - 1];
                    if *number == 0 {
                        self.vertices += 1;
                        *number = self.vertices as u32;
                    }
                    vertices.push(*number as usize - 1);
                }
            }
        }
        vertices
    }

    fn cross_tetrahedra(&mut self) {
        for base in self.refined.points([true; 3]) {
            let inside = (0..8).filter(|&corner| self.refined.inside[base + self.refined.step(corner)]).count();
            if inside % 8 == 0 {
                continue;
            }
            for way in WAYS {
                let vertices = self.vertices_on(base, way);
                if let &[first, ref others @ ..] = &vertices[..] {
                    self.faces.push((first, vertices.len()));
                    self.lines.extend(others.iter().map(|&other| [first, other]));
                }
            }
        }
    }

    /// Adds the rim, which lies in the faces of the whole box.
    fn cross_faces(&mut self) {
        for axis in 0..3 {
            let (u, v) = (1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
            let across: [bool; 3] = core::array::from_fn(|other| other != axis);
            let stride = self.refined.step(1 << axis);
            let last = self.refined.size[axis] - 1;
            for base in self.refined.points(across) {
                let at = base / stride % self.refined.size[axis];
                if at != 0 && at != last {
                    continue;
                }
                for corners in [[0, u, u + v], [0, v, u + v]] {
                    if let [a, b] = self.vertices_on(base, corners)[..] {
                        self.rim.push([a, b]);
                    }
                }
            }
        }
    }

    fn pieces(&self, lattice: &Lattice, steps: usize) -> Vec<Piece> {
        let [mut joined, mut rims] = [&self.lines, &self.rim].map(|lines| {
            let mut joined = Disjoint::new(self.vertices);
            lines.iter().for_each(|&[a, b]| joined.join(a, b));
            joined
        });
        let mut pieces: HashMap<usize, Piece> = HashMap::new();
        // Twice the number of sides: each is counted by both of its faces, or by one face and the rim.
        let mut sides: HashMap<usize, i64> = HashMap::new();
        for vertex in 0..self.vertices {
            pieces.entry(joined.root(vertex)).or_default().euler += 1;
        }
        for &(vertex, count) in &self.faces {
            let root = joined.root(vertex);
            pieces.entry(root).or_default().euler += 1;
            *sides.entry(root).or_default() += count as i64;
        }
        let mut on_rim = vec![false; self.vertices];
        for &[a, b] in &self.rim {
            *sides.entry(joined.root(a)).or_default() += 1;
            (on_rim[a], on_rim[b]) = (true, true);
        }
        for vertex in (0..self.vertices).filter(|&vertex| on_rim[vertex]) {
            pieces.entry(joined.root(vertex)).or_default().rims += usize::from(rims.root(vertex) == vertex);
        }
        for (root, piece) in &mut pieces {
            assert_eq!(sides[root] % 2, 0, "every side has two ends to its line");
            piece.euler -= sides[root] / 2;
        }
        for (edge, vertex) in self.crossings(lattice, steps) {
            pieces.entry(joined.root(vertex)).or_default().crossings.push(edge);
        }
        in_order(pieces.into_values().collect())
    }

    /// The lattice edges that the surface crosses, each with its vertex.
    fn crossings(&self, lattice: &Lattice, steps: usize) -> Vec<(LatticeEdge, usize)> {
        let mut crossings = Vec::new();
        for axis in 0..3 {
            let [nx, ny, nz] = core::array::from_fn(|other| lattice.size[other] - usize::from(other == axis));
            for [x, y, z] in (0..nx * ny * nz).map(|i| [i % nx, i / nx % ny, i / nx / ny]) {
                let [i, j, k] = [x, y, z].map(|at| at * steps);
                let low = i + self.refined.size[0] * (j + self.refined.size[1] * k);
                let stride = self.refined.step(1 << axis);
                let numbers = (0..steps).map(|step| self.numbers[(low + step * stride) * 7 + (1 << axis) - 1]);
                let found: Vec<u32> = numbers.filter(|&number| number != 0).collect();
                assert!(found.len() < 2, "the interpolant is linear along an edge");
                crossings
                    .extend(found.iter().map(|&number| (([x as u32, y as u32, z as u32], axis), number as usize - 1)));
            }
        }
        crossings
    }
}
