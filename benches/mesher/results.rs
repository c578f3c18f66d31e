//! The results: the least times, and their table.
//!
//! A time is the least of some samples, each the mean of a batch, since other work of the machine only adds to a time.

use core::{fmt, hint::black_box};

use criterion::{BenchmarkGroup, measurement::WallTime};
use marchless::Weight;
use marchless_benches::{Times, aligned, duration};

use crate::case::Case;

/// A mesher with its kind of weights, or another measured task.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Subject {
    /// Ours with normals, on weights of this name.
    Ours(&'static str),
    /// Ours with `Topology::Trilinear`, on weights of this name.
    Trilinear(&'static str),
    /// Our dual mesher with normals, on weights of this name.
    Dual(&'static str),
    /// The same with all vertices sharp, on weights of this name.
    Sharp(&'static str),
    /// `MeshReport` on our mesh of the `f32` samples.
    Report,
    /// Ours without normals, on `f32`.
    Bare,
    /// fast-surface-nets on `f32`.
    Nets,
    /// fast-surface-nets on `f32`, with normals normalised.
    NetsNormalised,
    /// fast-surface-nets on `i8`.
    NetsI8,
    Isosurface,
    Isomesh,
    /// isomesh's manifold dual contouring.
    IsomeshDual,
    /// No mesher: the weights of this name are only read.
    Reading(&'static str),
}

impl fmt::Display for Subject {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Ours(weight) => write!(f, "marchless {weight}"),
            Self::Trilinear(weight) => write!(f, "marchless {weight}, Trilinear"),
            Self::Dual(weight) => write!(f, "marchless {weight}, dual"),
            Self::Sharp(weight) => write!(f, "marchless {weight}, sharp"),
            Self::Report => f.write_str("MeshReport"),
            Self::Bare => f.write_str("marchless f32 without normals"),
            Self::Nets => f.write_str("fast-surface-nets f32"),
            Self::NetsNormalised => f.write_str("fast-surface-nets f32, normalised"),
            Self::NetsI8 => f.write_str("fast-surface-nets i8"),
            Self::Isosurface => f.write_str("isosurface"),
            Self::Isomesh => f.write_str("isomesh"),
            Self::IsomeshDual => f.write_str("isomesh, dual contouring"),
            Self::Reading(weight) => write!(f, "reading {weight}"),
        }
    }
}

/// A weight with a name for the table, and a way to read all weights without meshing.
pub(crate) trait Measured: Weight {
    const NAME: &'static str;

    /// All weights combined in one number.
    fn read(weights: &[Self]) -> usize;
}

impl Measured for i8 {
    const NAME: &'static str = "i8";

    fn read(weights: &[Self]) -> usize {
        weights.iter().fold(0, |all, weight| all ^ weight) as usize
    }
}

impl Measured for i16 {
    const NAME: &'static str = "i16";

    fn read(weights: &[Self]) -> usize {
        weights.iter().fold(0, |all, weight| all ^ weight) as usize
    }
}

impl Measured for f32 {
    const NAME: &'static str = "f32";

    fn read(weights: &[Self]) -> usize {
        weights.iter().fold(0, |all, weight| all ^ weight.to_bits()) as usize
    }
}

/// All times of a run.
#[derive(Default)]
pub(crate) struct Results(Vec<Timing>);

struct Timing {
    /// The case's field, extent and paper.
    case: (&'static str, String, Option<&'static str>),
    subject: Subject,
    seconds: f64,
    triangles: usize,
}

impl Results {
    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Lets criterion time `subject`, and keeps the least time. `prepare` runs only if the filter selects the subject.
    /// Each call of its result does the work once, and returns a number that depends on the work: for meshers, that of
    /// the triangles.
    pub(crate) fn measure<R: FnMut() -> usize>(
        &mut self,
        group: &mut BenchmarkGroup<'_, WallTime>,
        case: &Case,
        subject: Subject,
        prepare: impl FnOnce() -> R,
    ) {
        let (mut prepare, mut run) = (Some(prepare), None);
        let (mut times, mut triangles) = (Times::default(), 0);
        group.bench_function(subject.to_string(), |bencher| {
            if let Some(prepare) = prepare.take() {
                run = Some(prepare());
            }
            let Some(run) = &mut run else { return };
            bencher.iter_custom(|iterations| times.of(iterations, || triangles = black_box(run())));
        });
        if let Some(seconds) = times.least(case.sample_size()) {
            let case = (case.field.name(), case.extent.clone(), case.paper);
            self.0.push(Timing { case, subject, seconds, triangles });
        }
    }

    /// Checks that two subjects make equally many triangles, since both mesh the same cells of the same samples by
    /// marching cubes.
    ///
    /// # Panics
    /// If the numbers differ.
    pub(crate) fn check_same_triangles(&self, case: &Case, one: Subject, other: Subject) {
        let find = |subject| self.find(case.field.name(), &case.extent, subject).map(|result| result.triangles);
        if let (Some(ours), Some(theirs)) = (find(one), find(other)) {
            assert_eq!(ours, theirs, "{}: the triangles of {one} and of {other}", case.name());
        }
    }

    fn find(&self, field: &str, extent: &str, subject: Subject) -> Option<&Timing> {
        self.0.iter().find(|result| (result.case.0, &*result.case.1, result.subject) == (field, extent, subject))
    }

    /// The table, with a row for each of ours: times, and the factor by which each peer takes longer.
    pub(crate) fn table(&self) -> String {
        let mut rows = vec![
            [
                "field",
                "samples",
                "weight",
                "triangles",
                "time",
                "Mtri/s",
                "nets",
                "nets, unit",
                "isosurface",
                "isomesh",
                "",
            ]
            .map(str::to_owned),
        ];
        for result in &self.0 {
            let weight = match result.subject {
                Subject::Ours(weight) => weight,
                Subject::Bare => "f32, no normals",
                _ => continue,
            };
            let (field, extent, paper) = &result.case;
            let factor = |subject| self.find(field, extent, subject).map(|peer| peer.seconds / result.seconds);
            let peer = |subject| factor(subject).map_or_else(String::new, |factor| format!("{factor:.1}"));
            let mut notes = Vec::new();
            if let Some(factor) = factor(Subject::Reading(weight)) {
                notes.push(format!("{:.1} times reading", 1.0 / factor));
            }
            if let Some(factor) = factor(Subject::Trilinear(weight)) {
                notes.push(format!("Trilinear: {factor:.2}"));
            }
            if let Some(report) = self.find(field, extent, Subject::Report).filter(|_| weight == f32::NAME) {
                notes.push(format!("MeshReport: {:.0} ns a triangle", report.seconds / report.triangles as f64 * 1e9));
            }
            if let Some(factor) = factor(Subject::NetsI8).filter(|_| weight == i8::NAME) {
                notes.push(format!("nets on i8: {factor:.1}"));
            }
            if let Some(milliseconds) = paper {
                notes.push(format!("paper: {milliseconds} ms"));
            }
            rows.push([
                (*field).to_owned(),
                extent.clone(),
                weight.to_owned(),
                result.triangles.to_string(),
                duration(result.seconds),
                format!("{:.1}", result.triangles as f64 / result.seconds / 1e6),
                peer(Subject::Nets),
                peer(Subject::NetsNormalised),
                peer(Subject::Isosurface),
                peer(Subject::Isomesh),
                notes.join("; "),
            ]);
        }
        aligned(&rows)
    }
}

/// The median; `None` if there are no values.
pub(crate) fn median(values: &mut [f64]) -> Option<f64> {
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}
