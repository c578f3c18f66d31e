//! [`SmallJudge`]: a check of tiny meshes that takes about a microsecond. It keeps only a few words per vertex.
//!
//! It knows the samples, so it demands more than [`MeshReport`](marchless::MeshReport): one vertex on each crossing and
//! none elsewhere (except strictly inside cells, where that is allowed), a rim in the faces of the box only, and no
//! side of two triangles in a face of the box, where it could meet a neighbour's side.

use marchless::MeshBuffer;

/// The most vertices that a mesh may have.
const LIMIT: usize = 64;

/// A defect of a mesh. Vertices are given by their indices.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(dead_code, reason = "what the variants hold is there to be printed")]
pub(crate) enum Defect {
    TooManyVertices(usize),
    StrayIndices(usize),
    IndexOutOfRange([u32; 3]),
    VertexTwiceInTriangle([u32; 3]),
    ZeroArea([u32; 3]),
    /// Two triangles have the same side in the same direction.
    SideTwice([u32; 2]),
    /// A side of a single triangle in the interior of the box.
    Crack([usize; 2]),
    /// A side of two triangles, in a face of the box.
    InnerSideInFace([usize; 2]),
    NonManifoldVertex(usize),
    UnusedVertex(usize),
    /// Not finite, on no edge of the lattice, or nearer to its end than 1/1024.
    Misplaced([f32; 3]),
    SamePlace([f32; 3]),
    /// A vertex on the edge from the sample `low` along `axis`, both of whose ends are on the same side.
    NoCrossing {
        axis: usize,
        low: u32,
    },
    /// None on an edge whose ends are on different sides.
    NoVertex {
        axis: usize,
        low: u32,
    },
}

/// The counts of a sound mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Sound {
    /// The number of sides with a single triangle.
    pub(crate) rim: usize,
    /// The number of vertices strictly inside cells.
    pub(crate) interior: usize,
}

/// A box of at most 3 × 3 × 3 samples, and which of them are inside.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SmallBox {
    /// Samples per axis.
    pub(crate) size: [u32; 3],
    /// Bit `x + nx·(y + ny·z)` is set where the sample is inside.
    pub(crate) inside: u32,
}

impl SmallBox {
    pub(crate) const fn len(self) -> u32 {
        self.size[0] * self.size[1] * self.size[2]
    }

    /// The lowest and the highest corner in space.
    pub(crate) fn bounds(self) -> [[f32; 3]; 2] {
        [[0.0; 3], self.size.map(|n| (n - 1) as f32)]
    }

    const fn stride(self, axis: usize) -> u32 {
        match axis {
            0 => 1,
            1 => self.size[0],
            _ => self.size[0] * self.size[1],
        }
    }

    const fn is_inside(self, index: u32) -> bool {
        self.inside >> index & 1 == 1
    }

    /// True if the cell whose lowest corner is the sample at `index` has corners on both sides.
    fn is_active(self, index: u32) -> bool {
        let corners =
            (0..8).map(|corner| index + (0..3).map(|axis| (corner >> axis & 1) * self.stride(axis)).sum::<u32>());
        let count = corners.filter(|&corner| self.is_inside(corner)).count();
        count % 8 != 0
    }

    /// For each axis, a bit for each crossed edge along it, at its lower end.
    fn crossings(self) -> [u32; 3] {
        // A bit for each sample that is not the last along the axis.
        let [nx, ny, nz] = self.size;
        let row = (1 << (nx - 1)) - 1;
        let rows = |count: u32| (0..count).fold(0, |rows, at| rows | row << (at * nx));
        let whole = (1u32 << (nx * ny)) - 1;
        let layers = |layer: u32, count: u32| (0..count).fold(0, |layers, at| layers | layer << (at * nx * ny));
        let lower = [layers(rows(ny), nz), layers((1 << (nx * (ny - 1))) - 1, nz), layers(whole, nz - 1)];
        [0, 1, 2].map(|axis| (self.inside ^ self.inside >> self.stride(axis)) & lower[axis])
    }
}

/// Checks meshes, and keeps its memory between them.
pub(crate) struct SmallJudge {
    /// `follows[a][b]` is the third vertex of the triangle with the side from `a` to `b`.
    follows: Box<[[u8; LIMIT]; LIMIT]>,
    /// For each vertex, a bit for each vertex that a side from it leads to.
    leaving: [u64; LIMIT],
    /// For each vertex, a bit for each vertex that a side to it comes from.
    arriving: [u64; LIMIT],
    /// The faces of the box that each vertex lies in, a bit each.
    faces: [u8; LIMIT],
}

impl SmallJudge {
    pub(crate) fn new() -> Self {
        Self { follows: Box::new([[0; LIMIT]; LIMIT]), leaving: [0; LIMIT], arriving: [0; LIMIT], faces: [0; LIMIT] }
    }

    /// Checks the mesh of the samples of `small`. Vertices inside cells are allowed if `interior` is true.
    pub(crate) fn judge(&mut self, mesh: &MeshBuffer, small: SmallBox, interior: bool) -> Result<Sound, Defect> {
        let count = mesh.positions.len();
        if count > LIMIT {
            return Err(Defect::TooManyVertices(count));
        }
        let interior = self.judge_places(mesh, small, interior)?;
        self.judge_triangles(mesh)?;
        let mut rim = 0;
        for vertex in 0..count {
            rim += self.judge_vertex(vertex)?;
        }
        Ok(Sound { rim, interior })
    }

    /// Returns the number of vertices inside of cells.
    fn judge_places(&mut self, mesh: &MeshBuffer, small: SmallBox, interior: bool) -> Result<usize, Defect> {
        let (mut crossings, mut inner) = ([0u32; 3], 0);
        let (lasts, strides) = (small.size.map(|n| (n - 1) as f32), [0, 1, 2].map(|axis| small.stride(axis)));
        for (vertex, &position) in mesh.positions.iter().enumerate() {
            let (mut faces, mut index, mut between, mut within) = (0, 0, 0, true);
            for axis in 0..3 {
                let last = lasts[axis];
                if !(0.0..=last).contains(&position[axis]) {
                    return Err(Defect::Misplaced(position));
                }
                let low = position[axis] as u32;
                let fraction = position[axis] - low as f32;
                faces |=
                    u8::from(position[axis] == 0.0) << (2 * axis) | u8::from(position[axis] == last) << (2 * axis + 1);
                between |= usize::from(fraction != 0.0) << axis;
                index += low * strides[axis];
                within &= fraction == 0.0 || (1.0 / 1024.0..=1023.0 / 1024.0).contains(&fraction);
            }
            self.faces[vertex] = faces;
            if between == 0b111 && interior && small.is_active(index) {
                if mesh.positions[..vertex].contains(&position) {
                    return Err(Defect::SamePlace(position));
                }
                inner += 1;
            } else if between.count_ones() == 1 && within {
                let axis = between.trailing_zeros() as usize;
                if crossings[axis] >> index & 1 == 1 {
                    return Err(Defect::SamePlace(position));
                }
                crossings[axis] |= 1 << index;
            } else {
                return Err(Defect::Misplaced(position));
            }
        }
        let expected = small.crossings();
        if let Some(axis) = (0..3).find(|&axis| crossings[axis] & !expected[axis] != 0) {
            return Err(Defect::NoCrossing { axis, low: (crossings[axis] & !expected[axis]).trailing_zeros() });
        }
        if let Some(axis) = (0..3).find(|&axis| expected[axis] & !crossings[axis] != 0) {
            return Err(Defect::NoVertex { axis, low: (expected[axis] & !crossings[axis]).trailing_zeros() });
        }
        Ok(inner)
    }

    fn judge_triangles(&mut self, mesh: &MeshBuffer) -> Result<(), Defect> {
        let count = mesh.positions.len();
        self.leaving[..count].fill(0);
        self.arriving[..count].fill(0);
        let (triangles, rest) = mesh.indices.as_chunks::<3>();
        if !rest.is_empty() {
            return Err(Defect::StrayIndices(rest.len()));
        }
        for &triangle in triangles {
            let [a, b, c] = triangle.map(|index| index as usize);
            if a.max(b).max(c) >= count {
                return Err(Defect::IndexOutOfRange(triangle));
            }
            if a == b || b == c || c == a {
                return Err(Defect::VertexTwiceInTriangle(triangle));
            }
            if has_no_area([mesh.positions[a], mesh.positions[b], mesh.positions[c]]) {
                return Err(Defect::ZeroArea(triangle));
            }
            for [from, to, next] in [[a, b, c], [b, c, a], [c, a, b]] {
                if self.leaving[from] >> to & 1 == 1 {
                    return Err(Defect::SideTwice([from as u32, to as u32]));
                }
                self.leaving[from] |= 1 << to;
                self.arriving[to] |= 1 << from;
                self.follows[from][to] = next as u8;
            }
        }
        Ok(())
    }

    /// Returns the number of sides that leave the vertex and have no reverse: 0 or 1.
    fn judge_vertex(&self, vertex: usize) -> Result<usize, Defect> {
        let (leaving, arriving) = (self.leaving[vertex], self.arriving[vertex]);
        if leaving == 0 {
            return Err(Defect::UnusedVertex(vertex));
        }
        // Triangles around the vertex follow each other, along one path or around one ring.
        let open = leaving & !arriving;
        if open.count_ones() > 1 {
            return Err(Defect::NonManifoldVertex(vertex));
        }
        let start = if open == 0 { leaving } else { open }.trailing_zeros() as usize;
        let (mut at, mut seen) = (start, 0);
        while leaving >> at & 1 == 1 && seen < LIMIT {
            at = usize::from(self.follows[vertex][at]);
            seen += 1;
            if at == start {
                break;
            }
        }
        if seen != leaving.count_ones() as usize {
            return Err(Defect::NonManifoldVertex(vertex));
        }
        let mut others = leaving;
        while others != 0 {
            let other = others.trailing_zeros() as usize;
            others &= others - 1;
            let [is_open, is_in_face] = [open >> other & 1 == 1, self.faces[vertex] & self.faces[other] != 0];
            if is_open && !is_in_face {
                return Err(Defect::Crack([vertex, other]));
            }
            if is_in_face && !is_open {
                return Err(Defect::InnerSideInFace([vertex, other]));
            }
        }
        Ok(open.count_ones() as usize)
    }
}

fn has_no_area([a, b, c]: [[f32; 3]; 3]) -> bool {
    let minus = |end: [f32; 3], axis: usize| f64::from(end[axis]) - f64::from(a[axis]);
    (0..3).all(|axis| {
        let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
        minus(b, i) * minus(c, j) == minus(b, j) * minus(c, i)
    })
}
