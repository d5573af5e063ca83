//! Half hidden markers: which of them are believed, once the frames around them are known.
//!
//! Owns: [`Partly`]. A blob beside a node's place may be the rest of the marker or a glint. A marker is hidden and
//! shown again gradually, so it is believed where an unbroken run of such frames touches one in which it is whole.

use std::collections::VecDeque;

use super::{Observation, Status};
use crate::store::FrameStamp;

/// Frames that wait for what comes after them, at most.
const LONGEST: usize = 64;

/// A run of so many frames in which the marker went so far is no chance, px.
const RUN: usize = 3;
const RUN_PX: f64 = 8.0;

/// One frame's nodes and, for each, whether only a part of it is seen.
#[derive(Debug, Clone)]
struct Held {
    stamp: FrameStamp,
    row: Vec<Observation>,
    /// Whether a node waits to be believed.
    doubt: Vec<bool>,
}

/// Frames whose half hidden markers are not yet believed or given up.
#[derive(Debug, Clone, Default)]
pub struct Partly {
    held: VecDeque<Held>,
    /// For each node whether it is given in the newest frame.
    given: Vec<bool>,
}

impl Partly {
    /// Takes the next frame in order; `partly` says for each node whether only a part of it is seen.
    pub fn push(&mut self, stamp: FrameStamp, row: Vec<Observation>, partly: &[bool]) {
        let n = row.len();
        self.given.resize(n, false);
        let mut doubt = vec![false; n];
        for k in 0..n {
            let seen = row[k].status == Status::Seen;
            if seen && partly[k] {
                doubt[k] = !self.given[k];
                continue;
            }
            if seen {
                // Whole: what led up to it was it.
                for h in self.held.iter_mut().rev() {
                    if !h.doubt[k] {
                        break;
                    }
                    h.doubt[k] = false;
                }
            } else {
                self.give_up(k);
            }
            self.given[k] = seen;
        }
        self.held.push_back(Held { stamp, row, doubt });
        if self.held.len() > LONGEST {
            for k in 0..n {
                self.give_up(k);
            }
        }
    }

    /// Ends a run that touched no frame in which the node is whole. One that went along with the body is believed
    /// all the same: glints do not last, and what stands still is soon farther off than half a marker.
    fn give_up(&mut self, node: usize) {
        let run: Vec<(f64, f64)> = self
            .held
            .iter()
            .filter(|h| h.doubt[node])
            .map(|h| (h.row[node].x_px, h.row[node].y_px))
            .collect();
        let far = match (run.first(), run.last()) {
            (Some(a), Some(b)) => (a.0 - b.0).hypot(a.1 - b.1),
            _ => 0.0,
        };
        let believed = run.len() >= RUN && far > RUN_PX;
        for h in &mut self.held {
            if std::mem::take(&mut h.doubt[node]) && !believed {
                h.row[node] = Observation::MISSING;
            }
        }
    }

    /// The next frame that waits for nothing; at the `end` of the recording every frame.
    pub fn pop(&mut self, end: bool) -> Option<(FrameStamp, Vec<Observation>)> {
        if end {
            for k in 0..self.given.len() {
                self.give_up(k);
            }
        }
        if self.held.front()?.doubt.contains(&true) {
            return None;
        }
        self.held.pop_front().map(|h| (h.stamp, h.row))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `x` whole, `p` partly, `.` not seen; what is believed in the end.
    fn believed(frames: &str) -> String {
        let mut partly = Partly::default();
        let mut out = String::new();
        let take = |p: &mut Partly, end: bool, out: &mut String| {
            while let Some((_, row)) = p.pop(end) {
                out.push(if row[0].status == Status::Seen { 'x' } else { '.' });
            }
        };
        for (i, c) in frames.chars().enumerate() {
            let mut row = vec![Observation::MISSING];
            if c != '.' {
                row[0].status = Status::Seen;
            }
            let stamp = FrameStamp { index: i as u64, ticks: i as i64, decoded: true };
            partly.push(stamp, row, &[c == 'p']);
            take(&mut partly, false, &mut out);
        }
        take(&mut partly, true, &mut out);
        out
    }

    #[test]
    fn a_run_that_goes_along_with_the_body_is_believed() {
        for (step_px, seen) in [(5.0, true), (1.0, false)] {
            let mut partly = Partly::default();
            for i in 0..6_u32 {
                let mut row = vec![Observation::MISSING];
                if (1..5).contains(&i) {
                    row[0] = Observation {
                        x_px: step_px * f64::from(i),
                        y_px: 0.0,
                        sigma_px: 1.0,
                        area_px: 60.0,
                        status: Status::Seen,
                    };
                }
                let stamp = FrameStamp { index: u64::from(i), ticks: i64::from(i), decoded: true };
                partly.push(stamp, row, &[true]);
            }
            let rows: Vec<bool> = std::iter::from_fn(|| partly.pop(true))
                .map(|(_, row)| row[0].status == Status::Seen)
                .collect();
            assert_eq!(rows, [false, seen, seen, seen, seen, false]);
        }
    }

    #[test]
    fn a_part_is_believed_where_it_touches_the_whole() {
        assert_eq!(believed("xxpp..pxx"), "xxxx..xxx");
        assert_eq!(believed("x.p.x"), "x...x");
        assert_eq!(believed("pp"), "..");
        assert_eq!(believed("..pppx"), "..xxxx");
        // A run too long to wait for is given up.
        // Here nothing moves.
        let long = format!(".{}x", "p".repeat(80));
        assert_eq!(believed(&long).len(), 82);
        assert!(believed(&long).starts_with(".."));
    }
}
