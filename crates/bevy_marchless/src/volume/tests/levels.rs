//! Random events on a terrain with several levels of detail.

use std::collections::{BTreeMap, BTreeSet};

use bevy_platform::collections::HashSet;
use marchless::{LeafBlock, LevelCover, LevelSource, Mesher};

use super::super::levels::Levels;
use super::*;

impl Game {
    fn with_levels(detail: LevelDetail) -> Self {
        let mut game = Self { levels: Some(detail), ..Self::new() };
        game.heart.set_levels(Some(detail));
        game.keep();
        game
    }

    /// Keeps the whole extent drawn, with several levels.
    pub(super) fn keep(&mut self) {
        let extent = self.settings.extent;
        if self.levels.is_some() {
            let view = View::new(LoadRegion::of_box(extent, extent), 0.0, None, [0.0; 3]);
            self.heart.set_view(None, Some(view));
        }
    }

    /// Another source, as the plugin changes it.
    pub(super) fn start_over(&mut self, shift: f64) {
        self.settings = sampling_settings(shift, self.settings.extent);
        self.stamps.clear();
        self.waiting.clear();
        self.screen.clear();
        self.despawned.clear();
        self.heart = Heart::new(self.settings.clone(), self.method(), self.normals, colors(), true);
        self.heart.set_levels(self.levels);
        self.keep();
        let mut viewers: Vec<u32> = self.views.keys().copied().collect();
        viewers.sort_unstable();
        viewers.into_iter().for_each(|viewer| self.appearance(viewer));
    }

    /// What holds in every update of a terrain with several levels.
    pub(super) fn check_levels(&self, levels: &Levels) {
        let heart = &self.heart;
        let cover = levels.shown_cover();
        let drawn: BTreeSet<ChunkKey> =
            cover.leaves().filter(|(_, is_empty)| !is_empty).map(|(leaf, _)| leaf.into()).collect();
        let leaves: BTreeSet<ChunkKey> = heart.table.keys().filter(|key| heart.table.is_leaf(*key)).collect();
        assert_eq!(drawn, leaves, "what is drawn is in the cover");
        assert!(leaves.iter().all(|key| heart.table.is_shown(*key)), "a leaf is drawn as soon as it is one");
        for (leaf, _) in cover.leaves().filter(|(_, is_empty)| !is_empty) {
            for (near, _) in cover.leaves_near(leaf.region()).into_iter().filter(|(_, is_empty)| !is_empty) {
                assert!(near.level.abs_diff(leaf.level) <= 1, "{near:?} touches {leaf:?}");
            }
        }
        if self.despawned.is_empty() {
            self.check_closed(cover);
        }
    }

    /// Checks that all meshes on the screen form one surface, bit for bit, which is closed except beside chunks that have
    /// not come yet.
    fn check_closed(&self, cover: &LevelCover) {
        // Crossings are at multiples of 2⁻¹⁴ voxels of the level of their samples.
        let unit = f64::from(1 << 14);
        let mut edges = HashSet::<[[i64; 3]; 2]>::default();
        let mut positions = Vec::new();
        for (key, mesh) in self.screen.values() {
            let corner = key.position.map(|v| f64::from(v) * f64::from(CELLS));
            let size = f64::from(1 << key.level);
            let point = |p: &[f32; 3]| [0, 1, 2].map(|axis| ((corner[axis] + f64::from(p[axis])) * size * unit) as i64);
            positions.clear();
            positions.extend(mesh.positions.iter().map(point));
            for triangle in mesh.indices.chunks_exact(3) {
                let [a, b, c] = [0, 1, 2].map(|corner| positions[triangle[corner] as usize]);
                for edge in [[a, b], [b, c], [c, a]] {
                    // The edge that runs the other way matches it.
                    if !edges.remove(&[edge[1], edge[0]]) {
                        assert!(edges.insert(edge), "an edge twice, at {edge:?} of {key:?}");
                    }
                }
            }
        }
        let is_at_end = |[from, to]: &[[i64; 3]; 2]| {
            // The chunks around the edge's middle. Beside finer leaves, coarser ones end up to a voxel before their border.
            let (width, near) = (i64::from(CELLS) << 15, 2 << 15);
            let ends =
                [-near, near].map(|end| [0, 1, 2].map(|axis| (from[axis] + to[axis] + end).div_euclid(width) as i32));
            let mut touching =
                Region::new(ends[0], ends[1].map(|v| v + 1)).intersection(&self.settings.extent).points();
            touching.any(|chunk| cover.leaf_at(chunk).is_none())
        };
        edges.retain(|edge| !is_at_end(edge));
        assert!(edges.is_empty(), "{} open edges, one at {:?}", edges.len(), edges.iter().next());
    }

    /// Once nothing waits, all is as in a fresh terrain with the same edits.
    pub(super) fn check_settled_levels(&self, levels: &Levels, fresh: &Grid<i16>, settings: &MeshSettings) {
        let cover = levels.shown_cover();
        let known = fresh.chunks_in(self.settings.extent).collect::<BTreeMap<_, _>>();
        let source = LevelSource {
            source: self.settings.source.as_ref(),
            cells: CELLS,
            spacing: 1.0,
            stamps: &self.stamps,
            known: None,
            planes: fresh.planes(),
            isovalue: self.isovalue,
        };
        let (viewers, level_settings) = levels.asked();
        let asked = LevelCover::new(&viewers, &level_settings, None, |leaf| levels.is_empty(leaf)).expect("few leaves");
        assert!(level_settings.hysteresis > 0.0 || asked.leaves().eq(cover.leaves()), "the cover that viewers ask for");
        let (mut mesher, mut block, mut union) = (Mesher::new(), LeafBlock::new(), MeshUnion::new());
        let is_despawned = |key: &ChunkKey| self.despawned.contains(key) && self.heart.entity(*key).is_none();
        for (leaf, _) in cover.leaves().filter(|(_, is_empty)| !is_empty) {
            let key = ChunkKey::from(leaf);
            let mut expected = MeshBuffer::new();
            if leaf.level == 0 {
                // Chunks that the source's bound settles are uniform, which shows in normals beside them.
                fresh.mesh_chunk(leaf.position, &mut mesher, settings, &mut expected).expect("a chunk");
            } else {
                block.fill(&source, cover, leaf);
                mesher.mesh_leaf(&block.samples().expect("one answer"), settings, &mut expected).expect("a leaf");
            }
            union.add(&expected, leaf.region().min.map(|v| i64::from(v) * i64::from(CELLS)), leaf.level);
            if is_despawned(&key) {
                continue;
            }
            let wanted = if expected.is_empty() { LeafState::Empty } else { LeafState::Drawn };
            assert_eq!(self.heart.table.leaf_state(key), Some(wanted), "{key:?}");
            if let Some(drawn) = self.heart.table.drawn(key).filter(|drawn| !drawn.geometry.is_empty()) {
                assert!(*drawn.geometry == expected, "the mesh of {key:?}");
                assert_eq!(drawn.appearance, self.heart.appearance(), "the appearance of {key:?}");
            }
        }
        assert!(union.report().is_closed(), "{}", union.report());
        let finest = self.settings.extent.points().filter(|chunk| self.heart.table.contains(ChunkKey::finest(*chunk)));
        for chunk in finest.filter(|chunk| self.heart.samples.is_resident(*chunk)) {
            let (found, expected) = (self.heart.samples.newest().chunk(chunk).expect("it is resident"), known[&chunk]);
            assert!((0..CELLS.pow(3) as usize).all(|index| found.voxel(index) == expected.voxel(index)), "{chunk:?}");
        }
    }
}

fn detail() -> impl Strategy<Value = LevelDetail> {
    (2u8..5, 1.75..2.5f64, prop_oneof![Just(0.0), Just(0.1)]).prop_map(|(levels, falloff, hysteresis)| LevelDetail {
        levels,
        falloff,
        hysteresis,
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn whatever_happens_the_surface_is_closed(
        detail in detail(),
        events in prop::collection::vec(event(), 1..50),
    ) {
        let mut game = Game::with_levels(detail);
        for event in &events {
            game.happen(event);
        }
        game.follow_residency();
        // And again, from there.
        for event in events.iter().rev() {
            game.happen(event);
        }
        game.follow_residency();
    }
}

/// Balls in the air and on the ground, one upon the other, while meshes take long.
fn building() -> impl Strategy<Value = Event> {
    let place = || (-2.5..2.5f64, -0.5..5.5f64, -2.5..2.5f64).prop_map(|(x, y, z)| [x, y, z]);
    prop_oneof![
        1 => place().prop_map(|middle| Event::View { viewer: 0, view: Some((middle, 1.0, 0.0, None)) }),
        6 => (place(), 0.1..0.9f64, prop::bool::weighted(0.8))
            .prop_map(|(center, radius, add)| Event::QuantisedStamp { center, radius, add }),
        8 => (0usize..20, prop_oneof![Just(0usize), Just(8)])
            .prop_map(|(jobs, inline)| Event::Update { jobs, inline, late: false }),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn what_is_built_in_the_air_is_closed(
        detail in detail(),
        events in prop::collection::vec(building(), 1..60),
    ) {
        let mut game = Game::with_levels(detail);
        game.happen(&Event::Extent { index: 4 });
        game.follow_residency();
        for event in &events {
            game.happen(event);
        }
        game.follow_residency();
    }
}

#[test]
fn edits_make_place_without_meshes() {
    let detail = LevelDetail { levels: 3, falloff: 2.0, hysteresis: 0.0 };
    let mut game = Game::with_levels(detail);
    game.heart = Heart::new(game.settings.clone(), game.method(), true, colors(), false);
    game.heart.set_levels(Some(detail));
    game.keep();
    game.happen(&Event::View { viewer: 0, view: Some(([0.5, 2.5, 0.5], 1.0, 0.0, None)) });
    for _ in 0..200 {
        game.run_systems(30, 8, false);
    }
    let is_empty = |game: &Game| {
        let cover = game.heart.levels.as_ref().expect("there are levels").shown_cover();
        let (_, is_empty) = cover.leaves().find(|(leaf, _)| leaf.region().contains([0, 2, 0])).expect("it is kept");
        is_empty
    };
    assert!(is_empty(&game));
    game.happen(&Event::QuantisedStamp { center: [0.5, 2.5, 0.5], radius: 0.3, add: true });
    game.run_systems(30, 8, false);
    assert!(!is_empty(&game));
}

/// The last leaves of a view come while an edit of those beside them is being meshed.
#[test]
fn leaves_that_come_beside_an_edit_wait_for_it() {
    for jobs in [8, 24] {
        let mut game = Game::with_levels(LevelDetail { levels: 2, falloff: 1.75, hysteresis: 0.0 });
        game.happen(&Event::Extent { index: 2 });
        for jobs in [1, 24, jobs] {
            game.happen(&Event::Update { jobs, inline: 0, late: false });
        }
        game.happen(&Event::QuantisedStamp { center: [0.0, 0.0, 1.93], radius: 1.36, add: false });
        game.happen(&Event::Update { jobs: 0, inline: 0, late: false });
        game.follow_residency();
    }
}
