//! The distance of a field's saddles from the isovalue, zero, for the choice of inputs: near a saddle, no refinement
//! can tell which way the surface goes.

/// The least distance of a cell's saddles from zero, on its faces and within, as a fraction of the range of the
/// corners' values.
///
/// `corners`: bit 0 of a corner is its x.
pub(crate) fn distance(corners: &[f64; 8]) -> f64 {
    let [min, max] = [f64::min, f64::max].map(|fold| corners.iter().copied().reduce(fold).expect("eight corners"));
    let saddles = face_saddles(corners).into_iter().chain(body_saddles(corners));
    saddles.map(f64::abs).fold(f64::MAX, f64::min) / (max - min)
}

/// The faces' saddles, where they are within the face. Those with fewer than two changes of sign around them have
/// nothing to decide.
fn face_saddles(corners: &[f64; 8]) -> Vec<f64> {
    let mut saddles = Vec::new();
    for axis in 0..3 {
        let (u, v) = (1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
        for base in [0, 1 << axis] {
            let [a, b, c, d] = [0, u, v, u + v].map(|corner| corners[base + corner]);
            // a + (b − a)·x + (c − a)·y + e·x·y
            let e = a + d - b - c;
            let (x, y) = ((a - c) / e, (a - b) / e);
            if is_within(x) && is_within(y) {
                saddles.push((a * d - b * c) / e);
            }
        }
    }
    saddles
}

/// The saddles within the cell: there are at most two.
fn body_saddles(corners: &[f64; 8]) -> Vec<f64> {
    // a + b·x + c·y + d·z + e·x·y + f·x·z + g·y·z + h·x·y·z
    let [v0, v1, v2, v3, v4, v5, v6, v7] = *corners;
    let [a, b, c, d] = [v0, v1 - v0, v2 - v0, v4 - v0];
    let [e, f, g] = [v3 - v2 - v1 + v0, v5 - v4 - v1 + v0, v6 - v4 - v2 + v0];
    let h = v7 - v6 - v5 - v3 + v4 + v2 + v1 - v0;
    // Shifted by g/h, f/h and e/h, it has no products of two: h·X·Y·Z + p·X + q·Y + r·Z and a number.
    let [p, q, r] = [b - e * f / h, c - e * g / h, d - f * g / h];
    let mut saddles = Vec::new();
    for sign in [-1.0, 1.0] {
        // h·Y·Z = −p, h·X·Z = −q, h·X·Y = −r
        let x = sign * (-q * r / (h * p)).sqrt();
        let [y, z] = [-r / (h * x), -q / (h * x)];
        let [x, y, z] = [x - g / h, y - f / h, z - e / h];
        if [x, y, z].into_iter().all(is_within) {
            saddles.push(a + b * x + c * y + d * z + e * x * y + f * x * z + g * y * z + h * x * y * z);
        }
    }
    saddles
}

/// True if a coordinate lies in the cell; false for NaN.
fn is_within(coordinate: f64) -> bool {
    (0.0..=1.0).contains(&coordinate)
}
