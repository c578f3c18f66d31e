//! Binary glTF: one mesh of one primitive, its positions and normals side by side, then its indices.

use std::io::Write;

use gltf_json as json;
use json::accessor::{ComponentType, GenericComponentType, Type};
use json::buffer::{Stride, Target};
use json::mesh::Semantic::{Normals, Positions};
use json::validation::{Checked::Valid, USize64};
use marchless::MeshBuffer;

use super::{Encoder, OutputError, bytes};

/// The number of bytes before the JSON: the file's magic, version and length, and the chunk's length and kind.
const BEFORE_JSON: usize = 20;
/// The space for the JSON, which is padded with spaces.
const JSON: usize = 1536;
/// The number of bytes after the JSON: the length and kind of the chunk of vertices and indices.
const AFTER_JSON: usize = 8;

const VERTEX: u64 = 24;
const TRIANGLE: u64 = 12;

#[derive(Default)]
pub(super) struct Glb {
    vertices: u64,
    triangles: u64,
    /// The smallest box around all positions.
    bounds: Option<[[f32; 3]; 2]>,
}

impl Encoder for Glb {
    fn header_length(&self) -> usize {
        BEFORE_JSON + JSON + AFTER_JSON
    }

    fn encode(&mut self, piece: &MeshBuffer, body: &mut dyn Write, tail: &mut dyn Write) -> Result<(), OutputError> {
        self.vertices += piece.positions.len() as u64;
        self.triangles += piece.triangle_count() as u64;
        self.length()?;
        for (&position, &normal) in piece.positions.iter().zip(&piece.normals) {
            let [min, max] = self.bounds.get_or_insert([position; 2]);
            for axis in 0..3 {
                min[axis] = min[axis].min(position[axis]);
                max[axis] = max[axis].max(position[axis]);
            }
            body.write_all(bytes([position, normal]).as_flattened().as_flattened())?;
        }
        for triangle in piece.triangles() {
            tail.write_all(triangle.map(u32::to_le_bytes).as_flattened())?;
        }
        Ok(())
    }

    fn header(&self) -> Result<Vec<u8>, OutputError> {
        let length = self.length()?;
        let binary = length - self.header_length() as u32;
        // glTF has neither empty arrays nor an empty chunk for them. The JSON then reaches to the end of the file.
        let json = if binary == 0 { JSON + AFTER_JSON } else { JSON };
        let mut header = [&b"glTF"[..], &2u32.to_le_bytes(), &length.to_le_bytes()].concat();
        header.extend((json as u32).to_le_bytes());
        header.extend(b"JSON");
        header.extend(self.json()?);
        header.resize(BEFORE_JSON + json, b' ');
        if binary > 0 {
            header.extend(binary.to_le_bytes());
            header.extend(b"BIN\0");
        }
        Ok(header)
    }
}

impl Glb {
    /// The length of the file in bytes.
    fn length(&self) -> Result<u32, OutputError> {
        let length = self.header_length() as u64 + self.vertices * VERTEX + self.triangles * TRIANGLE;
        u32::try_from(length).map_err(|_| OutputError::GlbTooLong)
    }

    /// The scene: a node with the mesh, or an empty one where there is no surface.
    fn json(&self) -> Result<Vec<u8>, OutputError> {
        let mut root = json::Root::default();
        let mut node = json::Node::default();
        if let Some(bounds) = self.bounds {
            node.mesh = Some(self.push_mesh(&mut root, bounds));
        }
        let nodes = vec![root.push(node)];
        let scene = json::Scene { nodes, name: None, extensions: None, extras: json::Extras::default() };
        root.scene = Some(root.push(scene));
        json::serialize::to_vec(&root).map_err(|error| OutputError::Io(error.into()))
    }

    /// Adds the mesh with its buffer, whose vertices come before its triangles.
    fn push_mesh(&self, root: &mut json::Root, bounds: [[f32; 3]; 2]) -> json::Index<json::Mesh> {
        let [corners, triangles] = self.push_buffer_views(root);
        let vector = (self.vertices, ComponentType::F32, Type::Vec3);
        let positions = push_accessor(root, corners, 0, vector, Some(bounds));
        let normals = push_accessor(root, corners, 12, vector, None);
        let scalar = (3 * self.triangles, ComponentType::U32, Type::Scalar);
        let indices = push_accessor(root, triangles, 0, scalar, None);
        root.push(json::Mesh {
            primitives: vec![json::mesh::Primitive {
                attributes: [(Valid(Positions), positions), (Valid(Normals), normals)].into(),
                indices: Some(indices),
                material: None,
                mode: Valid(json::mesh::Mode::Triangles),
                targets: None,
                extensions: None,
                extras: json::Extras::default(),
            }],
            weights: None,
            name: None,
            extensions: None,
            extras: json::Extras::default(),
        })
    }

    /// Adds the buffer, and its views of the vertices and of the triangles.
    fn push_buffer_views(&self, root: &mut json::Root) -> [json::Index<json::buffer::View>; 2] {
        let (vertices, indices) = (self.vertices * VERTEX, self.triangles * TRIANGLE);
        let buffer = root.push(json::Buffer {
            byte_length: USize64(vertices + indices),
            uri: None,
            name: None,
            extensions: None,
            extras: json::Extras::default(),
        });
        let mut view = |start, length, stride, target| {
            root.push(json::buffer::View {
                buffer,
                byte_length: USize64(length),
                byte_offset: Some(USize64(start)),
                byte_stride: stride,
                name: None,
                target: Some(Valid(target)),
                extensions: None,
                extras: json::Extras::default(),
            })
        };
        [
            view(0, vertices, Some(Stride(VERTEX as usize)), Target::ArrayBuffer),
            view(vertices, indices, None, Target::ElementArrayBuffer),
        ]
    }
}

/// Adds an accessor: `start`, its first byte in the view; how many items it has, and of which type; their bounds.
fn push_accessor(
    root: &mut json::Root,
    view: json::Index<json::buffer::View>,
    start: u64,
    (count, component, shape): (u64, ComponentType, Type),
    bounds: Option<[[f32; 3]; 2]>,
) -> json::Index<json::Accessor> {
    let [min, max] = bounds.map_or([None, None], |bounds| bounds.map(|corner| Some(corner.to_vec().into())));
    root.push(json::Accessor {
        buffer_view: Some(view),
        byte_offset: Some(USize64(start)),
        count: USize64(count),
        component_type: Valid(GenericComponentType(component)),
        type_: Valid(shape),
        min,
        max,
        name: None,
        normalized: false,
        sparse: None,
        extensions: None,
        extras: json::Extras::default(),
    })
}
