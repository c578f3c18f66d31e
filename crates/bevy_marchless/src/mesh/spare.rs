//! [`SpareMeshes`]: the memory of replaced meshes.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use bevy_ecs::prelude::*;
use marchless::MeshBuffer;

/// The memory of meshes that others have replaced, for those that an edit shows at once: new memory has to be mapped
/// page by page, and what one thread has allocated another may not be given again.
#[derive(Resource, Default)]
pub(crate) struct SpareMeshes(Mutex<VecDeque<Arc<MeshBuffer>>>);

/// Twice as many as a small edit replaces.
const MOST: usize = 16;

impl SpareMeshes {
    /// Keeps a mesh's memory, to be used as soon as nobody else has the mesh.
    pub(crate) fn keep(&self, mesh: Arc<MeshBuffer>) {
        if !mesh.is_empty() {
            let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            kept.push_back(mesh);
            if kept.len() > MOST {
                kept.pop_front();
            }
        }
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
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let fits = kept.iter_mut().position(|kept| Arc::get_mut(kept).is_some_and(|kept| has_room_for(kept, mesh)));
        fits.and_then(|index| kept.remove(index))
    }
}

/// Whether a mesh can be copied without new memory, and without wasting much of the old.
fn has_room_for(room: &MeshBuffer, mesh: &MeshBuffer) -> bool {
    let fits = |room, needed| room >= needed && room <= 2 * needed;
    fits(room.positions.capacity(), mesh.positions.len())
        && fits(room.normals.capacity(), mesh.normals.len())
        && fits(room.materials.capacity(), mesh.materials.len())
        && fits(room.indices.capacity(), mesh.indices.len())
}

/// Memory for a mesh and a little more, for edits come back to where they were.
fn with_room_for(mesh: &MeshBuffer) -> MeshBuffer {
    let room = |needed: usize| needed + needed / 8;
    MeshBuffer {
        positions: Vec::with_capacity(room(mesh.positions.len())),
        normals: Vec::with_capacity(room(mesh.normals.len())),
        materials: Vec::with_capacity(room(mesh.materials.len())),
        indices: Vec::with_capacity(room(mesh.indices.len())),
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
        assert_eq!((spare.0.lock().unwrap().len(), Arc::strong_count(&first)), (MOST, 1), "the oldest has gone");
    }
}
