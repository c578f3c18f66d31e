//! [`Landscape`]: a source composed of layers of noise, caves, shapes and rules for materials.

mod body;
mod columns;
mod field;
mod layer;
mod material;
mod parts;
mod solid;

use core::fmt;
use core::sync::atomic::{AtomicU64, Ordering};
use std::sync::Arc;

use bevy_reflect::Reflect;
use bevy_reflect::std_traits::ReflectDefault;
use marchless::{Bound, Source, SourceRegion};

pub use layer::Layer;
pub use material::{MaterialRule, Patches};
pub use solid::{Caves, Solid, Tunnels};

use self::body::{Body, ColumnWindow, QueryBox};
use self::field::FieldPoints;
use self::material::Rules;
use self::parts::{Line, PreparedBody, Row};
use super::detail::Detail;
use super::height_field::Column;
use super::interval::Interval;
use super::noise::default_strata;
use super::{BOUND_MARGIN, SourceError, rows, world_box};

/// The greatest depth to which layers and solids may be nested.
const MOST_NESTED: u32 = 32;

/// The settings of a [`Landscape`]: plain data, which files can store and editors can change.
#[derive(Clone, Debug, PartialEq, Reflect)]
#[reflect(Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct LandscapeSettings {
    /// The ground. Default: the hills of [`NoiseHeights`](super::NoiseHeights).
    pub solid: Solid,
    /// The rules for the ground's materials; shapes have materials of their own. Default: material 2 from 3.5 units of
    /// depth and where the ground is at least as steep as 1, material 1 from 1.5 units of depth, and 0 on top.
    pub materials: Vec<MaterialRule>,
}

impl Default for LandscapeSettings {
    fn default() -> Self {
        let materials = default_strata().into_iter().map(MaterialRule::from).collect();
        Self { solid: Solid::default(), materials }
    }
}

impl LandscapeSettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`SourceError`] for the first number that is out of its range, and for parts nested more than 32 deep.
    pub fn validate(&self) -> Result<(), SourceError> {
        self.solid.validate()?;
        self.materials.iter().try_for_each(MaterialRule::validate)
    }
}

/// A source composed of layers of noise, caves, tunnels, shapes and rules for materials.
///
/// Clones share the heights that were evaluated already.
#[derive(Clone, Reflect)]
#[reflect(opaque)]
pub struct Landscape {
    compiled: Arc<Compiled>,
}

struct Compiled {
    settings: LandscapeSettings,
    body: Body,
    rules: Rules,
    noise_calls: AtomicU64,
}

impl Landscape {
    /// A landscape with these settings.
    ///
    /// # Errors
    /// As [`LandscapeSettings::validate`].
    pub fn new(settings: LandscapeSettings) -> Result<Self, SourceError> {
        settings.validate()?;
        Ok(Self::of_valid(settings))
    }

    /// A landscape with settings that are known to be valid.
    pub(super) fn of_valid(settings: LandscapeSettings) -> Self {
        let body = Body::new(&settings.solid, &mut 0);
        let rules = Rules::new(&settings.materials);
        Self { compiled: Arc::new(Compiled { settings, body, rules, noise_calls: AtomicU64::new(0) }) }
    }

    /// The settings of the landscape.
    pub fn settings(&self) -> &LandscapeSettings {
        &self.compiled.settings
    }

    /// The number of noise evaluations so far, by this landscape and its clones: one per octave and point.
    #[doc(hidden)]
    pub fn noise_calls(&self) -> u64 {
        self.compiled.noise_calls.load(Ordering::Relaxed)
    }

    /// The height of the landscape's first ground at a position, in full detail; `None` for a landscape without ground.
    /// Units: world.
    pub fn height(&self, x: f64, z: f64) -> Option<f64> {
        let mut calls = 0;
        let grounds = self.compiled.body.grounds();
        let field = grounds.first()?.columns.field();
        let mut height = [0.0];
        field.values(Detail::FINEST, &FieldPoints::Grid { xs: &[x], zs: &[z] }, &mut height, &mut calls);
        self.count(calls);
        Some(height[0])
    }

    fn count(&self, calls: u64) {
        self.compiled.noise_calls.fetch_add(calls, Ordering::Relaxed);
    }

    /// Converts a region to world units, for evaluation and bounds.
    fn region<'a>(&self, region: &SourceRegion, columns: Option<ColumnWindow<'a>>) -> QueryBox<'a> {
        let sides = world_box(region).map(|[low, high]| Interval { low, high });
        let detail = Detail::of(region);
        let reach = detail.deepened(self.compiled.rules.deepest).max(BOUND_MARGIN * region.spacing);
        QueryBox {
            sides,
            spacing: region.spacing,
            detail,
            reach,
            margin: BOUND_MARGIN * region.spacing,
            strictly: false,
            columns,
        }
    }

    /// The columns of each ground in a region, by the ground's number. `with_slopes`: whether for materials, too.
    fn columns(&self, region: &SourceRegion, with_slopes: bool, calls: &mut u64) -> Vec<Vec<Column>> {
        let grounds = self.compiled.body.grounds().into_iter();
        grounds.map(|ground| ground.columns.of(region, with_slopes, calls)).collect()
    }

    /// The bound of a region. `noisily`: whether to evaluate noise for it.
    fn certain(&self, region: &QueryBox, noisily: bool, calls: &mut u64) -> Bound {
        let known = self.compiled.body.known(region, noisily, calls);
        if known.with_margin.low >= 0.0 && known.distance.low >= 0.0 {
            return Bound::Outside;
        }
        let material = if known.with_margin.high < 0.0 && known.distance.high < 0.0 {
            let depth = [-known.distance.high, -known.distance.low];
            known.matter.and_then(|matter| match u8::try_from(matter) {
                Ok(material) => Some(material),
                Err(_) => {
                    let heights = [region.sides[1].low, region.sides[1].high];
                    self.compiled.rules.material_within(region.detail, depth, heights)
                }
            })
        } else {
            None
        };
        material.map_or(Bound::Mixed, |material| Bound::Inside { material })
    }
}

impl fmt::Debug for Landscape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Landscape").field("settings", self.settings()).finish_non_exhaustive()
    }
}

impl Default for Landscape {
    fn default() -> Self {
        Self::of_valid(LandscapeSettings::default())
    }
}

impl Source for Landscape {
    fn fill(&self, samples: &SourceRegion, distances: &mut [f32], materials: &mut [u8]) {
        if samples.is_empty() {
            return;
        }
        let mut calls = 0;
        let columns = self.columns(samples, self.compiled.rules.by_slope, &mut calls);
        let width = samples.size[0] as usize;
        let part = [0..width, 0..samples.size[2] as usize];
        let region = self.region(samples, Some(ColumnWindow { columns: &columns, width, part }));
        let mut body = PreparedBody::new(&self.compiled.body, samples, &region, &columns);
        let xs: Vec<f64> = (0..samples.size[0]).map(|x| samples.position([x, 0, 0])[0]).collect();
        let mut row = Row::new(width);
        let spacing = samples.spacing as f32;
        let mut rules = self.compiled.rules.for_rows(region.detail, &xs);
        for (index, distances, materials) in rows(samples, distances, materials) {
            let [_, y, z] = samples.position([0, index[0], index[1]]);
            let line =
                Line { index, xs: &xs, y, z, cut_margin: region.cut_margin() as f32, reach: region.reach as f32 };
            body.evaluate(&line, 0..width, &mut row, &mut calls);
            for (distance, sample) in distances.iter_mut().zip(&row.distance) {
                *distance = (sample / spacing).clamp(f32::MIN, f32::MAX);
            }
            rules.give(&line, &row, materials, &mut calls);
        }
        self.count(calls);
    }

    fn bound(&self, region: &SourceRegion) -> Bound {
        let region = self.region(region, None);
        let mut calls = 0;
        let bound = match self.certain(&region, false, &mut calls) {
            Bound::Mixed => self.certain(&region, true, &mut calls),
            bound => bound,
        };
        self.count(calls);
        bound
    }

    fn bound_closely(&self, samples: &SourceRegion) -> Bound {
        let margin = CLOSE * samples.spacing;
        let region = QueryBox { margin, strictly: true, ..self.region(samples, None) };
        let most = samples.size[0].max(samples.size[2]);
        let mut calls = 0;
        let mut bound = self.certain(&region, false, &mut calls);
        if bound == Bound::Mixed && !samples.is_empty() && most <= MOST_COLUMNS {
            let columns = self.columns(samples, false, &mut calls);
            let part = [0..samples.size[0] as usize, 0..samples.size[2] as usize];
            let columns = Some(ColumnWindow { columns: &columns, width: samples.size[0] as usize, part });
            bound = self.certain(&QueryBox { columns, ..region }, true, &mut calls);
        }
        self.count(calls);
        bound
    }
}

/// The margin of close bounds: isovalues may differ from 0 by this much. [Units: voxels]
const CLOSE: f64 = 3.0;

/// The widest region that is bounded column by column. [Units: columns along an axis]
const MOST_COLUMNS: u32 = 512;
