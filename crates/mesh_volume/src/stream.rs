//! [`stream`]: slab by slab from the volume through the mesher to the sink.

use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use marchless::{
    DualSettings, MeshBuffer, MeshError, MeshSettings, Mesher, Samples, Shape, SlabMesher, Topology, Weight,
};

use crate::Stop;
use crate::args::Args;
use crate::close::Closed;
use crate::error::Error;
use crate::input::Volume;
use crate::sample::{Sample, SampleType};
use crate::sink::{Made, Sink};

/// The time that each part of the work took.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Times {
    pub(crate) reading: Duration,
    pub(crate) meshing: Duration,
    /// Includes checking the mesh.
    pub(crate) writing: Duration,
}

/// Meshes the whole volume into `sink`.
///
/// # Errors
/// [`Error`] if the volume cannot be read to its end, if the mesh has too many vertices for 32-bit indices or cannot be
/// written, or if the user has interrupted the program.
pub(crate) fn stream(
    volume: &mut Volume,
    args: &Args,
    sink: Box<dyn Sink>,
    stop: &Stop,
) -> Result<(Made, Times), Error> {
    let run = match volume.sample_type {
        SampleType::Bool => stream_as::<bool>,
        SampleType::I8 => stream_as::<i8>,
        SampleType::U8 => stream_as::<u8>,
        SampleType::I16 => stream_as::<i16>,
        SampleType::U16 => stream_as::<u16>,
        SampleType::I32 => stream_as::<i32>,
        SampleType::U32 => stream_as::<u32>,
        SampleType::I64 => stream_as::<i64>,
        SampleType::U64 => stream_as::<u64>,
        SampleType::F32 => stream_as::<f32>,
        SampleType::F64 => stream_as::<f64>,
    };
    run(volume, args, sink, stop)
}

fn stream_as<S: Sample>(
    volume: &mut Volume,
    args: &Args,
    sink: Box<dyn Sink>,
    stop: &Stop,
) -> Result<(Made, Times), Error> {
    let (slab, slabs) = (volume.slab(), volume.slabs());
    let isovalue = S::isovalue(args.iso);
    if !args.close {
        let mut meshing = Meshing::new(slab, slabs.into(), isovalue, args, sink, stop)?;
        for_each_slab::<S>(volume, args.iso, |_, weights| meshing.push(weights))?;
        return meshing.finish();
    }
    let mut closed = Closed::new(slab, isovalue, args.invert)?;
    let mut meshing = Meshing::new(closed.size(), u64::from(slabs) + 2, 0.0, args, sink, stop)?;
    for_each_slab::<S>(volume, args.iso, |z, weights| {
        if z == 0 {
            meshing.push(closed.beyond(weights))?;
        }
        meshing.push(closed.within(weights))?;
        if z == slabs - 1 {
            meshing.push(closed.beyond(weights))?;
        }
        Ok(())
    })?;
    meshing.finish()
}

/// Calls `take` with the number and the weights of each slab.
fn for_each_slab<S: Sample>(
    volume: &mut Volume,
    iso: f64,
    mut take: impl FnMut(u32, &[S::Weight]) -> Result<(), Error>,
) -> Result<(), Error> {
    let (mut bytes, mut weights) = buffers::<S>(volume.slab(), volume.sample_type)?;
    for slab in 0..volume.slabs() {
        volume.read(&mut bytes)?;
        weights.clear();
        S::decode(&bytes, iso, &mut weights);
        take(slab, &weights)?;
    }
    Ok(())
}

/// Either mesher.
enum VolumeMesher<W> {
    /// The primal mesher, slab by slab.
    Primal(Box<SlabMesher<W>>),
    /// The dual mesher, with the samples of all slabs so far: `slab` samples along x and y.
    Dual { settings: DualSettings, slab: [u32; 2], weights: Vec<W> },
}

/// A mesher with its progress from the first slab to the last.
struct Meshing<'a, W> {
    args: &'a Args,
    stop: &'a Stop,
    sink: Box<dyn Sink>,
    mesher: VolumeMesher<W>,
    mesh: MeshBuffer,
    /// The number of the next slab.
    next: u32,
    times: Times,
    since: Instant,
    progress: ProgressBar,
}

impl<'a, W: Weight> Meshing<'a, W> {
    fn new(
        slab: [u32; 2],
        slabs: u64,
        isovalue: f32,
        args: &'a Args,
        sink: Box<dyn Sink>,
        stop: &'a Stop,
    ) -> Result<Self, Error> {
        let mesher = match args.dual_settings(isovalue) {
            Some(settings) => {
                let samples = slab.iter().try_fold(slabs as usize, |all, samples| all.checked_mul(*samples as usize));
                let mut weights = Vec::new();
                let reserved = samples.map(|samples| weights.try_reserve_exact(samples));
                reserved.and_then(Result::ok).ok_or(Error::VolumeMemory)?;
                VolumeMesher::Dual { settings, slab, weights }
            }
            None => {
                let topology = if args.exact { Topology::Trilinear } else { Topology::Separated };
                let settings = MeshSettings { isovalue, topology, ..MeshSettings::default() };
                VolumeMesher::Primal(Box::new(SlabMesher::new(slab, settings).map_err(|source| error(args, source))?))
            }
        };
        let (mesh, progress) = (MeshBuffer::new(), progress_bar(slabs));
        let (times, since) = (Times::default(), Instant::now());
        Ok(Self { args, stop, sink, mesher, mesh, next: 0, times, since, progress })
    }

    /// Meshes one more slab.
    fn push(&mut self, weights: &[W]) -> Result<(), Error> {
        spend(&mut self.since, &mut self.times.reading);
        match &mut self.mesher {
            VolumeMesher::Dual { weights: all, .. } => {
                all.extend_from_slice(weights);
                self.stop.check()?;
            }
            VolumeMesher::Primal(mesher) => {
                mesher.push(weights, &mut self.mesh).map_err(|source| error(self.args, source))?;
                spend(&mut self.since, &mut self.times.meshing);
                // The mesher's output for a slab comes when the next slab is pushed.
                if let Some(made) = self.next.checked_sub(1) {
                    self.sink.take(made, &mut self.mesh, self.stop)?;
                }
            }
        }
        self.next += 1;
        spend(&mut self.since, &mut self.times.writing);
        self.progress.inc(1);
        Ok(())
    }

    /// Completes the mesh.
    fn finish(mut self) -> Result<(Made, Times), Error> {
        let finished = match self.mesher {
            VolumeMesher::Primal(mesher) => mesher.finish(&mut self.mesh),
            VolumeMesher::Dual { settings, slab: [x, y], weights } => {
                let shape = Shape::new([x, y, self.next]).map_err(|_| Error::VolumeMemory)?;
                let samples = Samples::new(shape, &weights).map_err(|_| Error::VolumeMemory)?;
                Mesher::new().mesh_dual(samples, &settings, &mut self.mesh)
            }
        };
        finished.map_err(|source| error(self.args, source))?;
        spend(&mut self.since, &mut self.times.meshing);
        self.sink.take(self.next - 1, &mut self.mesh, self.stop)?;
        let made = self.sink.finish(self.stop)?;
        spend(&mut self.since, &mut self.times.writing);
        self.progress.finish_and_clear();
        Ok((made, self.times))
    }
}

fn error(args: &Args, source: MeshError) -> Error {
    Error::Mesh { path: args.input.clone(), source }
}

/// Adds the time since the last call to `part`.
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

/// A progress bar, which shows if standard error is a terminal.
fn progress_bar(slabs: u64) -> ProgressBar {
    let style = ProgressStyle::with_template("{bar:40} {percent:>3} %, {eta} to go");
    ProgressBar::new(slabs).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}
