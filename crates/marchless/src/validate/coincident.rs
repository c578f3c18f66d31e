//! [`Coincident`]: which vertices have equal positions.

use alloc::{vec, vec::Vec};

use super::work::Work;

/// Vertices per bucket, on average: a bucket is sorted within the first cache.
const BUCKET: usize = 2048;

/// The vertices whose position is also that of another vertex.
pub(super) struct Coincident {
    /// How many vertices have the position of one before them.
    pub(super) repeated: usize,
    /// For each vertex, the first one with its position; empty if all positions differ.
    first: Vec<u32>,
}

impl Coincident {
    /// `positions`: at most 2³² of them. Two are equal if their bits are, except that −0 is 0. `None` if the caller
    /// cancels.
    pub(super) fn of(positions: &[[f32; 3]], share: f32, work: &mut Work<'_>) -> Option<Self> {
        let threads = work.threads();
        let repeated = work.map(share, 0..threads, |part| Buckets::of(positions, part, threads).repeated(positions))?;
        let repeated = repeated.concat();
        let mut first = vec![];
        if !repeated.is_empty() {
            first = (0..positions.len()).map(|vertex| vertex as u32).collect();
            for &[vertex, original] in &repeated {
                first[vertex as usize] = original;
            }
        }
        Some(Self { repeated: repeated.len(), first })
    }

    /// The vertex that stands for all those with the position of `vertex`.
    pub(super) fn first(&self, vertex: u32) -> u32 {
        self.first.get(vertex as usize).copied().unwrap_or(vertex)
    }
}

/// Vertices by a hash of their position: the buckets of one part of several.
struct Buckets {
    /// The position's hash above, the vertex below.
    keys: Vec<u64>,
    /// Where each bucket ends.
    ends: Vec<usize>,
}

impl Buckets {
    /// Each part reads all positions, and keeps its share of the buckets.
    fn of(positions: &[[f32; 3]], part: usize, parts: usize) -> Self {
        let buckets = (positions.len() / BUCKET + 1).next_multiple_of(parts);
        let own = buckets / parts;
        let bucket = |hash: u32| ((u64::from(hash) * buckets as u64) >> 32) as usize;
        let local = |hash: u32| bucket(hash).wrapping_sub(part * own);
        let mut ends = vec![0; own];
        for &position in positions {
            if let Some(end) = ends.get_mut(local(hash(position))) {
                *end += 1;
            }
        }
        let mut sum = 0;
        for end in &mut ends {
            // The start, until the bucket is filled.
            (*end, sum) = (sum, sum + *end);
        }
        let mut keys = vec![0; sum];
        for (&position, vertex) in positions.iter().zip(0u64..) {
            let hash = hash(position);
            if let Some(end) = ends.get_mut(local(hash)) {
                keys[*end] = u64::from(hash) << 32 | vertex;
                *end += 1;
            }
        }
        Self { keys, ends }
    }

    /// Each vertex that is not the first at its position, and the first one.
    fn repeated(mut self, positions: &[[f32; 3]]) -> Vec<[u32; 2]> {
        let mut repeated = vec![];
        let mut start = 0;
        for end in self.ends {
            let bucket = &mut self.keys[start..end];
            start = end;
            bucket.sort_unstable();
            for equal in bucket.chunk_by_mut(|a, b| a >> 32 == b >> 32) {
                if equal.len() > 1 {
                    let position = |&key: &u64| bits(positions[key as u32 as usize]);
                    equal.sort_unstable_by_key(|key| (position(key), *key));
                    for same in equal.chunk_by(|a, b| position(a) == position(b)) {
                        repeated.extend(same[1..].iter().map(|&key| [key as u32, same[0] as u32]));
                    }
                }
            }
        }
        repeated
    }
}

/// Equal for equal positions.
fn bits(position: [f32; 3]) -> [u32; 3] {
    position.map(|coordinate| (coordinate + 0.0).to_bits())
}

#[inline(always)]
fn hash(position: [f32; 3]) -> u32 {
    let [x, y, z] = bits(position).map(u64::from);
    let low = (x | y << 32).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let all = (low ^ low >> 32 ^ z << 16).wrapping_mul(0xd6e8_feb8_6659_fd93);
    ((all ^ all >> 32).wrapping_mul(0xd6e8_feb8_6659_fd93) >> 32) as u32
}
