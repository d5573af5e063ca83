//! Once its buffers have grown, a detector asks for no memory.

#![allow(clippy::unwrap_used)] // a test may fail by panicking

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::Arc;

use tracker::detect::{DetectSettings, Detector, Levels};
use tracker::frame::Frame;
use tracker::synth::{Film, preset};

thread_local! {
    static REQUESTS: Cell<usize> = const { Cell::new(0) };
}

/// The system's allocator, counting what each thread asks of it.
struct Counting;

fn count() {
    REQUESTS.with(|n| n.set(n.get() + 1));
}

// SAFETY: every call goes on to the system's allocator as it came; counting touches a thread's own number only, which
// is made at compile time and has no destructor, so that it neither allocates nor dies.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: the caller's promise is the one that is asked for.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count();
        // SAFETY: as above.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn requests(work: impl FnOnce()) -> usize {
    let before = REQUESTS.get();
    work();
    REQUESTS.get() - before
}

#[test]
fn a_detector_that_has_seen_the_frames_allocates_nothing() {
    // Round markers and moving ones, merged and hidden ones, glints, uneven light; 8 and 16 bits.
    for (name, depth_bits) in [("clean", 8), ("glints", 8), ("fast", 8), ("noisy", 12)] {
        let mut scene = preset(name, 41).unwrap();
        scene.frames = 24;
        scene.camera.depth_bits = depth_bits;
        if depth_bits > 8 {
            let gain = f64::from(1u32 << (depth_bits - 8));
            scene.camera.read_noise *= gain;
            scene.camera.black *= gain;
            scene.light.background *= gain;
            scene.links.iter_mut().for_each(|l| l.level *= gain);
            scene.markers.iter_mut().for_each(|m| m.level *= gain);
        }
        let film = Film::new(&scene).unwrap();
        let frames: Vec<Frame> = (0..scene.frames).map(|i| film.frame(i)).collect();
        let settings = DetectSettings::default();
        let levels = Arc::new(Levels::learn(&frames[..6], &settings).unwrap());
        let mut detector = Detector::new(levels, &settings).unwrap();
        let mut found = Vec::new();
        let mut all = || {
            frames
                .iter()
                .map(|frame| {
                    detector.detect(frame, &mut found).unwrap();
                    found.len()
                })
                .sum::<usize>()
        };
        let mut seen = 0;
        // The first time the buffers grow: the count works.
        assert!(requests(|| seen = all()) > 0);
        assert!(seen > 100, "{name}: {seen}");
        let mut again = 0;
        assert_eq!(requests(|| again = all()), 0, "{name}");
        assert_eq!(again, seen);
    }
}
