//! [`stream`]: slab by slab from the volume through the mesher to the output.

use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use marchless::{MeshBuffer, MeshSettings, SlabMesher};

use crate::Stop;
use crate::error::Error;
use crate::input::Volume;
use crate::output::Output;
use crate::sample::{Sample, SampleType};
use crate::transform::Transform;

/// What came of it.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Totals {
    pub(crate) vertices: u64,
    pub(crate) triangles: u64,
    /// How long [`READING`], [`MESHING`] and [`WRITING`] took.
    pub(crate) times: [Duration; 3],
}

const READING: usize = 0;
const MESHING: usize = 1;
const WRITING: usize = 2;

/// Meshes the whole volume and puts the output in its place.
///
/// # Errors
/// [`Error`] where the volume cannot be read to its end, the mesh cannot be named by 32-bit indices or written, or the
/// user has enough of it.
pub(crate) fn stream(
    volume: &mut Volume,
    iso: f64,
    transform: &Transform,
    output: Output,
    stop: &Stop,
) -> Result<Totals, Error> {
    let run = match volume.sample_type {
        SampleType::I8 => stream_as::<i8>,
        SampleType::U8 => stream_as::<u8>,
        SampleType::I16 => stream_as::<i16>,
        SampleType::U16 => stream_as::<u16>,
        SampleType::I32 => stream_as::<i32>,
        SampleType::F32 => stream_as::<f32>,
        SampleType::F64 => stream_as::<f64>,
    };
    run(volume, iso, transform, output, stop)
}

fn stream_as<S: Sample>(
    volume: &mut Volume,
    iso: f64,
    transform: &Transform,
    output: Output,
    stop: &Stop,
) -> Result<Totals, Error> {
    let slab = volume.slab();
    let (mut bytes, mut weights) = buffers::<S>(slab, volume.sample_type)?;
    let settings = MeshSettings { isovalue: S::isovalue(iso), ..MeshSettings::default() };
    let mut mesher = SlabMesher::new(slab, settings).map_err(|source| volume.error(source))?;
    let mut mesh = MeshBuffer::new();
    let mut sink = Sink { transform, output, stop, totals: Totals::default(), since: Instant::now() };

    let progress = progress_bar(volume.slabs());
    for _ in 0..volume.slabs() {
        volume.read(&mut bytes)?;
        weights.clear();
        S::decode(&bytes, iso, &mut weights);
        sink.spent(READING);
        mesher.push(&weights, &mut mesh).map_err(|source| volume.error(source))?;
        sink.take(&mut mesh)?;
        progress.inc(1);
    }
    mesher.finish(&mut mesh).map_err(|source| volume.error(source))?;
    sink.take(&mut mesh)?;
    let totals = sink.finish()?;
    progress.finish_and_clear();
    Ok(totals)
}

/// Where pieces of the mesh go, and what is counted on the way.
struct Sink<'a> {
    transform: &'a Transform,
    output: Output,
    stop: &'a Stop,
    totals: Totals,
    /// Up to when time has been accounted for.
    since: Instant,
}

impl Sink<'_> {
    /// Takes a piece out of `mesh`.
    fn take(&mut self, mesh: &mut MeshBuffer) -> Result<(), Error> {
        self.transform.apply(mesh);
        self.spent(MESHING);
        self.totals.vertices += mesh.positions.len() as u64;
        self.totals.triangles += mesh.triangle_count() as u64;
        self.output.append(mesh)?;
        mesh.clear();
        self.spent(WRITING);
        self.stop.check()
    }

    fn finish(self) -> Result<Totals, Error> {
        let Self { output, stop, mut totals, since, .. } = self;
        output.finish(stop)?;
        totals.times[WRITING] += since.elapsed();
        Ok(totals)
    }

    /// Counts the time that has passed since the last call as `part`.
    fn spent(&mut self, part: usize) {
        let now = Instant::now();
        self.totals.times[part] += now - self.since;
        self.since = now;
    }
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
