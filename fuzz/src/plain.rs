//! A grid of bits as plain as can be.

use marchless::bits::{BitGrid, Connectivity};

/// A value for each point.
#[derive(Clone, Debug)]
pub struct Plain {
    /// Points per axis.
    pub size: [u32; 3],
    /// x fastest.
    values: Vec<bool>,
}

impl Plain {
    /// What `value` says of each point.
    pub fn new(size: [u32; 3], value: impl Fn([u32; 3]) -> bool) -> Self {
        Self { size, values: points(size).map(value).collect() }
    }

    /// Whether there is such a point.
    pub fn holds(&self, point: [i64; 3]) -> bool {
        (0..3).all(|axis| (0..i64::from(self.size[axis])).contains(&point[axis]))
    }

    /// A point's value, `false` outside.
    pub fn get(&self, point: [i64; 3]) -> bool {
        let [nx, ny, _] = self.size.map(i64::from);
        self.holds(point) && self.values[(point[0] + nx * (point[1] + ny * point[2])) as usize]
    }

    /// The points that are set, x fastest.
    pub fn set(&self) -> Vec<[u32; 3]> {
        points(self.size).filter(|point| self.get(point.map(i64::from))).collect()
    }

    /// Whether a grid has the same points, one by one and counted: so that it has no others beyond its rows.
    pub fn same(&self, grid: &BitGrid) -> bool {
        let ones: usize = grid.words().iter().map(|word| word.count_ones() as usize).sum();
        grid.shape().size() == self.size
            && points(self.size).all(|point| grid.get(point) == self.get(point.map(i64::from)))
            && ones == self.values.iter().filter(|&&value| value).count()
    }

    /// How many neighbours of a point are set, where those outside are as `outside` says.
    pub fn around(&self, point: [u32; 3], connectivity: Connectivity, outside: bool) -> usize {
        neighbours(connectivity)
            .map(|step| std::array::from_fn(|axis| i64::from(point[axis]) + step[axis]))
            .filter(|&next| if self.holds(next) { self.get(next) } else { outside })
            .count()
    }

    /// What a way over set points leads to from `seeds`.
    pub fn flood(&self, seeds: &[[u32; 3]], connectivity: Connectivity) -> Self {
        let mut filled = Self::new(self.size, |_| false);
        let mut stack: Vec<[i64; 3]> = seeds.iter().map(|seed| seed.map(i64::from)).collect();
        while let Some(point) = stack.pop() {
            if self.get(point) && !filled.get(point) {
                let [nx, ny, _] = self.size.map(i64::from);
                filled.values[(point[0] + nx * (point[1] + ny * point[2])) as usize] = true;
                stack.extend(neighbours(connectivity).map(|step| std::array::from_fn(|axis| point[axis] + step[axis])));
            }
        }
        filled
    }
}

/// The ways to a point's neighbours.
pub fn neighbours(connectivity: Connectivity) -> impl Iterator<Item = [i64; 3]> {
    let axes = match connectivity {
        Connectivity::Six => 1,
        Connectivity::Eighteen => 2,
        Connectivity::TwentySix => 3,
    };
    (0..27i64)
        .map(|step| [step % 3 - 1, step / 3 % 3 - 1, step / 9 - 1])
        .filter(move |step| (1..=axes).contains(&step.iter().map(|v| v.abs()).sum::<i64>()))
}

/// All points of a grid, x fastest.
pub fn points([nx, ny, nz]: [u32; 3]) -> impl Iterator<Item = [u32; 3]> {
    (0..nz).flat_map(move |z| (0..ny).flat_map(move |y| (0..nx).map(move |x| [x, y, z])))
}
