//! [`BitsSnapshot`]: the solid points of a box at one moment, for queries on any thread.

use core::fmt;
use std::sync::Arc;

use bevy_math::IVec3;
use bevy_tasks::{AsyncComputeTaskPool, Task, TaskPool};
use marchless::bits::{BitGrid, Connectivity};
use marchless::{Region, Shape};

use super::part::ChunkPart;
use super::{Island, Phase, TerrainBits, TerrainBitsError};

/// The solid points of a box of a terrain at one moment. Later changes of the terrain do not affect it.
///
/// It answers the queries of [`TerrainBits`] about boxes, on any thread. Taking a snapshot copies no samples: it shares
/// them with the terrain. Bits that it derives are kept in the terrain's cache, too. While a snapshot lives, an edit in
/// the box has to copy the chunk's samples.
#[derive(Clone)]
pub struct BitsSnapshot {
    /// The whole box.
    pub(super) region: Region,
    /// The part of the box that may be solid.
    pub(super) inside: Region,
    pub(super) parts: Vec<ChunkPart>,
}

impl BitsSnapshot {
    /// The box, in the terrain's lattice.
    pub const fn region(&self) -> Region {
        self.region
    }

    /// Runs a query in a task of the [`AsyncComputeTaskPool`]. Dropping the task cancels it.
    ///
    /// ```
    /// use bevy_marchless::prelude::*;
    /// use bevy_marchless::bits::prelude::*;
    /// # use bevy_ecs::prelude::*;
    /// use bevy_tasks::{Task, futures::check_ready};
    ///
    /// #[derive(Resource, Default)]
    /// struct Search(Option<Task<Result<Vec<Island>, TerrainBitsError>>>);
    ///
    /// fn start_search(mut edits: MessageReader<TerrainEdited>, bits: TerrainBits, mut search: ResMut<Search>) {
    ///     for edited in edits.read() {
    ///         let region = Region::new(edited.min.to_array(), edited.max.to_array()).grown(64, 64);
    ///         if let Ok(snapshot) = bits.snapshot(edited.terrain, region) {
    ///             search.0 = Some(snapshot.in_task(|snapshot| snapshot.islands()));
    ///         }
    ///     }
    /// }
    ///
    /// fn poll_search(mut search: ResMut<Search>) {
    ///     if let Some(Ok(islands)) = search.0.as_mut().and_then(check_ready) {
    ///         println!("{} islands hang free", islands.iter().filter(|island| !island.touches_boundary()).count());
    ///         search.0 = None;
    ///     }
    /// }
    /// ```
    pub fn in_task<T: Send + 'static>(self, query: impl FnOnce(&Self) -> T + Send + 'static) -> Task<T> {
        AsyncComputeTaskPool::get_or_init(TaskPool::default).spawn(async move { query(&self) })
    }

    /// The bits of the box; the box's lowest point is the grid's point `[0, 0, 0]`.
    ///
    /// # Errors
    /// [`TerrainBitsError::Empty`], [`TerrainBitsError::TooLarge`].
    pub fn bits(&self) -> Result<BitGrid, TerrainBitsError> {
        self.assemble(self.region)
    }

    /// True if a path inside the box leads from `a` to `b` through points of one phase.
    ///
    /// Solid points are neighbours along the axes only; points of air also along the diagonals of faces. This agrees
    /// with the mesh, which separates solid points across a diagonal. False if `a` or `b` is outside the box or of the
    /// other phase.
    ///
    /// # Errors
    /// [`TerrainBitsError::TooLarge`].
    pub fn connected(&self, a: IVec3, b: IVec3, phase: Phase) -> Result<bool, TerrainBitsError> {
        let (region, connectivity) = match phase {
            Phase::Solid => (self.inside, Connectivity::Six),
            Phase::Air => (self.region, Connectivity::Eighteen),
        };
        let ends = [a, b].map(|end| end.to_array());
        if !ends.iter().all(|end| region.contains(*end)) {
            return Ok(false);
        }
        let mut mask = self.assemble(region)?;
        if phase == Phase::Air {
            mask.invert();
        }
        let [a, b] = ends.map(|end| [0, 1, 2].map(|axis| end[axis].abs_diff(region.min[axis])));
        Ok(mask.get(a) && mask.get(b) && mask.flood(&[a], connectivity)?.get(b))
    }

    /// The islands of the box: the connected components of its solid points, in order of their first points, x fastest.
    ///
    /// Solid points are neighbours along the axes only, as in the mesh. So islands touch at edges and corners at most,
    /// and the mesh of each is closed. An island that [touches the boundary](Island::touches_boundary) may continue
    /// beyond the box.
    ///
    /// # Errors
    /// [`TerrainBitsError::TooLarge`].
    pub fn islands(&self) -> Result<Vec<Island>, TerrainBitsError> {
        if self.inside.is_empty() {
            return Ok(Vec::new());
        }
        let solid = Arc::new(self.assemble(self.inside)?);
        let components = solid.components(Connectivity::Six);
        Ok(components.iter().map(|component| Island::new(*component, self.inside, &solid)).collect())
    }

    /// The [islands](Self::islands) that do not [touch the boundary](Island::touches_boundary).
    ///
    /// # Errors
    /// [`TerrainBitsError::TooLarge`].
    pub fn loose_islands(&self) -> Result<Vec<Island>, TerrainBitsError> {
        let mut islands = self.islands()?;
        islands.retain(|island| !island.touches_boundary());
        Ok(islands)
    }

    /// Gathers the bits of all parts in one grid.
    fn assemble(&self, region: Region) -> Result<BitGrid, TerrainBitsError> {
        let [nx, ny, nz] = region.size();
        let shape = Shape::new([nx, ny, nz]).map_err(|_| {
            if region.is_empty() { TerrainBitsError::Empty { region } } else { TerrainBitsError::TooLarge { region } }
        })?;
        let words = u128::from(nx.div_ceil(64)) * u128::from(ny) * u128::from(nz);
        if words > u128::from(TerrainBits::MAX_WORDS) {
            return Err(TerrainBitsError::TooLarge { region });
        }
        let mut bits = BitGrid::new(shape)?;
        for part in &self.parts {
            part.write(&mut bits, region.min)?;
        }
        Ok(bits)
    }
}

impl fmt::Debug for BitsSnapshot {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("BitsSnapshot").field("region", &self.region).finish_non_exhaustive()
    }
}
