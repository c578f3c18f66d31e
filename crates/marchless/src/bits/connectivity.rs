//! [`Connectivity`]: the neighbourhood of a point.

/// The choice of neighbours among the 26 points around a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Connectivity {
    /// The 6 that share a face, of cubes around the points.
    Six,
    /// The 18 that share a face or an edge.
    Eighteen,
    /// All 26: those that share a face, an edge or a corner.
    TwentySix,
}

impl Connectivity {
    /// All three, the fewest neighbours first.
    pub const ALL: [Self; 3] = [Self::Six, Self::Eighteen, Self::TwentySix];
}
