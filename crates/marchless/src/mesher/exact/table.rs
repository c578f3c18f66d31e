//! What becomes of each case once its faces are decided, derived at compile time.

use crate::{
    cases::{Loops, triangulate},
    cell::{CaseIndex, Edge, Face},
    mesher::triangles::FIRST_EXTRA,
};

/// What becomes of a cell.
#[derive(Clone, Copy, Debug)]
pub(super) struct Outcome(u16);

impl Outcome {
    /// The cell is made one by one.
    const MADE: u16 = 1 << 14;
    /// Sheets of it may be joined by a tunnel.
    const TUNNEL: u16 = 1 << 15;
    /// That of the case without inside corners.
    pub(super) const NONE: Self = Self(0);

    /// Whether it is anything else than the triangles of this case.
    pub(super) const fn differs_from(self, case: CaseIndex) -> bool {
        self.0 != case.0 as u16
    }

    pub(super) const fn is_made(self) -> bool {
        self.0 & Self::MADE != 0
    }

    pub(super) const fn may_have_tunnel(self) -> bool {
        self.0 & Self::TUNNEL != 0
    }

    /// The code of its triangles, where it is neither made nor has a tunnel.
    pub(super) const fn code(self) -> u16 {
        self.0 & !(Self::MADE | Self::TUNNEL)
    }
}

/// A case with decided faces, whose triangles are not the case's.
#[derive(Clone, Copy)]
struct Extra {
    case: CaseIndex,
    joined: u8,
}

/// The codes of such cases follow all others.
pub(in crate::mesher) const EXTRA_CODES: usize = TABLE.extras;

/// The case of the extra code `number`.
pub(in crate::mesher) const fn extra_case(number: usize) -> CaseIndex {
    TABLE.extra[number].case
}

/// The triangles of the extra code `number`: the first so many count.
pub(in crate::mesher) const fn extra_triangles(number: usize) -> (u8, [[Edge; 3]; 5]) {
    let Extra { case, joined } = TABLE.extra[number];
    match triangulate(&Loops::new(case, joined)) {
        Some(triangles) => triangles,
        None => panic!("only what has triangles has a code"),
    }
}

/// The faces of a case that are ambiguous, a bit each.
pub(super) const fn ambiguous_faces(case: CaseIndex) -> u8 {
    AMBIGUOUS_FACES[case.0 as usize]
}

/// What becomes of a case; `joined`: a bit for each of its ambiguous faces whose inside corners are joined.
pub(super) const fn outcome(case: CaseIndex, joined: u8) -> Outcome {
    OUTCOMES[case.0 as usize][joined as usize % 64]
}

/// The corners of each face, around it.
pub(super) const FACE_CORNERS: [[usize; 4]; 6] = {
    let (mut all, mut face) = ([[0; 4]; 6], 0);
    while face < 6 {
        let mut corner = 0;
        while corner < 4 {
            all[face][corner] = Face::ALL[face].corners()[corner].index();
            corner += 1;
        }
        face += 1;
    }
    all
};

static AMBIGUOUS_FACES: [u8; 256] = {
    let (mut all, mut case) = ([0; 256], 0);
    while case < 256 {
        let mut face = 0;
        while face < 6 {
            all[case] |= (CaseIndex(case as u8).is_ambiguous(Face::ALL[face]) as u8) << face;
            face += 1;
        }
        case += 1;
    }
    all
};

static OUTCOMES: [[Outcome; 64]; 256] = TABLE.outcomes;

struct Table {
    /// Of sets of faces that are not all ambiguous, they mean nothing.
    outcomes: [[Outcome; 64]; 256],
    /// The first `extras` count.
    extra: [Extra; 256],
    extras: usize,
}

const TABLE: Table = {
    let mut table = Table {
        outcomes: [[Outcome::NONE; 64]; 256],
        extra: [Extra { case: CaseIndex(0), joined: 0 }; 256],
        extras: 0,
    };
    let mut case = 0;
    while case < 256 {
        let mut joined = 0;
        while joined < 64 {
            if joined & !AMBIGUOUS_FACES[case] == 0 {
                table.outcomes[case][joined as usize] = table.decided(CaseIndex(case as u8), joined);
            }
            joined += 1;
        }
        case += 1;
    }
    table
};

impl Table {
    const fn decided(&mut self, case: CaseIndex, joined: u8) -> Outcome {
        let loops = Loops::new(case, joined);
        let tunnel = if may_have_tunnel(case, &loops) { Outcome::TUNNEL } else { 0 };
        if joined == 0 {
            return Outcome(case.0 as u16 | tunnel);
        }
        if triangulate(&loops).is_none() {
            return Outcome(Outcome::MADE | tunnel);
        }
        self.extra[self.extras] = Extra { case, joined };
        self.extras += 1;
        Outcome((FIRST_EXTRA as usize + self.extras - 1) as u16 | tunnel)
    }
}

/// Whether the trilinear interpolant can join two of these loops by a tunnel: two loops, but of two of three crossings only
/// those at the ends of a diagonal of the cell, and none of nine; or of three loops the one of six and another.
const fn may_have_tunnel(case: CaseIndex, loops: &Loops) -> bool {
    let is_open = AMBIGUOUS_FACES[case.0 as usize] != 0;
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
        let ambiguous = (0..256).filter(|&case| AMBIGUOUS_FACES[case] != 0).count();
        let diagonal = (0..256)
            .filter(|&case| AMBIGUOUS_FACES[case] == 0 && outcome(CaseIndex(case as u8), 0).may_have_tunnel())
            .count();
        assert_eq!((ambiguous, diagonal), (120, 8));
    }
}
