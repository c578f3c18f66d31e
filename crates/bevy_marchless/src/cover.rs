//! [`Cover`]: from viewers to the chunks that are wanted, and what differs from before. Pure: it knows no entity but as a
//! viewer's id, and holds no chunk.

mod load_region;
mod queue;
mod rows;

use std::collections::{BTreeMap, BTreeSet};

use bevy_ecs::entity::Entity;
use bevy_math::IVec3;
use bevy_reflect::prelude::*;

pub(crate) use load_region::{LoadRegion, View};
pub(crate) use queue::{ChunkQueue, UniqueQueue};
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
pub(crate) enum Residency {
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
    views: BTreeMap<ViewId, TrackedView>,
    /// Those that are revealed in part.
    partial: BTreeSet<ViewId>,
    /// Whether some view has ever asked that samples are dropped: they have to come back some time.
    drops: bool,
}

/// A view, and how much of it has been told.
#[derive(Clone, Debug)]
struct TrackedView {
    view: View,
    borders: Borders,
    /// So large a part of its radii has been told, from the middle on: 0 at first, 1 for all.
    revealed: f64,
    /// How many chunks have not been told.
    hidden: usize,
}

impl TrackedView {
    /// The borders of what has been told.
    fn told(&self) -> Borders {
        if self.revealed > 0.0 { Borders::of(&self.view.within(self.revealed)) } else { Borders::default() }
    }
}

impl Cover {
    /// What one viewer sees.
    pub(crate) fn view(&self, id: ViewId) -> Option<&View> {
        Some(&self.views.get(&id)?.view)
    }

    /// Whether samples that are not needed for now may be dropped.
    pub(crate) const fn drops_samples(&self) -> bool {
        self.drops
    }

    /// Changes what one viewer sees; `None`: it is gone. `come` is told the chunks that may now be wanted more than
    /// before, and how much of them, `go` those that may be wanted less, and how much of them at most; some of them twice.
    ///
    /// Of a view that is new or differs a lot, nothing comes before it is [revealed](Self::reveal) ring by ring: it may
    /// have any number of chunks.
    pub(crate) fn set(
        &mut self,
        id: ViewId,
        view: Option<View>,
        come: impl FnMut([i32; 3], Residency),
        go: impl FnMut([i32; 3], Residency),
    ) {
        let old = self.views.remove(&id);
        let Some(view) = view else {
            self.partial.remove(&id);
            if let Some(old) = old {
                Borders::default().go(&old.borders, go);
            }
            return;
        };
        self.drops |= view.samples.is_some();
        let old = match old {
            Some(old) if view.has_borders_of(&old.view) => {
                self.views.insert(id, TrackedView { view, ..old });
                return;
            }
            old => old,
        };
        let borders = Borders::of(&view);
        let former = old.as_ref().filter(|old| view.is_near(&old.view));
        let revealed = former.map_or(0.0, |old| old.revealed);
        let mut hidden = 0;
        match former {
            Some(old) if revealed >= 1.0 => borders.come(&old.borders, come),
            Some(old) if revealed > 0.0 => {
                let now = Borders::of(&view.within(revealed));
                now.come(&old.told(), come);
                hidden = borders.len_beyond(&now);
            }
            _ => hidden = borders.len_beyond(&Borders::default()),
        }
        if revealed < 1.0 {
            self.partial.insert(id);
        }
        if let Some(old) = &old {
            borders.go(&old.borders, go);
        }
        self.views.insert(id, TrackedView { view, borders, revealed, hidden });
    }

    /// Whether all has been told of what viewers ask for.
    pub(crate) fn is_revealed(&self) -> bool {
        self.partial.is_empty()
    }

    /// The views that are revealed in part.
    pub(crate) fn partial(&self) -> impl Iterator<Item = ViewId> + '_ {
        self.partial.iter().copied()
    }

    /// Tells one ring more of a view that is revealed in part.
    pub(crate) fn reveal(&mut self, id: ViewId, come: impl FnMut([i32; 3], Residency)) {
        let Some(watched) = self.views.get_mut(&id) else { return };
        let before = watched.told();
        watched.revealed = watched.view.next_ring(watched.revealed);
        if watched.revealed < 1.0 {
            let now = watched.told();
            now.come(&before, come);
            watched.hidden = watched.borders.len_beyond(&now);
        } else {
            watched.borders.come(&before, come);
            watched.hidden = 0;
            self.partial.remove(&id);
        }
    }

    /// How many chunks viewers may ask for that have not been told.
    pub(crate) fn hidden(&self) -> usize {
        self.partial.iter().filter_map(|id| Some(self.views.get(id)?.hidden)).sum()
    }

    /// The chunks in range that have not been told.
    pub(crate) fn hidden_in_range(&self, mut take: impl FnMut([i32; 3])) {
        for watched in self.partial.iter().filter_map(|id| self.views.get(id)) {
            watched.borders.come(&watched.told(), |position, wanted| {
                if wanted == Residency::Mesh {
                    take(position);
                }
            });
        }
    }

    /// Whether a chunk is in range: to be drawn as soon as it can be.
    pub(crate) fn contains(&self, position: [i32; 3]) -> bool {
        self.near(position).any(|view| view.range.grown(0.0).contains(position))
    }

    /// What is asked of a chunk of which there is `now` so much. What a viewer's margin keeps is what is there.
    pub(crate) fn wanted(&self, position: [i32; 3], now: Residency) -> Residency {
        let asked = self.near(position).map(|view| {
            let grown = |by: f64| view.range.grown(by).contains(position);
            let stays = |by: f64| view.with_margin().grown(by).contains(position);
            if grown(0.0) || now == Residency::Mesh && stays(0.0) {
                Residency::Mesh
            } else if grown(1.0) || now >= Residency::Samples && stays(1.0) {
                Residency::Samples
            } else {
                Residency::Gone
            }
        });
        asked.max().unwrap_or(Residency::Gone)
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
        let views = self.views.iter().map(|(id, watched)| (id, &watched.view));
        let near = views.filter(|(_, view)| view.bounds().contains(position));
        near.map(|(id, view)| (*id, view.urgency(position))).min_by_key(|(_, urgency)| *urgency)
    }

    /// How urgent a chunk is for whoever sees it best: the lower, the sooner.
    pub(crate) fn urgency(&self, position: [i32; 3]) -> u32 {
        self.most_urgent(position).map_or(u32::MAX, |(_, urgency)| urgency)
    }

    /// How many chunks all viewers ask for together, or more where they see the same.
    pub(crate) fn size(&self) -> f64 {
        self.views.values().map(|watched| watched.view.range.box_size()).sum()
    }

    /// The views that may ask anything of a chunk.
    fn near(&self, position: [i32; 3]) -> impl Iterator<Item = &View> + '_ {
        self.views.values().map(|watched| &watched.view).filter(move |view| view.bounds().contains(position))
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use marchless::Region;
    use proptest::prelude::*;

    use super::*;

    const EXTENT: Region = Region { min: [-6, -4, -9], max: [7, 3, 9] };

    /// What a viewer is like: its place, its radii, its margin and within which radius samples stay.
    #[derive(Clone, Copy, Debug)]
    struct Viewer {
        middle: [f64; 3],
        radii: [f64; 3],
        is_box: bool,
        margin: f64,
        samples: Option<f64>,
    }

    impl Viewer {
        fn view(&self) -> View {
            let Self { middle, radii, is_box, margin, samples } = *self;
            let end = |sign: f64| [0, 1, 2].map(|axis| (middle[axis] + sign * radii[axis]).round() as i32);
            let range = if is_box {
                LoadRegion::of_box(Region::new(end(-1.0), end(1.0)), EXTENT)
            } else {
                LoadRegion::ellipsoid(middle, radii, EXTENT)
            };
            let samples = samples.map(|radius| LoadRegion::ellipsoid(range.middle(), [radius + 0.1; 3], EXTENT));
            View::new(range, margin, samples, [0.0; 3])
        }
    }

    fn viewer() -> impl Strategy<Value = Viewer> {
        let place = (prop::array::uniform3(-5.0..5.0f64), prop::array::uniform3(0.1..5.0f64));
        (place, any::<bool>(), 0.0..2.0f64, prop::option::of(0.0..4.0f64))
            .prop_map(|((middle, radii), is_box, margin, samples)| Viewer { middle, radii, is_box, margin, samples })
    }

    /// What happens to a viewer.
    #[derive(Clone, Debug)]
    enum Step {
        Becomes(Viewer),
        Moves([f64; 3]),
        Goes,
    }

    fn step() -> impl Strategy<Value = Step> {
        let moves = prop::array::uniform3(-1.0..1.0f64);
        prop_oneof![3 => viewer().prop_map(Step::Becomes), 6 => moves.prop_map(Step::Moves), 1 => Just(Step::Goes)]
    }

    /// Chunks that follow what they are told, as a terrain's do.
    #[derive(Default)]
    struct Followers {
        there: BTreeMap<[i32; 3], Residency>,
        /// Those that are to be looked at.
        told: BTreeSet<[i32; 3]>,
        /// Those whose samples have been asked for since they may have been dropped.
        sampled: BTreeSet<[i32; 3]>,
    }

    impl Followers {
        fn of(&self, position: [i32; 3]) -> Residency {
            self.there.get(&position).copied().unwrap_or(Residency::Gone)
        }

        fn come(&mut self, position: [i32; 3], wanted: Residency, drops: bool) {
            if drops || self.of(position) < wanted {
                self.told.insert(position);
            }
        }

        fn go(&mut self, position: [i32; 3], most: Residency, drops: bool) {
            if self.of(position) > if drops { Residency::Gone } else { most } {
                self.told.insert(position);
            }
        }

        fn reveal(&mut self, cover: &mut Cover) {
            let (partial, drops) = (cover.partial().collect::<Vec<_>>(), cover.drops_samples());
            for id in partial {
                cover.reveal(id, |position, wanted| self.come(position, wanted, drops));
            }
        }

        fn follow(&mut self, cover: &Cover) {
            for position in core::mem::take(&mut self.told) {
                self.there.insert(position, cover.wanted(position, self.of(position)));
                if cover.may_drop_samples(position) {
                    self.sampled.remove(&position);
                } else if cover.wants_samples(position) {
                    self.sampled.insert(position);
                }
            }
        }
    }

    proptest! {
        #[test]
        fn who_follows_what_it_is_told_is_as_it_is_wanted(
            steps in prop::collection::vec((0u32..3, step(), 0..7u32, any::<bool>()), 1..20),
        ) {
            let mut cover = Cover::default();
            let mut viewers = BTreeMap::new();
            let mut followers = Followers::default();
            for (viewer, step, rings, follows) in steps {
                match step {
                    Step::Becomes(settings) => _ = viewers.insert(viewer, settings),
                    Step::Moves(offset) => {
                        viewers.entry(viewer).and_modify(|settings: &mut Viewer| {
                            settings.middle = [0, 1, 2].map(|axis| settings.middle[axis] + offset[axis]);
                        });
                    }
                    Step::Goes => _ = viewers.remove(&viewer),
                }
                let view = viewers.get(&viewer).map(Viewer::view);
                let drops = cover.drops_samples() || view.is_some_and(|view| view.samples.is_some());
                let shared = core::cell::RefCell::new(&mut followers);
                cover.set(
                    Entity::from_raw_u32(viewer),
                    view,
                    |position, wanted| shared.borrow_mut().come(position, wanted, drops),
                    |position, most| shared.borrow_mut().go(position, most, drops),
                );
                (0..rings).for_each(|_| followers.reveal(&mut cover));
                if follows {
                    followers.follow(&cover);
                }
            }
            while !cover.is_revealed() {
                followers.reveal(&mut cover);
            }
            followers.follow(&cover);
            for position in EXTENT.grown(2, 2).points() {
                let now = followers.of(position);
                prop_assert_eq!(cover.wanted(position, now), now, "{:?}", position);
                if cover.drops_samples() {
                    let is_there = followers.sampled.contains(&position);
                    prop_assert!(is_there || !cover.wants_samples(position), "samples of {:?} are wanted", position);
                    let is_there = is_there && now > Residency::Gone;
                    prop_assert!(!is_there || !cover.may_drop_samples(position), "samples of {:?} stay", position);
                }
            }
        }

        #[test]
        fn bounds_hold_all_that_a_view_asks_for(viewer in viewer()) {
            let (mut cover, view) = (Cover::default(), viewer.view());
            cover.set(None, Some(view), |_, _| {}, |_, _| {});
            for position in EXTENT.grown(3, 3).points() {
                let asks = view.with_margin().grown(1.0).contains(position)
                    || view.samples.is_some_and(|range| range.widened(view.margin).grown(0.0).contains(position));
                prop_assert!(!asks || view.bounds().contains(position));
            }
        }
    }
}
