//! Shared code of the plugin's benches: a headless game whose updates are timed, worlds for it, and reports.

mod clock;
mod game;
mod report;
mod request;
mod times;
mod world;

pub use clock::{resident_bytes, thread_time};
pub use game::{Game, PACE};
pub use report::{machine, milliseconds, print_and_record, processor};
pub use request::Request;
pub use times::Times;
pub use world::World;
