//! [`Edit`]: the changes that a stamp made.

use alloc::collections::BTreeMap;

use crate::lattice::Region;

/// The changes that one or more stamps made.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Edit {
    /// The smallest box around the changed samples; empty if none changed.
    pub region: Region,
    /// The volume that became solid, by its new material.
    pub added: VolumeByMaterial,
    /// The volume that became air, by its old material.
    pub removed: VolumeByMaterial,
}

impl Edit {
    /// An edit that changed nothing.
    pub const NONE: Self =
        Self { region: Region::new([0; 3], [0; 3]), added: VolumeByMaterial::new(), removed: VolumeByMaterial::new() };

    /// True if no sample's weight or material changed.
    pub const fn is_empty(&self) -> bool {
        self.region.is_empty()
    }

    /// Adds the changes of another edit, which changed other samples or came later.
    pub fn merge(&mut self, other: &Self) {
        self.region = self.region.union(&other.region);
        self.added.merge(&other.added);
        self.removed.merge(&other.removed);
    }
}

impl Default for Edit {
    fn default() -> Self {
        Self::NONE
    }
}

/// A volume for each material, in cubic voxels. Each sample counts as one cubic voxel of its own material.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct VolumeByMaterial(BTreeMap<u8, u64>);

impl VolumeByMaterial {
    /// No volume of any material.
    pub const fn new() -> Self {
        Self(BTreeMap::new())
    }

    /// The volume of `material`.
    pub fn get(&self, material: u8) -> u64 {
        self.0.get(&material).copied().unwrap_or(0)
    }

    /// The volume of all materials; saturates.
    pub fn total(&self) -> u64 {
        self.0.values().fold(0, |total, &volume| total.saturating_add(volume))
    }

    /// True if the volume of every material is 0.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The materials with a volume above 0 and their volumes, in order of material.
    pub fn iter(&self) -> impl Iterator<Item = (u8, u64)> + '_ {
        self.0.iter().map(|(&material, &volume)| (material, volume))
    }

    /// Adds `volume` of `material`; saturates.
    pub fn add(&mut self, material: u8, volume: u64) {
        if volume > 0 {
            let sum = self.0.entry(material).or_default();
            *sum = sum.saturating_add(volume);
        }
    }

    /// Adds all of `other`'s volumes; saturates.
    pub fn merge(&mut self, other: &Self) {
        for (material, volume) in other.iter() {
            self.add(material, volume);
        }
    }
}
