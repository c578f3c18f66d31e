//! Vertices whose samples are tiny, huge or not finite, computed one by one: the plain definition of a vertex.

use crate::mesher::{
    crossing::crossing_fraction,
    normal::{EndNeighbours, vertex_normal},
    output::VertexBounds,
    settings::MeshSettings,
};
use crate::{
    buffer::MeshBuffer,
    sample::Weight,
    signs::{EdgeSlabs, SlabLayout},
};

/// Writes the vertices at the edges `[xs, ys]` along `AXIS` behind the ends of `out`'s vectors, one by one.
#[cold]
#[inline(never)]
pub(super) fn mend<const AXIS: usize, W: Weight>(
    layout: &SlabLayout,
    edges: &EdgeSlabs<'_, W>,
    settings: &MeshSettings,
    [xs, ys]: [&[u32]; 2],
    bounds: &mut VertexBounds,
    out: &mut MeshBuffer,
) {
    let [below, low, high, above] = edges.slabs;
    let (next_to_low, next_to_high) = if AXIS == 2 { (high, low) } else { (above, below) };
    for (vertex, (&x, &y)) in xs.iter().zip(ys).enumerate() {
        let (x_high, y_high) = (x + u32::from(AXIS == 0), y + u32::from(AXIS == 1));
        let (a, b) = (low[layout.index(x, y)], high[layout.index(x_high, y_high)]);
        let fraction = crossing_fraction(a, b, settings.isovalue * W::SCALE);
        let mut position = [x as f32, y as f32, edges.z as f32];
        position[AXIS] += fraction;
        out.positions.spare_capacity_mut()[vertex].write(position);
        bounds.include(position);
        if settings.normals {
            let ends = [
                EndNeighbours::of([below, low, next_to_low], edges.one_sided[0], layout, x, y),
                EndNeighbours::of([next_to_high, high, above], edges.one_sided[1], layout, x_high, y_high),
            ];
            let normal = vertex_normal(&ends, AXIS, fraction, a.inside(W::threshold(settings.isovalue)));
            out.normals.spare_capacity_mut()[vertex].write(normal);
        }
    }
}
