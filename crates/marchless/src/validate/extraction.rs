//! [`ExtractionReport`]: whether the vertices of a mesh lie on the crossings of its samples.

use alloc::vec;
use core::fmt;

use crate::{
    buffer::MeshBuffer,
    lattice::Samples,
    mesher::{MeshSettings, Topology},
    sample::Weight,
};

/// Crossings stay this far from the ends of their edge, in cells.
const MARGIN: f64 = 1.0 / 1024.0;
/// Half the distance between two places that a crossing is rounded to.
const HALF_STEP: f64 = 0.5 / 16_384.0;

/// Whether the vertices of a mesh lie on the crossings of the samples that it was made from.
///
/// A crossing is an edge of the lattice with one end inside and the other one outside; its vertex lies where the
/// weight, linear along the edge, is the isovalue, rounded to a multiple of 2⁻¹⁴ of the edge and at least 1/1024 of it from
/// both ends. This report is about vertices alone; [`MeshReport`](crate::MeshReport) is about triangles.
///
/// ```
/// use marchless::{ExtractionReport, MeshBuffer, MeshSettings, Mesher, Samples, Shape};
///
/// let weights = [-1.0f32, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 3.0];
/// let (samples, settings) = (Samples::new(Shape::cube(2)?, &weights)?, MeshSettings::default());
/// let mut mesh = MeshBuffer::new();
/// Mesher::new().mesh(samples, &settings, &mut mesh)?;
/// let report = ExtractionReport::new(samples, &settings, &mesh);
/// assert!(report.is_sound());
/// assert_eq!(report.to_string(), "sound: 3 crossings, 3 vertices");
///
/// mesh.positions[0][0] = 0.25;
/// let report = ExtractionReport::new(samples, &settings, &mesh);
/// assert_eq!(report.to_string(), "not sound: 3 crossings, 3 vertices, 1 of them off its crossing");
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct ExtractionReport {
    /// All vertices of the mesh.
    pub vertices: usize,
    /// The crossings of the samples: lattice edges with one end inside and the other one outside. 0 if the samples
    /// cannot be meshed.
    pub crossings: usize,
    /// Misplaced vertices: on no lattice edge, on an edge without a crossing, or away from the crossing on its edge.
    pub off_crossing: usize,
    /// Vertices on the crossing of an earlier vertex.
    pub repeated: usize,
    /// Crossings without a vertex on their edge.
    pub missing: usize,
    /// Vertices strictly inside a cell that has corners both inside and outside. Only
    /// [`Topology::Trilinear`] has them; with another one they are [`off_crossing`](Self::off_crossing).
    pub interior_vertices: usize,
}

impl ExtractionReport {
    /// Compares a mesh with the samples that it was made from.
    ///
    /// `mesh`: positions in cells from the first meshed sample; any number of them, with any values. They are compared
    /// with the exact crossings, computed in `f64`. The tolerance is the precision of `f32` positions: 10⁻⁶ of a cell
    /// and 2⁻²³ of the position.
    pub fn new<W: Weight>(samples: Samples<'_, W>, settings: &MeshSettings, mesh: &MeshBuffer) -> Self {
        let lattice = Lattice::of(samples, settings.isovalue);
        let mut report = Self { vertices: mesh.positions.len(), ..Self::default() };
        // Along each axis, a bit for the edge from each meshed sample.
        let mut seen = [(); 3].map(|()| vec![0u64; lattice.len().div_ceil(64)]);
        let mut crossings_seen = 0;
        for &position in &mesh.positions {
            match lattice.locate(position) {
                Site::Edge { low, axis } if lattice.is_crossing(low, axis) => {
                    let edge = lattice.index(low);
                    let (word, bit) = (&mut seen[axis][edge / 64], 1 << (edge % 64));
                    let repeated = *word & bit != 0;
                    *word |= bit;
                    crossings_seen += usize::from(!repeated);
                    report.repeated += usize::from(repeated);
                    report.off_crossing += usize::from(!repeated && !lattice.is_at_crossing(low, axis, position));
                }
                Site::Cell(low) if settings.topology == Topology::Trilinear && lattice.is_active(low) => {
                    report.interior_vertices += 1;
                }
                _ => report.off_crossing += 1,
            }
        }
        report.crossings = lattice.count_crossings();
        report.missing = report.crossings - crossings_seen;
        report
    }

    /// Whether each crossing has exactly one vertex, in its position, and all other vertices are interior ones.
    pub const fn is_sound(&self) -> bool {
        self.off_crossing == 0 && self.repeated == 0 && self.missing == 0
    }
}

impl fmt::Display for ExtractionReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let plural = |count: usize, one, several| if count == 1 { one } else { several };
        f.write_str(if self.is_sound() { "sound: " } else { "not sound: " })?;
        write!(f, "{} {}, ", self.crossings, plural(self.crossings, "crossing", "crossings"))?;
        write!(f, "{} {}", self.vertices, plural(self.vertices, "vertex", "vertices"))?;
        if self.off_crossing > 0 {
            let word = plural(self.off_crossing, "its crossing", "their crossings");
            write!(f, ", {} of them off {word}", self.off_crossing)?;
        }
        if self.repeated > 0 {
            let word = plural(self.repeated, "a crossing that has another one", "crossings that have another one");
            write!(f, ", {} of them on {word}", self.repeated)?;
        }
        if self.missing > 0 {
            let word = plural(self.missing, "crossing", "crossings");
            write!(f, ", {} {word} without a vertex", self.missing)?;
        }
        if self.interior_vertices > 0 {
            write!(f, ", {} of them inside a cell", self.interior_vertices)?;
        }
        Ok(())
    }
}

/// Where a position lies in the lattice.
enum Site {
    /// Between two neighbouring samples.
    Edge { low: [usize; 3], axis: usize },
    /// Strictly inside the cell above a sample.
    Cell([usize; 3]),
    /// Anywhere else.
    Elsewhere,
}

/// The meshed samples.
struct Lattice<'a, W> {
    samples: Samples<'a, W>,
    isovalue: f32,
    /// Meshed samples per axis; below two on some axis if there is nothing to mesh.
    size: [usize; 3],
}

impl<'a, W: Weight> Lattice<'a, W> {
    fn of(samples: Samples<'a, W>, isovalue: f32) -> Self {
        let padding = 2 * usize::from(samples.is_padded());
        let size = samples.shape().size().map(|size| (size as usize).saturating_sub(padding));
        let meshable = isovalue.is_finite() && size.iter().all(|&size| size >= 2);
        Self { samples, isovalue, size: if meshable { size } else { [0; 3] } }
    }

    fn len(&self) -> usize {
        self.size.iter().product()
    }

    /// The index of a meshed sample among the meshed samples.
    fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        x + self.size[0] * (y + self.size[1] * z)
    }

    /// In voxels.
    fn weight(&self, at: [usize; 3]) -> f32 {
        let strides = self.samples.shape().strides();
        let padding = usize::from(self.samples.is_padded());
        let index: usize = (0..3).map(|axis| (at[axis] + padding) * strides[axis]).sum();
        self.samples.weights()[index].to_voxels()
    }

    fn is_inside(&self, at: [usize; 3]) -> bool {
        self.weight(at) < self.isovalue
    }

    /// Finds where in the lattice a position lies.
    fn locate(&self, position: [f32; 3]) -> Site {
        let within = (0..3).all(|axis| position[axis] >= 0.0 && f64::from(position[axis]) < self.size[axis] as f64);
        if !within {
            return Site::Elsewhere;
        }
        let low = position.map(|coordinate| coordinate as usize);
        let between = [0, 1, 2].map(|axis| low[axis] as f32 != position[axis]);
        // There is nothing above the last sample.
        if (0..3).any(|axis| between[axis] && low[axis] + 1 == self.size[axis]) {
            return Site::Elsewhere;
        }
        match between {
            [true, true, true] => Site::Cell(low),
            [true, false, false] => Site::Edge { low, axis: 0 },
            [false, true, false] => Site::Edge { low, axis: 1 },
            [false, false, true] => Site::Edge { low, axis: 2 },
            _ => Site::Elsewhere,
        }
    }

    fn is_crossing(&self, low: [usize; 3], axis: usize) -> bool {
        self.is_inside(low) != self.is_inside(stepped(low, axis))
    }

    /// Whether a position on a crossing's edge is the crossing.
    fn is_at_crossing(&self, low: [usize; 3], axis: usize, position: [f32; 3]) -> bool {
        let [a, b] = [low, stepped(low, axis)].map(|end| finite(self.weight(end)));
        let crossing = (f64::from(self.isovalue) - a) / (b - a);
        // Both ends may be clamped to the same limit of `f32`.
        let crossing = if crossing.is_nan() { 0.0 } else { crossing }.clamp(MARGIN, 1.0 - MARGIN);
        let coordinate = f64::from(position[axis]);
        let fraction = coordinate - low[axis] as f64;
        // Beyond 16,384 cells `f32` has no number within the margin.
        let clamped = (MARGIN..=1.0 - MARGIN).contains(&fraction) || coordinate >= 16_384.0;
        clamped && (fraction - crossing).abs() <= HALF_STEP + 1e-6 + coordinate * f64::from(f32::EPSILON)
    }

    /// Whether the cell above a sample has corners inside and outside.
    fn is_active(&self, low: [usize; 3]) -> bool {
        let mut corners = (0..8usize).map(|corner| [0, 1, 2].map(|axis| low[axis] + (corner >> axis & 1)));
        let first = self.is_inside(low);
        corners.any(|corner| self.is_inside(corner) != first)
    }

    fn count_crossings(&self) -> usize {
        let [nx, ny, nz] = self.size;
        let mut count = 0;
        for z in 0..nz {
            for y in 0..ny {
                for x in 0..nx {
                    let at = [x, y, z];
                    for axis in 0..3 {
                        count += usize::from(at[axis] + 1 < self.size[axis] && self.is_crossing(at, axis));
                    }
                }
            }
        }
        count
    }
}

/// The next sample along an axis.
fn stepped(mut at: [usize; 3], axis: usize) -> [usize; 3] {
    at[axis] += 1;
    at
}

/// NaN is outside, and nothing lies beyond what `f32` can say.
fn finite(weight: f32) -> f64 {
    f64::from(if weight.is_nan() { f32::MAX } else { weight.clamp(f32::MIN, f32::MAX) })
}
