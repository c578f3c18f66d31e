//! What the plugin's systems do in an update, without an app.

use std::time::Duration;

use bevy_platform::time::Instant;

use super::*;
use crate::jobs::{Priority, do_next};

impl Game {
    /// What the systems do in an update. `late`: there is no time.
    pub(super) fn run_systems(&mut self, jobs: usize, inline: usize, late: bool) {
        let now = Instant::now();
        let until = if late { now } else { now + Duration::from_millis(5) };
        self.heart.follow(until, &mut self.stats);
        self.take_released();
        self.heart.take_filled(1, until, |_| {});
        let results = self.heart.fill_results().clone();
        self.heart.ask_for_samples(16, |job| {
            let results = results.clone();
            self.queue.push(Priority::Fill(job.urgency), move || results.push(job.run()))
        });
        self.apply_stamps();
        if self.heart.has_to_plan() {
            let queue = &self.queue;
            self.heart.start_plan(|job, results| queue.push(Priority::Plan, move || results.push(job.run())));
        }
        self.mesh(inline, until);
        (0..jobs).for_each(|_| _ = do_next(&self.queue));
    }

    fn apply_stamps(&mut self) {
        let mut edits = Edits::default();
        while let Some(stamp) = self.waiting.first().copied() {
            if !self.heart.has_samples_for(stamp.region()) {
                break;
            }
            self.waiting.remove(0);
            // What lies wholly beyond the extent is not kept.
            let [low, high] = [stamp.region().min, stamp.region().max.map(|v| v - 1)];
            let [low, high] = [low, high].map(|end| end.map(|v| v.div_euclid(CELLS as i32)));
            let touched = Region::new(low, high.map(|v| v + 1)).intersection(&self.settings.extent);
            self.stamps.extend((!touched.is_empty()).then_some(stamp));
            self.heart.stamp(stamp, self.stats.now(), &mut edits);
        }
        self.heart.set_holds_stamps(!self.waiting.is_empty());
        let _ = (self.heart.take_late_edits(), self.heart.finish_edits(edits));
    }

    fn mesh(&mut self, inline: usize, until: Instant) {
        while let Some(group) = self.heart.take_meshed(|| Instant::now() < until, |_, _| {}) {
            let shown = self.heart.show(group);
            self.show(shown);
        }
        self.heart.take_plan();
        while let Some(prepared) = self.heart.next_changed() {
            if prepared.changed <= inline {
                self.show_now(prepared);
            } else {
                self.start(prepared, Priority::Edit);
            }
        }
        self.change_levels();
        self.heart.sort_ready(until);
        while let Some((prepared, urgency)) = self.heart.next_first_mesh(8) {
            self.start(prepared, Priority::FirstMesh(urgency));
        }
        while let Some(restyle) = self.heart.next_restyle(8, true) {
            match restyle {
                Restyle::Mesh(prepared) => self.start(prepared, Priority::Restyle),
                Restyle::Recolor(key, group, geometry) => {
                    let results = self.heart.mesh_results().clone();
                    self.heart.start_recolor(group, |id| {
                        self.queue.push(Priority::Restyle, move || {
                            let meshed = ChunkMesh { geometry, ..ChunkMesh::empty(key) };
                            results.push(MeshResult::OfGroup(id, meshed));
                        })
                    });
                }
            }
        }
        if self.heart.may_end_transition(inline) {
            while let Some((key, _, settings)) = self.heart.next_in_transition(usize::MAX) {
                let meshed = meshed(&self.heart.mesh_input(key), key, &settings);
                self.heart.meshed_in_transition(meshed);
            }
            let shown = self.heart.end_transition();
            shown.into_iter().for_each(|shown| self.show(shown));
        }
        while let Some((key, job, settings)) = self.heart.next_in_transition(8) {
            let input = self.heart.mesh_input(key);
            let (results, appearance) = (self.heart.mesh_results().clone(), self.heart.appearance());
            let ticket = self.queue.push(Priority::Restyle, move || {
                let meshed = meshed(&input, key, &settings);
                results.push(MeshResult::Restyled(Restyled { job, meshed, appearance }));
            });
            self.heart.started_in_transition(key, job, ticket);
        }
    }

    pub(super) fn take_released(&mut self) {
        for entity in self.heart.take_released() {
            assert!(self.screen.remove(&entity).is_some(), "released twice, or never shown");
        }
    }

    fn change_levels(&mut self) {
        while let Some((change, inputs)) = self.heart.next_level_change() {
            let settings = self.heart.mesh_settings();
            let at_once = inputs.iter().map(|(key, input)| meshed(input, *key, &settings)).collect();
            let shown = self.heart.show_level_change(change, at_once);
            self.show(shown);
        }
        self.heart.start_level_changes();
        while let Some(jobs) = self.heart.next_level_jobs(8) {
            let (change, attempt) = (jobs.change, jobs.attempt());
            let settings = self.heart.mesh_settings();
            let job = |(key, input)| {
                let results = self.heart.mesh_results().clone();
                self.queue.push(Priority::Level(change), move || {
                    let meshed = meshed(&input, key, &settings);
                    results.push(MeshResult::OfLevels(LevelJobs::result(change, attempt, meshed)));
                })
            };
            let tickets = jobs.inputs.into_iter().map(job).collect();
            self.heart.started_level_jobs(change, tickets);
        }
    }

    fn show_now(&mut self, prepared: PreparedGroup) {
        let PreparedGroup { mut group, to_mesh, .. } = prepared;
        let settings = self.heart.mesh_settings();
        for (key, input) in to_mesh {
            group.push(meshed(&input, key, &settings));
        }
        let shown = self.heart.show(group);
        self.show(shown);
    }

    fn start(&mut self, prepared: PreparedGroup, priority: Priority) {
        if prepared.to_mesh.is_empty() {
            return self.show_now(prepared);
        }
        let (results, settings) = (self.heart.mesh_results().clone(), self.heart.mesh_settings());
        self.heart.start(prepared, |id, key, input| {
            let results = results.clone();
            self.queue.push(priority, move || {
                results.push(MeshResult::OfGroup(id, meshed(&input, key, &settings)));
            })
        });
    }

    fn show(&mut self, shown: Shown) {
        for Swap { key, place, meshed, appearance } in shown.swaps {
            match place {
                ShowTarget::Nowhere => {}
                ShowTarget::On(entity) => {
                    let on_screen = self.screen.get_mut(&entity).expect("it is on the screen");
                    assert_eq!(on_screen.0, key);
                    on_screen.1 = meshed.geometry;
                }
                ShowTarget::Recolored(entity) => {
                    assert!(Arc::ptr_eq(&self.screen[&entity].1, &meshed.geometry), "the same geometry");
                }
                ShowTarget::New => {
                    let entity = Entity::from_raw_u32(self.next_entity).expect("few entities");
                    self.next_entity += 1;
                    self.screen.insert(entity, (key, meshed.geometry.clone()));
                    self.heart.spawned(key, DrawnMesh { entity, geometry: meshed.geometry, appearance });
                }
            }
        }
        self.take_released();
    }
}
