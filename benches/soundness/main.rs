//! The soundness of the meshes of marchless and of its peers.
//!
//! All meshers mesh the same 304 small fields of 19 kinds, including ties, NaN and all magnitudes ([`fields`]), as
//! their documentation says ([`peers`]). [`MeshReport`](marchless::MeshReport) judges the meshes.
//!
//! `cargo bench -p marchless_benches --bench soundness` prints the tables after about two minutes, and lists our meshes
//! that are not clean, if any. With `MARCHLESS_RECORD=1` in the environment, the tables are also written to
//! `record/soundness.md`. `cargo test` runs it on a few small fields, and fails if a mesh of ours is not clean.
//!
//! `--write DIR` after `--` only writes the fields to `DIR/fields`, one file each: samples as little-endian `f32`, x
//! fastest. `--judge DIR` also judges the meshes in `DIR/meshes`, with a folder for each extractor and a file for each
//! field ([`Mesh::read`]). `benches/peers/soundness.py` does both for extractors from Python packages.

mod fields;
mod mesh;
mod peers;
mod record;
mod tally;

use std::{
    env, fs, io, panic,
    path::{Path, PathBuf},
    process::ExitCode,
};

use fields::Field;
use mesh::Mesh;
use peers::Peer;
use tally::{Flaws, Tally};

/// Fields of each kind.
const PER_KIND: usize = 16;
/// The most samples per axis.
const LARGEST: usize = 33;

fn main() -> ExitCode {
    run().unwrap_or_else(|error| {
        eprintln!("soundness: {error}");
        ExitCode::FAILURE
    })
}

fn run() -> io::Result<ExitCode> {
    // Criterion's own rule: without `--bench`, the caller is `cargo test`.
    if !env::args().any(|argument| argument == "--bench") {
        let (_, unclean) = judge_all(&fields::all(1, 16), None)?;
        tell(&unclean);
        return Ok(if unclean.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE });
    }
    let fields = fields::all(PER_KIND, LARGEST);
    if let Some(folder) = path_after("--write") {
        write(&fields, &folder.join("fields"))?;
        return Ok(ExitCode::SUCCESS);
    }
    let (tallies, unclean) = judge_all(&fields, path_after("--judge").as_deref())?;
    record::report(&fields, &tallies)?;
    tell(&unclean);
    Ok(ExitCode::SUCCESS)
}

/// The argument that follows `flag`.
fn path_after(flag: &str) -> Option<PathBuf> {
    env::args_os().skip_while(|argument| argument != flag).nth(1).map(PathBuf::from)
}

fn write(fields: &[Field], folder: &Path) -> io::Result<()> {
    fs::create_dir_all(folder)?;
    for field in fields {
        let bytes: Vec<u8> = field.samples.iter().flat_map(|sample| sample.to_le_bytes()).collect();
        fs::write(folder.join(field.file_name() + ".f32"), bytes)?;
    }
    Ok(())
}

/// The tallies of all meshers, and the defects of our meshes. `folder` has the meshes of other extractors.
fn judge_all(fields: &[Field], folder: Option<&Path>) -> io::Result<(Vec<Tally>, Vec<String>)> {
    let (mut tallies, mut unclean) = (Vec::new(), Vec::new());
    let hook = panic::take_hook();
    panic::set_hook(Box::new(|_| ())); // peers' panics are counted, and nothing else
    for (index, peer) in Peer::ALL.into_iter().enumerate() {
        let mut tally = Tally::new(peer.name);
        for field in fields {
            match tally.judge(field, peer.mesh(field).as_ref()) {
                Err(Flaws::Harmless(flaws)) if index < Peer::FLAWLESS => unclean.push(told(peer, field, &flaws)),
                Err(Flaws::Serious(flaws)) if index < Peer::OURS => unclean.push(told(peer, field, &flaws)),
                _ => (),
            }
        }
        tallies.push(tally);
    }
    panic::set_hook(hook);
    for extractor in folder.map_or_else(|| Ok(Vec::new()), |folder| folders(&folder.join("meshes")))? {
        let mut tally = Tally::new(extractor.file_name().unwrap_or_default().to_string_lossy());
        for field in fields {
            // What is wrong with it is in the tally.
            let _ = tally.judge(field, Mesh::read(&extractor.join(field.file_name() + ".mesh"))?.as_ref());
        }
        tallies.push(tally);
    }
    Ok((tallies, unclean))
}

fn told(peer: Peer, field: &Field, flaws: &str) -> String {
    format!("{}, {}: {flaws}", peer.name, field.file_name())
}

/// The folders in a folder, by name.
fn folders(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let mut folders = fs::read_dir(folder)?.map(|entry| Ok(entry?.path())).collect::<io::Result<Vec<_>>>()?;
    folders.sort();
    Ok(folders)
}

/// Prints the defects of our meshes.
fn tell(unclean: &[String]) {
    for mesh in unclean {
        eprintln!("not clean: {mesh}");
    }
}
