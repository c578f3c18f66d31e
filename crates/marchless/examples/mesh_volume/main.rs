//! `mesh_volume`: the isosurface of a volume in a file, as a mesh in a file.
//!
//! ```text
//! mesh_volume head.npy --iso 300 -o head.ply
//! mesh_volume engine.raw --shape 256,256,128 --type u8 --iso 80 --spacing 1,1,1.6 -o engine.glb
//! ```
//!
//! What lies below the isovalue is inside. The volume may be larger than memory: it is read, meshed and written a slab
//! (the samples of one z) at a time.

mod args;
mod error;
mod input;
mod npy;
mod output;
mod sample;
mod stream;
mod transform;

use std::io::{self, Write as _};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use clap::Parser as _;

use args::Args;
use error::Error;
use input::Volume;
use output::Output;
use stream::{Totals, stream};
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
    args.check_files()?;
    let mut volume = Volume::open(args)?;
    let transform = Transform::new(args, &volume)?;
    let output = Output::create(&args.output)?;
    let totals = stream(&mut volume, args.iso, &transform, output, &Stop::on_signals())?;
    summarise(args, &volume, &totals);
    Ok(())
}

/// Whether the user wants no more of it: `Ctrl-C`, or the system's wish that programs end.
struct Stop(Arc<AtomicBool>);

impl Stop {
    fn on_signals() -> Self {
        let flag = Arc::new(AtomicBool::new(false));
        let raised = Arc::clone(&flag);
        // Where there are no such signals, nothing is lost but the tidying up.
        let _ = ctrlc::set_handler(move || raised.store(true, Ordering::Relaxed));
        Self(flag)
    }

    fn check(&self) -> Result<(), Error> {
        if self.0.load(Ordering::Relaxed) { Err(Error::Interrupted) } else { Ok(()) }
    }
}

fn summarise(args: &Args, volume: &Volume, totals: &Totals) {
    let [x, y, z] = volume.size;
    let [reading, meshing, writing] = totals.times.map(|time| time.as_secs_f64());
    // The mesh is whole already, whether or not anyone listens.
    let _ = writeln!(
        io::stdout(),
        "{}: {x} × {y} × {z} {}, {} vertices, {} triangles; read in {reading:.2} s, meshed in {meshing:.2} s, written in {writing:.2} s",
        args.output.display(),
        volume.sample_type,
        totals.vertices,
        totals.triangles,
    );
    if totals.triangles == 0 {
        let _ = writeln!(
            io::stderr(),
            "note: there is no surface, since no neighbouring samples lie on different sides of {:?}",
            args.iso
        );
    }
}
