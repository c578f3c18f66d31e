//! [`Mesh`]: a mesh to be judged, and its file format.

use std::{collections::HashMap, fs, io, path::Path};

/// An indexed triangle mesh.
pub(crate) struct Mesh {
    pub(crate) positions: Vec<[f32; 3]>,
    pub(crate) indices: Vec<u32>,
}

impl Mesh {
    /// The mesh with nearby vertices merged: those at most 1/65536 apart along each axis, and some up to twice as far.
    pub(crate) fn welded(self) -> Self {
        let mut same: Vec<usize> = (0..self.positions.len()).collect();
        // Close ones are in the same cell of at least one of these grids, each shifted by half a cell along some axes.
        for shifts in 0..8 {
            let mut cells = HashMap::new();
            let finite = |(_, position): &(usize, &[f32; 3])| position.iter().all(|v| v.is_finite());
            for (index, position) in self.positions.iter().enumerate().filter(finite) {
                let shift = |axis: usize| f64::from(shifts >> axis & 1) / 2.0;
                let cell = [0, 1, 2].map(|axis| (f64::from(position[axis]) * 32768.0 + shift(axis)).floor() as i64);
                let other = *cells.entry(cell).or_insert(index);
                let [a, b] = [index, other].map(|index| root(&mut same, index));
                same[a.max(b)] = a.min(b);
            }
        }
        let mut positions = Vec::new();
        let mut indices = vec![0; same.len()];
        for index in 0..same.len() {
            let first = root(&mut same, index);
            if first == index {
                indices[index] = positions.len() as u32;
                positions.push(self.positions[index]);
            } else {
                indices[index] = indices[first];
            }
        }
        Self { positions, indices: self.indices.iter().map(|&index| indices[index as usize]).collect() }
    }

    /// Reads a file of little-endian words: the number of vertices, three `f32` for each, and three `u32` for each
    /// triangle. `None` if there is no such file, since its maker had no mesh.
    ///
    /// # Errors
    /// If the file cannot be read or has another format.
    pub(crate) fn read(path: &Path) -> io::Result<Option<Self>> {
        let bytes = match fs::read(path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            bytes => bytes?,
        };
        let (words, _) = bytes.as_chunks::<4>();
        let rest = words.split_first().and_then(|(&count, rest)| {
            let floats = (u32::from_le_bytes(count) as usize).checked_mul(3)?;
            rest.split_at_checked(floats)
        });
        let (floats, indices) = rest.ok_or_else(|| {
            let length = bytes.len();
            io::Error::new(io::ErrorKind::InvalidData, format!("{} of {length} bytes is cut short", path.display()))
        })?;
        let floats: Vec<f32> = floats.iter().map(|&word| f32::from_le_bytes(word)).collect();
        let indices = indices.iter().map(|&word| u32::from_le_bytes(word)).collect();
        Ok(Some(Self { positions: floats.as_chunks().0.to_vec(), indices }))
    }
}

/// The first of the vertices that are merged with `index`.
fn root(same: &mut [usize], mut index: usize) -> usize {
    while same[index] != index {
        same[index] = same[same[index]];
        index = same[index];
    }
    index
}
