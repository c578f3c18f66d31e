//! The outcome of each ambiguous case once its faces are decided, derived at compile time.

use crate::{
    active::FIRST_FREE_CODE,
    cases::{Loops, fan_apex, triangulate},
    cell::{CaseIndex, Edge, Face},
};

/// The outcome of an ambiguous cell: the code of its triangles, or the sheets of a special cell.
#[derive(Clone, Copy, Debug)]
pub(super) struct Outcome(u16);

impl Outcome {
    /// Set if the cell is special.
    const SPECIAL: u16 = 1 << 14;
    /// Set if a tunnel may join sheets of the cell.
    const TUNNEL: u16 = 1 << 15;
    /// The outcome of the case without inside corners.
    const NONE: Self = Self(0);

    pub(super) const fn is_special(self) -> bool {
        self.0 & Self::SPECIAL != 0
    }

    pub(super) const fn may_have_tunnel(self) -> bool {
        self.0 & Self::TUNNEL != 0
    }

    /// The code of the cell's triangles if it has no tunnel; the case of a special cell.
    #[inline(always)]
    pub(super) const fn code_or(self, case: CaseIndex) -> u16 {
        if self.is_special() { case.0 as u16 } else { self.number() }
    }

    const fn number(self) -> u16 {
        self.0 & !(Self::SPECIAL | Self::TUNNEL)
    }

    /// The sheets of a special cell.
    pub(super) fn sheets(self) -> &'static Sheets {
        &SHEETS[usize::from(self.number()) % SHEETS.len()]
    }
}

/// The triangles of a cell without a tunnel's: fans around crossings, and a disc around a vertex in the interior if a
/// loop has no fan.
#[derive(Clone, Copy)]
pub(super) struct Sheets {
    /// The first `count` are in use. Corners are edges, and [`FIRST_INTERIOR`] is the disc's middle.
    triangles: [[u8; 3]; 12],
    count: u8,
    /// The disc's rim. The first `rim_len` are in use.
    rim: [Edge; 12],
    rim_len: u8,
}

/// The number of the first vertex in a cell's interior; those on its edges come before.
pub(super) const FIRST_INTERIOR: u8 = 12;

impl Sheets {
    const NONE: Self = Self { triangles: [[0; 3]; 12], count: 0, rim: [Edge::ALL[0]; 12], rim_len: 0 };

    /// The sheets of these loops, without the loops whose bits are set in `skipped`.
    pub(super) const fn new(loops: &Loops, skipped: u8) -> Self {
        let (mut sheets, mut number) = (Self::NONE, 0);
        while number < loops.count {
            if skipped >> number & 1 == 0 {
                sheets.add(loops.get(number));
            }
            number += 1;
        }
        sheets
    }

    const fn add(&mut self, around: &[Edge]) {
        let len = around.len();
        let (middle, mut step, end) = match fan_apex(around) {
            Some(apex) => (around[apex].index() as u8, apex + 1, apex + len - 1),
            None => {
                assert!(self.rim_len == 0, "at most one loop of a cell has no fan");
                self.rim_len = len as u8;
                self.rim.split_at_mut(len).0.copy_from_slice(around);
                (FIRST_INTERIOR, 0, len)
            }
        };
        while step < end {
            let [from, to] = [around[step % len].index() as u8, around[(step + 1) % len].index() as u8];
            self.triangles[self.count as usize] = [middle, from, to];
            self.count += 1;
            step += 1;
        }
    }

    pub(super) fn triangles(&self) -> &[[u8; 3]] {
        &self.triangles[..usize::from(self.count)]
    }

    /// The crossings around the vertex in the interior; empty if there is none.
    pub(super) fn rim(&self) -> &[Edge] {
        &self.rim[..usize::from(self.rim_len)]
    }
}

/// A case with decided faces whose triangles differ from the case's.
#[derive(Clone, Copy)]
struct DecidedCase {
    case: CaseIndex,
    joined: u8,
}

/// The number of codes for decided cases. They start at [`FIRST_FREE_CODE`].
pub(in crate::mesher) const DECIDED_CODES: usize = TABLE.decided_count;

/// The case of the decided code `number`.
pub(in crate::mesher) const fn decided_case(number: usize) -> CaseIndex {
    TABLE.decided[number].case
}

/// The triangles of the decided code `number`, and how many of them are in use.
pub(in crate::mesher) const fn decided_triangles(number: usize) -> (u8, [[Edge; 3]; 5]) {
    let DecidedCase { case, joined } = TABLE.decided[number];
    match triangulate(&Loops::new(case, joined)) {
        Some(triangles) => triangles,
        None => panic!("only what has triangles has a code"),
    }
}

/// The ambiguous faces of a case whose inside corners are joined, a bit each. `larger`: the faces on which the first
/// and third corners' weights have the larger product, and those on which the second's and fourth's have, a bit each.
#[inline(always)]
pub(super) const fn joined_faces(case: CaseIndex, larger: [u8; 2]) -> u8 {
    let [first_inside, second_inside] = AMBIGUOUS_FACES[case.0 as usize];
    larger[0] & first_inside | larger[1] & second_inside
}

/// The outcome of a case. `joined`: its ambiguous faces whose inside corners are joined, a bit each.
pub(super) const fn outcome(case: CaseIndex, joined: u8) -> Outcome {
    OUTCOMES[case.0 as usize][joined as usize % 64]
}

/// The ambiguous faces of each case, a bit each: those whose first corner is inside, and those whose second is.
static AMBIGUOUS_FACES: [[u8; 2]; 256] = {
    let (mut all, mut case) = ([[0; 2]; 256], 0);
    while case < 256 {
        let mut face = 0;
        while face < 6 {
            let second_inside = case >> Face::ALL[face].corners()[1].index() & 1;
            all[case][second_inside] |= (CaseIndex(case as u8).is_ambiguous(Face::ALL[face]) as u8) << face;
            face += 1;
        }
        case += 1;
    }
    all
};

static OUTCOMES: [[Outcome; 64]; 256] = TABLE.outcomes;
static SHEETS: [Sheets; TABLE.sheets_count] = *TABLE.sheets.split_at(TABLE.sheets_count).0.first_chunk().unwrap();

struct TrilinearTable {
    /// By case and set of joined faces. Sets with a face that is not ambiguous have no meaning.
    outcomes: [[Outcome; 64]; 256],
    /// The first `decided_count` are in use.
    decided: [DecidedCase; 256],
    decided_count: usize,
    /// The first `sheets_count` are in use.
    sheets: [Sheets; 512],
    sheets_count: usize,
}

const TABLE: TrilinearTable = {
    let mut table = TrilinearTable {
        outcomes: [[Outcome::NONE; 64]; 256],
        decided: [DecidedCase { case: CaseIndex(0), joined: 0 }; 256],
        decided_count: 0,
        sheets: [Sheets::NONE; 512],
        sheets_count: 0,
    };
    let mut case = 0;
    while case < 256 {
        let mut joined = 0;
        while joined < 64 {
            if joined & !(AMBIGUOUS_FACES[case][0] | AMBIGUOUS_FACES[case][1]) == 0 {
                table.outcomes[case][joined as usize] = table.add(CaseIndex(case as u8), joined);
            }
            joined += 1;
        }
        case += 1;
    }
    table
};

impl TrilinearTable {
    const fn add(&mut self, case: CaseIndex, joined: u8) -> Outcome {
        let loops = Loops::new(case, joined);
        let tunnel = if may_have_tunnel(case, &loops) { Outcome::TUNNEL } else { 0 };
        if joined == 0 {
            return Outcome(case.0 as u16 | tunnel);
        }
        if triangulate(&loops).is_none() {
            self.sheets[self.sheets_count] = Sheets::new(&loops, 0);
            self.sheets_count += 1;
            return Outcome((self.sheets_count - 1) as u16 | Outcome::SPECIAL | tunnel);
        }
        self.decided[self.decided_count] = DecidedCase { case, joined };
        self.decided_count += 1;
        Outcome((FIRST_FREE_CODE as usize + self.decided_count - 1) as u16 | tunnel)
    }
}

/// True if the trilinear interpolant can join two of these loops by a tunnel.
///
/// It can join two loops, except if one has nine crossings; two loops of three crossings only if they lie at the ends
/// of a diagonal of the cell. Of three loops, it can join the one of six crossings and another one.
const fn may_have_tunnel(case: CaseIndex, loops: &Loops) -> bool {
    let [first_inside, second_inside] = AMBIGUOUS_FACES[case.0 as usize];
    let is_open = first_inside | second_inside != 0;
    match loops.count {
        2 => {
            let (a, b) = (loops.get(0).len(), loops.get(1).len());
            if is_open { a + b > 6 && a + b <= 9 } else { a == 3 && b == 3 }
        }
        3 => is_open && loops.get(0).len() + loops.get(1).len() + loops.get(2).len() == 12,
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hundred_and_twenty_eight_cases_are_open() {
        let ambiguous = (0..256).filter(|&case| AMBIGUOUS_FACES[case] != [0; 2]).count();
        let diagonal = (0..256)
            .filter(|&case| AMBIGUOUS_FACES[case] == [0; 2] && outcome(CaseIndex(case as u8), 0).may_have_tunnel())
            .count();
        assert_eq!((ambiguous, diagonal), (120, 8));
    }
}
