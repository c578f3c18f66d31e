//! [`MeshJob`]: meshing of a volume, of a part of one or of one slab, by type of weight and backend.

use core::ops::Range;

use super::{
    error::MeshError,
    pipeline::{SlabPipeline, SlabRole},
    primal::VertexPass,
    settings::MeshSettings,
};
use crate::{
    buffer::MeshBuffer,
    lattice::Samples,
    sample::{
        Weight,
        private::{PerWeight, Sealed},
    },
    signs::{SlabLayout, Window, uniform_prefix},
    simd::{Backend, Job, Simd, dispatch},
};

/// Slabs to be meshed.
pub(super) struct MeshJob<'a, W> {
    pub(super) input: Input<'a, W>,
    pub(super) layout: SlabLayout,
    pub(super) settings: &'a MeshSettings,
    pub(super) pipeline: &'a mut SlabPipeline,
    pub(super) out: &'a mut MeshBuffer,
}

/// Where the slabs of a job come from.
pub(super) enum Input<'a, W> {
    /// A whole volume, or the part of it with these cells along z; the range is not empty.
    Volume { samples: Samples<'a, W>, cells: Range<usize> },
    /// One slab of a stream, and whether another one follows.
    Stream { window: Window<'a, W>, has_next: bool },
}

impl<W: Weight> MeshJob<'_, W> {
    /// Meshes the slabs with `backend`.
    pub(super) fn run_on(self, backend: Backend) -> Result<(), MeshError> {
        W::call::<RunOn>((backend, self))
    }
}

/// [`MeshJob::run_on`], by type of weight.
struct RunOn;

impl PerWeight for RunOn {
    type Arguments<'a, W: Sealed> = (Backend, MeshJob<'a, W>);
    type Output = Result<(), MeshError>;

    fn of_i8((backend, job): (Backend, MeshJob<'_, i8>)) -> Self::Output {
        dispatch(backend, job)
    }

    fn of_i16((backend, job): (Backend, MeshJob<'_, i16>)) -> Self::Output {
        dispatch(backend, job)
    }

    fn of_f32((backend, job): (Backend, MeshJob<'_, f32>)) -> Self::Output {
        dispatch(backend, job)
    }
}

impl<W: Weight> Job for MeshJob<'_, W> {
    type Output = Result<(), MeshError>;

    #[inline(always)]
    fn run<S: Simd>(self) -> Self::Output {
        let Self { input, layout, settings, pipeline, out } = self;
        let (start, end) = match &input {
            Input::Stream { window, .. } => (window.z, window.z),
            Input::Volume { samples, cells } => {
                // Uniform slabs at the start have no surface: only the last of them is needed.
                let slabs = cells.start..cells.end + 1;
                let padding = usize::from(layout.padded);
                let given =
                    &samples.weights()[(slabs.start + padding) * layout.len..(slabs.end + padding) * layout.len];
                let uniform = uniform_prefix::<S, W>(given, W::threshold(settings.isovalue)) / layout.len;
                if uniform == slabs.len() {
                    return Ok(());
                }
                (cells.start + uniform.saturating_sub(1), cells.end)
            }
        };
        let mut vertices = VertexPass::new();
        for z in start..end + 1 {
            let (window, role, has_next) = match &input {
                Input::Stream { window, has_next } => {
                    (*window, if z == 0 { SlabRole::First } else { SlabRole::Inner }, *has_next)
                }
                Input::Volume { samples, .. } => {
                    let role = if z == start {
                        SlabRole::First
                    } else if z == end && end + 1 < layout.size[2] {
                        SlabRole::Shared
                    } else {
                        SlabRole::Inner
                    };
                    (Window::of(samples, &layout, z), role, z < end)
                }
            };
            let next = has_next.then_some(window.slabs[3]);
            pipeline.step::<S, W>(&layout, &window, role, next, settings, &mut vertices, out)?;
        }
        vertices.bounds.widen(out);
        Ok(())
    }
}
