//! Digital topology of a set of lattice points: inside by 6 neighbours, outside by 18.
//!
//! Inside points are connected along lattice edges. Outside points are connected across a square, too, but not across a
//! cube: two lone opposite corners of a cube are separate on either side. So the thickened inside is a complex of its
//! points and of the edges, squares and cubes whose corners are all inside. Each cube that is inside except for two
//! opposite corners has one more piece: its six other corners form a ring of edges without a square, which is filled.
//!
//! The boundary of a body has twice the body's Euler number, and n closed surfaces cut space into n + 1 parts.

use super::disjoint::Disjoint;

/// Lattice points, the outermost of which are outside.
#[derive(Clone, Debug)]
pub(crate) struct Digital {
    /// Points per axis.
    pub(crate) size: [usize; 3],
    /// x fastest.
    pub(crate) inside: Vec<bool>,
}

impl Digital {
    fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        x + self.size[0] * (y + self.size[1] * z)
    }

    fn points(&self) -> impl Iterator<Item = [usize; 3]> + use<> {
        let [nx, ny, nz] = self.size;
        (0..nx * ny * nz).map(move |index| [index % nx, index / nx % ny, index / nx / ny])
    }

    /// The point `step` away, if the lattice has it.
    fn neighbour(&self, point: [usize; 3], step: [isize; 3]) -> Option<usize> {
        let mut other = [0; 3];
        for axis in 0..3 {
            other[axis] = point[axis].checked_add_signed(step[axis]).filter(|&at| at < self.size[axis])?;
        }
        Some(self.index(other))
    }

    /// The number of connected parts of the inside or outside points. Neighbours differ by 1 in at most `most_steps`
    /// coordinates.
    fn parts(&self, inside: bool, most_steps: usize) -> usize {
        let steps = || (0..27).map(|i: isize| [i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1]);
        let mut joined = Disjoint::new(self.inside.len());
        for point in self.points().filter(|&point| self.inside[self.index(point)] == inside) {
            for step in steps().filter(|step| (1..=most_steps).contains(&step.iter().filter(|&&s| s != 0).count())) {
                if let Some(other) = self.neighbour(point, step)
                    && self.inside[other] == inside
                {
                    joined.join(self.index(point), other);
                }
            }
        }
        (0..self.inside.len()).filter(|&point| self.inside[point] == inside && joined.root(point) == point).count()
    }

    pub(crate) fn inside_parts(&self) -> usize {
        self.parts(true, 1)
    }

    pub(crate) fn outside_parts(&self) -> usize {
        self.parts(false, 2)
    }

    /// The Euler number of the inside.
    pub(crate) fn euler(&self) -> i64 {
        // The corners of the point, edge, square or cube that extends from `point` along `axes`, a bit for each axis.
        let corners = |point: [usize; 3], axes: usize| -> Vec<Option<bool>> {
            let offsets = (0..8).filter(|corner| corner & !axes == 0);
            offsets
                .map(|corner| {
                    let step = [0, 1, 2].map(|axis| (corner >> axis & 1) as isize);
                    self.neighbour(point, step).map(|other| self.inside[other])
                })
                .collect()
        };
        let mut euler = 0;
        for point in self.points() {
            for axes in 0..8usize {
                if corners(point, axes).iter().all(|&corner| corner == Some(true)) {
                    euler += if axes.count_ones() % 2 == 0 { 1 } else { -1 };
                }
            }
            let cube = corners(point, 7);
            let outside: Vec<usize> = (0..8).filter(|&corner| cube[corner] != Some(true)).collect();
            euler += i64::from(matches!(outside[..], [a, b] if a + b == 7) && cube.iter().all(Option::is_some));
        }
        euler
    }
}

/// In every cube, the complex has one part for each group of connected inside corners, and no holes, like the thickened
/// inside.
#[test]
fn the_complex_is_sound_in_every_cube() {
    for case in 0..256 {
        let cube = Digital { size: [2; 3], inside: (0..8).map(|corner| case >> corner & 1 == 1).collect() };
        assert_eq!(cube.euler(), cube.inside_parts() as i64, "case {case:08b}");
    }
}
