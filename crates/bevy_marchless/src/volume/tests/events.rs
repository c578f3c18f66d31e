//! [`Event`]: what happens to a terrain, at random.

use proptest::prelude::*;

/// What happens to a terrain. Lengths in chunks.
#[derive(Clone, Debug)]
pub(super) enum Event {
    View {
        viewer: u32,
        view: Option<([f64; 3], f64, f64, Option<f64>)>,
    },
    QuantisedStamp {
        center: [f64; 3],
        radius: f64,
        add: bool,
    },
    Despawn {
        index: usize,
    },
    Source {
        shift: f64,
    },
    Colors,
    Normals,
    Isovalue {
        isovalue: f32,
    },
    /// The dual mesher with these steps of smoothing, or the primal one.
    Mesher {
        smoothing: Option<u32>,
    },
    Extent {
        index: usize,
    },
    Update {
        jobs: usize,
        inline: usize,
        late: bool,
    },
}

pub(super) fn event() -> impl Strategy<Value = Event> {
    let place = || (-3.0..4.0f64, -1.5..1.5f64, -3.0..4.0f64).prop_map(|(x, y, z)| [x, y, z]);
    let view = (place(), 0.2..2.4f64, 0.0..1.2f64, prop::option::of(0.0..1.5f64));
    prop_oneof![
        4 => (0u32..3, prop::option::weighted(0.8, view)).prop_map(|(viewer, view)| Event::View { viewer, view }),
        6 => (place(), 0.1..1.5f64, any::<bool>())
            .prop_map(|(center, radius, add)| Event::QuantisedStamp { center, radius, add }),
        1 => (0usize..100).prop_map(|index| Event::Despawn { index }),
        1 => (-4.0..4.0f64).prop_map(|shift| Event::Source { shift }),
        1 => Just(Event::Colors),
        1 => Just(Event::Normals),
        1 => (-1.5f32..1.5).prop_map(|isovalue| Event::Isovalue { isovalue }),
        1 => mesher(),
        2 => (0usize..4).prop_map(|index| Event::Extent { index }),
        12 => (0usize..30, prop_oneof![Just(0usize), Just(8)], any::<bool>())
            .prop_map(|(jobs, inline, late)| Event::Update { jobs, inline, late }),
    ]
}

fn mesher() -> impl Strategy<Value = Event> {
    prop::option::of(prop_oneof![Just(0u32), 1..7u32]).prop_map(|smoothing| Event::Mesher { smoothing })
}

/// An event that leaves all chunks where they are, and all that is drawn one surface.
pub(super) fn event_of_surface() -> impl Strategy<Value = Event> {
    prop_oneof![
        // Small ones at any distance from borders: many reach just as far as the meshes of one mesher read.
        6 => ((-2.2..2.2f64, -1.2..1.2f64, -2.2..2.2f64), 0.05..0.4f64, any::<bool>())
            .prop_map(|((x, y, z), radius, add)| Event::QuantisedStamp { center: [x, y, z], radius, add }),
        1 => Just(Event::Colors),
        1 => Just(Event::Normals),
        2 => (-1.5f32..1.5).prop_map(|isovalue| Event::Isovalue { isovalue }),
        4 => mesher(),
        12 => (0usize..12, prop_oneof![Just(0usize), Just(8)], any::<bool>())
            .prop_map(|(jobs, inline, late)| Event::Update { jobs, inline, late }),
    ]
}
