//! The functions of the page `crates/bevy_marchless/docs/sources.md`, word for word; a test compares them.

use bevy_marchless::source::*;

/// Hills: five octaves of noise, each half as large and less than half as strong as the one before.
pub(crate) fn hills() -> Layer {
    48.0 + Layer::noise(Fractal { seed: 1, zoom: 120.0, ..Fractal::default() }, 60.0)
}

/// Mountains with sharp ridges.
pub(crate) fn ridges() -> Layer {
    40.0 + Layer::ridges(Fractal { seed: 8, zoom: 120.0, persistence: 0.35, ..Fractal::default() }, 46.0)
}

/// Hills in steps of 9.
pub(crate) fn terraces() -> Layer {
    let hills = 48.0 + Layer::noise(Fractal { seed: 1, octaves: 3, zoom: 120.0, ..Fractal::default() }, 60.0);
    hills.terraced(9.0, 0.85)
}

/// Ridges, bent out of shape.
pub(crate) fn warped() -> Layer {
    let ridges = 48.0 + Layer::ridges(Fractal { seed: 4, octaves: 2, zoom: 110.0, ..Fractal::default() }, 34.0);
    ridges.warped(Fractal { seed: 7, octaves: 2, zoom: 110.0, ..Fractal::default() }, 60.0)
}

/// Plains, with mountains on them where another noise is high.
pub(crate) fn plains_and_mountains() -> Layer {
    let plains = 26.0 + Layer::noise(Fractal { seed: 1, zoom: 90.0, ..Fractal::default() }, 10.0);
    let mountains = 34.0 + Layer::ridges(Fractal { seed: 5, zoom: 140.0, ..Fractal::default() }, 44.0);
    let place = Layer::noise(Fractal { seed: 2, octaves: 1, zoom: 180.0, ..Fractal::default() }, 1.0);
    plains + mountains * place.curved([[-0.15, 0.0], [0.5, 1.0]])
}

/// Hills with caves in them, but neither near the surface nor in the lowest ten units.
pub(crate) fn caves() -> Solid {
    let hills = 78.0 + Layer::noise(Fractal { seed: 1, zoom: 120.0, ..Fractal::default() }, 60.0);
    let noise = Fractal { seed: 14, octaves: 3, zoom: 46.0, ..Fractal::default() };
    let caves = Solid::from(Caves { noise, threshold: 0.1, lattice: 1 })
        .intersection(hills.clone() + -9.0)
        .intersection(Sdf::half_space([0.0, 10.0, 0.0], [0.0, -1.0, 0.0]));
    Solid::from(hills).subtraction(caves)
}

/// Hills with tunnels through them.
pub(crate) fn tunnels() -> Solid {
    let hills = 78.0 + Layer::noise(Fractal { seed: 1, zoom: 120.0, ..Fractal::default() }, 60.0);
    let noise = Fractal { seed: 700, octaves: 1, zoom: 52.0, ..Fractal::default() };
    let tunnels = Solid::from(Tunnels { noise, radius: 8.0, lattice: 1 })
        .intersection(Sdf::half_space([0.0, 10.0, 0.0], [0.0, -1.0, 0.0]));
    Solid::from(hills).subtraction(tunnels)
}

/// A crater, a tunnel into it, a bridge over it and a tower beside it.
pub(crate) fn shapes() -> Solid {
    let ground = 58.0 + Layer::noise(Fractal { seed: 1, zoom: 120.0, ..Fractal::default() }, 22.0);
    let crater = Sdf::sphere([95.0, 66.0, 150.0], 46.0);
    let tunnel = Sdf::capsule([95.0, 34.0, 176.0], [220.0, 34.0, 176.0], 10.0);
    let bridge = Sdf::cuboid([95.0, 58.0, 135.0], [54.0, 2.5, 7.0]).with_material(1);
    let tower = Sdf::cuboid([190.0, 70.0, 100.0], [18.0, 44.0, 18.0])
        .subtraction(Sdf::cuboid([190.0, 114.0, 100.0], [13.0, 20.0, 13.0]))
        .subtraction(Sdf::cuboid([190.0, 112.0, 100.0], [5.0, 8.0, 30.0]))
        .subtraction(Sdf::cuboid([190.0, 112.0, 100.0], [30.0, 8.0, 5.0]))
        .with_material(5);
    Solid::from(ground).subtraction(crater).subtraction(tunnel).union(bridge).union(tower)
}

/// Sand, meadows, woods, rock, snow, and veins of ore inside.
pub(crate) fn materials() -> Vec<MaterialRule> {
    let [grass, rock, sand, snow, ore, woods] = [0, 2, 3, 4, 5, 8];
    let noise = |seed, zoom| Fractal { seed, zoom, octaves: 3, ..Fractal::default() };
    let of = |material| Stratum { material, ..Stratum::default() };
    vec![
        MaterialRule::from(Stratum { below_depth: 6.0, ..of(ore) }).in_patches(noise(8, 30.0), 0.3),
        MaterialRule::from(Stratum { below_depth: 3.0, ..of(rock) }),
        MaterialRule::from(Stratum { steeper_than: 1.8, ..of(rock) }),
        MaterialRule::from(Stratum { above_height: 78.0, ..of(snow) }),
        MaterialRule::from(Stratum { steeper_than: 1.0, ..of(rock) }),
        MaterialRule::from(Stratum { above_height: 36.0, ..of(woods) }).in_patches(noise(6, 40.0), 0.15),
        MaterialRule::from(Stratum { above_height: 36.0, ..of(grass) }),
        MaterialRule::from(of(sand)),
    ]
}

/// The mountains that have these materials.
pub(crate) fn mountains() -> Layer {
    44.0 + Layer::ridges(Fractal { seed: 6, zoom: 220.0, persistence: 0.4, ..Fractal::default() }, 50.0)
}
