//! [`LevelCover`]: which chunks of an octree to draw, and at which level of detail; [`LeafBlock`]: their samples.

mod balance;
mod block;
mod change;
mod tree;

use alloc::{collections::BTreeMap, vec::Vec};

use thiserror::Error;

pub use block::{LeafBlock, LevelSource};
pub use change::LevelChange;

use crate::{lattice::Region, mesher::FinerNeighbours};
use tree::{Node, State};

/// A chunk of an octree of chunks.
///
/// A chunk of level `k` is as wide as 2ᵏ chunks of level 0, and has as many cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct LeafKey {
    /// The level of detail, 0 to 6; 0 is the finest.
    pub level: u8,
    /// The position, in chunks of this level.
    pub position: [i32; 3],
}

impl LeafKey {
    /// The leaf's box, in chunks of level 0. It saturates at the limits of `i32`.
    pub fn region(self) -> Region {
        let scaled = |v: i64| (v << self.level).clamp(i32::MIN.into(), i32::MAX.into()) as i32;
        Region::new(self.position.map(|v| scaled(i64::from(v))), self.position.map(|v| scaled(i64::from(v) + 1)))
    }

    /// The child of one level finer in an octant: bit 0 is its x, bit 1 its y, bit 2 its z.
    fn child(self, octant: u8) -> Self {
        let position = [0, 1, 2].map(|axis| 2 * self.position[axis] + i32::from(octant >> axis & 1));
        Self { level: self.level - 1, position }
    }
}

/// The settings of a [`LevelCover`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LevelSettings {
    /// The number of levels, 1 to 7. With 1, all leaves are chunks of level 0.
    pub levels: u8,
    /// How slowly detail falls off: a chunk is split where a viewer is nearer than this many times its width. 1.75 or
    /// more, so that neighbours differ by one level without further splits; default 3.
    pub falloff: f64,
    /// The share by which a chunk that is split, or in view at all, must be farther away than another one before that
    /// changes. So leaves do not flicker where a viewer goes to and fro. 0 to 1; default 0.1.
    pub hysteresis: f64,
    /// How far viewers see, in chunks of level 0, above 0. Chunks of the coarsest level that are nearer are in the
    /// cover, whole.
    pub view_distance: f64,
    /// The chunks of level 0 that exist at all. A coarser leaf may reach beyond them.
    pub extent: Region,
}

impl Default for LevelSettings {
    /// Six levels up to 128 chunks (4,096 voxels) away, the finest up to 6 (192 voxels); no limits of the extent.
    fn default() -> Self {
        let extent = Region::new([i32::MIN; 3], [i32::MAX; 3]);
        Self { levels: 6, falloff: 3.0, hysteresis: 0.1, view_distance: 128.0, extent }
    }
}

/// The leaves of an octree of chunks that cover what viewers see: fine ones near them, coarser ones farther away.
///
/// Every chunk of level 0 in view lies in exactly one leaf. Leaves with a surface that touch, across a face, an edge or
/// a corner, differ by one level at most, and finer and coarser leaves never alternate around an edge of a leaf with a
/// surface. So [`Mesher::mesh_leaf`](crate::Mesher::mesh_leaf) can mesh all of them without a seam. A box that is known
/// to be empty is one leaf, whatever its size.
///
/// When viewers move, make a new cover; [`LevelCover::changes_to`] leads to it from the one that is shown.
///
/// ```
/// use marchless::{LeafKey, LevelCover, LevelSettings};
///
/// // Ground at the height 0 along y; all chunks are empty but those that it passes.
/// let is_empty = |leaf: LeafKey| !(leaf.region().min[1] < 0 && leaf.region().max[1] > -1);
/// let viewer = [0.5, 0.1, 0.5];
/// let cover = LevelCover::new(&[viewer], &LevelSettings::default(), None, is_empty)?;
///
/// let below = cover.leaf_at([0, -1, 0]).expect("it is in view");
/// let far = cover.leaf_at([-100, -1, 0]).expect("it is in view");
/// assert_eq!((below.level, far.level), (0, 5));
/// // Nearer to the viewer, its neighbour is finer.
/// assert!(cover.finer_neighbours(far).contains([1, 0, 0]));
/// # Ok::<(), marchless::LevelError>(())
/// ```
#[derive(Clone, Debug)]
pub struct LevelCover {
    /// The level of the roots.
    top: u8,
    /// The index in `nodes` of each chunk of the coarsest level that is in view.
    roots: BTreeMap<[i32; 3], u32>,
    /// The eight children of a split node lie together.
    nodes: Vec<Node>,
}

impl LevelCover {
    /// The most leaves of a cover.
    pub const MAX_LEAVES: usize = 1 << 20;

    /// The cover for viewers at these places, in chunks of level 0. `former`: the cover from before, from which it
    /// differs no more than need be ([`LevelSettings::hysteresis`]). `is_empty`: whether a chunk is certain to have no
    /// surface, borders included; called at most once for each chunk.
    ///
    /// It is a pure function: the same arguments give the same leaves. A cover with 1,200 leaves that may have a surface
    /// takes less than 3 ms besides the calls of `is_empty`.
    ///
    /// # Errors
    /// [`LevelError`] if a setting is out of range, a viewer's place is not finite, or there would be too many leaves.
    pub fn new(
        viewers: &[[f64; 3]],
        settings: &LevelSettings,
        former: Option<&Self>,
        mut is_empty: impl FnMut(LeafKey) -> bool,
    ) -> Result<Self, LevelError> {
        settings.check(viewers)?;
        let top = settings.levels - 1;
        let former = former.filter(|former| former.top == top);
        let mut cover = Self { top, roots: BTreeMap::new(), nodes: Vec::new() };
        let mut builder = Builder { viewers, settings, former, is_empty: &mut is_empty };
        builder.add_roots(&mut cover)?;
        let roots: Vec<u32> = cover.roots.values().copied().collect();
        for root in roots {
            builder.refine(&mut cover, root)?;
        }
        balance::balance(&mut cover, &mut builder)?;
        Ok(cover)
    }

    /// All leaves, and whether each is empty.
    pub fn leaves(&self) -> impl Iterator<Item = (LeafKey, bool)> + '_ {
        self.reachable().filter_map(|node| match node.state {
            State::Leaf => Some((node.key, false)),
            State::Empty => Some((node.key, true)),
            State::Split { .. } | State::Nowhere => None,
        })
    }

    /// The leaf that holds a chunk of level 0; `None` if it is not in view or does not exist.
    pub fn leaf_at(&self, chunk: [i32; 3]) -> Option<LeafKey> {
        let node = self.node_over(LeafKey { level: 0, position: chunk })?;
        matches!(node.state, State::Leaf | State::Empty).then_some(node.key)
    }

    /// True if this chunk is split into finer leaves.
    pub fn is_split(&self, key: LeafKey) -> bool {
        self.node_over(key).is_some_and(|node| node.key == key && matches!(node.state, State::Split { .. }))
    }

    /// The neighbours of a leaf that are one level finer.
    pub fn finer_neighbours(&self, leaf: LeafKey) -> FinerNeighbours {
        if leaf.level == 0 {
            return FinerNeighbours::NONE;
        }
        FinerNeighbours::from_fn(|direction| neighbour(leaf, direction).is_some_and(|place| self.is_split(place)))
    }
}

impl LevelSettings {
    fn check(&self, viewers: &[[f64; 3]]) -> Result<(), LevelError> {
        if !(1..=7).contains(&self.levels) {
            return Err(LevelError::Levels { found: self.levels });
        }
        let number = |name, expected, found: f64, holds: bool| {
            // Not a number holds nothing.
            if holds && found.is_finite() { Ok(()) } else { Err(LevelError::Setting { name, expected, found }) }
        };
        number("falloff", "1.75 or more", self.falloff, self.falloff >= 1.75)?;
        number("hysteresis", "from 0 to 1", self.hysteresis, (0.0..=1.0).contains(&self.hysteresis))?;
        number("view_distance", "above 0", self.view_distance, self.view_distance > 0.0)?;
        match viewers.iter().find(|viewer| !viewer.iter().all(|v| v.is_finite())) {
            Some(&found) => Err(LevelError::Viewer { found }),
            None => Ok(()),
        }
    }
}

/// What decides which chunks are split.
struct Builder<'a> {
    viewers: &'a [[f64; 3]],
    settings: &'a LevelSettings,
    former: Option<&'a LevelCover>,
    is_empty: &'a mut dyn FnMut(LeafKey) -> bool,
}

impl Builder<'_> {
    /// Adds the chunks of the coarsest level that viewers see.
    fn add_roots(&self, cover: &mut LevelCover) -> Result<(), LevelError> {
        let (distance, width) = (self.settings.view_distance, f64::from(1u32 << cover.top));
        let reach = distance * (1.0 + self.settings.hysteresis);
        let row = 2.0 * reach / width + 2.0;
        if row * row * row * self.viewers.len() as f64 > 8.0 * LevelCover::MAX_LEAVES as f64 {
            return Err(LevelError::TooManyLeaves);
        }
        for viewer in self.viewers {
            let ends = viewer.map(|v| [v - reach, v + reach].map(|v| libm::floor(v / width) as i32));
            let region = Region::new(ends.map(|[low, _]| low), ends.map(|[_, high]| high.saturating_add(1)));
            for position in region.points() {
                let key = LeafKey { level: cover.top, position };
                let was_in_view = self.former.is_some_and(|former| former.roots.contains_key(&position));
                let limit = if was_in_view { reach } else { distance };
                if !cover.roots.contains_key(&position)
                    && self.exists(key)
                    && distance_squared(*viewer, key) < limit * limit
                {
                    cover.roots.insert(position, cover.nodes.len() as u32);
                    cover.nodes.push(Node { key, state: State::Leaf });
                }
            }
        }
        self.check_size(cover)
    }

    /// Splits a new leaf, and what comes of it, as far as viewers want it.
    fn refine(&mut self, cover: &mut LevelCover, index: u32) -> Result<(), LevelError> {
        let mut to_refine = alloc::vec![index];
        while let Some(index) = to_refine.pop() {
            let key = cover.nodes[index as usize].key;
            if (self.is_empty)(key) {
                cover.nodes[index as usize].state = State::Empty;
            } else if self.is_to_split(key) {
                let first = self.split_node(cover, index)?;
                to_refine.extend(
                    (first..first + 8).rev().filter(|&child| matches!(cover.nodes[child as usize].state, State::Leaf)),
                );
            }
        }
        Ok(())
    }

    /// Splits a leaf and returns the index of its first child. The children's emptiness is not known yet.
    fn split_node(&self, cover: &mut LevelCover, index: u32) -> Result<u32, LevelError> {
        let (key, first) = (cover.nodes[index as usize].key, cover.nodes.len() as u32);
        cover.nodes.extend((0..8).map(|octant| {
            let key = key.child(octant);
            Node { key, state: if self.exists(key) { State::Leaf } else { State::Nowhere } }
        }));
        cover.nodes[index as usize].state = State::Split { first };
        self.check_size(cover)?;
        Ok(first)
    }

    fn is_to_split(&self, key: LeafKey) -> bool {
        let width = f64::from(1u32 << key.level);
        let was_split = self.former.is_some_and(|former| former.is_split(key));
        let limit = self.settings.falloff * width * if was_split { 1.0 + self.settings.hysteresis } else { 1.0 };
        key.level > 0 && self.viewers.iter().any(|viewer| distance_squared(*viewer, key) < limit * limit)
    }

    fn exists(&self, key: LeafKey) -> bool {
        !key.region().intersection(&self.settings.extent).is_empty()
    }

    const fn check_size(&self, cover: &LevelCover) -> Result<(), LevelError> {
        // A split node has eight children, so leaves are seven eighths of all nodes or more.
        if cover.nodes.len() / 8 * 7 > LevelCover::MAX_LEAVES { Err(LevelError::TooManyLeaves) } else { Ok(()) }
    }
}

/// The squared distance from a place to a chunk, in chunks of level 0.
fn distance_squared(place: [f64; 3], key: LeafKey) -> f64 {
    let width = f64::from(1u32 << key.level);
    let beyond = |axis: usize| {
        let low = f64::from(key.position[axis]) * width;
        place[axis] - place[axis].clamp(low, low + width)
    };
    (0..3).map(|axis| beyond(axis) * beyond(axis)).sum()
}

/// The chunk of the same level in a direction; `None` beyond the lattice.
fn neighbour(key: LeafKey, direction: [i32; 3]) -> Option<LeafKey> {
    let mut position = key.position;
    for axis in 0..3 {
        position[axis] = position[axis].checked_add(direction[axis])?;
    }
    Some(LeafKey { position, ..key })
}

/// The reason why there is no [`LevelCover`].
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum LevelError {
    /// The number of levels is out of range.
    #[error("a cover has 1 to 7 levels, but {found} were asked for")]
    Levels {
        /// The number that was given.
        found: u8,
    },
    /// Another setting is out of range, or not finite.
    #[error("{name} must be {expected}, but it is {found}")]
    Setting {
        /// The setting.
        name: &'static str,
        /// The allowed range, in words.
        expected: &'static str,
        /// The number that was given.
        found: f64,
    },
    /// A viewer is at no finite place.
    #[error("viewers must be at finite places, but one is at {found:?}")]
    Viewer {
        /// The place that was given.
        found: [f64; 3],
    },
    /// There would be more than [`LevelCover::MAX_LEAVES`] leaves.
    #[error(
        "there would be more than {} leaves; a shorter view distance, more levels or a lower falloff make fewer",
        LevelCover::MAX_LEAVES
    )]
    TooManyLeaves,
}

#[cfg(test)]
mod tests;
