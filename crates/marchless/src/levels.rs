//! [`LevelCover`]: which chunks of an octree to draw, and at which level of detail; [`LeafBlock`]: their samples.

mod balance;
mod block;
mod change;
mod tree;
mod way;

use alloc::{collections::BTreeMap, vec::Vec};
use core::cmp::Ordering;

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

    /// The chunk of one level coarser that holds this one.
    fn parent(self) -> Self {
        Self { level: self.level + 1, position: self.position.map(|v| v >> 1) }
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
    /// The chunks of level 0 that exist at all. A coarser leaf may reach beyond them.
    pub extent: Region,
    /// The chunks of level 0 that are in the cover wherever viewers are, with the chunks of the coarsest level that hold
    /// them; may be empty.
    pub kept: Region,
}

impl Default for LevelSettings {
    /// Six levels, the finest up to 6 chunks (192 voxels) away; no limits of the extent, and nothing kept.
    fn default() -> Self {
        let extent = Region::new([i32::MIN; 3], [i32::MAX; 3]);
        Self { levels: 6, falloff: 3.0, hysteresis: 0.1, extent, kept: Region::new([0; 3], [0; 3]) }
    }
}

/// A viewer of a [`LevelCover`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LevelViewer {
    /// Where it is, in chunks of level 0.
    pub position: [f64; 3],
    /// How far it sees, in chunks of level 0, above 0; may be infinite. Chunks of the coarsest level that are nearer are
    /// in the cover, whole.
    pub distance: f64,
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
/// use marchless::{LeafKey, LevelCover, LevelSettings, LevelViewer};
///
/// // Ground at the height 0 along y; all chunks are empty but those that it passes.
/// let is_empty = |leaf: LeafKey| !(leaf.region().min[1] < 0 && leaf.region().max[1] > -1);
/// let viewer = LevelViewer { position: [0.5, 0.1, 0.5], distance: 128.0 };
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
    /// The number of nodes from which on those that cannot be reached are dropped.
    compact_at: usize,
}

impl LevelCover {
    /// The most leaves of a cover.
    pub const MAX_LEAVES: usize = 1 << 20;

    /// The cover for these viewers. `former`: the cover from before, from which it
    /// differs no more than need be ([`LevelSettings::hysteresis`]). `is_empty`: whether a chunk is certain to have no
    /// surface, borders included; called at most once for each chunk.
    ///
    /// It is a pure function: the same arguments give the same leaves. A cover with 1,200 leaves that may have a surface
    /// takes less than 3 ms besides the calls of `is_empty`.
    ///
    /// # Errors
    /// [`LevelError`] if a setting is out of range, a viewer's place is not finite or it does not see, or there would be
    /// too many leaves.
    pub fn new(
        viewers: &[LevelViewer],
        settings: &LevelSettings,
        former: Option<&Self>,
        mut is_empty: impl FnMut(LeafKey) -> bool,
    ) -> Result<Self, LevelError> {
        settings.check(viewers)?;
        let top = settings.levels - 1;
        let former = former.filter(|former| former.top == top);
        let mut cover = Self { top, roots: BTreeMap::new(), nodes: Vec::new(), compact_at: 0 };
        let mut builder = Builder { viewers, settings, former, is_empty: &mut is_empty };
        builder.add_roots(&mut cover)?;
        let roots: Vec<u32> = cover.roots.values().copied().collect();
        for root in roots {
            builder.mark_empty(&mut cover, root);
            builder.refine(&mut cover, root)?;
        }
        let all = 0..cover.nodes.len() as u32;
        balance::balance(&mut cover, &mut builder, all)?;
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

    /// The box around all leaves, in chunks of level 0; empty if there are none.
    pub fn region(&self) -> Region {
        let roots = self.roots.keys().map(|&position| LeafKey { level: self.top, position }.region());
        roots.reduce(|a, b| a.union(&b)).unwrap_or(Region::new([0; 3], [0; 3]))
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

    /// The leaves that overlap or touch (with a face, an edge or a corner) a box of chunks of level 0, in order, and
    /// whether each is empty. An empty box touches nothing.
    pub fn leaves_near(&self, chunks: Region) -> Vec<(LeafKey, bool)> {
        if chunks.is_empty() { Vec::new() } else { self.leaves_touching(&[chunks]) }
    }

    /// The change that puts a surface into some of this cover's empty leaves, because of an edit: each becomes a leaf
    /// with a surface, split as the viewers want it, and others are split until all fit. Keys that are not empty leaves
    /// of the cover are ignored. No leaf is merged, even if a new cover would have a coarser one.
    ///
    /// `is_empty`: as for [`LevelCover::new`], after the edit. It is called for parts of leaves only: these leaves
    /// themselves count as not empty.
    ///
    /// # Errors
    /// As [`LevelCover::new`].
    pub fn fill(
        &self,
        leaves: &[LeafKey],
        viewers: &[LevelViewer],
        settings: &LevelSettings,
        mut is_empty: impl FnMut(LeafKey) -> bool,
    ) -> Result<LevelChange, LevelError> {
        settings.check(viewers)?;
        let mut filled = self.clone();
        let mut builder = Builder { viewers, settings, former: Some(self), is_empty: &mut is_empty };
        let mut changed = Vec::new();
        for &leaf in leaves {
            let Some(index) = filled.index_over(leaf) else { continue };
            let node = &mut filled.nodes[index as usize];
            if node.key == leaf && matches!(node.state, State::Empty) {
                node.state = State::Leaf;
                builder.refine(&mut filled, index)?;
                changed.push(leaf);
            }
        }
        let regions: Vec<Region> = changed.iter().map(|leaf| leaf.region()).collect();
        let near = filled.leaves_touching(&regions);
        let near: Vec<u32> = near.into_iter().filter_map(|(leaf, _)| filled.index_over(leaf)).collect();
        balance::balance(&mut filled, &mut builder, near.into_iter())?;
        Ok(self.refined_to(&filled, &changed).unwrap_or_default())
    }

    /// The neighbours of a leaf that are one level finer.
    pub fn finer_neighbours(&self, leaf: LeafKey) -> FinerNeighbours {
        if leaf.level == 0 {
            return FinerNeighbours::NONE;
        }
        if leaf.level > self.top {
            return FinerNeighbours::NONE;
        }
        let near = self.near(leaf);
        let is_split = |place: LeafKey| {
            let node = near.node_over(place);
            node.is_some_and(|(_, node)| node.key == place && matches!(node.state, State::Split { .. }))
        };
        FinerNeighbours::from_fn(|direction| neighbour(leaf, direction).is_some_and(is_split))
    }
}

impl LevelSettings {
    fn check(&self, viewers: &[LevelViewer]) -> Result<(), LevelError> {
        if !(1..=7).contains(&self.levels) {
            return Err(LevelError::Levels { found: self.levels });
        }
        let number = |name, expected, found: f64, holds: bool| {
            // Not a number holds nothing.
            if holds && found.is_finite() { Ok(()) } else { Err(LevelError::Setting { name, expected, found }) }
        };
        number("falloff", "1.75 or more", self.falloff, self.falloff >= 1.75)?;
        number("hysteresis", "from 0 to 1", self.hysteresis, (0.0..=1.0).contains(&self.hysteresis))?;
        for LevelViewer { position, distance } in viewers {
            if !position.iter().all(|v| v.is_finite()) {
                return Err(LevelError::Viewer { found: *position });
            }
            // Not a number is not above 0.
            if distance.partial_cmp(&0.0) != Some(Ordering::Greater) {
                return Err(LevelError::Setting { name: "a viewer's distance", expected: "above 0", found: *distance });
            }
        }
        Ok(())
    }
}

/// What decides which chunks are split.
struct Builder<'a> {
    viewers: &'a [LevelViewer],
    settings: &'a LevelSettings,
    former: Option<&'a LevelCover>,
    is_empty: &'a mut dyn FnMut(LeafKey) -> bool,
}

impl Builder<'_> {
    /// Adds the chunks of the coarsest level that viewers see.
    fn add_roots(&self, cover: &mut LevelCover) -> Result<(), LevelError> {
        let (top, width) = (cover.top, f64::from(1u32 << cover.top));
        let root = |chunks: Region| {
            Region::new(chunks.min.map(|v| v >> top), chunks.max.map(|v| (v.saturating_sub(1) >> top) + 1))
        };
        let extent = self.settings.extent;
        let existing = if extent.is_empty() { extent } else { root(extent) };
        let kept = self.settings.kept.intersection(&extent);
        if !kept.is_empty() {
            self.add_roots_in(root(kept), cover, |_| true)?;
        }
        for &LevelViewer { position, distance } in self.viewers {
            let reach = distance * (1.0 + self.settings.hysteresis);
            let ends = position.map(|v| [v - reach, v + reach].map(|v| libm::floor(v / width) as i32));
            let region = Region::new(ends.map(|[low, _]| low), ends.map(|[_, high]| high.saturating_add(1)));
            self.add_roots_in(region.intersection(&existing), cover, |key| {
                let was_in_view = self.former.is_some_and(|former| former.roots.contains_key(&key.position));
                let limit = if was_in_view { reach } else { distance };
                let squared = limit * limit;
                // Where the square overflows, the box alone is exact enough.
                squared == f64::INFINITY || distance_squared(position, key) < squared
            })?;
        }
        Ok(())
    }

    /// Adds those of the coarsest chunks in a box that are in view.
    fn add_roots_in(
        &self,
        positions: Region,
        cover: &mut LevelCover,
        is_in_view: impl Fn(LeafKey) -> bool,
    ) -> Result<(), LevelError> {
        if positions.size().into_iter().map(f64::from).product::<f64>() > 8.0 * LevelCover::MAX_LEAVES as f64 {
            return Err(LevelError::TooManyLeaves);
        }
        for position in positions.points() {
            let key = LeafKey { level: cover.top, position };
            if !cover.roots.contains_key(&position) && self.exists(key) && is_in_view(key) {
                cover.roots.insert(position, cover.nodes.len() as u32);
                cover.nodes.push(Node { key, state: State::Leaf });
                self.check_size(cover)?;
            }
        }
        Ok(())
    }

    /// Makes a leaf an empty one if it has no surface.
    fn mark_empty(&mut self, cover: &mut LevelCover, index: u32) {
        let node = &mut cover.nodes[index as usize];
        if matches!(node.state, State::Leaf) && (self.is_empty)(node.key) {
            node.state = State::Empty;
        }
    }

    /// Splits a leaf, and what comes of it, as far as viewers want it, where there is a surface.
    fn refine(&mut self, cover: &mut LevelCover, index: u32) -> Result<(), LevelError> {
        let mut to_refine = alloc::vec![index];
        while let Some(index) = to_refine.pop() {
            let node = cover.nodes[index as usize];
            if matches!(node.state, State::Leaf) && self.is_to_split(node.key) {
                let first = self.split_node(cover, index)?;
                to_refine.extend((first..first + 8).rev());
            }
        }
        Ok(())
    }

    /// Splits a leaf and returns the index of its first child.
    fn split_node(&mut self, cover: &mut LevelCover, index: u32) -> Result<u32, LevelError> {
        let (key, first) = (cover.nodes[index as usize].key, cover.nodes.len() as u32);
        cover.nodes.extend((0..8).map(|octant| {
            let key = key.child(octant);
            Node { key, state: if self.exists(key) { State::Leaf } else { State::Nowhere } }
        }));
        cover.nodes[index as usize].state = State::Split { first };
        self.check_size(cover)?;
        (first..first + 8).for_each(|child| self.mark_empty(cover, child));
        Ok(first)
    }

    fn is_to_split(&self, key: LeafKey) -> bool {
        let width = f64::from(1u32 << key.level);
        let was_split = self.former.is_some_and(|former| former.is_split(key));
        let limit = self.settings.falloff * width * if was_split { 1.0 + self.settings.hysteresis } else { 1.0 };
        key.level > 0 && self.viewers.iter().any(|viewer| distance_squared(viewer.position, key) < limit * limit)
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
        "there would be more than {} leaves; viewers that see less far, more levels or a lower falloff make fewer",
        LevelCover::MAX_LEAVES
    )]
    TooManyLeaves,
}

#[cfg(test)]
mod tests;
