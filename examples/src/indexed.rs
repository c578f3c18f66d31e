//! [`encode`]: small PNG files, of at most 256 colours.

use std::collections::BTreeMap;

type Rgb = [u8; 3];

/// A colour, and how many pixels have it.
type Counted = (Rgb, u32);

const MOST_COLORS: usize = 256;

/// A PNG file with one byte a pixel. `pixels`: `[width·height]`, by rows.
///
/// # Errors
/// [`png::EncodingError`] where there are not as many pixels as said.
pub(crate) fn encode(width: u32, height: u32, pixels: &[Rgb]) -> Result<Vec<u8>, png::EncodingError> {
    let mut counts = BTreeMap::<Rgb, u32>::new();
    pixels.iter().for_each(|&color| *counts.entry(color).or_default() += 1);
    let colors = few_colors(counts.iter().map(|(&color, &count)| (color, count)).collect());
    let nearest = |color: Rgb| (0..colors.len()).min_by_key(|&index| squared(color, colors[index])).unwrap_or(0) as u8;
    let indices: BTreeMap<Rgb, u8> = counts.into_keys().map(|color| (color, nearest(color))).collect();

    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, width, height);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_palette(colors.as_flattened());
    encoder.set_compression(png::Compression::High);
    encoder.set_filter(png::Filter::NoFilter);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&pixels.iter().map(|color| indices[color]).collect::<Vec<_>>())?;
    writer.finish()?;
    Ok(file)
}

/// Colours for all of these: the box of colours that differ most is halved until there are enough boxes.
///
/// After P. Heckbert, "Color image quantization for frame buffer display" (1982).
fn few_colors(counted: Vec<Counted>) -> Vec<Rgb> {
    let mut boxes = vec![(spread(&counted), counted)];
    while boxes.len() < MOST_COLORS {
        let most = (0..boxes.len()).max_by(|&a, &b| boxes[a].0.1.total_cmp(&boxes[b].0.1));
        let Some(index) = most.filter(|&index| boxes[index].1.len() > 1) else { break };
        let ((axis, _), mut counted) = boxes.swap_remove(index);
        counted.sort_by_key(|(color, _)| color[axis]);
        let mean = mean(&counted)[axis];
        let middle = counted.partition_point(|(color, _)| f64::from(color[axis]) <= mean).clamp(1, counted.len() - 1);
        let above = counted.split_off(middle);
        boxes.extend([counted, above].map(|half| (spread(&half), half)));
    }
    boxes.iter().map(|(_, counted)| mean(counted).map(|value| value.round() as u8)).collect()
}

/// Along which axis colours differ most, and the sum of the squares by which they do.
fn spread(counted: &[Counted]) -> (usize, f64) {
    let mean = mean(counted);
    let along = |axis: usize| -> f64 {
        let square = |(color, count): &Counted| f64::from(*count) * (f64::from(color[axis]) - mean[axis]).powi(2);
        counted.iter().map(square).sum()
    };
    (0..3).map(|axis| (axis, along(axis))).max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0, 0.0))
}

fn mean(counted: &[Counted]) -> [f64; 3] {
    let pixels: f64 = counted.iter().map(|(_, count)| f64::from(*count)).sum();
    [0, 1, 2].map(|axis| {
        let sum: f64 = counted.iter().map(|(color, count)| f64::from(*count) * f64::from(color[axis])).sum();
        sum / pixels.max(1.0)
    })
}

fn squared(a: Rgb, b: Rgb) -> u32 {
    a.into_iter().zip(b).map(|(a, b)| u32::from(a.abs_diff(b)).pow(2)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decoded(file: &[u8]) -> Vec<Rgb> {
        let mut decoder = png::Decoder::new(std::io::Cursor::new(file));
        decoder.set_transformations(png::Transformations::EXPAND);
        let mut reader = decoder.read_info().expect("a PNG file");
        let mut bytes = vec![0; reader.output_buffer_size().expect("it is small")];
        reader.next_frame(&mut bytes).expect("it is whole");
        bytes.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect()
    }

    #[test]
    fn few_colors_stay_as_they_are() {
        let pixels: Vec<Rgb> = (0..=255).map(|v| [v, 255 - v, 7]).collect();
        assert_eq!(decoded(&encode(32, 8, &pixels).expect("a file")), pixels);
        assert_eq!(decoded(&encode(2, 1, &[[9; 3]; 2]).expect("a file")), [[9; 3]; 2]);
    }

    #[test]
    fn many_colors_stay_nearly_as_they_are() {
        let pixels: Vec<Rgb> = (0..64 * 64).map(|v: u32| [4 * (v % 64) as u8, 4 * (v / 64) as u8, 100]).collect();
        let file = encode(64, 64, &pixels).expect("a file");
        let farthest = pixels.iter().zip(decoded(&file)).map(|(&a, b)| squared(a, b)).max();
        // A sixteenth of each axis is 16 levels.
        assert!(farthest <= Some(2 * 16 * 16), "{farthest:?}");
    }
}
