//! The loops of all cases in the form that the passes use, and the edges of a cell's faces.

use crate::{
    cases::{Loops, next_crossings},
    cell::{CaseIndex, Edge, Face},
};

/// The loops of a case.
#[derive(Clone, Copy)]
pub(super) struct CaseLoops {
    /// The crossings of each loop, a bit each; loops are in the order of their lowest crossings.
    pub(super) edges: [u16; 4],
    pub(super) count: u8,
    /// 1 plus the number of the ambiguous face all of whose crossings lie in one loop; 0 if there is none.
    pub(super) whole_face: u8,
    /// The loop of each crossing, two bits an edge.
    pub(super) numbers: u32,
}

pub(super) static LOOPS: [CaseLoops; 256] = {
    let (mut all, mut case) = ([CaseLoops { edges: [0; 4], count: 0, whole_face: 0, numbers: 0 }; 256], 0);
    while case < 256 {
        all[case] = CaseLoops::of(CaseIndex(case as u8));
        case += 1;
    }
    all
};

/// The crossing that follows each crossing on its loop.
static NEXT: [[u8; 12]; 256] = {
    let (mut all, mut case) = ([[0; 12]; 256], 0);
    while case < 256 {
        let (next, mut edge) = (next_crossings(CaseIndex(case as u8), 0), 0);
        while edge < 12 {
            if let Some(to) = next[edge] {
                all[case][edge] = to.index() as u8;
            }
            edge += 1;
        }
        case += 1;
    }
    all
};

/// The edges of each face, a bit each.
pub(super) const FACE_EDGES: [u16; 6] = {
    let (mut all, mut face) = ([0; 6], 0);
    while face < 6 {
        let mut edge = 0;
        while edge < 12 {
            let [low, high] = Edge::ALL[edge].corners();
            if Face::ALL[face].holds(low) && Face::ALL[face].holds(high) {
                all[face] |= 1 << edge;
            }
            edge += 1;
        }
        face += 1;
    }
    all
};

/// The edges along each axis, a bit each.
pub(super) const AXIS_EDGES: [u16; 3] = [0x00F, 0x0F0, 0xF00];

impl CaseLoops {
    const fn of(case: CaseIndex) -> Self {
        let loops = Loops::new(case, 0);
        let mut result = Self { edges: [0; 4], count: loops.count as u8, whole_face: 0, numbers: 0 };
        let mut number = 0;
        while number < loops.count {
            let crossings = loops.get(number);
            let mut index = 0;
            while index < crossings.len() {
                result.edges[number] |= 1 << crossings[index].index();
                result.numbers |= (number as u32) << (2 * crossings[index].index());
                index += 1;
            }
            let mut face = 0;
            while face < 6 {
                if case.is_ambiguous(Face::ALL[face]) && result.edges[number] & FACE_EDGES[face] == FACE_EDGES[face] {
                    assert!(result.whole_face == 0, "no case has two such faces");
                    result.whole_face = face as u8 + 1;
                }
                face += 1;
            }
            number += 1;
        }
        result
    }
}

/// The crossings of the run of `start`: those that lead from it to others on its loop, both ways, through crossings in
/// `among` only.
pub(super) fn run(case: u8, start: u16, among: u16) -> u16 {
    let next = &NEXT[usize::from(case)];
    let mut run = start;
    loop {
        let before = run;
        for edge in (0..12).filter(|&edge| among >> edge & 1 == 1 && among >> next[edge] & 1 == 1) {
            let both = 1 << edge | 1 << next[edge];
            if run & both != 0 {
                run |= both;
            }
        }
        if run == before {
            return run;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thirty_six_cases_can_be_complemented() {
        let of = |inside: u32| {
            let cases = (0..256u16).filter(|case| case.count_ones() == inside);
            cases.filter(|&case| LOOPS[usize::from(case)].whole_face != 0).count()
        };
        assert_eq!([0, 1, 2, 3, 4, 5, 6, 7, 8].map(of), [0, 0, 0, 0, 0, 24, 12, 0, 0]);
    }

    #[test]
    fn complements_have_two_loops_that_share_the_face() {
        for case in (0..256).filter(|&case| LOOPS[case].whole_face != 0) {
            let (loops, complement) = (LOOPS[case], LOOPS[255 - case]);
            let face = FACE_EDGES[usize::from(loops.whole_face) - 1];
            assert_eq!((loops.count, complement.count), (1, 2));
            let shares = [0, 1].map(|number: usize| (complement.edges[number] & face).count_ones());
            assert_eq!(shares, [2, 2]);
        }
    }

    /// Two bits name a vertex of a cell.
    #[test]
    fn no_cell_has_more_than_four_runs() {
        for case in 0..=255u8 {
            let crossed = LOOPS[usize::from(case)].edges.iter().fold(0, |all, edges| all | edges);
            for lacking in 0..64 {
                let faces = (0..6).filter(|face| lacking >> face & 1 == 1);
                let mut left = crossed & !faces.fold(0, |edges, face| edges | FACE_EDGES[face]);
                let mut runs = 0;
                while left != 0 {
                    left &= !run(case, left & left.wrapping_neg(), left);
                    runs += 1;
                }
                assert!(runs <= 4, "case {case:08b}");
            }
        }
    }
}
