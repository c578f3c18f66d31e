//! [`ViewFinder`]: computes a viewer's view of a terrain.

use bevy_ecs::prelude::*;
use bevy_math::{DAffine3, Vec3};
use bevy_platform::collections::HashSet;
use bevy_transform::components::GlobalTransform;

use super::TerrainViewer;
use crate::cover::{LoadRegion, View};
use crate::terrain::Terrain;

/// Positions of viewers are rounded to this part of a chunk, so that small steps change nothing.
const STEP: f64 = 1.0 / 8.0;
/// The longest viewing distance, in voxels.
const FARTHEST: f64 = 1e9;

/// Computes the load regions of one terrain's viewers.
pub(super) struct ViewFinder<'a> {
    pub(super) terrain: &'a Terrain,
    /// The transform from world space to the terrain's own; `None` if it could not be computed.
    pub(super) to_terrain: Option<DAffine3>,
    /// The warnings given: pairs of a terrain and the viewer concerned, or the terrain itself.
    pub(super) reported: &'a mut HashSet<(Entity, Entity)>,
}

impl ViewFinder<'_> {
    /// The view of a viewer; `None`, with a warning, if the settings or transforms are invalid. `known`: its latest
    /// view, and the settings that it was made from.
    pub(super) fn view(
        &mut self,
        terrain: Entity,
        viewer: Entity,
        settings: &TerrainViewer,
        place: &GlobalTransform,
        known: Option<(TerrainViewer, View)>,
    ) -> Option<View> {
        let to_terrain = self.inverse_transform(terrain)?;
        let cells = f64::from(self.terrain.chunk_cells);
        let at = to_terrain.transform_point3(place.translation().as_dvec3());
        let at = (at / (f64::from(self.terrain.voxel_size) * cells)).to_array();
        self.check(terrain, viewer, settings, place, at)?;
        // `f64::min` would turn NaN into a number.
        let radii = settings.radii.as_dvec3().to_array().map(|v| if v > FARTHEST { FARTHEST } else { v } / cells);
        let [margin, samples] = [settings.margin, settings.sample_radius].map(|v| f64::from(v) / cells);
        let middle = at.map(|v| (v / STEP).round() * STEP);
        let extent = self.terrain.chunk_region();
        // Rounded to halves, so that turning the viewer changes little.
        let forward = place.affine().transform_vector3(Vec3::NEG_Z).as_dvec3();
        let forward = to_terrain.transform_vector3(forward).normalize_or_zero();
        let forward = (forward * 2.0).round().to_array();
        if let Some((as_before, viewed)) = known
            && (as_before, viewed.range.middle(), viewed.range.extent()) == (*settings, middle, extent)
        {
            return Some(viewed.facing(forward));
        }
        let whole = LoadRegion::ellipsoid(middle, radii.map(|radius| radius + STEP), extent);
        let has_levels = self.terrain.levels.count > 1;
        let range = if has_levels { whole } else { limited(whole) };
        self.note_scaled_radii(terrain, viewer, settings, range != whole);
        let margin = if has_levels { 0.0 } else { limited_margin(&range, margin) };
        // Nothing is dropped if the sample radius covers everything that may be loaded.
        let drops = !has_levels && samples < range.longest() + margin + 2.0;
        let samples = drops.then(|| LoadRegion::ellipsoid(middle, [samples + STEP; 3], extent));
        Some(View::new(range, margin, samples, forward))
    }

    /// From world space to the terrain's own; `None`, and a warning, where that is not finite.
    fn inverse_transform(&mut self, terrain: Entity) -> Option<DAffine3> {
        let to_terrain = self.to_terrain.filter(|to_terrain| to_terrain.is_finite());
        if to_terrain.is_none() {
            self.warn(terrain, terrain, || {
                format!("terrain {terrain} cannot be followed: its transform has no inverse")
            });
        }
        to_terrain
    }

    /// Refuses, with a warning, a viewer at no finite place and settings that are out of range. `at`: where it is, in
    /// chunks.
    fn check(
        &mut self,
        terrain: Entity,
        viewer: Entity,
        settings: &TerrainViewer,
        place: &GlobalTransform,
        at: [f64; 3],
    ) -> Option<()> {
        if !at.iter().all(|v| v.is_finite()) {
            let position = place.translation();
            self.warn(terrain, viewer, || {
                format!("terrain viewer {viewer} has no finite position ({position}); it loads nothing new")
            });
            return None;
        }
        let TerrainViewer { radii, margin, sample_radius } = *settings;
        // Comparisons with NaN are false, so NaN is refused here, too.
        if !(radii.to_array().iter().all(|radius| *radius > 0.0) && margin >= 0.0 && sample_radius >= 0.0) {
            self.warn(terrain, viewer, || {
                format!(
                    "terrain viewer {viewer} needs radii above 0 and a margin and a sample radius of 0 or more, in voxels, \
                     but has {radii}, {margin} and {sample_radius}; it loads nothing new"
                )
            });
            return None;
        }
        Some(())
    }

    /// Warns once of radii that had to be scaled down.
    fn note_scaled_radii(&mut self, terrain: Entity, viewer: Entity, settings: &TerrainViewer, are_scaled: bool) {
        if !are_scaled {
            self.reported.remove(&(terrain, viewer));
            return;
        }
        self.warn(terrain, viewer, || {
            format!(
                "terrain viewer {viewer} asks for more than {} chunks with radii of {} voxels; they are scaled down",
                Terrain::MAX_CHUNKS,
                settings.radii
            )
        });
    }

    fn warn(&mut self, terrain: Entity, about: Entity, text: impl FnOnce() -> String) {
        if self.reported.insert((terrain, about)) {
            bevy_log::warn!("{}", text());
        }
    }
}

/// Shrinks a region until it has at most [`Terrain::MAX_CHUNKS`] chunks.
fn limited(mut range: LoadRegion) -> LoadRegion {
    // The bounding box comes first: counting the rows of a huge region would take too long.
    while range.box_size() > 4.0 * Terrain::MAX_CHUNKS as f64 {
        range = range.shrunk(0.9);
    }
    while range.box_size() > Terrain::MAX_CHUNKS as f64 && range.grown(0.0).len() > Terrain::MAX_CHUNKS {
        range = range.shrunk(0.97);
    }
    range
}

/// Shrinks a margin until the region and the margin fit into a box of 4 × [`Terrain::MAX_CHUNKS`] chunks.
fn limited_margin(range: &LoadRegion, margin: f64) -> f64 {
    let mut margin = margin.min(FARTHEST);
    while margin > 0.1 && range.widened(margin).box_size() > 4.0 * Terrain::MAX_CHUNKS as f64 {
        margin *= 0.9;
    }
    margin
}
