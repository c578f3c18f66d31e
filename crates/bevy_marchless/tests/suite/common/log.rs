//! Records the plugin's log messages.

use std::sync::Mutex;

use bevy_log::tracing::field::{Field, Visit};
use bevy_log::tracing::{self, Event, Level, Subscriber};
use bevy_log::tracing_subscriber::layer::{Context, Layer, SubscriberExt as _};

/// The plugin's warnings and errors.
static LOG: Mutex<Vec<String>> = Mutex::new(Vec::new());

struct Recorder;

impl<S: Subscriber> Layer<S> for Recorder {
    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        let ours = event.metadata().target().starts_with("bevy_marchless");
        if ours && *event.metadata().level() <= Level::WARN {
            let mut message = Message::default();
            event.record(&mut message);
            LOG.lock().unwrap().push(message.0);
        }
    }
}

#[derive(Default)]
struct Message(String);

impl Visit for Message {
    fn record_debug(&mut self, field: &Field, value: &dyn core::fmt::Debug) {
        if field.name() == "message" {
            self.0 = format!("{value:?}");
        }
    }
}

/// Starts recording. A process has one log, so a file may have one test that records.
pub fn record() {
    let log = bevy_log::tracing_subscriber::registry().with(Recorder);
    tracing::subscriber::set_global_default(log).expect("no other log");
}

/// Takes the messages since the last call.
pub fn said() -> Vec<String> {
    core::mem::take(&mut LOG.lock().unwrap())
}
