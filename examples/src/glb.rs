//! [`write()`]: a mesh as a binary glTF file, which Blender and most viewers open.

use std::borrow::Cow;
use std::io::{self, Write as _};
use std::path::Path;

use crate::files::write_atomically;
use gltf_json as json;
use json::accessor::{ComponentType, GenericComponentType, Type};
use json::validation::Checked::Valid;
use json::validation::USize64;

/// An indexed mesh with a normal and a linear colour per vertex.
#[derive(Debug, Default)]
pub struct Mesh {
    /// [Units: metres]
    pub positions: Vec<[f32; 3]>,
    /// Of unit length.
    pub normals: Vec<[f32; 3]>,
    /// Red, green, blue and alpha.
    pub colors: Vec<[u8; 4]>,
    /// Three a triangle.
    pub indices: Vec<u32>,
}

/// Writes `mesh` to a file; an old one is replaced only by a whole new one.
///
/// # Errors
/// What the system says.
pub fn write(path: &Path, mesh: &Mesh) -> io::Result<()> {
    let mut file = Builder::default();
    let (positions, min, max) = (flat(&mesh.positions), bound(mesh, f32::min), bound(mesh, f32::max));
    let position = file.push(&positions, mesh.positions.len(), ComponentType::F32, Type::Vec3);
    let normal = file.push(&flat(&mesh.normals), mesh.normals.len(), ComponentType::F32, Type::Vec3);
    let color = file.push(mesh.colors.as_flattened(), mesh.colors.len(), ComponentType::U8, Type::Vec4);
    let indices: Vec<u8> = mesh.indices.iter().flat_map(|index| index.to_le_bytes()).collect();
    let indices = file.push(&indices, mesh.indices.len(), ComponentType::U32, Type::Scalar);
    file.root.accessors[position.value()].min = Some(json::serialize::to_value(min)?);
    file.root.accessors[position.value()].max = Some(json::serialize::to_value(max)?);
    file.root.accessors[color.value()].normalized = true;

    use json::mesh::Semantic::{Colors, Normals, Positions};
    let attributes = [(Positions, position), (Normals, normal), (Colors(0), color)];
    let primitive = json::mesh::Primitive {
        attributes: attributes.into_iter().map(|(semantic, accessor)| (Valid(semantic), accessor)).collect(),
        indices: Some(indices),
        material: None,
        mode: Valid(json::mesh::Mode::Triangles),
        targets: None,
        extensions: None,
        extras: json::Extras::default(),
    };
    let bytes = file.finish(primitive)?;
    write_atomically(path, |file| file.write_all(&bytes))
}

/// A glTF file with one mesh in the making.
#[derive(Default)]
struct Builder {
    root: json::Root,
    bytes: Vec<u8>,
}

impl Builder {
    /// Adds an array of `count` elements.
    fn push(
        &mut self,
        bytes: &[u8],
        count: usize,
        component: ComponentType,
        shape: Type,
    ) -> json::Index<json::Accessor> {
        let view = self.root.push(json::buffer::View {
            buffer: json::Index::new(0),
            byte_length: USize64::from(bytes.len()),
            byte_offset: Some(USize64::from(self.bytes.len())),
            byte_stride: None,
            name: None,
            target: None,
            extensions: None,
            extras: json::Extras::default(),
        });
        // All elements are of 4 bytes or a multiple of it, so that all arrays are aligned.
        self.bytes.extend_from_slice(bytes);
        self.root.push(json::Accessor {
            buffer_view: Some(view),
            byte_offset: None,
            count: USize64::from(count),
            component_type: Valid(GenericComponentType(component)),
            type_: Valid(shape),
            min: None,
            max: None,
            name: None,
            normalized: false,
            sparse: None,
            extensions: None,
            extras: json::Extras::default(),
        })
    }

    /// The file as bytes.
    fn finish(mut self, primitive: json::mesh::Primitive) -> io::Result<Vec<u8>> {
        let Self { root, bytes } = &mut self;
        root.push(json::Buffer {
            byte_length: USize64::from(bytes.len()),
            uri: None,
            name: None,
            extensions: None,
            extras: json::Extras::default(),
        });
        let name = Some("surface".to_owned());
        let mesh = root.push(json::Mesh {
            primitives: vec![primitive],
            weights: None,
            name: name.clone(),
            extensions: None,
            extras: json::Extras::default(),
        });
        let node = root.push(json::Node { mesh: Some(mesh), name, ..json::Node::default() });
        root.push(json::Scene { nodes: vec![node], name: None, extensions: None, extras: json::Extras::default() });
        let json = json::serialize::to_vec(&root)?;
        let header = gltf::binary::Header { magic: *b"glTF", version: 2, length: 0 };
        let glb = gltf::binary::Glb { header, json: Cow::Owned(json), bin: Some(Cow::Borrowed(bytes)) };
        glb.to_vec().map_err(io::Error::other)
    }
}

fn flat(vectors: &[[f32; 3]]) -> Vec<u8> {
    vectors.as_flattened().iter().flat_map(|number| number.to_le_bytes()).collect()
}

fn bound(mesh: &Mesh, choose: fn(f32, f32) -> f32) -> [f32; 3] {
    let choose = |a: [f32; 3], b: [f32; 3]| core::array::from_fn(|axis| choose(a[axis], b[axis]));
    mesh.positions.iter().copied().reduce(choose).unwrap_or_default()
}
