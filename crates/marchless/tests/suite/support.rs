//! Helpers that several test modules share.

pub(crate) mod exact;
mod fields;
mod random;

pub(crate) use fields::{Field, TestWeight};
pub(crate) use random::random;

/// All points of a box from 0 up to, but without, its size: x fastest.
pub(crate) fn points([nx, ny, nz]: [u32; 3]) -> impl Iterator<Item = [u32; 3]> {
    (0..nz).flat_map(move |z| (0..ny).flat_map(move |y| (0..nx).map(move |x| [x, y, z])))
}
