//! The functions of the page `crates/marchless/docs/bits.md`, word for word; a test compares them.

use marchless::bits::{BitGrid, BitsError, Components, Connectivity, Rule};
use marchless::{Region, Shape};

/// Caves in a block of rock. Set points are open, and all are connected.
pub(crate) fn caves(shape: Shape, mut random: u32) -> Result<BitGrid, BitsError> {
    let mut rock = BitGrid::from_fn(shape, |_| {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        random >> 31 == 1
    })?;
    let rule = Rule::new(&Vec::from_iter(14..=26), &Vec::from_iter(13..=26))?.with_outside(true);
    for _ in 0..5 {
        rock = rock.stepped(&rule);
    }
    rock.invert();
    let caves = rock.components(Connectivity::Six);
    Ok(caves.largest().map_or(rock, |largest| caves.mask(largest)))
}

/// The water of a spring in caves: all points that it reaches, up to the spring's height.
pub(crate) fn water(caves: &BitGrid, spring: [u32; 3]) -> Result<BitGrid, BitsError> {
    let [nx, ny, nz] = caves.shape().size().map(|size| size as i32);
    let mut below = caves.clone();
    below.fill(Region::new([0, spring[1] as i32 + 1, 0], [nx, ny, nz]), false);
    below.flood(&[spring], Connectivity::Six)
}

/// The rock that is left after some years of weather.
pub(crate) fn weathered(rock: &BitGrid, years: u32) -> Result<BitGrid, BitsError> {
    let rule = Rule::new(&[], &Vec::from_iter(12..=26))?;
    let mut left = rock.clone();
    for _ in 0..years {
        left = left.stepped(&rule);
    }
    Ok(left.opened(Connectivity::Six))
}

/// Five square columns, 1 to 13 points wide, each with a slab on top, on a common base.
pub(crate) fn columns([x, y, z]: [u32; 3]) -> bool {
    let width = 2 + 3 * (x / 20);
    let away = (x % 20).abs_diff(10).max(z.abs_diff(10));
    y < 4 || 2 * away < width + if (30..34).contains(&y) { 4 } else { 0 } && y < 34
}

/// The place where a body comes to rest after it falls or rolls down from `place`.
pub(crate) fn rolled(ground: &BitGrid, body: &BitGrid, mut place: [i32; 3]) -> [i32; 3] {
    let steps = [[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]];
    loop {
        let down = steps.map(|[x, z]| [place[0] + x, place[1] - 1, place[2] + z]);
        match down.into_iter().find(|&next| next[1] >= 0 && !ground.overlaps(body, next)) {
            Some(next) => place = next,
            None => return place,
        }
    }
}

/// Rolling hills.
pub(crate) fn hills([x, y, z]: [u32; 3]) -> bool {
    let [x, z] = [x, z].map(|v| v as f32 / 11.0);
    (y as f32) < 17.0 + 8.0 * x.sin() * z.cos() + 3.0 * (0.6 * x + 1.0).sin()
}

/// The pieces of rock that nothing supports: no path through rock connects them to the lowest layer.
pub(crate) fn floating(rock: &BitGrid) -> Result<Components, BitsError> {
    let [nx, _, nz] = rock.shape().size().map(|size| size as i32);
    let mut ground = BitGrid::new(rock.shape())?;
    ground.fill(Region::new([0; 3], [nx, 1, nz]), true);
    let mut loose = rock.clone();
    loose.subtract(&rock.flood_from(&ground, Connectivity::Six)?)?;
    Ok(loose.components(Connectivity::Six))
}

/// Heads on pillars, in four columns and two rows, on a common base.
pub(crate) fn heads([x, y, z]: [u32; 3]) -> bool {
    let [x, z] = [x, z].map(|v| (v % 20) as f32 - 9.5);
    let head = x * x + (y as f32 - 28.0).powi(2) + z * z < 60.0;
    y < 4 || head || y < 28 && x * x + z * z < 9.0
}
