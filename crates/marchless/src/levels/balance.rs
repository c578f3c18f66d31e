//! Further splits, until all leaves with a surface fit their neighbours.

use alloc::collections::VecDeque;

use super::{Builder, LeafKey, LevelCover, LevelError, neighbour, tree::State};

/// Splits leaves until none with a surface touches one more than one level finer that has one, and until finer and
/// coarser leaves alternate at no edge of a leaf with a surface. `to_check`: the nodes that may not fit yet.
pub(super) fn balance(
    cover: &mut LevelCover,
    builder: &mut Builder<'_>,
    to_check: impl Iterator<Item = u32>,
) -> Result<(), LevelError> {
    let mut to_check: VecDeque<u32> = to_check.collect();
    while let Some(index) = to_check.pop_front() {
        let node = cover.nodes[index as usize];
        if !matches!(node.state, State::Leaf) {
            continue;
        }
        let to_split = if alternates(cover, node.key) { Some(index) } else { too_coarse(cover, node.key) };
        let Some(to_split) = to_split else { continue };
        let split = cover.nodes[to_split as usize].key;
        let first = builder.split_node(cover, to_split)?;
        // What touches the split leaf may not fit any more.
        to_check.extend(first..first + 8);
        to_check.push_back(index);
        to_check.extend(directions().filter_map(|direction| cover.index_over(neighbour(split, direction)?)));
    }
    Ok(())
}

/// The 26 directions to a leaf's neighbours.
fn directions() -> impl Iterator<Item = [i32; 3]> {
    (0..27).map(|place| [place % 3 - 1, place / 3 % 3 - 1, place / 9 - 1]).filter(|direction| *direction != [0; 3])
}

/// A leaf with a surface that touches this one and is more than one level coarser.
pub(super) fn too_coarse(cover: &LevelCover, leaf: LeafKey) -> Option<u32> {
    let near = cover.near(leaf);
    directions().find_map(|direction| {
        let (index, node) = near.node_over(neighbour(leaf, direction)?)?;
        (matches!(node.state, State::Leaf) && node.key.level > leaf.level + 1).then_some(index)
    })
}

/// Whether finer and coarser leaves alternate at an edge of this leaf, as one of the coarser ones.
fn alternates(cover: &LevelCover, leaf: LeafKey) -> bool {
    leaf.level > 0 && cover.finer_neighbours(leaf).alternating_edge().is_some()
}
