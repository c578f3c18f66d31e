//! Code that the examples share: a camera to fly with, a look (sky, light, fog, colours), pictures without a window,
//! and the way to run without a screen.

pub mod camera;
pub mod files;
pub mod glb;
pub mod graphics;
pub mod ground;
mod indexed;
pub mod look;
pub mod picture;
pub mod sky;
pub mod small;
pub mod solid;
pub mod stage;

/// Compiles the README's example.
#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
pub struct Readme;
