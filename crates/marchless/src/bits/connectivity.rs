//! [`Connectivity`]: the neighbourhood of a point.

/// The neighbourhood of a point: which of the 26 points around it are its neighbours.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Connectivity {
    /// The 6 neighbours whose unit cubes share a face with the point's.
    Six,
    /// The 18 neighbours whose unit cubes share a face or an edge with the point's.
    Eighteen,
    /// All 26 neighbours, whose unit cubes share a face, an edge or a corner with the point's.
    TwentySix,
}

impl Connectivity {
    /// All three, the fewest neighbours first.
    pub const ALL: [Self; 3] = [Self::Six, Self::Eighteen, Self::TwentySix];
}
