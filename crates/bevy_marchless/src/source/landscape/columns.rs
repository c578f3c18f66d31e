//! [`Columns`]: the heights of a ground, each evaluated once and kept for the chunks above and below.

use core::mem;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use marchless::SourceRegion;

use super::field::{Field, FieldPoints};
use crate::source::detail::Detail;
use crate::source::height_field::Column;

/// The number of columns along a side of a tile.
const TILE: i64 = 16;

/// The number of parts of the cache that are locked separately.
const SHARDS: usize = 8;

/// The most tiles in one generation of a shard.
///
/// A shard holds two generations. So the cache of one ground stays below 8 · 2 · 512 · 2 KB = 16 MB, which is a square
/// of 90 tiles or 1,448 columns. Tiles of coarse levels may be twice as large.
const TILES_PER_GENERATION: usize = 512;

/// [`TILE`]² columns, x fastest. The thread that needs a tile first evaluates it; others wait for it.
#[derive(Default)]
struct Tile {
    heights: OnceLock<Box<[f64]>>,
    /// [`Column::material_up`], for levels other than 0.
    ups: OnceLock<Box<[f64]>>,
}

/// A tile's position along x and z, in tiles, the bits of the spacing of its columns, and their level of detail.
type Key = (i64, i64, u64, u8);

/// The heights of one ground.
///
/// Tiles lie at multiples of 16 columns, whatever the size of chunks. So each height is evaluated once for all regions.
pub(super) struct Columns {
    field: Field,
    shards: [Mutex<Shard>; SHARDS],
}

/// Two generations of tiles. When the younger one is full, it becomes the older one; tiles of the former older one that
/// have not been used since are dropped.
#[derive(Default)]
struct Shard {
    young: HashMap<Key, Arc<Tile>>,
    old: HashMap<Key, Arc<Tile>>,
}

impl Shard {
    fn tile(&mut self, key: Key) -> Arc<Tile> {
        if let Some(tile) = self.young.get(&key) {
            return tile.clone();
        }
        let tile = self.old.remove(&key).unwrap_or_default();
        if self.young.len() >= TILES_PER_GENERATION {
            self.old = mem::take(&mut self.young);
        }
        self.young.insert(key, tile.clone());
        tile
    }
}

impl Columns {
    pub(super) fn new(field: Field) -> Self {
        Self { field, shards: Default::default() }
    }

    pub(super) fn field(&self) -> &Field {
        &self.field
    }

    /// The ground in each column of a region, x fastest. Slopes are central differences, so they depend only on the
    /// column's position and the spacing.
    ///
    /// `with_slopes`: whether materials go by slopes. If so, these are the slopes of level 0 at every level: coarse
    /// levels leave out what is steep in the small, and would give it another material.
    pub(super) fn of(&self, region: &SourceRegion, with_slopes: bool, calls: &mut u64) -> Vec<Column> {
        let [nx, nz] = [0, 2].map(|axis| region.size[axis] as usize);
        let width = nx + 2;
        let heights = self.gather(region, 1, calls, |tile, at, calls| {
            tile.heights.get_or_init(|| self.evaluate(at, Detail::of(region), region.spacing, calls))
        });
        let run = 2.0 * region.spacing;
        let indices = (0..nz).flat_map(|z| (0..nx).map(move |x| x + 1 + width * (z + 1)));
        let mut columns: Vec<Column> = indices
            .map(|index| {
                let [along_x, along_z] = [1, width].map(|step| [heights[index - step], heights[index + step]]);
                Column::new(heights[index], along_x, along_z, run)
            })
            .collect();
        if with_slopes && region.level > 0 {
            let ups = self.gather(region, 0, calls, |tile, at, calls| {
                tile.ups.get_or_init(|| self.evaluate_ups(at, Detail::of(region), calls))
            });
            for (column, up) in columns.iter_mut().zip(ups) {
                column.material_up = up;
            }
        }
        columns
    }

    /// The values of a region's columns and of `ring` columns around them, x fastest. `of_tile`: the values of a tile,
    /// given its position in tiles.
    fn gather(
        &self,
        region: &SourceRegion,
        ring: i64,
        calls: &mut u64,
        of_tile: impl for<'a> Fn(&'a Tile, [i64; 2], &mut u64) -> &'a [f64],
    ) -> Vec<f64> {
        let low = [0, 2].map(|axis| i64::from(region.min[axis]) - ring);
        let size = [0, 2].map(|axis| i64::from(region.size[axis]) + 2 * ring);
        let mut values = vec![0.0; (size[0] * size[1]) as usize];
        let tiles = |axis: usize| low[axis].div_euclid(TILE)..=(low[axis] + size[axis] - 1).div_euclid(TILE);
        for (tile_x, tile_z) in tiles(1).flat_map(|z| tiles(0).map(move |x| (x, z))) {
            let tile = self.tile((tile_x, tile_z, region.spacing.to_bits(), region.level));
            let tile = of_tile(&tile, [tile_x, tile_z], calls);
            let common = |axis: usize, tile: i64| {
                let first = (tile * TILE).max(low[axis]);
                first..(tile * TILE + TILE).min(low[axis] + size[axis]).max(first)
            };
            let [xs, zs] = [common(0, tile_x), common(1, tile_z)];
            let len = (xs.end - xs.start) as usize;
            for z in zs {
                let from = (xs.start - tile_x * TILE + TILE * (z - tile_z * TILE)) as usize;
                let to = (xs.start - low[0] + size[0] * (z - low[1])) as usize;
                values[to..to + len].copy_from_slice(&tile[from..from + len]);
            }
        }
        values
    }

    fn tile(&self, key: Key) -> Arc<Tile> {
        let shard = (key.0.wrapping_mul(5).wrapping_add(key.1.wrapping_mul(3))).rem_euclid(SHARDS as i64) as usize;
        // A poisoned lock is harmless: a shard is consistent at all times, even if a thread panicked while it held it.
        self.shards[shard].lock().unwrap_or_else(PoisonError::into_inner).tile(key)
    }

    fn evaluate(&self, tile: [i64; 2], detail: Detail, spacing: f64, calls: &mut u64) -> Box<[f64]> {
        let [xs, zs] =
            tile.map(|tile| (0..TILE).map(|index| (tile * TILE + index) as f64 * spacing).collect::<Vec<_>>());
        let mut heights = vec![0.0; (TILE * TILE) as usize];
        self.field.values(detail, &FieldPoints::Grid { xs: &xs, zs: &zs }, &mut heights, calls);
        heights.into()
    }

    /// The y part of the ground's normal at each column of a tile, bit for bit as at level 0.
    fn evaluate_ups(&self, tile: [i64; 2], detail: Detail, calls: &mut u64) -> Box<[f64]> {
        let mut beside = |steps: [f64; 2]| {
            let [xs, zs] = [0, 1].map(|axis| {
                let points = (0..TILE).map(|index| (tile[axis] * TILE + index) as f64 * detail.voxels());
                points.map(|point| (point + steps[axis]) * detail.voxel()).collect::<Vec<_>>()
            });
            let mut heights = vec![0.0; (TILE * TILE) as usize];
            self.field.values(Detail::FINEST, &FieldPoints::Grid { xs: &xs, zs: &zs }, &mut heights, calls);
            heights
        };
        let [left, right, front, back] = [[-1.0, 0.0], [1.0, 0.0], [0.0, -1.0], [0.0, 1.0]].map(&mut beside);
        let columns = left.into_iter().zip(right).zip(front.into_iter().zip(back));
        let run = 2.0 * detail.voxel();
        columns.map(|((left, right), (front, back))| Column::new(0.0, [left, right], [front, back], run).up).collect()
    }
}
