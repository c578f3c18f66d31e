//! [`PRESETS`]: cells worth looking at, numbered as in E. Chernyaev, "Marching Cubes 33: Construction of Topologically
//! Correct Isosurfaces" (1995).

/// A cell that the topologies mesh differently: case 4 with a tunnel.
pub(crate) const DEFAULT: [f32; 8] = [-1.0, 0.1, 0.3, 0.3, 0.3, 0.1, 0.1, -1.0];

/// A number, what the trilinear interpolant has there, and the weights of corners 0 to 7.
///
/// Each keeps its topology over some change of the isovalue; tunnels are narrow.
pub(crate) const PRESETS: [(&str, &str, [f32; 8]); 28] = [
    ("1", "a single corner inside", [0.8, 1.0, 0.5, 0.8, 0.5, 0.8, -0.6, 0.5]),
    ("3.1", "an ambiguous face, inside corners separated", [-0.5, 0.8, 1.0, -0.3, 0.5, 0.5, 0.5, 0.3]),
    ("3.2", "an ambiguous face, inside corners joined", [-1.0, 0.5, 0.5, -1.0, 0.6, 0.6, 0.5, 0.3]),
    ("4.1.1", "opposite corners, apart", [-1.0, 0.5, 1.0, 1.0, 0.8, 0.4, 0.5, -1.0]),
    ("4.1.2", "opposite corners, joined by a tunnel", DEFAULT),
    ("6.1.1", "a corner and an edge, apart", [-0.7, -0.5, 1.0, 0.9, 1.0, 1.0, 0.5, -0.5]),
    ("6.1.2", "a corner and an edge, joined by a tunnel", [-1.0, -0.05, 0.1, 0.55, 0.1, 0.45, 0.1, -1.0]),
    ("6.2", "a corner and an edge, joined on the face", [-1.0, -0.5, 1.0, 0.1, 1.0, 0.3, 0.4, -1.0]),
    ("7.1", "three corners, joined on no face", [0.7, -0.2, -0.3, 1.0, -0.5, 1.0, 1.0, 0.7]),
    ("7.2", "three corners, joined on one face", [0.7, -0.2, -0.6, 0.9, -0.8, 1.0, 0.1, 0.5]),
    ("7.3", "three corners, joined on two faces", [0.6, -0.4, -0.4, 0.9, -1.0, 0.1, 0.1, 1.0]),
    ("7.4.1", "three corners, joined on three faces", [0.3, -1.0, -1.0, 0.3, -1.0, 0.2, 0.3, 1.0]),
    ("7.4.2", "three corners, joined on three faces, with a tunnel", [1.0, -0.6, -0.65, 0.2, -0.35, 0.05, 0.05, 1.0]),
    ("10.1.1", "two edges, joined on no face", [-0.5, -0.5, 0.6, 0.5, 1.0, 1.0, -0.2, -0.1]),
    ("10.1.1'", "two edges, joined on both faces", [-1.0, -1.0, 0.2, 0.2, 0.4, 0.3, -1.0, -0.5]),
    ("10.1.2", "two edges, joined by a tunnel", [-1.0, -0.05, 0.55, 0.5, 0.3, 0.35, -0.05, -1.0]),
    ("10.2", "two edges, joined on one face", [-0.5, -1.0, 1.0, 0.2, 1.0, 0.2, -0.5, -1.0]),
    ("12.1.1", "a corner and a bend, apart", [-1.0, -0.2, -0.5, 1.0, 0.7, 0.7, 1.0, -0.5]),
    ("12.1.1'", "a corner and a bend, joined on both faces", [-1.0, -0.8, -1.0, 0.3, 0.7, 0.5, 1.0, -1.0]),
    ("12.1.2", "a corner and a bend, joined by a tunnel", [-1.0, -0.05, -0.05, 0.6, 0.05, 0.35, 0.4, -1.0]),
    ("12.2", "a corner and a bend, joined on one face", [-0.6, -0.3, -1.0, 1.0, 0.3, 1.0, 0.1, -1.0]),
    ("13.1", "alternating corners, joined on no face", [-0.5, 1.0, 0.7, -0.2, 1.0, -0.5, -0.3, 1.0]),
    ("13.1'", "alternating corners, joined on all faces", [-1.0, 0.5, 0.2, -0.7, 0.5, -1.0, -1.0, 0.2]),
    ("13.2", "alternating corners, joined on one face", [-0.3, 0.8, 1.0, -1.0, 0.9, -1.0, -0.2, 0.6]),
    ("13.3", "alternating corners, joined on two faces: a loop of 9", [-0.8, 1.0, 0.6, -0.5, 0.7, -0.1, -1.0, 0.5]),
    ("13.4", "alternating corners, joined on three faces: a loop of 12", [-0.4, 0.3, 0.6, -1.0, 1.0, -0.3, -0.5, 0.5]),
    ("13.5.1", "alternating corners, joined on three other faces", [-1.0, 0.2, 0.9, -0.9, 1.0, -0.9, -0.2, 1.0]),
    ("13.5.2", "the same, with a tunnel", [-1.0, 0.95, 0.05, -0.85, 1.0, -0.8, -0.95, 0.85]),
];
