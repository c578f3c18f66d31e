//! Volumes for the tests: their samples, and their bytes in files.

/// The types of samples, as the program names them, without bool, which has only two values.
pub(crate) const TYPES: [&str; 10] = ["i8", "u8", "i16", "u16", "i32", "u32", "i64", "u64", "f32", "f64"];

/// NumPy's name for a type.
pub(crate) fn numpy_type(kind: &str) -> &'static str {
    match kind {
        "bool" => "|b1",
        "i8" => "|i1",
        "u8" => "|u1",
        "i16" => "<i2",
        "u16" => "<u2",
        "i32" => "<i4",
        "u32" => "<u4",
        "i64" => "<i8",
        "u64" => "<u8",
        "f32" => "<f4",
        "f64" => "<f8",
        _ => unreachable!("{kind}"),
    }
}

/// Samples that a type can hold, x fastest.
#[derive(Clone, Debug)]
pub(crate) struct Volume {
    pub(crate) size: [usize; 3],
    pub(crate) kind: &'static str,
    pub(crate) samples: Vec<f64>,
}

impl Volume {
    /// A volume of `sample` at each position, clamped to the type's range.
    pub(crate) fn new(size: [usize; 3], kind: &'static str, sample: impl Fn([usize; 3]) -> f64) -> Self {
        let points = (0..size[2]).flat_map(|z| (0..size[1]).flat_map(move |y| (0..size[0]).map(move |x| [x, y, z])));
        let samples = points.map(|point| held(kind, sample(point))).collect();
        Self { size, kind, samples }
    }

    /// The distance to the middle, which is 100 at `radius`, with some noise on it, within any type's range.
    pub(crate) fn ball(size: [usize; 3], kind: &'static str, radius: f64, noise: f64) -> Self {
        Self::new(size, kind, |point| {
            let squares = (0..3).map(|axis| (point[axis] as f64 - (size[axis] - 1) as f64 / 2.0).powi(2));
            let seed = point[0] + 1000 * (point[1] + 1000 * point[2]);
            100.0 * squares.sum::<f64>().sqrt() / radius + noise * (random(seed) - 0.5)
        })
    }

    pub(crate) fn at(&self, [x, y, z]: [usize; 3]) -> f64 {
        self.samples[x + self.size[0] * (y + self.size[1] * z)]
    }

    /// The samples as they lie in a file, x fastest.
    pub(crate) fn bytes(&self) -> Vec<u8> {
        self.samples.iter().flat_map(|&sample| bytes(self.kind, sample)).collect()
    }

    /// [`bytes`](Self::bytes) with each sample in big-endian order.
    pub(crate) fn big_endian_bytes(&self) -> Vec<u8> {
        let samples = self.samples.iter();
        samples.flat_map(|&sample| bytes(self.kind, sample).into_iter().rev().collect::<Vec<_>>()).collect()
    }

    /// The flags that describe the bytes on the command line.
    pub(crate) fn flags(&self) -> String {
        let [x, y, z] = self.size;
        format!("--shape {x},{y},{z} --type {}", self.kind)
    }

    /// The `.npy` file of the array with the indices `[z][y][x]`, in C order.
    pub(crate) fn npy(&self, version: u8) -> Vec<u8> {
        let [x, y, z] = self.size;
        npy(version, &header(numpy_type(self.kind), false, &[z, y, x]), &self.bytes())
    }

    /// The `.npy` file of the array with the indices `[z][y][x]`, in Fortran order.
    pub(crate) fn npy_fortran(&self) -> Vec<u8> {
        let [nx, ny, nz] = self.size;
        let points = (0..nx).flat_map(|x| (0..ny).flat_map(move |y| (0..nz).map(move |z| [x, y, z])));
        let data: Vec<u8> = points.flat_map(|point| bytes(self.kind, self.at(point))).collect();
        npy(1, &header(numpy_type(self.kind), true, &[nz, ny, nx]), &data)
    }
}

/// A header as NumPy writes it, without the trailing spaces.
pub(crate) fn header(descr: &str, fortran_order: bool, shape: &[usize]) -> String {
    let order = if fortran_order { "True" } else { "False" };
    let lengths: Vec<String> = shape.iter().map(usize::to_string).collect();
    format!("{{'descr': '{descr}', 'fortran_order': {order}, 'shape': ({}), }}", lengths.join(", "))
}

/// A `.npy` file with this header and data.
pub(crate) fn npy(version: u8, header: &str, data: &[u8]) -> Vec<u8> {
    let start = if version == 1 { 10 } else { 12 };
    let length = (start + header.len() + 1).next_multiple_of(64) - start;
    let mut file = [&b"\x93NUMPY"[..], &[version, 0]].concat();
    file.extend(&(length as u32).to_le_bytes()[..start - 8]);
    file.extend(format!("{header:<width$}\n", width = length - 1).as_bytes());
    file.extend(data);
    file
}

/// A random number from 0 to 1 for each seed.
pub(crate) fn random(seed: usize) -> f64 {
    fastrand::Rng::with_seed(seed as u64).f64()
}

/// The nearest number that a sample of this type can hold.
fn held(kind: &str, number: f64) -> f64 {
    match kind {
        "bool" => f64::from(number >= 0.5),
        "i8" => f64::from(number.round() as i8),
        "u8" => f64::from(number.round() as u8),
        "i16" => f64::from(number.round() as i16),
        "u16" => f64::from(number.round() as u16),
        "i32" => f64::from(number.round() as i32),
        "u32" => f64::from(number.round() as u32),
        "i64" => number.round() as i64 as f64,
        "u64" => number.round() as u64 as f64,
        "f32" => f64::from(number as f32),
        _ => number,
    }
}

fn bytes(kind: &str, sample: f64) -> Vec<u8> {
    match kind {
        "i8" => (sample as i8).to_le_bytes().to_vec(),
        "bool" | "u8" => (sample as u8).to_le_bytes().to_vec(),
        "i16" => (sample as i16).to_le_bytes().to_vec(),
        "u16" => (sample as u16).to_le_bytes().to_vec(),
        "i32" => (sample as i32).to_le_bytes().to_vec(),
        "u32" => (sample as u32).to_le_bytes().to_vec(),
        "i64" => (sample as i64).to_le_bytes().to_vec(),
        "u64" => (sample as u64).to_le_bytes().to_vec(),
        "f32" => (sample as f32).to_le_bytes().to_vec(),
        _ => sample.to_le_bytes().to_vec(),
    }
}
