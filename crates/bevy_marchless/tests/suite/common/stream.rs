//! Shared by the tests of streaming: a cheap terrain, random flights through it, a check of the cover in every update,
//! and a fresh terrain to compare with.
#![allow(unused_imports, reason = "each test uses a part of it")]

mod cover;
mod fresh;
mod hills;
mod journey;

pub use cover::{Cover, View};
pub use fresh::Fresh;
pub use hills::Hills;
pub use journey::{Flight, Leg, legs, legs_of_seed};
