//! Vertices whose samples are tiny, huge or not finite, computed one by one: the plain definition of a vertex.

use super::{
    STEPS,
    place::{CellSlabs, rounded_mean, trilinear},
};
use crate::{
    cell::{Corner, Edge},
    mesher::{
        crossing::crossing_fraction,
        normal::{EndNeighbours, steady_unit, unit},
    },
    sample::Weight,
};

/// The mean of some crossings of a cell, in steps.
#[cold]
#[inline(never)]
pub(super) fn mean<W: Weight>(slabs: &CellSlabs<'_, W>, cell: [u32; 2], edges: u16) -> [f32; 3] {
    let (mut sum, mut count) = ([0.0; 3], 0.0);
    for edge in Edge::ALL.into_iter().filter(|edge| edges >> edge.index() & 1 == 1) {
        let [a, b] = edge.corners().map(|corner| weight(slabs, cell, corner));
        for (axis, sum) in sum.iter_mut().enumerate() {
            *sum += if edge.axis() == axis {
                crossing_fraction(a, b, slabs.isovalue * W::SCALE)
            } else {
                f32::from(edge.corners()[0].offset()[axis])
            };
        }
        count += 1.0;
    }
    sum.map(|sum| rounded_mean(sum, count))
}

/// The normal at `offset` in a cell. `edges`: the crossings of the vertex.
#[cold]
#[inline(never)]
pub(super) fn normal<W: Weight>(slabs: &CellSlabs<'_, W>, cell: [u32; 2], edges: u16, offset: [f32; 3]) -> [f32; 3] {
    let corners = Corner::ALL.map(|corner| neighbours(slabs, cell, corner));
    let [x, y, z] = offset.map(|steps| steps / STEPS as f32);
    let gradients = corners.each_ref().map(|corner| corner.gradient().map(W::to_f32));
    let gradient = [0, 1, 2].map(|axis| trilinear(&gradients.map(|gradient| gradient[axis]), x, y, z));
    unit(gradient).unwrap_or_else(|| {
        // Where there is no gradient, the direction of the lowest crossing.
        let edge = Edge::new(edges.trailing_zeros() as u8 % 12);
        let low_inside = weight(slabs, cell, edge.corners()[0]).inside(W::threshold(slabs.isovalue));
        let mut fallback = [0.0; 3];
        fallback[edge.axis()] = if low_inside { 1.0 } else { -1.0 };
        let mut steady = [0.0; 3];
        for (corner, gradient) in Corner::ALL.into_iter().zip(corners.each_ref().map(EndNeighbours::steady_gradient)) {
            let share = |axis: usize, at: f32| f64::from(if corner.offset()[axis] == 1 { at } else { 1.0 - at });
            let share = share(0, x) * share(1, y) * share(2, z);
            for axis in 0..3 {
                steady[axis] += share * gradient[axis];
            }
        }
        steady_unit(steady, fallback)
    })
}

fn weight<W: Weight>(slabs: &CellSlabs<'_, W>, cell: [u32; 2], corner: Corner) -> W {
    let [x, y, z] = corner.offset();
    slabs.edges.slabs[1 + usize::from(z)][slabs.layout.index(cell[0] + u32::from(x), cell[1] + u32::from(y))]
}

fn neighbours<W: Weight>(slabs: &CellSlabs<'_, W>, cell: [u32; 2], corner: Corner) -> EndNeighbours<W> {
    let [x, y, z] = corner.offset();
    let first = usize::from(z);
    let [below, own, above] = [0, 1, 2].map(|slab| slabs.edges.slabs[first + slab]);
    let one_sided = slabs.edges.one_sided[first];
    EndNeighbours::of([below, own, above], one_sided, &slabs.layout, cell[0] + u32::from(x), cell[1] + u32::from(y))
}
