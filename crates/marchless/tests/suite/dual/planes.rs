//! Sharp vertices of the plain dual mesher: the planes at a loop's crossings, and the point that is nearest to them.
//!
//! Bits are compared, so sums are in the order of edges and of axes, and rotations in the order xy, xz, yz.

use marchless::Weight;
use marchless::cell::Corner;

use super::reference::{CellVertex, STEPS, Volume};

type Point = [f32; 3];

/// A sum of squared distances to planes. Points count from the middle of the cell.
#[derive(Clone, Debug)]
pub(crate) struct Quadric {
    matrix: [Point; 3],
    vector: Point,
    constant: f32,
}

/// A vertex that planes have placed.
#[derive(Clone, Debug)]
pub(crate) struct Sharp {
    pub(crate) quadric: Quadric,
    pub(crate) is_crease: bool,
    /// In steps from the lowest corner of the cell.
    pub(crate) offset: [i64; 3],
}

fn dot(a: Point, b: Point) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn times(matrix: &[Point; 3], point: Point) -> Point {
    matrix.map(|row| dot(row, point))
}

impl Quadric {
    pub(crate) fn error(&self, point: Point) -> f32 {
        dot(point, times(&self.matrix, point)) - 2.0 * dot(self.vector, point) + self.constant
    }

    fn add(&mut self, normal: Point, point: Point) {
        let distance = dot(normal, point);
        for row in 0..3 {
            for column in 0..3 {
                self.matrix[row][column] += normal[row] * normal[column];
            }
            self.vector[row] += normal[row] * distance;
        }
        self.constant += distance * distance;
    }
}

/// The eigenvalues and eigenvectors of a symmetric matrix: four times a rotation in each plane.
fn eigen(mut matrix: [Point; 3]) -> [(f32, Point); 3] {
    let mut vectors = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0f32]];
    for [p, q] in [[0, 1], [0, 2], [1, 2]].repeat(4) {
        let (difference, twice) = (matrix[q][q] - matrix[p][p], 2.0 * matrix[p][q]);
        let size = (difference * difference + twice * twice).sqrt();
        let divisor = difference + if difference < 0.0 { -size } else { size };
        let tangent: f32 = if divisor == 0.0 { 0.0 } else { twice / divisor };
        let cosine = 1.0 / (1.0 + tangent * tangent).sqrt();
        let sine = tangent * cosine;
        let change = tangent * matrix[p][q];
        matrix[p][p] -= change;
        matrix[q][q] += change;
        (matrix[p][q], matrix[q][p]) = (0.0, 0.0);
        let rest = 3 - p - q;
        let (low, high) = (matrix[p][rest], matrix[q][rest]);
        (matrix[p][rest], matrix[q][rest]) = (cosine * low - sine * high, sine * low + cosine * high);
        (matrix[rest][p], matrix[rest][q]) = (matrix[p][rest], matrix[q][rest]);
        let (low, high) = (vectors[p], vectors[q]);
        vectors[p] = [0, 1, 2].map(|k| cosine * low[k] - sine * high[k]);
        vectors[q] = [0, 1, 2].map(|k| sine * low[k] + cosine * high[k]);
    }
    [0, 1, 2].map(|k| (matrix[k][k], vectors[k]))
}

impl<W: Weight> Volume<'_, W> {
    /// A sample in steps; `None` beyond the samples.
    fn sample(&self, at: [i64; 3]) -> Option<f32> {
        let exists = (0..3).all(|axis| (0..i64::from(self.size[axis])).contains(&at[axis]));
        exists.then(|| self.weights[self.index(at.map(|v| v as u32))].to_voxels() * W::SCALE)
    }

    /// The slope along `axis` at a corner of a cell, by the samples on the near side of a crease; and whether there is no
    /// crease.
    fn slope(&self, cell: [i64; 3], corner: Corner, axis: usize) -> (f32, bool) {
        // The differences, all along the axis: to the sample outside the cell, within the cell, beyond it.
        let differences = |axis: usize| {
            let own = [0, 1, 2].map(|k| cell[k] + i64::from(corner.offset()[k]));
            let away = if corner.offset()[axis] == 1 { -1 } else { 1 };
            let sample = |steps: i64| {
                let mut at = own;
                at[axis] += away * steps;
                self.sample(at)
            };
            let difference =
                |near: Option<f32>, far: Option<f32>| Some(if away == 1 { far? - near? } else { near? - far? });
            let inner = difference(sample(0), sample(1)).expect("both are corners of the cell");
            let outer = difference(sample(-1), sample(0)).unwrap_or(inner);
            [outer, inner, difference(sample(1), sample(2)).unwrap_or(inner)]
        };
        let size: f32 = differences(0)[1].abs() + differences(1)[1].abs() + differences(2)[1].abs();
        let [outer, inner, far] = differences(axis);
        let bend = (inner - outer).abs();
        if bend <= size / 4.0 {
            ((outer + inner) / 2.0, true)
        } else if (far - inner).abs() < bend / 8.0 {
            (inner, false)
        } else {
            (outer, false)
        }
    }

    /// The planes at the crossings of a vertex. `mean`: in steps.
    pub(crate) fn sharp(&self, cell: [i64; 3], vertex: &CellVertex, mean: [i64; 3]) -> Sharp {
        let mut quadric = Quadric { matrix: [[0.0; 3]; 3], vector: [0.0; 3], constant: 0.0 };
        let mut edges = vertex.crossings.clone();
        edges.sort();
        for edge in edges {
            let [low, high] = edge.corners();
            let fraction = self.crossing(cell, edge) as f32 / 16384.0;
            let [a, b] = [low, high].map(|corner| {
                let at = [0, 1, 2].map(|k| cell[k] + i64::from(corner.offset()[k]));
                self.sample(at).expect("corners of cells exist")
            });
            let gradient = [0, 1, 2].map(|axis| {
                let [at_low, at_high] = [low, high].map(|corner| self.slope(cell, corner, axis));
                match (at_low, at_high) {
                    _ if axis == edge.axis() => b - a,
                    ((low, true), (_, false)) => low,
                    ((_, false), (high, true)) => high,
                    ((low, _), (high, _)) => low + (high - low) * fraction,
                }
            });
            let squared = dot(gradient, gradient);
            if (1e-30..1e30).contains(&squared) {
                let scale = 1.0 / squared.sqrt();
                let point = [0, 1, 2]
                    .map(|axis| (if axis == edge.axis() { fraction } else { f32::from(low.offset()[axis]) }) - 0.5);
                quadric.add(gradient.map(|v| v * scale), point);
            }
        }
        least(quadric, mean.map(|steps| steps as f32 / STEPS as f32 - 0.5))
    }
}

/// The point of the cell where a quadric is least, nearest to `start`.
fn least(quadric: Quadric, start: Point) -> Sharp {
    let reach = 0.5 - 1.0 / STEPS as f32;
    let along = times(&quadric.matrix, start);
    let slope = [0, 1, 2].map(|k| quadric.vector[k] - along[k]);
    let eigen = eigen(quadric.matrix);
    let largest = eigen.iter().map(|&(value, _)| value).fold(f32::MIN, f32::max);
    let telling: Vec<_> = eigen.iter().filter(|&&(value, _)| value > largest / 32.0).collect();
    let mut point = start;
    for (value, vector) in &telling {
        let step = dot(*vector, slope) * (1.0 / value);
        point = [0, 1, 2].map(|k| point[k] + vector[k] * step);
    }
    if point.iter().any(|v| v.abs() > reach) {
        let mut matrix = [0, 1, 2].map(|row| [0, 1, 2].map(|k| if row == k { largest / 1024.0 } else { 0.0 }));
        let mut right = [0.0; 3];
        for (value, vector) in &telling {
            let along = dot(*vector, slope);
            for row in 0..3 {
                right[row] += vector[row] * along;
                for column in 0..3 {
                    matrix[row][column] += vector[row] * vector[column] * value;
                }
            }
        }
        let bounds = start.map(|v| [-reach - v, reach - v]);
        let step = least_in_box(&matrix, right, bounds, [0, 1, 2].map(|k| point[k] - start[k]));
        point = [0, 1, 2].map(|k| start[k] + step[k]);
    }
    let steps = |v: f32| ((v * STEPS as f32 + 2048.0).round_ties_even() as i64).clamp(1, STEPS - 1);
    Sharp { quadric, is_crease: telling.len() > 1, offset: point.map(steps) }
}

/// The best of the points on the faces and edges that `free` is beyond.
fn least_in_box(matrix: &[Point; 3], right: Point, bounds: [[f32; 2]; 3], free: Point) -> Point {
    let into = |axis: usize, v: f32| v.clamp(bounds[axis][0], bounds[axis][1]);
    let mut candidates = Vec::new();
    for axis in (0..3).filter(|&axis| into(axis, free[axis]) != free[axis]) {
        let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
        let mut on_face = [0.0; 3];
        on_face[axis] = into(axis, free[axis]);
        let rest = [0, 1, 2].map(|k| right[k] - matrix[k][axis] * on_face[axis]);
        let determinant = matrix[u][u] * matrix[v][v] - matrix[u][v] * matrix[v][u];
        on_face[u] = (rest[u] * matrix[v][v] - rest[v] * matrix[u][v]) / determinant;
        on_face[v] = (rest[v] * matrix[u][u] - rest[u] * matrix[u][v]) / determinant;
        let beyond: Vec<_> = [u, v].into_iter().filter(|&k| into(k, on_face[k]) != on_face[k]).collect();
        if beyond.is_empty() {
            candidates.push(on_face);
        }
        for fixed in beyond {
            let (mut on_edge, other) = (on_face, u + v - fixed);
            on_edge[fixed] = into(fixed, on_face[fixed]);
            let free = (rest[other] - matrix[other][fixed] * on_edge[fixed]) / matrix[other][other];
            on_edge[other] = into(other, free);
            candidates.push(on_edge);
        }
    }
    let error = |point: &Point| dot(*point, times(matrix, *point)) - 2.0 * dot(right, *point);
    let first_least = candidates.into_iter().reduce(|best, next| if error(&next) < error(&best) { next } else { best });
    first_least.expect("the point is outside the box")
}

/// Whether a quad with a crease takes its second diagonal. `places`: in steps, of the four vertices. `middles`: of
/// their cells.
pub(crate) fn follows_crease(
    is_second: bool,
    places: [[i64; 3]; 4],
    middles: [[i64; 3]; 4],
    sharp: [Option<&Sharp>; 4],
) -> bool {
    let error = |from: usize, to: usize| {
        (0..4).fold(0.0, |sum, corner| {
            let doubled = [0, 1, 2].map(|k| places[from][k] + places[to][k] - 2 * middles[corner][k]);
            let point = doubled.map(|v| v as f32 / (2 * STEPS) as f32);
            sum + sharp[corner].map_or(0.0, |sharp| sharp.quadric.error(point))
        })
    };
    let (first, second) = (error(0, 2), error(1, 3));
    if is_second { first + 1.0 / 1024.0 >= second } else { second + 1.0 / 1024.0 < first }
}

#[test]
fn eigenvectors_span_the_matrix() {
    let mut random = fastrand::Rng::with_seed(5);
    for _ in 0..10_000 {
        let mut matrix = [[0.0; 3]; 3];
        for _ in 0..1 + random.usize(..6) {
            let normal = [0; 3].map(|_| random.f32() * 2.0 - 1.0);
            for row in 0..3 {
                for column in 0..3 {
                    matrix[row][column] += normal[row] * normal[column];
                }
            }
        }
        for (value, vector) in eigen(matrix) {
            let along = times(&matrix, vector);
            assert!((0..3).all(|k| (along[k] - value * vector[k]).abs() < 1e-5), "{matrix:?}");
            assert!((dot(vector, vector) - 1.0).abs() < 1e-5);
        }
    }
}

/// No point of a fine grid over the box is better.
#[test]
fn least_points_in_boxes_are_least() {
    let mut random = fastrand::Rng::with_seed(6);
    for _ in 0..2_000 {
        let mut quadric = Quadric { matrix: [[0.0; 3]; 3], vector: [0.0; 3], constant: 0.0 };
        for _ in 0..3 + random.usize(..6) {
            let normal = [0; 3].map(|_| random.f32() * 2.0 - 1.0);
            let size = dot(normal, normal).sqrt();
            quadric.add(normal.map(|v| v / size), [0; 3].map(|_| random.f32() - 0.5));
        }
        let sharp = least(quadric.clone(), [0.0; 3]);
        let smallest = eigen(quadric.matrix).iter().map(|&(value, _)| value).fold(f32::MAX, f32::min);
        if smallest < 0.2 {
            continue;
        }
        let found = quadric.error(sharp.offset.map(|v| v as f32 / STEPS as f32 - 0.5));
        for point in (0..11 * 11 * 11).map(|i| [i % 11, i / 11 % 11, i / 121].map(|v| v as f32 / 10.0 - 0.5)) {
            assert!(found <= quadric.error(point) + 0.01, "{quadric:?}: {found} at {:?}", sharp.offset);
        }
    }
}
