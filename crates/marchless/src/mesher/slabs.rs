//! The order of things: what becomes of one slab of samples after the other, and of a whole volume.

use core::ops::Range;

use super::{
    MeshError, MeshSettings, Topology,
    classify::{self, Signs},
    exact::Exact,
    triangles::{self, Codes, FirstVertices},
    vertices::{Planes, Vertices},
};
use crate::{
    buffer::MeshBuffer,
    lattice::{Samples, Shape},
    sample::{
        Weight,
        private::{PerWeight, Sealed},
    },
    simd::{Backend, Job, Simd, dispatch},
};

/// How the samples of a slab lie in memory, and how their signs are packed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lattice {
    /// Meshed samples per axis.
    pub(super) size: [usize; 3],
    /// Whether there is a layer of padding around them.
    pub(super) padded: bool,
    /// The samples of a slab, padding included.
    pub(super) len: usize,
    /// The index of the slab's first meshed sample.
    pub(super) origin: usize,
    /// How far apart in memory neighbours along y are.
    pub(super) stride: usize,
    /// Sign words a row.
    pub(super) words: usize,
    /// The bits of a row's last word that are samples.
    pub(super) last_word: u64,
}

impl Lattice {
    pub(super) fn of<W>(samples: &Samples<'_, W>) -> Result<Self, MeshError> {
        let (shape, padding) = (samples.shape(), u32::from(samples.is_padded()));
        let least = 2 + 2 * padding;
        if shape.size().iter().any(|&size| size < least) {
            return Err(MeshError::TooSmall { shape, least });
        }
        let depth = (shape.size()[2] - 2 * padding) as usize;
        let [_, stride, len] = shape.strides();
        let size = [0, 1].map(|axis| (shape.size()[axis] - 2 * padding) as usize);
        Ok(Self::new([size[0], size[1], depth], padding as usize, stride, len))
    }

    /// The lattice of slabs of `size` samples without padding, of which nobody knows how many there are; `None` where
    /// they have no cells or do not fit in memory.
    pub(super) fn of_slabs(size: [u32; 2]) -> Option<Self> {
        let shape = Shape::new([size[0], size[1], 1]).ok()?;
        let [_, stride, len] = shape.strides();
        (size[0] >= 2 && size[1] >= 2)
            .then(|| Self::new([size[0] as usize, size[1] as usize, usize::MAX], 0, stride, len))
    }

    fn new(size: [usize; 3], padding: usize, stride: usize, len: usize) -> Self {
        Self {
            size,
            padded: padding == 1,
            len,
            origin: padding * (1 + stride),
            stride,
            words: size[0].div_ceil(64),
            last_word: u64::MAX >> (size[0].next_multiple_of(64) - size[0]),
        }
    }

    /// The index in its slab of the meshed sample at `x`, `y`.
    #[inline(always)]
    pub(super) const fn index(&self, x: u32, y: u32) -> usize {
        self.origin + y as usize * self.stride + x as usize
    }

    /// The `x` and `y` of a meshed sample's [index](Lattice::index).
    pub(super) const fn position_of(&self, index: usize) -> (u32, u32) {
        let from_origin = index - self.origin;
        ((from_origin % self.stride) as u32, (from_origin / self.stride) as u32)
    }

    /// How far apart in memory the ends of an edge along `AXIS` are in their slabs.
    #[inline(always)]
    pub(super) const fn step<const AXIS: usize>(&self) -> usize {
        match AXIS {
            0 => 1,
            1 => self.stride,
            _ => 0,
        }
    }

    /// The row, and the position along x of the first sample, of a slab's word `word`.
    #[inline(always)]
    pub(super) const fn place_of(&self, word: usize) -> (u32, u32) {
        if self.words == 1 {
            return (word as u32, 0);
        }
        ((word / self.words) as u32, 64 * (word % self.words) as u32)
    }
}

/// A slab of samples with those around it: whole slabs, padding included. Beyond an open border the outermost slab
/// stands in for those that are missing.
#[derive(Clone, Copy)]
pub(super) struct Window<'a, W> {
    /// The slabs two below, one below, the slab itself, and the one above.
    pub(super) slabs: [&'a [W]; 4],
    /// The materials of the slab below and of the slab itself, where there are any.
    pub(super) materials: Option<[&'a [u8]; 2]>,
    /// The slab's lattice position along z.
    pub(super) z: usize,
    /// Whether the gradient along z is one-sided on the slab below, and on the slab itself.
    pub(super) one_sided: [bool; 2],
}

/// What is remembered from slab to slab.
#[derive(Clone, Debug)]
pub(super) struct Slabs {
    /// The signs of the slab before, of the slab itself, and of the next one: that is read early, in one go, so that
    /// the gradients, which need a sample of it here and there, find it in the cache.
    signs: [Signs; 3],
    /// The cells between the slab before and the slab itself.
    codes: Codes,
    /// Those of them that their signs leave open.
    exact: Exact,
    /// The first vertices of the slab before on edges along x and y.
    first: [u64; 2],
    /// All vertices so far.
    pub(super) vertices: u64,
}

impl Slabs {
    pub(super) const fn new() -> Self {
        Self {
            signs: [Signs::new(), Signs::new(), Signs::new()],
            codes: Codes::new(),
            exact: Exact::new(),
            first: [0; 2],
            vertices: 0,
        }
    }

    /// Takes in the next slab: makes the vertices on edges from the slab before and on those within the slab, and the
    /// triangles in between. Of the first slab (of a volume or a part of it) there is no slab before; of the last one
    /// of a part, the vertices within belong to the next part and are not made. `next`: the slab that will come next,
    /// if any.
    #[inline(always)]
    pub(super) fn step<S: Simd, W: Weight>(
        &mut self,
        lattice: &Lattice,
        window: &Window<'_, W>,
        place: Place,
        next: Option<&[W]>,
        settings: &MeshSettings,
        pass: &mut Vertices<W>,
        out: &mut MeshBuffer,
    ) -> Result<(), MeshError> {
        if place == Place::First {
            self.vertices = 0;
        }
        let [_, low, slab, above] = window.slabs;
        let threshold = W::threshold(settings.isovalue);
        self.signs.rotate_left(1);
        let [before, newest, following] = &mut self.signs;
        if place == Place::First {
            newest.fill::<S, W>(lattice, slab, threshold);
        }
        if let Some(next) = next {
            following.fill::<S, W>(lattice, next, threshold);
        }
        let joined = place != Place::First && (before.uniform().is_none() || before.uniform() != newest.uniform());
        let mut first =
            FirstVertices { x: [self.first[0] as u32, 0], y: [self.first[1] as u32, 0], z: self.vertices as u32 };
        if joined {
            before.spell_out(lattice);
            newest.spell_out(lattice);
            let planes = Planes {
                slabs: window.slabs,
                one_sided: window.one_sided,
                materials: window.materials,
                z: window.z.wrapping_sub(1),
            };
            self.vertices += pass.place::<S, 2>(lattice, &planes, settings, before.signs(), newest.signs(), out);
            self.exact.clear();
            let is_exact = settings.topology == Topology::Trilinear;
            self.codes.fill::<S>(lattice, before, newest, is_exact.then(|| self.exact.open_cells()));
            if is_exact {
                let (codes, bounds) = (self.codes.get_mut(), &mut pass.bounds);
                self.vertices +=
                    self.exact.decide::<S, W>(lattice, &planes, settings, codes, self.vertices, bounds, out);
            }
        }
        self.first = [self.vertices; 2];
        if newest.uniform().is_none() {
            let planes = Planes {
                slabs: [low, slab, slab, above],
                one_sided: [window.one_sided[1]; 2],
                materials: window.materials.map(|[_, materials]| [materials; 2]),
                z: window.z,
            };
            let (signs, neighbours) = (newest.signs(), newest.next());
            if place == Place::Beyond {
                self.first[1] += triangles::crossings(signs, neighbours);
            } else {
                self.vertices += pass.place::<S, 0>(lattice, &planes, settings, signs, neighbours, out);
                self.first[1] = self.vertices;
                let below_last_row = &signs[..signs.len() - lattice.words];
                self.vertices +=
                    pass.place::<S, 1>(lattice, &planes, settings, below_last_row, &signs[lattice.words..], out);
            }
        }
        if self.vertices > u64::from(u32::MAX) {
            return Err(MeshError::TooManyVertices { found: self.vertices });
        }
        if joined {
            (first.x[1], first.y[1]) = (self.first[0] as u32, self.first[1] as u32);
            triangles::join::<S>(lattice, before, newest, &first, &mut self.codes, &self.exact, &mut out.indices);
        }
        Ok(())
    }
}

/// Where a slab stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Place {
    /// First of a volume, or of a part of one.
    First,
    /// After another one.
    Next,
    /// Behind the last of a part: the next part's first.
    Beyond,
}

/// Slabs to be meshed.
pub(super) struct Meshing<'a, W> {
    pub(super) input: Input<'a, W>,
    pub(super) lattice: Lattice,
    pub(super) settings: &'a MeshSettings,
    pub(super) slabs: &'a mut Slabs,
    pub(super) out: &'a mut MeshBuffer,
}

/// Where slabs come from.
pub(super) enum Input<'a, W> {
    /// All of a volume, or the part of it that has these cells along z; they are not empty.
    Volume { samples: Samples<'a, W>, cells: Range<usize> },
    /// One slab of many that come one by one, and whether another one will come.
    Stream { window: Window<'a, W>, has_next: bool },
}

impl<W: Weight> Meshing<'_, W> {
    /// Meshes them with `backend`.
    pub(super) fn on(self, backend: Backend) -> Result<(), MeshError> {
        W::call::<OnBackend>((backend, self))
    }
}

/// [`Meshing::on`], by type of weights.
struct OnBackend;

impl PerWeight for OnBackend {
    type Arguments<'a, W: Sealed> = (Backend, Meshing<'a, W>);
    type Output = Result<(), MeshError>;

    fn of_i8((backend, meshing): (Backend, Meshing<'_, i8>)) -> Self::Output {
        dispatch(backend, meshing)
    }

    fn of_i16((backend, meshing): (Backend, Meshing<'_, i16>)) -> Self::Output {
        dispatch(backend, meshing)
    }

    fn of_f32((backend, meshing): (Backend, Meshing<'_, f32>)) -> Self::Output {
        dispatch(backend, meshing)
    }
}

impl<W: Weight> Job for Meshing<'_, W> {
    type Output = Result<(), MeshError>;

    #[inline(always)]
    fn run<S: Simd>(self) -> Self::Output {
        let Self { input, lattice, settings, slabs, out } = self;
        let (start, end) = match &input {
            Input::Stream { window, .. } => (window.z, window.z),
            Input::Volume { samples, cells } => {
                // Slabs alike from the first on have no surface: the last of them will do.
                let slabs = cells.start..cells.end + 1;
                let padding = usize::from(lattice.padded);
                let given =
                    &samples.weights()[(slabs.start + padding) * lattice.len..(slabs.end + padding) * lattice.len];
                let alike = classify::alike::<S, W>(given, W::threshold(settings.isovalue)) / lattice.len;
                if alike == slabs.len() {
                    return Ok(());
                }
                (cells.start + alike.saturating_sub(1), cells.end)
            }
        };
        let mut pass = Vertices::new();
        for z in start..end + 1 {
            let (window, place, has_next) = match &input {
                Input::Stream { window, has_next } => {
                    (*window, if z == 0 { Place::First } else { Place::Next }, *has_next)
                }
                Input::Volume { samples, .. } => {
                    let place = if z == start {
                        Place::First
                    } else if z == end && end + 1 < lattice.size[2] {
                        Place::Beyond
                    } else {
                        Place::Next
                    };
                    (Window::of(samples, &lattice, z), place, z < end)
                }
            };
            let next = has_next.then_some(window.slabs[3]);
            slabs.step::<S, W>(&lattice, &window, place, next, settings, &mut pass, out)?;
        }
        pass.bounds.widen(out);
        Ok(())
    }
}

impl<'a, W: Weight> Window<'a, W> {
    /// The window around the meshed slab `z` of whole samples.
    #[inline(always)]
    fn of(samples: &Samples<'a, W>, lattice: &Lattice, z: usize) -> Self {
        let [_, _, len] = samples.shape().strides();
        let last = samples.shape().size()[2] as usize - 1;
        let at = z + usize::from(lattice.padded);
        let index = |at: usize| at.min(last) * len;
        let at_border = |at: usize| !lattice.padded && (at == 0 || at == last);
        let numbers = [at.saturating_sub(2), at.saturating_sub(1), at, at + 1];
        Self {
            slabs: numbers.map(|at| &samples.weights()[index(at)..][..len]),
            materials: samples
                .materials()
                .map(|materials| [at.saturating_sub(1), at].map(|at| &materials[index(at)..][..len])),
            z,
            one_sided: [at_border(at.saturating_sub(1)), at_border(at)],
        }
    }
}
