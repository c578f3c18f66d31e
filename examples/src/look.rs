//! [`Look`]: the colours, light and air of a scene, and [`LookPlugin`], which puts one on.

use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::light::CascadeShadowConfigBuilder;
use bevy::pbr::{DistanceFog, ExtendedMaterial, FogFalloff};
use bevy::prelude::*;
use bevy_marchless::prelude::Palette;

use crate::ground::{GroundExtension, GroundMaterial};
use crate::sky::{Sky, SkyMaterial};

/// The colours, light and air of a scene. Colours are sRGB.
#[derive(Clone, Copy, Debug)]
pub struct Look {
    /// What it is called.
    pub name: &'static str,
    /// The sky overhead.
    pub zenith: [f32; 3],
    /// The sky at the horizon; far things fade to it.
    pub horizon: [f32; 3],
    /// The sun's light.
    pub sun: [f32; 3],
    /// Where the sun stands: above the horizon and around it. [Units: degrees]
    pub sun_angles: [f32; 2],
    /// How bright the sun is. [Units: lux]
    pub illuminance: f32,
    /// How much light comes from the sky.
    pub skylight: f32,
    /// How much of the sky is clouds, 0 to 1.
    pub clouds: f32,
    /// How far one sees. [Units: world]
    pub visibility: f32,
    /// Meadows: fresh and dry.
    pub grass: [[f32; 3]; 2],
    /// Rock: its light and its dark layers.
    pub rock: [[f32; 3]; 2],
    /// The lowest ground.
    pub sand: [f32; 3],
    /// The highest ground.
    pub snow: [f32; 3],
    /// Where sand ends and where snow begins, as shares of the ground's relief.
    pub lines: [f32; 2],
}

/// The looks there are.
pub const LOOKS: [Look; 6] = [
    Look {
        name: "Alpine morning",
        zenith: [0.16, 0.36, 0.68],
        horizon: [0.70, 0.80, 0.90],
        sun: [1.0, 0.93, 0.82],
        sun_angles: [34.0, 62.0],
        illuminance: 13_000.0,
        skylight: 0.42,
        clouds: 0.45,
        visibility: 1_000.0,
        grass: [[0.22, 0.34, 0.13], [0.43, 0.41, 0.22]],
        rock: [[0.50, 0.47, 0.44], [0.30, 0.29, 0.29]],
        sand: [0.66, 0.60, 0.46],
        snow: [0.95, 0.97, 1.0],
        lines: [0.16, 0.74],
    },
    Look {
        name: "Golden evening",
        zenith: [0.26, 0.33, 0.52],
        horizon: [0.96, 0.72, 0.50],
        sun: [1.0, 0.72, 0.42],
        sun_angles: [17.0, 74.0],
        illuminance: 17_000.0,
        skylight: 0.41,
        clouds: 0.55,
        visibility: 900.0,
        grass: [[0.42, 0.43, 0.17], [0.62, 0.50, 0.24]],
        rock: [[0.60, 0.50, 0.42], [0.42, 0.34, 0.30]],
        sand: [0.72, 0.58, 0.40],
        snow: [0.97, 0.94, 0.92],
        lines: [0.14, 0.86],
    },
    Look {
        name: "Red desert",
        zenith: [0.20, 0.44, 0.70],
        horizon: [0.88, 0.80, 0.68],
        sun: [1.0, 0.90, 0.74],
        sun_angles: [30.0, 50.0],
        illuminance: 18_000.0,
        skylight: 0.45,
        clouds: 0.15,
        visibility: 700.0,
        grass: [[0.74, 0.48, 0.28], [0.80, 0.56, 0.34]],
        rock: [[0.72, 0.38, 0.22], [0.50, 0.24, 0.16]],
        sand: [0.86, 0.68, 0.44],
        snow: [0.86, 0.66, 0.46],
        lines: [0.30, 0.92],
    },
    Look {
        name: "Northern dawn",
        zenith: [0.15, 0.20, 0.42],
        horizon: [0.88, 0.70, 0.74],
        sun: [1.0, 0.76, 0.62],
        sun_angles: [15.0, 68.0],
        illuminance: 15_000.0,
        skylight: 0.51,
        clouds: 0.6,
        visibility: 600.0,
        grass: [[0.24, 0.31, 0.20], [0.42, 0.38, 0.28]],
        rock: [[0.44, 0.45, 0.50], [0.29, 0.30, 0.35]],
        sand: [0.46, 0.44, 0.42],
        snow: [0.93, 0.95, 1.0],
        lines: [0.10, 0.45],
    },
    Look {
        name: "Mars",
        zenith: [0.55, 0.40, 0.30],
        horizon: [0.86, 0.68, 0.50],
        sun: [1.0, 0.90, 0.80],
        sun_angles: [28.0, 60.0],
        illuminance: 15_000.0,
        skylight: 0.38,
        clouds: 0.0,
        visibility: 700.0,
        grass: [[0.60, 0.33, 0.20], [0.67, 0.41, 0.26]],
        rock: [[0.48, 0.29, 0.21], [0.33, 0.20, 0.16]],
        sand: [0.74, 0.47, 0.30],
        snow: [0.78, 0.60, 0.46],
        lines: [0.22, 0.88],
    },
    Look {
        name: "Highland summer",
        zenith: [0.22, 0.42, 0.66],
        horizon: [0.78, 0.84, 0.88],
        sun: [1.0, 0.95, 0.86],
        sun_angles: [42.0, 48.0],
        illuminance: 12_500.0,
        skylight: 0.42,
        clouds: 0.7,
        visibility: 750.0,
        grass: [[0.18, 0.31, 0.12], [0.40, 0.33, 0.24]],
        rock: [[0.44, 0.42, 0.40], [0.28, 0.27, 0.28]],
        sand: [0.52, 0.50, 0.36],
        snow: [0.60, 0.58, 0.54],
        lines: [0.12, 0.95],
    },
];

/// The materials of the examples, in order of their numbers.
pub const MATERIALS: [&str; 6] = ["ground", "rock", "sand", "clay", "snow", "moss"];

/// The material of the ground's surface, coloured by slope and height.
pub const GROUND: u8 = 0;
/// The material inside the ground.
pub const ROCK: u8 = 1;

impl Look {
    /// The colours of [`MATERIALS`]. Alpha is 0 where the ground's own colours by slope and height go.
    pub fn palette(&self) -> Palette {
        let clay = [0.62, 0.34, 0.24];
        let moss = [0.30, 0.42, 0.16];
        let colors = [self.grass[0], self.rock[0], self.sand, clay, [0.93, 0.95, 0.98], moss];
        Palette::new(colors.iter().enumerate().map(|(material, &[red, green, blue])| {
            Color::srgba(red, green, blue, if material == usize::from(GROUND) { 0.0 } else { 1.0 })
        }))
    }

    /// The direction towards the sun.
    pub fn to_sun(&self) -> Vec3 {
        let [elevation, azimuth] = self.sun_angles.map(f32::to_radians);
        Vec3::new(azimuth.sin() * elevation.cos(), elevation.sin(), azimuth.cos() * elevation.cos())
    }
}

/// Which of [`LOOKS`] the scene wears, and what it must fit. Changing it changes the scene.
#[derive(Resource, Clone, Copy, Debug)]
pub struct Scene {
    /// The index of the look.
    pub look: usize,
    /// The lowest and the highest ground. [Units: world]
    pub relief: [f32; 2],
    /// How large the scene is: shadows reach and fog begins as far. [Units: world]
    pub size: f32,
    /// Where the world ends, if it does while one looks: fog hides everything from there on. [Units: world from the
    /// camera]
    pub end: Option<f32>,
}

impl Default for Scene {
    fn default() -> Self {
        Self { look: 0, relief: [0.0, 100.0], size: 256.0, end: None }
    }
}

impl Scene {
    /// The look it wears.
    pub fn look(&self) -> &'static Look {
        &LOOKS[self.look % LOOKS.len()]
    }
}

/// The material of all ground.
#[derive(Resource)]
pub struct Ground(pub Handle<GroundMaterial>);

/// Spawns sky and sun, makes the [`Ground`] material and keeps them and every 3-D camera's fog as [`Scene`] wants them.
pub struct LookPlugin;

impl Plugin for LookPlugin {
    fn build(&self, app: &mut App) {
        app.add_plugins((crate::ground::plugin, crate::sky::plugin))
            .init_resource::<Scene>()
            .insert_resource(ClearColor(Color::BLACK))
            .insert_resource(GlobalAmbientLight::NONE)
            .add_systems(PreStartup, spawn_sun_and_ground)
            .add_systems(Update, wear_look.run_if(resource_changed::<Scene>));
        app.add_observer(|_: On<Add, Camera3d>, mut scene: ResMut<Scene>| scene.set_changed());
    }
}

fn spawn_sun_and_ground(mut commands: Commands, mut materials: ResMut<Assets<GroundMaterial>>) {
    commands.spawn(DirectionalLight { shadow_maps_enabled: true, ..default() });
    commands.insert_resource(Ground(materials.add(ExtendedMaterial {
        base: StandardMaterial { perceptual_roughness: 0.95, reflectance: 0.25, ..default() },
        extension: GroundExtension::default(),
    })));
}

fn wear_look(
    mut commands: Commands,
    scene: Res<Scene>,
    ground: Res<Ground>,
    mut grounds: ResMut<Assets<GroundMaterial>>,
    sky: Single<&MeshMaterial3d<SkyMaterial>, With<Sky>>,
    mut skies: ResMut<Assets<SkyMaterial>>,
    sun: Single<(Entity, &mut Transform, &mut DirectionalLight)>,
    cameras: Query<Entity, With<Camera3d>>,
) {
    let look = scene.look();
    let horizon = air(look.horizon);

    if let Some(mut material) = grounds.get_mut(&ground.0) {
        material.extension = GroundExtension::new(look, scene.relief);
    }
    if let Some(mut material) = skies.get_mut(*sky) {
        *material = SkyMaterial::new(look);
    }
    let (sun, mut transform, mut light) = sun.into_inner();
    *transform = Transform::IDENTITY.looking_to(-look.to_sun(), Vec3::Y);
    light.color = Color::from(linear(look.sun));
    light.illuminance = look.illuminance;
    let cascades = CascadeShadowConfigBuilder {
        num_cascades: 4,
        first_cascade_far_bound: scene.size * 0.15,
        maximum_distance: scene.size * 2.5,
        ..default()
    };
    commands.entity(sun).insert(cascades.build());

    let falloff = match scene.end {
        Some(end) => FogFalloff::Linear { start: 0.4 * end, end },
        None => FogFalloff::from_visibility_squared(look.visibility * scene.size / 256.0),
    };
    for camera in &cameras {
        let fog = DistanceFog {
            color: horizon.into(),
            directional_light_color: Color::from(linear(look.sun)).with_alpha(0.06),
            directional_light_exponent: 12.0,
            falloff: falloff.clone(),
        };
        commands.entity(camera).insert((fog, Tonemapping::AcesFitted));
    }
}

/// A colour of the sky, as bright as the tone mapping wants it.
pub(crate) fn air(color: [f32; 3]) -> LinearRgba {
    (linear(color) * 1.5).with_alpha(1.0)
}

/// A colour given in sRGB.
pub(crate) fn linear([red, green, blue]: [f32; 3]) -> LinearRgba {
    Color::srgb(red, green, blue).to_linear()
}
