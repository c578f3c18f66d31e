//! A plain dual mesher: cell by cell, with maps, and with loops of its own.
//!
//! It states every rule as directly as it can, and is slow.

use std::collections::{BTreeMap, BTreeSet};

use marchless::cell::{CaseIndex, Corner, Edge, Face};
use marchless::{MaterialSet, Weight};

use super::planes::{Sharp, follows_crease};
use crate::support::exact::{cross, dot, minus};

/// Offsets within a cell are multiples of 1/4096.
pub(crate) const STEPS: i64 = 4096;

/// A vertex of a cell: some of the crossings of one loop.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct CellVertex {
    /// The crossings that it is placed by, in the order of the loop.
    pub(crate) crossings: Vec<Edge>,
}

/// Samples of a box, and which of them are to be meshed.
pub(crate) struct Volume<'a, W> {
    pub(crate) size: [u32; 3],
    pub(crate) weights: &'a [W],
    pub(crate) materials: &'a [u8],
    pub(crate) isovalue: f32,
    /// Whether the outermost samples are padding.
    pub(crate) padded: bool,
    pub(crate) smoothing: u32,
    pub(crate) sharp: MaterialSet,
    pub(crate) crease: Option<f32>,
}

/// A mesh of whole numbers.
#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct Mesh {
    /// In steps from the first sample that is not padding.
    pub(crate) positions: Vec<[i64; 3]>,
    /// The cell of each vertex, in the samples' own coordinates.
    pub(crate) cells: Vec<[u32; 3]>,
    pub(crate) vertices: Vec<CellVertex>,
    pub(crate) materials: Vec<u8>,
    pub(crate) indices: Vec<u32>,
    /// The normals of sharp vertices, if creases show.
    pub(crate) normals: BTreeMap<usize, [u32; 3]>,
}

/// The loops of a case, each with the inside to its left as seen from outside; ordered by their lowest edges.
pub(crate) fn loops_of(case: CaseIndex) -> Vec<Vec<Edge>> {
    let mut next = BTreeMap::new();
    for face in Face::ALL {
        let corners = face.corners();
        let inside = |i: usize| case.is_inside(corners[i % 4]);
        let side = |i: usize| Edge::between(corners[i % 4], corners[(i + 1) % 4]);
        // A run of inside corners goes from `start + 1` to `end`. Diagonal inside corners are two runs.
        for start in (0..4).filter(|&i| !inside(i) && inside(i + 1)) {
            let end = (start + 1..).find(|&i| !inside(i + 1)).expect("the corner at the start is outside");
            next.insert(side(start), side(end));
        }
    }
    let mut loops = Vec::new();
    while let Some((&first, _)) = next.first_key_value() {
        let (mut crossings, mut at) = (Vec::new(), first);
        while let Some(to) = next.remove(&at) {
            crossings.push(at);
            at = to;
        }
        loops.push(crossings);
    }
    loops
}

/// The four edges of a face.
pub(crate) fn sides_of(face: Face) -> Vec<Edge> {
    Edge::ALL.into_iter().filter(|edge| edge.corners().iter().all(|&corner| face.holds(corner))).collect()
}

/// The ambiguous faces all of whose crossings lie in one loop.
pub(crate) fn whole_faces(case: CaseIndex) -> Vec<Face> {
    let loops = loops_of(case);
    let is_whole =
        |face: &Face| loops.iter().any(|crossings| sides_of(*face).iter().all(|side| crossings.contains(side)));
    Face::ALL.into_iter().filter(|&face| case.is_ambiguous(face)).filter(is_whole).collect()
}

/// The face of the cell across `face` that is the same one.
pub(crate) fn opposite(face: Face) -> Face {
    Face::ALL[face.index() ^ 1]
}

impl<W: Weight> Volume<'_, W> {
    pub(crate) fn index(&self, at: [u32; 3]) -> usize {
        let [nx, ny, _] = self.size.map(|n| n as usize);
        let [x, y, z] = at.map(|v| v as usize);
        x + nx * (y + ny * z)
    }

    fn is_inside(&self, at: [u32; 3]) -> bool {
        self.weights[self.index(at)].to_voxels() < self.isovalue
    }

    fn has_cell(&self, cell: [i64; 3]) -> bool {
        (0..3).all(|axis| (0..i64::from(self.size[axis]) - 1).contains(&cell[axis]))
    }

    /// Whether a cell may have vertices: in padded samples, the outermost cells only decide what others do.
    fn has_vertices(&self, cell: [i64; 3]) -> bool {
        let margin = i64::from(self.padded);
        (0..3).all(|axis| (margin..i64::from(self.size[axis]) - 1 - margin).contains(&cell[axis]))
    }

    fn corner(cell: [i64; 3], corner: Corner) -> [u32; 3] {
        let offset = corner.offset();
        [0, 1, 2].map(|axis| (cell[axis] + i64::from(offset[axis])) as u32)
    }

    pub(crate) fn case(&self, cell: [i64; 3]) -> CaseIndex {
        let inside = |&corner: &Corner| self.is_inside(Self::corner(cell, corner));
        CaseIndex(Corner::ALL.iter().filter(|corner| inside(corner)).map(|corner| 1 << corner.index()).sum())
    }

    /// Whether a cell takes the loops of its complement: it and a neighbour both have all crossings of their common
    /// face in one loop.
    pub(crate) fn is_complemented(&self, cell: [i64; 3]) -> bool {
        whole_faces(self.case(cell)).iter().any(|&face| {
            let mut neighbour = cell;
            neighbour[face.axis()] += if face.is_high() { 1 } else { -1 };
            self.has_cell(neighbour) && whole_faces(self.case(neighbour)).contains(&opposite(face))
        })
    }

    /// The cells around an edge of a cell, and which of their edges it is. Both are in the order of the quadrants
    /// (−, −), (+, −), (+, +), (−, +) of the next two axes.
    fn around(cell: [i64; 3], edge: Edge) -> [([i64; 3], Edge); 4] {
        let (axis, low) = (edge.axis(), edge.corners()[0].offset());
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[high_u, high_v]: [u8; 2]| {
            let mut other = [0, 1, 2].map(|k| cell[k] + i64::from(low[k]));
            other[u] += i64::from(high_u) - 1;
            other[v] += i64::from(high_v) - 1;
            let corner = (1 - high_u) << u | (1 - high_v) << v;
            (other, Edge::between(Corner::new(corner), Corner::new(corner | 1 << axis)))
        })
    }

    /// Whether an edge of a cell has a quad: it has all four cells.
    fn has_quad(&self, cell: [i64; 3], edge: Edge) -> bool {
        Self::around(cell, edge).iter().all(|&(other, _)| self.has_vertices(other))
    }

    /// Whether a quad is part of the mesh, and not only of what its vertices are smoothed by.
    fn is_own(&self, cell: [i64; 3], edge: Edge) -> bool {
        let low = Self::corner(cell, edge.corners()[0]);
        let layers = self.layers();
        !self.padded || (0..3).all(|axis| (layers..self.size[axis] - layers).contains(&low[axis]))
    }

    /// The layers of padding on each side.
    fn layers(&self) -> u32 {
        2 + self.smoothing + u32::from(self.crease.is_some())
    }

    /// The lattice point that positions count from, on each axis.
    fn origin(&self) -> i64 {
        if self.padded { i64::from(self.layers()) } else { 0 }
    }

    fn vertices_of(&self, cell: [i64; 3]) -> Vec<CellVertex> {
        let case = self.case(cell);
        let loops = loops_of(if self.is_complemented(cell) { CaseIndex(!case.0) } else { case });
        let mut vertices: Vec<_> = loops.into_iter().flat_map(|crossings| self.split(cell, crossings)).collect();
        vertices.sort_by_key(|vertex| vertex.crossings.iter().min().copied());
        vertices
    }

    /// At an open border, each run of crossings with quads has a vertex of its own.
    fn split(&self, cell: [i64; 3], mut crossings: Vec<Edge>) -> Vec<CellVertex> {
        let Some(gap) = crossings.iter().position(|&edge| !self.has_quad(cell, edge)) else {
            return vec![CellVertex { crossings }];
        };
        if self.padded {
            return vec![CellVertex { crossings }];
        }
        crossings.rotate_left(gap);
        let runs = crossings.split(|&edge| !self.has_quad(cell, edge)).filter(|run| !run.is_empty());
        runs.map(|run| CellVertex { crossings: run.to_vec() }).collect()
    }

    /// The multiple of 2⁻¹⁴ of an edge at which the surface crosses it.
    pub(crate) fn crossing(&self, cell: [i64; 3], edge: Edge) -> i64 {
        let [a, b] = edge.corners().map(|corner| self.weights[self.index(Self::corner(cell, corner))].to_voxels());
        let size = (b * W::SCALE - a * W::SCALE).abs();
        let fraction = if (1e-30..1e30).contains(&size) {
            (self.isovalue * W::SCALE - a * W::SCALE) / (b * W::SCALE - a * W::SCALE)
        } else {
            let finite = |v: f32| f64::from(if v.is_nan() { f32::MAX } else { v.clamp(f32::MIN, f32::MAX) });
            ((f64::from(self.isovalue) - finite(a)) / (finite(b) - finite(a))) as f32
        };
        let fraction = if fraction.is_nan() { 0.0 } else { fraction }.clamp(1.0 / 1024.0, 1023.0 / 1024.0);
        // Ties go to the even one.
        (f64::from(fraction) * 16384.0).round_ties_even() as i64
    }

    /// The mean of a vertex's crossings, in steps from its cell's lowest corner; halves are rounded up.
    fn mean(&self, cell: [i64; 3], vertex: &CellVertex) -> [i64; 3] {
        let count = vertex.crossings.len() as i64;
        [0, 1, 2].map(|axis| {
            let along = |edge: &Edge| {
                if edge.axis() == axis {
                    self.crossing(cell, *edge)
                } else {
                    16384 * i64::from(edge.corners()[0].offset()[axis])
                }
            };
            let sum: i64 = vertex.crossings.iter().map(along).sum();
            (sum + 2 * count).div_euclid(4 * count).clamp(1, STEPS - 1)
        })
    }

    /// The material of the nearest of the inside corners that the vertex's crossings have; of the lowest of several.
    fn material(&self, cell: [i64; 3], vertex: &CellVertex, offset: [i64; 3]) -> u8 {
        let corners: BTreeSet<_> = vertex.crossings.iter().flat_map(|edge| edge.corners()).collect();
        let inside = corners.into_iter().filter(|&corner| self.is_inside(Self::corner(cell, corner)));
        let distance = |corner: &Corner| -> i64 {
            (0..3).map(|axis| (offset[axis] - STEPS * i64::from(corner.offset()[axis])).pow(2)).sum()
        };
        let nearest = inside.min_by_key(distance).expect("a crossing has an inside end");
        self.materials[self.index(Self::corner(cell, nearest))]
    }

    pub(crate) fn mesh(&self) -> Mesh {
        let cells = |axis: usize| 0..i64::from(self.size[axis]) - 1;
        let cells: Vec<[i64; 3]> =
            cells(2).flat_map(|z| cells(1).flat_map(move |y| cells(0).map(move |x| [x, y, z]))).collect();
        let (mut offsets, mut sharp) = (Vec::new(), Vec::new());
        let (mut of_cell, mut places, mut mesh) = (BTreeMap::new(), Vec::new(), Mesh::default());
        for &cell in cells.iter().filter(|&&cell| self.has_vertices(cell)) {
            for vertex in self.vertices_of(cell) {
                for &edge in &vertex.crossings {
                    of_cell.insert((cell, edge), offsets.len());
                }
                let mean = self.mean(cell, &vertex);
                let material = self.material(cell, &vertex, mean);
                let planes = self.sharp.contains(material).then(|| self.sharp(cell, &vertex, mean));
                offsets.push(planes.as_ref().map_or(mean, |planes| planes.offset));
                sharp.push(planes);
                mesh.materials.push(material);
                mesh.vertices.push(vertex);
                places.push(cell);
            }
        }

        let quads = self.quads(&of_cell);
        for _ in 0..self.smoothing {
            let moved = smoothed(&offsets, &places, &quads);
            offsets = (0..offsets.len()).map(|at| if sharp[at].is_some() { offsets[at] } else { moved[at] }).collect();
        }
        let place = |vertex: usize| [0, 1, 2].map(|axis| STEPS * places[vertex][axis] + offsets[vertex][axis]);
        let mut triangles = Vec::new();
        for quad in &quads {
            let middles = quad.vertices.map(|vertex| places[vertex].map(|v| STEPS * v + STEPS / 2));
            let planes = quad.vertices.map(|vertex| sharp[vertex].as_ref());
            let both = quad.triangles(quad.vertices.map(place), middles, planes);
            triangles.extend(both.map(|corners| Triangle::new(corners, place, quad.own)));
        }

        // Vertices without triangles are left out.
        let own = || triangles.iter().filter(|triangle| triangle.own);
        let used: BTreeSet<usize> = own().flat_map(|triangle| triangle.corners).collect();
        let numbers: BTreeMap<usize, usize> = used.iter().copied().zip(0..).collect();
        let mut vertices: Vec<usize> = used.iter().copied().collect();
        let mut copies = BTreeMap::new();
        let mut around: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (at, triangle) in triangles.iter().enumerate() {
            triangle.corners.iter().for_each(|&vertex| around.entry(vertex).or_default().push(at));
        }
        for &vertex in used.iter().filter(|&&vertex| self.crease.is_some() && sharp[vertex].is_some()) {
            let fans = fans(&around[&vertex], &triangles, self.crease.unwrap_or_default());
            let own = fans.into_iter().filter(|fan| fan.iter().any(|&triangle| triangles[triangle].own));
            for (index, fan) in own.enumerate() {
                let number = if index == 0 { numbers[&vertex] } else { vertices.len() };
                if index > 0 {
                    vertices.push(vertex);
                }
                mesh.normals.insert(number, mean_normal(&fan, &triangles));
                copies.extend(fan.into_iter().map(|triangle| ((triangle, vertex), number)));
            }
        }
        for (at, triangle) in triangles.iter().enumerate().filter(|(_, triangle)| triangle.own) {
            let number = |vertex| copies.get(&(at, vertex)).copied().unwrap_or(numbers[&vertex]);
            mesh.indices.extend(triangle.corners.map(|vertex| number(vertex) as u32));
        }
        mesh.positions = vertices.iter().map(|&vertex| place(vertex).map(|v| v - STEPS * self.origin())).collect();
        mesh.cells = vertices.iter().map(|&vertex| places[vertex].map(|v| v as u32)).collect();
        mesh.materials = vertices.iter().map(|&vertex| mesh.materials[vertex]).collect();
        mesh.vertices = vertices.iter().map(|&vertex| mesh.vertices[vertex].clone()).collect();
        mesh
    }

    /// All quads: slab by slab those around edges along x, along y, then along z, each row by row.
    fn quads(&self, of_cell: &BTreeMap<([i64; 3], Edge), usize>) -> Vec<Quad> {
        let [nx, ny, nz] = self.size;
        let mut quads = Vec::new();
        for z in 0..nz {
            for axis in 0..3 {
                for (y, x) in (0..ny).flat_map(|y| (0..nx).map(move |x| (y, x))) {
                    let low = [x, y, z];
                    let mut high = low;
                    high[axis] += 1;
                    if high[axis] >= self.size[axis] || self.is_inside(low) == self.is_inside(high) {
                        continue;
                    }
                    let (cell, edge) = (low.map(i64::from), Edge::ALL[4 * axis]);
                    if self.has_quad(cell, edge) {
                        let vertices = Self::around(cell, edge).map(|place| of_cell[&place]);
                        let (outward, own) = (self.is_inside(low), self.is_own(cell, edge));
                        let sum: i64 = low.iter().map(|&v| i64::from(v) - self.origin()).sum();
                        let odd = self.crease.is_none() && sum.rem_euclid(2) == 1;
                        quads.push(Quad { vertices, odd, axis, outward, own });
                    }
                }
            }
        }
        quads
    }
}

/// A quad around a crossed edge.
struct Quad {
    /// In the order of [`Volume::around`].
    vertices: [usize; 4],
    /// Whether the edge's low end has an odd sum of coordinates, and equally good diagonals alternate.
    odd: bool,
    axis: usize,
    /// Whether the surface's outside is in the direction of the axis.
    outward: bool,
    own: bool,
}

impl Quad {
    /// Two triangles: of both diagonals, the one whose smaller triangle is larger as seen along the edge; at a crease,
    /// if both triangles of both diagonals face the edge, the one that the planes choose.
    fn triangles(&self, places: [[i64; 3]; 4], middles: [[i64; 3]; 4], sharp: [Option<&Sharp>; 4]) -> [[usize; 3]; 2] {
        let [a, b, c, d] = self.vertices;
        let flat = places.map(|place| [place[(self.axis + 1) % 3], place[(self.axis + 2) % 3]]);
        let area = |[p, q, r]: [usize; 3]| {
            let [[px, py], [qx, qy], [rx, ry]] = [flat[p], flat[q], flat[r]];
            (qx - px) * (ry - py) - (qy - py) * (rx - px)
        };
        let first = area([0, 1, 2]).min(area([0, 2, 3]));
        let second = area([0, 1, 3]).min(area([1, 2, 3]));
        assert!(first.max(second) > 0, "one diagonal always has two triangles that face the edge");
        let mut is_second = second > first || second == first && self.odd;
        if first.min(second) > 0 && sharp.iter().flatten().any(|sharp| sharp.is_crease) {
            is_second = follows_crease(is_second, places, middles, sharp);
        }
        match (is_second, self.outward) {
            (false, true) => [[a, b, c], [a, c, d]],
            (true, true) => [[b, c, d], [b, d, a]],
            (false, false) => [[a, d, c], [a, c, b]],
            (true, false) => [[d, c, b], [d, b, a]],
        }
    }
}

/// A triangle, and twice its area along its normal.
struct Triangle {
    corners: [usize; 3],
    normal: [i64; 3],
    own: bool,
}

impl Triangle {
    fn new(corners: [usize; 3], place: impl Fn(usize) -> [i64; 3], own: bool) -> Self {
        let [a, b, c] = corners.map(place);
        Self { corners, normal: cross(minus(b, a), minus(c, a)), own }
    }

    fn length(&self) -> f64 {
        (dot(self.normal, self.normal) as f64).sqrt()
    }
}

/// The runs of triangles around a vertex between creases.
fn fans(around: &[usize], triangles: &[Triangle], crease: f32) -> Vec<Vec<usize>> {
    let mut fans: Vec<Vec<usize>> = Vec::new();
    for &triangle in around {
        let this = &triangles[triangle];
        let goes_on = |&other: &usize| {
            let other = &triangles[other];
            let common = this.corners.iter().filter(|corner| other.corners.contains(corner)).count();
            let least = f64::from(crease).cos() * (this.length() * other.length());
            common == 2 && dot(this.normal, other.normal) as f64 >= least
        };
        let (joined, apart): (Vec<_>, Vec<_>) = fans.into_iter().partition(|fan| fan.iter().any(goes_on));
        let mut fan: Vec<usize> = joined.into_iter().flatten().chain([triangle]).collect();
        fan.sort();
        fans = apart;
        fans.push(fan);
    }
    fans.sort();
    fans
}

fn mean_normal(fan: &[usize], triangles: &[Triangle]) -> [u32; 3] {
    let sum = [0, 1, 2].map(|axis| fan.iter().map(|&triangle| triangles[triangle].normal[axis]).sum::<i64>());
    let [x, y, z] = (if sum == [0; 3] { triangles[fan[0]].normal } else { sum }).map(|v| v as f64);
    let length = (x * x + y * y + z * z).sqrt();
    [x, y, z].map(|v| ((v / length) as f32).to_bits())
}

/// One step of smoothing: each vertex moves half the way to the mean of the vertices that sides of quads join it to, a
/// side of two quads counting twice. Halves are rounded up, and vertices stay in their cells.
fn smoothed(offsets: &[[i64; 3]], places: &[[i64; 3]], quads: &[Quad]) -> Vec<[i64; 3]> {
    let mut sums = vec![([0; 3], 0); offsets.len()];
    for quad in quads {
        for corner in 0..4 {
            let (from, to) = (quad.vertices[corner], quad.vertices[(corner + 1) % 4]);
            for (vertex, other) in [(from, to), (to, from)] {
                let (sum, count) = &mut sums[vertex];
                *count += 1;
                for axis in 0..3 {
                    sum[axis] += STEPS * (places[other][axis] - places[vertex][axis]) + offsets[other][axis];
                }
            }
        }
    }
    let moved = |(offset, (sum, count)): (&[i64; 3], &([i64; 3], i64))| {
        [0, 1, 2].map(|axis| {
            let doubled = offset[axis] * count + sum[axis];
            if *count == 0 { offset[axis] } else { (doubled + count).div_euclid(2 * count).clamp(1, STEPS - 1) }
        })
    };
    offsets.iter().zip(&sums).map(moved).collect()
}
