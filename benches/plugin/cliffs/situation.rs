//! [`Bench`] and [`Row`]: how long situations run, and the rows that they return.

use std::fmt;

use bevy_marchless::prelude::*;
use bevy_math::Vec3;
use bevy_transform::components::Transform;
use marchless_plugin_benches::{Game, PACE, Times, milliseconds};

/// The mode of a run: situations are measured, or only tried out.
pub(crate) struct Bench {
    pub(crate) test: bool,
}

impl Bench {
    /// The number of updates, rays or the like to measure: `count`, or a few if situations are only tried out.
    pub(crate) fn count(&self, count: u32) -> u32 {
        if self.test { count.min(20) } else { count }
    }

    /// A game with this terrain and no viewer.
    pub(crate) fn game(&self, terrain: Terrain) -> Game {
        Game::new(terrain, !self.test)
    }

    /// Lets the terrain settle, unmeasured, within a minute.
    pub(crate) fn settle(&self, game: &mut Game) {
        game.settle(self.count(60 * PACE));
    }
}

/// One row of the table.
pub(crate) struct Row {
    situation: String,
    times: Times,
    figure: String,
}

impl Row {
    pub(crate) fn new(situation: impl Into<String>, times: Times) -> Self {
        Self { situation: situation.into(), times, figure: String::new() }
    }

    /// The row with a figure in another unit.
    pub(crate) fn with_figure(self, figure: impl Into<String>) -> Self {
        Self { figure: figure.into(), ..self }
    }

    /// The row with the number of updates until the situation's end, and whether it was reached.
    pub(crate) fn with_updates_until(self, what: &str, reached: bool) -> Self {
        let more = if reached { "" } else { "> " };
        let figure = format!("{what} after {more}{} updates", self.times.count());
        self.with_figure(figure)
    }

    /// The table's head.
    pub(crate) fn head() -> Vec<String> {
        ["situation", "measured", "mean", "p99", "max", "figure"].map(str::to_owned).to_vec()
    }

    pub(crate) fn cells(&self) -> Vec<String> {
        vec![
            self.situation.clone(),
            self.times.count().to_string(),
            milliseconds(self.times.mean()),
            milliseconds(self.times.quantile(0.99)),
            milliseconds(self.times.max()),
            self.figure.clone(),
        ]
    }
}

impl fmt::Display for Row {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.cells().join(" | "))
    }
}

/// Some metres above the hills, over a column.
pub(crate) fn above(x: f32, z: f32) -> Transform {
    Transform::from_translation(Vec3::new(x, 80.0, z))
}

/// Runs updates, each after a change, until `done` or for at most `most` updates. Also returns whether `done` was
/// reached.
pub(crate) fn updates_until(
    game: &mut Game,
    most: u32,
    mut change: impl FnMut(&mut Game),
    mut done: impl FnMut(&mut Game) -> bool,
) -> (Times, bool) {
    let mut times = Vec::new();
    let mut reached = false;
    while !reached && times.len() < most as usize {
        change(game);
        times.push(game.update());
        reached = done(game);
    }
    (times.into_iter().collect(), reached)
}
