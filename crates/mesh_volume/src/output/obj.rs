//! Wavefront OBJ: `v` and `vn` for each vertex, then `f`.

use std::io::Write;

use marchless::MeshBuffer;

use super::{Encoder, OutputError};

const HEADER: &[u8] = b"# made by mesh_volume\n";

pub(super) struct Obj;

impl Encoder for Obj {
    fn header_length(&self) -> usize {
        HEADER.len()
    }

    fn encode(&mut self, piece: &MeshBuffer, body: &mut dyn Write, tail: &mut dyn Write) -> Result<(), OutputError> {
        // `Display` writes the shortest digits that parse to the same number.
        for ([x, y, z], [nx, ny, nz]) in piece.positions.iter().zip(&piece.normals) {
            writeln!(body, "v {x} {y} {z}\nvn {nx} {ny} {nz}")?;
        }
        for triangle in piece.triangles() {
            let [a, b, c] = triangle.map(|index| u64::from(index) + 1);
            writeln!(tail, "f {a}//{a} {b}//{b} {c}//{c}")?;
        }
        Ok(())
    }

    fn header(&self) -> Result<Vec<u8>, OutputError> {
        Ok(HEADER.to_vec())
    }
}
