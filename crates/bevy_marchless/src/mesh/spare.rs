//! [`SpareMeshes`]: memory for the meshes that edits show at once.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use bevy_ecs::prelude::*;
use bevy_tasks::AsyncComputeTaskPool;
use marchless::MeshBuffer;

/// Memory for the meshes that edits show at once: new memory has to be mapped page by page, which can take longer than
/// all else, and what one thread has allocated another may not be given again.
///
/// Geometry takes the memory of geometry that was replaced. A renderer takes an asset's memory for good, so tasks
/// prepare some for the assets of the next edit, which are likely to be about as large as those of the last one.
#[derive(Resource, Default)]
pub(crate) struct SpareMeshes {
    replaced: Mutex<VecDeque<Arc<MeshBuffer>>>,
    rooms: Arc<Mutex<VecDeque<AssetRoom>>>,
}

/// Memory for the parts of one mesh asset.
#[derive(Debug, Default)]
pub(crate) struct AssetRoom {
    pub(crate) positions: Vec<[f32; 3]>,
    pub(crate) normals: Vec<[f32; 3]>,
    pub(crate) colors: Vec<[f32; 4]>,
    pub(crate) materials: Vec<u32>,
    pub(crate) indices: Vec<u16>,
}

impl AssetRoom {
    fn new(vertices: usize, indices: usize) -> Self {
        Self {
            positions: Vec::with_capacity(vertices),
            normals: Vec::with_capacity(vertices),
            colors: Vec::with_capacity(vertices),
            materials: Vec::with_capacity(vertices),
            indices: Vec::with_capacity(indices),
        }
    }

    /// Writes to all of it, so that none is left to be mapped.
    fn touch(&mut self) {
        fn touch<T: Clone>(room: &mut Vec<T>, with: T) {
            room.resize(room.capacity(), with);
            room.clear();
        }
        touch(&mut self.positions, [0.0; 3]);
        touch(&mut self.normals, [0.0; 3]);
        touch(&mut self.colors, [0.0; 4]);
        touch(&mut self.materials, 0);
        touch(&mut self.indices, 0);
    }
}

/// Twice as many as a small edit replaces.
const MOST: usize = 16;

impl SpareMeshes {
    /// Keeps a mesh's memory, to be used as soon as nobody else has the mesh.
    pub(crate) fn keep(&self, mesh: Arc<MeshBuffer>) {
        if !mesh.is_empty() {
            push(&self.replaced, mesh);
        }
    }

    /// Memory for a mesh's asset: the least of what is prepared in which it fits without wasting much, or new one.
    pub(crate) fn room_for(&self, mesh: &MeshBuffer) -> AssetRoom {
        let (vertices, indices) = (mesh.positions.len(), mesh.indices.len());
        let fits = |room: usize, needed: usize| room >= needed && room <= 4 * needed;
        let mut rooms = lock(&self.rooms);
        let fitting = rooms
            .iter()
            .enumerate()
            .filter(|(_, room)| fits(room.positions.capacity(), vertices) && fits(room.indices.capacity(), indices));
        let least = fitting.min_by_key(|(_, room)| room.positions.capacity()).map(|(index, _)| index);
        least.and_then(|index| rooms.remove(index)).unwrap_or_else(|| AssetRoom::new(vertices, indices))
    }

    /// Has memory prepared for assets of meshes like these, where there are threads for that.
    pub(crate) fn prepare_rooms<'a>(&self, meshes: impl Iterator<Item = &'a MeshBuffer>) {
        let sizes: Vec<_> = meshes.map(|mesh| (slack(mesh.positions.len()), slack(mesh.indices.len()))).collect();
        let Some(pool) = AsyncComputeTaskPool::try_get().filter(|_| !sizes.is_empty()) else { return };
        let rooms = self.rooms.clone();
        let prepare = async move {
            for (vertices, indices) in sizes {
                let mut room = AssetRoom::new(vertices, indices);
                room.touch();
                push(&rooms, room);
            }
        };
        pool.spawn(prepare).detach();
    }

    /// A copy of a mesh, in spare memory where some of it fits.
    pub(crate) fn copy(&self, mesh: &MeshBuffer) -> Arc<MeshBuffer> {
        let mut copy = self.take_for(mesh).unwrap_or_else(|| Arc::new(with_room_for(mesh)));
        if let Some(copy) = Arc::get_mut(&mut copy) {
            let MeshBuffer { positions, normals, materials, indices, bounds } = mesh;
            copy.positions.clone_from(positions);
            copy.normals.clone_from(normals);
            copy.materials.clone_from(materials);
            copy.indices.clone_from(indices);
            copy.bounds = *bounds;
        }
        copy
    }

    fn take_for(&self, mesh: &MeshBuffer) -> Option<Arc<MeshBuffer>> {
        let mut kept = lock(&self.replaced);
        let fits = kept.iter_mut().position(|kept| Arc::get_mut(kept).is_some_and(|kept| has_room_for(kept, mesh)));
        fits.and_then(|index| kept.remove(index))
    }
}

fn lock<T>(kept: &Mutex<T>) -> MutexGuard<'_, T> {
    kept.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Adds to what is kept, of which the oldest goes where there is too much.
fn push<T>(kept: &Mutex<VecDeque<T>>, new: T) {
    let mut kept = lock(kept);
    kept.push_back(new);
    if kept.len() > MOST {
        kept.pop_front();
    }
}

/// What is needed and a little more, for edits come back to where they were.
const fn slack(needed: usize) -> usize {
    needed + needed / 8
}

/// Whether a mesh can be copied without new memory, and without wasting much of the old.
fn has_room_for(room: &MeshBuffer, mesh: &MeshBuffer) -> bool {
    let fits = |room, needed| room >= needed && room <= 2 * needed;
    fits(room.positions.capacity(), mesh.positions.len())
        && fits(room.normals.capacity(), mesh.normals.len())
        && fits(room.materials.capacity(), mesh.materials.len())
        && fits(room.indices.capacity(), mesh.indices.len())
}

fn with_room_for(mesh: &MeshBuffer) -> MeshBuffer {
    MeshBuffer {
        positions: Vec::with_capacity(slack(mesh.positions.len())),
        normals: Vec::with_capacity(slack(mesh.normals.len())),
        materials: Vec::with_capacity(slack(mesh.materials.len())),
        indices: Vec::with_capacity(slack(mesh.indices.len())),
        bounds: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh(vertices: usize) -> MeshBuffer {
        MeshBuffer {
            positions: vec![[1.0; 3]; vertices],
            normals: vec![[2.0; 3]; vertices],
            materials: vec![3; vertices],
            indices: (0..3 * vertices as u32).collect(),
            bounds: Some([[0.0; 3], [1.0; 3]]),
        }
    }

    #[test]
    fn a_copy_takes_memory_that_nobody_has_and_that_fits() {
        let spare = SpareMeshes::default();
        let [small, large, used, fitting] = [90, 300, 110, 110].map(|vertices| Arc::new(mesh(vertices)));
        let (user, address) = (used.clone(), fitting.positions.as_ptr());
        [small, large, used, fitting].into_iter().for_each(|mesh| spare.keep(mesh));
        let copy = spare.copy(&mesh(100));
        assert_eq!((copy.positions.as_ptr(), &*copy), (address, &mesh(100)));
        assert_eq!(*user, mesh(110));
        let copy = spare.copy(&mesh(105));
        assert_eq!((&*copy, &*user), (&mesh(105), &mesh(110)), "what fits is in use");
        let address = copy.positions.as_ptr();
        spare.keep(copy);
        assert_eq!(spare.copy(&mesh(112)).positions.as_ptr(), address, "there is room for a little more");
    }

    #[test]
    fn little_is_kept() {
        let spare = SpareMeshes::default();
        let first = Arc::new(mesh(10));
        spare.keep(first.clone());
        (0..MOST).for_each(|_| spare.keep(Arc::new(mesh(10))));
        spare.keep(Arc::default());
        assert_eq!((spare.replaced.lock().unwrap().len(), Arc::strong_count(&first)), (MOST, 1), "the oldest has gone");
    }

    #[test]
    fn assets_take_the_least_room_that_was_prepared() {
        AsyncComputeTaskPool::get_or_init(Default::default);
        let spare = SpareMeshes::default();
        spare.prepare_rooms([300, 100, 200, 30].map(mesh).iter());
        while lock(&spare.rooms).len() < 4 {
            std::thread::yield_now();
        }
        let room = spare.room_for(&mesh(110));
        let capacities = [
            room.positions.capacity(),
            room.normals.capacity(),
            room.colors.capacity(),
            room.materials.capacity(),
            room.indices.capacity(),
        ];
        assert_eq!(capacities, [112, 112, 112, 112, 337]);
        assert!(room.positions.is_empty() && room.indices.is_empty());
        assert_eq!(spare.room_for(&mesh(110)).positions.capacity(), 225);
        assert_eq!(spare.room_for(&mesh(340)).positions.capacity(), 340, "nothing that large");
        assert_eq!(spare.room_for(&mesh(8)).positions.capacity(), 8, "nothing that small");
        assert_eq!(lock(&spare.rooms).len(), 2);
        spare.prepare_rooms(core::iter::repeat_n(&mesh(10), 3 * MOST));
        while lock(&spare.rooms).iter().any(|room| room.positions.capacity() > 11) {
            std::thread::yield_now();
        }
        assert!(lock(&spare.rooms).len() <= MOST);
    }
}
