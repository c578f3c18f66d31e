//! The numbered parts of a cell: corners, edges and faces, and the case index of its corners' signs.
//!
//! ```text
//!        6────────e3────────7          z  y
//!       ╱│                 ╱│          │ ╱
//!     e6 │               e7 │          │╱
//!     ╱ e10              ╱ e11         └────x
//!    4────────e2────────5   │
//!    │   │              │   │     corner = x + 2·y + 4·z
//!    │   2────────e1────│───3     edges 0–3 run along x, 4–7 along y, 8–11 along z
//!   e8  ╱              e9  ╱      faces: 0 −x, 1 +x, 2 −y, 3 +y, 4 −z, 5 +z
//!    │ e4               │ e5
//!    │╱                 │╱
//!    0────────e0────────1
//! ```

/// A corner of a cell, 0–7: bit 0 is its x, bit 1 its y, bit 2 its z.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Corner(u8);

impl Corner {
    /// All eight corners.
    pub const ALL: [Self; 8] = [Self(0), Self(1), Self(2), Self(3), Self(4), Self(5), Self(6), Self(7)];

    /// The corner number `index`.
    ///
    /// # Panics
    /// If `index` is not below 8.
    pub const fn new(index: u8) -> Self {
        assert!(index < 8, "a cell has eight corners");
        Self(index)
    }

    /// The corner's number, 0–7.
    pub const fn index(self) -> usize {
        self.0 as usize
    }

    /// The corner's position in the cell; each coordinate is 0 or 1.
    pub const fn offset(self) -> [u8; 3] {
        [self.0 & 1, self.0 >> 1 & 1, self.0 >> 2]
    }
}

/// An edge of a cell, 0–11: four along x, four along y, four along z.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(transparent)]
pub struct Edge(u8);

impl Edge {
    /// All twelve edges.
    pub const ALL: [Self; 12] = {
        let mut all = [Self(0); 12];
        let mut index = 0;
        while index < 12 {
            all[index] = Self(index as u8);
            index += 1;
        }
        all
    };

    /// The edge number `index`.
    ///
    /// # Panics
    /// If `index` is not below 12.
    pub const fn new(index: u8) -> Self {
        assert!(index < 12, "a cell has twelve edges");
        Self(index)
    }

    /// The edge between two corners.
    ///
    /// # Panics
    /// If the corners are not neighbours.
    pub const fn between(a: Corner, b: Corner) -> Self {
        let low = a.0 & b.0;
        match a.0 ^ b.0 {
            1 => Self(low >> 1),
            2 => Self(4 + (low & 1) + (low >> 1 & 2)),
            4 => Self(8 + low),
            _ => panic!("the corners are not neighbours"),
        }
    }

    /// The edge's number, 0–11.
    pub const fn index(self) -> usize {
        self.0 as usize
    }

    /// The axis that the edge runs along: 0 x, 1 y, 2 z.
    pub const fn axis(self) -> usize {
        self.0 as usize / 4
    }

    /// The two ends of the edge, the lower first.
    pub const fn corners(self) -> [Corner; 2] {
        let (first, second) = (self.0 & 1, self.0 >> 1 & 1);
        match self.axis() {
            0 => [Corner(first << 1 | second << 2), Corner(first << 1 | second << 2 | 1)],
            1 => [Corner(first | second << 2), Corner(first | second << 2 | 2)],
            _ => [Corner(first | second << 1), Corner(first | second << 1 | 4)],
        }
    }

    /// True if both edges lie on one face of the cell.
    pub const fn shares_face(self, other: Self) -> bool {
        self.faces() & other.faces() != 0
    }

    /// The two faces that the edge lies on, a bit each.
    const fn faces(self) -> u8 {
        let (mut faces, mut face) = (0, 0);
        let [low, high] = self.corners();
        while face < 6 {
            if Face(face).holds(low) && Face(face).holds(high) {
                faces |= 1 << face;
            }
            face += 1;
        }
        faces
    }
}

/// A face of a cell, 0–5: −x, +x, −y, +y, −z, +z.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Face(u8);

impl Face {
    /// All six faces.
    pub const ALL: [Self; 6] = [Self(0), Self(1), Self(2), Self(3), Self(4), Self(5)];

    /// The face number `index`.
    ///
    /// # Panics
    /// If `index` is not below 6.
    pub const fn new(index: u8) -> Self {
        assert!(index < 6, "a cell has six faces");
        Self(index)
    }

    /// The face's number, 0–5.
    pub const fn index(self) -> usize {
        self.0 as usize
    }

    /// The axis that the face is perpendicular to: 0 x, 1 y, 2 z.
    pub const fn axis(self) -> usize {
        self.0 as usize / 2
    }

    /// True if the face lies on the high side of its axis.
    pub const fn is_high(self) -> bool {
        self.0 & 1 == 1
    }

    /// The corners of the face, counter-clockwise as seen from outside the cell.
    pub const fn corners(self) -> [Corner; 4] {
        let (across, u, v) = (1u8 << self.axis(), 1u8 << ((self.axis() + 1) % 3), 1u8 << ((self.axis() + 2) % 3));
        if self.is_high() {
            [Corner(across), Corner(across | u), Corner(across | u | v), Corner(across | v)]
        } else {
            [Corner(0), Corner(v), Corner(u | v), Corner(u)]
        }
    }

    /// True if `corner` is one of the face's four.
    pub const fn holds(self, corner: Corner) -> bool {
        (corner.0 >> self.axis() & 1 == 1) == self.is_high()
    }
}

/// The set of a cell's corners that are inside. Bit `i` is corner `i`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct CaseIndex(pub u8);

impl CaseIndex {
    /// True if `corner` is inside.
    pub const fn is_inside(self, corner: Corner) -> bool {
        self.0 >> corner.0 & 1 == 1
    }

    /// True if the surface crosses `edge`.
    pub const fn crosses(self, edge: Edge) -> bool {
        let [low, high] = edge.corners();
        self.is_inside(low) != self.is_inside(high)
    }

    /// True if the corners of `face` alternate between inside and outside. Their signs then leave open how the four
    /// crossings are joined.
    pub const fn is_ambiguous(self, face: Face) -> bool {
        let [a, b, c, d] = face.corners();
        self.is_inside(a) == self.is_inside(c)
            && self.is_inside(b) == self.is_inside(d)
            && self.is_inside(a) != self.is_inside(b)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_edge_lies_between_its_corners() {
        for edge in Edge::ALL {
            let [low, high] = edge.corners();
            assert_eq!(high.index() - low.index(), 1 << edge.axis());
            assert_eq!((Edge::between(low, high), Edge::between(high, low)), (edge, edge));
            assert_eq!(edge.faces().count_ones(), 2);
        }
    }

    #[test]
    fn face_corners_turn_counter_clockwise() {
        for face in Face::ALL {
            let [a, b, _, d] = face.corners().map(|corner| corner.offset().map(i32::from));
            let (u, v) = ([0, 1, 2].map(|i| b[i] - a[i]), [0, 1, 2].map(|i| d[i] - a[i]));
            let normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
            let mut outward = [0; 3];
            outward[face.axis()] = if face.is_high() { 1 } else { -1 };
            assert_eq!(normal, outward, "{face:?}");
            assert!(face.corners().iter().all(|&corner| face.holds(corner)));
        }
    }
}
