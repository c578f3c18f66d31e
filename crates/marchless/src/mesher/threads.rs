//! [`ThreadedMesher`]: meshes one large volume on several threads.

use alloc::vec::Vec;
use core::{mem::MaybeUninit, num::NonZero};
use std::{
    panic::resume_unwind,
    sync::{Mutex, PoisonError},
    thread,
};

use super::{
    error::{MeshError, checked_layout},
    job::{Input, MeshJob},
    output::{commit, reserve, union},
    pipeline::SlabPipeline,
    settings::MeshSettings,
};
use crate::{buffer::MeshBuffer, lattice::Samples, sample::Weight, simd::Backend};

/// The parts of a volume per thread. There are enough that all threads finish at about the same time even if the
/// surface lies in a few slabs.
const PARTS: usize = 8;

/// Meshes one large volume on several threads. It keeps its scratch memory from volume to volume.
///
/// The mesh is that of [`Mesher::mesh`](super::Mesher::mesh), byte for byte, on any number of threads, with the same
/// guarantees. The threads first make parts of the mesh in scratch memory, which takes as much memory as the mesh, and
/// then join them. For many small volumes, such as chunks, give each thread its own `Mesher` instead.
///
/// ```
/// use marchless::{MeshBuffer, MeshSettings, Samples, Shape, ThreadedMesher};
///
/// let shape = Shape::cube(64)?;
/// let weights: Vec<f32> = (0..shape.len()).map(|index| (index / 4096) as f32 - 31.5).collect();
/// let mut mesh = MeshBuffer::new();
/// let mut mesher = ThreadedMesher::new(std::thread::available_parallelism()?);
/// mesher.mesh(Samples::new(shape, &weights)?, &MeshSettings::default(), &mut mesh)?;
/// assert_eq!(mesh.triangle_count(), 2 * 63 * 63);
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct ThreadedMesher {
    threads: NonZero<usize>,
    backend: Backend,
    parts: Vec<MeshBuffer>,
    pipelines: Vec<SlabPipeline>,
}

impl ThreadedMesher {
    /// A mesher that uses `threads` threads, including the caller's. It allocates nothing until the first mesh.
    pub fn new(threads: NonZero<usize>) -> Self {
        Self { threads, backend: Backend::fastest(), parts: Vec::new(), pipelines: Vec::new() }
    }

    /// Meshes `samples` into `out` and drops its former content. Samples without a surface are no error: `out` is then
    /// empty.
    ///
    /// # Errors
    /// Those of [`Mesher::mesh`](super::Mesher::mesh). `out` is then empty.
    pub fn mesh<W: Weight>(
        &mut self,
        samples: Samples<'_, W>,
        settings: &MeshSettings,
        out: &mut MeshBuffer,
    ) -> Result<(), MeshError> {
        out.clear();
        settings.check()?;
        let layout = checked_layout(&samples)?;
        let cells = layout.size[2] - 1;
        let threads = self.threads.get().min(cells);
        let parts = threads.saturating_mul(PARTS).min(cells);
        self.parts.resize_with(parts, MeshBuffer::new);
        self.pipelines.resize_with(threads, SlabPipeline::new);

        let backend = self.backend;
        let start_of = |part: usize| (cells as u64 * part as u64 / parts as u64) as usize;
        let queue = Mutex::new(self.parts.iter_mut().enumerate());
        let work = |pipeline: &mut SlabPipeline| {
            while let Some((part, out)) = next(&queue) {
                out.clear();
                let input = Input::Volume { samples, cells: start_of(part)..start_of(part + 1) };
                MeshJob { input, layout, settings, pipeline, out }.run_on(backend)?;
            }
            Ok(())
        };
        let work = &work;
        on_threads(self.pipelines.iter_mut().map(|pipeline| move || work(pipeline)))?;
        concatenate(&self.parts, threads, out)
    }
}

/// Takes the next item from a queue that several threads share.
fn next<I: Iterator>(queue: &Mutex<I>) -> Option<I::Item> {
    queue.lock().unwrap_or_else(PoisonError::into_inner).next()
}

/// Runs all `jobs` at once, the first on this thread, and returns an error if any job fails.
///
/// If the system refuses to start a thread, fewer jobs run. So each job must be able to do the work of all.
fn on_threads<J: FnOnce() -> Result<(), MeshError> + Send>(mut jobs: impl Iterator<Item = J>) -> Result<(), MeshError> {
    let Some(own) = jobs.next() else { return Ok(()) };
    thread::scope(|scope| {
        let others = jobs.filter_map(|job| thread::Builder::new().spawn_scoped(scope, job).ok());
        let others: Vec<_> = others.collect();
        let mut result = own();
        for other in others {
            let other = other.join().unwrap_or_else(|panic| resume_unwind(panic));
            result = result.and(other);
        }
        result
    })
}

/// A part of the mesh, and the slices of the whole mesh that it is copied to.
struct Piece<'a> {
    part: &'a MeshBuffer,
    /// The number of vertices in all earlier parts.
    base: u32,
    positions: &'a mut [MaybeUninit<[f32; 3]>],
    normals: &'a mut [MaybeUninit<[f32; 3]>],
    materials: &'a mut [MaybeUninit<u8>],
    indices: &'a mut [MaybeUninit<u32>],
}

/// Appends `parts` to `out`, which is empty.
///
/// At the end of a part, indices go beyond the part's own vertices. They then name vertices of the next part, which
/// follow directly in the whole mesh.
fn concatenate(parts: &[MeshBuffer], threads: usize, out: &mut MeshBuffer) -> Result<(), MeshError> {
    let sum = |len: fn(&MeshBuffer) -> usize| parts.iter().map(len).sum::<usize>();
    let lens = [sum(|part| part.positions.len()), sum(|part| part.normals.len()), sum(|part| part.materials.len())];
    let indices_len = sum(|part| part.indices.len());
    if u32::try_from(lens[0]).is_err() {
        return Err(MeshError::TooManyVertices { found: lens[0] as u64 });
    }
    let (mut positions, mut normals) = (reserve(&mut out.positions, lens[0]), reserve(&mut out.normals, lens[1]));
    let (mut materials, mut indices) = (reserve(&mut out.materials, lens[2]), reserve(&mut out.indices, indices_len));
    let mut base = 0;
    let mut pieces = Vec::new();
    for part in parts {
        pieces.push(Piece {
            part,
            base,
            positions: take(&mut positions, part.positions.len()),
            normals: take(&mut normals, part.normals.len()),
            materials: take(&mut materials, part.materials.len()),
            indices: take(&mut indices, part.indices.len()),
        });
        base += part.positions.len() as u32;
        out.bounds = union(out.bounds, part.bounds);
    }
    let pieces = Mutex::new(pieces.into_iter());
    let work = || {
        while let Some(piece) = next(&pieces) {
            piece.positions.write_copy_of_slice(&piece.part.positions);
            piece.normals.write_copy_of_slice(&piece.part.normals);
            piece.materials.write_copy_of_slice(&piece.part.materials);
            for (to, &from) in piece.indices.iter_mut().zip(&piece.part.indices) {
                to.write(piece.base + from);
            }
        }
        Ok(())
    };
    on_threads((0..threads).map(|_| work))?;
    // SAFETY: the pieces fill the reserved memory without a gap, and all of them have been written.
    #[expect(unsafe_code, reason = "spares filling the vectors with zeros first")]
    unsafe {
        commit(&mut out.positions, lens[0]);
        commit(&mut out.normals, lens[1]);
        commit(&mut out.materials, lens[2]);
        commit(&mut out.indices, indices_len);
    }
    Ok(())
}

/// Splits the first `len` items off `items`.
fn take<'a, T>(items: &mut &'a mut [T], len: usize) -> &'a mut [T] {
    let (taken, rest) = core::mem::take(items).split_at_mut(len);
    *items = rest;
    taken
}
