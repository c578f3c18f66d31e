//! One mesh per chunk: equal to its part of the whole mesh, to the last bit; and all files are written or none.

use std::collections::{BTreeMap, BTreeSet};

use marchless::MeshReport;
use proptest::prelude::*;

use crate::program::Folder;
use crate::readers::{self, Mesh};
use crate::volumes::{TYPES, Volume, random};

/// A vertex, bit for bit.
type Vertex = [[u32; 3]; 2];

fn vertex(mesh: &Mesh, index: u32) -> Vertex {
    [mesh.positions[index as usize], mesh.normals[index as usize]].map(|vector| vector.map(f32::to_bits))
}

fn triangles(mesh: &Mesh) -> Vec<[Vertex; 3]> {
    let corner = |index: &u32| vertex(mesh, *index);
    mesh.indices.chunks_exact(3).map(|triangle| [0, 1, 2].map(|k| corner(&triangle[k]))).collect()
}

/// The whole mesh's triangles by the number of the chunk that their middle lies in, x fastest. Those outside the volume
/// belong to the nearest chunk.
fn by_chunk(whole: &Mesh, size: [usize; 3], cells: usize, spacing: [f64; 3]) -> BTreeMap<usize, Vec<[Vertex; 3]>> {
    let counts = size.map(|samples| (samples - 1).div_ceil(cells));
    let mut chunks: BTreeMap<_, Vec<_>> = BTreeMap::new();
    for (corners, triangle) in whole.corners().iter().zip(triangles(whole)) {
        let [x, y, z] = [0, 1, 2].map(|axis| {
            let sum: f64 = corners.iter().map(|corner| f64::from(corner[axis])).sum();
            ((sum / 3.0 / spacing[axis]) as usize).min(size[axis] - 2) / cells
        });
        chunks.entry(x + counts[0] * (y + counts[1] * z)).or_default().push(triangle);
    }
    chunks
}

/// The chunks' meshes, by the numbers in their files' names.
fn read_chunks(folder: &Folder) -> BTreeMap<usize, Mesh> {
    let names = folder.names().into_iter().filter(|name| name.starts_with("o."));
    let chunks = names.map(|name| {
        let number = name.strip_prefix("o.").and_then(|name| name.strip_suffix(".ply")).expect("a chunk's name");
        assert_eq!(number.len(), 4, "{name}");
        (number.parse().expect("a number"), readers::ply(&folder.read(&name)))
    });
    chunks.collect()
}

/// The corners of the box around a chunk; with `close`, chunks at the volume's border reach a sample beyond it.
fn bounds(number: usize, size: [usize; 3], cells: usize, spacing: [f64; 3], close: bool) -> [[f32; 3]; 2] {
    let [x, y, _] = size.map(|samples| (samples - 1).div_ceil(cells));
    let chunk = [number % x, number / x % y, number / x / y];
    [0, 1].map(|end| {
        [0, 1, 2].map(|axis| {
            let sample = ((chunk[axis] + end) * cells).min(size[axis] - 1);
            let margin = match (close, sample) {
                (true, 0) => -1.0,
                (true, last) if last == size[axis] - 1 => 1.0,
                _ => 0.0,
            };
            ((sample as f64 + margin) * spacing[axis]) as f32
        })
    })
}

/// Asserts that each chunk is clean, equals its part of the whole mesh, and has the same vertices as its neighbours on
/// common borders.
fn assert_chunks(
    chunks: &BTreeMap<usize, Mesh>,
    whole: &Mesh,
    size: [usize; 3],
    cells: usize,
    spacing: [f64; 3],
    close: bool,
) {
    let expected = by_chunk(whole, size, cells, spacing);
    assert_eq!(chunks.keys().collect::<Vec<_>>(), expected.keys().collect::<Vec<_>>());
    let mut normals = BTreeMap::new();
    // The vertices on the faces of chunks: by axis and coordinate, those of the chunks below and above.
    let mut borders: BTreeMap<(usize, u32), [BTreeSet<Vertex>; 2]> = BTreeMap::new();
    for (&number, mesh) in chunks {
        assert_eq!(triangles(mesh), expected[&number], "chunk {number}");
        let bounds = bounds(number, size, cells, spacing, close);
        let report = MeshReport::in_box(&mesh.positions, &mesh.indices, bounds);
        assert!(report.is_clean(), "chunk {number}: {report}");
        for index in 0..mesh.positions.len() as u32 {
            let [position, normal] = vertex(mesh, index);
            assert_eq!(*normals.entry(position).or_insert(normal), normal, "{:?}", mesh.positions[index as usize]);
            for (axis, end) in (0..3).flat_map(|axis| [(axis, 0), (axis, 1)]) {
                if position[axis] == bounds[end][axis].to_bits() {
                    borders.entry((axis, position[axis])).or_default()[1 - end].insert([position, normal]);
                }
            }
        }
    }
    for ((axis, coordinate), [below, above]) in borders {
        let coordinate = f32::from_bits(coordinate);
        let last = ((size[axis] - 1) as f64 * spacing[axis]) as f32;
        if coordinate > 0.0 && coordinate < last {
            assert_eq!(below, above, "on the border at {coordinate} along axis {axis}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn chunks_are_the_whole_mesh_taken_apart(
        size in prop::array::uniform3(2usize..14),
        kind in prop::sample::select(&TYPES[..]),
        seed in 0usize..1000,
        amplitude in prop_oneof![Just(0.0), 5.0..200.0],
        cells in 1usize..9,
        spacing in prop_oneof![Just([1.0; 3]), prop::array::uniform3(prop::sample::select(&[0.1, 0.7, 1.0, 3.3][..]))],
        (fortran, invert, exact, close) in any::<(bool, bool, bool, bool)>(),
    ) {
        let volume = Volume::new(size, kind, |[x, y, z]| {
            let wave = (x as f64 * 0.9 + seed as f64).sin() + (y as f64 * 1.1).cos() + (z as f64 * 0.8).sin();
            60.0 + 20.0 * wave + amplitude * (random(seed + x + 100 * (y + 100 * z)) - 0.5)
        });
        let folder = Folder::new();
        folder.write("v.npy", &if fortran { volume.npy_fortran() } else { volume.npy(1) });
        let [x, y, z] = spacing;
        let mut args = format!("v.npy --iso 60 --spacing {x},{y},{z} --check");
        for flag in [(invert, " --invert"), (exact, " --exact"), (close, " --close")] {
            args += if flag.0 { flag.1 } else { "" };
        }
        folder.run(&format!("{args} -o whole.ply"));
        let output = folder.run(&format!("{args} --chunk {cells} -o o.ply"));
        let errors = String::from_utf8_lossy(&output.stderr);
        prop_assert!(output.status.success(), "{errors}");
        let whole = readers::ply(&folder.read("whole.ply"));
        let chunks = read_chunks(&folder);
        assert_chunks(&chunks, &whole, size, cells, spacing, close);
        let said = String::from_utf8_lossy(&output.stdout);
        prop_assert!(said.starts_with(&format!("meshes checked: {}, all clean\n", chunks.len())), "{said}");
        let count: usize = size.iter().map(|samples| (samples - 1).div_ceil(cells)).product();
        let vertices: usize = chunks.values().map(|mesh| mesh.positions.len()).sum();
        let counts = format!(
            "{kind} in {count} chunks, {} of them with a surface, {vertices} vertices, {} triangles; read",
            chunks.len(), whole.indices.len() / 3,
        );
        prop_assert!(said.contains(&counts), "{said}");
    }
}

/// The ball of the tests below has a surface in all but the outermost of 4 × 4 × 4 chunks of 8 cells.
fn ball(folder: &Folder) -> (Volume, String) {
    let volume = Volume::ball([33, 33, 33], "u8", 12.0, 0.0);
    folder.write("v.raw", &volume.bytes());
    let args = format!("v.raw {}", volume.flags());
    (volume, args)
}

#[test]
fn chunks_are_the_same_in_every_format() {
    let folder = Folder::new();
    let (volume, args) = ball(&folder);
    for format in ["ply", "obj", "stl", "glb"] {
        folder.mesh(&format!("{args} --iso 100 --chunk 8 -o o.{format}"));
    }
    folder.mesh(&format!("{args} --iso 100 -o whole.ply"));
    let names = folder.names();
    let ply: Vec<_> = names.iter().filter_map(|name| name.strip_prefix("o.")?.strip_suffix(".ply")).collect();
    let chunks: BTreeMap<_, _> = ply
        .iter()
        .map(|name| (name.parse().expect("a number"), readers::ply(&folder.read(&format!("o.{name}.ply")))))
        .collect();
    assert_chunks(&chunks, &readers::ply(&folder.read("whole.ply")), volume.size, 8, [1.0; 3], false);
    // The chunks at the volume's corners, and those along its edges that the ball does not reach, have no files.
    assert!(ply.len() > 20 && ply.len() < 64 && !ply.contains(&"0000"), "{ply:?}");
    for (name, mesh) in ply.iter().zip(chunks.values()) {
        assert_eq!(&readers::obj(&folder.read(&format!("o.{name}.obj"))), mesh);
        assert_eq!(readers::glb(&folder.read(&format!("o.{name}.glb"))).as_ref(), Some(mesh));
        assert_eq!(readers::stl(&folder.read(&format!("o.{name}.stl"))).0, mesh.corners());
    }
    assert_eq!(names.len(), 2 + 4 * ply.len());
}

#[test]
fn a_chunk_may_be_larger_than_the_volume() {
    let folder = Folder::new();
    let (volume, args) = ball(&folder);
    folder.mesh(&format!("{args} --iso 100 -o whole.ply"));
    for cells in ["32", "33", "4294967295"] {
        folder.mesh(&format!("{args} --iso 100 --chunk {cells} -o o.ply"));
        assert_eq!(folder.names(), ["o.0000.ply", "v.raw", "whole.ply"]);
        let whole = readers::ply(&folder.read("whole.ply"));
        assert_chunks(&read_chunks(&folder), &whole, volume.size, 32, [1.0; 3], false);
    }
}

#[test]
fn chunks_hold_what_rounding_moves_to_the_end_of_the_volume() {
    let folder = Folder::new();
    let volume = Volume::new([17001, 2, 2], "u8", |[x, _, _]| if x == 17000 { 0.0 } else { 255.0 });
    folder.write("v.raw", &volume.bytes());
    folder.mesh(&format!("v.raw {} --iso 0.001 --chunk 17000 -o o.ply", volume.flags()));
    let chunks = read_chunks(&folder);
    assert_eq!((chunks.len(), chunks[&0].indices.len()), (1, 6));
    assert!(chunks[&0].positions.iter().all(|position| position[0] == 17000.0));
}

#[test]
fn numbers_have_as_many_digits_as_the_last_one() {
    let folder = Folder::new();
    // A slab of surface in the middle of 102 × 102 × 1 chunks.
    let volume = Volume::new([103, 103, 2], "u8", |[x, _, _]| x as f64);
    folder.write("v.raw", &volume.bytes());
    folder.mesh(&format!("v.raw {} --iso 50.5 --chunk 1 -o some.mesh.ply", volume.flags()));
    let names = folder.names();
    assert_eq!((names.len(), &*names[0], &*names[101]), (103, "some.mesh.00050.ply", "some.mesh.10352.ply"));
}

#[test]
fn files_of_an_earlier_mesh_do_not_mix_with_the_new_one() {
    let folder = Folder::new();
    let (_, args) = ball(&folder);
    folder.mesh(&format!("{args} --iso 100 --chunk 8 -o o.ply"));
    let before = folder.names();
    // Other files in the folder must stay.
    let others = ["o.ply", "o.000.ply", "o.0000.obj", "o.0000.ply.bak", "o.+000.ply", "p.0000.ply", ".o.0000.ply"];
    for name in others {
        folder.write(name, b"other");
    }
    folder.write("o.0000.ply", b"old");
    folder.write("o.0001.ply", b"old");
    folder.mesh(&format!("{args} --iso 100 --chunk 8 -o o.ply"));
    let after: Vec<_> = folder.names().into_iter().filter(|name| !others.contains(&&**name)).collect();
    assert_eq!(after, before);
    assert!(others.iter().all(|name| folder.read(name) == b"other"));

    // A mesh of fewer chunks leaves the other numbered files in place, and notes them.
    let noted = folder.mesh_noting(&format!("{args} --iso 100 --chunk 16 -o o.ply"));
    assert!(noted.starts_with("note: no chunk of this mesh, and so left as it was: o.0008.ply and "), "{noted}");
    let noted = folder.mesh_noting(&format!("{args} --iso 1e6 --chunk 16 -o o.ply"));
    assert!(noted.contains("note: there is no surface"), "{noted}");
    assert!(!folder.path("o.0007.ply").exists() && folder.path("o.0008.ply").exists());
}

#[test]
fn bad_chunks_are_refused() {
    let folder = Folder::new();
    folder.write("v.raw", &vec![0; 200 * 200 * 100]);
    let args = "v.raw --shape 200,200,100 --type u8";
    for cells in ["0", "-1", "1.5", "1e2", "4294967296", "many", "-o"] {
        let because = ["a whole number of cells from 1 to 4294967295", "--chunk"];
        folder.assert_refused(&format!("{args} --chunk {cells} -o o.ply"), 2, &because);
    }
    let because = ["--chunk 1 makes 3920499 chunks", "no more than 1000000", "at least 2 cells"];
    folder.assert_refused(&format!("{args} --chunk 1 -o o.ply"), 2, &because);
    folder.assert_refused(&format!("{args} --chunk 50 -o missing/o.ply"), 2, &["no folder missing"]);
    folder.assert_refused(&format!("{args} --chunk 50 -o o"), 2, &[".ply, .obj, .stl or .glb"]);
    // A name that only the number makes too long.
    let name = "o".repeat(248);
    folder.assert_refused(&format!("{args} --chunk 50 -o {name}.ply"), 1, &[".0000.ply cannot be written"]);
    // What is in the way of a chunk, but not of the whole.
    for name in ["o.0003.ply", "o.ply"] {
        std::fs::create_dir(folder.path(name)).expect("the folder of tests can be written");
    }
    folder.assert_refused(&format!("{args} --chunk 50 -o o.ply"), 2, &["o.0003.ply", "not a file"]);
    folder.mesh_noting(&format!("{args} --chunk 199 --iso 1 -o o.ply"));
}
