//! Notices frames that show what the frame before them shows.
//!
//! Owns: [`Repeats`], [`copies_words`]. Must not: change a time or leave out a frame.

use nalgebra::Vector2;

use crate::message::Message;
use crate::observation::Observation;

/// Step of the marker that moves most before and after a repeated frame, px: less says nothing.
const MOVES_PX: f64 = 1.0;
/// Part of the steps before and after that all markers stay within in a repeated frame.
const STAYS: f64 = 0.1;
/// Frames in a row that repeat one, at most: longer, things may have stopped.
const LONGEST: usize = 5;
/// Repeated frames from which on they are told, and the part of all frames that they are at least.
const TOLD: usize = 5;
const TOLD_PART: f64 = 0.02;

/// Steps of markers from frame to frame; where they stop for a frame and go on in the same direction, a frame was repeated.
#[derive(Debug, Default)]
pub struct Repeats {
    last: Vec<Option<Vector2<f64>>>,
    /// The last steps that were a motion.
    moved: Vec<Option<Vector2<f64>>>,
    /// Frames since then that stay, and the longest step in them, px.
    stays: usize,
    longest_px: f64,
    repeated: usize,
    frames: usize,
}

fn longest(steps: &[Option<Vector2<f64>>]) -> f64 {
    steps.iter().flatten().map(|s| s.norm()).fold(0.0, f64::max)
}

impl Repeats {
    /// Takes in the nodes of a frame.
    pub fn push(&mut self, row: &[Observation]) {
        self.frames += 1;
        let place = |o: &Observation| o.status.is_seen().then(|| Vector2::new(o.x_px, o.y_px));
        let now: Vec<Option<Vector2<f64>>> = row.iter().map(place).collect();
        let step = |(a, b): (&Option<Vector2<f64>>, &Option<Vector2<f64>>)| Some((*b)? - (*a)?);
        let steps: Vec<Option<Vector2<f64>>> = self.last.iter().zip(&now).map(step).collect();
        self.last = now;
        if steps.iter().all(Option::is_none) {
            (self.moved, self.stays, self.longest_px) = (Vec::new(), 0, 0.0);
            return;
        }
        let (before_px, now_px) = (longest(&self.moved), longest(&steps));
        if before_px >= MOVES_PX && now_px < STAYS * before_px {
            self.stays += 1;
            self.longest_px = self.longest_px.max(now_px);
            return;
        }
        let along = self.moved.iter().zip(&steps).filter_map(|(a, b)| Some((*a)?.dot(&(*b)?)));
        let goes_on = now_px >= MOVES_PX && self.longest_px < STAYS * now_px && along.sum::<f64>() > 0.0;
        if goes_on && (1..=LONGEST).contains(&self.stays) {
            self.repeated += self.stays;
        }
        (self.moved, self.stays, self.longest_px) = (steps, 0, 0.0);
    }

    /// Warning of repeated frames, if they are many.
    pub fn words(&self) -> Option<Message> {
        let many = self.repeated >= TOLD && self.repeated as f64 >= TOLD_PART * self.frames as f64;
        many.then(|| copies_words(self.repeated, self.frames))
    }
}

/// Warning of frames that are copies.
pub fn copies_words(copies: usize, frames: usize) -> Message {
    format!(
        "{copies} of {frames} frames are copies of the frame before them, as recorders of a screen and converters make them: their \
         times are those of the file, not of what they show"
    )
    .into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observation::Status;

    fn told(x_px: impl Fn(usize) -> f64) -> bool {
        let mut repeats = Repeats::default();
        for k in 0..200 {
            let seen =
                Observation { x_px: x_px(k), y_px: 50.0, status: Status::Seen, ..Observation::MISSING };
            repeats.push(&[seen]);
        }
        repeats.words().is_some()
    }

    #[test]
    fn frames_shown_twice_are_told_and_things_that_turn_or_stop_are_not() {
        let swing = |k: f64| 300.0 + 100.0 * (0.25 * k).sin();
        assert!(told(|k| swing((k / 2 * 2) as f64)));
        assert!(told(|k| swing((k / 3 * 3) as f64)));
        assert!(told(|k| swing((k - usize::from(k % 7 == 3)) as f64)));
        assert!(!told(|k| swing(k as f64)));
        // Turns every fourth frame, and stops for ten frames.
        assert!(!told(|k| 100.0 + 5.0 * ((k + 4) % 8).abs_diff(4) as f64));
        assert!(!told(|k| 3.0 * (k - (k % 30).saturating_sub(20)) as f64));
    }
}
