//! Any samples, meshed in every way that there is: the same flawless mesh, or the same typed error.

#![no_main]

use std::num::NonZero;

use libfuzzer_sys::fuzz_target;
use marchless::{Backend, MeshBuffer, MeshError, MeshReport, MeshSettings, Mesher, ThreadedMesher};
use marchless_fuzz::{AnyVolume, Bits, FuzzWeight, Volume};

fuzz_target!(|input: (u8, AnyVolume)| match input {
    (threads, AnyVolume::I8(volume)) => check(&volume, threads),
    (threads, AnyVolume::I16(volume)) => check(&volume, threads),
    (threads, AnyVolume::F32(volume)) => check(&volume, threads),
});

fn check<W: FuzzWeight>(volume: &Volume<W>, threads: u8) {
    let (samples, settings) = (volume.samples(), &volume.settings);
    let mut plain = MeshBuffer::new();
    let meshed = Mesher::with_backend(Backend::Portable).mesh(samples, settings, &mut plain);
    match expected_error(volume) {
        None => {
            meshed.expect("the samples can be meshed");
            check_mesh(volume, &plain);
        }
        Some(expected) => {
            // NaN equals nothing, not even itself.
            assert_eq!(format!("{:?}", meshed.expect_err("the samples cannot be meshed")), format!("{expected:?}"));
            assert_eq!(plain, MeshBuffer::new());
        }
    }

    let (plain, mut mesh) = (Bits::of(&plain), MeshBuffer::new());
    for backend in Backend::ALL.iter().copied().filter(|backend| backend.is_available()) {
        // A mesher that has seen something else must not remember it.
        let mut mesher = Mesher::with_backend(backend);
        let turned_over = MeshSettings { isovalue: -settings.isovalue, normals: !settings.normals, ..*settings };
        let _ = mesher.mesh(samples, &turned_over, &mut mesh);
        let _ = mesher.mesh(samples, settings, &mut mesh);
        assert_eq!(Bits::of(&mesh), plain, "{}", backend.name());
    }
    let threads = NonZero::new(usize::from(threads % 4)).unwrap_or(NonZero::<usize>::MIN);
    let _ = ThreadedMesher::new(threads).mesh(samples, settings, &mut mesh);
    assert_eq!(Bits::of(&mesh), plain, "{threads} threads");
}

fn expected_error<W: FuzzWeight>(volume: &Volume<W>) -> Option<MeshError> {
    let (isovalue, least) = (volume.settings.isovalue, if volume.padded { 4 } else { 2 });
    if !isovalue.is_finite() {
        return Some(MeshError::Isovalue { found: isovalue });
    }
    let too_small = volume.shape.size().iter().any(|&size| size < least);
    too_small.then_some(MeshError::TooSmall { shape: volume.shape, least })
}

fn check_mesh<W: FuzzWeight>(volume: &Volume<W>, mesh: &MeshBuffer) {
    let report = MeshReport::new(&mesh.positions, &mesh.indices);
    assert!(report.is_clean(), "{report}");
    let vertices = mesh.positions.len();
    assert_eq!(mesh.normals.len(), if volume.settings.normals { vertices } else { 0 });
    assert_eq!(mesh.materials.len(), if volume.materials.is_some() { vertices } else { 0 });
    for normal in &mesh.normals {
        let length = normal.iter().map(|v| v * v).sum::<f32>().sqrt();
        assert!((length - 1.0).abs() < 1e-5, "{normal:?} is no unit normal");
    }
    let last = volume.shape.size().map(|size| (size - if volume.padded { 3 } else { 1 }) as f32);
    for position in &mesh.positions {
        assert!((0..3).all(|axis| (0.0..=last[axis]).contains(&position[axis])), "{position:?} is out of bounds");
    }
    let bounds = mesh.positions.iter().fold(None, |bounds: Option<[[f32; 3]; 2]>, &p| {
        let [min, max] = bounds.unwrap_or([p, p]);
        Some([[0, 1, 2].map(|k| min[k].min(p[k])), [0, 1, 2].map(|k| max[k].max(p[k]))])
    });
    assert_eq!(mesh.bounds, bounds);
}
