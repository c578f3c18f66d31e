//! [`Cell`]: eight weights and an isovalue, and the [`Surface`]s that are made of them.

use core::error::Error;
use core::ops::RangeInclusive;

use bevy::prelude::Resource;
use marchless::cell::{CaseIndex, Corner, Face};
use marchless::{MeshBuffer, MeshReport, MeshSettings, Mesher, Samples, Shape, Topology};

use crate::presets::DEFAULT;

/// The weights of a cell's corners, and where its surface lies.
#[derive(Resource, Clone, Debug, PartialEq)]
pub(crate) struct Cell {
    /// By the corner's number; what is below the isovalue is inside.
    pub(crate) weights: [f32; 8],
    pub(crate) isovalue: f32,
}

/// What weights and isovalue may be.
pub(crate) const RANGE: RangeInclusive<f32> = -1.0..=1.0;

/// How many times as fine the interpolant is sampled.
const REFINEMENT: u32 = 32;

/// How a cell is meshed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum View {
    /// With `Topology::Separated`.
    Separated,
    /// With `Topology::Trilinear`.
    Trilinear,
    /// The trilinear interpolant, sampled finely.
    Refined,
}

impl View {
    /// From left to right.
    pub(crate) const ALL: [Self; 3] = [Self::Separated, Self::Trilinear, Self::Refined];

    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Separated => "Topology::Separated",
            Self::Trilinear => "Topology::Trilinear",
            Self::Refined => "trilinear interpolant, refined",
        }
    }
}

impl Default for Cell {
    fn default() -> Self {
        Self { weights: DEFAULT, isovalue: 0.0 }
    }
}

impl Cell {
    /// Which corners are inside.
    pub(crate) fn case(&self) -> CaseIndex {
        let inside = |corner: &Corner| self.weights[corner.index()] < self.isovalue;
        CaseIndex(Corner::ALL.iter().map(|corner| u8::from(inside(corner)) << corner.index()).sum())
    }

    /// The faces on which inside and outside corners alternate.
    pub(crate) fn ambiguous_faces(&self) -> impl Iterator<Item = Face> {
        let case = self.case();
        Face::ALL.into_iter().filter(move |face| {
            let [a, b, c, d] = face.corners().map(|corner| case.is_inside(corner));
            a == c && b == d && a != b
        })
    }

    /// Whether only two corners differ from all others, and stand opposite each other: then no face is ambiguous, but a
    /// tunnel may join both.
    pub(crate) fn is_case_4(&self) -> bool {
        let CaseIndex(inside) = self.case();
        let few = if inside.count_ones() == 2 { inside } else { !inside };
        few.count_ones() == 2 && few == few.reverse_bits()
    }

    /// Negates the weights and the isovalue: what was inside is outside.
    pub(crate) fn flip(&mut self) {
        self.weights = self.weights.map(|weight| -weight);
        self.isovalue = -self.isovalue;
    }

    /// Its surface.
    ///
    /// # Errors
    /// The mesher's, where the isovalue is not finite.
    pub(crate) fn surface(&self, view: View) -> Result<Surface, Box<dyn Error + Send + Sync>> {
        let cells = if view == View::Refined { REFINEMENT } else { 1 };
        let topology = if view == View::Trilinear { Topology::Trilinear } else { Topology::Separated };
        let settings = MeshSettings { isovalue: self.isovalue, topology, ..MeshSettings::default() };
        let shape = Shape::cube(cells + 1)?;
        let mut mesh = MeshBuffer::new();
        Mesher::new().mesh(Samples::new(shape, &self.samples(cells))?, &settings, &mut mesh)?;
        for coordinate in mesh.positions.as_flattened_mut() {
            *coordinate /= cells as f32;
        }
        let report = MeshReport::in_box(&mesh.positions, &mesh.indices, [[0.0; 3], [1.0; 3]]);
        Ok(Surface { mesh, report, is_refined: view == View::Refined })
    }

    /// The trilinear interpolant at `cells + 1` places per axis, x fastest.
    fn samples(&self, cells: u32) -> Vec<f32> {
        let mut samples = Vec::new();
        for z in 0..=cells {
            for y in 0..=cells {
                for x in 0..=cells {
                    let place = [x, y, z].map(|v| f64::from(v) / f64::from(cells));
                    let share = |corner: Corner| -> f64 {
                        let sides = corner.offset().into_iter().zip(place);
                        sides.map(|(side, t)| if side == 1 { t } else { 1.0 - t }).product()
                    };
                    let weighted = |corner: Corner| share(corner) * f64::from(self.weights[corner.index()]);
                    samples.push(Corner::ALL.into_iter().map(weighted).sum::<f64>() as f32);
                }
            }
        }
        samples
    }
}

/// The surface of a cell.
#[derive(Debug, Default)]
pub(crate) struct Surface {
    /// In cells.
    pub(crate) mesh: MeshBuffer,
    pub(crate) report: MeshReport,
    /// Whether its triangles are too many to be shown one by one.
    pub(crate) is_refined: bool,
}

impl Surface {
    /// Its figures, one or two a line.
    pub(crate) fn figures(&self) -> [String; 2] {
        let count =
            |count: usize, one: &str, several: &str| format!("{count} {}", if count == 1 { one } else { several });
        let MeshReport { triangles, components, euler, .. } = self.report;
        let triangles = count(triangles, "triangle", "triangles");
        let components = count(components, "component", "components");
        let interior = self.mesh.positions.iter().filter(|&&position| is_interior(position)).count();
        let last = match (self.report.is_clean(), self.is_refined) {
            (false, _) => ", with defects".to_owned(),
            (true, true) => String::new(),
            (true, false) => format!(", {}", count(interior, "interior vertex", "interior vertices")),
        };
        [format!("{triangles}, {components}"), format!("Euler characteristic {euler}{last}")]
    }
}

/// Whether a vertex of a single cell lies on none of its edges.
pub(crate) fn is_interior(position: [f32; 3]) -> bool {
    position.iter().all(|&v| v > 0.0 && v < 1.0)
}
