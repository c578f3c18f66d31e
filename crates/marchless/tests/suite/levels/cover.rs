//! [`Cover`]: leaves of several levels that fill a box.

use std::fmt;

use fastrand::Rng;
use marchless::LevelCover;

/// A chunk of a cover.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Leaf {
    /// The lowest lattice point, in voxels of level 0.
    pub(super) min: [i32; 3],
    pub(super) level: u8,
}

/// Leaves that fill a box, and differ by one level at most where they touch.
#[derive(Clone)]
pub(super) struct Cover {
    /// Cells per axis of a leaf.
    pub(super) cells: i32,
    /// Chunks of level 0 per axis.
    size: [i32; 3],
    /// The leaf at each chunk of level 0, x fastest.
    leaves: Vec<Leaf>,
}

impl Cover {
    /// Leaves of level 1 at these places, or eight of level 0 where `is_finer`.
    pub(super) fn of_places(places: [usize; 3], cells: i32, is_finer: impl Fn([usize; 3]) -> bool) -> Self {
        let size = places.map(|count| 2 * count as i32);
        let mut cover = Self { cells, size, leaves: Vec::new() };
        cover.leaves = cover
            .chunks()
            .map(|chunk| {
                let level = u8::from(!is_finer(chunk.map(|v| v as usize / 2)));
                Leaf { min: chunk.map(|v| (v >> level << level) * cells), level }
            })
            .collect();
        cover
    }

    /// The leaves of a cover of a whole extent that begins at the origin. `size`: chunks of level 0 per axis.
    pub(super) fn of_levels(levels: &LevelCover, size: [i32; 3], cells: i32) -> Self {
        let mut cover = Self { cells, size, leaves: Vec::new() };
        let leaf = |chunk| {
            let key = levels.leaf_at(chunk).expect("the whole extent is in view");
            Leaf { min: key.region().min.map(|v| v * cells), level: key.level }
        };
        cover.leaves = cover.chunks().map(leaf).collect();
        cover
    }

    /// A random octree of `levels` levels, split further until neighbours fit.
    pub(super) fn random_octree(random: &mut Rng, levels: u8, cells: i32) -> Self {
        let top = levels - 1;
        let size = [1 << top; 3].map(|size: i32| size * 2);
        let mut cover = Self { cells, size, leaves: Vec::new() };
        cover.leaves =
            cover.chunks().map(|chunk| Leaf { min: chunk.map(|v| (v >> top << top) * cells), level: top }).collect();
        for _ in 0..random.u32(1..8) {
            let chunk = size.map(|size| random.i32(0..size));
            cover.split(cover.leaf_of_chunk(chunk).expect("it is in the box"));
        }
        loop {
            let ill_fitting = cover.leaves().find(|leaf| cover.must_split(leaf));
            let Some(leaf) = ill_fitting else { return cover };
            cover.split(leaf);
        }
    }

    fn must_split(&self, leaf: &Leaf) -> bool {
        let too_coarse = self.neighbours(leaf).any(|(_, neighbour)| neighbour.level + 1 < leaf.level);
        too_coarse || self.alternates(leaf)
    }

    fn split(&mut self, leaf: Leaf) {
        let Some(level) = leaf.level.checked_sub(1) else { return };
        let chunks: Vec<_> = self.chunks().collect();
        for (chunk, entry) in chunks.into_iter().zip(&mut self.leaves) {
            if *entry == leaf {
                *entry = Leaf { min: chunk.map(|v| (v >> level << level) * self.cells), level };
            }
        }
    }

    fn chunks(&self) -> impl Iterator<Item = [i32; 3]> + use<> {
        let [x, y, z] = self.size;
        (0..x * y * z).map(move |index| [index % x, index / x % y, index / (x * y)])
    }

    /// Each leaf once.
    pub(super) fn leaves(&self) -> impl Iterator<Item = Leaf> {
        self.chunks()
            .zip(&self.leaves)
            .filter(|(chunk, leaf)| chunk.map(|v| v * self.cells) == leaf.min)
            .map(|(_, l)| *l)
    }

    fn leaf_of_chunk(&self, chunk: [i32; 3]) -> Option<Leaf> {
        let within = (0..3).all(|axis| (0..self.size[axis]).contains(&chunk[axis]));
        within.then(|| self.leaves[(chunk[0] + self.size[0] * (chunk[1] + self.size[1] * chunk[2])) as usize])
    }

    /// The leaf that holds the cell of level 0 above a lattice point.
    fn leaf_at(&self, cell: [i32; 3]) -> Option<Leaf> {
        self.leaf_of_chunk(cell.map(|v| v.div_euclid(self.cells)))
    }

    /// The leaf's width in voxels of level 0.
    pub(super) fn width(&self, leaf: &Leaf) -> i32 {
        self.cells << leaf.level
    }

    /// The leaf in a direction, one of those that touch `leaf` there.
    pub(super) fn neighbour(&self, leaf: &Leaf, direction: [i32; 3]) -> Option<Leaf> {
        self.leaf_at([0, 1, 2].map(|axis| match direction[axis] {
            1 => leaf.min[axis] + self.width(leaf),
            step => leaf.min[axis] + step,
        }))
    }

    /// All leaves that touch `leaf`, each with a direction; some of them twice.
    fn neighbours(&self, leaf: &Leaf) -> impl Iterator<Item = ([i32; 3], Leaf)> {
        let chunks = self.chunks().zip(&self.leaves);
        let (low, high) = (leaf.min, leaf.min.map(|v| v + self.width(leaf)));
        chunks.filter_map(move |(chunk, &other)| {
            let direction = [0, 1, 2].map(|axis| {
                let at = chunk[axis] * self.cells;
                i32::from(at >= high[axis]) - i32::from(at < low[axis])
            });
            let touches = (0..3).all(|axis| {
                let at = chunk[axis] * self.cells;
                at <= high[axis] && at + self.cells >= low[axis]
            });
            (touches && direction != [0; 3]).then_some((direction, other))
        })
    }

    /// Whether finer and coarser leaves alternate at an edge of this leaf, which is one of the coarser ones.
    fn alternates(&self, leaf: &Leaf) -> bool {
        let is_finer = |direction| self.neighbour(leaf, direction).is_some_and(|other| other.level < leaf.level);
        (0..3).any(|axis| {
            [-1, 1].iter().any(|&u| {
                [-1, 1].iter().any(|&v| {
                    let at = |u: i32, v: i32| {
                        let mut direction = [0; 3];
                        (direction[(axis + 1) % 3], direction[(axis + 2) % 3]) = (u, v);
                        direction
                    };
                    is_finer(at(u, 0)) && is_finer(at(0, v)) && !is_finer(at(u, v))
                })
            })
        })
    }

    /// Whether finer and coarser leaves alternate at any edge.
    pub(super) fn has_alternating_edge(&self) -> bool {
        self.leaves().any(|leaf| self.alternates(&leaf))
    }

    /// The level of the finest leaf that touches a lattice point; `None` on or beyond the border of the box.
    pub(super) fn finest(&self, point: [i32; 3]) -> Option<u8> {
        let octants = (0..8).map(|octant| self.leaf_at([0, 1, 2].map(|axis| point[axis] - (octant >> axis & 1))));
        octants.map(|leaf| leaf.map(|leaf| leaf.level)).min().flatten()
    }
}

impl Leaf {
    /// Whether a position in the leaf's own cells is inside the box by more than a voxel.
    pub(super) fn contains_within(&self, cover: &Cover, position: &[f32; 3]) -> bool {
        (0..3).all(|axis| {
            let at = self.min[axis] as f32 + position[axis] * f32::from(1u8 << self.level);
            (4.0..=(cover.size[axis] * cover.cells) as f32 - 4.0).contains(&at)
        })
    }
}

impl fmt::Debug for Cover {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "leaves of {} cells: ", self.cells)?;
        f.debug_list().entries(self.leaves().map(|leaf| (leaf.min, leaf.level))).finish()
    }
}
