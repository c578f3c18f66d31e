//! Volumes that come slab by slab, wrong slabs among them: the mesh of the whole, or typed errors that change nothing.

#![no_main]

use libfuzzer_sys::{
    arbitrary::{Arbitrary, Result, Unstructured},
    fuzz_target,
};
use marchless::{MeshBuffer, MeshError, MeshSettings, Mesher, Samples, SlabMesher};
use marchless_fuzz::{AnyVolume, Bits, FuzzWeight, TOPOLOGIES, Volume};

/// What happens before each slab; repeated where there are more slabs.
#[derive(Debug)]
struct Step {
    /// The length of a slab that does not fit, relative to one that does; none where 0.
    excess: i8,
    /// Whether the mesh is taken out of the buffer.
    taken: bool,
}

impl<'a> Arbitrary<'a> for Step {
    fn arbitrary(u: &mut Unstructured<'a>) -> Result<Self> {
        Ok(Self { excess: u.arbitrary()?, taken: u.arbitrary()? })
    }
}

/// A size that is likely no volume's, what to do slab by slab, and the volume.
type Input = ([u32; 2], [Step; 5], AnyVolume);

fuzz_target!(|input: Input| {
    let (size, steps, volume) = input;
    match volume {
        AnyVolume::I8(volume) => check(size, &steps, &volume),
        AnyVolume::I16(volume) => check(size, &steps, &volume),
        AnyVolume::F32(volume) => check(size, &steps, &volume),
    }
});

fn check<W: FuzzWeight>(any_size: [u32; 2], steps: &[Step], volume: &Volume<W>) {
    for settings in TOPOLOGIES.map(|topology| volume.settings(topology)) {
        check_size::<W>(any_size, &settings);
        check_slabs(steps, volume, &settings);
    }
}

fn check_slabs<W: FuzzWeight>(steps: &[Step], volume: &Volume<W>, settings: &MeshSettings) {
    let [nx, ny, nz] = volume.shape.size();
    let (size, len) = ([nx, ny], (nx * ny) as usize);
    let Some(mut mesher) = check_size(size, settings) else { return };

    let (mut piece, mut streamed) = (MeshBuffer::new(), MeshBuffer::new());
    for (slab, step) in volume.weights.chunks_exact(len).zip(steps.iter().cycle()) {
        let found = len.saturating_add_signed(step.excess.into());
        if found != len {
            let before = Bits::of(&piece);
            let refused = mesher.push(&vec![W::INSIDE; found], &mut piece);
            assert_eq!(refused, Err(MeshError::SlabLength { size, expected: len, found }));
            assert_eq!(Bits::of(&piece), before);
        }
        if step.taken {
            take(&mut piece, &mut streamed);
        }
        // A copy, so that AddressSanitizer sees a read beyond either end.
        mesher.push(&Box::<[W]>::from(slab), &mut piece).expect("the slab is whole");
    }
    let finished = mesher.finish(&mut piece);
    take(&mut piece, &mut streamed);
    if nz < 2 {
        assert_eq!(finished, Err(MeshError::TooFewSlabs { found: 1 }));
        assert_eq!(streamed, MeshBuffer::new());
        return;
    }
    finished.expect("there are slabs enough");
    let mut whole = MeshBuffer::new();
    let samples = Samples::new(volume.shape, &volume.weights).expect("one weight a sample");
    Mesher::new().mesh(samples, settings, &mut whole).expect("the samples can be meshed");
    assert_eq!(Bits::of(&streamed), Bits::of(&whole));
}

/// A mesher of slabs of `size`, where there can be one.
fn check_size<W: FuzzWeight>(size: [u32; 2], settings: &MeshSettings) -> Option<SlabMesher<W>> {
    let mesher = SlabMesher::new(size, *settings);
    if !settings.isovalue.is_finite() {
        assert!(matches!(mesher, Err(MeshError::Isovalue { .. })));
    } else if size.iter().any(|&size| size < 2) {
        assert_eq!(mesher.as_ref().err(), Some(&MeshError::SlabSize { size }));
    }
    mesher.ok()
}

/// Moves what is in `piece` to the end of `whole`.
fn take(piece: &mut MeshBuffer, whole: &mut MeshBuffer) {
    whole.positions.append(&mut piece.positions);
    whole.normals.append(&mut piece.normals);
    whole.indices.append(&mut piece.indices);
    whole.bounds = match (whole.bounds, piece.bounds.take()) {
        (Some([min, max]), Some([low, high])) => {
            Some([[0, 1, 2].map(|k| min[k].min(low[k])), [0, 1, 2].map(|k| max[k].max(high[k]))])
        }
        (bounds, None) | (None, bounds) => bounds,
    };
}
