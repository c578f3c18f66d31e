//! [`build`]: an app with graphics, or the reason why there is none.

use core::fmt;
use std::panic::{self, AssertUnwindSafe};

use bevy::prelude::*;

/// Why an app has no graphics.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoGraphics {
    /// There is no display to open a window on.
    Display,
    /// There is no graphics adapter.
    Adapter,
}

impl fmt::Display for NoGraphics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Display => "there is no display to open a window on",
            Self::Adapter => "there is no graphics adapter",
        })
    }
}

impl core::error::Error for NoGraphics {}

/// Builds an app with `add_plugins`, which adds `DefaultPlugins`.
///
/// Bevy's window and render plugins panic where there is no display or no adapter; this says so instead.
///
/// # Errors
/// [`NoGraphics`] where the one or the other is missing. Any other panic goes on.
pub fn build(add_plugins: impl FnOnce(&mut App)) -> Result<App, NoGraphics> {
    let hook = panic::take_hook();
    panic::set_hook(Box::new(|_| {}));
    let built = panic::catch_unwind(AssertUnwindSafe(|| {
        let mut app = App::new();
        add_plugins(&mut app);
        app
    }));
    drop(panic::take_hook());
    panic::set_hook(hook);

    built.map_err(|payload| {
        let message = payload.downcast_ref::<String>().map(String::as_str);
        let message = message.or_else(|| payload.downcast_ref::<&str>().copied()).unwrap_or_default();
        if message.contains("event loop") {
            NoGraphics::Display
        } else if message.contains("Unable to find a GPU") {
            NoGraphics::Adapter
        } else {
            // The hook has kept silent about it.
            eprintln!("{message}");
            panic::resume_unwind(payload)
        }
    })
}
