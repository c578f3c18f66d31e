//! Plain readers of the program's formats. They are strict and accept only what the program writes.

use std::collections::HashMap;

use marchless::MeshReport;

/// A mesh as read from a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Mesh {
    pub(crate) positions: Vec<[f32; 3]>,
    pub(crate) normals: Vec<[f32; 3]>,
    pub(crate) indices: Vec<u32>,
}

impl Mesh {
    pub(crate) fn report(&self) -> MeshReport {
        MeshReport::new(&self.positions, &self.indices)
    }

    /// The corners of each triangle.
    pub(crate) fn corners(&self) -> Vec<[[f32; 3]; 3]> {
        let corner = |&index: &u32| self.positions[index as usize];
        self.indices.chunks_exact(3).map(|triangle| [0, 1, 2].map(|k| corner(&triangle[k]))).collect()
    }

    /// The volume that the surface encloses; negative if its triangles face inwards.
    pub(crate) fn volume(&self) -> f64 {
        self.corners()
            .iter()
            .map(|corners| {
                let [a, b, c] = corners.map(|corner| corner.map(f64::from));
                let cross = [b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]];
                (a[0] * cross[0] + a[1] * cross[1] + a[2] * cross[2]) / 6.0
            })
            .sum()
    }
}

pub(crate) fn ply(file: &[u8]) -> Mesh {
    let end = b"end_header\n";
    let start = file.windows(end.len()).position(|window| window == end).expect("an end of the header") + end.len();
    let header = str::from_utf8(&file[..start]).expect("a header of text");
    let lines: Vec<&str> = header.lines().filter(|line| !line.starts_with("comment ")).collect();
    let [first, format, vertices, x, y, z, nx, ny, nz, faces, list, _] = lines[..] else { panic!("{header}") };
    assert_eq!([first, format], ["ply", "format binary_little_endian 1.0"]);
    let properties = ["x", "y", "z", "nx", "ny", "nz"].map(|name| format!("property float {name}"));
    assert_eq!([x, y, z, nx, ny, nz], properties.each_ref().map(String::as_str));
    assert_eq!(list, "property list uchar uint vertex_indices");
    let count = |line: &str, what| line.strip_prefix(what).and_then(|count| count.parse().ok()).expect("a count");
    let (vertices, faces): (usize, usize) = (count(vertices, "element vertex "), count(faces, "element face "));

    assert_eq!(file.len(), start + 24 * vertices + 13 * faces);
    let (body, tail) = file[start..].split_at(24 * vertices);
    let mut mesh = Mesh::default();
    for vertex in body.chunks_exact(24) {
        mesh.positions.push(vector(&vertex[..12]));
        mesh.normals.push(vector(&vertex[12..]));
    }
    for face in tail.chunks_exact(13) {
        assert_eq!(face[0], 3);
        mesh.indices.extend(face[1..].as_chunks().0.iter().map(|&index| u32::from_le_bytes(index)));
    }
    mesh
}

pub(crate) fn obj(file: &[u8]) -> Mesh {
    let mut mesh = Mesh::default();
    for line in str::from_utf8(file).expect("text").lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        let numbers = || [1, 2, 3].map(|k| words[k].parse().expect("a number"));
        match words[0] {
            "#" => continue,
            "v" => mesh.positions.push(numbers()),
            "vn" => mesh.normals.push(numbers()),
            "f" => {
                for corner in &words[1..] {
                    let (vertex, normal) = corner.split_once("//").expect("a vertex and a normal");
                    assert_eq!(vertex, normal);
                    mesh.indices.push(vertex.parse::<u32>().expect("an index") - 1);
                }
            }
            _ => panic!("{line}"),
        }
        assert_eq!(words.len(), 4, "{line}");
    }
    mesh
}

/// The facets' corners and normals.
pub(crate) fn stl(file: &[u8]) -> (Vec<[[f32; 3]; 3]>, Vec<[f32; 3]>) {
    assert!(!file.starts_with(b"solid"));
    let count = u32::from_le_bytes(file[80..84].try_into().expect("4 bytes"));
    assert_eq!(file.len(), 84 + 50 * count as usize);
    let facets = file[84..].chunks_exact(50).map(|facet| {
        assert_eq!(facet[48..], [0, 0]);
        let [normal, a, b, c] = [0, 12, 24, 36].map(|at| vector(&facet[at..at + 12]));
        ([a, b, c], normal)
    });
    facets.unzip()
}

/// The facets as a mesh. Vertices in the same place become one.
pub(crate) fn welded(facets: &[[[f32; 3]; 3]]) -> Mesh {
    let (mut mesh, mut known) = (Mesh::default(), HashMap::new());
    for &corner in facets.as_flattened() {
        let index = *known.entry(corner.map(f32::to_bits)).or_insert_with(|| {
            mesh.positions.push(corner);
            mesh.positions.len() as u32 - 1
        });
        mesh.indices.push(index);
    }
    mesh
}

/// The mesh, or `None` if the file has none. Checks that the bounds are those of the positions.
pub(crate) fn glb(file: &[u8]) -> Option<Mesh> {
    assert_eq!(file[8..12], (file.len() as u32).to_le_bytes());
    let gltf = gltf::Gltf::from_slice(file).expect("valid glTF");
    let mesh = gltf.default_scene().expect("a scene").nodes().next().expect("a node").mesh()?;
    let blob = gltf.blob.as_deref().expect("a chunk of data");
    let buffers: Vec<_> = gltf.buffers().map(|buffer| buffer.length()).collect();
    assert_eq!(buffers, [blob.len()]);
    let primitive = mesh.primitives().next().expect("a primitive");
    assert_eq!(primitive.mode(), gltf::mesh::Mode::Triangles);
    let reader = primitive.reader(|_| Some(blob));
    let mesh = Mesh {
        positions: reader.read_positions().expect("positions").collect(),
        normals: reader.read_normals().expect("normals").collect(),
        indices: reader.read_indices().expect("indices").into_u32().collect(),
    };
    let bound = |choose: fn(f32, f32) -> f32| {
        let choose = |a: [f32; 3], b: [f32; 3]| [0, 1, 2].map(|axis| choose(a[axis], b[axis]));
        mesh.positions.iter().copied().reduce(choose).expect("a vertex")
    };
    let bounds = primitive.bounding_box();
    assert_eq!([bounds.min, bounds.max], [bound(f32::min), bound(f32::max)]);
    Some(mesh)
}

fn vector(bytes: &[u8]) -> [f32; 3] {
    let numbers = bytes.as_chunks().0;
    [0, 1, 2].map(|axis| f32::from_le_bytes(numbers[axis]))
}
