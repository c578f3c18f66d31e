//! Binary little-endian PLY: vertices with normals, then faces.

use std::io::Write;

use marchless::MeshBuffer;

use super::{Encoder, OutputError, bytes};

/// The length of every header, which is padded with a comment.
const HEADER: usize = 352;

#[derive(Default)]
pub(super) struct Ply {
    vertices: u64,
    triangles: u64,
}

impl Encoder for Ply {
    fn header_length(&self) -> usize {
        HEADER
    }

    fn encode(&mut self, piece: &MeshBuffer, body: &mut dyn Write, tail: &mut dyn Write) -> Result<(), OutputError> {
        self.vertices += piece.positions.len() as u64;
        self.triangles += piece.triangle_count() as u64;
        for (&position, &normal) in piece.positions.iter().zip(&piece.normals) {
            body.write_all(bytes([position, normal]).as_flattened().as_flattened())?;
        }
        for triangle in piece.triangles() {
            let mut face = [3; 13];
            face[1..].copy_from_slice(triangle.map(u32::to_le_bytes).as_flattened());
            tail.write_all(&face)?;
        }
        Ok(())
    }

    fn header(&self) -> Result<Vec<u8>, OutputError> {
        let start = "ply\nformat binary_little_endian 1.0\ncomment made by mesh_volume";
        let end = format!(
            "\nelement vertex {}\n\
             property float x\nproperty float y\nproperty float z\n\
             property float nx\nproperty float ny\nproperty float nz\n\
             element face {}\n\
             property list uchar uint vertex_indices\n\
             end_header\n",
            self.vertices, self.triangles
        );
        // Two counts of 20 digits, the longest possible ones, fit.
        let width = HEADER - end.len();
        Ok(format!("{start:width$}{end}").into_bytes())
    }
}
