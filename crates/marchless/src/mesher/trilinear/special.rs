//! Special cells, meshed one by one: fans, discs around a vertex in the interior, and tunnels.

use alloc::vec::Vec;

use super::{
    table::{FIRST_INTERIOR, Outcome, Sheets},
    tunnel::{RING, Strip, Waist, ring, spaced, straightened_corner, straightened_crossing, strip},
};
use crate::mesher::{output::VertexBounds, settings::MeshSettings};
use crate::{
    buffer::MeshBuffer,
    cases::Loops,
    cell::{CaseIndex, Edge},
    math::sqrt_f64,
    sample::Weight,
    signs::{EdgeSlabs, SlabLayout},
};

/// The least distance of a disc's middle vertex from the faces of the cell.
const MIN_DEPTH: f64 = 1.0 / 16.0;

/// Steps towards the surface end after the first step that is shorter than this.
const SHORTEST_STEP: f64 = 1.0 / 256.0;

/// Meshes one special cell.
pub(super) struct SpecialMesher<'a, W> {
    pub(super) layout: &'a SlabLayout,
    pub(super) edges: &'a EdgeSlabs<'a, W>,
    pub(super) settings: &'a MeshSettings,
    /// The lattice position of the cell's lowest corner.
    pub(super) x: u32,
    pub(super) y: u32,
    pub(super) case: CaseIndex,
    /// The weights at the cell's corners minus the isovalue, in voxels.
    pub(super) weights: [f64; 8],
}

impl<W: Weight> SpecialMesher<'_, W> {
    /// Appends the vertices in the cell's interior and the cell's triangles. Returns the number of those vertices.
    ///
    /// The triangles form a tunnel if there is a waist and it is clear which loops it joins, otherwise the sheets of
    /// `outcome`.
    #[inline(never)]
    pub(super) fn mesh(
        &self,
        joined: u8,
        outcome: Outcome,
        waist: Option<Waist>,
        triangles: &mut Vec<[u8; 3]>,
        bounds: &mut VertexBounds,
        out: &mut MeshBuffer,
    ) -> u64 {
        let interpolant = Interpolant::new(&self.weights);
        if let Some(tunnel) = waist.and_then(|waist| Tunnel::new(self.case, joined, &interpolant, waist)) {
            for corner in tunnel.ring {
                self.vertex(&interpolant, corner, bounds, out);
            }
            triangles.extend(tunnel.strips.iter().flat_map(Strip::triangles));
            triangles.extend_from_slice(tunnel.others.triangles());
            debug_assert!(tunnel.others.rim().is_empty(), "beside a tunnel there is at most one small sheet");
            return RING as u64;
        }
        let sheets =
            if outcome.is_special() { *outcome.sheets() } else { Sheets::new(&Loops::new(self.case, joined), 0) };
        triangles.extend_from_slice(sheets.triangles());
        if sheets.rim().is_empty() {
            return 0;
        }
        let mut sum = [0.0; 3];
        for &edge in sheets.rim() {
            let [x, y, z] = interpolant.crossing(edge);
            sum = [sum[0] + x, sum[1] + y, sum[2] + z];
        }
        let mean = sum.map(|sum| sum / sheets.rim().len() as f64);
        self.vertex(&interpolant, interpolant.nearest_to(mean), bounds, out);
        1
    }

    /// Appends the vertex at the point `at` of the cell.
    fn vertex(&self, interpolant: &Interpolant, at: [f64; 3], bounds: &mut VertexBounds, out: &mut MeshBuffer) {
        let origin = [f64::from(self.x), f64::from(self.y), self.edges.z as f64];
        let position = core::array::from_fn(|axis| (origin[axis] + at[axis]) as f32);
        bounds.include(position);
        out.positions.push(position);
        if self.settings.normals {
            out.normals.push(interpolant.normal(at));
        }
        if let Some(materials) = self.edges.materials {
            let distance = |corner: usize| {
                let [x, y, z] = core::array::from_fn(|axis| (corner >> axis & 1) as f64 - at[axis]);
                x * x + y * y + z * z
            };
            let inside = (0..8).filter(|corner| self.case.0 >> corner & 1 == 1);
            let nearest = inside.min_by(|&a, &b| distance(a).total_cmp(&distance(b))).unwrap_or_default();
            let lowest = self.layout.index(self.x, self.y);
            out.materials.push(materials[nearest / 4][lowest + nearest % 2 + nearest / 2 % 2 * self.layout.stride]);
        }
    }
}

/// The trilinear interpolant of a cell's corner weights, which are finite.
struct Interpolant([f64; 8]);

impl Interpolant {
    fn new(weights: &[f64; 8]) -> Self {
        // Twice the range of `f32`, because the isovalue has been subtracted.
        let [least, most] = [f32::MIN, f32::MAX].map(|limit| 2.0 * f64::from(limit));
        Self(weights.map(|weight| if weight.is_nan() { most } else { weight.clamp(least, most) }))
    }

    /// The point on an edge where the interpolant is 0. The signs of the ends differ.
    fn crossing(&self, edge: Edge) -> [f64; 3] {
        let mut crossing = edge.corners()[0].offset().map(f64::from);
        crossing[edge.axis()] = self.crossing_along(edge);
        crossing
    }

    /// The coordinate of the crossing along the edge.
    fn crossing_along(&self, edge: Edge) -> f64 {
        let [a, b] = edge.corners().map(|corner| self.0[corner.index()]);
        a / (a - b)
    }

    /// The interpolant's value and gradient at a point.
    fn at_with_gradient(&self, [x, y, z]: [f64; 3]) -> (f64, [f64; 3]) {
        let between = |from: f64, to: f64, t: f64| from + (to - from) * t;
        let [a, b, c, d, e, f, g, h] = self.0;
        let along_x = between(between(b - a, d - c, y), between(f - e, h - g, y), z);
        let [a, c, e, g] = [between(a, b, x), between(c, d, x), between(e, f, x), between(g, h, x)];
        let along_y = between(c - a, g - e, z);
        let [low, high] = [between(a, c, y), between(e, g, y)];
        (between(low, high, z), [along_x, along_y, high - low])
    }

    /// The unit direction of the gradient at a point; +z if the gradient is zero.
    fn normal(&self, at: [f64; 3]) -> [f32; 3] {
        let (_, gradient) = self.at_with_gradient(at);
        let largest = gradient.iter().fold(0.0f64, |largest, v| largest.max(v.abs()));
        if largest == 0.0 {
            return [0.0, 0.0, 1.0];
        }
        let [x, y, z] = gradient.map(|v| v / largest);
        let length = sqrt_f64(x * x + y * y + z * z);
        [x, y, z].map(|v| (v / length) as f32)
    }

    /// The point moved along the gradient, to the surface or near it.
    fn nearest_to(&self, mut point: [f64; 3]) -> [f64; 3] {
        for _ in 0..4 {
            let (value, gradient) = self.at_with_gradient(point);
            let [x, y, z] = gradient;
            let step = value / (x * x + y * y + z * z);
            if !step.is_finite() {
                break;
            }
            let before = point;
            point = [0, 1, 2].map(|axis| (point[axis] - step * gradient[axis]).clamp(MIN_DEPTH, 1.0 - MIN_DEPTH));
            if (0..3).all(|axis| (point[axis] - before[axis]).abs() < SHORTEST_STEP) {
                break;
            }
        }
        point
    }
}

/// A tunnel: two loops that share one sheet, and the ring between them.
struct Tunnel {
    /// The ring's corners, in order.
    ring: [[f64; 3]; RING],
    /// The strips between the loops and the ring. The ring's corners are the first vertices in the interior.
    strips: [Strip; 2],
    /// The sheets of the other loops.
    others: Sheets,
}

impl Tunnel {
    /// The tunnel with this waist; `None` if it is unclear which loops it joins.
    fn new(case: CaseIndex, joined: u8, interpolant: &Interpolant, waist: Waist) -> Option<Self> {
        let loops = &Loops::new(case, joined);
        let corner = |corner: usize, waist: &Waist| core::array::from_fn(|axis| waist[axis][corner >> axis & 1]);
        // The interpolant is about 0 on the ring, and farthest from 0 at the ends of the diagonal that the tunnel
        // surrounds.
        let value = |end: usize| interpolant.at_with_gradient(corner(end, &waist)).0;
        let (mut end, mut through) = (0, 0.0f64);
        for other in 0..4 {
            let value = value(other) + value(other ^ 7);
            if value.abs() >= through.abs() {
                (end, through) = (other, value);
            }
        }
        let joined = joined_loops(case, loops, through < 0.0)?;

        let corners = ring(end).map(straightened_corner);
        let names = core::array::from_fn(|index| FIRST_INTERIOR + index as u8);
        let (mut corners_backward, mut names_backward): ([[f64; 3]; RING], [u8; RING]) = (corners, names);
        corners_backward.reverse();
        names_backward.reverse();
        let ring_turn = turn(&corners, end);
        let strip_to = |number: usize| {
            let (mut around, mut around_names) = ([[0.0; 3]; 12], [0; 12]);
            let edges = loops.get(number);
            for ((point, name), &edge) in around.iter_mut().zip(&mut around_names).zip(edges) {
                *point = straightened_crossing(edge, interpolant.crossing_along(edge), &waist);
                *name = edge.index() as u8;
            }
            let around = &around[..edges.len()];
            let forward = turn(around, end) * ring_turn > 0.0;
            let ring = if forward { (&corners, &names) } else { (&corners_backward, &names_backward) };
            Some((forward, strip((around, ring.0), (&around_names[..edges.len()], ring.1))?))
        };
        let ((forward, first), (other_forward, second)) = (strip_to(joined[0])?, strip_to(joined[1])?);
        if forward == other_forward {
            return None;
        }
        let waist = spaced(waist);
        Some(Self {
            ring: ring(end).map(|end| corner(end, &waist)),
            strips: [first, second],
            others: Sheets::new(loops, 1 << joined[0] | 1 << joined[1]),
        })
    }
}

/// The turn of a closed line around the diagonal of a straightened cell from corner `end`: positive for one sense of
/// rotation, negative for the other.
fn turn(points: &[[f64; 3]], end: usize) -> f64 {
    let diagonal: [f64; 3] = core::array::from_fn(|axis| if end >> axis & 1 == 1 { -1.0 } else { 1.0 });
    let (mut sum, mut last) = (0.0, points[points.len() - 1].map(|v| v - 1.5));
    for point in points {
        let ([a, b, c], [d, e, f]) = (last, point.map(|v| v - 1.5));
        sum += diagonal[0] * (b * f - c * e) + diagonal[1] * (c * d - a * f) + diagonal[2] * (a * e - b * d);
        last = [d, e, f];
    }
    sum
}

/// The two loops that a tunnel joins, if that is clear. `goes_around_inside`: true if the tunnel surrounds the inside.
fn joined_loops(case: CaseIndex, loops: &Loops, goes_around_inside: bool) -> Option<[usize; 2]> {
    if loops.count == 2 {
        return Some([0, 1]);
    }
    // The tunnel leads to a corner that a small sheet cuts off, and that has the sign of what the tunnel surrounds.
    let leads_to = |number: &usize| {
        let ends = |edge: &Edge| edge.corners().iter().fold(0, |ends, corner| ends | 1u8 << corner.index());
        let cut_off = loops.get(*number).iter().fold(u8::MAX, |common, edge| common & ends(edge));
        cut_off != 0 && (cut_off & case.0 != 0) == goes_around_inside
    };
    let large = (0..loops.count).find(|&number| loops.get(number).len() > 3)?;
    Some([large, (0..loops.count).find(leads_to)?])
}
