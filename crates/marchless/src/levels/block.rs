//! [`LeafBlock`]: the samples of a leaf and of its finer neighbours' faces, filled from a source.

use alloc::{collections::BTreeMap, vec, vec::Vec};
use core::ops::Range;

use super::{LeafKey, LevelCover};
use crate::{
    brush::QuantisedStamp,
    cell::Face,
    grid::{Grid, GridChunk, MIN_CHUNK_CELLS, border::Border},
    lattice::{MAX_CHUNK_CELLS, Region, Samples, Shape},
    mesher::{FinerNeighbours, LeafError, LeafSamples},
    sample::{Voxel, Weight},
    source::{BOUND_MARGIN, Bound, Source, SourceRegion},
};

/// What leaves are filled from.
#[derive(Clone, Copy)]
pub struct LevelSource<'a> {
    /// The field of distances and materials.
    pub source: &'a dyn Source,
    /// Cells per axis of a leaf, 2 to 62; others are clamped.
    pub cells: u32,
    /// World units between neighbouring lattice points of level 0.
    pub spacing: f64,
    /// What has been edited, in order. Stamps whose regions are four lattice points of a leaf's level or more away from
    /// it do not matter to it, so they may be left out.
    pub stamps: &'a [QuantisedStamp],
    /// Chunks of level 0 whose samples are known, with everything that has been edited and not clipped to `planes`. They
    /// count instead of the stamps there, with the same effect: at other levels, only points that differ from
    /// [`GridChunk::from_source`] have the known sample. A chunk with very many edits is better given by its samples.
    /// The grid's bounds do not matter. It is ignored if its chunks do not have `cells` cells per axis.
    pub known: Option<&'a Grid<i16>>,
    /// The border of a bounded volume, if it has one: its outermost planes of lattice points, in voxels of level 0, as
    /// [`Grid::planes`](crate::Grid::planes) gives them. What lies beyond is air, and surfaces are closed half a voxel
    /// inside.
    pub planes: Option<Region>,
    /// The isovalue at which leaves will be meshed, in voxels of level 0. It matters only where there are `planes`.
    pub isovalue: f32,
}

impl LevelSource<'_> {
    /// True if a leaf is certain to have no surface: [`Source::bound`] says so of the leaf and of four lattice points of
    /// its level around it, neither a stamp nor a known chunk reaches these points, and no border cuts solid ground
    /// there. It suits [`LevelCover::new`].
    ///
    /// The bound is asked at the leaf's level and at all finer ones, since finer leaves beside it share their samples
    /// with it.
    pub fn is_empty(&self, leaf: LeafKey) -> bool {
        let cells = self.cells();
        let region = SourceRegion {
            min: leaf.position.map(|v| v.saturating_mul(cells as i32)),
            size: [cells + 1; 3],
            level: leaf.level,
            spacing: self.spacing * f64::from(1u32 << leaf.level.min(31)),
        }
        .grown(BOUND_MARGIN);
        let scaled = |v: i64| (v << leaf.level).clamp(i32::MIN.into(), i32::MAX.into()) as i32;
        let end = |axis: usize| i64::from(region.min[axis]) + i64::from(region.size[axis]);
        let points = Region::new(region.min.map(|v| scaled(v.into())), [0, 1, 2].map(|axis| scaled(end(axis))));
        let reaches = |edited: Region| !edited.intersection(&points).is_empty();
        let mut known = self.known_in(points);
        if self.stamps.iter().any(|stamp| reaches(stamp.region())) || known.next().is_some() {
            return false;
        }
        let at = |level: u8| {
            let finer = leaf.level - level;
            let size = |size: u32| ((size - 1) << finer) + 1;
            let min = region.min.map(|v| v.saturating_mul(1 << finer));
            let spacing = self.spacing * f64::from(1u32 << level);
            self.source.bound(&SourceRegion { min, size: region.size.map(size), level, spacing })
        };
        match self.source.bound(&region) {
            Bound::Outside => (0..leaf.level).all(|level| at(level) == Bound::Outside),
            Bound::Inside { .. } => {
                let cut = |planes| Border::new(planes).cuts(leaf.level, region.min, region.size);
                let is_inside = |level: u8| matches!(at(level), Bound::Inside { .. });
                !self.planes.is_some_and(cut) && (0..leaf.level).all(is_inside)
            }
            Bound::Mixed => false,
        }
    }

    fn cells(&self) -> u32 {
        self.cells.clamp(2, MAX_CHUNK_CELLS)
    }

    /// The known chunks.
    fn known(&self) -> Option<&Grid<i16>> {
        self.known.filter(|known| known.chunk_cells() == self.cells())
    }

    /// The known chunks that have any of these lattice points of level 0: the points of each.
    fn known_in(&self, points: Region) -> impl Iterator<Item = Region> + '_ {
        self.known().into_iter().flat_map(move |known| {
            let last = known.chunk_of(points.max.map(|v| v.saturating_sub(1)));
            let chunks = Region::new(known.chunk_of(points.min), last.map(|v| v + 1));
            known.chunks_in(chunks).map(|(position, _)| known.chunk_region(position))
        })
    }
}

/// The samples that the mesh of a leaf is made from. The caller keeps and reuses a block.
///
/// Samples of all levels are in voxels of level 0: at level `k`, they are the source's answers times 2ᵏ. A lattice point
/// has one sample, that of the finest leaf that touches it, in the blocks of all leaves. So the meshes of all leaves of a
/// cover fit, even if the source answers differently at different levels. A point that stamps change has the sample of
/// level 0 at every level: that of [`GridChunk::from_source`], with all stamps applied. So leaves of level 0 may as
/// well be meshed as chunks of a [`Grid`].
///
/// ```
/// use marchless::{
///     LeafBlock, LeafKey, LevelCover, LevelSettings, LevelSource, LevelViewer, MeshBuffer, MeshSettings, MeshUnion,
///     Mesher,
/// };
///
/// // A planet of radius 100 around the origin, seen from above its north pole.
/// let planet = |[x, y, z]: [f64; 3]| (x * x + y * y + z * z).sqrt() - 100.0;
/// let cells = 16;
/// let level_source = LevelSource {
///     source: &planet,
///     cells,
///     spacing: 1.0,
///     stamps: &[],
///     known: None,
///     planes: None,
///     isovalue: 0.0,
/// };
/// let viewer = LevelViewer { position: [0.0, 7.0, 0.0], distance: 20.0 };
/// let settings = LevelSettings { levels: 4, falloff: 2.0, ..LevelSettings::default() };
/// // A chunk whose middle is farther from the surface than its corners are from its middle is empty.
/// let is_empty = |leaf: LeafKey| {
///     let half = f64::from(cells << leaf.level) / 2.0;
///     planet(leaf.position.map(|v| (2.0 * f64::from(v) + 1.0) * half)).abs() > 1.75 * half + 4.0
/// };
/// let cover = LevelCover::new(&[viewer], &settings, None, is_empty)?;
///
/// let (mut mesher, mut block, mut mesh) = (Mesher::new(), LeafBlock::new(), MeshBuffer::new());
/// let mut union = MeshUnion::new();
/// for (leaf, _) in cover.leaves().filter(|(_, is_empty)| !is_empty) {
///     block.fill(&level_source, &cover, leaf);
///     mesher.mesh_leaf(&block.samples()?, &MeshSettings::default(), &mut mesh)?;
///     union.add(&mesh, leaf.region().min.map(|v| i64::from(v) * i64::from(cells)), leaf.level);
/// }
/// let report = union.report();
/// assert!(report.is_closed() && report.is_clean() && report.components == 1, "{report}");
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct LeafBlock {
    own: SampleBox,
    /// By face; filled where its neighbour is finer.
    faces: [SampleBox; 6],
    finer: FinerNeighbours,
    /// Scratch memory: what a source answers.
    distances: Vec<f32>,
    /// Scratch memory: the sample of all points of a chunk of level 0, if a bound decides it.
    bounds: BTreeMap<[i32; 3], Option<Voxel<i16>>>,
}

impl LeafBlock {
    /// A block of a single sample of air, until [`LeafBlock::fill`] fills it.
    pub fn new() -> Self {
        let faces = core::array::from_fn(|_| SampleBox::new());
        let (distances, bounds) = (Vec::new(), BTreeMap::new());
        Self { own: SampleBox::new(), faces, finer: FinerNeighbours::NONE, distances, bounds }
    }

    /// Fills the block for a leaf of a cover. Allocates little once the block has been filled before.
    pub fn fill(&mut self, from: &LevelSource<'_>, cover: &LevelCover, leaf: LeafKey) {
        let cells = from.cells();
        self.bounds.clear();
        let (distances, bounds) = (&mut self.distances, &mut self.bounds);
        let mut filler = Filler { from, cover, cells: cells as i32, distances, bounds };
        self.finer = cover.finer_neighbours(leaf);
        let corner = leaf.position.map(|v| v.saturating_mul(cells as i32));
        filler.fill(leaf.level, corner.map(|v| v.saturating_sub(1)), [cells + 3; 3], &mut self.own);
        for face in Face::ALL.into_iter().filter(|&face| self.finer.contains_face(face)) {
            let (mut min, mut size) = (corner.map(|v| v.saturating_mul(2).saturating_sub(1)), [2 * cells + 3; 3]);
            if face.is_high() {
                min[face.axis()] = min[face.axis()].saturating_add(2 * cells as i32);
            }
            size[face.axis()] = 3;
            // A leaf of level 0 has no finer neighbours.
            filler.fill(leaf.level.saturating_sub(1), min, size, &mut self.faces[face.index()]);
        }
    }

    /// The samples, for [`Mesher::mesh_leaf`](crate::Mesher::mesh_leaf).
    ///
    /// # Errors
    /// [`LeafError::Samples`] before the first [`LeafBlock::fill`], and [`LeafError::PointsDiffer`] if the source gives
    /// two answers for one point.
    pub fn samples(&self) -> Result<LeafSamples<'_, i16>, LeafError> {
        let faces = Face::ALL.map(|face| self.finer.contains_face(face).then(|| self.faces[face.index()].samples()));
        LeafSamples::new(self.own.samples().padded(), self.finer, faces)
    }
}

impl Default for LeafBlock {
    fn default() -> Self {
        Self::new()
    }
}

/// A box of samples.
#[derive(Clone, Debug)]
struct SampleBox {
    size: [u32; 3],
    weights: Vec<i16>,
    materials: Vec<u8>,
}

impl SampleBox {
    fn new() -> Self {
        Self { size: [1; 3], weights: vec![i16::OUTSIDE], materials: vec![0] }
    }

    fn samples(&self) -> Samples<'_, i16> {
        Shape::new(self.size)
            .map(|shape| Samples::new(shape, &self.weights).and_then(|samples| samples.with_materials(&self.materials)))
            .expect("a leaf has few cells")
            .expect("samples fill their box")
    }

    fn index(&self, at: [u32; 3]) -> usize {
        let [x, y, z] = at.map(|v| v as usize);
        let [nx, ny, _] = self.size.map(|v| v as usize);
        x + nx * (y + ny * z)
    }
}

/// Fills boxes of samples of any level.
struct Filler<'a> {
    from: &'a LevelSource<'a>,
    cover: &'a LevelCover,
    cells: i32,
    distances: &'a mut Vec<f32>,
    bounds: &'a mut BTreeMap<[i32; 3], Option<Voxel<i16>>>,
}

impl Filler<'_> {
    /// Fills a box of lattice points of a level with what leaves of that level read there.
    fn fill(&mut self, level: u8, min: [i32; 3], size: [u32; 3], out: &mut SampleBox) {
        self.sample(level, min, size, out);
        if level == 0 || !self.has_split_places(level, min, size) {
            return;
        }
        // Points between split and whole places have finer samples.
        let segments = [0, 1, 2].map(|axis| self.segments(min[axis], size[axis]));
        let mut finer = SampleBox::new();
        for z in &segments[2] {
            for y in &segments[1] {
                for x in &segments[0] {
                    let part = [x, y, z];
                    if !self.is_mixed(level, part.map(|segment| segment.places.clone())) {
                        continue;
                    }
                    let start = [0, 1, 2].map(|axis| min[axis].saturating_add(part[axis].points.start as i32));
                    let len = part.map(|segment| segment.points.len() as u32);
                    self.fill(level - 1, start.map(|v| v.saturating_mul(2)), len.map(|v| 2 * v - 1), &mut finer);
                    for k in 0..len[2] {
                        for j in 0..len[1] {
                            for i in 0..len[0] {
                                let from = finer.index([2 * i, 2 * j, 2 * k]);
                                let to = [i, j, k];
                                let to = out.index([0, 1, 2].map(|axis| part[axis].points.start + to[axis]));
                                (out.weights[to], out.materials[to]) = (finer.weights[from], finer.materials[from]);
                            }
                        }
                    }
                }
            }
        }
    }

    /// Fills a box with the source's own samples of a level.
    fn sample(&mut self, level: u8, min: [i32; 3], size: [u32; 3], out: &mut SampleBox) {
        let len = size.iter().map(|&v| v as usize).product();
        let region = SourceRegion { min, size, level, spacing: self.from.spacing * f64::from(1u8 << level) };
        out.size = size;
        out.materials.clear();
        out.materials.resize(len, 0);
        out.weights.resize(len, 0);
        self.from.source.fill_weights(&region, self.distances, &mut out.weights, &mut out.materials);
        self.apply_edits(&region, out);
        if let Some(planes) = self.from.planes {
            let (weights, materials) = (&mut out.weights, &mut out.materials);
            Border::new(planes).clip_box(level, min, size, self.from.isovalue, weights, materials);
        }
    }

    /// Applies what has been edited to a box of the source's samples.
    fn apply_edits(&mut self, region: &SourceRegion, out: &mut SampleBox) {
        let from = self.from;
        let stamps: Vec<(Region, &QuantisedStamp)> = from.stamps.iter().map(|s| (s.region(), s)).collect();
        let scaled = |axis: usize, point: u32| {
            let point = (i64::from(region.min[axis]) + i64::from(point)) << region.level;
            point.clamp(i32::MIN.into(), i32::MAX.into()) as i32
        };
        let ends = Region::new([0, 1, 2].map(|k| scaled(k, 0)), [0, 1, 2].map(|k| scaled(k, region.size[k])));
        // At level 0, meshes and normals next to edits read what a bound has decided, too: see `finest`.
        let beside = if region.level == 0 { 2 } else { 0 };
        // Known chunks come behind all stamps.
        let known = from.known_in(ends.grown(beside, beside)).map(|reach| (usize::MAX, reach));
        let mut touched: Vec<TouchedRow> = (stamps.iter().map(|(reach, _)| *reach).enumerate().chain(known))
            .filter(|(_, reach)| !reach.is_empty())
            .map(|(edit, reach)| (edit, reach.grown(beside, beside)))
            .flat_map(|(edit, reach)| touched_rows(region, reach).map(move |(row, x)| TouchedRow { row, x, edit }))
            .collect();
        touched.sort_unstable_by_key(|touched| (touched.row, touched.edit));
        for row in touched.chunk_by(|a, b| a.row == b.row) {
            let [z, y] = row[0].row;
            let (first, last) = row.iter().fold((u32::MAX, 0), |(a, b), t| (a.min(t.x.start), b.max(t.x.end)));
            for x in (first..last).filter(|x| row.iter().any(|touched| touched.x.contains(x))) {
                let index = out.index([x, y, z]);
                let (point, step) = ([x, y, z], 1 << region.level);
                let at = [0, 1, 2].map(|k| region.min[k].saturating_add(point[k] as i32).saturating_mul(step));
                let sampled = (region.level == 0).then(|| Voxel::new(out.weights[index], out.materials[index]));
                let old = self.finest(at, sampled);
                let new = match self.known(at) {
                    Some(known) => known,
                    None => {
                        let here = row.iter().filter_map(|touched| stamps.get(touched.edit));
                        here.filter(|(reach, _)| reach.contains(at))
                            .fold(old, |old, (_, stamp)| stamp.at_point(old, at))
                    }
                };
                if new != old || region.level == 0 {
                    (out.weights[index], out.materials[index]) = (new.weight, new.material);
                }
            }
        }
    }

    /// The sample of level 0 at a lattice point in a known chunk.
    fn known(&self, point: [i32; 3]) -> Option<Voxel<i16>> {
        let known = self.from.known()?;
        Some(known.chunk(known.chunk_of(point))?.voxel(known.index(point)))
    }

    /// The sample of level 0 at one lattice point before all edits, as [`GridChunk::from_source`] has it. `sampled`:
    /// the source's own answer, if it is there already.
    ///
    /// The two differ far from the source's surface, where a bound decides what a whole chunk is made of. Edits may put
    /// a surface there, and that of a grid's chunk next to it must fit.
    fn finest(&mut self, point: [i32; 3], sampled: Option<Voxel<i16>>) -> Voxel<i16> {
        let LevelSource { source, spacing, .. } = *self.from;
        let (chunk, cells) = (point.map(|v| v.div_euclid(self.cells)), self.cells as u32);
        let decided = self.bounds.entry(chunk).or_insert_with(|| {
            // No grid has smaller chunks.
            let chunk = (cells >= MIN_CHUNK_CELLS).then(|| GridChunk::from_bounds(source, chunk, cells, spacing))??;
            Some(chunk.voxel(0))
        });
        if let Some(known) = decided.or(sampled) {
            return known;
        }
        let region = SourceRegion { min: point, size: [1; 3], level: 0, spacing: self.from.spacing };
        let (mut distance, mut material) = ([0.0], [0]);
        self.from.source.fill(&region, &mut distance, &mut material);
        Voxel::new(i16::from_voxels(distance[0]), material[0])
    }

    /// Whether any chunk of this level that a box of points touches is split.
    fn has_split_places(&self, level: u8, min: [i32; 3], size: [u32; 3]) -> bool {
        let places = [0, 1, 2].map(|axis| {
            let last = min[axis].saturating_add(size[axis] as i32 - 1);
            (min[axis].saturating_sub(1)).div_euclid(self.cells)..last.div_euclid(self.cells) + 1
        });
        self.places(level, places).any(|is_split| is_split)
    }

    /// Whether some of these chunks are split and some are not.
    fn is_mixed(&self, level: u8, places: [Range<i32>; 3]) -> bool {
        let mut places = self.places(level, places);
        let first = places.next();
        places.any(|is_split| Some(is_split) != first)
    }

    /// Whether each of these chunks is split.
    fn places(&self, level: u8, [x, y, z]: [Range<i32>; 3]) -> impl Iterator<Item = bool> + '_ {
        let positions = z.flat_map(move |z| {
            let x = x.clone();
            y.clone().flat_map(move |y| x.clone().map(move |x| [x, y, z]))
        });
        positions.map(move |position| self.cover.is_split(LeafKey { level, position }))
    }

    /// The points of a box along one axis: those on borders of chunks one by one, and those between together.
    fn segments(&self, min: i32, size: u32) -> Vec<Segment> {
        let mut segments: Vec<Segment> = Vec::new();
        for point in 0..size {
            let at = min.saturating_add(point as i32);
            let place = at.div_euclid(self.cells);
            let is_border = at.rem_euclid(self.cells) == 0;
            match segments.last_mut() {
                Some(last) if !is_border && last.places == (place..place + 1) => last.points.end = point + 1,
                _ => {
                    let places = place - i32::from(is_border)..place + 1;
                    segments.push(Segment { points: point..point + 1, places });
                }
            }
        }
        segments
    }
}

/// A row of points, `[z, y]`, and those of it that an edit reaches, counted from the box's lowest.
struct TouchedRow {
    row: [u32; 2],
    x: Range<u32>,
    /// The index of the stamp; the highest for a known chunk.
    edit: usize,
}

/// The rows of a box that a box of lattice points of level 0 reaches.
fn touched_rows(region: &SourceRegion, reach: Region) -> impl Iterator<Item = ([u32; 2], Range<u32>)> + use<> {
    let step = 1 << region.level;
    let (min, size) = (region.min, region.size);
    let [x, y, z] = [0, 1, 2].map(|axis| {
        let index = |v: i32| (v.saturating_add(step - 1).div_euclid(step)).saturating_sub(min[axis]);
        let size = size[axis] as i32;
        index(reach.min[axis]).clamp(0, size) as u32..index(reach.max[axis]).clamp(0, size) as u32
    });
    let z = if x.is_empty() { 0..0 } else { z };
    z.flat_map(move |z| {
        let x = x.clone();
        y.clone().map(move |y| ([z, y], x.clone()))
    })
}

/// Points of a box along one axis that lie in the same chunks, borders included.
struct Segment {
    points: Range<u32>,
    places: Range<i32>,
}

#[cfg(test)]
mod tests;
