//! A chunk's base samples are the same through every function that makes them, with any legal bounds.

use marchless::{BOUND_BOX_CHUNKS, Bound, Grid, GridChunk, Region, Source, SourceRegion};
use proptest::prelude::*;

use crate::support::random;

const CELLS: u32 = 8;

#[derive(Clone, Copy, Debug)]
enum Solid {
    /// Solid below a height, in voxels.
    Plane(i32),
    /// Solid within a radius of a point, in voxels.
    Ball([i32; 3], i32),
}

impl Solid {
    /// The signed distance in voxels; changes by at most one per voxel.
    fn distance(self, point: [f64; 3]) -> f64 {
        match self {
            Self::Plane(height) => point[1] - f64::from(height),
            Self::Ball(centre, radius) => {
                let square = |axis: usize| (point[axis] - f64::from(centre[axis])).powi(2);
                (square(0) + square(1) + square(2)).sqrt() - f64::from(radius)
            }
        }
    }

    /// The least and the greatest distance in a box.
    fn range(self, region: &SourceRegion) -> [f64; 2] {
        let low = region.min.map(f64::from);
        let high = [0, 1, 2].map(|axis| low[axis] + f64::from(region.size[axis]) - 1.0);
        match self {
            Self::Plane(_) => [self.distance(low), self.distance(high)],
            Self::Ball(centre, _) => {
                let centre = centre.map(f64::from);
                let nearest = [0, 1, 2].map(|axis| centre[axis].clamp(low[axis], high[axis]));
                let farthest = [0, 1, 2]
                    .map(|axis| if centre[axis] - low[axis] > high[axis] - centre[axis] { low } else { high }[axis]);
                [self.distance(nearest), self.distance(farthest)]
            }
        }
    }
}

/// The regions that a bound is certain of, if they are all solid or all air.
#[derive(Clone, Copy, Debug)]
enum Knows {
    All,
    Nothing,
    /// Regions of at least this many points per axis.
    Large(u32),
    /// Regions of at most this many points per axis.
    Small(u32),
    /// Random regions, by this seed.
    Some(u64),
}

impl Knows {
    fn knows(self, region: &SourceRegion) -> bool {
        match self {
            Self::All => true,
            Self::Nothing => false,
            Self::Large(size) => region.size[0] >= size,
            Self::Small(size) => region.size[0] <= size,
            Self::Some(seed) => random(random(seed, region.min), region.size) & 1 == 1,
        }
    }
}

#[derive(Clone, Copy, Debug)]
struct Odd {
    solid: Solid,
    bound: Knows,
    closely: Knows,
}

impl Odd {
    fn certain(&self, knows: Knows, region: &SourceRegion, margin: f64) -> Bound {
        match self.solid.range(region) {
            _ if !knows.knows(region) => Bound::Mixed,
            [least, _] if least >= margin => Bound::Outside,
            [_, greatest] if greatest < 0.0 && greatest <= -margin => Bound::Inside { material: 3 },
            _ => Bound::Mixed,
        }
    }
}

impl Source for Odd {
    fn fill(&self, region: &SourceRegion, distances: &mut [f32], materials: &mut [u8]) {
        let mut index = 0;
        for z in 0..region.size[2] {
            for y in 0..region.size[1] {
                for x in 0..region.size[0] {
                    let point = region.position([x, y, z]).map(|v| v / region.spacing);
                    distances[index] = self.solid.distance(point) as f32;
                    materials[index] = if distances[index] < 0.0 { 3 } else { 0 };
                    index += 1;
                }
            }
        }
    }

    fn bound(&self, region: &SourceRegion) -> Bound {
        self.certain(self.bound, region, 0.0)
    }

    fn bound_closely(&self, region: &SourceRegion) -> Bound {
        self.certain(self.closely, region, 3.0)
    }
}

fn knows() -> impl Strategy<Value = Knows> {
    prop_oneof![
        Just(Knows::All),
        Just(Knows::Nothing),
        (8u32..60).prop_map(Knows::Large),
        (8u32..60).prop_map(Knows::Small),
        any::<u64>().prop_map(Knows::Some),
    ]
}

fn source() -> impl Strategy<Value = Odd> {
    let solid = prop_oneof![
        (-60i32..60).prop_map(Solid::Plane),
        (prop::array::uniform3(-40i32..40), 4i32..80).prop_map(|(centre, radius)| Solid::Ball(centre, radius)),
    ];
    (solid, knows(), knows()).prop_map(|(solid, bound, closely)| Odd { solid, bound, closely })
}

/// `GridChunk::from_source` in plain steps.
fn plain(source: &Odd, position: [i32; 3], spacing: f64) -> (GridChunk, bool) {
    let region = |corner: [i32; 3], points: i32| {
        let min = corner.map(|v| v * CELLS as i32);
        SourceRegion { min, size: [points as u32; 3], level: 0, spacing }
    };
    let chunk = region(position, CELLS as i32);
    let whole = region(position.map(|v| v - v.rem_euclid(4)), 4 * CELLS as i32);
    for bound in [source.bound(&whole.grown(4)), source.bound(&chunk.grown(4)), source.bound_closely(&chunk)] {
        match bound {
            Bound::Inside { material } => {
                return (GridChunk::Uniform(marchless::Voxel::new(i16::MIN, material)), false);
            }
            Bound::Outside => return (GridChunk::AIR, false),
            Bound::Mixed => {}
        }
    }
    let (mut distances, mut materials) = (vec![0.0; chunk.len()], vec![0; chunk.len()]);
    source.fill(&chunk, &mut distances, &mut materials);
    let weights = distances.into_iter().map(marchless::Weight::from_voxels).collect();
    (GridChunk::from_samples(weights, materials, CELLS).unwrap(), true)
}

proptest! {
    #[test]
    fn all_functions_make_the_same_base_samples(
        source in source(),
        spacing in prop_oneof![Just(1.0), Just(0.25)],
        start in prop::array::uniform3(-8i32..5),
    ) {
        let mut grid = Grid::<i16>::new(CELLS).unwrap();
        for position in Region::new(start, start.map(|v| v + 4)).points() {
            let expected = plain(&source, position, spacing);
            let (chunk, sampled) = GridChunk::from_source_counted(&source, position, CELLS, spacing);
            prop_assert_eq!((&chunk, sampled), (&expected.0, expected.1), "at {:?}", position);
            prop_assert_eq!(&GridChunk::from_source(&source, position, CELLS, spacing), &chunk);
            grid.fill(position, &source, spacing).unwrap();
            prop_assert_eq!(grid.chunk(position), Some(&chunk));
            let early = GridChunk::without_sampling(&source, position, CELLS, spacing);
            prop_assert!(early.as_ref().is_none_or(|early| *early == chunk), "{:?} at {:?}", early, position);
            let corner = GridChunk::<i16>::bound_box(position).map(|v| v * BOUND_BOX_CHUNKS);
            let of_box = GridChunk::box_without_sampling(&source, corner, BOUND_BOX_CHUNKS as u32, CELLS, spacing);
            prop_assert!(of_box.as_ref().is_none_or(|of_box| *of_box == chunk), "{:?} at {:?}", of_box, position);
            prop_assert_eq!(GridChunk::without_sampling_in(of_box, &source, position, CELLS, spacing), early);
        }
    }
}

/// Fails if the bound of the box of chunks is never used, which random sources show only now and then.
#[test]
fn a_bound_of_the_box_alone_makes_its_chunks_uniform() {
    let source = Odd { solid: Solid::Plane(-1), bound: Knows::Large(40), closely: Knows::Nothing };
    let sampled = |y: i32| GridChunk::<i16>::from_source_counted(&source, [5, y, -7], CELLS, 1.0).1;
    assert_eq!([-5, -4, 0, 3, 4, 8].map(sampled), [false, true, true, true, false, false]);
}

#[test]
fn chunks_at_the_ends_of_i32_follow_their_bounds() {
    let source = Odd { solid: Solid::Plane(0), bound: Knows::All, closely: Knows::All };
    for cells in [8, 31, 62] {
        let end = i32::MAX / cells as i32;
        for y in [i32::MIN, i32::MIN + 5, -end - 1, -end, end, end + 1, i32::MAX - 4, i32::MAX] {
            for x in [i32::MIN, -3, i32::MAX] {
                let solid = GridChunk::Uniform(marchless::Voxel::new(i16::MIN, 3));
                let expected = if y < 0 { solid } else { GridChunk::AIR };
                assert_eq!(GridChunk::from_source(&source, [x, y, x], cells, 1.0), expected);
                assert_eq!(GridChunk::without_sampling(&source, [x, y, x], cells, 1.0), Some(expected));
            }
        }
    }
}
