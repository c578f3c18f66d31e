//! [`MeshReport`] and [`ExtractionReport`]: what is sound and what is not in an indexed triangle mesh, whoever made it.
//!
//! ```text
//! positions ──places──▶ which vertices are not finite, which lie in the same place
//! indices ──links──▶ what surrounds each vertex: edges, fans, rims, duplicates, components
//! both ──crossings──▶ a tree of boxes; planes, and exact predicates, where two boxes meet
//! samples, mesh ──extraction──▶ which vertex lies on which crossing
//! ```

mod aabb;
mod boxes;
mod coincident;
mod crossings;
mod extraction;
mod links;
mod order;
mod predicates;
mod triangle;
mod work;

use alloc::borrow::Cow;
use core::{fmt, ops::ControlFlow};

use coincident::Coincident;
pub use extraction::ExtractionReport;
use links::Links;
use work::Work;

/// The defects of an indexed triangle mesh, counted, and what kind of surface it is.
///
/// Triangles that name a vertex which does not exist, or the same vertex twice, are counted as such and left out of
/// everything else. What concerns edges, fans and components is told from the indices alone; positions matter to
/// [`cracks`](Self::cracks), [`zero_area_triangles`](Self::zero_area_triangles),
/// [`crossing_triangles`](Self::crossing_triangles), [`duplicate_vertices`](Self::duplicate_vertices) and
/// [`non_finite_vertices`](Self::non_finite_vertices).
///
/// Areas and crossings are exact for all finite positions, from the smallest subnormal number to the largest: they are
/// told by Jonathan Richard Shewchuk's adaptive predicates, in `f64`, where no product of `f32` coordinates overflows
/// or loses a bit to underflow.
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
    /// All whole triples of indices.
    pub triangles: usize,
    /// Edges of one triangle only: the rim of an open surface.
    pub boundary_edges: usize,
    /// Those of the boundary edges that do not lie on a face of the box, where one was given
    /// ([`MeshReport::in_box`]): the surface should go on there. 0 without a box.
    pub cracks: usize,
    /// Edges of three or more triangles.
    pub non_manifold_edges: usize,
    /// Vertices whose triangles are neither one fan nor one ring around them.
    pub non_manifold_vertices: usize,
    /// Edges along which triangles do not run in opposite directions, pair by pair (at a non-manifold edge one may
    /// be left over).
    pub inconsistent_edges: usize,
    /// Triangles that name a vertex twice.
    pub repeated_index_triangles: usize,
    /// Triangles of three different vertices that lie on one line, exactly, or in one place. None where a coordinate is
    /// not finite.
    pub zero_area_triangles: usize,
    /// Triangles with the same three vertices as another one before them, whichever way round.
    pub duplicate_triangles: usize,
    /// Pairs of triangles that have a point in common which is neither a common vertex nor on a common edge: they
    /// pierce, touch or cover each other. Vertices in the same place are the same here, so that it makes no difference
    /// whether triangles share them. Left out are triangles of zero area, those with a vertex that is not finite, and all
    /// but one of each set of duplicates. Counted up to [`MeshReport::MOST_CROSSINGS`], among at most 2³¹ triangles.
    pub crossing_triangles: usize,
    /// Vertices in the same place as another one before them, to the last bit (−0 is 0).
    pub duplicate_vertices: usize,
    /// Vertices of no triangle.
    pub unused_vertices: usize,
    /// Vertices with a coordinate that is infinite or NaN.
    pub non_finite_vertices: usize,
    /// Indices that name no vertex.
    pub out_of_range_indices: usize,
    /// Indices left over after the last whole triangle: 0, 1 or 2.
    pub stray_indices: usize,
    /// Pieces that share no vertex with each other.
    pub components: usize,
    /// Vertices − edges + triangles of the surface: 2 for a sphere, 0 for a torus, 1 for a disc; summed over the
    /// components.
    pub euler: i64,
    /// How many handles the surface has, summed over the components: 0 for a sphere or a disc, 1 for a torus, whatever
    /// is cut out of them. `None` where it is no consistently oriented 2-manifold.
    pub genus: Option<u64>,
}

impl MeshReport {
    /// Where the count of [`crossing_triangles`](Self::crossing_triangles) ends: a million triangles in a heap make half
    /// a million million pairs.
    pub const MOST_CROSSINGS: usize = 10_000_000;

    /// Examines a mesh; rims are allowed everywhere.
    ///
    /// `indices`: three a triangle; any values and any number of them.
    ///
    /// About a microsecond a triangle and 200 bytes for each, in O(n log n), as long as few triangles' axis-aligned boxes
    /// overlap but those of neighbours. Beyond that, all pairs of triangles whose boxes overlap are compared: the time
    /// grows with their number, the memory does not.
    pub fn new(positions: &[[f32; 3]], indices: &[u32]) -> Self {
        Self::unhurried(positions, indices, None)
    }

    /// Examines a mesh whose rims must lie on the faces of the box `[min, max]`; the others are
    /// [`cracks`](Self::cracks).
    ///
    /// A boundary edge lies on a face where both its ends do: one coordinate of both is equal to the box's `min` or
    /// `max`, exactly, and the others are within the box.
    pub fn in_box(positions: &[[f32; 3]], indices: &[u32], bounds: [[f32; 3]; 2]) -> Self {
        Self::unhurried(positions, indices, Some(bounds))
    }

    /// Whether the surface has no rim. An empty mesh is closed.
    pub const fn is_closed(&self) -> bool {
        self.boundary_edges == 0
    }

    /// Whether there is no defect: open or closed, the mesh is a consistently oriented 2-manifold that does not cross
    /// itself, without cracks, without degenerate or duplicate parts and without indices or vertices that lead nowhere.
    pub fn is_clean(&self) -> bool {
        self.defects().iter().all(|&(count, _, _)| count == 0)
    }

    /// Examines a mesh as [`new`](Self::new) does, and tells `progress` which share of the work is done, from 0 to 1.
    ///
    /// `progress` decides whether to go on; `None` if it has not. It is called on the caller's thread, many times a second:
    /// print or redraw less often. A few steps take up to a twentieth of the time each.
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

    /// Examines a mesh without telling anyone how far it is.
    fn unhurried(positions: &[[f32; 3]], indices: &[u32], bounds: Option<[[f32; 3]; 2]>) -> Self {
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
        // What indices can name.
        let nameable = usize::try_from(1u64 << 32).map_or(positions.len(), |most| positions.len().min(most));
        let coincident = Coincident::of(&positions[..nameable], 0.05, work)?;
        let mut report = Self {
            vertices: positions.len(),
            triangles: indices.len() / 3,
            duplicate_vertices: coincident.repeated,
            non_finite_vertices: positions.iter().filter(|&&position| !is_finite(position)).count(),
            out_of_range_indices: indices.iter().filter(|&&index| index as usize >= nameable).count(),
            stray_indices: indices.len() % 3,
            ..Self::default()
        };

        // The triangles that the surface is made of.
        let mut triangles = Cow::Borrowed(indices.as_chunks().0);
        let is_repeated = |&[a, b, c]: &[u32; 3]| a == b || b == c || c == a;
        let exists = |triangle: &[u32; 3]| triangle.iter().all(|&index| (index as usize) < nameable);
        if report.out_of_range_indices > 0 || triangles.iter().any(is_repeated) {
            triangles.to_mut().retain(exists);
            report.repeated_index_triangles = triangles.iter().filter(|&triangle| is_repeated(triangle)).count();
            triangles.to_mut().retain(|triangle| !is_repeated(triangle));
        }

        let links = Links::of(&triangles, nameable, 0.2, work)?;
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

    /// Every kind of defect: how many, and the word for one and for several.
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

/// How many threads examine a mesh: those that the system offers, but one for every [`PER_THREAD`] triangles.
#[cfg(feature = "std")]
fn threads(triangles: usize) -> usize {
    let useful = triangles / PER_THREAD;
    // The question takes longer than a small mesh.
    if useful < 2 { 1 } else { std::thread::available_parallelism().map_or(1, |offered| offered.get().min(useful)) }
}

#[cfg(not(feature = "std"))]
const fn threads(_triangles: usize) -> usize {
    1
}

/// Triangles for which another thread pays.
#[cfg(feature = "std")]
const PER_THREAD: usize = 1 << 15;

fn is_finite(position: [f32; 3]) -> bool {
    position.iter().all(|coordinate| coordinate.is_finite())
}

/// Whether some face of the box holds the whole edge.
fn is_on_face(edge: [[f32; 3]; 2], [min, max]: [[f32; 3]; 2]) -> bool {
    let within = edge.iter().all(|end| (0..3).all(|axis| min[axis] <= end[axis] && end[axis] <= max[axis]));
    let flat = |axis: usize, face: f32| edge.iter().all(|end| end[axis] == face);
    within && (0..3).any(|axis| flat(axis, min[axis]) || flat(axis, max[axis]))
}

#[cfg(test)]
mod tests;
