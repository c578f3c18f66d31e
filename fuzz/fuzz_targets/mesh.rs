//! Any samples, meshed in every way that there is: for each topology the same flawless mesh, or the same typed error.

#![no_main]

use std::num::NonZero;

use libfuzzer_sys::fuzz_target;
use marchless::{Backend, ExtractionReport, MeshBuffer, MeshError, MeshReport, MeshSettings, Mesher, ThreadedMesher};
use marchless_fuzz::{AnyVolume, Bits, FuzzWeight, TOPOLOGIES, Volume};

fuzz_target!(|input: (u8, AnyVolume)| match input {
    (threads, AnyVolume::I8(volume)) => check(&volume, threads),
    (threads, AnyVolume::I16(volume)) => check(&volume, threads),
    (threads, AnyVolume::F32(volume)) => check(&volume, threads),
});

fn check<W: FuzzWeight>(volume: &Volume<W>, threads: u8) {
    let samples = volume.samples();
    let meshes = TOPOLOGIES.map(|topology| {
        let (settings, mut mesh) = (volume.settings(topology), MeshBuffer::new());
        let meshed = Mesher::with_backend(Backend::Portable).mesh(samples, &settings, &mut mesh);
        match expected_error(volume) {
            None => {
                meshed.expect("the samples can be meshed");
                check_mesh(volume, &settings, &mesh);
            }
            Some(expected) => {
                // NaN equals nothing, not even itself.
                assert_eq!(format!("{:?}", meshed.expect_err("the samples cannot be meshed")), format!("{expected:?}"));
                assert_eq!(mesh, MeshBuffer::new());
            }
        }
        (settings, Bits::of(&mesh))
    });

    let mut mesh = MeshBuffer::new();
    for backend in Backend::ALL.iter().copied().filter(|backend| backend.is_available()) {
        // A mesher that has seen something else, with the other topology, must not remember it.
        let mut mesher = Mesher::with_backend(backend);
        let [separated, trilinear] = meshes.each_ref();
        for ((settings, expected), (other, _)) in [(separated, trilinear), (trilinear, separated)] {
            let turned_over = MeshSettings { isovalue: -other.isovalue, normals: !other.normals, ..*other };
            let _ = mesher.mesh(samples, &turned_over, &mut mesh);
            let _ = mesher.mesh(samples, settings, &mut mesh);
            assert_eq!(Bits::of(&mesh), *expected, "{}, {:?}", backend.name(), settings.topology);
        }
    }
    let threads = NonZero::new(usize::from(threads % 4)).unwrap_or(NonZero::<usize>::MIN);
    let mut mesher = ThreadedMesher::new(threads);
    for (settings, expected) in &meshes {
        let _ = mesher.mesh(samples, settings, &mut mesh);
        assert_eq!(Bits::of(&mesh), *expected, "{threads} threads, {:?}", settings.topology);
    }
}

fn expected_error<W: FuzzWeight>(volume: &Volume<W>) -> Option<MeshError> {
    let (isovalue, least) = (volume.isovalue, if volume.padded { 4 } else { 2 });
    if !isovalue.is_finite() {
        return Some(MeshError::Isovalue { found: isovalue });
    }
    let too_small = volume.shape.size().iter().any(|&size| size < least);
    too_small.then_some(MeshError::TooSmall { shape: volume.shape, least })
}

fn check_mesh<W: FuzzWeight>(volume: &Volume<W>, settings: &MeshSettings, mesh: &MeshBuffer) {
    let last = volume.shape.size().map(|size| (size - if volume.padded { 3 } else { 1 }) as f32);
    let report = MeshReport::in_box(&mesh.positions, &mesh.indices, [[0.0; 3], last]);
    assert!(report.is_clean(), "{:?}: {report}", settings.topology);
    // A vertex inside a cell is where it should not be, unless the topology is the trilinear one.
    let report = ExtractionReport::new(volume.samples(), settings, mesh);
    assert!(report.is_sound(), "{:?}: {report}", settings.topology);
    let vertices = mesh.positions.len();
    assert_eq!(mesh.normals.len(), if settings.normals { vertices } else { 0 });
    assert_eq!(mesh.materials.len(), if volume.materials.is_some() { vertices } else { 0 });
    for normal in &mesh.normals {
        let length = normal.iter().map(|v| v * v).sum::<f32>().sqrt();
        assert!((length - 1.0).abs() < 1e-5, "{normal:?} is no unit normal");
    }
    for position in &mesh.positions {
        assert!((0..3).all(|axis| (0.0..=last[axis]).contains(&position[axis])), "{position:?} is out of bounds");
    }
    let bounds = mesh.positions.iter().fold(None, |bounds: Option<[[f32; 3]; 2]>, &p| {
        let [min, max] = bounds.unwrap_or([p, p]);
        Some([[0, 1, 2].map(|k| min[k].min(p[k])), [0, 1, 2].map(|k| max[k].max(p[k]))])
    });
    assert_eq!(mesh.bounds, bounds);
}
