//! [`World`]: endless hills, and the viewing distance.

use core::ops::RangeInclusive;

use bevy::prelude::*;
use bevy_marchless::prelude::*;
use bevy_marchless::source::prelude::*;
use marchless_examples::look::{Ground, LOOKS, ROCK, Scene};

/// What the world is made of, and how far one sees.
#[derive(Resource, Clone, Copy, Debug, PartialEq)]
pub(crate) struct World {
    /// Another number, other hills.
    pub(crate) seed: u32,
    /// [Units: voxels]
    pub(crate) radius: f32,
    /// The index of its look.
    pub(crate) look: usize,
}

/// How far one may see. [Units: voxels]
pub(crate) const RADII: RangeInclusive<f32> = 64.0..=4_096.0;
/// Up to here all ground is of the finest level; farther views have several levels of detail. [Units: voxels]
const ONE_LEVEL: f32 = 512.0;
const LEVELS: u8 = 6;
/// How high and low the viewer's range reaches at most with one level, so that its chunks are not too many.
/// [Units: voxels]
const HEIGHT: f32 = 448.0;
/// Between these heights most of the ground lies. [Units: voxels]
const RELIEF: [f32; 2] = [-42.0, 40.0];
/// Higher than all hills. [Units: voxels]
pub(crate) const FLIGHT_LEVEL: f32 = 60.0;
/// How deep below the ground tunnels reach. [Units: voxels]
const TUNNELS: f64 = 28.0;
/// How deep the ground's own colours reach; below is rock. [Units: voxels]
const TOPSOIL: f64 = 2.0;
/// How far from the eye the view has shadows, at most. [Units: voxels]
const SHADOWS: f32 = 1_024.0;
/// The share of the range at which everything has faded, so that its end is not seen.
const FADED: f32 = 0.95;

impl World {
    /// Hills of different height, with tunnels a little below their surface.
    ///
    /// # Errors
    /// [`SourceError`] about a number that is out of its range.
    pub(crate) fn source(&self) -> Result<Landscape, SourceError> {
        let noise = |number: u32, octaves: u32, zoom: f64| {
            let seed = self.seed.wrapping_mul(16).wrapping_add(number);
            Fractal { seed, octaves, zoom, ..Fractal::default() }
        };
        let heights = Layer::noise(noise(0, 6, 140.0), 50.0) + Layer::noise(noise(6, 2, 600.0), 16.0);
        let deep = Solid::Everything.subtraction(heights.clone() + -TUNNELS);
        let tunnels = Tunnels { noise: noise(8, 2, 110.0), radius: 5.0, lattice: 2 };
        Landscape::new(LandscapeSettings {
            solid: Solid::Ground(heights).subtraction(Solid::Tunnels(tunnels).intersection(deep)),
            materials: vec![Stratum { material: ROCK, below_depth: TOPSOIL, ..Stratum::default() }.into()],
        })
    }

    /// The terrain made of it, without any border.
    ///
    /// # Errors
    /// As [`Self::source`].
    pub(crate) fn terrain(&self) -> Result<Terrain, SourceError> {
        let levels = self.levels();
        Ok(Terrain::endless(self.source()?).with_palette(LOOKS[self.look].palette()).with_levels(levels))
    }

    fn levels(&self) -> u8 {
        if self.radius > ONE_LEVEL { LEVELS } else { 1 }
    }

    /// What makes an entity see it.
    pub(crate) fn viewer(&self) -> TerrainViewer {
        TerrainViewer::new(self.radius).with_height(self.radius.min(HEIGHT))
    }
}

pub(crate) fn plugin(app: &mut App) {
    app.add_systems(Startup, spawn_terrain).add_systems(Update, follow_world.run_if(resource_changed::<World>));
}

fn spawn_terrain(world: Res<World>, ground: Res<Ground>, mut commands: Commands) -> Result {
    commands.spawn((world.terrain()?, MeshMaterial3d(ground.0.clone())));
    Ok(())
}

/// Keeps viewers, cameras and the scene as the world wants them.
fn follow_world(
    world: Res<World>,
    mut scene: ResMut<Scene>,
    mut viewers: Query<(&mut TerrainViewer, Option<&mut Projection>)>,
    mut terrains: Query<&mut Terrain>,
) {
    for mut terrain in &mut terrains {
        if terrain.levels.count != world.levels() {
            terrain.levels.count = world.levels();
        }
    }
    let end = Some(FADED * world.radius);
    // Shadows farther away than this would be coarse ones near by.
    let size = 0.4 * world.radius.min(SHADOWS);
    *scene = Scene { look: world.look, relief: RELIEF, size, end };
    for (mut viewer, projection) in &mut viewers {
        viewer.set_if_neq(world.viewer());
        if let Some(Projection::Perspective(mut perspective)) = projection.as_deref().cloned() {
            perspective.far = 1.5 * world.radius;
            if let Some(mut projection) = projection {
                *projection = Projection::Perspective(perspective);
            }
        }
    }
}
