//! What becomes of each case once its faces are decided, derived at compile time.

use crate::{
    cases::{Loops, triangulate},
    cell::{CaseIndex, Edge, Face},
};

/// What becomes of a cell.
#[derive(Clone, Copy)]
pub(super) struct Outcome(u16);

impl Outcome {
    /// The cell is made one by one.
    const MADE: u16 = 1 << 14;
    /// Sheets of it may be joined by a tunnel.
    const TUNNEL: u16 = 1 << 15;

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

/// What becomes of a case; bit `n` of `number` is set where the inside corners of the `n`th of its ambiguous faces are
/// joined.
pub(super) const fn outcome(case: CaseIndex, number: usize) -> Outcome {
    OUTCOMES[FIRST[case.0 as usize] as usize + number]
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

static FIRST: [u16; 256] = TABLE.first;
static OUTCOMES: [Outcome; ROOM] = TABLE.outcomes;

/// At least as many as there are outcomes, and extra codes.
const ROOM: usize = 1024;

struct Table {
    /// Of each case, where its outcomes begin.
    first: [u16; 256],
    outcomes: [Outcome; ROOM],
    extra: [Extra; ROOM],
    extras: usize,
}

const TABLE: Table = {
    let mut table = Table {
        first: [0; 256],
        outcomes: [Outcome(0); ROOM],
        extra: [Extra { case: CaseIndex(0), joined: 0 }; ROOM],
        extras: 0,
    };
    let (mut case, mut len) = (0, 0);
    while case < 256 {
        table.first[case] = len as u16;
        let (faces, mut number) = (AMBIGUOUS_FACES[case], 0);
        while number < 1 << faces.count_ones() {
            table.outcomes[len] = table.decided(CaseIndex(case as u8), spread(number, faces));
            len += 1;
            number += 1;
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
        Outcome((super::super::triangles::FIRST_EXTRA as usize + self.extras - 1) as u16 | tunnel)
    }
}

/// Moves bit `n` of `number` to the `n`th of the bits in `mask`.
const fn spread(number: u8, mask: u8) -> u8 {
    let (mut spread, mut place, mut bit) = (0, 0, 0);
    while bit < 8 {
        if mask >> bit & 1 == 1 {
            spread |= (number >> place & 1) << bit;
            place += 1;
        }
        bit += 1;
    }
    spread
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
