//! [`MaterialSet`]: which of the 256 materials belong to something.

/// A set of materials, with a bit for each of the 256.
///
/// ```
/// use marchless::MaterialSet;
///
/// let hewn: MaterialSet = [3, 7].into_iter().collect();
/// assert!(hewn.contains(7) && !hewn.contains(0));
/// assert!(MaterialSet::ALL.contains(255) && MaterialSet::EMPTY.is_empty());
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct MaterialSet([u128; 2]);

impl MaterialSet {
    /// No material.
    pub const EMPTY: Self = Self([0; 2]);
    /// All 256 materials.
    pub const ALL: Self = Self([u128::MAX; 2]);

    /// The set with `material` added.
    #[must_use]
    pub const fn with(mut self, material: u8) -> Self {
        self.0[(material / 128) as usize] |= 1 << (material % 128);
        self
    }

    /// True if `material` belongs to the set.
    #[inline]
    pub const fn contains(&self, material: u8) -> bool {
        self.0[(material / 128) as usize] >> (material % 128) & 1 == 1
    }

    /// True if no material belongs to the set.
    pub const fn is_empty(&self) -> bool {
        self.0[0] | self.0[1] == 0
    }
}

impl FromIterator<u8> for MaterialSet {
    fn from_iter<I: IntoIterator<Item = u8>>(materials: I) -> Self {
        materials.into_iter().fold(Self::EMPTY, Self::with)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sets_hold_what_was_added() {
        for added in 0..=255 {
            let set = MaterialSet::EMPTY.with(added);
            assert!(!set.is_empty() && (0..=255).all(|material| set.contains(material) == (material == added)));
        }
        assert_eq!((0..=255).collect::<MaterialSet>(), MaterialSet::ALL);
    }
}
