//! A program without the standard library that meshes a ball: exit code 0 where the mesh is right.
//!
//! It has a panic handler and an allocator of its own, so that it does not even compile where anything below it
//! links std.

#![no_std]
#![no_main]

use core::{
    alloc::{GlobalAlloc, Layout},
    cell::UnsafeCell,
    ffi::c_int,
    panic::PanicInfo,
    ptr::null_mut,
    sync::atomic::{AtomicUsize, Ordering},
};

use marchless::{MeshBuffer, MeshReport, MeshSettings, Mesher, Samples, Shape, Weight};

/// Samples per axis; the ball has a radius of `SIZE / 3`.
const SIZE: i16 = 24;

// The start-up code, memcpy and memset.
#[link(name = "c")]
unsafe extern "C" {
    fn abort() -> !;
}

/// What C's start-up code calls.
#[unsafe(no_mangle)]
extern "C" fn main() -> c_int {
    match mesh_a_ball() {
        Some(report) if report.is_closed() && report.is_clean() && report.euler == 2 => 0,
        _ => 1,
    }
}

fn mesh_a_ball() -> Option<MeshReport> {
    let shape = Shape::cube(SIZE as u32).ok()?;
    let mut weights = [0i16; (SIZE as usize).pow(3)];
    // Any field with the ball's signs will do, so there is no need of a square root.
    for (i, weight) in weights.iter_mut().enumerate() {
        let i = i as i16;
        let squared: i16 = [i % SIZE, i / SIZE % SIZE, i / (SIZE * SIZE)].map(|v| (v - SIZE / 2).pow(2)).iter().sum();
        *weight = i16::from_voxels(f32::from(squared - (SIZE / 3).pow(2)) / f32::from(SIZE));
    }
    let mut mesh = MeshBuffer::new();
    let samples = Samples::new(shape, &weights).ok()?;
    Mesher::new().mesh(samples, &MeshSettings::default(), &mut mesh).ok()?;
    Some(MeshReport::new(&mesh.positions, &mesh.indices))
}

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    // SAFETY: it takes nothing and does not return.
    unsafe { abort() }
}

/// The compiled `core` and `alloc` refer to it by name; it is never called, since nothing unwinds.
#[unsafe(no_mangle)]
extern "C" fn rust_eh_personality() {}

/// Hands out a fixed piece of memory from front to back and takes nothing back.
struct Bump {
    memory: UnsafeCell<[u8; Self::SIZE]>,
    used: AtomicUsize,
}

impl Bump {
    const SIZE: usize = 64 << 20;
}

// SAFETY: `used` gives every allocation bytes of its own.
unsafe impl Sync for Bump {}

// SAFETY: what is handed out lies within `memory`, is aligned, and never overlaps.
unsafe impl GlobalAlloc for Bump {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // Room for the layout wherever the alignment puts it.
        let start = self.used.fetch_add(layout.size() + layout.align(), Ordering::Relaxed);
        if start + layout.size() + layout.align() > Self::SIZE {
            return null_mut();
        }
        // SAFETY: just checked to lie within `memory`.
        let place = unsafe { self.memory.get().cast::<u8>().add(start) };
        place.map_addr(|address| address.next_multiple_of(layout.align()))
    }

    unsafe fn dealloc(&self, _: *mut u8, _: Layout) {}
}

#[global_allocator]
static ALLOCATOR: Bump = Bump { memory: UnsafeCell::new([0; Bump::SIZE]), used: AtomicUsize::new(0) };
