//! `mesh_volume`: the isosurface of a volume in a file, as a mesh in a file, or in one per chunk.
//!
//! ```text
//! mesh_volume head.npy --iso 300 -o head.ply
//! mesh_volume engine.raw --shape 256,256,128 --type u8 --iso 80 --spacing 1,1,1.6 -o engine.glb
//! mesh_volume caves.npy --chunk 64 --check -o caves.ply
//! mesh_volume mask.npy --iso 0.5 --invert --close -o part.stl
//! mesh_volume mask.npy --iso 0.5 --invert --close --dual --smooth 4 -o smooth.stl
//! mesh_volume scan.raw --shape 512,512,300 --type i16 --endian big --skip 1024 --origin -20,0,35.5 -o scan.ply
//! ```
//!
//! Samples below the isovalue are inside. In a volume of `bool`, false is 0 and true is 1: `--iso 0.5` lies between
//! them, and with `--invert` the mesh encloses the true samples. Samples of up to 16 bits are exact. For larger ones,
//! the difference to the isovalue is rounded to an `f32` (24 bits), but never across zero. So the surface always lies
//! between the right samples.
//!
//! The surface is open where it leaves the volume; `--close` closes it, half a sample beyond the outermost samples.
//! `--origin` is the position of the first sample. Positions are `f32`: far from 0, they are rounded.
//!
//! With `--dual`, vertices lie in cells instead of on edges. `--smooth` moves each towards the mean of its neighbours,
//! within its cell: it takes away the steps of a mask. `--sharp` keeps the creases of a field of distances, and `--crease`
//! breaks the normals there.
//!
//! The volume may be larger than memory: it is read, meshed and written a slab (the samples of one z) at a time. Only
//! `--dual` holds all of it. With
//! `--chunk`, the meshes of one layer of chunks are held until the layer is complete. With `--check` alone, the whole
//! mesh is held, but never the volume. So the check judges the mesh by itself, as any reader would find it, not against
//! its samples.

mod args;
mod close;
mod error;
mod input;
mod npy;
mod output;
mod recent;
mod sample;
mod sink;
mod split;
mod stream;
mod transform;

use std::fmt;
use std::io::{self, Write as _};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use clap::Parser as _;

use args::Args;
use error::Error;
use input::Volume;
use sample::SampleType;
use sink::{ChunkedSink, Made, Sink, WholeSink};
use split::Chunks;
use stream::{Times, stream};
use transform::Transform;

fn main() -> ExitCode {
    match run(&Args::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}

fn run(args: &Args) -> Result<(), Error> {
    args.check_usage()?;
    let mut volume = Volume::open(args)?;
    let transform = Transform::new(args, &volume)?;
    let chunks = args.chunk.map(|size| Chunks::new(size, args.margin(), &volume)).transpose()?;
    let stop = Stop::on_signals();
    let sink: Box<dyn Sink> = match chunks {
        Some(chunks) => Box::new(ChunkedSink::new(args, chunks, transform)?),
        None => Box::new(WholeSink::new(args, &volume, transform)?),
    };
    let (made, times) = stream(&mut volume, args, sink, &stop)?;
    if let Some(check) = &made.check {
        say(check);
        if !check.is_clean() {
            return Err(Error::NotClean);
        }
    }
    stop.check()?;
    let summary = summary(args, &volume, chunks.as_ref(), &made, times);
    let (is_empty, foreign) = (made.triangles == 0, made.foreign.clone());
    made.put()?;
    say(&summary);
    if let Some((first, count)) = foreign {
        let more = if count > 1 { format!(" and {} more", count - 1) } else { String::new() };
        note(format_args!("no chunk of this mesh, and so left as it was: {}{more}", first.display()));
    }
    if is_empty {
        let hint = match volume.sample_type {
            SampleType::Bool => " (false is 0 and true is 1: --iso 0.5 lies between them)",
            _ => "",
        };
        note(format_args!(
            "there is no surface, since no neighbouring samples lie on different sides of {:?}{hint}",
            args.iso
        ));
    }
    Ok(())
}

/// The flag that a request to stop raises: `Ctrl-C`, or the system's signal to terminate.
struct Stop(Arc<AtomicBool>);

impl Stop {
    fn on_signals() -> Self {
        let flag = Arc::new(AtomicBool::new(false));
        let raised = Arc::clone(&flag);
        // Without such signals, only the tidying up after an interruption is missing.
        let _ = ctrlc::set_handler(move || raised.store(true, Ordering::Relaxed));
        Self(flag)
    }

    fn check(&self) -> Result<(), Error> {
        if self.0.load(Ordering::Relaxed) { Err(Error::Interrupted) } else { Ok(()) }
    }
}

/// A line that sums up the input, the mesh and the times.
fn summary(args: &Args, volume: &Volume, chunks: Option<&Chunks>, made: &Made, times: Times) -> String {
    let [x, y, z] = volume.size;
    let chunks = chunks.map_or_else(String::new, |chunks| {
        format!(" in {} chunks, {} of them with a surface", chunks.count, made.files.len())
    });
    let check = made.check.as_ref().map(|check| check.time);
    let writing = times.writing.saturating_sub(check.unwrap_or_default());
    let [reading, meshing, writing] = [times.reading, times.meshing, writing].map(|time| time.as_secs_f64());
    let checked = check.map_or_else(String::new, |time| format!(", checked in {:.2} s", time.as_secs_f64()));
    format!(
        "{}: {x} × {y} × {z} {}{chunks}, {} vertices, {} triangles; read in {reading:.2} s, meshed in {meshing:.2} s, written in {writing:.2} s{checked}\n",
        args.output.display(),
        volume.sample_type,
        made.vertices,
        made.triangles,
    )
}

/// Prints to standard output. Errors are ignored, since the mesh is complete already.
fn say(text: impl fmt::Display) {
    let _ = write!(io::stdout(), "{text}");
}

/// Prints a note for the user to standard error.
fn note(text: impl fmt::Display) {
    let _ = writeln!(io::stderr(), "note: {text}");
}
