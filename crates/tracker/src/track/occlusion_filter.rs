//! Accepts or drops half hidden markers by the frames around them.
//!
//! Owns: [`OcclusionFilter`]. A blob beside a node's place may be the rest of the marker or a glint. A marker is hidden and
//! shown again gradually, so it is believed where an unbroken run of such frames touches one in which it is whole.

use std::collections::VecDeque;

use nalgebra::Vector2;

use crate::observation::{Observation, Status};
use crate::store::FrameStamp;

/// Frames that wait for what comes after them, at most.
const LONGEST: usize = 64;

/// A run of so many frames in which something went along with the marker's place is no chance: one glint in 10^3
/// falls beside a place, three in a row one in 10^9.
const RUN: usize = 3;
/// So far must the place go in a run, px: well above what a firm pose is uncertain by.
const RUN_PX: f64 = 2.0;
/// Part of the place's way that what is seen must go too. What stands still goes none of it; what is left of a marker
/// goes all of it, give or take the edge that hides it.
const ALONG: f64 = 0.5;

/// One frame's nodes and, for each, whether only a part of it is seen.
#[derive(Debug, Clone)]
struct Held {
    stamp: FrameStamp,
    row: Vec<Observation>,
    /// Of a node that waits to be believed how far what is seen of it is from its place, px.
    doubt: Vec<Option<Vector2<f64>>>,
}

/// Frames whose half hidden markers are not yet believed or given up.
#[derive(Debug, Clone, Default)]
pub struct OcclusionFilter {
    held: VecDeque<Held>,
    /// For each node whether it is given in the newest frame.
    given: Vec<bool>,
}

impl OcclusionFilter {
    /// Takes the next frame in order; `offsets` says for each node of which only a part is seen how far that is from
    /// its place, px.
    pub fn push(&mut self, stamp: FrameStamp, row: Vec<Observation>, offsets: &[Option<Vector2<f64>>]) {
        let n = row.len();
        self.given.resize(n, false);
        let mut doubt = vec![None; n];
        for k in 0..n {
            let seen = row[k].status == Status::Seen;
            if seen && offsets[k].is_some() {
                doubt[k] = offsets[k].filter(|_| !self.given[k]);
                continue;
            }
            if seen {
                // Whole: what led up to it was it.
                for h in self.held.iter_mut().rev() {
                    if h.doubt[k].take().is_none() {
                        break;
                    }
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
    /// all the same.
    fn give_up(&mut self, node: usize) {
        let believed = self.went_along(node);
        for h in &mut self.held {
            if h.doubt[node].take().is_some() && !believed {
                h.row[node] = Observation::MISSING;
            }
        }
    }

    /// Whether what is seen of a node in doubt moves as its place does, which what stands there does not.
    fn went_along(&self, node: usize) -> bool {
        let run: Vec<(Vector2<f64>, Vector2<f64>)> = self
            .held
            .iter()
            .filter_map(|h| {
                let place = Vector2::new(h.row[node].x_px, h.row[node].y_px);
                h.doubt[node].map(|off| (place, place + off))
            })
            .collect();
        let Some(&first) = run.first() else { return false };
        let ways = run.iter().map(|at| (at.0 - first.0, at.1 - first.1));
        let farthest = ways.max_by(|a, b| a.0.norm_squared().total_cmp(&b.0.norm_squared()));
        run.len() >= RUN
            && farthest.is_some_and(|(place, seen)| {
                place.norm() > RUN_PX && seen.dot(&place) > ALONG * place.norm_squared()
            })
    }

    /// The next frame that waits for nothing; at the `end` of the recording every frame.
    pub fn pop(&mut self, end: bool) -> Option<(FrameStamp, Vec<Observation>)> {
        if end {
            for k in 0..self.given.len() {
                self.give_up(k);
            }
        }
        if self.held.front()?.doubt.iter().any(Option::is_some) {
            return None;
        }
        self.held.pop_front().map(|h| (h.stamp, h.row))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `x` whole, `p` half hidden, `.` not seen; what is believed in the end.
    fn believed(frames: &str) -> String {
        let mut filter = OcclusionFilter::default();
        let mut out = String::new();
        let take = |p: &mut OcclusionFilter, end: bool, out: &mut String| {
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
            filter.push(stamp, row, &[(c == 'p').then(Vector2::zeros)]);
            take(&mut filter, false, &mut out);
        }
        take(&mut filter, true, &mut out);
        out
    }

    #[test]
    fn a_run_that_goes_along_with_the_body_is_believed() {
        // What goes along, what stands still where the place comes by, and too short a way to tell.
        for (step_px, goes, seen) in
            [(1.0, 1.0, true), (1.0, 0.8, true), (1.0, 0.0, false), (0.5, 1.0, false)]
        {
            let mut filter = OcclusionFilter::default();
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
                let off = Vector2::new((goes - 1.0) * step_px * f64::from(i), 1.5);
                filter.push(stamp, row, &[Some(off)]);
            }
            let rows: Vec<bool> = std::iter::from_fn(|| filter.pop(true))
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
