//! [`Sample`]: the conversion of a file's samples and the isovalue to weights. No sample changes sides.
//!
//! The mesher computes with integers of up to 16 bits and with `f32`. So samples of up to 16 bits stay exact. For all
//! others, the difference to the isovalue becomes an `f32`; only this difference is rounded, to 24 bits.

#[cfg(test)]
mod tests;

use std::fmt;

use clap::ValueEnum;
use marchless::Weight;

/// The type of the samples in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum SampleType {
    /// A byte: 0 is false and counts as 0, any other is true and counts as 1.
    Bool,
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl SampleType {
    pub(crate) const fn bytes(self) -> usize {
        match self {
            Self::Bool | Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }
}

impl fmt::Display for SampleType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Bool => "bool",
            Self::I8 => "i8",
            Self::U8 => "u8",
            Self::I16 => "i16",
            Self::U16 => "u16",
            Self::I32 => "i32",
            Self::U32 => "u32",
            Self::I64 => "i64",
            Self::U64 => "u64",
            Self::F32 => "f32",
            Self::F64 => "f64",
        })
    }
}

/// The byte order of samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Endian {
    Little,
    Big,
}

impl Endian {
    /// This machine's order.
    pub(crate) const NATIVE: Self = if cfg!(target_endian = "big") { Self::Big } else { Self::Little };
}

impl fmt::Display for Endian {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Little => "little",
            Self::Big => "big",
        })
    }
}

/// A type of sample, and its conversion to weights.
///
/// A weight lies below [`Sample::isovalue`] if and only if its sample lies below the isovalue in the file's own
/// numbers; NaN lies below nothing.
pub(crate) trait Sample {
    type Weight: Weight;

    /// The isovalue for the weights, in voxels; finite. `iso`: the one for the samples, finite.
    fn isovalue(iso: f64) -> f32;

    /// Appends the weights of little-endian samples.
    fn decode(bytes: &[u8], iso: f64, weights: &mut Vec<Self::Weight>);
}

macro_rules! integer_sample {
    ($type:ty, $weight:ty, $flip:literal) => {
        impl Sample for $type {
            type Weight = $weight;

            fn isovalue(iso: f64) -> f32 {
                integer_isovalue::<$weight>(iso, f64::from(<$type>::MIN), f64::from(<$type>::MAX))
            }

            fn decode(bytes: &[u8], _iso: f64, weights: &mut Vec<$weight>) {
                let (samples, _) = bytes.as_chunks();
                weights.extend(samples.iter().map(|&sample| (<$type>::from_le_bytes(sample) ^ $flip) as $weight));
            }
        }
    };
}

integer_sample!(i8, i8, 0);
integer_sample!(i16, i16, 0);
// Flipping the highest bit takes half of the range away, and so keeps the order.
integer_sample!(u8, i8, 0x80);
integer_sample!(u16, i16, 0x8000);

impl Sample for bool {
    type Weight = i8;

    fn isovalue(iso: f64) -> f32 {
        i8::isovalue(iso)
    }

    fn decode(bytes: &[u8], _iso: f64, weights: &mut Vec<i8>) {
        weights.extend(bytes.iter().map(|&byte| i8::from(byte != 0)));
    }
}

/// The isovalue of integer weights, in voxels. Samples go from `least`, which becomes the lowest weight, to `most`.
///
/// A whole number lies below an isovalue if and only if it lies below the next whole number above the isovalue. So
/// rounding to `f32` may move the isovalue, but not onto or across a whole number.
fn integer_isovalue<W: Weight>(iso: f64, least: f64, most: f64) -> f32 {
    // Clamping changes nothing: no sample lies below `least`, and all lie below `most + 1`.
    let iso = iso.clamp(least, most + 1.0);
    // 0 for signed samples, half of the range for unsigned ones.
    let shift = least + (most - least + 1.0) / 2.0;
    let ceiling = (iso.ceil() - shift) as f32;
    // One above zero must survive the division.
    let floor = if ceiling == 1.0 { 1e-30 } else { (ceiling - 1.0).next_up() };
    ((iso - shift) as f32).clamp(floor, ceiling) / W::SCALE
}

/// Samples that are meshed by their difference to the isovalue, which `$above` computes.
macro_rules! wide_sample {
    ($type:ty, $above:ident) => {
        impl Sample for $type {
            type Weight = f32;

            fn isovalue(_iso: f64) -> f32 {
                0.0
            }

            fn decode(bytes: &[u8], iso: f64, weights: &mut Vec<f32>) {
                let (samples, _) = bytes.as_chunks();
                weights.extend(samples.iter().map(|&sample| $above(<$type>::from_le_bytes(sample).into(), iso)));
            }
        }
    };
}

// An `i32` has more digits than an `f32`, but its difference to an isovalue near it has few.
wide_sample!(i32, above);
wide_sample!(u32, above);
wide_sample!(f32, above);
wide_sample!(f64, above);
// Beyond 2^53, an `f64` does not hold them all.
wide_sample!(i64, above_long);
wide_sample!(u64, above_long);

/// The sample minus the isovalue. Rounding keeps the sign: the result is negative if and only if the sample lies below.
#[inline(always)]
fn above(sample: f64, iso: f64) -> f32 {
    // Never zero for different numbers.
    rounded(sample - iso)
}

/// The difference of an integer of up to 64 bits and the isovalue, rounded to `f32`.
fn above_long(sample: i128, iso: f64) -> f32 {
    let whole = iso.floor();
    // No sample comes near the limits, within which differences are exact.
    let steps = sample - whole.clamp(-1e30, 1e30) as i128;
    rounded(steps as f64 - (iso - whole))
}

/// The difference as an `f32` of the same sign. A tiny one becomes zero, or if it is negative the smallest number below
/// zero.
#[inline(always)]
fn rounded(difference: f64) -> f32 {
    const LEAST: f32 = f32::from_bits(1);
    let rounded = difference as f32;
    if difference < 0.0 { rounded.min(-LEAST) } else { rounded }
}
