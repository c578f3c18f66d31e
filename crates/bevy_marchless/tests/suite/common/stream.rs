//! What the tests of streaming share: a cheap world, random flights through it, a check of the cover in every update, and
//! what a world that nobody flew through would show.
#![allow(unused_imports, reason = "each test uses a part of it")]

mod cover;
mod fresh;
mod hills;
mod journey;

pub use cover::{Cover, View};
pub use fresh::Fresh;
pub use hills::Hills;
pub use journey::{Flight, Leg, legs, legs_of_seed};
