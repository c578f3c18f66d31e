//! [`Solid`]: a grid of bits or a part of a source as a mesh to look at: closed, and darker where little light gets in.

use core::error::Error;

use bevy::asset::RenderAssetUsages;
use bevy::mesh::{Indices, PrimitiveTopology};
use bevy::prelude::*;
use bevy_marchless::prelude::Palette;
use marchless::bits::BitGrid;
use marchless::{MeshBuffer, MeshSettings, Mesher, Region, Samples, Source, SourceRegion};

use crate::glb;
use crate::look::linear;

/// The surface of the set points of a grid, or of the solid ones of a region, in lattice coordinates: the first point
/// is at 0.
#[derive(Clone, Debug, Default)]
pub struct Solid {
    /// Positions, normals, triangles, and materials where there are any. All beyond the last points is empty, so that
    /// it is closed.
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
        Ok(Self { openness: openness(&mesh, bits, REACH), mesh })
    }

    /// What a source has in a region, cut out of it: half a voxel beyond the region's last points there are flat faces.
    /// `reach`: how far around a vertex is looked for its openness. [Units: points]
    ///
    /// # Errors
    /// Where memory or the numbers of vertices do not hold it.
    pub fn of_source(
        source: &impl Source,
        region: &SourceRegion,
        reach: i32,
    ) -> Result<Self, Box<dyn Error + Send + Sync>> {
        let around = region.grown(1);
        let shape = around.shape()?;
        let (mut distances, mut materials) = (vec![0.0; shape.len()], vec![0; shape.len()]);
        source.fill(&around, &mut distances, &mut materials);
        distances.iter_mut().for_each(|distance| *distance = distance.clamp(-8.0, 8.0));
        // Just beyond the last points it is as empty as it is solid there, so that the faces lie half-way.
        let [nx, ny, nz] = around.size;
        for [x, y, z] in Region::new([0; 3], around.size.map(|size| size as i32)).points().map(|p| p.map(|v| v as u32))
        {
            let last = [x.min(nx - 2).max(1), y.min(ny - 2).max(1), z.min(nz - 2).max(1)];
            if last != [x, y, z] {
                distances[shape.index([x, y, z])] = distances[shape.index(last)].abs();
            }
        }
        let samples = Samples::new(shape, &distances)?.with_materials(&materials)?;
        let mut mesh = MeshBuffer::new();
        Mesher::new().mesh(samples, &MeshSettings::default(), &mut mesh)?;
        let bits = BitGrid::from_samples(samples, 0.0)?;
        let openness = openness(&mesh, &bits, reach);
        mesh.positions.as_flattened_mut().iter_mut().for_each(|v| *v -= 1.0);
        for (position, normal) in mesh.positions.iter().zip(&mut mesh.normals) {
            for axis in 0..3 {
                let high = position[axis] == region.size[axis] as f32 - 0.5;
                if high || position[axis] == -0.5 {
                    *normal = [0.0; 3];
                    normal[axis] = if high { 1.0 } else { -1.0 };
                }
            }
        }
        Ok(Self { openness, mesh })
    }

    /// Smooths the steps that bits leave. `held` says which coordinates of a vertex stay as they are.
    ///
    /// After G. Taubin, "A signal processing approach to fair surface design" (1995): passes that shrink and passes
    /// that grow take turns, so that the body keeps its size.
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
        self.asset(self.colors(color))
    }

    /// A mesh for drawing, with the colours of its materials.
    pub fn to_asset_of_materials(&self, palette: &Palette) -> Mesh {
        let vertices = self.mesh.materials.iter().zip(&self.openness);
        self.asset(vertices.map(|(&material, &openness)| shaded(palette.color(material).to_linear(), openness)))
    }

    fn asset(&self, colors: impl Iterator<Item = LinearRgba>) -> Mesh {
        Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::RENDER_WORLD)
            .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, self.mesh.positions.clone())
            .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, self.mesh.normals.clone())
            .with_inserted_attribute(
                Mesh::ATTRIBUTE_COLOR,
                colors.map(|color| color.to_f32_array()).collect::<Vec<_>>(),
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
            shaded(linear(color(position.into(), normal.into(), openness)), openness)
        })
    }
}

/// Of each vertex, the share of unset points up to `reach` away. The first of the bits is at 0.
fn openness(mesh: &MeshBuffer, bits: &BitGrid, reach: i32) -> Vec<f32> {
    let share = |(position, normal): (&[f32; 3], &[f32; 3])| {
        let middle = (Vec3::from(*position) + Vec3::from(*normal)).round().as_ivec3();
        let around = Region::new((middle - reach).to_array(), (middle + reach + 1).to_array());
        1.0 - bits.count_in(around) as f32 / (2 * reach + 1).pow(3) as f32
    };
    mesh.positions.iter().zip(&mesh.normals).map(share).collect()
}

fn shaded(color: LinearRgba, openness: f32) -> LinearRgba {
    (color * (openness / 0.5).clamp(0.25, 1.0)).with_alpha(1.0)
}
