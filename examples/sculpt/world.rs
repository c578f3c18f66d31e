//! [`World`]: the settings of the terrain, and the terrain that follows them.

use std::error::Error;
use std::hash::{BuildHasher as _, Hasher as _, RandomState};

use bevy::math::DVec3;
use bevy::prelude::*;
use bevy_marchless::prelude::*;
use bevy_marchless::source::prelude::*;
use marchless_examples::camera::fly_camera;
use marchless_examples::look::{GROUND, Ground, LOOKS, ROCK, Scene};

use crate::args::Args;

/// What the terrain is made of. Changing it makes the terrain anew.
#[derive(Resource, Clone, Debug, PartialEq)]
pub(crate) struct World {
    /// Another number, another world.
    pub(crate) seed: u32,
    /// The distance between hills, or caves. [Units: voxels]
    pub(crate) zoom: f64,
    /// How many octaves of noise.
    pub(crate) octaves: u32,
    /// Where the surface lies. [Units: voxels]
    pub(crate) isovalue: f32,
    /// Which kind of source.
    pub(crate) kind: Kind,
    /// The index of its look.
    pub(crate) look: usize,
    /// The height map, if one was given.
    pub(crate) map: Option<Map>,
    /// How many times it was made anew, so that what was dug is gone even where nothing else differs.
    pub(crate) times: u32,
}

/// A height map and how large its voxels are.
#[derive(Clone, Debug)]
pub(crate) struct Map {
    source: HeightMap,
    /// [Units: metres]
    voxel_size: f32,
    extent: UVec3,
}

/// There is one map at most.
impl PartialEq for Map {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// Which kind of source.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Hills of noise.
    Hills,
    /// Hills with caves.
    Caves,
    /// The height map from the command line.
    HeightMap,
    /// Solids of geometry.
    Solids,
    /// Nothing, to draw in.
    Air,
}

impl Kind {
    /// Each with its name.
    pub(crate) const ALL: [(Self, &'static str); 5] = [
        (Self::Hills, "Hills"),
        (Self::Caves, "Caves"),
        (Self::HeightMap, "Height map"),
        (Self::Solids, "SDF scene"),
        (Self::Air, "Air"),
    ];
}

/// How deep the ground's own colours reach; below is rock. [Units: voxels]
const TOPSOIL: f64 = 2.0;
/// The middle height of hills, and how far they reach above and below at most. [Units: voxels]
const HILLS: [f64; 2] = [48.0, 76.0];

impl World {
    /// The world that the command line asks for.
    ///
    /// # Errors
    /// About a height map that cannot be loaded or does not fit.
    pub(crate) fn new(args: &Args) -> Result<Self, Box<dyn Error>> {
        let map = Map::new(args)?;
        let kind = if map.is_some() { Kind::HeightMap } else { Kind::Hills };
        let look = usize::from(args.look);
        let world = Self { seed: args.seed, zoom: 150.0, octaves: 6, isovalue: 0.0, kind, look, map, times: 0 };
        world.terrain()?.check()?;
        Ok(world)
    }

    /// The terrain made of it.
    ///
    /// # Errors
    /// [`SourceError`] about a number that is out of its range.
    pub(crate) fn terrain(&self) -> Result<Terrain, SourceError> {
        let terrain = match (self.kind, &self.map) {
            (Kind::HeightMap, Some(map)) => {
                Terrain::new(map.source.clone()).with_extent(map.extent).with_voxel_size(map.voxel_size)
            }
            (Kind::Hills, _) => Terrain::new(NoiseHeights::new(self.hills())?),
            (Kind::Caves, _) => Terrain::new(NoiseDensity::new(NoiseDensitySettings {
                noise: Fractal { zoom: 0.35 * self.zoom, octaves: self.octaves.min(3), ..self.hills().noise },
                threshold: 0.16,
                ground: Some(self.hills()),
                strata: strata(1.0),
            })?),
            (Kind::Solids, _) => Terrain::new(solids().validate()?),
            (Kind::Air | Kind::HeightMap, _) => Terrain::new(Air),
        };
        Ok(terrain.with_isovalue(self.isovalue).with_palette(LOOKS[self.look].palette()))
    }

    /// The heights between which its ground lies. [Units: voxels]
    pub(crate) fn relief(&self) -> [f32; 2] {
        match (self.kind, &self.map) {
            (Kind::HeightMap, Some(map)) => {
                [map.source.min_height(), map.source.max_height()].map(|height| height as f32 / map.voxel_size)
            }
            (Kind::Solids, _) => [10.0, 120.0],
            _ => [HILLS[0] - 0.5 * HILLS[1], HILLS[0] + 0.55 * HILLS[1]].map(|height| height as f32),
        }
    }

    /// Another world that looks otherwise.
    pub(crate) fn shuffle(&mut self) {
        self.seed = RandomState::new().build_hasher().finish() as u32;
        self.times += 1;
        self.look = (self.look + 1 + self.seed as usize % (LOOKS.len() - 1)) % LOOKS.len();
        // The others know no seed.
        if !matches!(self.kind, Kind::Hills | Kind::Caves) {
            self.kind = Kind::Hills;
        }
    }

    /// Makes it of nothing but air.
    pub(crate) fn clear(&mut self) {
        self.times += 1;
        self.kind = Kind::Air;
    }

    fn hills(&self) -> NoiseHeightsSettings {
        NoiseHeightsSettings {
            noise: Fractal { seed: self.seed, octaves: self.octaves, zoom: self.zoom, ..Fractal::default() },
            base: HILLS[0],
            amplitude: HILLS[1],
            strata: strata(1.0),
        }
    }
}

impl Map {
    /// The map that the command line asks for.
    fn new(args: &Args) -> Result<Option<Self>, Box<dyn Error>> {
        let (Some(path), Some(metres_per_pixel), Some(metres_per_unit)) =
            (&args.heightmap, args.metres_per_pixel, args.metres_per_unit)
        else {
            return Ok(None);
        };
        let settings = HeightMapSettings {
            metres_per_pixel,
            metres_per_unit,
            exaggeration: args.exaggerate,
            ..HeightMapSettings::default()
        };
        // The soil is as deep as voxels are large, which the map itself may decide.
        let source = HeightMap::from_path(path, settings.clone())?;
        let voxel_size = args.voxel_size.unwrap_or(source.default_voxel_size());
        let floor = Some(40.0 * voxel_size);
        let source = source.with_settings(HeightMapSettings { strata: strata(voxel_size), floor, ..settings })?;
        let extent = source.extent_in_chunks(voxel_size, marchless::DEFAULT_CHUNK_CELLS)?;
        if args.voxel_size.is_none() {
            println!("A voxel is {voxel_size:.1} m large, so that the longer side is 512 voxels.");
        }
        Ok(Some(Self { source, voxel_size: voxel_size as f32, extent }))
    }
}

/// The ground's own colours on top, rock below.
fn strata(voxel_size: f64) -> Vec<Stratum> {
    vec![Stratum { material: ROCK, below_depth: TOPSOIL * voxel_size, ..Stratum::default() }]
}

/// A meadow with an arch, a ring, a pierced ball and a stair.
fn solids() -> Sdf {
    let meadow = Sdf::cuboid(DVec3::new(128.0, 8.0, 128.0), DVec3::new(120.0, 10.0, 120.0)).with_material(GROUND);
    let arch = Sdf::torus(DVec3::new(84.0, 62.0, 96.0), 34.0, 9.0).with_material(ROCK);
    let pillars = Sdf::capsule(DVec3::new(84.0, 8.0, 62.0), DVec3::new(84.0, 62.0, 62.0), 8.0)
        .smooth_union(Sdf::capsule(DVec3::new(84.0, 8.0, 130.0), DVec3::new(84.0, 62.0, 130.0), 8.0), 6.0)
        .with_material(ROCK);
    let middle = DVec3::new(168.0, 62.0, 92.0);
    let ball = Sdf::sphere(middle, 40.0)
        .intersection(Sdf::cuboid(middle, DVec3::splat(33.0)))
        .with_material(3)
        .subtraction(Sdf::capsule(middle - DVec3::X * 60.0, middle + DVec3::X * 60.0, 17.0))
        .subtraction(Sdf::capsule(middle - DVec3::Y * 60.0, middle + DVec3::Y * 60.0, 17.0))
        .subtraction(Sdf::capsule(middle - DVec3::Z * 60.0, middle + DVec3::Z * 60.0, 17.0));
    let stair = (0..8).map(|step| {
        let height = 8.0 + 4.0 * f64::from(step);
        Sdf::cuboid(
            DVec3::new(70.0 + 12.0 * f64::from(step), 16.0 + 0.5 * height, 190.0),
            DVec3::new(6.0, height, 18.0),
        )
        .with_material(2)
    });
    let solids = meadow.smooth_union(pillars, 10.0).smooth_union(arch, 10.0).union(ball);
    stair.fold(solids, Sdf::union)
}

pub(crate) fn plugin(app: &mut App) {
    app.add_systems(Startup, spawn_world).add_systems(Update, follow_world.run_if(resource_changed::<World>));
}

fn spawn_world(world: Res<World>, ground: Res<Ground>, mut commands: Commands) {
    let Ok(terrain) = world.terrain() else { return };
    let size = terrain.size_in_voxels().as_vec3();
    let [low, high] = world.relief();
    let middle = Vec3::new(0.5 * size.x, low + 0.5 * (high - low), 0.5 * size.z);
    let reach = size.x.max(size.z);
    let eye = middle + reach * Vec3::new(-0.46, 0.185, 0.64);
    commands.spawn(fly_camera(eye, middle));
    commands.spawn((terrain, MeshMaterial3d(ground.0.clone())));
}

/// Keeps the terrain and the scene as the world wants them; a voxel is one world unit whatever it stands for.
fn follow_world(
    world: Res<World>,
    mut made_of: Local<Option<World>>,
    mut scene: ResMut<Scene>,
    terrain: Single<(&mut Terrain, &mut Transform)>,
) {
    let (mut terrain, mut transform) = terrain.into_inner();
    // A new source fills the terrain anew, and what was dug is gone: not for the sake of another isovalue or look.
    let same_source =
        |made_of: &World| World { isovalue: made_of.isovalue, look: made_of.look, ..world.clone() } == *made_of;
    match world.terrain() {
        Ok(new) if made_of.as_ref().is_some_and(same_source) => {
            terrain.isovalue = new.isovalue;
            terrain.palette = new.palette;
        }
        Ok(new) => *terrain = new,
        Err(error) => error!("This world cannot be: {error}."),
    }
    *made_of = Some(world.clone());
    transform.scale = Vec3::splat(1.0 / terrain.voxel_size);
    let size = terrain.size_in_voxels().as_vec3();
    *scene = Scene { look: world.look, relief: world.relief(), size: size.x.max(size.z), ..default() };
}
