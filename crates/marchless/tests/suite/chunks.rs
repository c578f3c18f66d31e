//! Random volumes, meshed whole and in chunks that are cut out of them by hand, in both topologies: every surface is
//! sound, and the chunks' borders match edge for edge, bit for bit.

mod volumes;

use std::collections::{HashMap, HashSet};

use marchless::{ExtractionReport, MeshBuffer, MeshReport, MeshSettings, Mesher, Region, Samples, Topology};
use proptest::prelude::*;
use volumes::{Volume, VolumeWeight};

const TOPOLOGIES: [Topology; 2] = [Topology::Separated, Topology::Trilinear];

/// An exact place in the volume: `f64` holds the sum of a chunk's origin and an `f32` position within the chunk.
type Place = [u64; 3];

/// The lattice edge or cell of a vertex: twice the coordinates of its middle, which are odd along each axis that it
/// extends along.
type Home = [i32; 3];

fn is_interior(position: &[f32; 3]) -> bool {
    position.iter().all(|coordinate| coordinate.fract() != 0.0)
}

fn mesh<W: VolumeWeight>(
    samples: Samples<'_, W>,
    volume: &Volume,
    topology: Topology,
) -> Result<MeshBuffer, TestCaseError> {
    let settings = MeshSettings { isovalue: volume.isovalue, topology, ..MeshSettings::default() };
    let mut mesh = MeshBuffer::new();
    Mesher::new().mesh(samples, &settings, &mut mesh)?;
    prop_assert_eq!((mesh.normals.len(), mesh.materials.len()), (mesh.positions.len(), mesh.positions.len()));
    for normal in &mesh.normals {
        let squared: f32 = normal.iter().map(|v| v * v).sum();
        prop_assert!((squared - 1.0).abs() < 1e-5, "{:?} is no unit vector", normal);
    }
    let report = ExtractionReport::new(samples, &settings, &mesh);
    prop_assert!(report.is_sound(), "{}", report);
    prop_assert_eq!(report.interior_vertices, mesh.positions.iter().filter(|p| is_interior(p)).count());
    Ok(mesh)
}

/// The whole volume at once.
fn check_whole<W: VolumeWeight>(volume: &Volume) -> Result<(), TestCaseError> {
    let points = volume.cells.map(|n| n as i32 + 1);
    let cut = volume.cut::<W>([0; 3], points);
    let meshes = [mesh(cut.samples(), volume, TOPOLOGIES[0])?, mesh(cut.samples(), volume, TOPOLOGIES[1])?];
    for mesh in &meshes {
        let bounds = [[0.0; 3], volume.cells.map(|n| n as f32)];
        let report = MeshReport::in_box(&mesh.positions, &mesh.indices, bounds);
        prop_assert!(report.is_clean(), "{}", report);
        if volume.enclosed {
            prop_assert!(report.is_closed() && report.euler % 2 == 0, "{}", report);
        }
    }
    // Whatever the topology, vertices on edges of the lattice are the same.
    let [separated, trilinear] = meshes.map(|mesh| {
        let vertices = mesh.positions.iter().zip(&mesh.normals).zip(mesh.materials);
        let on_edges = vertices.filter(|((position, _), _)| !is_interior(position));
        on_edges.map(|((p, n), material)| (p.map(f32::to_bits), n.map(f32::to_bits), material)).collect::<HashSet<_>>()
    });
    prop_assert_eq!(separated, trilinear);
    Ok(())
}

/// A chunk's cells, and its mesh.
struct GridChunk {
    region: Region,
    mesh: MeshBuffer,
}

impl GridChunk {
    fn coordinates(&self, vertex: u32) -> [f64; 3] {
        let position = self.mesh.positions[vertex as usize];
        [0, 1, 2].map(|axis| f64::from(self.region.min[axis]) + f64::from(position[axis]))
    }

    fn place(&self, vertex: u32) -> Place {
        self.coordinates(vertex).map(f64::to_bits)
    }

    fn home(&self, vertex: u32) -> Home {
        self.coordinates(vertex).map(|v| 2 * v.floor() as i32 + i32::from(v.fract() != 0.0))
    }

    /// The triangles by the homes of their vertices, each rotated to start with the least.
    fn triangles(&self) -> impl Iterator<Item = [Home; 3]> {
        self.mesh.triangles().map(|triangle| {
            let mut homes = triangle.map(|vertex| self.home(vertex));
            let least = (0..3).min_by_key(|&corner| homes[corner]).unwrap_or(0);
            homes.rotate_left(least);
            homes
        })
    }
}

/// A mesh for each chunk of at most `cells` cells per axis, of its samples and a layer of padding around them.
fn chunks<W: VolumeWeight>(volume: &Volume, cells: u32, topology: Topology) -> Result<Vec<GridChunk>, TestCaseError> {
    let counts = volume.cells.map(|n| n.div_ceil(cells) as i32);
    let mut chunks = Vec::new();
    for position in Region::new([0; 3], counts).points() {
        let min = position.map(|at| at * cells as i32);
        let max = [0, 1, 2].map(|axis| (min[axis] + cells as i32).min(volume.cells[axis] as i32));
        let cut = volume.cut::<W>(min.map(|v| v - 1), max.map(|v| v + 2));
        let mesh = mesh(cut.samples().padded(), volume, topology)?;
        let chunk = GridChunk { region: Region::new(min, max), mesh };
        let bounds = [[0.0; 3], chunk.region.size().map(|n| n as f32)];
        let report = MeshReport::in_box(&chunk.mesh.positions, &chunk.mesh.indices, bounds);
        prop_assert!(report.is_clean(), "{}", report);
        chunks.push(chunk);
    }
    Ok(chunks)
}

fn check_chunks<W: VolumeWeight>(volume: &Volume, cells: u32, topology: Topology) -> Result<(), TestCaseError> {
    let chunks = chunks::<W>(volume, cells, topology)?;
    check_vertices(&chunks)?;
    check_rims(volume, &chunks)?;

    // The whole has the same triangles.
    let cut = volume.cut::<W>([-1; 3], volume.cells.map(|n| n as i32 + 2));
    let region = Region::new([0; 3], volume.cells.map(|n| n as i32));
    let whole = GridChunk { region, mesh: mesh(cut.samples().padded(), volume, topology)? };
    let mut expected: Vec<_> = whole.triangles().collect();
    let mut found: Vec<_> = chunks.iter().flat_map(GridChunk::triangles).collect();
    expected.sort_unstable();
    found.sort_unstable();
    prop_assert!(found == expected, "{} triangles in chunks, {} in the whole", found.len(), expected.len());
    Ok(())
}

/// Every chunk whose box holds a vertex has that vertex, bit for bit.
fn check_vertices(chunks: &[GridChunk]) -> Result<(), TestCaseError> {
    let mut known: HashMap<Place, ([u32; 3], u8, usize)> = HashMap::new();
    for chunk in chunks {
        for vertex in 0..chunk.mesh.positions.len() {
            let (normal, material) = (chunk.mesh.normals[vertex].map(f32::to_bits), chunk.mesh.materials[vertex]);
            let place = chunk.place(vertex as u32);
            let (other_normal, other_material, count) = known.entry(place).or_insert((normal, material, 0));
            prop_assert_eq!((normal, material), (*other_normal, *other_material), "at {:?}", place.map(f64::from_bits));
            *count += 1;
        }
    }
    for (place, (.., count)) in known {
        let place = place.map(f64::from_bits);
        let holds = |chunk: &&GridChunk| {
            let Region { min, max } = chunk.region;
            (0..3).all(|axis| (f64::from(min[axis])..=f64::from(max[axis])).contains(&place[axis]))
        };
        prop_assert_eq!(chunks.iter().filter(holds).count(), count, "at {:?}", place);
    }
    Ok(())
}

/// Each side of a chunk's rim is the reverse of a side of another chunk's rim, or lies in a face of the volume.
fn check_rims(volume: &Volume, chunks: &[GridChunk]) -> Result<(), TestCaseError> {
    let mut rims: HashSet<[Place; 2]> = HashSet::new();
    for chunk in chunks {
        let sides = || chunk.mesh.triangles().flat_map(|[a, b, c]| [[a, b], [b, c], [c, a]]);
        let all: HashSet<[u32; 2]> = sides().collect();
        for [from, to] in sides().filter(|&[from, to]| !all.contains(&[to, from])) {
            let side = [chunk.place(from), chunk.place(to)];
            prop_assert!(rims.insert(side), "{:?} is there twice", side.map(|place| place.map(f64::from_bits)));
        }
    }
    for &[from, to] in &rims {
        let ends = [from, to].map(|place| place.map(f64::from_bits));
        let in_face = (0..3).any(|axis| {
            [0.0, f64::from(volume.cells[axis])].iter().any(|&face| ends.iter().all(|end| end[axis] == face))
        });
        prop_assert_eq!(rims.contains(&[to, from]), !in_face, "between {:?}", ends);
    }
    Ok(())
}

fn check<W: VolumeWeight>(volume: &Volume) -> Result<(), TestCaseError> {
    check_whole::<W>(volume)?;
    for topology in TOPOLOGIES {
        for cells in [2, 4, 8] {
            check_chunks::<W>(volume, cells, topology)?;
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn volumes_of_i8_are_sound_in_whole_and_in_parts(volume in Volume::any()) {
        check::<i8>(&volume)?;
    }

    #[test]
    fn volumes_of_i16_are_sound_in_whole_and_in_parts(volume in Volume::any()) {
        check::<i16>(&volume)?;
    }

    #[test]
    fn volumes_of_f32_are_sound_in_whole_and_in_parts(volume in Volume::any()) {
        check::<f32>(&volume)?;
    }
}
