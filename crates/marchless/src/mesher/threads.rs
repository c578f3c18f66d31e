//! [`ThreadedMesher`]: one large volume on several threads.

use alloc::vec::Vec;
use core::{
    mem::MaybeUninit,
    num::NonZero,
    sync::atomic::{AtomicUsize, Ordering},
};
use std::{
    panic::resume_unwind,
    sync::{Mutex, PoisonError},
    thread,
};

use super::{
    MeshError, MeshSettings,
    output::{keep, room},
    slabs::{Lattice, Part, Slabs},
};
use crate::{
    buffer::MeshBuffer,
    lattice::Samples,
    sample::Weight,
    simd::{Backend, dispatch},
};

/// Parts of a volume for each thread: enough that the threads finish at about the same time where the surface lies in a few slabs.
const PARTS: usize = 8;

/// Meshes one large volume on several threads; keeps its scratch memory between volumes.
///
/// The mesh is that of [`Mesher::mesh`](super::Mesher::mesh), byte for byte, on any number of threads; the same promises hold. The
/// threads make parts of the mesh in memory of their own, which takes as much again as the mesh. For many small volumes, such as
/// chunks, give each thread a `Mesher` of its own instead.
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
    parts: Vec<Mutex<MeshBuffer>>,
    slabs: Vec<Slabs>,
}

impl ThreadedMesher {
    /// A mesher that has allocated nothing yet and will use `threads` threads, the caller's among them.
    pub fn new(threads: NonZero<usize>) -> Self {
        Self { threads, backend: Backend::fastest(), parts: Vec::new(), slabs: Vec::new() }
    }

    /// Meshes `samples` into `out`, whose former content is dropped. No surface is no error: `out` is then empty.
    ///
    /// # Errors
    /// As [`Mesher::mesh`](super::Mesher::mesh); `out` is then empty.
    pub fn mesh<W: Weight>(
        &mut self,
        samples: Samples<'_, W>,
        settings: &MeshSettings,
        out: &mut MeshBuffer,
    ) -> Result<(), MeshError> {
        out.clear();
        settings.check()?;
        let lattice = Lattice::of(&samples)?;
        let cells = lattice.size[2] - 1;
        let threads = self.threads.get().min(cells);
        let parts = (PARTS * threads).min(cells);
        self.parts.resize_with(parts, Mutex::default);
        self.slabs.resize_with(threads, Slabs::new);

        let (backend, buffers, next) = (self.backend, &self.parts, AtomicUsize::new(0));
        let work = |slabs: &mut Slabs| {
            loop {
                let part = next.fetch_add(1, Ordering::Relaxed);
                let Some(buffer) = buffers.get(part) else { return Ok(()) };
                let out = &mut *buffer.lock().unwrap_or_else(PoisonError::into_inner);
                out.clear();
                let cells = cells * part / parts..cells * (part + 1) / parts;
                dispatch(backend, Part { samples, lattice, cells, settings, slabs, out })?;
            }
        };
        let work = &work;
        on_threads(self.slabs.iter_mut().map(|slabs| move || work(slabs)))?;
        let parts = self.parts.iter_mut().map(|part| &*part.get_mut().unwrap_or_else(PoisonError::into_inner));
        concatenate(&parts.collect::<Vec<_>>(), threads, out)
    }
}

/// Runs all of `jobs` at once, the first of them on this thread, and returns the first error.
fn on_threads<J: FnOnce() -> Result<(), MeshError> + Send>(jobs: impl Iterator<Item = J>) -> Result<(), MeshError> {
    let mut jobs = jobs;
    let Some(own) = jobs.next() else { return Ok(()) };
    thread::scope(|scope| {
        let others: Vec<_> = jobs.map(|job| scope.spawn(job)).collect();
        let mut result = own();
        for other in others {
            let other = other.join().unwrap_or_else(|panic| resume_unwind(panic));
            result = result.and(other);
        }
        result
    })
}

/// A part of the mesh and the places in the whole that it goes to.
struct Piece<'a> {
    part: &'a MeshBuffer,
    /// Vertices of the parts before.
    base: u32,
    positions: &'a mut [MaybeUninit<[f32; 3]>],
    normals: &'a mut [MaybeUninit<[f32; 3]>],
    materials: &'a mut [MaybeUninit<u8>],
    indices: &'a mut [MaybeUninit<u32>],
}

/// Writes `parts` to `out`, which is empty, one behind the other.
///
/// Indices that count the vertices of a part run on into the next part's at its end: those come right behind.
fn concatenate(parts: &[&MeshBuffer], threads: usize, out: &mut MeshBuffer) -> Result<(), MeshError> {
    let sum = |len: fn(&MeshBuffer) -> usize| parts.iter().map(|part| len(part)).sum::<usize>();
    let lens = [sum(|part| part.positions.len()), sum(|part| part.normals.len()), sum(|part| part.materials.len())];
    let indices_len = sum(|part| part.indices.len());
    if u32::try_from(lens[0]).is_err() {
        return Err(MeshError::TooManyVertices { found: lens[0] as u64 });
    }
    let (mut positions, mut normals) = (room(&mut out.positions, lens[0]), room(&mut out.normals, lens[1]));
    let (mut materials, mut indices) = (room(&mut out.materials, lens[2]), room(&mut out.indices, indices_len));
    let mut base = 0;
    let mut pieces = Vec::new();
    for &part in parts {
        pieces.push(Piece {
            part,
            base,
            positions: take(&mut positions, part.positions.len()),
            normals: take(&mut normals, part.normals.len()),
            materials: take(&mut materials, part.materials.len()),
            indices: take(&mut indices, part.indices.len()),
        });
        base += part.positions.len() as u32;
        out.bounds = match (out.bounds, part.bounds) {
            (Some([min, max]), Some([low, high])) => Some([
                core::array::from_fn(|axis| min[axis].min(low[axis])),
                core::array::from_fn(|axis| max[axis].max(high[axis])),
            ]),
            (bounds, None) | (None, bounds) => bounds,
        };
    }
    let pieces = Mutex::new(pieces.into_iter());
    let next = || pieces.lock().unwrap_or_else(PoisonError::into_inner).next();
    let work = || {
        while let Some(piece) = next() {
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
    // SAFETY: the pieces fill the room without a gap, and all of them have been written.
    #[expect(unsafe_code, reason = "spares filling the vectors with zeros first")]
    unsafe {
        keep(&mut out.positions, lens[0]);
        keep(&mut out.normals, lens[1]);
        keep(&mut out.materials, lens[2]);
        keep(&mut out.indices, indices_len);
    }
    Ok(())
}

/// Splits the first `len` items off `items`.
fn take<'a, T>(items: &mut &'a mut [T], len: usize) -> &'a mut [T] {
    let (taken, rest) = core::mem::take(items).split_at_mut(len);
    *items = rest;
    taken
}
