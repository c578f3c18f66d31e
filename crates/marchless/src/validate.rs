//! [`MeshReport`] and [`ExtractionReport`]: the defects of an indexed triangle mesh from any source; [`MeshUnion`]:
//! several meshes, to be judged as one.
//!
//! ```text
//! positions ──coincident──▶ vertices with equal positions
//! indices ──links──▶ the triangles around each vertex: edges, fans, rims, duplicates, components
//! both ──order──▶ triangles in spatial order ──boxes──▶ pairs whose bounding boxes overlap
//!        ──triangle, predicates──▶ which of these pairs cross
//! samples, mesh ──extraction──▶ which vertex lies on which crossing
//! ```
//!
//! All steps but the last run as parts of [`Work`], on one thread or several.

mod aabb;
mod boxes;
mod coincident;
mod crossings;
mod extraction;
mod links;
mod order;
mod predicates;
mod triangle;
mod union;
mod work;

use alloc::borrow::Cow;
use core::{fmt, ops::ControlFlow};

use coincident::Coincident;
pub use extraction::ExtractionReport;
use links::Links;
pub use union::MeshUnion;
use work::Work;

/// Counts the defects of an indexed triangle mesh, and says what kind of surface it is.
///
/// Triangles with an index out of range, or with the same index twice, are counted as such and left out of everything
/// else. Edges, fans and components depend on the indices alone; positions matter to
/// [`cracks`](Self::cracks), [`zero_area_triangles`](Self::zero_area_triangles),
/// [`crossing_triangles`](Self::crossing_triangles), [`duplicate_vertices`](Self::duplicate_vertices) and
/// [`non_finite_vertices`](Self::non_finite_vertices).
///
/// Areas and crossings are exact for all finite positions, from the smallest subnormal number to the largest. They rest
/// on Jonathan Richard Shewchuk's adaptive predicates in `f64`, where the products of `f32` coordinates neither
/// overflow nor underflow.
///
/// ```
/// use marchless::MeshReport;
///
/// let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
/// let tetrahedron = MeshReport::new(&corners, &[0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3]);
/// assert!(tetrahedron.is_closed() && tetrahedron.is_clean());
/// assert_eq!(
///     tetrahedron.to_string(),
///     "closed, clean: 4 vertices, 4 triangles, 1 component, Euler characteristic 2, genus 0",
/// );
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct MeshReport {
    /// All vertices.
    pub vertices: usize,
    /// All complete triples of indices.
    pub triangles: usize,
    /// Edges of one triangle only: the rim of an open surface.
    pub boundary_edges: usize,
    /// Boundary edges inside the box, off its faces ([`MeshReport::in_box`]): the surface should continue there. 0
    /// without a box.
    pub cracks: usize,
    /// Edges of three or more triangles.
    pub non_manifold_edges: usize,
    /// Vertices whose triangles form neither one fan nor one ring around them.
    pub non_manifold_vertices: usize,
    /// Edges whose triangles do not pair up in opposite directions. (At a non-manifold edge, one may be left over.)
    pub inconsistent_edges: usize,
    /// Triangles with the same index twice.
    pub repeated_index_triangles: usize,
    /// Triangles of three different vertices that lie exactly on one line, or at one point. Those with a coordinate
    /// that is not finite do not count.
    pub zero_area_triangles: usize,
    /// Triangles with the same three vertices as an earlier one, in any order.
    pub duplicate_triangles: usize,
    /// Pairs of triangles that pierce, touch or cover each other: they have a point in common that is neither a common
    /// vertex nor on a common edge. Vertices with equal positions count as one vertex here. Left out are triangles of
    /// zero area, those with a vertex that is not finite, and all but one of each set of duplicates. Counted up to
    /// [`MeshReport::MOST_CROSSINGS`], among at most 2³¹ triangles.
    pub crossing_triangles: usize,
    /// Vertices whose position equals that of an earlier one, to the last bit (−0 equals 0).
    pub duplicate_vertices: usize,
    /// Vertices of no triangle.
    pub unused_vertices: usize,
    /// Vertices with a coordinate that is infinite or NaN.
    pub non_finite_vertices: usize,
    /// Indices without a vertex.
    pub out_of_range_indices: usize,
    /// Indices left over after the last whole triangle: 0, 1 or 2.
    pub stray_indices: usize,
    /// Pieces that share no vertex with each other.
    pub components: usize,
    /// Vertices − edges + triangles of the surface: 2 for a sphere, 0 for a torus, 1 for a disc; summed over the
    /// components.
    pub euler: i64,
    /// The number of handles, summed over the components: 0 for a sphere or a disc, 1 for a torus, with or without
    /// holes cut into them. `None` if the surface is not a consistently oriented 2-manifold.
    pub genus: Option<u64>,
}

impl MeshReport {
    /// The limit of [`crossing_triangles`](Self::crossing_triangles): a million triangles in a heap can make half a
    /// million million pairs.
    pub const MOST_CROSSINGS: usize = 10_000_000;

    /// Examines a mesh; rims are allowed everywhere.
    ///
    /// `indices`: three a triangle; any values and any number of them.
    ///
    /// Takes 0.6 to 1.1 µs of processor time a triangle on a server core of 2023, and about 130 bytes of memory, as
    /// long as few axis-aligned bounding boxes overlap other than those of neighbours. Beyond that, all pairs of
    /// triangles whose boxes overlap are compared: the time grows with their number, the memory does not.
    ///
    /// With feature `std`, meshes of more than 65,000 triangles are examined on several threads, as many as
    /// `std::thread::available_parallelism` says at most. The report is the same on any number of threads.
    pub fn new(positions: &[[f32; 3]], indices: &[u32]) -> Self {
        Self::to_the_end(positions, indices, None)
    }

    /// Examines a mesh whose rims must lie on the faces of the box `[min, max]`; boundary edges elsewhere are
    /// [`cracks`](Self::cracks).
    ///
    /// A boundary edge lies on a face if one coordinate of both its ends is exactly the box's `min` or `max`, and the
    /// others are within the box.
    pub fn in_box(positions: &[[f32; 3]], indices: &[u32], bounds: [[f32; 3]; 2]) -> Self {
        Self::to_the_end(positions, indices, Some(bounds))
    }

    /// Whether the surface has no rim. An empty mesh is closed.
    pub const fn is_closed(&self) -> bool {
        self.boundary_edges == 0
    }

    /// Whether there is no defect. The mesh, open or closed, is then a consistently oriented 2-manifold that does not
    /// cross itself, without cracks, degenerate or duplicate triangles, stray indices and unused vertices.
    pub fn is_clean(&self) -> bool {
        self.defects().iter().all(|&(count, _, _)| count == 0)
    }

    /// Examines a mesh like [`new`](Self::new), and calls `progress` with the share of the work done so far, from 0 to
    /// 1.
    ///
    /// Returns `None` if `progress` returns `ControlFlow::Break`, which cancels the work. It is called on the caller's
    /// thread, up to some thousand times a second, so it should print or redraw less often. Between two calls, up to a
    /// fifth of the work may pass.
    ///
    /// ```
    /// use core::ops::ControlFlow;
    /// use marchless::MeshReport;
    ///
    /// let (positions, indices) = ([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [0, 1, 2]);
    /// let report = MeshReport::with_progress(&positions, &indices, |done| {
    ///     assert!((0.0..=1.0).contains(&done));
    ///     ControlFlow::Continue(())
    /// });
    /// assert_eq!(report, Some(MeshReport::new(&positions, &indices)));
    /// assert_eq!(MeshReport::with_progress(&positions, &indices, |_| ControlFlow::Break(())), None);
    /// ```
    pub fn with_progress(
        positions: &[[f32; 3]],
        indices: &[u32],
        mut progress: impl FnMut(f32) -> ControlFlow<()>,
    ) -> Option<Self> {
        Self::examine(positions, indices, None, &mut Work::new(threads(indices.len() / 3), &mut progress))
    }

    /// Examines a mesh without progress.
    fn to_the_end(positions: &[[f32; 3]], indices: &[u32], bounds: Option<[[f32; 3]; 2]>) -> Self {
        let mut progress = |_| ControlFlow::Continue(());
        let mut work = Work::new(threads(indices.len() / 3), &mut progress);
        Self::examine(positions, indices, bounds, &mut work).unwrap_or_default()
    }

    fn examine(
        positions: &[[f32; 3]],
        indices: &[u32],
        bounds: Option<[[f32; 3]; 2]>,
        work: &mut Work<'_>,
    ) -> Option<Self> {
        // Indices have 32 bits: they reach no vertex beyond.
        let reachable = usize::try_from(1u64 << 32).map_or(positions.len(), |limit| positions.len().min(limit));
        let coincident = Coincident::of(&positions[..reachable], 0.05, work)?;
        let mut report = Self {
            vertices: positions.len(),
            triangles: indices.len() / 3,
            duplicate_vertices: coincident.repeated,
            non_finite_vertices: positions.iter().filter(|&&position| !is_finite(position)).count(),
            out_of_range_indices: indices.iter().filter(|&&index| index as usize >= reachable).count(),
            stray_indices: indices.len() % 3,
            ..Self::default()
        };

        // The triangles that the surface is made of.
        let mut triangles = Cow::Borrowed(indices.as_chunks().0);
        let is_repeated = |&[a, b, c]: &[u32; 3]| a == b || b == c || c == a;
        let exists = |triangle: &[u32; 3]| triangle.iter().all(|&index| (index as usize) < reachable);
        if report.out_of_range_indices > 0 || triangles.iter().any(is_repeated) {
            triangles.to_mut().retain(exists);
            report.repeated_index_triangles = triangles.iter().filter(|&triangle| is_repeated(triangle)).count();
            triangles.to_mut().retain(|triangle| !is_repeated(triangle));
        }

        let links = Links::of(&triangles, reachable, 0.2, work)?;
        report.boundary_edges = links.boundary.len();
        report.cracks = bounds.map_or(0, |bounds| {
            let is_crack = |edge: &&[u32; 2]| !is_on_face(edge.map(|end| positions[end as usize]), bounds);
            links.boundary.iter().filter(is_crack).count()
        });
        report.non_manifold_edges = links.non_manifold_edges;
        report.non_manifold_vertices = links.non_manifold_vertices;
        report.inconsistent_edges = links.inconsistent_edges;
        report.duplicate_triangles = links.duplicate_triangles;
        report.unused_vertices = positions.len() - links.used_vertices;
        report.components = links.components;
        report.euler = links.used_vertices as i64 - links.edges as i64 + triangles.len() as i64;
        report.genus = links.genus(report.euler);

        let mesh = crossings::Mesh { positions, triangles: &triangles, coincident: &coincident };
        (report.zero_area_triangles, report.crossing_triangles) =
            crossings::count(&mesh, links.duplicate_triangles > 0, 0.75, work)?;
        Some(report)
    }

    /// Each kind of defect: the count, and the words for one and for several.
    const fn defects(&self) -> [(usize, &'static str, &'static str); 13] {
        [
            (self.cracks, "crack", "cracks"),
            (self.non_manifold_edges, "non-manifold edge", "non-manifold edges"),
            (self.non_manifold_vertices, "non-manifold vertex", "non-manifold vertices"),
            (self.inconsistent_edges, "inconsistently oriented edge", "inconsistently oriented edges"),
            (self.repeated_index_triangles, "triangle with a repeated index", "triangles with a repeated index"),
            (self.zero_area_triangles, "triangle of zero area", "triangles of zero area"),
            (self.duplicate_triangles, "duplicate triangle", "duplicate triangles"),
            (self.crossing_triangles, "pair of crossing triangles", "pairs of crossing triangles"),
            (self.duplicate_vertices, "duplicate vertex", "duplicate vertices"),
            (self.unused_vertices, "unused vertex", "unused vertices"),
            (self.non_finite_vertices, "non-finite vertex", "non-finite vertices"),
            (self.out_of_range_indices, "index out of range", "indices out of range"),
            (self.stray_indices, "stray index", "stray indices"),
        ]
    }
}

impl fmt::Display for MeshReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.is_closed() { "closed" } else { "open" })?;
        f.write_str(if self.is_clean() { ", clean: " } else { ", with defects: " })?;
        let mut counted = |count: usize, one: &str, several: &str| {
            let word = if count == 1 { one } else { several };
            write!(f, "{count} {word}, ")
        };
        counted(self.vertices, "vertex", "vertices")?;
        counted(self.triangles, "triangle", "triangles")?;
        counted(self.components, "component", "components")?;
        if !self.is_closed() {
            counted(self.boundary_edges, "boundary edge", "boundary edges")?;
        }
        for (count, one, several) in self.defects() {
            if count > 0 {
                counted(count, one, several)?;
            }
        }
        write!(f, "Euler characteristic {}", self.euler)?;
        self.genus.map_or(Ok(()), |genus| write!(f, ", genus {genus}"))
    }
}

/// The number of threads for a mesh: what the system offers, but at most one for every [`PER_THREAD`] triangles.
#[cfg(feature = "std")]
fn threads(triangles: usize) -> usize {
    let useful = triangles / PER_THREAD;
    // Asking the system takes longer than examining a small mesh.
    if useful < 2 { 1 } else { std::thread::available_parallelism().map_or(1, |offered| offered.get().min(useful)) }
}

#[cfg(not(feature = "std"))]
const fn threads(_triangles: usize) -> usize {
    1
}

/// The number of triangles that is worth a thread.
#[cfg(feature = "std")]
const PER_THREAD: usize = 1 << 15;

fn is_finite(position: [f32; 3]) -> bool {
    position.iter().all(|coordinate| coordinate.is_finite())
}

/// Whether an edge lies on a face of the box.
fn is_on_face(edge: [[f32; 3]; 2], [min, max]: [[f32; 3]; 2]) -> bool {
    let within = edge.iter().all(|end| (0..3).all(|axis| min[axis] <= end[axis] && end[axis] <= max[axis]));
    let flat = |axis: usize, face: f32| edge.iter().all(|end| end[axis] == face);
    within && (0..3).any(|axis| flat(axis, min[axis]) || flat(axis, max[axis]))
}

#[cfg(test)]
mod tests;
