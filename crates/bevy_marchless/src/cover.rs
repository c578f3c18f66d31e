//! [`Cover`]: turns viewers into wanted chunks, and reports what differs from before. It is pure: it knows entities only as
//! the ids of viewers, and holds no chunk.

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

/// One leaf of a terrain's cover: a place, and what is shown there.
#[derive(Reflect, Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[reflect(Debug, PartialEq, Hash, Clone)]
pub struct Leaf {
    /// The level of detail; 0 is the finest. A chunk of level `k` is as wide as 2ᵏ chunks of level 0.
    pub level: u8,
    /// The chunk's position, in chunks of this level.
    pub position: IVec3,
    /// The state of the leaf.
    pub state: LeafState,
}

/// How far a leaf is from being shown.
#[derive(Reflect, Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[reflect(Debug, PartialEq, Hash, Clone)]
pub enum LeafState {
    /// Not filled or not meshed yet.
    Waiting,
    /// Nothing is drawn: there is no surface, or the game has despawned the chunk's entity.
    Empty,
    /// Its mesh.
    Drawn,
}

/// The numbers of a terrain's leaves in each state.
#[derive(Reflect, Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[reflect(Default, Debug, PartialEq, Hash, Clone)]
pub struct Coverage {
    /// Leaves that are [`LeafState::Waiting`].
    pub waiting: usize,
    /// Leaves that are [`LeafState::Empty`].
    pub empty: usize,
    /// Leaves that are [`LeafState::Drawn`].
    pub drawn: usize,
}

/// The part of a chunk that viewers need.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Residency {
    /// Nothing.
    Gone,
    /// Its samples, for the meshes of its neighbours.
    Samples,
    /// Its mesh.
    Mesh,
}

/// The owner of a view: a viewer's entity, or `None` for the chunks that the terrain always keeps.
pub(crate) type ViewId = Option<Entity>;

/// The views of all viewers of one terrain.
#[derive(Clone, Debug, Default)]
pub(crate) struct Cover {
    views: BTreeMap<ViewId, TrackedView>,
    /// The views that are only partly revealed.
    partial: BTreeSet<ViewId>,
    /// Whether any view has ever allowed samples to be dropped: dropped samples have to come back some time.
    drops: bool,
}

/// A view, and the part of it that has been reported.
#[derive(Clone, Debug)]
struct TrackedView {
    view: View,
    borders: Borders,
    /// The part of its radii that has been reported, from the middle outwards: 0 at first, 1 for all.
    revealed: f64,
    /// The number of chunks that have not been reported.
    hidden: usize,
}

impl TrackedView {
    /// The borders of the reported part.
    fn reported_borders(&self) -> Borders {
        if self.revealed > 0.0 { Borders::of(&self.view.within(self.revealed)) } else { Borders::default() }
    }
}

impl Cover {
    /// The view of one viewer.
    pub(crate) fn view(&self, id: ViewId) -> Option<&View> {
        Some(&self.views.get(&id)?.view)
    }

    /// All views.
    pub(crate) fn views(&self) -> impl Iterator<Item = (ViewId, View)> + '_ {
        self.views.iter().map(|(id, tracked)| (*id, tracked.view))
    }

    /// Changes the view of one viewer, for the urgency of chunks alone: no chunk is reported.
    pub(crate) fn set_quietly(&mut self, id: ViewId, view: Option<View>) {
        match view {
            Some(view) => {
                let tracked = TrackedView { view, borders: Borders::default(), revealed: 1.0, hidden: 0 };
                self.views.insert(id, tracked);
            }
            None => _ = self.views.remove(&id),
        }
    }

    /// Whether samples that nothing needs at present may be dropped.
    pub(crate) const fn drops_samples(&self) -> bool {
        self.drops
    }

    /// Changes the view of one viewer; `None` removes it. `entering` receives the chunks that may now be wanted more
    /// than before, each with the residency wanted. `leaving` receives those that may be wanted less, each with the most
    /// residency wanted. Some chunks are reported twice.
    ///
    /// Nothing of a view that is new or differs a lot is reported before it is [revealed](Self::reveal) ring by ring: it
    /// may have any number of chunks.
    pub(crate) fn set(
        &mut self,
        id: ViewId,
        view: Option<View>,
        entering: impl FnMut([i32; 3], Residency),
        leaving: impl FnMut([i32; 3], Residency),
    ) {
        let old = self.views.remove(&id);
        let Some(view) = view else {
            self.partial.remove(&id);
            if let Some(old) = old {
                Borders::default().report_leaving(&old.borders, leaving);
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
            Some(old) if revealed >= 1.0 => borders.report_entering(&old.borders, entering),
            Some(old) if revealed > 0.0 => {
                let now = Borders::of(&view.within(revealed));
                now.report_entering(&old.reported_borders(), entering);
                hidden = borders.len_beyond(&now);
            }
            _ => hidden = borders.len_beyond(&Borders::default()),
        }
        if revealed < 1.0 {
            self.partial.insert(id);
        }
        if let Some(old) = &old {
            borders.report_leaving(&old.borders, leaving);
        }
        self.views.insert(id, TrackedView { view, borders, revealed, hidden });
    }

    /// Whether everything in the views has been reported.
    pub(crate) fn is_revealed(&self) -> bool {
        self.partial.is_empty()
    }

    /// The views that are only partly revealed.
    pub(crate) fn partial(&self) -> impl Iterator<Item = ViewId> + '_ {
        self.partial.iter().copied()
    }

    /// Reports one more ring of a view that is only partly revealed.
    pub(crate) fn reveal(&mut self, id: ViewId, entering: impl FnMut([i32; 3], Residency)) {
        let Some(tracked) = self.views.get_mut(&id) else { return };
        let before = tracked.reported_borders();
        tracked.revealed = tracked.view.next_ring(tracked.revealed);
        if tracked.revealed < 1.0 {
            let now = tracked.reported_borders();
            now.report_entering(&before, entering);
            tracked.hidden = tracked.borders.len_beyond(&now);
        } else {
            tracked.borders.report_entering(&before, entering);
            tracked.hidden = 0;
            self.partial.remove(&id);
        }
    }

    /// An upper bound of the number of chunks in the views that have not been reported.
    pub(crate) fn hidden(&self) -> usize {
        self.partial.iter().filter_map(|id| Some(self.views.get(id)?.hidden)).sum()
    }

    /// The chunks in range that have not been reported.
    pub(crate) fn hidden_in_range(&self, mut take: impl FnMut([i32; 3])) {
        for tracked in self.partial.iter().filter_map(|id| self.views.get(id)) {
            tracked.borders.report_entering(&tracked.reported_borders(), |position, wanted| {
                if wanted == Residency::Mesh {
                    take(position);
                }
            });
        }
    }

    /// Whether a chunk is in range, so that it is drawn as soon as possible.
    pub(crate) fn contains(&self, position: [i32; 3]) -> bool {
        self.near(position).any(|view| view.range.grown(0.0).contains(position))
    }

    /// The residency that the views ask for, for a chunk that has residency `now`. A viewer's margin keeps the residency
    /// that a chunk has.
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

    /// Whether a chunk's dropped samples should be sampled again.
    pub(crate) fn wants_samples(&self, position: [i32; 3]) -> bool {
        self.near(position).any(|view| match view.samples {
            Some(range) => range.grown(0.0).contains(position),
            None => view.range.grown(1.0).contains(position),
        })
    }

    /// Whether a chunk's samples may be dropped.
    pub(crate) fn may_drop_samples(&self, position: [i32; 3]) -> bool {
        !self.near(position).any(|view| match view.samples {
            Some(range) => range.widened(view.margin).grown(0.0).contains(position),
            None => view.with_margin().grown(1.0).contains(position),
        })
    }

    /// The viewer for which a chunk is most urgent, and its urgency there: lower comes sooner.
    pub(crate) fn most_urgent(&self, position: [i32; 3]) -> Option<(ViewId, u32)> {
        let views = self.views.iter().map(|(id, tracked)| (id, &tracked.view));
        let near = views.filter(|(_, view)| view.bounds().contains(position));
        near.map(|(id, view)| (*id, view.urgency(position))).min_by_key(|(_, urgency)| *urgency)
    }

    /// The urgency of a chunk for the viewer that sees it best: lower comes sooner.
    pub(crate) fn urgency(&self, position: [i32; 3]) -> u32 {
        self.most_urgent(position).map_or(u32::MAX, |(_, urgency)| urgency)
    }

    /// An upper bound of the number of chunks in all views together; exact where views do not overlap.
    pub(crate) fn size(&self) -> f64 {
        self.views.values().map(|tracked| tracked.view.range.box_size()).sum()
    }

    /// The views that may ask for anything of a chunk.
    fn near(&self, position: [i32; 3]) -> impl Iterator<Item = &View> + '_ {
        self.views.values().map(|tracked| &tracked.view).filter(move |view| view.bounds().contains(position))
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use marchless::Region;
    use proptest::prelude::*;

    use super::*;

    const EXTENT: Region = Region { min: [-6, -4, -9], max: [7, 3, 9] };

    /// A viewer: its position, its radii, its margin and its sample radius.
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

    /// A change of one viewer.
    #[derive(Clone, Debug)]
    enum Step {
        Set(Viewer),
        Move([f64; 3]),
        Remove,
    }

    fn step() -> impl Strategy<Value = Step> {
        let moves = prop::array::uniform3(-1.0..1.0f64);
        prop_oneof![3 => viewer().prop_map(Step::Set), 6 => moves.prop_map(Step::Move), 1 => Just(Step::Remove)]
    }

    /// Chunks that follow the cover's reports, like those of a terrain.
    #[derive(Default)]
    struct Followers {
        residencies: BTreeMap<[i32; 3], Residency>,
        /// The reported chunks that have not followed yet.
        reported: BTreeSet<[i32; 3]>,
        /// The chunks whose samples were wanted again after they may have been dropped.
        sampled: BTreeSet<[i32; 3]>,
    }

    impl Followers {
        fn of(&self, position: [i32; 3]) -> Residency {
            self.residencies.get(&position).copied().unwrap_or(Residency::Gone)
        }

        fn enter(&mut self, position: [i32; 3], wanted: Residency, drops: bool) {
            if drops || self.of(position) < wanted {
                self.reported.insert(position);
            }
        }

        fn leave(&mut self, position: [i32; 3], most: Residency, drops: bool) {
            if self.of(position) > if drops { Residency::Gone } else { most } {
                self.reported.insert(position);
            }
        }

        fn reveal(&mut self, cover: &mut Cover) {
            let (partial, drops) = (cover.partial().collect::<Vec<_>>(), cover.drops_samples());
            for id in partial {
                cover.reveal(id, |position, wanted| self.enter(position, wanted, drops));
            }
        }

        fn follow(&mut self, cover: &Cover) {
            for position in core::mem::take(&mut self.reported) {
                self.residencies.insert(position, cover.wanted(position, self.of(position)));
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
        fn chunks_that_follow_all_reports_have_the_wanted_residency(
            steps in prop::collection::vec((0u32..3, step(), 0..7u32, any::<bool>()), 1..20),
        ) {
            let mut cover = Cover::default();
            let mut viewers = BTreeMap::new();
            let mut followers = Followers::default();
            for (viewer, step, rings, follows) in steps {
                match step {
                    Step::Set(settings) => _ = viewers.insert(viewer, settings),
                    Step::Move(offset) => {
                        viewers.entry(viewer).and_modify(|settings: &mut Viewer| {
                            settings.middle = [0, 1, 2].map(|axis| settings.middle[axis] + offset[axis]);
                        });
                    }
                    Step::Remove => _ = viewers.remove(&viewer),
                }
                let view = viewers.get(&viewer).map(Viewer::view);
                let drops = cover.drops_samples() || view.is_some_and(|view| view.samples.is_some());
                let shared = core::cell::RefCell::new(&mut followers);
                cover.set(
                    Entity::from_raw_u32(viewer),
                    view,
                    |position, wanted| shared.borrow_mut().enter(position, wanted, drops),
                    |position, most| shared.borrow_mut().leave(position, most, drops),
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
        fn bounds_hold_all_chunks_that_a_view_asks_for(viewer in viewer()) {
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
