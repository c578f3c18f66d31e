//! Binary STL: triangles without shared vertices, each with its own normal.

use std::io::{self, Write};

use marchless::MeshBuffer;

use super::{Encoder, OutputError, bytes};
use crate::recent::Recent;

/// The title. It must not begin with "solid", as text files do.
const TITLE: &[u8] = b"binary STL made by mesh_volume";

pub(super) struct Stl {
    recent: Recent<[f32; 3]>,
    triangles: u64,
}

impl Encoder for Stl {
    fn header_length(&self) -> usize {
        84
    }

    fn encode(&mut self, piece: &MeshBuffer, body: &mut dyn Write, _tail: &mut dyn Write) -> Result<(), OutputError> {
        self.recent.extend(piece.positions.iter().copied()).map_err(io::Error::from)?;
        for triangle in piece.triangles() {
            let corners = triangle.map(|index| self.recent.get(index).copied());
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
    pub(super) const fn new() -> Self {
        Self { recent: Recent::new(), triangles: 0 }
    }

    fn count(&self) -> Result<u32, OutputError> {
        u32::try_from(self.triangles).map_err(|_| OutputError::StlTooLong)
    }
}

/// The unit normal of a triangle with counter-clockwise corners; zero if rounding left the triangle no area.
fn normal(corners: [[f32; 3]; 3]) -> [f32; 3] {
    let [a, b, c] = corners.map(|corner| corner.map(f64::from));
    let [u, v] = [b, c].map(|end| [end[0] - a[0], end[1] - a[1], end[2] - a[2]]);
    let cross = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    let length = cross.iter().map(|v| v * v).sum::<f64>().sqrt();
    if length > 0.0 { cross.map(|v| (v / length) as f32) } else { [0.0; 3] }
}
