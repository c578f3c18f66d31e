//! Cells that are made one by one: fans, discs around a vertex in the interior, and tunnels.

use alloc::vec::Vec;

use super::{
    Open,
    tunnel::{RING, Strip, Waist, ring, spaced, straightened, strip},
};
use crate::{
    buffer::MeshBuffer,
    cases::{Loops, fan_apex},
    cell::{CaseIndex, Edge},
    math::sqrt_f64,
    mesher::{output::Bounds, vertices::crossing_fraction},
    sample::Weight,
};

/// The name of the first vertex in a cell's interior, behind those on its edges.
const FIRST_INTERIOR: u8 = 12;

/// Vertices in the middle of a disc stay this far from the faces of the cell.
const LEAST_DEPTH: f64 = 1.0 / 16.0;

impl<W: Weight> Open<'_, W> {
    /// Makes the cell's vertices in its interior and appends the cell's triangles. Returns how many vertices there are.
    #[cold]
    #[inline(never)]
    pub(super) fn make(
        &self,
        joined: u8,
        waist: Option<Waist>,
        triangles: &mut Vec<[u8; 3]>,
        bounds: &mut Bounds,
        out: &mut MeshBuffer,
    ) -> u64 {
        let loops = Loops::new(self.case, joined);
        let field = Trilinear::new(&self.weights);
        let crossings = self.crossings();
        let mut names = FIRST_INTERIOR..;
        let mut vertex = |at| {
            self.vertex(&field, at, bounds, out);
            names.next().unwrap_or_default()
        };
        let tunnel = waist.and_then(|waist| Tunnel::new(self.case, &loops, &field, waist));
        if let Some(tunnel) = &tunnel {
            for corner in tunnel.ring {
                vertex(corner);
            }
            triangles.extend(tunnel.strips.iter().flat_map(Strip::triangles));
        }
        for number in (0..loops.count).filter(|number| tunnel.as_ref().is_none_or(|t| !t.loops.contains(number))) {
            let around = loops.get(number);
            let len = around.len();
            let name = |index: usize| around[index % len].index() as u8;
            if let Some(apex) = fan_apex(around) {
                triangles.extend((1..len - 1).map(|step| [name(apex), name(apex + step), name(apex + step + 1)]));
            } else {
                let middle = vertex(field.middle_of(around, &crossings));
                triangles.extend((0..len).map(|index| [middle, name(index), name(index + 1)]));
            }
        }
        u64::from(names.start - FIRST_INTERIOR)
    }

    /// Where the surface crosses the cell's edges; 0 on others.
    fn crossings(&self) -> [[f64; 3]; 12] {
        let at = self.lattice.index(self.x, self.y);
        let weight =
            |corner: usize| self.planes.slabs[1 + corner / 4][at + corner % 2 + corner / 2 % 2 * self.lattice.stride];
        Edge::ALL.map(|edge| {
            let [low, high] = edge.corners();
            let mut crossing = low.offset().map(f64::from);
            if self.case.crosses(edge) {
                let isovalue = self.settings.isovalue * W::SCALE;
                crossing[edge.axis()] =
                    f64::from(crossing_fraction(weight(low.index()), weight(high.index()), isovalue));
            }
            crossing
        })
    }

    /// Appends a vertex to the mesh. `at`: in the cell.
    fn vertex(&self, field: &Trilinear, at: [f64; 3], bounds: &mut Bounds, out: &mut MeshBuffer) {
        let lowest = [f64::from(self.x), f64::from(self.y), self.planes.z as f64];
        let position = core::array::from_fn(|axis| (lowest[axis] + at[axis]) as f32);
        bounds.include(position);
        out.positions.push(position);
        if self.settings.normals {
            out.normals.push(field.normal(at));
        }
        if let Some(materials) = self.planes.materials {
            let distance = |corner: usize| {
                let [x, y, z] = core::array::from_fn(|axis| (corner >> axis & 1) as f64 - at[axis]);
                x * x + y * y + z * z
            };
            let inside = (0..8).filter(|corner| self.case.0 >> corner & 1 == 1);
            let nearest = inside.min_by(|&a, &b| distance(a).total_cmp(&distance(b))).unwrap_or_default();
            let place = self.lattice.index(self.x, self.y);
            out.materials.push(materials[nearest / 4][place + nearest % 2 + nearest / 2 % 2 * self.lattice.stride]);
        }
    }
}

/// The trilinear interpolant of a cell's weights, all of them finite.
struct Trilinear([f64; 8]);

impl Trilinear {
    fn new(weights: &[f64; 8]) -> Self {
        let [least, most] = [f32::MIN, f32::MAX].map(f64::from);
        Self(weights.map(|weight| if weight.is_nan() { most } else { weight.clamp(least, most) }))
    }

    fn at(&self, [x, y, z]: [f64; 3]) -> f64 {
        let between = |from: f64, to: f64, t: f64| from + (to - from) * t;
        let [a, b, c, d, e, f, g, h] = self.0;
        let low = between(between(a, b, x), between(c, d, x), y);
        let high = between(between(e, f, x), between(g, h, x), y);
        between(low, high, z)
    }

    /// Where the interpolant is 0 on an edge, whose ends differ in sign.
    fn crossing(&self, edge: Edge) -> [f64; 3] {
        let [low, high] = edge.corners();
        let (a, b) = (self.0[low.index()], self.0[high.index()]);
        let mut crossing = low.offset().map(f64::from);
        crossing[edge.axis()] = a / (a - b);
        crossing
    }

    fn gradient(&self, at: [f64; 3]) -> [f64; 3] {
        core::array::from_fn(|axis| {
            let [mut low, mut high] = [at; 2];
            (low[axis], high[axis]) = (0.0, 1.0);
            self.at(high) - self.at(low)
        })
    }

    /// The direction in which the weights grow; up where they do not.
    fn normal(&self, at: [f64; 3]) -> [f32; 3] {
        let gradient = self.gradient(at);
        let largest = gradient.iter().fold(0.0f64, |largest, v| largest.max(v.abs()));
        if largest == 0.0 {
            return [0.0, 0.0, 1.0];
        }
        let [x, y, z] = gradient.map(|v| v / largest);
        let length = sqrt_f64(x * x + y * y + z * z);
        [x, y, z].map(|v| (v / length) as f32)
    }

    /// A point within a loop of crossings, near the surface: their mean, moved along the gradient.
    fn middle_of(&self, around: &[Edge], crossings: &[[f64; 3]; 12]) -> [f64; 3] {
        let mut point = [0, 1, 2]
            .map(|axis| around.iter().map(|edge| crossings[edge.index()][axis]).sum::<f64>() / around.len() as f64);
        for _ in 0..4 {
            let (value, gradient) = (self.at(point), self.gradient(point));
            let step = value / gradient.iter().map(|v| v * v).sum::<f64>();
            if !step.is_finite() {
                break;
            }
            point = [0, 1, 2].map(|axis| (point[axis] - step * gradient[axis]).clamp(LEAST_DEPTH, 1.0 - LEAST_DEPTH));
        }
        point
    }
}

/// Two loops whose sheets are one, and the ring between them.
struct Tunnel {
    loops: [usize; 2],
    /// Where the ring's corners are, in order.
    ring: [[f64; 3]; RING],
    /// The strips between the loops and the ring, whose corners are the first vertices in the interior.
    strips: [Strip; 2],
}

impl Tunnel {
    /// `None` where it cannot be told what is to be joined.
    fn new(case: CaseIndex, loops: &Loops, field: &Trilinear, waist: Waist) -> Option<Self> {
        let corner = |corner: usize, waist: &Waist| core::array::from_fn(|axis| waist[axis][corner >> axis & 1]);
        // On the ring the interpolant is about 0. What the tunnel goes around is farthest from that.
        let through = |end: usize| field.at(corner(end, &waist)) + field.at(corner(end ^ 7, &waist));
        let end = (0..4).max_by(|&a, &b| through(a).abs().total_cmp(&through(b).abs()))?;
        let joined = joined_loops(case, loops, through(end) < 0.0)?;

        let corners = ring(end).map(|end| straightened(corner(end, &waist), &waist));
        let names = core::array::from_fn(|index| FIRST_INTERIOR + index as u8);
        let (mut corners_backward, mut names_backward): ([[f64; 3]; RING], [u8; RING]) = (corners, names);
        corners_backward.reverse();
        names_backward.reverse();
        let strip_to = |number: usize, forward: bool| {
            let (mut around, mut around_names) = ([[0.0; 3]; 12], [0; 12]);
            let edges = loops.get(number);
            for (index, &edge) in edges.iter().enumerate() {
                (around[index], around_names[index]) = (straightened(field.crossing(edge), &waist), edge.index() as u8);
            }
            let ring = if forward { (&corners, &names) } else { (&corners_backward, &names_backward) };
            strip((&around[..edges.len()], ring.0), (&around_names[..edges.len()], ring.1))
        };
        // One loop turns as the ring does, and the other against it.
        let pair = |forward: bool| strip_to(joined[0], forward).zip(strip_to(joined[1], !forward));
        let ((_, first), (_, second)) = match (pair(true), pair(false)) {
            (Some(one), Some(other)) => {
                if one.0.0 + one.1.0 <= other.0.0 + other.1.0 {
                    one
                } else {
                    other
                }
            }
            (one, other) => one.or(other)?,
        };
        let waist = spaced(waist);
        Some(Self { loops: joined, ring: ring(end).map(|end| corner(end, &waist)), strips: [first, second] })
    }
}

/// The two loops that a tunnel joins. `goes_around_inside`: what is within the tunnel.
fn joined_loops(case: CaseIndex, loops: &Loops, goes_around_inside: bool) -> Option<[usize; 2]> {
    if loops.count == 2 {
        return Some([0, 1]);
    }
    // The tunnel leads to the corner that one of the small sheets cuts off: not to one of the other sign.
    let leads_to = |number: &usize| {
        let ends = |edge: &Edge| edge.corners().iter().fold(0, |ends, corner| ends | 1u8 << corner.index());
        let cut_off = loops.get(*number).iter().fold(u8::MAX, |common, edge| common & ends(edge));
        cut_off != 0 && (cut_off & case.0 != 0) == goes_around_inside
    };
    let large = (0..loops.count).find(|&number| loops.get(number).len() > 3)?;
    Some([large, (0..loops.count).find(leads_to)?])
}
