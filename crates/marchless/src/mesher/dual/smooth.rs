//! Steps of smoothing, in integers.

use alloc::vec::Vec;

use super::{Offset, STEPS, VertexKind, quads::Quad};

/// Scratch memory: for each vertex, the sum of its neighbours' places relative to its own cell, and their number.
#[derive(Clone, Debug)]
pub(super) struct Smoothing(Vec<[i32; 4]>);

impl Smoothing {
    pub(super) const fn new() -> Self {
        Self(Vec::new())
    }
}

/// Moves each vertex half the way to the mean of its neighbours, in each of `steps` steps. It stays in its cell; halves
/// are rounded up. Sharp vertices stay where they are. Neighbours are the vertices at the other ends of sides of quads. A
/// side of two quads counts twice.
pub(super) fn smooth(steps: u32, quads: &[Quad], offsets: &mut [Offset], Smoothing(sums): &mut Smoothing) {
    for _ in 0..steps {
        sums.clear();
        sums.resize(offsets.len(), [0; 4]);
        for quad in quads {
            let axis = usize::from(quad.axis);
            let [a, b, c, d] = quad.vertices.map(|vertex| vertex as usize);
            // From the first to the second vertex, the cell is the next along the axis.
            for (low, high, along) in
                [(a, b, (axis + 1) % 3), (d, c, (axis + 1) % 3), (a, d, (axis + 2) % 3), (b, c, (axis + 2) % 3)]
            {
                let (at_low, at_high) = (offsets[low], offsets[high]);
                for k in 0..3 {
                    let step = if k == along { STEPS } else { 0 };
                    sums[low][k] += i32::from(at_high[k]) + step;
                    sums[high][k] += i32::from(at_low[k]) - step;
                }
                sums[low][3] += 1;
                sums[high][3] += 1;
            }
        }
        for (offset, &[x, y, z, count]) in offsets.iter_mut().zip(&*sums) {
            if count == 0 || offset[3] != VertexKind::Smooth as u16 {
                continue;
            }
            for (at, sum) in offset.iter_mut().zip([x, y, z]) {
                let moved = (i32::from(*at) * count + sum + count).div_euclid(2 * count);
                *at = moved.clamp(1, STEPS - 1) as u16;
            }
        }
    }
}
