//! [`MeshInput`]: what the mesh of a chunk is made from, on any thread.

use core::error::Error;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, OnceLock};

use marchless::{
    Block, Grid, LeafBlock, LeafKey, LevelChange, LevelCover, LevelSource, MeshBuffer, MeshMethod, Mesher,
    Neighbourhood, QuantisedStamp, Region, Source,
};

/// What the mesh of a chunk is made from.
pub(crate) enum MeshInput {
    /// The samples of a chunk of the finest level, and of the chunks around it.
    Finest(Box<Neighbourhood<i16>>),
    /// What the samples of a coarser leaf are made from.
    Coarser(Box<LeafInput>),
}

/// What the samples of a leaf are made from: the source and every edit, as they were at one moment.
pub(crate) struct LeafInput {
    pub(super) leaf: LeafKey,
    pub(super) source: Arc<dyn Source>,
    pub(super) cells: u32,
    pub(super) spacing: f64,
    pub(super) planes: Option<Region>,
    pub(super) stamps: Vec<QuantisedStamp>,
    /// Chunks whose samples are kept instead of their stamps.
    pub(super) known: Option<Grid<i16>>,
    pub(super) cover: LaterCover,
}

/// A cover as it will be after some changes. Making it takes a while, so the first job that needs it does so.
#[derive(Clone)]
pub(crate) struct LaterCover(Arc<(Arc<LevelCover>, Vec<Arc<LevelChange>>, OnceLock<LevelCover>)>);

impl LaterCover {
    pub(crate) fn new(cover: Arc<LevelCover>, changes: Vec<Arc<LevelChange>>) -> Self {
        Self(Arc::new((cover, changes, OnceLock::new())))
    }

    fn get(&self) -> &LevelCover {
        let (cover, changes, later) = &*self.0;
        if changes.is_empty() {
            return cover;
        }
        later.get_or_init(|| {
            let mut later = LevelCover::clone(cover);
            changes.iter().for_each(|change| later.apply(change));
            later
        })
    }
}

/// Memory that meshing reuses.
#[derive(Default)]
pub(crate) struct MeshScratch {
    pub(crate) mesher: Mesher,
    block: Block<i16>,
    leaf: LeafBlock,
}

impl MeshInput {
    /// Meshes the chunk.
    ///
    /// # Errors
    /// What the source or the mesher reports. `out` is then undefined.
    pub(crate) fn mesh(
        &self,
        scratch: &mut MeshScratch,
        method: &MeshMethod,
        out: &mut MeshBuffer,
    ) -> Result<(), Box<dyn Error>> {
        let MeshScratch { mesher, block, leaf } = scratch;
        match self {
            Self::Finest(samples) => samples.view().mesh(mesher, block, method, out)?,
            Self::Coarser(input) => {
                let MeshMethod::Primal(settings) = method else {
                    return Err("coarser levels of detail have primal meshes only".into());
                };
                input.fill(leaf, settings.isovalue)?;
                mesher.mesh_leaf(&leaf.samples()?, settings, out)?;
            }
        }
        Ok(())
    }
}

impl LeafInput {
    fn fill(&self, block: &mut LeafBlock, isovalue: f32) -> Result<(), Box<dyn Error>> {
        let Self { leaf, source, cells, spacing, planes, stamps, known, cover } = self;
        let source = LevelSource {
            source: source.as_ref(),
            cells: *cells,
            spacing: *spacing,
            stamps,
            known: known.as_ref(),
            planes: *planes,
            isovalue,
        };
        catch_unwind(AssertUnwindSafe(|| block.fill(&source, cover.get(), *leaf)))
            .map_err(|_| "the terrain's source panicked".into())
    }
}
