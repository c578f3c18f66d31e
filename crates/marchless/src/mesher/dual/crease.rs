//! Creases in normals: sharp vertices get a copy for each smooth fan of triangles around them.
//!
//! A fan is a run of triangles around a vertex, each at most the crease angle from the next. Its normal is the mean of
//! the triangles' normals by area. Sums are of integers, so the order of triangles does not matter, and blocks that
//! share a vertex agree: with one more layer of padding, each block knows all triangles around its vertices.

use alloc::vec::Vec;

use super::{Offset, VertexKind, quadric::Quadric, quads::Quad};
use crate::{buffer::MeshBuffer, math::sqrt_f64};

/// The fan of a corner at a smooth vertex.
const NONE: u32 = u32::MAX;

/// A triangle.
#[derive(Clone, Copy, Debug)]
struct Facet {
    vertices: [u32; 3],
    is_own: bool,
    /// Twice its area along its normal, in steps.
    normal: [i32; 3],
    /// The length of that.
    length: f64,
}

/// A run of triangles around a vertex.
#[derive(Clone, Copy, Debug)]
struct Fan {
    vertex: u32,
    /// The sum of its triangles' normals.
    normal: [i64; 3],
    /// Whether the mesh has a triangle of it.
    is_own: bool,
    /// The number of its copy of the vertex.
    number: u32,
}

/// Scratch memory.
#[derive(Clone, Debug)]
pub(super) struct Creases {
    facets: Vec<Facet>,
    /// Where each sharp vertex's part of `corners` ends, and that of the vertex before.
    ends: Vec<u32>,
    /// Corners of facets, `3 · facet + corner`, by vertex.
    corners: Vec<u32>,
    /// The fan of each corner; during the search, the first corner of it, as a place in `corners`.
    fan_of: Vec<u32>,
    fans: Vec<Fan>,
}

impl Creases {
    pub(super) const fn new() -> Self {
        Self { facets: Vec::new(), ends: Vec::new(), corners: Vec::new(), fan_of: Vec::new(), fans: Vec::new() }
    }

    /// Drops all fans.
    pub(super) fn clear(&mut self) {
        self.facets.clear();
        self.fan_of.clear();
        self.fans.clear();
    }

    /// Finds the fans around all sharp vertices. `cosine`: that of the crease angle.
    pub(super) fn find(&mut self, cosine: f64, quads: &[Quad], offsets: &[Offset], quadrics: &[Quadric]) {
        self.clear();
        for quad in quads {
            let places = quad.places(offsets);
            let triangles = quad.triangles(offsets, quadrics);
            self.facets.extend(triangles.as_chunks().0.iter().map(|&vertices| Facet::new(quad, vertices, &places)));
        }
        self.gather_corners(offsets);
        self.fan_of.resize(3 * self.facets.len(), NONE);
        let mut start = 0;
        for vertex in 0..offsets.len() {
            let end = self.ends[vertex] as usize;
            self.find_fans(vertex as u32, cosine, start..end);
            start = end;
        }
    }

    /// Lists the corners of all facets at sharp vertices, by vertex.
    fn gather_corners(&mut self, offsets: &[Offset]) {
        let Self { facets, ends, corners, .. } = self;
        let is_sharp = |vertex: u32| offsets[vertex as usize][3] != VertexKind::Smooth as u16;
        ends.clear();
        ends.resize(offsets.len() + 1, 0);
        for &vertex in facets.iter().flat_map(|facet| &facet.vertices).filter(|&&vertex| is_sharp(vertex)) {
            ends[vertex as usize + 1] += 1;
        }
        let mut sum = 0;
        for end in ends.iter_mut() {
            sum += *end;
            *end = sum;
        }
        // Each vertex's number is where its part begins; filling moves it to the part's end.
        corners.clear();
        corners.resize(sum as usize, 0);
        for (corner, &vertex) in facets.iter().flat_map(|facet| &facet.vertices).enumerate() {
            if is_sharp(vertex) {
                let end = &mut ends[vertex as usize];
                corners[*end as usize] = corner as u32;
                *end += 1;
            }
        }
    }

    /// Finds the fans of a vertex. `part`: its corners.
    fn find_fans(&mut self, vertex: u32, cosine: f64, part: core::ops::Range<usize>) {
        let Self { facets, corners, fan_of, fans, .. } = self;
        let corners = &corners[part];
        let facet = |corner: u32| &facets[corner as usize / 3];
        // The vertex of the corner's facet that is `turn` corners further on.
        let other = |corner: u32, turn: usize| facet(corner).vertices[(corner as usize + turn) % 3];
        for (own, &corner) in (0..).zip(corners) {
            fan_of[corner as usize] = own;
        }
        for &corner in corners {
            let next = corners.iter().copied().find(|&next| other(corner, 2) == other(next, 1));
            let Some(next) = next.filter(|&next| facet(corner).is_smooth_to(facet(next), cosine)) else { continue };
            let [first, second] = [corner, next].map(|corner| fan_of[corner as usize]);
            for &joined in corners {
                let fan = &mut fan_of[joined as usize];
                *fan = if *fan == first.max(second) { first.min(second) } else { *fan };
            }
        }
        let first_fan = fans.len();
        for (own, &corner) in (0..).zip(corners) {
            let first = fan_of[corner as usize];
            let number = if first == own {
                fans.push(Fan { vertex, normal: [0; 3], is_own: false, number: NONE });
                fans.len() as u32 - 1
            } else {
                // The fan's first corner comes before, and has its number by now.
                fan_of[corners[first as usize] as usize]
            };
            let (fan, facet) = (&mut fans[number as usize], facet(corner));
            fan.is_own |= facet.is_own;
            for (sum, part) in fan.normal.iter_mut().zip(facet.normal) {
                *sum += i64::from(part);
            }
            fan_of[corner as usize] = number;
        }
        // Normals may cancel out: then the first one is the fan's.
        for (number, fan) in (0..).zip(&mut *fans).skip(first_fan).filter(|(_, fan)| fan.normal == [0; 3]) {
            let first = corners.iter().find(|&&corner| fan_of[corner as usize] == number);
            fan.normal = first.map_or([0, 0, 1], |&corner| facet(corner).normal.map(i64::from));
        }
    }

    /// Numbers the copies: the first fan of a vertex keeps its number in `numbers`, others get those from `count` on.
    /// Returns the number of all vertices.
    pub(super) fn number(&mut self, numbers: &[u32], count: usize) -> u64 {
        let (mut total, mut kept) = (count as u64, NONE);
        for fan in self.fans.iter_mut().filter(|fan| fan.is_own) {
            let is_first = kept != fan.vertex;
            kept = fan.vertex;
            fan.number = if is_first { numbers[fan.vertex as usize] } else { total as u32 };
            total += u64::from(!is_first);
        }
        total
    }

    /// Writes the triangles of the mesh.
    pub(super) fn write_triangles(&self, numbers: &[u32], indices: &mut Vec<u32>) {
        for (facet, fans) in self.facets.iter().zip(self.fan_of.as_chunks::<3>().0).filter(|(facet, _)| facet.is_own) {
            for (&vertex, &fan) in facet.vertices.iter().zip(fans) {
                indices.push(if fan == NONE { numbers[vertex as usize] } else { self.fans[fan as usize].number });
            }
        }
    }

    /// Gives each fan's vertex its normal, and appends the copies. `numbers`: those of the vertices that copies are of.
    pub(super) fn write_normals(&self, numbers: &[u32], out: &mut MeshBuffer) {
        for fan in self.fans.iter().filter(|fan| fan.is_own) {
            let number = fan.number as usize;
            if number == out.positions.len() {
                let copied = numbers[fan.vertex as usize] as usize;
                out.positions.push(out.positions[copied]);
                out.normals.push([0.0; 3]);
                if let Some(&material) = out.materials.get(copied) {
                    out.materials.push(material);
                }
            }
            out.normals[number] = unit(fan.normal);
        }
    }
}

impl Facet {
    fn new(quad: &Quad, vertices: [u32; 3], places: &[[i32; 3]; 4]) -> Self {
        let place = |vertex: u32| {
            let corner = quad.vertices.iter().position(|&other| other == vertex).unwrap_or_default();
            places[corner]
        };
        let [a, b, c] = vertices.map(place);
        let [to_b, to_c] = [b, c].map(|to| [to[0] - a[0], to[1] - a[1], to[2] - a[2]]);
        let normal = [0, 1, 2].map(|axis| {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            to_b[u] * to_c[v] - to_b[v] * to_c[u]
        });
        let squared: i64 = normal.iter().map(|&v| i64::from(v) * i64::from(v)).sum();
        Self { vertices, is_own: quad.is_own, normal, length: sqrt_f64(squared as f64) }
    }

    /// Whether the angle to another facet has a cosine of at least this.
    fn is_smooth_to(&self, other: &Self, cosine: f64) -> bool {
        let product: i64 = self.normal.iter().zip(other.normal).map(|(&a, b)| i64::from(a) * i64::from(b)).sum();
        product as f64 >= cosine * (self.length * other.length)
    }
}

/// The direction of a sum of normals that is not zero.
fn unit(normal: [i64; 3]) -> [f32; 3] {
    let [x, y, z] = normal.map(|v| v as f64);
    let length = sqrt_f64(x * x + y * y + z * z);
    [x, y, z].map(|v| (v / length) as f32)
}

/// The cosine of an angle from 0 to π, by sums and products alone: the same bits on every machine.
pub(super) fn cosine(angle: f32) -> f64 {
    let half = f64::from(angle) / 2.0;
    // The series of the sine of the half angle; what is left out is below 10⁻¹⁶.
    let series = (1..=10).rev().fold(1.0, |rest, k| 1.0 - half * half / f64::from(2 * k * (2 * k + 1)) * rest);
    let sine = half * series;
    1.0 - 2.0 * sine * sine
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cosines_are_those_of_the_standard_library() {
        for step in 0..=1000 {
            let angle = core::f32::consts::PI * step as f32 / 1000.0;
            assert!((cosine(angle) - libm::cos(f64::from(angle))).abs() < 1e-15, "{angle}");
        }
    }
}
