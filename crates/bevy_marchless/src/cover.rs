//! [`Cover`]: from viewers to the chunks that are wanted, and what differs from before. Pure: it knows no entity but as a
//! viewer's id, and holds no chunk.

mod queue;
mod range;
mod rows;

use std::collections::BTreeMap;

use bevy_ecs::entity::Entity;
use bevy_math::IVec3;
use bevy_reflect::prelude::*;

pub(crate) use queue::{ChunkQueue, UniqueQueue};
pub(crate) use range::{Range, View};
use rows::Borders;

/// What a terrain shows at one place: one piece of its cover.
#[derive(Reflect, Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[reflect(Debug, PartialEq, Hash, Clone)]
pub struct Leaf {
    /// The level of detail; 0 is the finest, and at present there is no other.
    pub level: u8,
    /// The chunk's place, in chunks of this level.
    pub position: IVec3,
    /// What is shown of it.
    pub state: LeafState,
}

/// What is shown of a leaf.
#[derive(Reflect, Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[reflect(Debug, PartialEq, Hash, Clone)]
pub enum LeafState {
    /// Not filled or not meshed yet.
    Waiting,
    /// Known to have no surface.
    Empty,
    /// Its mesh.
    Drawn,
}

/// How many leaves of each state a terrain has.
#[derive(Reflect, Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[reflect(Default, Debug, PartialEq, Hash, Clone)]
pub struct Coverage {
    /// See [`LeafState::Waiting`].
    pub waiting: usize,
    /// See [`LeafState::Empty`].
    pub empty: usize,
    /// See [`LeafState::Drawn`].
    pub drawn: usize,
}

/// What viewers ask of a chunk.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Wanted {
    /// Nothing.
    Gone,
    /// Its samples, for the meshes of its neighbours.
    Samples,
    /// Its mesh.
    Mesh,
}

/// Who asks for chunks: a viewer's entity, or `None` for what the terrain keeps whoever looks.
pub(crate) type ViewId = Option<Entity>;

/// What all viewers of one terrain see.
#[derive(Clone, Debug, Default)]
pub(crate) struct Cover {
    views: BTreeMap<ViewId, View>,
    borders: BTreeMap<ViewId, Borders>,
    /// Whether some view has ever asked that samples are dropped: they have to come back some time.
    drops: bool,
}

impl Cover {
    /// What one viewer sees.
    pub(crate) fn view(&self, id: ViewId) -> Option<&View> {
        self.views.get(&id)
    }

    /// Whether samples that are not needed for now may be dropped.
    pub(crate) const fn drops_samples(&self) -> bool {
        self.drops
    }

    /// Changes what one viewer sees; `None`: it is gone. `come` is told the chunks that may now be wanted more than
    /// before, and how much of them, `go` those that may be wanted less; some of them twice.
    pub(crate) fn set(
        &mut self,
        id: ViewId,
        view: Option<View>,
        come: impl FnMut([i32; 3], Wanted),
        go: impl FnMut([i32; 3]),
    ) {
        let old = match view {
            Some(view) => self.views.insert(id, view),
            None => self.views.remove(&id),
        };
        self.drops |= view.is_some_and(|view| view.samples.is_some());
        if view.zip(old).is_some_and(|(view, old)| view.has_borders_of(&old)) {
            return;
        }
        let borders = view.as_ref().map(Borders::of).unwrap_or_default();
        let before = self.borders.remove(&id).unwrap_or_default();
        borders.come(&before, come);
        borders.go(&before, go);
        if view.is_some() {
            self.borders.insert(id, borders);
        }
    }

    /// All chunks of which a viewer may want more than nothing.
    pub(crate) fn list(&self, id: ViewId, come: impl FnMut([i32; 3], Wanted)) {
        if let Some(borders) = self.borders.get(&id) {
            borders.come(&Borders::default(), come);
        }
    }

    /// Whether a chunk is in range: to be drawn as soon as it can be.
    pub(crate) fn contains(&self, position: [i32; 3]) -> bool {
        self.near(position).any(|view| view.range.grown(0.0).contains(position))
    }

    /// What is asked of a chunk of which there is `now` so much. What a viewer's margin keeps is what is there.
    pub(crate) fn wanted(&self, position: [i32; 3], now: Wanted) -> Wanted {
        let asked = self.near(position).map(|view| {
            let grown = |by: f64| view.range.grown(by).contains(position);
            let stays = |by: f64| view.with_margin().grown(by).contains(position);
            if grown(0.0) || now == Wanted::Mesh && stays(0.0) {
                Wanted::Mesh
            } else if grown(1.0) || now >= Wanted::Samples && stays(1.0) {
                Wanted::Samples
            } else {
                Wanted::Gone
            }
        });
        asked.max().unwrap_or(Wanted::Gone)
    }

    /// Whether samples are to be there, where they have been dropped.
    pub(crate) fn wants_samples(&self, position: [i32; 3]) -> bool {
        self.near(position).any(|view| match view.samples {
            Some(range) => range.grown(0.0).contains(position),
            None => view.range.grown(1.0).contains(position),
        })
    }

    /// Whether samples that are there may be dropped.
    pub(crate) fn may_drop_samples(&self, position: [i32; 3]) -> bool {
        !self.near(position).any(|view| match view.samples {
            Some(range) => range.widened(view.margin).grown(0.0).contains(position),
            None => view.with_margin().grown(1.0).contains(position),
        })
    }

    /// The viewer to which a chunk matters most, and how urgent it is there: the lower, the sooner.
    pub(crate) fn most_urgent(&self, position: [i32; 3]) -> Option<(ViewId, u32)> {
        let near = self.views.iter().filter(|(_, view)| view.bounds().contains(position));
        near.map(|(id, view)| (*id, view.urgency(position))).min_by_key(|(_, urgency)| *urgency)
    }

    /// How urgent a chunk is for whoever sees it best: the lower, the sooner.
    pub(crate) fn urgency(&self, position: [i32; 3]) -> u32 {
        self.most_urgent(position).map_or(u32::MAX, |(_, urgency)| urgency)
    }

    /// How many chunks all viewers ask for together, or more where they see the same.
    pub(crate) fn size(&self) -> f64 {
        self.views.values().map(|view| view.range.box_size()).sum()
    }

    /// The views that may ask anything of a chunk.
    fn near(&self, position: [i32; 3]) -> impl Iterator<Item = &View> + '_ {
        self.views.values().filter(move |view| view.bounds().contains(position))
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use marchless::Region;
    use proptest::prelude::*;

    use super::*;

    const EXTENT: Region = Region { min: [-6, -4, -9], max: [7, 3, 9] };

    fn view() -> impl Strategy<Value = View> {
        let range = (prop::array::uniform3(-5.0..5.0f64), prop::array::uniform3(0.1..5.0f64))
            .prop_map(|(middle, radii)| Range::ellipsoid(middle, radii, EXTENT));
        let boxed = (prop::array::uniform3(-6..6i32), prop::array::uniform3(0..5i32))
            .prop_map(|(min, size)| Range::of_box(Region::new(min, [0, 1, 2].map(|i| min[i] + size[i])), EXTENT));
        let samples = prop::option::of(0.0..4.0f64);
        (prop_oneof![range, boxed], 0.0..2.0f64, samples).prop_map(|(range, margin, samples)| {
            let samples = samples.map(|radius| Range::ellipsoid(range.middle(), [radius + 0.1; 3], EXTENT));
            View::new(range, margin, samples, [0.0; 3])
        })
    }

    proptest! {
        #[test]
        fn changes_hold_every_chunk_of_which_more_or_less_is_wanted(
            steps in prop::collection::vec((0u32..4, prop::option::weighted(0.8, view())), 1..12),
        ) {
            let mut cover = Cover::default();
            for (viewer, view) in steps {
                let id = Entity::from_raw_u32(viewer);
                let before = cover.clone();
                let (mut come, mut gone) = (BTreeSet::new(), BTreeSet::new());
                cover.set(id, view, |position, wanted| { come.insert((position, wanted)); }, |position| { gone.insert(position); });
                for position in EXTENT.grown(2, 2).points() {
                    for now in [Wanted::Gone, Wanted::Samples, Wanted::Mesh] {
                        let wanted = cover.wanted(position, now);
                        if before.wanted(position, now) == now && wanted != now {
                            let is_told = if wanted > now { come.contains(&(position, wanted)) } else { gone.contains(&position) };
                            prop_assert!(is_told, "{:?}: {:?}, not {:?}", position, wanted, now);
                        }
                    }
                    if !before.wants_samples(position) && cover.wants_samples(position) {
                        prop_assert!(come.contains(&(position, Wanted::Samples)), "samples of {:?} are wanted again", position);
                    }
                    if !before.may_drop_samples(position) && cover.may_drop_samples(position) {
                        prop_assert!(gone.contains(&position), "samples of {:?} may be dropped", position);
                    }
                }
            }
        }

        #[test]
        fn bounds_hold_all_that_a_view_asks_for(view in view()) {
            let mut cover = Cover::default();
            cover.set(None, Some(view), |_, _| {}, |_| {});
            for position in EXTENT.grown(3, 3).points() {
                let asks = view.with_margin().grown(1.0).contains(position)
                    || view.samples.is_some_and(|range| range.widened(view.margin).grown(0.0).contains(position));
                prop_assert!(!asks || view.bounds().contains(position));
            }
        }
    }
}
