//! [`Tally`]: counts of the flaws in a mesher's meshes.

use marchless::MeshReport;
use marchless_benches::aligned;

use crate::{
    fields::{Field, Kind},
    mesh::Mesh,
};

/// A kind of flaw: its name, and its count in a report.
type Flaw = (&'static str, fn(&MeshReport) -> usize);

/// The flaws that are counted one by one. A missing mesh is counted, too.
const FLAWS: [Flaw; 8] = [
    ("open edges", |report| report.boundary_edges),
    ("non-manifold edges", |report| report.non_manifold_edges),
    ("non-manifold vertices", |report| report.non_manifold_vertices),
    ("flipped edges", |report| report.inconsistent_edges),
    ("zero-area triangles", zero_area_triangles),
    ("duplicate vertices", |report| report.duplicate_vertices),
    ("crossing triangles", |report| report.crossing_triangles),
    ("non-finite vertices", |report| report.non_finite_vertices),
];

/// What is wrong with a mesh.
pub(crate) enum Flaws {
    /// At most triangles that cross and vertices that meet.
    Harmless(String),
    Serious(String),
}

/// The judged meshes of all fields by one mesher.
pub(crate) struct Tally {
    name: String,
    fields: usize,
    triangles: usize,
    zero_area_triangles: usize,
    /// The number of fields with any flaw.
    flawed: usize,
    /// The number of fields with any flaw, for each kind of field.
    flawed_of_kind: [usize; Kind::ALL.len()],
    /// The number of fields without a mesh.
    none: usize,
    /// For each flaw, the number of fields that have it, and its count in all fields.
    flaws: [(usize, usize); FLAWS.len()],
}

impl Tally {
    pub(crate) fn new(name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            fields: 0,
            triangles: 0,
            zero_area_triangles: 0,
            flawed: 0,
            flawed_of_kind: [0; Kind::ALL.len()],
            none: 0,
            flaws: [(0, 0); FLAWS.len()],
        }
    }

    /// Judges the mesh of a field.
    ///
    /// # Errors
    /// A description of its flaws.
    pub(crate) fn judge(&mut self, field: &Field, mesh: Option<&Mesh>) -> Result<(), Flaws> {
        self.fields += 1;
        let verdict = match mesh.filter(|mesh| !mesh.indices.is_empty() || !field.has_surface()) {
            Some(mesh) => self.examine(mesh),
            None => {
                self.none += 1;
                Err(Flaws::Serious("no mesh".to_owned()))
            }
        };
        if verdict.is_err() {
            self.flawed += 1;
            self.flawed_of_kind[field.kind as usize] += 1;
        }
        verdict
    }

    fn examine(&mut self, mesh: &Mesh) -> Result<(), Flaws> {
        let report = MeshReport::new(&mesh.positions, &mesh.indices);
        self.triangles += report.triangles;
        self.zero_area_triangles += zero_area_triangles(&report);
        for ((fields, all), (_, count)) in self.flaws.iter_mut().zip(FLAWS) {
            *fields += usize::from(count(&report) > 0);
            *all += count(&report);
        }
        if report.is_closed() && report.is_clean() {
            return Ok(());
        }
        let mut serious = report.clone();
        (serious.crossing_triangles, serious.duplicate_vertices) = (0, 0);
        let kind = if serious.is_closed() && serious.is_clean() { Flaws::Harmless } else { Flaws::Serious };
        Err(kind(report.to_string()))
    }
}

fn zero_area_triangles(report: &MeshReport) -> usize {
    report.repeated_index_triangles + report.zero_area_triangles
}

/// A table of the number of fields with each flaw, for each mesher.
pub(crate) fn fields_table(tallies: &[Tally]) -> String {
    table(tallies, "any", |tally| tally.flawed.to_string(), |&(fields, _)| fields.to_string())
}

/// A table of the count of each flaw in all fields, for each mesher.
pub(crate) fn totals_table(tallies: &[Tally]) -> String {
    table(tallies, "triangles", |tally| tally.triangles.to_string(), |&(_, all)| all.to_string())
}

/// A table with a row for each mesher, and columns for the result of `first`, for each flaw, for missing meshes and for
/// the share of triangles without an area.
fn table(
    tallies: &[Tally],
    first: &str,
    of_first: impl Fn(&Tally) -> String,
    of_flaw: impl Fn(&(usize, usize)) -> String,
) -> String {
    let names = FLAWS.map(|(name, _)| name);
    let head = ["extractor", first].into_iter().chain(names).chain(["no mesh", "zero-area share"]);
    let mut rows = vec![head.map(str::to_owned).collect::<Vec<_>>()];
    for tally in tallies {
        let share = 100.0 * tally.zero_area_triangles as f64 / tally.triangles.max(1) as f64;
        let mut row = vec![tally.name.clone(), of_first(tally)];
        row.extend(tally.flaws.iter().map(&of_flaw));
        row.extend([tally.none.to_string(), format!("{share:.1} %")]);
        rows.push(row);
    }
    aligned(&rows)
}

/// A table of the number of fields of each kind with any flaw, with a column for each mesher, in their order.
pub(crate) fn kinds_table(tallies: &[Tally]) -> String {
    let numbers = (1..=tallies.len()).map(|number| number.to_string());
    let mut rows = vec![[vec!["field".to_owned()], numbers.collect()].concat()];
    for kind in Kind::ALL {
        let flawed = tallies.iter().map(|tally| tally.flawed_of_kind[kind as usize].to_string());
        rows.push([vec![kind.name().to_owned()], flawed.collect()].concat());
    }
    aligned(&rows)
}
