//! Bounds the work of looking for bodies. It is counted, never timed, so that the same recording has the same result everywhere.
//!
//! Owns: [`Work`]. Must not: know what is looked for.

use std::sync::atomic::{AtomicU64, Ordering};

/// Work that is saved up at most, and at the beginning, in look-ups: one detection that is sought near one place, some 0.1 us.
pub const MOST_SAVED: u64 = 10_000_000;
/// Work after which a frame begins no further search, look-ups: a wish to stop, heard between two frames, then waits some 0.2 s.
pub const MOST_OF_FRAME: u64 = 2_000_000;
/// Work that each frame adds, look-ups.
pub const EACH_FRAME: u64 = 10_000;

/// Work that may still be done.
#[derive(Debug)]
pub struct Work {
    left: AtomicU64,
    /// Down to which it may be spent now.
    floor: AtomicU64,
}

impl Clone for Work {
    fn clone(&self) -> Self {
        let copy = |v: &AtomicU64| AtomicU64::new(v.load(Ordering::Relaxed));
        Self { left: copy(&self.left), floor: copy(&self.floor) }
    }
}

impl Work {
    /// A budget of `places` look-ups.
    pub fn of(places: u64) -> Self {
        Self { left: AtomicU64::new(places), floor: AtomicU64::new(0) }
    }

    /// The budget of a recording, which each frame adds to.
    pub fn saved() -> Self {
        Self::of(MOST_SAVED)
    }

    /// Begins a frame: it adds its own, and may take a part of what is saved.
    pub fn begin_frame(&self) {
        let left = (self.left() + EACH_FRAME).min(MOST_SAVED);
        self.left.store(left, Ordering::Relaxed);
        self.floor.store(left.saturating_sub(MOST_OF_FRAME), Ordering::Relaxed);
    }

    /// The work that is left.
    pub fn left(&self) -> u64 {
        self.left.load(Ordering::Relaxed)
    }

    /// Counts work that is done in any case; one thread at a time does.
    pub fn spend(&self, places: usize) {
        let left = self.left().saturating_sub(places as u64);
        self.left.store(left, Ordering::Relaxed);
    }

    /// Whether no more is to be begun.
    pub fn is_spent(&self) -> bool {
        self.left() <= self.floor.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_takes_a_part_of_what_is_saved_and_many_frames_no_more_than_they_add() {
        let work = Work::saved();
        let mut total = 0;
        for frame in 0..200_u64 {
            work.begin_frame();
            let mut taken = 0;
            while !work.is_spent() {
                work.spend(1000);
                taken += 1000;
            }
            assert!(taken <= MOST_OF_FRAME, "{frame}: {taken}");
            total += taken;
            assert!(total <= MOST_SAVED + (frame + 1) * EACH_FRAME, "{frame}");
        }
        assert!(total > MOST_SAVED);
        // Frames of little work save again.
        (0..10).for_each(|_| work.begin_frame());
        assert!(!work.is_spent());
    }
}
