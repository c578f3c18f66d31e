//! Colours, normals, isovalue and mesher change.
//!
//! New colours and normals *sweep* over the chunks one by one, since borders stay closed meanwhile. Colours need no new
//! geometry. Another isovalue or mesher moves the whole surface: all chunks are meshed beside the drawn ones, and swapped
//! in one update, the *transition*. A stamp meanwhile is shown with the former one, and its chunks are meshed again for
//! the new one. Settings that change before the transition ends wait for it, so that something is shown however often
//! they change.

use std::collections::HashMap;
use std::sync::Arc;

use bevy_platform::collections::HashSet;
use marchless::{MeshBuffer, MeshMethod};

use super::mesh::{PreparedGroup, Shown, is_uniform_around};
use super::{ChunkMesh, Colors, Group, Heart, Purpose};
use crate::chunk::ChunkKey;
use crate::cover::UniqueQueue;
use crate::jobs::{Ticket, new_number};

/// The appearance of meshes, apart from the isovalue and the mesher.
pub(super) struct Appearance {
    /// The number that tells appearances apart.
    pub(super) number: u64,
    pub(super) normals: bool,
    pub(super) colors: Colors,
}

impl Appearance {
    pub(super) fn new(normals: bool, colors: Colors) -> Self {
        Self { number: new_number(), normals, colors }
    }
}

impl Default for Appearance {
    fn default() -> Self {
        Self { number: 0, normals: true, colors: Arc::new([[1.0; 4]; 256]) }
    }
}

/// A running change of the isovalue or the mesher. Every shown leaf is waiting, lacks samples, is being meshed, or is done.
pub(super) struct Transition {
    method: MeshMethod,
    waiting: UniqueQueue,
    /// The leaves whose neighbours are not all filled.
    lacking: HashSet<ChunkKey>,
    /// The leaves that are being meshed, each with its job.
    running: HashMap<ChunkKey, (u64, Ticket)>,
    done: HashMap<ChunkKey, (ChunkMesh, u64)>,
}

impl Transition {
    pub(super) const fn method(&self) -> MeshMethod {
        self.method
    }

    pub(super) fn waiting(&self) -> usize {
        self.waiting.len() + self.lacking.len() + self.running.len()
    }
}

/// A chunk meshed for the isovalue or the mesher to come.
pub(crate) struct Restyled {
    pub(crate) job: u64,
    pub(crate) meshed: ChunkMesh,
    pub(crate) appearance: u64,
}

/// A chunk that is to get another appearance.
pub(crate) enum Restyle {
    /// The chunk needs another mesh.
    Mesh(PreparedGroup),
    /// The chunk keeps its geometry and needs other colours.
    Recolor(ChunkKey, Group, Arc<MeshBuffer>),
}

impl Heart {
    /// Changes the colours of meshes, and whether they have normals.
    pub(crate) fn set_appearance(&mut self, normals: bool, colors: Colors) {
        self.appearance = Appearance::new(normals, colors);
        let Self { table, to_restyle, .. } = self;
        table.entities().for_each(|(key, _)| to_restyle.push(key));
    }

    /// Whether chunks wait for another appearance, or a transition may go on.
    pub(super) fn has_to_restyle(&self) -> bool {
        !self.to_restyle.is_empty() || self.transition.is_some()
    }

    /// The next chunk that is to get another appearance; `None` if none is, or if `limit` groups that give way are
    /// under way. `assets`: whether there are meshes to be coloured.
    pub(crate) fn next_restyle(&mut self, limit: usize, assets: bool) -> Option<Restyle> {
        while self.groups.yielding() < limit {
            let key = self.to_restyle.pop()?;
            let Some(drawn) = self.table.drawn(key).filter(|drawn| drawn.appearance != self.appearance.number) else {
                continue;
            };
            if self.groups.is_pending(key) || self.groups.is_claimed(key) {
                continue; // It is visited again when it is shown.
            }
            let geometry = drawn.geometry.clone();
            if geometry.is_empty() || geometry.normals.is_empty() != self.appearance.normals {
                if geometry.is_empty() || !assets {
                    self.table.set_appearance(key, self.appearance.number);
                    continue;
                }
                let chunks = [key].into();
                let group = Group {
                    chunks,
                    snapshot: Default::default(),
                    appearance: self.appearance.number,
                    places: Default::default(),
                    since: None,
                    purpose: Purpose::Restyle,
                    members: 1,
                    meshed: Vec::new(),
                    tickets: Vec::new(),
                };
                return Some(Restyle::Recolor(key, group, geometry));
            }
            if let Some(prepared) = self.prepare_one(key, Purpose::Restyle) {
                return Some(Restyle::Mesh(prepared));
            }
        }
        None
    }

    /// Starts a group of one chunk with the job that colours its mesh.
    pub(crate) fn start_recolor(&mut self, group: Group, start: impl FnOnce(u64) -> Ticket) {
        let id = self.groups.start(group);
        let ticket = start(id);
        if let Some(group) = self.groups.get_mut(id) {
            group.tickets.push(ticket);
        }
    }

    /// Changes the isovalue and the mesher, once every drawn chunk has been meshed for them. `method` has normals.
    pub(crate) fn set_mesh_method(&mut self, method: MeshMethod) {
        match &self.transition {
            Some(transition) => self.next_method = Some(method).filter(|next| *next != transition.method),
            None if method != self.method => self.begin_transition(method),
            None => {}
        }
    }

    fn begin_transition(&mut self, method: MeshMethod) {
        let mut waiting = UniqueQueue::default();
        self.table.keys().filter(|key| self.table.is_shown(*key)).for_each(|key| waiting.push(key));
        if waiting.is_empty() {
            self.method = method;
            self.follow_method();
            self.restart_level_meshes();
            // Chunks that are being meshed for the first time have the former isovalue or mesher.
            self.restart_groups();
            return;
        }
        let (lacking, running, done) = (HashSet::default(), HashMap::new(), HashMap::new());
        self.transition = Some(Transition { method, waiting, lacking, running, done });
        self.follow_method();
    }

    /// Lets edits reach as far as meshes read: those that are drawn, and those to come.
    pub(super) fn follow_method(&mut self) {
        let widest = self.methods().max_by_key(MeshMethod::margins).unwrap_or(self.method);
        self.samples.set_mesh_method(widest);
    }

    /// The layers of chunks at the terrain's border whose meshes depend on where it is. Those of the dual mesher reach
    /// into a second one if chunks are small.
    pub(super) fn layers_at_border(&self) -> i32 {
        if self.methods().any(|method| matches!(method, MeshMethod::Dual(_))) { 2 } else { 1 }
    }

    /// The methods of the meshes that are drawn, and of those to come.
    fn methods(&self) -> impl Iterator<Item = MeshMethod> {
        [Some(self.method), self.transition.as_ref().map(Transition::method)].into_iter().flatten()
    }

    /// Takes in that a chunk's samples, or its shown state, have changed: its mesh for the isovalue and the mesher to come is
    /// out of date.
    pub(super) fn renew_in_transition(&mut self, key: ChunkKey) {
        if let Some(transition) = &mut self.transition
            && self.table.is_shown(key)
        {
            transition.running.remove(&key);
            transition.done.remove(&key);
            if !transition.lacking.contains(&key) {
                transition.waiting.push(key);
            }
        }
    }

    /// Takes in that a chunk is not drawn any more.
    pub(super) fn leave_transition(&mut self, key: ChunkKey) {
        if let Some(transition) = &mut self.transition {
            transition.running.remove(&key);
            transition.done.remove(&key);
            transition.lacking.remove(&key);
        }
    }

    /// Whether the transition waits for samples around a chunk.
    pub(super) fn transition_lacks(&self, key: ChunkKey) -> bool {
        self.transition.as_ref().is_some_and(|transition| transition.lacking.contains(&key))
    }

    /// Takes in samples that the transition may have waited for.
    pub(super) fn unblock_transition(&mut self, key: ChunkKey) {
        if let Some(transition) = self.transition.as_mut().filter(|transition| !transition.lacking.is_empty()) {
            for near in key.around().filter(|near| !self.table.lacks_samples(*near)) {
                if transition.lacking.remove(&near) {
                    transition.waiting.push(near);
                }
            }
        }
    }

    /// The next chunk to be meshed for the transition, while at most `limit` are under way: its job's number, and the
    /// settings of its mesh.
    pub(crate) fn next_in_transition(&mut self, limit: usize) -> Option<(ChunkKey, u64, MeshMethod)> {
        let normals = self.appearance.normals;
        loop {
            let transition = self.transition.as_mut().filter(|transition| transition.running.len() < limit)?;
            let key = transition.waiting.pop()?;
            if !self.table.is_shown(key) || matches!(self.table.shown(key), Some(super::table::Shown::Despawned)) {
                continue;
            }
            if self.table.lacks_samples(key) {
                transition.lacking.insert(key);
                self.look_at(key);
            } else if key.level == 0 && is_uniform_around(self.samples.newest(), key.position) {
                transition.done.insert(key, (ChunkMesh::empty(key), self.appearance.number));
            } else {
                return Some((key, new_number(), transition.method.with_normals(normals)));
            }
        }
    }

    /// The appearance that new meshes get.
    pub(crate) const fn appearance(&self) -> u64 {
        self.appearance.number
    }

    /// Notes that a chunk is being meshed for the transition.
    pub(crate) fn started_in_transition(&mut self, key: ChunkKey, job: u64, ticket: Ticket) {
        if let Some(transition) = &mut self.transition {
            transition.running.insert(key, (job, ticket));
        }
    }

    /// Takes in a chunk that a job has meshed for the transition.
    pub(crate) fn take_restyled(&mut self, restyled: Restyled) {
        let Restyled { job, meshed, appearance } = restyled;
        let key = meshed.key;
        if let Some(transition) = &mut self.transition
            && transition.running.get(&key).is_some_and(|(number, _)| *number == job)
        {
            transition.running.remove(&key);
            transition.done.insert(key, (meshed, appearance));
        }
    }

    /// Whether at most `inline` chunks are missing until the transition ends, and all of them can be meshed now. An edit
    /// that changes levels is shown before.
    pub(crate) fn may_end_transition(&self, inline: usize) -> bool {
        self.transition.as_ref().is_some_and(|transition| {
            transition.running.is_empty() && transition.lacking.is_empty() && transition.waiting.len() <= inline
        }) && !self.groups.makes_place()
    }

    /// Takes in a chunk that was meshed at once for the transition.
    pub(crate) fn meshed_in_transition(&mut self, meshed: ChunkMesh) {
        let appearance = self.appearance.number;
        if let Some(transition) = &mut self.transition {
            transition.done.insert(meshed.key, (meshed, appearance));
        }
    }

    /// Shows all chunks as meshed for the transition, if none is missing. They show the newest samples, including chunks
    /// that were still to be meshed with the former isovalue or mesher.
    pub(crate) fn end_transition(&mut self) -> Option<Shown> {
        let is_done = |transition: &mut Transition| transition.waiting() == 0;
        let Transition { method, done, .. } = self.transition.take_if(is_done)?;
        self.method = method;
        self.follow_method();
        self.restart_level_meshes();
        let mut shown = Shown::default();
        let groups = self.groups.take_all();
        for (_, (meshed, appearance)) in done {
            let key = meshed.key;
            if key.level == 0 {
                self.samples.show_newest(key.position);
            }
            shown.swaps.push(self.swap(meshed, appearance));
            if appearance != self.appearance.number {
                self.to_restyle.push(key);
            }
            self.may_drop_around(key);
        }
        for key in groups.iter().flat_map(|pending| &pending.chunks) {
            for near in key.around().filter(|near| near.level == 0 && self.table.contains(*near)) {
                self.samples.show_newest(near.position);
            }
            self.table.look_again(*key);
            if self.table.drawn(*key).is_some_and(|drawn| drawn.appearance != self.appearance.number) {
                self.to_restyle.push(*key);
            }
        }
        shown.since = groups.into_iter().filter_map(|pending| pending.since).collect();
        if let Some(next) = self.next_method.take() {
            self.set_mesh_method(next);
        }
        Some(shown)
    }

    /// Starts all groups again, with changed settings.
    fn restart_groups(&mut self) {
        for pending in self.groups.take_all() {
            pending.chunks.iter().for_each(|key| self.table.look_again(*key));
            if pending.since.is_some() {
                self.groups.add(pending);
            }
        }
    }
}
