//! Landscapes and caves of fractal noise, over the `noise` crate's Perlin noise.

use ::noise::{NoiseFn, Perlin};
use bevy_reflect::Reflect;
use bevy_reflect::std_traits::ReflectDefault;
use marchless::{Bound, Source, SourceRegion};

use super::height_field::{self, Column, HeightField};
use super::strata::{Stratum, material_at};
use super::{Fractal, ROOM, SourceError, check, check_position, rows, world_box};

/// One octave of a [`Fractal`].
#[derive(Clone, Debug)]
struct Octave {
    perlin: Perlin,
    amplitude: f64,
    frequency: f64,
    offset: f64,
}

/// A [`Fractal`] ready to be evaluated.
#[derive(Clone, Debug)]
struct Octaves {
    octaves: Vec<Octave>,
    ridged: bool,
}

impl Octaves {
    /// Of settings that are valid.
    fn new(settings: &Fractal) -> Self {
        let amplitudes = |index: u32| settings.persistence.powi(index as i32);
        let sum: f64 = (0..settings.octaves).map(amplitudes).sum();
        let octave = |index: u32| Octave {
            perlin: Perlin::new(settings.seed.wrapping_add(index)),
            amplitude: amplitudes(index) / sum,
            frequency: settings.lacunarity.powi(index as i32) / settings.zoom,
            // Perlin noise is 0 at whole numbers; without offsets all octaves would meet there.
            offset: (f64::from(index) + 1.0) * 0.618_033_988_749_895,
        };
        Self { octaves: (0..settings.octaves).map(octave).collect(), ridged: settings.ridged }
    }

    /// From −1 to 1.
    fn get<const N: usize>(&self, position: [f64; N]) -> f64
    where
        Perlin: NoiseFn<f64, N>,
    {
        let mut sum = 0.0;
        for Octave { perlin, amplitude, frequency, offset } in &self.octaves {
            let value = perlin.get(position.map(|v| repeat(v * frequency + offset)));
            sum += amplitude * if self.ridged { 1.0 - 2.0 * value.abs() } else { value };
        }
        sum
    }

    /// How much the noise typically changes per world unit.
    fn typical_gradient(&self) -> f64 {
        self.octaves.iter().map(|octave| (octave.amplitude * octave.frequency).powi(2)).sum::<f64>().sqrt()
    }
}

/// The same point of Perlin noise, which repeats every 256, at a coordinate from 0 to 256: far away it would overflow.
fn repeat(coordinate: f64) -> f64 {
    let near = coordinate - 256.0 * (coordinate / 256.0).floor();
    if near.is_finite() { near } else { 0.0 }
}

/// What [`NoiseHeights`] are made of.
#[derive(Clone, Debug, PartialEq, Reflect)]
#[reflect(Default)]
pub struct NoiseHeightsSettings {
    /// The noise; its `zoom` is about the distance between hills.
    pub noise: Fractal,
    /// The height in the middle between the highest and the lowest possible. [Units: world, from the terrain's lowest
    /// corner] Default: 56.
    pub base: f64,
    /// How far heights reach above and below the base at most. Units: world. Limit: >= 0. Default: 52.
    pub amplitude: f64,
    /// The ground's materials. [Default: material 2 from 5 units of depth and where it is steeper than 1, material 1
    /// from 1.5 units of depth, and 0 on top]
    pub strata: Vec<Stratum>,
}

impl Default for NoiseHeightsSettings {
    fn default() -> Self {
        Self { noise: Fractal::default(), base: 56.0, amplitude: 52.0, strata: default_strata() }
    }
}

impl NoiseHeightsSettings {
    /// Says what is wrong with the settings, if anything is.
    ///
    /// # Errors
    /// [`SourceError::Setting`] for the first number that is out of its range.
    pub fn validate(&self) -> Result<(), SourceError> {
        self.noise.validate()?;
        check_position("the base height", self.base)?;
        check("the amplitude", "from 0 to 1e9", self.amplitude, |v| (0.0..=super::FARTHEST).contains(&v))?;
        Ok(())
    }
}

pub(crate) fn default_strata() -> Vec<Stratum> {
    vec![
        Stratum { material: 2, below_depth: 5.0, ..Stratum::default() },
        Stratum { material: 2, steeper_than: 1.0, ..Stratum::default() },
        Stratum { material: 1, below_depth: 1.5, ..Stratum::default() },
    ]
}

/// Hills: the height of the ground is fractal noise, evaluated once per column.
///
/// Chunks above the highest and below the lowest possible ground are skipped without sampling.
#[derive(Clone, Debug, Reflect)]
#[reflect(opaque)]
pub struct NoiseHeights {
    settings: NoiseHeightsSettings,
    octaves: Octaves,
}

impl NoiseHeights {
    /// Hills of these settings.
    ///
    /// # Errors
    /// [`SourceError::Setting`] for the first number that is out of its range.
    pub fn new(settings: NoiseHeightsSettings) -> Result<Self, SourceError> {
        settings.validate()?;
        Ok(Self::of_valid(settings))
    }

    fn of_valid(settings: NoiseHeightsSettings) -> Self {
        Self { octaves: Octaves::new(&settings.noise), settings }
    }

    /// Hills of the default settings, but of another seed.
    pub fn from_seed(seed: u32) -> Self {
        let noise = Fractal { seed, ..Fractal::default() };
        Self::of_valid(NoiseHeightsSettings { noise, ..NoiseHeightsSettings::default() })
    }

    /// What the hills are made of.
    pub fn settings(&self) -> &NoiseHeightsSettings {
        &self.settings
    }

    /// The height of the ground at a position. Units: world.
    pub fn height(&self, x: f64, z: f64) -> f64 {
        self.settings.base + self.settings.amplitude * self.octaves.get([x, z])
    }
}

impl Default for NoiseHeights {
    fn default() -> Self {
        Self::from_seed(0)
    }
}

impl HeightField for NoiseHeights {
    fn height(&self, x: f64, z: f64) -> f64 {
        self.height(x, z)
    }

    fn range(&self, _x: [f64; 2], _z: [f64; 2]) -> [f64; 2] {
        let NoiseHeightsSettings { base, amplitude, .. } = self.settings;
        [base - amplitude, base + amplitude]
    }
}

impl Source for NoiseHeights {
    fn fill(&self, region: &SourceRegion, distances: &mut [f32], materials: &mut [u8]) {
        height_field::fill(self, &self.settings.strata, region, distances, materials);
    }

    fn bound(&self, region: &SourceRegion) -> Bound {
        height_field::bound(self, &self.settings.strata, region)
    }
}

/// What a [`NoiseDensity`] is made of.
#[derive(Clone, Debug, PartialEq, Reflect)]
#[reflect(Default)]
pub struct NoiseDensitySettings {
    /// The noise; its `zoom` is about the distance between caves.
    pub noise: Fractal,
    /// There is ground where the noise is below this: at −1 none, at 0 in half of the space, at 1 in all of it.
    /// Default: 0.15.
    pub threshold: f64,
    /// Hills above which there is only air; their strata are not used. Default: none, ground in all directions.
    pub ground: Option<NoiseHeightsSettings>,
    /// The ground's materials. Depth is the estimated distance to the nearest surface, a cave's too.
    /// Default: as of [`NoiseHeightsSettings::strata`].
    pub strata: Vec<Stratum>,
}

impl Default for NoiseDensitySettings {
    fn default() -> Self {
        let noise = Fractal { octaves: 3, zoom: 40.0, ..Fractal::default() };
        Self { noise, threshold: 0.15, ground: None, strata: default_strata() }
    }
}

/// Caves and overhangs: there is ground where 3-D noise is below a threshold and, if wished, below the surface of hills.
///
/// The noise is evaluated once per sample, but not above the hills; distances are estimated from its gradient.
#[derive(Clone, Debug, Reflect)]
#[reflect(opaque)]
pub struct NoiseDensity {
    settings: NoiseDensitySettings,
    octaves: Octaves,
    ground: Option<NoiseHeights>,
}

impl NoiseDensity {
    /// Caves of these settings.
    ///
    /// # Errors
    /// [`SourceError::Setting`] for the first number that is out of its range.
    pub fn new(settings: NoiseDensitySettings) -> Result<Self, SourceError> {
        settings.noise.validate()?;
        check("the threshold", "from -1 to 1", settings.threshold, |v| (-1.0..=1.0).contains(&v))?;
        let ground = settings.ground.clone().map(NoiseHeights::new).transpose()?;
        Ok(Self { octaves: Octaves::new(&settings.noise), ground, settings })
    }

    /// What it is made of.
    pub fn settings(&self) -> &NoiseDensitySettings {
        &self.settings
    }

    /// The ground of each column, endless without hills.
    fn columns(&self, region: &SourceRegion) -> Vec<Column> {
        match &self.ground {
            Some(ground) => height_field::columns(ground, region),
            None => {
                let endless = Column { height: f64::INFINITY, slope: 0.0 };
                vec![endless; region.size[0] as usize * region.size[2] as usize]
            }
        }
    }
}

impl Default for NoiseDensity {
    fn default() -> Self {
        let settings = NoiseDensitySettings::default();
        Self { octaves: Octaves::new(&settings.noise), ground: None, settings }
    }
}

impl Source for NoiseDensity {
    fn fill(&self, region: &SourceRegion, distances: &mut [f32], materials: &mut [u8]) {
        let columns = self.columns(region);
        let mut noise = NoiseGrid::new(&self.octaves, region);
        let flattest = self.octaves.typical_gradient() / 4.0;
        for ([y, z], distances, materials) in rows(region, distances, materials) {
            let world_y = (f64::from(region.min[1]) + f64::from(y)) * region.spacing;
            let columns = &columns[region.size[0] as usize * z as usize..];
            for (x, ((column, distance), material)) in (0u32..).zip(columns.iter().zip(distances).zip(materials)) {
                let mut nearest = column.distance(world_y - column.height);
                let mut slope = column.slope;
                if nearest < ROOM * region.spacing {
                    let (value, gradient) = noise.sample([x, y, z]);
                    let [gx, gy, gz] = gradient;
                    let flat = gx * gx + gz * gz;
                    let cave = (value - self.settings.threshold) / (flat + gy * gy).sqrt().max(flattest);
                    if cave > nearest {
                        nearest = cave;
                        // Where the noise falls upwards, air is below: this is a ceiling.
                        slope = if gy > 0.0 { flat.sqrt() / gy } else { f64::INFINITY };
                    }
                }
                *distance = (nearest / region.spacing) as f32;
                if nearest < 0.0 {
                    *material = material_at(&self.settings.strata, -nearest, world_y, slope);
                }
            }
        }
    }

    fn bound(&self, region: &SourceRegion) -> Bound {
        let [_, [bottom, _], _] = world_box(region);
        let outside = self.ground.as_ref().is_some_and(|ground| {
            let [_, highest] = ground.range([0.0; 2], [0.0; 2]);
            bottom > highest + ROOM * region.spacing
        });
        if outside { Bound::Outside } else { Bound::Mixed }
    }
}

/// Noise at a region's samples and the layer around them, each evaluated when it is first asked for, and once.
struct NoiseGrid<'a> {
    octaves: &'a Octaves,
    region: &'a SourceRegion,
    strides: [usize; 3],
    /// NaN where not evaluated yet.
    values: Vec<f64>,
}

impl<'a> NoiseGrid<'a> {
    fn new(octaves: &'a Octaves, region: &'a SourceRegion) -> Self {
        let [nx, ny, nz] = region.size.map(|points| points as usize + 2);
        Self { octaves, region, strides: [1, nx, nx * ny], values: vec![f64::NAN; nx * ny * nz] }
    }

    /// The noise at one of the region's samples, and its gradient per world unit by central differences.
    fn sample(&mut self, local: [u32; 3]) -> (f64, [f64; 3]) {
        let value = self.value(local, [0; 3]);
        let gradient = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map(|step: [i32; 3]| {
            let change = self.value(local, step) - self.value(local, step.map(|v| -v));
            change / (2.0 * self.region.spacing)
        });
        (value, gradient)
    }

    fn value(&mut self, local: [u32; 3], step: [i32; 3]) -> f64 {
        let at = |axis: usize| (i64::from(local[axis]) + i64::from(step[axis]) + 1) as usize;
        let index: usize = (0..3).map(|axis| at(axis) * self.strides[axis]).sum();
        if self.values[index].is_nan() {
            let SourceRegion { min, spacing, .. } = self.region;
            let position = [0, 1, 2].map(|axis| (f64::from(min[axis]) + at(axis) as f64 - 1.0) * spacing);
            self.values[index] = self.octaves.get(position);
        }
        self.values[index]
    }
}
