//! Any samples, meshed by the dual mesher on every backend: the same mesh without a flaw, or the same typed error.

#![no_main]

use libfuzzer_sys::fuzz_target;
use marchless::{Backend, DualSettings, MaterialSet, MeshBuffer, MeshError, MeshReport, Mesher};
use marchless_fuzz::{AnyVolume, Bits, FuzzWeight, Volume};

fuzz_target!(|input: (u8, AnyVolume)| match input {
    (choice, AnyVolume::I8(volume)) => check(&volume, choice),
    (choice, AnyVolume::I16(volume)) => check(&volume, choice),
    (choice, AnyVolume::F32(volume)) => check(&volume, choice),
});

fn check<W: FuzzWeight>(volume: &Volume<W>, choice: u8) {
    let smoothing = u32::from(choice % 12).saturating_sub(2);
    // What is left of the byte: seven pairs of sharp materials and an angle for each number of steps.
    let (sharp, crease) = match choice / 12 % 7 {
        0..=2 => (MaterialSet::EMPTY, None),
        3 => (MaterialSet::ALL, None),
        4 => (MaterialSet::ALL, Some(0.5)),
        5 => ((0..=255).filter(|material| material % 2 == 0).collect(), Some(volume.isovalue)),
        _ => ((0..=255).filter(|material| material % 2 == 1).collect(), None),
    };
    let settings = DualSettings { isovalue: volume.isovalue, normals: volume.normals, smoothing, sharp, crease };
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
        let other = DualSettings {
            isovalue: -settings.isovalue,
            normals: !settings.normals,
            smoothing: 8 - smoothing.min(8),
            sharp: MaterialSet::ALL,
            crease: Some(1.0),
        };
        let _ = mesher.mesh_dual(samples, &other, &mut mesh);
        // NaN equals nothing, not even itself.
        let again = mesher.mesh_dual(samples, &settings, &mut mesh);
        assert_eq!(format!("{again:?}"), format!("{meshed:?}"));
        assert_eq!(Bits::of(&mesh), expected, "{}", backend.name());
    }
}

fn check_error<W: FuzzWeight>(volume: &Volume<W>, settings: &DualSettings, error: MeshError) {
    let smallest = volume.shape.size().into_iter().min().unwrap_or(0);
    let padding = settings.padding();
    match error {
        MeshError::Isovalue { found } => assert!(!found.is_finite()),
        MeshError::TooSmall { least, .. } => {
            assert_eq!(least, if volume.padded { 2 * padding + 1 } else { 2 });
            assert!(smallest < least);
        }
        MeshError::Crease { found } => assert!(!(0.0..=core::f32::consts::PI).contains(&found)),
        MeshError::Smoothing { found, most } => assert!(found == settings.smoothing && found > most),
        error => panic!("{error}"),
    }
}

fn check_mesh<W: FuzzWeight>(volume: &Volume<W>, settings: &DualSettings, mesh: &MeshBuffer) {
    // Copies at creases are judged as their vertices: they follow all others, and without normals there are none.
    let bare = DualSettings { normals: false, ..*settings };
    let mut whole = MeshBuffer::new();
    Mesher::new().mesh_dual(volume.samples(), &bare, &mut whole).expect("normals do not matter");
    let corners =
        |mesh: &MeshBuffer| -> Vec<_> { mesh.indices.iter().map(|&at| mesh.positions[at as usize]).collect() };
    assert_eq!(corners(mesh), corners(&whole));
    let mut report = MeshReport::new(&whole.positions, &whole.indices);
    report.crossing_triangles = 0;
    if settings.smoothing > 0 || !settings.sharp.is_empty() {
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
