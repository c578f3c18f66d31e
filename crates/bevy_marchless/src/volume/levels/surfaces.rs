//! [`Surfaces`]: which boxes may have a surface.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, PoisonError, RwLock};

use bevy_platform::collections::{HashMap, HashSet};
use marchless::{LeafKey, LevelSource, Region, Source};

use crate::volume::SamplingSettings;

/// The most boxes whose bounds are remembered.
const MOST_BOUNDS: usize = 1 << 17;
/// A stamp on more chunks than this is noted as a whole.
const MANY: u64 = 4096;

/// Which boxes of a terrain may have a surface: where the source's bound does not rule it out, and where stamps have
/// been. Shared with jobs.
pub(crate) struct Surfaces {
    source: Arc<dyn Source>,
    cells: u32,
    spacing: f64,
    planes: Option<Region>,
    /// Whether the source rules out a surface.
    bounds: Mutex<HashMap<LeafKey, bool>>,
    stamped: RwLock<Stamped>,
}

/// Where stamps have been.
#[derive(Clone, Default)]
struct Stamped {
    /// The leaves of every level that small stamps reach.
    leaves: HashSet<LeafKey>,
    /// The lattice points that large stamps reach.
    large: Vec<Region>,
}

impl Surfaces {
    pub(super) fn new(settings: &SamplingSettings, planes: Option<Region>) -> Self {
        let SamplingSettings { source, cells, spacing, .. } = settings.clone();
        Self { source, cells, spacing, planes, bounds: Mutex::default(), stamped: RwLock::default() }
    }

    /// The same stamps on a terrain with other borders.
    pub(super) fn with_planes(&self, planes: Option<Region>) -> Self {
        let stamped = self.stamped.read().unwrap_or_else(PoisonError::into_inner).clone();
        let Self { source, cells, spacing, .. } = self;
        Self {
            source: source.clone(),
            cells: *cells,
            spacing: *spacing,
            planes,
            bounds: Mutex::default(),
            stamped: RwLock::new(stamped),
        }
    }

    /// Whether a leaf is certain to have no surface.
    pub(super) fn is_empty(&self, leaf: LeafKey) -> bool {
        !self.is_stamped(leaf) && self.is_ruled_out(leaf)
    }

    /// Notes a stamp, and returns whether a leaf may have a surface that was not noted before. `touched`: the lattice
    /// points that it may change.
    pub(super) fn stamp(&self, touched: Region) -> bool {
        if touched.is_empty() {
            return false;
        }
        let mut stamped = self.stamped.write().unwrap_or_else(PoisonError::into_inner);
        let leaves = self.reached(0, touched);
        if leaves.size().into_iter().map(u64::from).product::<u64>() > MANY {
            stamped.large.push(touched);
            return true;
        }
        let before = stamped.leaves.len();
        for level in 0..7 {
            stamped.leaves.extend(self.reached(level, touched).points().map(|position| LeafKey { level, position }));
        }
        stamped.leaves.len() > before
    }

    /// The leaves of a level that a stamp reaches, or whose border it reaches.
    pub(super) fn reached(&self, level: u8, touched: Region) -> Region {
        let width = i64::from(self.cells) << level;
        let before = |point: i32| (i64::from(point) - 1).div_euclid(width) as i32;
        Region::new(touched.min.map(before), touched.max.map(|v| before(v).saturating_add(1)))
    }

    fn is_stamped(&self, leaf: LeafKey) -> bool {
        let stamped = self.stamped.read().unwrap_or_else(PoisonError::into_inner);
        let reaches = |touched: &Region| self.reached(leaf.level, *touched).contains(leaf.position);
        stamped.leaves.contains(&leaf) || stamped.large.iter().any(reaches)
    }

    /// Whether the source is certain that a leaf has no surface. A source that panics is certain of nothing.
    fn is_ruled_out(&self, leaf: LeafKey) -> bool {
        let lock = || self.bounds.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = lock().get(&leaf) {
            return *known;
        }
        let source = LevelSource {
            source: self.source.as_ref(),
            cells: self.cells,
            spacing: self.spacing,
            stamps: &[],
            known: None,
            planes: self.planes,
            isovalue: 0.0,
        };
        let is_empty = catch_unwind(AssertUnwindSafe(|| source.is_empty(leaf))).unwrap_or(false);
        let mut bounds = lock();
        if bounds.len() >= MOST_BOUNDS {
            bounds.clear();
        }
        bounds.insert(leaf, is_empty);
        is_empty
    }
}
