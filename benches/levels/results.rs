//! The results: the least times, and their table.

use core::{fmt, hint::black_box};

use criterion::{BenchmarkGroup, measurement::WallTime};
use marchless_benches::{Times, aligned, duration};

use crate::block::Block;

/// The number of criterion's samples.
pub(crate) const SAMPLES: usize = 20;

/// A mesher.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Subject {
    Ours,
    /// transvoxel's `extract_from_field`.
    Field,
    /// transvoxel's `extract` on cached blocks.
    Cached,
}

impl fmt::Display for Subject {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Ours => "marchless",
            Self::Field => "transvoxel",
            Self::Cached => "transvoxel, cached blocks",
        })
    }
}

/// All times of a run.
#[derive(Default)]
pub(crate) struct Results(Vec<Timing>);

struct Timing {
    /// The block's field and number of finer faces.
    block: (&'static str, usize),
    subject: Subject,
    seconds: f64,
    triangles: usize,
}

impl Results {
    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Lets criterion time `subject`, and keeps the least time. `prepare` runs only if the filter selects the subject.
    /// Each call of its result meshes once, and returns the number of triangles.
    pub(crate) fn measure<R: FnMut() -> usize>(
        &mut self,
        group: &mut BenchmarkGroup<'_, WallTime>,
        block: &Block<'_>,
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
        if let Some(seconds) = times.least(SAMPLES) {
            self.0.push(Timing { block: (block.field.name(), block.faces.len()), subject, seconds, triangles });
        }
    }

    /// Checks that all meshers did the same work.
    ///
    /// # Panics
    /// If the numbers of triangles differ.
    pub(crate) fn check(&self, block: &Block<'_>) {
        let find = |subject| self.find((block.field.name(), block.faces.len()), subject);
        for peer in [Subject::Field, Subject::Cached] {
            if let (Some(ours), Some(theirs)) = (find(Subject::Ours), find(peer)) {
                assert_eq!(ours.triangles, theirs.triangles, "{}: the triangles of ours and {peer}", block.name());
            }
        }
    }

    fn find(&self, block: (&str, usize), subject: Subject) -> Option<&Timing> {
        self.0.iter().find(|result| result.block == block && result.subject == subject)
    }

    /// The table, with a row for each of ours: times, and the factor by which each peer takes longer.
    pub(crate) fn table(&self) -> String {
        let head = ["field", "finer faces", "triangles", "marchless", "transvoxel", "ratio", "cached blocks", "ratio"];
        let mut rows = vec![head.map(str::to_owned)];
        for ours in self.0.iter().filter(|result| result.subject == Subject::Ours) {
            let (field, faces) = ours.block;
            let peer = |subject| self.find(ours.block, subject);
            let time = |subject| peer(subject).map_or_else(String::new, |peer| duration(peer.seconds));
            let ratio =
                |subject| peer(subject).map_or_else(String::new, |peer| format!("{:.1}", peer.seconds / ours.seconds));
            rows.push([
                field.to_owned(),
                faces.to_string(),
                ours.triangles.to_string(),
                duration(ours.seconds),
                time(Subject::Field),
                ratio(Subject::Field),
                time(Subject::Cached),
                ratio(Subject::Cached),
            ]);
        }
        aligned(&rows)
    }
}
