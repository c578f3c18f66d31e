//! Height maps: real elevation, or a painted picture, from 16-bit greyscale PNG files.

use core::fmt;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Cursor, Seek};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use bevy_math::{DVec2, UVec3};
use bevy_reflect::Reflect;
use bevy_reflect::std_traits::ReflectDefault;
use marchless::{Bound, Source, SourceRegion};
use png::{BitDepth, ColorType, DecodingError};
use thiserror::Error;

use super::height_field::{self, HeightField};
use super::strata::Stratum;
use super::{SourceError, check, check_length, check_position};

/// How a picture's pixels become ground. One metre is one world unit.
#[derive(Clone, Debug, PartialEq, Reflect)]
#[reflect(Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct HeightMapSettings {
    /// Metres per pixel along x (a row of the picture) and z (a column). Limit: > 0. Default: 1, 1.
    pub metres_per_pixel: DVec2,
    /// Metres of height per unit of the samples. Limit: > 0. Default: 1.
    pub metres_per_unit: f64,
    /// The factor that heights are multiplied with, on top of `metres_per_unit`. Limit: > 0. Default: 1.
    pub exaggeration: f64,
    /// The height of the lowest sample above the terrain's lowest corner, which leaves ground to dig into.
    /// Units: world. Default: `None`, which is eight voxels of the default size.
    pub floor: Option<f64>,
    /// The rules for the ground's materials. Default: none, so all ground has material 0.
    pub strata: Vec<Stratum>,
}

impl Default for HeightMapSettings {
    fn default() -> Self {
        Self { metres_per_pixel: DVec2::ONE, metres_per_unit: 1.0, exaggeration: 1.0, floor: None, strata: Vec::new() }
    }
}

impl HeightMapSettings {
    /// Checks the settings alone. With a picture, the ground may still exceed the limits of a map.
    ///
    /// # Errors
    /// [`SourceError::Setting`] for the first number that is out of its range.
    pub fn validate(&self) -> Result<(), SourceError> {
        check_length("metres per pixel along x", self.metres_per_pixel.x)?;
        check_length("metres per pixel along z", self.metres_per_pixel.y)?;
        check_length("metres per unit", self.metres_per_unit)?;
        check_length("exaggeration", self.exaggeration)?;
        check_position("the floor", self.floor.unwrap_or(0.0))?;
        Ok(())
    }
}

/// Ground whose heights are samples in a grid, with bicubic (Catmull–Rom) interpolation between them.
///
/// The picture's left edge lies at x = 0, its top edge at z = 0. Each sample lies in the middle of its pixel. Beyond
/// the picture, the heights of its border continue. So north is −z if it is the top of the picture.
#[derive(Clone, PartialEq, Reflect)]
#[reflect(opaque)]
pub struct HeightMap {
    size: [u32; 2],
    samples: Arc<[u16]>,
    settings: HeightMapSettings,
    /// The lowest sample.
    lowest: u16,
    /// The highest sample.
    highest: u16,
    /// The height of the lowest sample. [Units: world]
    floor: f64,
}

impl HeightMap {
    /// The length of a map's longer side in voxels of the default size.
    const DEFAULT_VOXELS: f64 = 512.0;

    /// Reads a 16-bit greyscale PNG file.
    ///
    /// # Errors
    /// [`HeightMapError`] for a file that cannot be read, is not such a picture or is cut short, and for settings that
    /// are out of range.
    pub fn from_path(path: impl AsRef<Path>, settings: HeightMapSettings) -> Result<Self, HeightMapError> {
        let path = path.as_ref();
        let file = File::open(path).map_err(|error| HeightMapError::Open { path: path.to_owned(), error })?;
        Self::from_reader(BufReader::new(file), settings)
    }

    /// Reads a 16-bit greyscale PNG picture from memory.
    ///
    /// # Errors
    /// As [`from_path`](Self::from_path).
    pub fn from_bytes(bytes: &[u8], settings: HeightMapSettings) -> Result<Self, HeightMapError> {
        Self::from_reader(Cursor::new(bytes), settings)
    }

    /// Reads a 16-bit greyscale PNG picture.
    ///
    /// # Errors
    /// As [`from_path`](Self::from_path).
    pub fn from_reader(reader: impl BufRead + Seek, settings: HeightMapSettings) -> Result<Self, HeightMapError> {
        let (size, samples) = decode(reader)?;
        Self::from_samples(size, samples, settings)
    }

    /// A map from samples in units of [`HeightMapSettings::metres_per_unit`].
    ///
    /// `size`: samples along x and z. `samples`: `[nx·nz]`, x fastest.
    ///
    /// # Errors
    /// [`HeightMapError`] for a size of zero, for a number of samples that does not match it, and for settings that are
    /// out of range.
    pub fn from_samples(
        size: [u32; 2],
        samples: Vec<u16>,
        settings: HeightMapSettings,
    ) -> Result<Self, HeightMapError> {
        let expected = u64::from(size[0]) * u64::from(size[1]);
        if samples.len() as u64 != expected {
            return Err(HeightMapError::SampleCount { size, expected, found: samples.len() });
        }
        let (Some(&lowest), Some(&highest)) = (samples.iter().min(), samples.iter().max()) else {
            return Err(HeightMapError::Empty { size });
        };
        let floor = 0.0;
        Self { size, samples: samples.into(), settings: HeightMapSettings::default(), lowest, highest, floor }
            .with_settings(settings)
            .map_err(HeightMapError::from)
    }

    /// The map with other settings. Samples are shared, not copied.
    ///
    /// # Errors
    /// [`SourceError`] for settings that are out of range.
    pub fn with_settings(self, settings: HeightMapSettings) -> Result<Self, SourceError> {
        settings.validate()?;
        let mut map = Self { settings, floor: 0.0, ..self };
        check_length("the map's longer side", map.size_in_world().max_element())?;
        check_position("the highest point above the lowest one", map.max_height())?;
        map.floor = check_position("the floor", map.settings.floor.unwrap_or(8.0 * map.default_voxel_size()))?;
        Ok(map)
    }

    /// The settings that turn samples into ground.
    pub fn settings(&self) -> &HeightMapSettings {
        &self.settings
    }

    /// The number of samples along x and z.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// The map's size along x and z. Units: world.
    pub fn size_in_world(&self) -> DVec2 {
        DVec2::new(f64::from(self.size[0]), f64::from(self.size[1])) * self.settings.metres_per_pixel
    }

    /// The height of the lowest sample: the floor. Units: world.
    pub fn min_height(&self) -> f64 {
        self.floor
    }

    /// The height of the highest sample; the ground between samples may be slightly higher. Units: world.
    pub fn max_height(&self) -> f64 {
        self.world_height(f64::from(self.highest))
    }

    /// The height of the ground at a position. Units: world.
    pub fn height(&self, x: f64, z: f64) -> f64 {
        let [x, z] = self.in_pixels(x, z);
        let [(x, x_weights), (z, z_weights)] = [x, z].map(catmull_rom);
        let along_x = |row: i64| -> f64 { (x..).zip(x_weights).map(|(x, weight)| weight * self.sample(x, row)).sum() };
        self.world_height((z..).zip(z_weights).map(|(row, weight)| weight * along_x(row)).sum())
    }

    /// The voxel size that makes the map's longer side 512 voxels. Units: world.
    pub fn default_voxel_size(&self) -> f64 {
        self.size_in_world().max_element() / Self::DEFAULT_VOXELS
    }

    /// The number of chunks per axis that hold the whole map, with eight voxels of air above its highest sample.
    ///
    /// `voxel_size`: in world units. `chunk_cells`: voxels per axis of a chunk.
    ///
    /// # Errors
    /// [`SourceError::Setting`] for a voxel size that is not positive, or for chunks without voxels.
    pub fn extent_in_chunks(&self, voxel_size: f64, chunk_cells: u32) -> Result<UVec3, SourceError> {
        check_length("the voxel size", voxel_size)?;
        check("the number of voxels along a chunk", "at least 1", f64::from(chunk_cells), |v| v >= 1.0)?;
        let size = self.size_in_world();
        let chunks = |length: f64| (length / voxel_size / f64::from(chunk_cells)).ceil().max(1.0) as u32;
        Ok(UVec3::new(chunks(size.x), chunks(self.max_height() + 8.0 * voxel_size), chunks(size.y)))
    }

    /// Converts a world position to pixels; samples lie at whole numbers.
    fn in_pixels(&self, x: f64, z: f64) -> [f64; 2] {
        let [x, z] = [x / self.settings.metres_per_pixel.x - 0.5, z / self.settings.metres_per_pixel.y - 0.5];
        // Farther beyond the border, interpolation sees only copies of the border's sample.
        [x.clamp(-2.0, f64::from(self.size[0]) + 1.0), z.clamp(-2.0, f64::from(self.size[1]) + 1.0)]
    }

    /// The sample of a pixel; beyond the border, the nearest one.
    fn sample(&self, x: i64, z: i64) -> f64 {
        let [x, z] = [(x, self.size[0]), (z, self.size[1])].map(|(v, size)| v.clamp(0, i64::from(size) - 1) as usize);
        f64::from(self.samples[x + self.size[0] as usize * z])
    }

    fn world_height(&self, sample: f64) -> f64 {
        let scale = self.settings.metres_per_unit * self.settings.exaggeration;
        (sample - f64::from(self.lowest)) * scale + self.floor
    }
}

impl fmt::Debug for HeightMap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("HeightMap").field("size", &self.size).field("settings", &self.settings).finish_non_exhaustive()
    }
}

/// The first of the four samples around a position in pixels along one axis, and the weights of all four.
fn catmull_rom(position: f64) -> (i64, [f64; 4]) {
    let whole = position.floor();
    let t = position - whole;
    let s = 1.0 - t;
    let weights = [-0.5 * t * s * s, 1.0 + t * t * (1.5 * t - 2.5), 1.0 + s * s * (1.5 * s - 2.5), -0.5 * s * t * t];
    (whole as i64 - 1, weights)
}

/// The greatest overshoot of bicubic interpolation, as a share of the range of the samples.
///
/// It is the greatest sum of negative weights. Along one axis that is 1/8, half-way between samples, where the positive
/// weights add up to 9/8. Two axes give 2 · 1/8 · 9/8.
const OVERSHOOT: f64 = 9.0 / 32.0;

impl HeightField for HeightMap {
    fn height(&self, x: f64, z: f64) -> f64 {
        self.height(x, z)
    }

    fn range(&self, x: [f64; 2], z: [f64; 2]) -> [f64; 2] {
        let [x, z] = {
            let [low, high] = [0, 1].map(|end| self.in_pixels(x[end], z[end]));
            // All samples with a weight, and one more on each side for rounding.
            let clamped = |v: i64, size: u32| v.clamp(0, i64::from(size) - 1) as usize;
            [0, 1].map(|axis| {
                clamped(low[axis].floor() as i64 - 2, self.size[axis])
                    ..=clamped(high[axis].floor() as i64 + 3, self.size[axis])
            })
        };
        let rows = z.map(|z| &self.samples[self.size[0] as usize * z..][x.clone()]);
        let (min, max) = rows.flatten().fold((u16::MAX, 0), |(min, max), &sample| (sample.min(min), sample.max(max)));
        let over = OVERSHOOT * f64::from(max.saturating_sub(min));
        [self.world_height(f64::from(min) - over), self.world_height(f64::from(max) + over)]
    }
}

impl Source for HeightMap {
    fn fill(&self, region: &SourceRegion, distances: &mut [f32], materials: &mut [u8]) {
        height_field::fill(self, &self.settings.strata, region, distances, materials);
    }

    fn bound(&self, region: &SourceRegion) -> Bound {
        height_field::bound(self, &self.settings.strata, region)
    }
}

/// An error in the file or the samples of a [`HeightMap`].
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum HeightMapError {
    /// The file could not be opened.
    #[error("the height map {} cannot be opened: {error}", path.display())]
    Open {
        /// The file's path.
        path: PathBuf,
        /// The system's error.
        error: io::Error,
    },
    /// The bytes are not a PNG picture, or a damaged one.
    #[error("a height map must be a PNG picture, but this is not one: {0}")]
    NotPng(DecodingError),
    /// The picture is not 16-bit greyscale.
    #[error("a height map must be 16-bit grey, but this picture is {bits}-bit {color}")]
    NotGrey16 {
        /// Bits per channel.
        bits: u8,
        /// The picture's channels.
        color: &'static str,
    },
    /// The file ends before the picture does.
    #[error("the height map of {} × {} samples is cut short: its file ends before the picture does", size[0], size[1])]
    CutShort {
        /// The size in the file's header: samples along x and z.
        size: [u32; 2],
    },
    /// The picture could not be read to its end.
    #[error("the height map cannot be read: {0}")]
    Damaged(DecodingError),
    /// There are no samples.
    #[error("a height map needs at least one sample per side, but its size is {} × {}", size[0], size[1])]
    Empty {
        /// Samples along x and z.
        size: [u32; 2],
    },
    /// There are more than 2²⁸ samples.
    #[error("a height map of {} × {} samples is larger than {} samples", size[0], size[1], MOST_SAMPLES)]
    TooLarge {
        /// Samples along x and z.
        size: [u32; 2],
    },
    /// The number of samples does not match the size.
    #[error("a height map of {} × {} samples needs {expected} of them, but there are {found}", size[0], size[1])]
    SampleCount {
        /// Samples along x and z.
        size: [u32; 2],
        /// The number of samples that the size needs.
        expected: u64,
        /// The number of samples that were given.
        found: usize,
    },
    /// A setting is out of range.
    #[error(transparent)]
    Setting(#[from] SourceError),
}

/// The most samples of a map: 16,384 × 16,384, or half a gigabyte.
const MOST_SAMPLES: usize = 1 << 28;

/// Reads the size and samples of a 16-bit greyscale PNG picture.
fn decode(reader: impl BufRead + Seek) -> Result<([u32; 2], Vec<u16>), HeightMapError> {
    let mut reader = png::Decoder::new(reader).read_info().map_err(HeightMapError::NotPng)?;
    let info = reader.info();
    let size = [info.width, info.height];
    if (info.color_type, info.bit_depth) != (ColorType::Grayscale, BitDepth::Sixteen) {
        let color = match info.color_type {
            ColorType::Grayscale => "grey",
            ColorType::Rgb => "RGB",
            ColorType::Indexed => "indexed colour",
            ColorType::GrayscaleAlpha => "grey with alpha",
            ColorType::Rgba => "RGB with alpha",
        };
        return Err(HeightMapError::NotGrey16 { bits: info.bit_depth as u8, color });
    }
    let count = u64::from(size[0]) * u64::from(size[1]);
    if count > MOST_SAMPLES as u64 {
        return Err(HeightMapError::TooLarge { size });
    }
    let mut bytes = vec![0; 2 * count as usize];
    reader.next_frame(&mut bytes).map_err(|error| match error {
        DecodingError::IoError(error) if error.kind() == io::ErrorKind::UnexpectedEof => {
            HeightMapError::CutShort { size }
        }
        error => HeightMapError::Damaged(error),
    })?;
    Ok((size, bytes.as_chunks().0.iter().map(|pair| u16::from_be_bytes(*pair)).collect()))
}
