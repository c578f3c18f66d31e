//! From bits alone to a triangle mesh.
