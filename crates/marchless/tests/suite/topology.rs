//! The topology of the surface against references without cases, loops or decisions: digital topology for the default
//! one, a refinement of the trilinear interpolant for the exact one.

mod digital;
mod disjoint;
mod pieces;
mod refined;
mod saddles;

use digital::Digital;
use fastrand::Rng;
use marchless::{MeshBuffer, MeshReport, MeshSettings, Mesher, Samples, Shape, Topology, Weight};
use pieces::{Piece, pieces_of};
use refined::Lattice;

/// The least distance of saddles from the isovalue, as a fraction of the range of a cell's values.
const DISTANCE: f64 = 0.05;

const FIELDS: usize = 200;

/// A random number whose products with small whole numbers are exact; the sign is given.
fn value(inside: bool, random: &mut Rng) -> f64 {
    let magnitude = (1 + random.u64(..4096)) as f64 / 4096.0;
    if inside { -magnitude } else { magnitude }
}

/// Any value, inside or outside.
fn any_value(random: &mut Rng) -> f64 {
    let inside = random.bool();
    value(inside, random)
}

fn cell(corners: [f64; 8]) -> Lattice {
    Lattice { size: [2; 3], values: corners.to_vec() }
}

fn mesh(lattice: &Lattice, topology: Topology) -> MeshBuffer {
    mesh_of::<f32>(lattice, MeshSettings { topology, ..MeshSettings::default() })
}

/// The mesh of a lattice whose values are raised by the isovalue.
fn mesh_of<W: Weight>(lattice: &Lattice, settings: MeshSettings) -> MeshBuffer {
    let weights: Vec<W> =
        lattice.values.iter().map(|&value| W::from_voxels(value as f32 + settings.isovalue)).collect();
    let shape = Shape::new(lattice.size.map(|n| n as u32)).expect("a small shape");
    let samples = Samples::new(shape, &weights).expect("one weight a sample");
    let mut mesh = MeshBuffer::new();
    Mesher::new().mesh(samples, &settings, &mut mesh).expect("there are cells");
    mesh
}

fn case_of(corners: [f64; 8]) -> usize {
    (0..8).filter(|&corner| corners[corner] < 0.0).map(|corner| 1 << corner).sum()
}

/// True if the signs of the corners leave something to decide: they alternate on a face, or two opposite corners differ
/// from all others.
fn is_ambiguous(case: usize) -> bool {
    let inside = |corner: usize| case >> corner & 1;
    let faces = (0..3).flat_map(|axis| {
        let (u, v) = (1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
        [0, 1 << axis].map(|base| [base, base + u, base + v, base + u + v])
    });
    let alternates =
        |[a, b, c, d]: [usize; 4]| inside(a) == inside(d) && inside(b) == inside(c) && inside(a) != inside(b);
    let opposite = (0..4).any(|corner| {
        let pair = 1 << corner | 1 << (7 - corner);
        case == pair || case == 255 - pair
    });
    faces.into_iter().any(alternates) || opposite
}

/// A random cell with these signs, with no saddle near the isovalue.
fn random_cell(case: usize, random: &mut Rng) -> Lattice {
    loop {
        let corners = core::array::from_fn(|corner| value(case >> corner & 1 == 1, random));
        if saddles::distance(&corners) >= DISTANCE {
            return cell(corners);
        }
    }
}

/// Cells whose topology is obvious.
#[test]
fn the_refinement_is_right_in_simple_cells() {
    let pieces = |values: [f64; 8]| {
        refined::pieces_of(&cell(values)).iter().map(|piece| (piece.crossings.len(), piece.euler, piece.rims)).collect()
    };
    let check = |values, expected: &[(usize, i64, usize)]| {
        let found: Vec<_> = pieces(values);
        assert_eq!(found, expected, "{values:?}");
    };
    check([1.0; 8], &[]);
    // A plane across the cell; one corner cut off.
    check([-1.0, -1.0, -1.0, -1.0, 1.0, 1.0, 1.0, 1.0], &[(4, 1, 1)]);
    check([-1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0], &[(3, 1, 1)]);
    // Two corners diagonal in a face, separate and joined; diagonal in the cell, separate and joined by a tunnel.
    check([-0.5, 1.0, 1.0, -0.5, 1.0, 1.0, 1.0, 1.0], &[(3, 1, 1), (3, 1, 1)]);
    check([-1.0, 0.5, 0.5, -1.0, 1.0, 1.0, 1.0, 1.0], &[(6, 1, 1)]);
    check([-0.5, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, -0.5], &[(3, 1, 1), (3, 1, 1)]);
    check([-1.0, 0.125, 0.125, 0.125, 0.125, 0.125, 0.125, -1.0], &[(6, 0, 2)]);
    check([1.0, -0.125, -0.125, -0.125, -0.125, -0.125, -0.125, 1.0], &[(6, 0, 2)]);
}

#[test]
fn unambiguous_cells_are_equal_in_both_topologies() {
    let mut random = Rng::with_seed(1);
    for case in (0..256).filter(|&case| !is_ambiguous(case)) {
        for _ in 0..4 {
            let lattice = random_cell(case, &mut random);
            let expected = refined::pieces_of(&lattice);
            for topology in [Topology::Separated, Topology::Trilinear] {
                assert_eq!(pieces_of(&mesh(&lattice, topology)), expected, "{topology:?}: {lattice:?}");
            }
        }
    }
}

#[test]
fn ambiguous_cells_have_the_topology_of_the_interpolant() {
    let seed = 0x7472_696c_696e_6561;
    println!("seed {seed:#x}");
    let mut random = Rng::with_seed(seed);
    let (mut cells, mut agree, mut as_separated) = (0, 0, 0);
    let mut first = None;
    for case in (0..256).filter(|&case| is_ambiguous(case)) {
        for _ in 0..16 {
            let lattice = random_cell(case, &mut random);
            let expected = refined::pieces_of(&lattice);
            let found = pieces_of(&mesh(&lattice, Topology::Trilinear));
            cells += 1;
            as_separated += usize::from(pieces_of(&mesh(&lattice, Topology::Separated)) == expected);
            if found == expected {
                agree += 1;
            } else {
                first.get_or_insert((case, lattice, expected, found));
            }
        }
    }
    println!("{cells} cells, {agree} agree, {as_separated} with the default topology");
    if let Some((case, lattice, expected, found)) = first {
        panic!("case {case:08b}, {:?}: expected {expected:#?}, found {found:#?}", lattice.values);
    }
}

/// The values are exact in all types of weights; some equal the isovalue.
#[test]
fn all_types_of_weights_and_all_isovalues_give_one_topology() {
    let mut random = Rng::with_seed(816);
    for case in (0..256).filter(|&case| is_ambiguous(case)) {
        for number in 0..60 {
            let steps = [1, 3, 60][number % 3];
            let lattice = cell(core::array::from_fn(|corner| {
                let magnitude = (1 + random.u64(..steps)) as f64 / 32.0;
                if case >> corner & 1 == 1 { -magnitude } else { magnitude }
            }));
            let isovalue = random.u64(..121) as f32 / 32.0 - 60.0 / 32.0;
            let settings = MeshSettings { isovalue, topology: Topology::Trilinear, ..MeshSettings::default() };
            let expected = pieces_of(&mesh(&lattice, Topology::Trilinear));
            for mesh in [mesh_of::<i8>, mesh_of::<i16>, mesh_of::<f32>] {
                assert_eq!(pieces_of(&mesh(&lattice, settings)), expected, "{isovalue}, {:?}", lattice.values);
            }
        }
    }
}

/// A lattice of random samples with no saddle near the isovalue. The outermost samples are air if it is `enclosed`.
fn random_field(cells: [u64; 3], enclosed: bool, smooth: bool, random: &mut Rng) -> Lattice {
    let size = cells.map(|n| n as usize + 1);
    let mut field = Lattice { size, values: vec![1.0; size.iter().product()] };
    let outermost = |point: [usize; 3]| (0..3).any(|axis| point[axis] == 0 || point[axis] + 1 == size[axis]);
    let phases = [(); 6].map(|()| random.f64() * 6.0);
    let points: Vec<[usize; 3]> =
        (0..field.values.len()).map(|i| [i % size[0], i / size[0] % size[1], i / size[0] / size[1]]).collect();
    for (index, &point) in points.iter().enumerate() {
        let wave = |axis: usize| (point[axis] as f64 * (0.8 + 0.2 * phases[axis]) + phases[axis + 3]).sin();
        field.values[index] = match (enclosed && outermost(point), smooth) {
            (true, _) => value(false, random),
            // Odd multiples of 1/8192: exact in the refinement, and never zero.
            (false, true) => ((wave(0) + wave(1) * wave(2)) * 2048.0).round() / 4096.0 + 1.0 / 8192.0,
            (false, false) => any_value(random),
        };
    }
    // Redraws samples until no cell has a saddle near the isovalue.
    loop {
        let spoilt: Vec<[usize; 3]> =
            field.cells().filter(|&cell| saddles::distance(&field.corners(cell)) < DISTANCE).collect();
        if spoilt.is_empty() {
            return field;
        }
        for cell in spoilt {
            let corner = random.u64(..8) as usize;
            let point = core::array::from_fn(|axis| cell[axis] + (corner >> axis & 1));
            let index = field.index(point);
            field.values[index] = if enclosed && outermost(point) { value(false, random) } else { any_value(random) };
        }
    }
}

#[test]
fn fields_have_the_topology_of_the_interpolant() {
    let seed = 0x6669_656c_6473;
    println!("seed {seed:#x}");
    let mut random = Rng::with_seed(seed);
    let (mut agree, mut as_separated, mut pieces, mut handles) = (0, 0, 0, 0);
    let mut first = None;
    for number in 0..FIELDS {
        let cells = [(); 3].map(|()| 4 + random.u64(..5));
        let (enclosed, smooth) = (number % 2 == 0, number % 4 < 2);
        let field = loop {
            let field = random_field(cells, enclosed, smooth, &mut random);
            if field.cells().any(|cell| is_ambiguous(case_of(field.corners(cell)))) {
                break field;
            }
        };
        let expected = refined::pieces_of(&field);
        assert!(!enclosed || expected.iter().all(|piece| piece.rims == 0), "{field:?}");
        let found = pieces_of(&mesh(&field, Topology::Trilinear));
        as_separated += usize::from(pieces_of(&mesh(&field, Topology::Separated)) == expected);
        pieces += expected.len();
        handles += expected.iter().map(|piece| (2 - piece.euler - piece.rims as i64) / 2).sum::<i64>();
        if found == expected {
            agree += 1;
        } else {
            first.get_or_insert((field, expected, found));
        }
    }
    println!(
        "{FIELDS} fields of {pieces} pieces and {handles} handles, {agree} agree, {as_separated} with the default"
    );
    if let Some((field, expected, found)) = first {
        // A cell that differs by itself makes a better message.
        for at in field.cells() {
            let lattice = cell(field.corners(at));
            let [expected, found] = [refined::pieces_of(&lattice), pieces_of(&mesh(&lattice, Topology::Trilinear))];
            assert_eq!(found, expected, "the cell at {at:?}: {:?}", lattice.values);
        }
        let only = |a: &[Piece], b: &[Piece]| -> Vec<Piece> { a.iter().filter(|&p| !b.contains(p)).cloned().collect() };
        let (missing, other) = (only(&expected, &found), only(&found, &expected));
        panic!("{field:?}: expected {missing:#?}, found {other:#?}");
    }
}

/// A random set of points, none of them outermost.
fn random_set(size: [usize; 3], share: u64, random: &mut Rng) -> Digital {
    let len: usize = size.iter().product();
    let inside = |index: usize, random: &mut Rng| {
        let at = [index % size[0], index / size[0] % size[1], index / size[0] / size[1]];
        (0..3).all(|axis| at[axis] > 0 && at[axis] + 1 < size[axis]) && random.u64(..16) < share
    };
    Digital { size, inside: (0..len).map(|index| inside(index, random)).collect() }
}

fn check_digital(set: &Digital, random: &mut Rng) {
    let values = set.inside.iter().map(|&inside| value(inside, random)).collect();
    let mesh = mesh(&Lattice { size: set.size, values }, Topology::Separated);
    let report = MeshReport::new(&mesh.positions, &mesh.indices);
    assert!(report.is_closed() && report.is_clean(), "{set:?}: {report}");
    let regions = set.inside_parts() + set.outside_parts();
    assert_eq!((report.components + 1, report.euler), (regions, 2 * set.euler()), "{set:?}: {report}");
}

#[test]
fn the_default_topology_joins_6_neighbours_inside_and_18_outside() {
    let mut random = Rng::with_seed(6 + 18);
    for case in 0..256u32 {
        let inside = |index: usize| {
            let at = [index % 4, index / 4 % 4, index / 16];
            at.iter().all(|at| (1..3).contains(at)) && case >> (at[0] - 1 + 2 * (at[1] - 1) + 4 * (at[2] - 1)) & 1 == 1
        };
        check_digital(&Digital { size: [4; 3], inside: (0..64).map(inside).collect() }, &mut random);
    }
    let (mut sets, seed) = (0, 0x6469_6769_7461_6c00);
    println!("seed {seed:#x}");
    let mut random = Rng::with_seed(seed);
    for share in 2..=14 {
        for _ in 0..200 {
            let size = [(); 3].map(|()| 3 + random.u64(..8) as usize);
            check_digital(&random_set(size, share, &mut random), &mut random);
            sets += 1;
        }
    }
    println!("{sets} sets");
}
