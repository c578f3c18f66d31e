//! A cheap endless source with true bounds: hills, and caves below them.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use bevy_marchless::source::{Bound, Source, SourceRegion};

/// Hills at most 8 high, and round caves in the ground below them. Positions are in world units.
#[derive(Clone, Debug, Default)]
pub struct Hills {
    fills: Arc<AtomicU64>,
}

/// The edge of the cubes that may hold a cave each. [Units: world]
const BOUND_MARGIN: f64 = 24.0;
const CAVE: f64 = 7.0;
/// The height below which the ground is of material 2; above, it is of material 1.
const ROCK: f64 = -30.0;

impl Hills {
    /// How often it has been sampled.
    pub fn fills(&self) -> u64 {
        self.fills.load(Ordering::Relaxed)
    }

    /// The height of the ground.
    pub fn height(x: f64, z: f64) -> f64 {
        5.0 * (x * 0.07).sin() * (z * 0.06).cos() + 3.0 * (x * 0.021 + z * 0.017).sin()
    }

    fn distance([x, y, z]: [f64; 3]) -> f64 {
        let room = [x, y, z].map(|v| (v / BOUND_MARGIN).floor());
        let cave = if has_cave(room) { CAVE - length(sub([x, y, z], middle(room))) } else { -5.0 };
        (y - Self::height(x, z)).max(cave.max(-5.0))
    }

    /// The bound of a box of world positions. `hills`: the lowest and the highest ground over it.
    fn bound_box([low, high]: [[f64; 3]; 2], hills: [f64; 2]) -> Bound {
        if low[1] > hills[1] {
            return Bound::Outside;
        }
        let rooms = [0, 1, 2].map(|axis| [low[axis], high[axis]].map(|v| (v / BOUND_MARGIN).floor()));
        let few = rooms.iter().all(|[first, last]| last - first < 10.0);
        if high[1] < hills[0] && (high[1] < ROCK || low[1] >= ROCK) && few {
            let steps = |[first, last]: [f64; 2]| (0..=(last - first) as i32).map(move |step| first + f64::from(step));
            for z in steps(rooms[2]) {
                for y in steps(rooms[1]) {
                    for x in steps(rooms[0]) {
                        let middle = middle([x, y, z]);
                        let nearest = [0, 1, 2].map(|axis| middle[axis].clamp(low[axis], high[axis]));
                        if has_cave([x, y, z]) && length(sub(nearest, middle)) <= CAVE {
                            return Bound::Mixed;
                        }
                    }
                }
            }
            return Bound::Inside { material: material(high[1]) };
        }
        Bound::Mixed
    }
}

impl Source for Hills {
    fn fill(&self, region: &SourceRegion, distances: &mut [f32], materials: &mut [u8]) {
        self.fills.fetch_add(1, Ordering::Relaxed);
        let mut samples = distances.iter_mut().zip(materials);
        for z in 0..region.size[2] {
            for y in 0..region.size[1] {
                for x in 0..region.size[0] {
                    let position = region.position([x, y, z]);
                    let Some((distance, sample)) = samples.next() else { return };
                    *distance = (Self::distance(position) / region.spacing) as f32;
                    *sample = if *distance < 0.0 { material(position[1]) } else { 0 };
                }
            }
        }
    }

    fn bound(&self, region: &SourceRegion) -> Bound {
        Self::bound_box(box_of(region), [-8.0, 8.0])
    }

    fn bound_closely(&self, region: &SourceRegion) -> Bound {
        // Samples of 3 or more voxels, as this bound promises, lie that far from the surface.
        let [low, high] = box_of(&region.grown(4));
        let [x, z] = [0, 2].map(|axis| 0.5 * (low[axis] + high[axis]));
        // The steepest slopes along x and z.
        let change = 0.5 * ((high[0] - low[0]) * (0.35 + 0.063) + (high[2] - low[2]) * (0.3 + 0.051)) + 0.01;
        let height = Self::height(x, z);
        let hills = [(height - change).max(-8.0), (height + change).min(8.0)];
        Self::bound_box([low, high], hills)
    }
}

fn box_of(region: &SourceRegion) -> [[f64; 3]; 2] {
    [region.position([0; 3]), region.position(region.size.map(|v| v.saturating_sub(1)))]
}

fn material(y: f64) -> u8 {
    if y < ROCK { 2 } else { 1 }
}

fn middle(room: [f64; 3]) -> [f64; 3] {
    room.map(|v| (v + 0.5) * BOUND_MARGIN)
}

/// One cube in four holds a cave, if it lies below the hills.
fn has_cave([x, y, z]: [f64; 3]) -> bool {
    let mix =
        (x as i64).wrapping_mul(73_856_093) ^ (y as i64).wrapping_mul(19_349_663) ^ (z as i64).wrapping_mul(83_492_791);
    y < 0.5 && mix.wrapping_mul(0x2545_f491_4f6c_dd1d_u64 as i64) >> 40 & 3 == 0
}

fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn length(v: [f64; 3]) -> f64 {
    v.iter().map(|v| v * v).sum::<f64>().sqrt()
}
