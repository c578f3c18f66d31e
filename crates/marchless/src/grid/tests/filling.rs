//! Chunks filled from sources with bounds.

use super::*;
use crate::source::{Bound, Source, SourceRegion};

/// A hollow ball of stone, as a source with or without bounds.
#[derive(Clone, Copy)]
struct Shell {
    centre: [f64; 3],
    radius: f64,
    bounds: bool,
}

impl Shell {
    fn distance(&self, point: [f64; 3]) -> f64 {
        let square = |axis: usize| (point[axis] - self.centre[axis]) * (point[axis] - self.centre[axis]);
        let away = libm::sqrt(square(0) + square(1) + square(2));
        (away - self.radius).max(3.0 - away)
    }
}

impl Source for Shell {
    fn fill(&self, region: &SourceRegion, distances: &mut [f32], materials: &mut [u8]) {
        let size = Region::new([0; 3], region.size.map(|v| v as i32));
        for (index, point) in size.points().enumerate() {
            distances[index] = (self.distance(region.position(point.map(|v| v as u32))) / region.spacing) as f32;
            materials[index] = 4;
        }
    }

    fn bound(&self, region: &SourceRegion) -> Bound {
        let [low, high] = [region.position([0; 3]), region.position(region.size.map(|v| v - 1))];
        let middle = core::array::from_fn(|axis| (low[axis] + high[axis]) / 2.0);
        let reach = libm::sqrt((0..3).map(|axis| (high[axis] - low[axis]) * (high[axis] - low[axis])).sum()) / 2.0;
        match self.distance(middle) {
            _ if !self.bounds => Bound::Mixed,
            distance if distance > reach => Bound::Outside,
            distance if distance < -reach => Bound::Inside { material: 4 },
            _ => Bound::Mixed,
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    #[test]
    fn bounds_spare_sampling_and_change_no_mesh(
        cells in 8u32..=12,
        centre in [-4.0..4.0f64, -4.0..4.0, -4.0..4.0],
        radius in 8.0..60.0f64,
        spacing in prop_oneof![Just(1.0), Just(0.5)],
    ) {
        let shell = Shell { centre, radius, bounds: true };
        let mut spared = 0;
        let mut grids = [Grid::<i16>::new(cells).unwrap(), Grid::new(cells).unwrap()];
        for position in Region::new([-4; 3], [4; 3]).points() {
            for (grid, bounds) in grids.iter_mut().zip([true, false]) {
                let source: Box<dyn Source> = Box::new(Shell { bounds, ..shell });
                grid.insert(position, GridChunk::from_source(&source, position, cells, spacing)).unwrap();
            }
            spared += u32::from(matches!(grids[0].chunk(position), Some(GridChunk::Uniform(_))));
            for point in grids[0].chunk_region(position).points() {
                let [fast, plain] = [&grids[0], &grids[1]].map(|grid| grid.get(point));
                prop_assert_eq!(fast.weight < 0, plain.weight < 0);
                prop_assert!(fast.weight == plain.weight || plain.weight.unsigned_abs() > 4 * 256);
            }
        }
        prop_assert!(spared > 0);
        let mut mesher = Mesher::new();
        let mut meshes = [MeshBuffer::new(), MeshBuffer::new()];
        for position in Region::new([-3; 3], [3; 3]).points() {
            for isovalue in [0.0, 1.0, -1.0] {
                let settings = MeshSettings { isovalue, ..MeshSettings::default() };
                for (grid, mesh) in grids.iter().zip(&mut meshes) {
                    grid.mesh_chunk(position, &mut mesher, settings, mesh).unwrap();
                }
                prop_assert_eq!(&meshes[0].positions, &meshes[1].positions);
                prop_assert_eq!(&meshes[0].normals, &meshes[1].normals);
                prop_assert_eq!(&meshes[0].indices, &meshes[1].indices);
            }
        }
    }
}
