use alloc::{
    collections::{BTreeMap, BTreeSet},
    string::ToString,
    vec::Vec,
};

use proptest::prelude::*;

use super::*;

const EXTENT: Region = Region::new([-40, -24, -33], [48, 17, 40]);
const EVERYTHING: Region = Region::new([i32::MIN; 3], [i32::MAX; 3]);

/// Rolling ground: chunks well above and below it are empty.
fn is_empty(key: LeafKey) -> bool {
    let Region { min, max } = key.region();
    let middle = [0, 2].map(|axis| f64::from(min[axis] + max[axis]) / 2.0);
    let ground = 6.0 * libm::sin(middle[0] / 9.0) + 5.0 * libm::cos(middle[1] / 7.0);
    let slack = 1.0 + f64::from(max[0] - min[0]);
    f64::from(min[1]) > ground + slack || f64::from(max[1]) < ground - slack
}

fn settings(levels: u8, falloff: f64) -> LevelSettings {
    LevelSettings { levels, falloff, extent: EXTENT, ..LevelSettings::default() }
}

fn see(places: &[[f64; 3]], distance: f64) -> Vec<LevelViewer> {
    places.iter().map(|&position| LevelViewer { position, distance }).collect()
}

/// Whether the boxes of two leaves have a face, an edge or a corner in common.
fn touch(a: LeafKey, b: LeafKey) -> bool {
    let [a, b] = [a.region(), b.region()];
    (0..3).all(|axis| a.min[axis] <= b.max[axis] && b.min[axis] <= a.max[axis])
}

/// Checks everything that a cover promises.
fn check(cover: &LevelCover, viewers: &[[f64; 3]], settings: &LevelSettings) -> Result<(), TestCaseError> {
    check_leaves(cover)?;
    for (leaf, _) in cover.leaves().filter(|(leaf, is_empty)| !is_empty && leaf.level > 0) {
        // Detail is at least what was asked for.
        let nearest = viewers.iter().map(|viewer| distance_squared(*viewer, leaf)).fold(f64::INFINITY, f64::min);
        let limit = settings.falloff * f64::from(1u32 << leaf.level);
        prop_assert!(nearest >= limit * limit, "{:?} is too coarse", leaf);
    }
    Ok(())
}

/// Checks that leaves cover the roots, once, and that they fit each other.
fn check_leaves(cover: &LevelCover) -> Result<(), TestCaseError> {
    check_leaves_of(cover, |_| true)
}

/// [`check_leaves`], with other ground in some leaves.
fn check_leaves_of(cover: &LevelCover, is_known: impl Fn(LeafKey) -> bool) -> Result<(), TestCaseError> {
    let leaves: Vec<(LeafKey, bool)> = cover.leaves().collect();
    let existing = |leaf: LeafKey| leaf.region().intersection(&EXTENT);
    let mut covered = 0u64;
    for &(leaf, empty) in &leaves {
        prop_assert!(empty == is_empty(leaf) || !is_known(leaf), "{:?}", leaf);
        let region = existing(leaf);
        prop_assert!(!region.is_empty(), "{:?} is outside", leaf);
        covered += region.size().map(u64::from).iter().product::<u64>();
        for corner in [region.min, region.max.map(|v| v - 1)] {
            prop_assert_eq!(cover.leaf_at(corner), Some(leaf));
        }
        prop_assert!(!cover.is_split(leaf));
    }
    // Leaves do not overlap: they have as many chunks as the chunks in view.
    let roots = cover.roots.keys().map(|&position| LeafKey { level: cover.top, position });
    let in_view: u64 = roots.map(|root| existing(root).size().map(u64::from).iter().product::<u64>()).sum();
    prop_assert_eq!(covered, in_view);

    let drawn: Vec<LeafKey> = leaves.iter().filter(|(_, empty)| !empty).map(|(leaf, _)| *leaf).collect();
    for &a in &drawn {
        for &b in drawn.iter().filter(|b| a.level > b.level + 1) {
            prop_assert!(!touch(a, b), "{:?} touches {:?}", a, b);
        }
        prop_assert_eq!(cover.finer_neighbours(a).alternating_edge(), None, "{:?}", a);
    }
    Ok(())
}

fn viewer() -> impl Strategy<Value = [f64; 3]> {
    prop_oneof![4 => [-45.0..50.0f64, -15.0..15.0f64, -40.0..45.0f64], 1 => proptest::array::uniform3(-1e12..1e12f64)]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    #[test]
    fn covers_keep_their_promises(
        viewers in prop::collection::vec(viewer(), 0..4),
        (levels, falloff, view_distance) in (1..6u8, 1.75..4.0f64, 1.0..40.0f64),
        steps in prop::collection::vec((any::<prop::sample::Index>(), proptest::array::uniform3(-3.0..3.0f64)), 0..4),
        (low, size) in (proptest::array::uniform3(-50..50i32), proptest::array::uniform3(0..20i32)),
    ) {
        let (settings, mut viewers) = (settings(levels, falloff), viewers);
        let mut calls = BTreeSet::new();
        let mut cover = LevelCover::new(&see(&viewers, view_distance), &settings, None, |key| {
            assert!(calls.insert(key), "{key:?} was asked for twice");
            is_empty(key)
        })?;
        check(&cover, &viewers, &settings)?;
        for chunks in [Region::new(low, [0, 1, 2].map(|axis| low[axis] + size[axis])), EVERYTHING] {
            let mut near: Vec<(LeafKey, bool)> =
                cover.leaves().filter(|(leaf, _)| super::change::touch(&leaf.region(), &chunks)).collect();
            near.sort_unstable();
            near.retain(|_| !chunks.is_empty());
            prop_assert_eq!(cover.leaves_near(chunks), near);
        }
        for (which, offset) in steps {
            if let Some(viewer) = viewers.len().checked_sub(1).map(|last| which.index(last + 1)) {
                viewers[viewer] = [0, 1, 2].map(|axis| viewers[viewer][axis] + offset[axis]);
            }
            cover = LevelCover::new(&see(&viewers, view_distance), &settings, Some(&cover), is_empty)?;
            check(&cover, &viewers, &settings)?;
        }
    }

    /// Edits put surfaces into empty leaves.
    #[test]
    fn filled_leaves_fit(
        [before, viewers] in proptest::array::uniform2(prop::collection::vec(viewer(), 1..3)),
        (levels, falloff, distance) in (1..6u8, 1.75..3.0f64, 1.0..40.0f64),
        which in prop::collection::vec(any::<prop::sample::Index>(), 1..4),
        dug in proptest::array::uniform3(any::<prop::sample::Index>()),
    ) {
        let ([before, viewers], settings) = ([before, viewers].map(|at| see(&at, distance)), settings(levels, falloff));
        // Changes have led to the cover, so that it has nodes that cannot be reached any more.
        let mut cover = LevelCover::new(&before, &settings, None, is_empty)?;
        let wanted = LevelCover::new(&viewers, &settings, Some(&cover), is_empty)?;
        for change in cover.changes_to(&wanted).expect("the numbers of levels are the same") {
            cover.apply(&change);
        }
        let empty: Vec<LeafKey> = cover.leaves().filter(|(_, is_empty)| *is_empty).map(|(leaf, _)| leaf).collect();
        prop_assume!(!empty.is_empty());
        let filled: Vec<LeafKey> = which.iter().map(|index| *index.get(&empty)).collect();
        // Within each, a single chunk gets a surface.
        let chunk_in = |leaf: LeafKey| {
            let Region { min, max } = leaf.region().intersection(&EXTENT);
            [0, 1, 2].map(|axis| min[axis] + dug[axis].index((max[axis] - min[axis]) as usize) as i32)
        };
        let chunks: Vec<[i32; 3]> = filled.iter().map(|leaf| chunk_in(*leaf)).collect();
        let is_filled = |key: LeafKey| chunks.iter().any(|chunk| key.region().contains(*chunk));
        let is_empty_now = |key| {
            assert!(!filled.contains(&key), "{key:?} is filled");
            is_empty(key) && !is_filled(key)
        };
        let others: Vec<LeafKey> = cover.leaves().filter(|(_, is_empty)| !is_empty).map(|(leaf, _)| leaf).collect();
        prop_assert_eq!(cover.fill(&others, &viewers, &settings, is_empty_now)?, LevelChange::default());
        let change = cover.fill(&filled, &viewers, &settings, is_empty_now)?;
        let mut now = cover.clone();
        now.apply(&change);
        check_leaves_of(&now, |leaf| !is_filled(leaf))?;
        for chunk in &chunks {
            let leaf = now.leaf_at(*chunk).expect("it is in view");
            prop_assert!(now.leaves().any(|found| found == (leaf, false)));
        }
        // Nodes that cannot be reached any more do not matter.
        prop_assert_eq!(&change, &wanted.fill(&filled, &viewers, &settings, is_empty_now)?);
        // Detail is at least what was asked for.
        for (leaf, _) in now.leaves().filter(|(leaf, is_empty)| !is_empty && is_filled(*leaf)) {
            let limit = settings.falloff * f64::from(1u32 << leaf.level);
            let is_far = |viewer: &LevelViewer| distance_squared(viewer.position, leaf) >= limit * limit;
            prop_assert!(leaf.level == 0 || viewers.iter().all(is_far), "{:?} is too coarse", leaf);
        }
        // Other leaves are only split, and only next to such that are filled or split.
        let mut split: Vec<LeafKey> = change.removed.iter().filter(|leaf| !filled.contains(leaf)).copied().collect();
        prop_assert!(split.iter().all(|leaf| now.is_split(*leaf)));
        let mut changed: Vec<LeafKey> = filled.clone();
        while let Some(found) = split.iter().position(|a| changed.iter().any(|b| touch(*a, *b))) {
            changed.push(split.swap_remove(found));
        }
        prop_assert_eq!(split, []);
    }

    /// Changes lead from one cover to another, and all covers between fit.
    #[test]
    fn changes_lead_from_cover_to_cover(
        [from, to] in proptest::array::uniform2(prop::collection::vec(viewer(), 0..3)),
        (levels, falloff) in (1..5u8, 1.75..3.0f64),
        distances in proptest::array::uniform2(0.5..2.5f64),
        dug in prop::option::of((EXTENT.min[0]..EXTENT.max[0], -9..9i32)),
        meshes in 0..40usize,
    ) {
        // Chunks right of a place are dug away, or filled, between the two covers.
        let is_dug = |key: LeafKey| dug.is_some_and(|(from, _)| key.region().max[0] > from);
        let is_empty_then = |key: LeafKey| match dug {
            Some((_, height)) if is_dug(key) => key.region().min[1] > height || key.region().max[1] < height - 2,
            _ => is_empty(key),
        };
        let [from_distance, to_distance] = distances.map(|distance| distance * f64::from(1u32 << (levels - 1)));
        let settings = settings(levels, falloff);
        let start = LevelCover::new(&see(&from, from_distance), &settings, None, is_empty)?;
        let target = LevelCover::new(&see(&to, to_distance), &settings, None, is_empty_then)?;
        let (changes, is_whole) = start.first_changes_to(&target, usize::MAX, meshes, |_| 0).expect("the same levels");
        prop_assert!(is_whole);
        // A part of a way leads to where the rest begins.
        let (first, is_whole) = start.first_changes_to(&target, 5, meshes, |leaf| leaf.level.into()).expect("the same");
        prop_assert!(first.len() <= 5 || is_whole);
        let mut half_way = start.clone();
        first.iter().for_each(|change| half_way.apply(change));
        check_leaves_of(&half_way, |leaf| !is_dug(leaf))?;
        let rest = half_way.changes_to(&target).expect("the same");
        prop_assert_eq!(rest.is_empty(), is_whole);
        rest.iter().for_each(|change| half_way.apply(change));
        prop_assert!(half_way.leaves().eq(target.leaves()));
        let (mut now, mut most) = (start.clone(), start.reachable().count());
        let drawn = |cover: &LevelCover| -> BTreeMap<LeafKey, (bool, FinerNeighbours)> {
            cover.leaves().map(|(leaf, is_empty)| (leaf, (is_empty, cover.finer_neighbours(leaf)))).collect()
        };
        let mut shown = drawn(&now);
        for (number, change) in changes.iter().enumerate() {
            let overlaps_next = changes.get(number + 1).is_some_and(|next| change.overlaps(next));
            if let Some(next) = changes.get(number + 1).filter(|_| !overlaps_next) {
                // Either may come first.
                let (mut other, mut this) = (now.clone(), now.clone());
                other.apply(next);
                check_leaves_of(&other, |leaf| !is_dug(leaf))?;
                other.apply(change);
                this.apply(change);
                this.apply(next);
                prop_assert_eq!(drawn(&other), drawn(&this));
            }
            now.apply(change);
            check_leaves_of(&now, |leaf| !is_dug(leaf))?;
            for leaf in &change.removed {
                prop_assert!(shown.remove(leaf).is_some(), "{:?} was not drawn", leaf);
            }
            for &(leaf, is_empty) in &change.added {
                prop_assert_eq!(shown.insert(leaf, (is_empty, now.finer_neighbours(leaf))), None);
            }
            for &leaf in &change.remeshed {
                let finer = now.finer_neighbours(leaf);
                let before = shown.insert(leaf, (false, finer));
                let is_beside_finest = || change.leaves().any(|other| other.level + 1 < leaf.level && touch(other, leaf));
                prop_assert!(before.is_some_and(|(is_empty, before)| !is_empty && (before != finer || is_beside_finest())));
            }
            let mut expected = drawn(&now);
            // Empty leaves have no mesh that could depend on their neighbours.
            for map in [&mut shown, &mut expected] {
                map.values_mut().filter(|(is_empty, _)| *is_empty).for_each(|leaf| leaf.1 = FinerNeighbours::NONE);
            }
            prop_assert_eq!(&shown, &expected);
            most = most.max(now.reachable().count());
        }
        prop_assert_eq!(drawn(&now), drawn(&target));
        // The way out where no single step fits.
        let (mut all, mut once) = (start.clone(), start);
        if let Some(change) = all.all_at_once(&target) {
            once.apply(&change);
        }
        prop_assert_eq!(drawn(&once), drawn(&target));
        // Nodes that cannot be reached do not pile up.
        prop_assert!(now.nodes.len() <= 2 * most + 80, "{} of {most} nodes", now.nodes.len());
    }

    /// All chunks that a viewer sees, and no other, at one level.
    #[test]
    fn one_level_is_a_ball_of_chunks(viewer in [-40.0..48.0f64, -24.0..17.0f64, -33.0..40.0f64], distance in 0.5..9.0f64) {
        let cover = LevelCover::new(&see(&[viewer], distance), &settings(1, 3.0), None, is_empty)?;
        for chunk in EXTENT.points().step_by(3) {
            let key = LeafKey { level: 0, position: chunk };
            let expected = (distance_squared(viewer, key) < distance * distance).then_some(key);
            prop_assert_eq!(cover.leaf_at(chunk), expected);
        }
    }

    /// A viewer that goes to and fro within the hysteresis changes nothing, after the first time.
    #[test]
    fn small_steps_change_nothing(viewer in viewer(), offset in proptest::array::uniform3(-0.05..0.05f64)) {
        // A step of less than 0.1 is less than the hysteresis of the finest leaves that can be merged.
        let settings = settings(5, 2.0);
        let there = [0, 1, 2].map(|axis| viewer[axis] + offset[axis]);
        let first = LevelCover::new(&see(&[viewer], 30.0), &settings, None, is_empty)?;
        let second = LevelCover::new(&see(&[there], 30.0), &settings, Some(&first), is_empty)?;
        let mut former = second;
        for place in [viewer, there, viewer] {
            let cover = LevelCover::new(&see(&[place], 30.0), &settings, Some(&former), is_empty)?;
            let [now, before] = [&cover, &former].map(|cover| cover.leaves().collect::<BTreeSet<_>>());
            prop_assert_eq!(now, before);
            former = cover;
        }
    }
}

#[test]
fn two_viewers_make_diagonal_leaves_split_further() {
    // Without an extent and with a surface everywhere: viewers across from each other along a diagonal of an edge.
    let settings = LevelSettings { hysteresis: 0.0, ..settings(3, 1.75) };
    let mut splits = 0;
    for step in 0..60 {
        let at = f64::from(step) / 10.0;
        let viewers = [[at, 0.5, at], [at - 7.0, 0.5, at - 7.0]];
        let cover = LevelCover::new(&see(&viewers, 9.0), &settings, None, |_| false).unwrap();
        let drawn: Vec<LeafKey> = cover.leaves().map(|(leaf, _)| leaf).collect();
        for &leaf in &drawn {
            assert_eq!(cover.finer_neighbours(leaf).alternating_edge(), None);
            assert!(drawn.iter().all(|&other| leaf.level <= other.level + 1 || !touch(leaf, other)));
        }
        let wanted = |key: LeafKey| {
            viewers.iter().any(|v| {
                let limit = 1.75 * f64::from(1u32 << key.level);
                distance_squared(*v, key) < limit * limit
            })
        };
        let parents = drawn.iter().filter(|leaf| leaf.level < 2).map(|leaf| leaf.parent());
        splits += parents.collect::<BTreeSet<_>>().into_iter().filter(|&parent| !wanted(parent)).count();
    }
    assert!(splits > 0, "some edge alternates without further splits");
}

#[test]
fn covers_of_other_numbers_of_levels_have_no_way_between() {
    let cover = |levels| LevelCover::new(&see(&[[0.0; 3]], 9.0), &settings(levels, 2.0), None, is_empty).unwrap();
    assert_eq!(cover(2).changes_to(&cover(3)), None);
    assert_eq!(cover(3).changes_to(&cover(3)), Some(Vec::new()));
}

#[test]
fn bad_settings_are_refused() {
    let good = LevelSettings::default();
    let refusal = |settings: LevelSettings, viewer: f64| {
        let viewers = see(&[[viewer, 0.0, 0.0]], 9.0);
        LevelCover::new(&viewers, &settings, None, |_| true).expect_err("the settings are bad").to_string()
    };
    for levels in [0, 8] {
        let expected = alloc::format!("a cover has 1 to 7 levels, but {levels} were asked for");
        assert_eq!(refusal(LevelSettings { levels, ..good }, 0.0), expected);
    }
    for falloff in [f64::NAN, 1.7, f64::INFINITY] {
        let expected = alloc::format!("falloff must be 1.75 or more, but it is {falloff}");
        assert_eq!(refusal(LevelSettings { falloff, ..good }, 0.0), expected);
    }
    for distance in [f64::NAN, 0.0, -1.0] {
        let expected = alloc::format!("a viewer's distance must be above 0, but it is {distance}");
        let refused = LevelCover::new(&see(&[[0.0; 3]], distance), &good, None, |_| true);
        assert_eq!(refused.expect_err("it sees nothing").to_string(), expected);
    }
    for hysteresis in [f64::NAN, -0.1, 1.1] {
        let expected = alloc::format!("hysteresis must be from 0 to 1, but it is {hysteresis}");
        assert_eq!(refusal(LevelSettings { hysteresis, ..good }, 0.0), expected);
    }
    assert_eq!(refusal(good, f64::NAN), "viewers must be at finite places, but one is at [NaN, 0.0, 0.0]");
    for (settings, distance) in [
        (good, 1e300),
        (good, f64::INFINITY),
        (LevelSettings { levels: 1, ..good }, 200.0),
        (LevelSettings { levels: 1, ..good }, 90.0),
        (LevelSettings { falloff: 1e9, ..good }, 1e4),
        (LevelSettings { kept: good.extent, ..good }, 1.0),
    ] {
        let viewers = see(&[[0.0; 3]], distance);
        let found = LevelCover::new(&viewers, &settings, None, |_| false).expect_err("there are too many");
        assert_eq!(found, LevelError::TooManyLeaves);
    }
    // No viewer sees nothing; a viewer far outside the lattice sees nothing either.
    for viewers in [Vec::new(), see(&[[1e300; 3]], 100.0)] {
        assert_eq!(LevelCover::new(&viewers, &good, None, |_| false).unwrap().leaves().count(), 0);
    }
}

#[test]
fn what_is_kept_needs_no_viewer() {
    let kept = Region::new([-3, -2, 5], [4, 1, 9]);
    let settings = LevelSettings { kept, ..settings(4, 2.0) };
    let nobody = LevelCover::new(&[], &settings, None, is_empty).unwrap();
    assert!(EXTENT.points().all(|chunk| !kept.contains(chunk) || nobody.leaf_at(chunk).is_some()));
    assert!(nobody.leaves().all(|(leaf, _)| leaf.level == 3));
    // Viewers that see infinitely far see all that exists, wherever they are.
    for (place, distance) in [(2.0, f64::INFINITY), (2.0, f64::MAX), (1e300, f64::INFINITY), (1e200, 1e201)] {
        let all = LevelCover::new(&see(&[[place; 3]], distance), &settings, None, is_empty).unwrap();
        assert!(EXTENT.points().all(|chunk| all.leaf_at(chunk).is_some()));
    }
}

/// On even ground between two rows of chunks, splits and merges wait for others across edges: none waits for all.
#[test]
fn wide_views_change_in_small_parts() {
    let is_empty = |leaf: LeafKey| leaf.region().min[1] > 0 || leaf.region().max[1] < 0;
    let settings = LevelSettings { levels: 5, falloff: 3.0, ..LevelSettings::default() };
    let mut shown = LevelCover::new(&[], &settings, None, is_empty).expect("no leaves are not too many");
    for x in [0.0, 90.0, 180.5, 180.0] {
        let viewers = see(&[[x, 2.0, 0.0]], 64.0);
        let target = LevelCover::new(&viewers, &settings, Some(&shown), is_empty).expect("few leaves");
        let urgency = |leaf| distance_squared([x, 2.0, 0.0], leaf) as u32;
        let (changes, is_whole) = shown.first_changes_to(&target, usize::MAX, 24, urgency).expect("the same levels");
        assert!(is_whole);
        for change in &changes {
            let meshes = change.added.iter().filter(|(_, is_empty)| !is_empty).count() + change.remeshed.len();
            assert!(meshes <= 48, "{meshes} meshes");
            shown.apply(change);
        }
        assert!(shown.leaves().eq(target.leaves()));
    }
}
