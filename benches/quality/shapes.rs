//! The shapes, as functions of a point.

pub(crate) type Point = [f64; 3];

/// A shape in a box of samples.
pub(crate) struct Scene {
    kind: Kind,
    /// The middle of the box, a little off the lattice.
    middle: Point,
    /// About half the size of the shape.
    radius: f64,
}

#[derive(Clone, Copy)]
enum Kind {
    Cube,
    Cone,
    Csg,
}

impl Scene {
    pub(crate) fn all(size: f64) -> [Self; 3] {
        let middle = [0.5, 0.48, 0.51].map(|part| (size - 1.0) * part);
        [Kind::Cube, Kind::Cone, Kind::Csg].map(|kind| Self { kind, middle, radius: size * 0.26 })
    }

    pub(crate) const fn name(&self) -> &'static str {
        match self.kind {
            Kind::Cube => "turned cube",
            Kind::Cone => "turned cone",
            Kind::Csg => "cube less a ball and with one",
        }
    }

    /// The distance to the surface, negative inside; near creases of cuts and unions only its bound.
    pub(crate) fn distance(&self, point: Point) -> f64 {
        let from_middle = [0, 1, 2].map(|axis| point[axis] - self.middle[axis]);
        let p = turned(from_middle);
        let radius = self.radius;
        match self.kind {
            Kind::Cube => cube(p, radius),
            Kind::Cone => {
                // 26.6° between axis and side.
                let side = p[0].hypot(p[1]) * 0.8_f64.sqrt() + (p[2] - radius) * 0.2_f64.sqrt();
                side.max(-p[2] - radius)
            }
            Kind::Csg => {
                let cut = radius * 1.25 - length(from_middle);
                let added = length([p[0], p[1], p[2] - radius]) - radius * 0.45;
                cube(p, radius).max(cut).min(added)
            }
        }
    }

    /// The direction of the function's gradient.
    pub(crate) fn normal(&self, point: Point) -> Point {
        let step = 1e-4;
        unit([0, 1, 2].map(|axis| {
            let [mut low, mut high] = [point; 2];
            low[axis] -= step;
            high[axis] += step;
            self.distance(high) - self.distance(low)
        }))
    }

    /// Whether normals within a voxel differ by more than 20°.
    pub(crate) fn has_crease(&self, point: Point) -> bool {
        let own = self.normal(point);
        (0..6).any(|side| {
            let mut other = point;
            other[side / 2] += if side % 2 == 0 { -1.0 } else { 1.0 };
            dot(own, self.normal(other)) < 20.0_f64.to_radians().cos()
        })
    }
}

fn cube(p: Point, half: f64) -> f64 {
    let beyond = p.map(|v| v.abs() - half);
    length(beyond.map(|v| v.max(0.0))) + beyond[0].max(beyond[1]).max(beyond[2]).min(0.0)
}

fn turned([x, y, z]: Point) -> Point {
    let ((s, c), (t, d)) = (0.5_f64.sin_cos(), 0.7_f64.sin_cos());
    let (x, y) = (x * c - y * s, x * s + y * c);
    [x, y * d - z * t, y * t + z * d]
}

pub(crate) fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn length(a: Point) -> f64 {
    dot(a, a).sqrt()
}

pub(crate) fn unit(a: Point) -> Point {
    let length = length(a);
    a.map(|v| v / length)
}
