//! Binary STL: triangles that share nothing, each with a normal of its own.

use std::collections::VecDeque;
use std::io::Write;

use marchless::MeshBuffer;

use super::{Encoder, OutputError, bytes};

/// Must not begin with "solid", as text files do.
const TITLE: &[u8] = b"binary STL made by mesh_volume";

/// A piece is what a slab adds: triangles between it and the slab before it, which have no other vertices than the two
/// slabs.
const PIECES: usize = 2;

#[derive(Default)]
pub(super) struct Stl {
    /// The latest vertices.
    recent: VecDeque<[f32; 3]>,
    /// How many came before those.
    gone: usize,
    /// How many there were before each of the latest pieces.
    pieces: VecDeque<usize>,
    triangles: u64,
}

impl Encoder for Stl {
    fn header_length(&self) -> usize {
        84
    }

    fn encode(&mut self, piece: &MeshBuffer, body: &mut dyn Write, _tail: &mut dyn Write) -> Result<(), OutputError> {
        self.pieces.push_back(self.gone + self.recent.len());
        if self.pieces.len() > PIECES
            && let Some(first) = self.pieces.pop_front()
        {
            self.recent.drain(..first - self.gone);
            self.gone = first;
        }
        self.recent.extend(&piece.positions);
        for triangle in piece.triangles() {
            let corners = triangle.map(|index| self.vertex(index));
            let [Some(a), Some(b), Some(c)] = corners else {
                return Err(OutputError::VertexMissing { triangle: self.triangles });
            };
            let mut facet = [0; 50];
            facet[..48].copy_from_slice(bytes([normal([a, b, c]), a, b, c]).as_flattened().as_flattened());
            body.write_all(&facet)?;
            self.triangles += 1;
        }
        self.count().map(|_| ())
    }

    fn header(&self) -> Result<Vec<u8>, OutputError> {
        let mut header = vec![0; 84];
        header[..TITLE.len()].copy_from_slice(TITLE);
        header[80..].copy_from_slice(&self.count()?.to_le_bytes());
        Ok(header)
    }
}

impl Stl {
    fn vertex(&self, index: u32) -> Option<[f32; 3]> {
        self.recent.get((index as usize).checked_sub(self.gone)?).copied()
    }

    fn count(&self) -> Result<u32, OutputError> {
        u32::try_from(self.triangles).map_err(|_| OutputError::StlTooLong)
    }
}

/// The unit normal of a triangle whose corners run counter-clockwise; zero where rounding has left it no area.
fn normal(corners: [[f32; 3]; 3]) -> [f32; 3] {
    let [a, b, c] = corners.map(|corner| corner.map(f64::from));
    let [u, v] = [b, c].map(|end| [end[0] - a[0], end[1] - a[1], end[2] - a[2]]);
    let cross = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    let length = cross.iter().map(|v| v * v).sum::<f64>().sqrt();
    if length > 0.0 { cross.map(|v| (v / length) as f32) } else { [0.0; 3] }
}
