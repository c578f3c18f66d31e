//! [`stream`]: slab by slab from the volume through the mesher to where the mesh goes.

use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use marchless::{MeshBuffer, MeshSettings, SlabMesher, Topology};

use crate::Stop;
use crate::args::Args;
use crate::error::Error;
use crate::input::Volume;
use crate::sample::{Sample, SampleType};
use crate::sink::{Made, Sink};

/// How long each part of it took.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Times {
    pub(crate) reading: Duration,
    pub(crate) meshing: Duration,
    /// Checking the mesh, too.
    pub(crate) writing: Duration,
}

/// Meshes the whole volume into `sink`.
///
/// # Errors
/// [`Error`] where the volume cannot be read to its end, the mesh cannot be named by 32-bit indices or written, or the
/// user has enough of it.
pub(crate) fn stream(
    volume: &mut Volume,
    args: &Args,
    sink: Box<dyn Sink>,
    stop: &Stop,
) -> Result<(Made, Times), Error> {
    let run = match volume.sample_type {
        SampleType::I8 => stream_as::<i8>,
        SampleType::U8 => stream_as::<u8>,
        SampleType::I16 => stream_as::<i16>,
        SampleType::U16 => stream_as::<u16>,
        SampleType::I32 => stream_as::<i32>,
        SampleType::F32 => stream_as::<f32>,
        SampleType::F64 => stream_as::<f64>,
    };
    run(volume, args, sink, stop)
}

fn stream_as<S: Sample>(
    volume: &mut Volume,
    args: &Args,
    mut sink: Box<dyn Sink>,
    stop: &Stop,
) -> Result<(Made, Times), Error> {
    let slab = volume.slab();
    let (mut bytes, mut weights) = buffers::<S>(slab, volume.sample_type)?;
    let topology = if args.exact { Topology::Trilinear } else { Topology::Separated };
    let settings = MeshSettings { isovalue: S::isovalue(args.iso), topology, ..MeshSettings::default() };
    let mut mesher = SlabMesher::new(slab, settings).map_err(|source| volume.error(source))?;
    let mut mesh = MeshBuffer::new();
    let (mut times, mut since) = (Times::default(), Instant::now());

    let progress = progress_bar(volume.slabs());
    for slab in 0..volume.slabs() {
        volume.read(&mut bytes)?;
        weights.clear();
        S::decode(&bytes, args.iso, &mut weights);
        spend(&mut since, &mut times.reading);
        mesher.push(&weights, &mut mesh).map_err(|source| volume.error(source))?;
        spend(&mut since, &mut times.meshing);
        // The mesher waits for the next slab before it makes anything of one.
        if let Some(made) = slab.checked_sub(1) {
            sink.take(made, &mut mesh, stop)?;
        }
        spend(&mut since, &mut times.writing);
        progress.inc(1);
    }
    mesher.finish(&mut mesh).map_err(|source| volume.error(source))?;
    spend(&mut since, &mut times.meshing);
    sink.take(volume.slabs() - 1, &mut mesh, stop)?;
    let made = sink.finish(stop)?;
    spend(&mut since, &mut times.writing);
    progress.finish_and_clear();
    Ok((made, times))
}

/// Counts the time that has passed since the last call as `part`.
fn spend(since: &mut Instant, part: &mut Duration) {
    let now = Instant::now();
    *part += now - *since;
    *since = now;
}

/// Room for a slab as bytes and as weights.
fn buffers<S: Sample>([a, b]: [u32; 2], sample_type: SampleType) -> Result<(Vec<u8>, Vec<S::Weight>), Error> {
    let too_large = || Error::Memory { slab: [a, b] };
    let samples = (a as usize).checked_mul(b as usize).ok_or_else(too_large)?;
    let length = samples.checked_mul(sample_type.bytes()).ok_or_else(too_large)?;
    let (mut bytes, mut weights) = (Vec::new(), Vec::new());
    bytes.try_reserve_exact(length).map_err(|_| too_large())?;
    weights.try_reserve_exact(samples).map_err(|_| too_large())?;
    bytes.resize(length, 0);
    Ok((bytes, weights))
}

/// Shown while standard error is a terminal.
fn progress_bar(slabs: u32) -> ProgressBar {
    let style = ProgressStyle::with_template("{bar:40} {percent:>3} %, {eta} to go");
    ProgressBar::new(u64::from(slabs)).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}
