//! What becomes of each case once its faces are decided, derived at compile time.

use crate::{
    active::FIRST_FREE_CODE,
    cases::{Loops, fan_apex, triangulate},
    cell::{CaseIndex, Edge, Face},
};

/// What becomes of a cell.
#[derive(Clone, Copy, Debug)]
pub(super) struct Outcome(u16);

impl Outcome {
    /// The cell is made one by one.
    const SPECIAL: u16 = 1 << 14;
    /// Sheets of it may be joined by a tunnel.
    const TUNNEL: u16 = 1 << 15;
    /// That of the case without inside corners.
    const NONE: Self = Self(0);

    pub(super) const fn is_special(self) -> bool {
        self.0 & Self::SPECIAL != 0
    }

    pub(super) const fn may_have_tunnel(self) -> bool {
        self.0 & Self::TUNNEL != 0
    }

    /// The code of its triangles, where it is neither made nor has a tunnel; that of the case where it is made.
    #[inline(always)]
    pub(super) const fn code_or(self, case: CaseIndex) -> u16 {
        if self.is_special() { case.0 as u16 } else { self.number() }
    }

    const fn number(self) -> u16 {
        self.0 & !(Self::SPECIAL | Self::TUNNEL)
    }

    /// Its triangles, where it is made.
    pub(super) fn sheets(self) -> &'static Sheets {
        &SHEETS[usize::from(self.number()) % SHEETS.len()]
    }
}

/// The triangles of a cell without those of a tunnel: fans around crossings, and one disc around a vertex in the interior
/// where a loop has no fan.
#[derive(Clone, Copy)]
pub(super) struct Sheets {
    /// The first `count` count. Corners are edges, and [`FIRST_INTERIOR`] is the disc's middle.
    triangles: [[u8; 3]; 12],
    count: u8,
    /// The disc's rim, of which the first `rim_len` count.
    rim: [Edge; 12],
    rim_len: u8,
}

/// The name of the first vertex in a cell's interior, behind those on its edges.
pub(super) const FIRST_INTERIOR: u8 = 12;

impl Sheets {
    const NONE: Self = Self { triangles: [[0; 3]; 12], count: 0, rim: [Edge::ALL[0]; 12], rim_len: 0 };

    /// The sheets of these loops, but for those whose bits are set in `skipped`.
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

    /// The crossings around the vertex in the interior, if there is one.
    pub(super) fn rim(&self) -> &[Edge] {
        &self.rim[..usize::from(self.rim_len)]
    }
}

/// A case with decided faces, whose triangles are not the case's.
#[derive(Clone, Copy)]
struct DecidedCase {
    case: CaseIndex,
    joined: u8,
}

/// The codes of such cases follow all others.
pub(in crate::mesher) const DECIDED_CODES: usize = TABLE.decided_count;

/// The case of the extra code `number`.
pub(in crate::mesher) const fn decided_case(number: usize) -> CaseIndex {
    TABLE.decided[number].case
}

/// The triangles of the extra code `number`: the first so many count.
pub(in crate::mesher) const fn decided_triangles(number: usize) -> (u8, [[Edge; 3]; 5]) {
    let DecidedCase { case, joined } = TABLE.decided[number];
    match triangulate(&Loops::new(case, joined)) {
        Some(triangles) => triangles,
        None => panic!("only what has triangles has a code"),
    }
}

/// A bit for each ambiguous face of a case whose inside corners are joined. `larger`: a bit for each face of which the
/// first and third corners' weights have the larger product, and of which the second's and fourth's have.
#[inline(always)]
pub(super) const fn joined_faces(case: CaseIndex, larger: [u8; 2]) -> u8 {
    let [first_inside, second_inside] = AMBIGUOUS_FACES[case.0 as usize];
    larger[0] & first_inside | larger[1] & second_inside
}

/// What becomes of a case; `joined`: a bit for each of its ambiguous faces whose inside corners are joined.
pub(super) const fn outcome(case: CaseIndex, joined: u8) -> Outcome {
    OUTCOMES[case.0 as usize][joined as usize % 64]
}

/// The ambiguous faces of a case, a bit each: those whose first corner is inside, and those whose second is.
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
    /// Of sets of faces that are not all ambiguous, they mean nothing.
    outcomes: [[Outcome; 64]; 256],
    /// The first `extras` count.
    decided: [DecidedCase; 256],
    decided_count: usize,
    /// The first `made` count.
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

/// Whether the trilinear interpolant can join two of these loops by a tunnel: two loops, but of two of three crossings only
/// those at the ends of a diagonal of the cell, and none of nine; or of three loops the one of six and another.
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
