//! transvoxel on a block: each call meshes it once, and counts the triangles.
//!
//! It calls for samples at positions, with z fastest, and larger ones are inside. So it gets a copy of the field in
//! that order, negated. Positions are in finer steps from the leaf's corner, which makes them exact.
//!
//! Not used: `FieldCaching::CacheCentralBlockOnly`, which samples the finer neighbours at wrong positions.

use core::hint::black_box;

use marchless::cell::Face;
use transvoxel::prelude::{
    Block as Region, BlockStarView, FieldCaching, GenericMeshBuilder, TransitionSide, TransitionSides, VoxelVecBlock,
    extract, extract_from_field,
};

use crate::block::{Block, CELLS, PADDING, SIZE};

/// `extract_from_field`: samples come from an array through a function.
pub(crate) fn field(block: &Block<'_>) -> impl FnMut() -> usize + use<> {
    let (density, sides) = (density(block), sides(block));
    move || {
        let builder = GenericMeshBuilder::new();
        let mesh = extract_from_field(black_box(&density), FieldCaching::CacheNothing, region(), sides, 0.0, builder);
        black_box(mesh.build()).num_tris()
    }
}

/// `extract`: the leaf and its finer neighbours are cached before.
pub(crate) fn cached(block: &Block<'_>) -> impl FnMut() -> usize + use<> {
    let density = density(block);
    let mut blocks = BlockStarView::new_simple(VoxelVecBlock::cache(&density, region()));
    for side in sides(block) {
        let neighbour = region().high_res_neighbour_to(side);
        blocks = blocks.with_neighbour(VoxelVecBlock::cache(&density, neighbour), side);
    }
    move || black_box(extract(black_box(&blocks), 0.0, GenericMeshBuilder::new()).build()).num_tris()
}

/// The leaf, in finer steps.
fn region() -> Region<f32> {
    Region::new([0.0; 3], (2 * CELLS) as f32, CELLS as usize)
}

/// The field as transvoxel wants it. It is 0 beyond its samples, where [`cached`] asks for more than is meshed.
fn density(block: &Block<'_>) -> impl Fn(f32, f32, f32) -> f32 + use<> {
    let axis = || 0..SIZE;
    let points = axis().flat_map(|x| axis().flat_map(move |y| axis().map(move |z| [x, y, z])));
    let densities: Vec<f32> = points.map(|point| -block.at(point)).collect();
    move |x, y, z| {
        let [x, y, z] = [x, y, z].map(|v| (v + PADDING as f32) as usize);
        densities.get((x * SIZE as usize + y) * SIZE as usize + z).copied().unwrap_or(0.0)
    }
}

fn sides(block: &Block<'_>) -> TransitionSides {
    use TransitionSide::{HighX, HighY, HighZ, LowX, LowY, LowZ};
    let side = |face: &Face| [LowX, HighX, LowY, HighY, LowZ, HighZ][face.index()];
    block.faces.iter().map(side).fold(TransitionSide::none(), |sides, side| sides | side)
}
