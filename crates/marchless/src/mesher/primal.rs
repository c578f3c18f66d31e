//! The marching-cubes passes: one vertex on each crossed edge, and the triangles of each active cell.

mod mend;
mod triangles;
mod vertices;

pub(super) use triangles::{FirstVertices, write_triangles};
pub(super) use vertices::VertexPass;
