//! The memory that samples take.

use marchless::GridChunk;

use super::Heart;
use super::samples::shares_samples;

impl Heart {
    /// The memory that the records of chunks take, in bytes, and that of coarser leaves' samples.
    pub(crate) fn notes_bytes(&self) -> usize {
        self.table.bytes() + self.levels.as_ref().map_or(0, super::Levels::sample_bytes)
    }

    /// The memory that the samples of at most `most` chunks take, in bytes, starting at a position; and the position to
    /// go on from, if any are left.
    pub(crate) fn sample_bytes_from(&self, from: [i32; 3], most: usize) -> (usize, Option<[i32; 3]>) {
        let mut newest = self.samples.newest().chunks_from(from).peekable();
        let mut shown = self.samples.shown().chunks_from(from).peekable();
        let mut bytes = 0;
        for done in 0.. {
            let Some(next) = newest.peek().into_iter().chain(shown.peek()).map(|(position, _)| *position).min() else {
                break;
            };
            if done == most {
                return (bytes, Some(next));
            }
            let [newest, shown] =
                [&mut newest, &mut shown].map(|chunks| chunks.next_if(|(position, _)| *position == next));
            let entries = [newest, shown].into_iter().flatten();
            bytes += entries.map(|_| size_of::<([i32; 3], GridChunk<i16>)>()).sum::<usize>();
            bytes += match (newest, shown) {
                (Some((_, newest)), Some((_, shown))) if !shares_samples(newest, shown) => {
                    bytes_of(newest) + bytes_of(shown)
                }
                (Some((_, chunk)), _) | (None, Some((_, chunk))) => bytes_of(chunk),
                (None, None) => 0,
            };
        }
        (bytes, None)
    }
}

/// The memory that a chunk's samples take, in bytes.
fn bytes_of(chunk: &GridChunk<i16>) -> usize {
    match chunk {
        GridChunk::Uniform(_) => 0,
        GridChunk::Samples(samples) => 2 * samples.weights.capacity() + samples.materials.capacity(),
    }
}
