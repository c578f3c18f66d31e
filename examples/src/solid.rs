//! [`Solid`]: a grid of bits as a mesh to look at: closed, smoothed, and darker where little light gets in.

use core::error::Error;

use bevy::asset::RenderAssetUsages;
use bevy::mesh::{Indices, PrimitiveTopology};
use bevy::prelude::*;
use marchless::bits::BitGrid;
use marchless::{MeshBuffer, Region};

use crate::glb;
use crate::look::linear;

/// The surface of the set points of a grid, in lattice coordinates: the grid's first point is at 0.
#[derive(Clone, Debug, Default)]
pub struct Solid {
    /// Positions, normals and triangles. Points outside the grid are not set, so that it is closed.
    pub mesh: MeshBuffer,
    /// Of each vertex, the share of unset points around: about 0.5 on a plane, less in a hollow, more on a ridge.
    pub openness: Vec<f32>,
}

/// How far around a vertex is looked for its openness. [Units: points]
const REACH: i32 = 4;

impl Solid {
    /// The mesh with vertices at edge midpoints, as it comes.
    ///
    /// # Errors
    /// Where memory or the numbers of vertices do not hold it.
    pub fn new(bits: &BitGrid) -> Result<Self, Box<dyn Error + Send + Sync>> {
        // A layer of unset points all round closes the surface.
        let [nx, ny, nz] = bits.shape().size().map(|size| size as i32);
        let mut mesh = MeshBuffer::new();
        bits.cut(Region::new([-1; 3], [nx + 1, ny + 1, nz + 1]))?.mesh(&mut mesh)?;
        mesh.positions.as_flattened_mut().iter_mut().for_each(|v| *v -= 1.0);
        let openness = mesh.positions.iter().zip(&mesh.normals).map(|(&position, &normal)| {
            let middle = (Vec3::from(position) + Vec3::from(normal)).round().as_ivec3();
            let around = Region::new((middle - REACH).to_array(), (middle + REACH + 1).to_array());
            1.0 - bits.count_in(around) as f32 / (2 * REACH + 1).pow(3) as f32
        });
        Ok(Self { openness: openness.collect(), mesh })
    }

    /// Smooths the steps that bits leave. `held` says which coordinates of a vertex stay as they are.
    ///
    /// After G. Taubin, "A signal processing approach to fair surface design" (1995): passes that shrink and passes that
    /// grow take turns, so that the body keeps its size.
    pub fn smooth(&mut self, passes: u32, held: impl Fn([f32; 3]) -> [bool; 3]) {
        let mesh = &mut self.mesh;
        let free: Vec<Vec3> =
            mesh.positions.iter().map(|&position| Vec3::from(held(position).map(|held| f32::from(!held)))).collect();
        let mut positions: Vec<Vec3> = mesh.positions.iter().copied().map(Vec3::from).collect();
        for strength in [0.5, -0.52].into_iter().cycle().take(2 * passes as usize) {
            // On a closed surface every edge runs once in each direction.
            let mut sums = vec![Vec4::ZERO; positions.len()];
            for [a, b, c] in mesh.triangles().map(|triangle| triangle.map(|v| v as usize)) {
                for (from, to) in [(a, b), (b, c), (c, a)] {
                    sums[from] += positions[to].extend(1.0);
                }
            }
            for ((position, sum), free) in positions.iter_mut().zip(&sums).zip(&free) {
                *position += strength * free * (sum.truncate() / sum.w.max(1.0) - *position);
            }
        }
        let mut normals = vec![Vec3::ZERO; positions.len()];
        for triangle in mesh.triangles().map(|triangle| triangle.map(|v| v as usize)) {
            let [a, b, c] = triangle.map(|v| positions[v]);
            let area = (b - a).cross(c - a);
            triangle.into_iter().for_each(|v| normals[v] += area);
        }
        mesh.positions = positions.iter().map(Vec3::to_array).collect();
        mesh.normals = normals.iter().map(|normal| normal.normalize_or(Vec3::Y).to_array()).collect();
    }

    /// A mesh for drawing. `color` gives a vertex' colour in sRGB for its position, normal and openness.
    pub fn to_asset(&self, color: impl Fn(Vec3, Vec3, f32) -> [f32; 3]) -> Mesh {
        Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::RENDER_WORLD)
            .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, self.mesh.positions.clone())
            .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, self.mesh.normals.clone())
            .with_inserted_attribute(
                Mesh::ATTRIBUTE_COLOR,
                self.colors(color).map(|color| color.to_f32_array()).collect::<Vec<_>>(),
            )
            .with_inserted_indices(Indices::U32(self.mesh.indices.clone()))
    }

    /// A mesh for a file, with colours as in [`to_asset`](Self::to_asset).
    pub fn to_file(&self, color: impl Fn(Vec3, Vec3, f32) -> [f32; 3]) -> glb::Mesh {
        glb::Mesh {
            positions: self.mesh.positions.clone(),
            normals: self.mesh.normals.clone(),
            colors: self.colors(color).map(|color| color.to_u8_array()).collect(),
            indices: self.mesh.indices.clone(),
        }
    }

    fn colors(&self, color: impl Fn(Vec3, Vec3, f32) -> [f32; 3]) -> impl Iterator<Item = LinearRgba> {
        let vertices = self.mesh.positions.iter().zip(&self.mesh.normals).zip(&self.openness);
        vertices.map(move |((&position, &normal), &openness)| {
            let light = (openness / 0.5).clamp(0.25, 1.0);
            let linear = linear(color(position.into(), normal.into(), openness)) * light;
            linear.with_alpha(1.0)
        })
    }
}
