//! Any samples, meshed by the dual mesher on every backend: the same mesh without a flaw, or the same typed error.

#![no_main]

use libfuzzer_sys::fuzz_target;
use marchless::{Backend, DualSettings, MeshBuffer, MeshError, MeshReport, Mesher};
use marchless_fuzz::{AnyVolume, Bits, FuzzWeight, Volume};

fuzz_target!(|input: (u8, AnyVolume)| match input {
    (smoothing, AnyVolume::I8(volume)) => check(&volume, smoothing),
    (smoothing, AnyVolume::I16(volume)) => check(&volume, smoothing),
    (smoothing, AnyVolume::F32(volume)) => check(&volume, smoothing),
});

fn check<W: FuzzWeight>(volume: &Volume<W>, smoothing: u8) {
    let smoothing = u32::from(smoothing % 12).saturating_sub(2);
    let settings = DualSettings { isovalue: volume.isovalue, normals: volume.normals, smoothing };
    let (samples, mut mesh) = (volume.samples(), MeshBuffer::new());
    let meshed = Mesher::with_backend(Backend::Portable).mesh_dual(samples, &settings, &mut mesh);
    match meshed {
        Ok(()) => check_mesh(volume, &settings, &mesh),
        Err(error) => {
            check_error(volume, &settings, error);
            assert_eq!(mesh, MeshBuffer::new());
        }
    }
    let expected = Bits::of(&mesh);
    for backend in Backend::ALL.iter().copied().filter(|backend| backend.is_available()) {
        // A mesher that has seen something else must not remember it.
        let mut mesher = Mesher::with_backend(backend);
        let other =
            DualSettings { isovalue: -settings.isovalue, normals: !settings.normals, smoothing: 8 - smoothing.min(8) };
        let _ = mesher.mesh_dual(samples, &other, &mut mesh);
        // NaN equals nothing, not even itself.
        let again = mesher.mesh_dual(samples, &settings, &mut mesh);
        assert_eq!(format!("{again:?}"), format!("{meshed:?}"));
        assert_eq!(Bits::of(&mesh), expected, "{}", backend.name());
    }
}

fn check_error<W: FuzzWeight>(volume: &Volume<W>, settings: &DualSettings, error: MeshError) {
    let smallest = volume.shape.size().into_iter().min().unwrap_or(0);
    let padding = 2 + settings.smoothing;
    match error {
        MeshError::Isovalue { found } => assert!(!found.is_finite()),
        MeshError::TooSmall { least, .. } => {
            assert_eq!(least, if volume.padded { 2 * padding + 1 } else { 2 });
            assert!(smallest < least);
        }
        MeshError::Smoothing { found, most } => assert!(found == settings.smoothing && found > most),
        error => panic!("{error}"),
    }
}

fn check_mesh<W: FuzzWeight>(volume: &Volume<W>, settings: &DualSettings, mesh: &MeshBuffer) {
    let mut report = MeshReport::new(&mesh.positions, &mesh.indices);
    report.crossing_triangles = 0;
    if settings.smoothing > 0 {
        // Two vertices of a cell may meet.
        report.duplicate_vertices = 0;
    }
    if volume.padded {
        // The surface goes on in other blocks.
        report.non_manifold_vertices = 0;
    }
    assert!(report.is_clean(), "{report}");
    let vertices = mesh.positions.len();
    assert_eq!(mesh.normals.len(), if settings.normals { vertices } else { 0 });
    assert_eq!(mesh.materials.len(), if volume.materials.is_some() { vertices } else { 0 });
    for normal in &mesh.normals {
        let length = normal.iter().map(|v| v * v).sum::<f32>().sqrt();
        assert!((length - 1.0).abs() < 1e-5, "{normal:?} is no unit normal");
    }
    for position in &mesh.positions {
        assert!(position.iter().all(|v| v.fract() != 0.0), "{position:?} lies on a face of its cell");
    }
}
