//! [`LeafBlock`]: the samples of a leaf and of its finer neighbours' faces, filled from a source.

use alloc::{vec, vec::Vec};
use core::ops::Range;

use super::{LeafKey, LevelCover};
use crate::{
    brush::QuantisedStamp,
    cell::Face,
    grid::{Grid, GridChunk, border::Border},
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
    /// What has been edited, in order. Stamps far from a leaf do not matter to it, so they may be left out.
    pub stamps: &'a [QuantisedStamp],
    /// Chunks of level 0 whose samples are known, with everything that has been edited: they count instead of the
    /// stamps there. A chunk with very many edits is better given by its samples.
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
        let is_known = |known: &Grid<i16>| {
            let chunk = |v: i32| v.div_euclid(known.chunk_cells() as i32);
            let chunks = Region::new(points.min.map(chunk), points.max.map(|v| chunk(v.saturating_sub(1)) + 1));
            known.chunks_in(chunks).next().is_some()
        };
        if self.stamps.iter().any(|stamp| reaches(stamp.region())) || self.known.is_some_and(is_known) {
            return false;
        }
        match self.source.bound(&region) {
            Bound::Outside => true,
            Bound::Inside { .. } => {
                let cut = |planes| Border::new(planes).cuts(leaf.level, region.min, region.size);
                !self.planes.is_some_and(cut)
            }
            Bound::Mixed => false,
        }
    }

    fn cells(&self) -> u32 {
        self.cells.clamp(2, MAX_CHUNK_CELLS)
    }
}

/// The samples that the mesh of a leaf is made from. The caller keeps and reuses a block.
///
/// Samples of all levels are in voxels of level 0: at level `k`, they are the source's answers times 2ᵏ. A lattice point
/// has one sample, that of the finest leaf that touches it, in the blocks of all leaves. So the meshes of all leaves of a
/// cover fit, even if the source answers differently at different levels. A point that stamps change has the sample of
/// level 0 at every level: the source's answer there, with all stamps applied.
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
}

impl LeafBlock {
    /// A block of a single sample of air, until [`LeafBlock::fill`] fills it.
    pub fn new() -> Self {
        let faces = core::array::from_fn(|_| SampleBox::new());
        Self { own: SampleBox::new(), faces, finer: FinerNeighbours::NONE, distances: Vec::new() }
    }

    /// Fills the block for a leaf of a cover. Allocates little once the block has been filled before.
    pub fn fill(&mut self, from: &LevelSource<'_>, cover: &LevelCover, leaf: LeafKey) {
        let cells = from.cells();
        let mut filler = Filler { from, cover, cells: cells as i32, distances: &mut self.distances };
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
        let (width, len) = (f32::from(1u8 << level), size.iter().map(|&v| v as usize).product());
        let region = SourceRegion { min, size, level, spacing: self.from.spacing * f64::from(width) };
        self.distances.clear();
        self.distances.resize(len, 0.0);
        out.size = size;
        out.materials.clear();
        out.materials.resize(len, 0);
        self.from.source.fill(&region, self.distances, &mut out.materials);
        out.weights.clear();
        out.weights.extend(self.distances.iter().map(|distance| i16::from_voxels(distance * width)));
        self.apply_edits(&region, out);
        if let Some(planes) = self.from.planes {
            let (weights, materials) = (&mut out.weights, &mut out.materials);
            Border::new(planes).clip_box(level, min, size, self.from.isovalue, weights, materials);
        }
    }

    /// Applies what has been edited to a box of the source's samples.
    fn apply_edits(&self, region: &SourceRegion, out: &mut SampleBox) {
        let stamps: Vec<(Region, &QuantisedStamp)> = self.from.stamps.iter().map(|s| (s.region(), s)).collect();
        let known = self.known_chunks(region);
        let reaches = stamps.iter().map(|(reach, _)| *reach).enumerate();
        // Known chunks come behind all stamps.
        let mut touched: Vec<TouchedRow> = reaches
            .chain(known.iter().map(|(reach, _)| (usize::MAX, *reach)))
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
                let old = match region.level {
                    0 => Voxel::new(out.weights[index], out.materials[index]),
                    _ => self.finest(at),
                };
                let new = match known.iter().find(|(reach, _)| reach.contains(at)) {
                    Some((reach, chunk)) => chunk.voxel(self.index_in(*reach, at)),
                    None => {
                        let here = row.iter().filter_map(|touched| stamps.get(touched.edit));
                        here.filter(|(reach, _)| reach.contains(at))
                            .fold(old, |old, (_, stamp)| stamp.at_point(old, at))
                    }
                };
                if new != old {
                    (out.weights[index], out.materials[index]) = (new.weight, new.material);
                }
            }
        }
    }

    /// The known chunks in a box of lattice points, each with its points.
    fn known_chunks(&self, region: &SourceRegion) -> Vec<(Region, &GridChunk<i16>)> {
        let Some(known) = self.from.known.filter(|known| known.chunk_cells() as i32 == self.cells) else {
            return Vec::new();
        };
        let chunk = |axis: usize, point: u32| {
            let point = (i64::from(region.min[axis]) + i64::from(point)) << region.level;
            point.div_euclid(self.cells.into()).clamp(i32::MIN.into(), i64::from(i32::MAX) - 1) as i32
        };
        let last = |axis: usize| chunk(axis, region.size[axis].saturating_sub(1)) + 1;
        let chunks = Region::new([0, 1, 2].map(|axis| chunk(axis, 0)), [0, 1, 2].map(last));
        known.chunks_in(chunks).map(|(position, chunk)| (known.chunk_region(position), chunk)).collect()
    }

    /// The index of a lattice point's sample in the chunk that has these points.
    const fn index_in(&self, chunk: Region, at: [i32; 3]) -> usize {
        let n = self.cells as usize;
        let [x, y, z] = [at[0] - chunk.min[0], at[1] - chunk.min[1], at[2] - chunk.min[2]];
        x as usize + n * (y as usize + n * z as usize)
    }

    /// The source's sample of level 0 at one lattice point.
    fn finest(&self, point: [i32; 3]) -> Voxel<i16> {
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
    /// The index of the stamp.
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
mod tests {
    use super::*;
    use crate::{LevelSettings, LevelViewer, Operation, QuantisedShape};

    /// A point that stamps change has the sample of level 0 at every level, and any other the source's own.
    #[test]
    fn stamps_reach_every_level() {
        let source = |[x, y, z]: [f64; 3]| y - 3.0 * libm::sin(x / 9.0) - 2.0 * libm::cos(z / 7.0);
        let ball = |center, radius| QuantisedShape::sphere(center, radius).unwrap();
        let stamps = [
            QuantisedStamp::new(ball([5.0, 1.0, -7.0], 9.0), Operation::Dig, 0),
            QuantisedStamp::new(ball([9.5, -2.0, -2.0], 5.0), Operation::Add, 3),
            QuantisedStamp::new(ball([-20.0, 14.0, 20.0], 6.0), Operation::Add, 4),
            QuantisedStamp::new(ball([8.0, 0.0, -4.0], 7.0), Operation::Paint, 5),
            QuantisedStamp::new(ball([-58.0, 0.0, -57.0], 6.0), Operation::Dig, 0),
            QuantisedStamp::new(ball([45.0, 0.0, 48.0], 12.0), Operation::Dig, 0),
        ];
        let (cells, extent) = (8, Region::new([-8; 3], [8; 3]));
        let mut plain = Grid::<i16>::bounded(cells, extent).unwrap();
        for position in extent.points() {
            plain.insert(position, GridChunk::from_source(&source, position, cells, 1.0)).unwrap();
        }
        let mut edited = plain.clone();
        stamps.iter().for_each(|stamp| _ = edited.apply(stamp));

        let from = LevelSource {
            source: &source,
            cells,
            spacing: 1.0,
            stamps: &stamps,
            known: None,
            planes: None,
            isovalue: 0.0,
        };
        // Some chunks are given by their samples, and the stamps are wrong there.
        let mut known = Grid::<i16>::new(cells).unwrap();
        for (position, chunk) in edited.chunks_in(extent).filter(|([x, _, z], _)| (x + z) % 2 == 0) {
            known.insert(position, chunk.clone()).unwrap();
        }
        let half_known = LevelSource { known: Some(&known), ..from };
        let settings = LevelSettings { levels: 3, falloff: 1.75, extent, ..LevelSettings::default() };
        let viewer = LevelViewer { position: [-7.5, 0.0, -7.5], distance: 30.0 };
        let cover = LevelCover::new(&[viewer], &settings, None, |_| false).unwrap();
        let (mut block, mut changed) = (LeafBlock::new(), [0; 3]);
        for (leaf, _) in cover.leaves() {
            block.fill(&half_known, &cover, leaf);
            let (own, faces) = (block.own.clone(), block.faces.clone());
            block.fill(&from, &cover, leaf);
            let are_same = |a: &SampleBox, b: &SampleBox| a.weights == b.weights && a.materials == b.materials;
            assert!(are_same(&own, &block.own) && faces.iter().zip(&block.faces).all(|(a, b)| are_same(a, b)));
            let corner = leaf.position.map(|v| v * cells as i32 - 1);
            for (index, at) in Region::new([0; 3], [cells as i32 + 3; 3]).points().enumerate() {
                let point = [0, 1, 2].map(|axis| (corner[axis] + at[axis]) << leaf.level);
                let (before, after) = (plain.get(point), edited.get(point));
                let found = Voxel::new(block.own.weights[index], block.own.materials[index]);
                let limits = Region::new([-64; 3], [64; 3]);
                if limits.contains(point) {
                    // A closure answers alike at all levels.
                    assert_eq!(found, after, "{point:?} of {leaf:?}, {before:?} before");
                    changed[usize::from(leaf.level)] += usize::from(before != after);
                }
            }
            let is_stamped = stamps.iter().any(|stamp| {
                let cell = |v: [i32; 3]| v.map(|v| v * cells as i32);
                let Region { min, max } = leaf.region();
                !stamp.region().intersection(&Region::new(cell(min), cell(max))).is_empty()
            });
            assert!(!(is_stamped && from.is_empty(leaf)));
        }
        assert!(changed.iter().all(|&points| points > 0), "{changed:?}");
    }
}
