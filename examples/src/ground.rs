//! [`GroundMaterial`]: ground coloured by slope and height, over the terrain's own colours.
//!
//! It reads the vertex colours that come from the terrain's palette. Where their alpha is 1 they show as they are, with
//! layers and grain; where it is 0, meadow, sand, snow and rock are mixed by slope and height.

use bevy::asset::uuid_handle;
use bevy::pbr::{ExtendedMaterial, MaterialExtension};
use bevy::prelude::*;
use bevy::render::render_resource::{AsBindGroup, ShaderType};
use bevy::shader::{Shader, ShaderRef};

use crate::look::{LOOKS, Look, air, linear};

/// Bevy's standard material with [`GroundExtension`].
pub type GroundMaterial = ExtendedMaterial<StandardMaterial, GroundExtension>;

/// What the ground's shader adds to the standard material.
#[derive(Asset, AsBindGroup, TypePath, Clone, Debug)]
pub struct GroundExtension {
    #[uniform(100)]
    ground: GroundUniform,
}

/// Colours are linear. The alpha of `sky` is how much light comes from it.
#[derive(ShaderType, Clone, Copy, Debug)]
struct GroundUniform {
    grass: Vec4,
    dry_grass: Vec4,
    rock: Vec4,
    dark_rock: Vec4,
    sand: Vec4,
    snow: Vec4,
    sky: Vec4,
    mist: Vec4,
    /// The lowest ground, the highest ground, the end of the sand and the beginning of the snow. [Units: world]
    heights: Vec4,
}

impl GroundExtension {
    /// The ground of `look`, between the heights of `relief` in world units.
    pub fn new(look: &Look, relief: [f32; 2]) -> Self {
        let color = |color: [f32; 3]| linear(color).to_vec4();
        let line = |share: f32| relief[0] + share * (relief[1] - relief[0]);
        let sky = air(look.zenith).mix(&air(look.horizon), 0.55);
        Self {
            ground: GroundUniform {
                grass: color(look.grass[0]),
                dry_grass: color(look.grass[1]),
                rock: color(look.rock[0]),
                dark_rock: color(look.rock[1]),
                sand: color(look.sand),
                snow: color(look.snow),
                sky: sky.to_vec4().with_w(look.skylight),
                mist: air(look.horizon).to_vec4(),
                heights: Vec4::new(relief[0], relief[1], line(look.lines[0]), line(look.lines[1])),
            },
        }
    }
}

impl Default for GroundExtension {
    fn default() -> Self {
        Self::new(&LOOKS[0], [0.0, 100.0])
    }
}

const SHADER: Handle<Shader> = uuid_handle!("6c1a5f0e-5d0b-4a57-9c40-7a8a3c1d52e1");
const NOISE: Handle<Shader> = uuid_handle!("0d6f8f0c-2d3b-4b8e-8d8c-1f2e7b1a9c34");

impl MaterialExtension for GroundExtension {
    fn fragment_shader() -> ShaderRef {
        SHADER.into()
    }
}

pub(crate) fn plugin(app: &mut App) {
    // Compiled into the program, so that it runs from anywhere, and there from the first frame on.
    let mut shaders = app.world_mut().resource_mut::<Assets<Shader>>();
    for (handle, source, path) in [
        (NOISE, include_str!("noise.wgsl"), "marchless_examples/noise.wgsl"),
        (SHADER, include_str!("ground.wgsl"), "marchless_examples/ground.wgsl"),
    ] {
        let inserted = shaders.insert(&handle, Shader::from_wgsl(source, path));
        debug_assert!(inserted.is_ok(), "the handle of {path} is not taken");
    }
    app.add_plugins(MaterialPlugin::<GroundMaterial>::default());
}
