//! The peer: cell masks by word strides, reimplemented with the layout and the passes of an article on building cell
//! masks.
//!
//! The article (its title and author are not known) reports 143 ms for 256³ of white noise and 84 ms for five octaves
//! of simplex noise, on one thread of an AMD FX-8350.
//!
//! Signs lie in 32-bit words along one axis, here x; a 64-bit word holds the masks of eight cells. There are four
//! passes, one for each edge of a cell along x. A pass goes through all rows of cells, block by block. Each set bit of
//! the block's word sets a bit in the masks of the two cells that share that corner. The masks of the block are
//! gathered in four local words; the cell before the block is written directly. The first pass assigns; the others skip
//! words without a set bit and write only changes.
//!
//! The article names its axes z, y and x from the innermost outwards; here they are x, y and z. So its order of corners
//! (innermost axis first) is that of [`Corner`](marchless::cell::Corner).

use marchless::bits::BitGrid;

/// Bits in a word of signs.
const STRIDE: usize = 32;
/// The number of words that hold the masks of so many cells.
const LOCAL: usize = STRIDE / 8;

/// The signs of a cube, and the masks of its cells.
pub(crate) struct WordStride {
    size: usize,
    /// Words per row.
    blocks: usize,
    signs: Vec<u32>,
    masks: Vec<u64>,
}

impl WordStride {
    /// The grid must be a cube, its size a multiple of 32.
    pub(crate) fn new(grid: &BitGrid) -> Self {
        let [size, ny, nz] = grid.shape().size().map(|size| size as usize);
        assert!(size == ny && size == nz && size.is_multiple_of(STRIDE), "a cube of whole words");
        let blocks = size / STRIDE;
        let halves = |row: &[u64]| -> Vec<u32> {
            row.iter().flat_map(|&word| [word as u32, (word >> 32) as u32]).take(blocks).collect()
        };
        let signs = grid.words().chunks_exact(grid.words_per_row()).flat_map(halves).collect();
        Self { size, blocks, signs, masks: vec![0; LOCAL * blocks * (size - 1) * (size - 1)] }
    }

    /// Builds all masks.
    pub(crate) fn run(&mut self) {
        self.pass::<0>();
        self.pass::<2>();
        self.pass::<4>();
        self.pass::<6>();
    }

    /// The mask of each cell, x fastest.
    pub(crate) fn masks(&self) -> impl Iterator<Item = u8> {
        let rows = self.masks.chunks_exact(LOCAL * self.blocks);
        rows.flat_map(|row| row.iter().flat_map(|word| word.to_le_bytes()).take(self.size - 1))
    }

    /// The edge whose corners are bits `M` and `M + 1` of a mask.
    #[inline(never)]
    fn pass<const M: u32>(&mut self) {
        let (blocks, cells) = (self.blocks, self.size - 1);
        let slab = blocks * self.size;
        let first = blocks * (M as usize >> 1 & 1) + slab * (M as usize >> 2);
        let slabs = self.signs[first..].chunks(slab).zip(self.masks.chunks_exact_mut(LOCAL * blocks * cells));
        for (signs, masks) in slabs {
            for (row, masks) in signs.chunks_exact(blocks).zip(masks.chunks_exact_mut(LOCAL * blocks)) {
                let masks = masks.as_chunks_mut::<LOCAL>().0;
                for (block, &line) in row.iter().enumerate().take(masks.len()) {
                    if M > 0 && line == 0 {
                        continue;
                    }
                    let (before, [line_masks, ..]) = masks.split_at_mut(block) else { continue };
                    edge_line::<M>(line, block + 1 == blocks, before.last_mut(), line_masks);
                }
            }
        }
    }
}

/// Adds one word of signs to the masks of its own cells and of the cell before them.
#[inline(always)]
fn edge_line<const M: u32>(line: u32, is_last: bool, before: Option<&mut [u64; LOCAL]>, line_masks: &mut [u64; LOCAL]) {
    let mut local = [0u64; LOCAL];
    // Unrolled, as in the article.
    macro_rules! edges {
        ($($word:tt [$($bit:tt)*])*) => { $($(
            if line & 1 << (8 * $word + $bit) != 0 {
                if !is_last || 8 * $word + $bit < STRIDE - 1 {
                    local[$word] |= 1 << (8 * $bit + M);
                }
                edges!(@before $word $bit);
            }
        )*)* };
        (@before 0 0) => {};
        (@before $word:tt 0) => { local[$word - 1] |= 1 << (8 * 7 + M + 1) };
        (@before $word:tt $bit:tt) => { local[$word] |= 1 << (8 * ($bit - 1) + M + 1) };
    }
    edges! {
        0 [0 1 2 3 4 5 6 7]
        1 [0 1 2 3 4 5 6 7]
        2 [0 1 2 3 4 5 6 7]
        3 [0 1 2 3 4 5 6 7]
    }
    if line & 1 != 0
        && let Some(before) = before
    {
        before[LOCAL - 1] |= 1 << (8 * 7 + M + 1);
    }
    if M == 0 {
        *line_masks = local;
        return;
    }
    for (mask, local) in line_masks.iter_mut().zip(local) {
        if local != 0 {
            *mask |= local;
        }
    }
}
