//! Carries tracklets from frame to frame.
//!
//! Owns: [`Linker`]. Must not: bridge a frame in which a marker is not seen.

use nalgebra::Vector2;

use super::tracklet::{Point, Tracklet};
use crate::detect::{Detection, Flags};
use crate::rigid::index::DetectionIndex;

/// The gate of a link: how far from its prediction a marker may be, and by how much nearer than any other.
#[derive(Debug, Clone, Copy)]
struct Gate {
    /// Largest distance, px.
    reach_px: f64,
    /// Least distance of the second nearest marker over that of the nearest.
    ratio: f64,
    /// Least distance of the second nearest marker, px.
    apart_px: f64,
}

/// A marker seen once may have gone anywhere near, so that the next one must be by far the nearest.
const FIRST: Gate = Gate { reach_px: 30.0, ratio: 3.0, apart_px: 4.0 };
/// Gates of a marker seen twice, and three times or more: a least distance (px) for noise, and a part of the last step. A step
/// that changes by a tenth a frame uses less than half of the gate.
const SECOND: (f64, f64) = (2.5, 0.5);
const LATER: (f64, f64) = (2.0, 0.35);
const RATIO: f64 = 2.0;
const APART_PX: f64 = 1.5;
/// Areas of one marker in consecutive frames are within this ratio: blur along a step of its own radius, and one half hidden.
const LOOK: f32 = 2.5;
/// A tracklet of fewer points tells nothing.
const LEAST: usize = 5;

/// Makes tracklets of frames in their order.
#[derive(Debug, Default)]
pub struct Linker {
    live: Vec<Tracklet>,
    done: Vec<Tracklet>,
    last: Option<usize>,
}

/// The nearest and how far the next is.
#[derive(Debug, Clone, Copy)]
struct Nearest {
    which: usize,
    near_px: f64,
    next_px: f64,
}

impl Nearest {
    const NONE: Self = Self { which: usize::MAX, near_px: f64::INFINITY, next_px: f64::INFINITY };

    fn take(&mut self, which: usize, px: f64) {
        if px < self.near_px {
            *self = Self { which, near_px: px, next_px: self.near_px };
        } else {
            self.next_px = self.next_px.min(px);
        }
    }
}

/// The predicted place of a tracklet, and its gate.
fn expected(points: &[Point]) -> (Vector2<f64>, Gate) {
    let n = points.len();
    let p = |back: usize| points[n - back].place;
    if n == 1 {
        return (p(1), FIRST);
    }
    let step = p(1) - p(2);
    let gate = |(least, part): (f64, f64)| Gate {
        reach_px: least + part * step.norm(),
        ratio: RATIO,
        apart_px: APART_PX,
    };
    if n == 2 {
        return (p(1) + step, gate(SECOND));
    }
    // Half way between the straight line and the parabola: half of the acceleration, with less of the noise.
    let bend = step - (p(2) - p(3));
    (p(1) + step + 0.5 * bend, gate(LATER))
}

impl Linker {
    /// Adds the frame of index `frame`; a gap before it ends all tracklets.
    pub fn push(&mut self, frame: usize, detections: &[Detection]) {
        if self.last.is_some_and(|last| last + 1 != frame) {
            self.end();
        }
        self.last = Some(frame);
        let index = DetectionIndex::new(detections);
        let single = |d: usize| !detections[d].flags.has(Flags::MERGED);
        let mut of_track = vec![Nearest::NONE; self.live.len()];
        let mut of_detection = vec![Nearest::NONE; detections.len()];
        let mut gates = Vec::with_capacity(self.live.len());
        let mut near = Vec::new();
        for (t, track) in self.live.iter().enumerate() {
            let (place, gate) = expected(&track.points);
            gates.push(gate);
            index.within(place, gate.ratio * gate.reach_px + gate.apart_px, &mut near);
            for &d in &near {
                let px = (index.place(d) - place).norm();
                of_track[t].take(d, px);
                of_detection[d].take(t, px);
            }
        }
        let mut owner = vec![None; detections.len()];
        for (t, (n, gate)) in of_track.iter().zip(&gates).enumerate() {
            // A blob of several markers competes and is not taken.
            if n.near_px > gate.reach_px || !single(n.which) {
                continue;
            }
            let other = of_detection[n.which];
            let clear = (gate.ratio * n.near_px).max(gate.apart_px);
            let last = self.live[t].points[self.live[t].points.len() - 1].area_px;
            let area = detections[n.which].area_px;
            let alike = area < LOOK * last && last < LOOK * area;
            if other.which == t && n.next_px >= clear && other.next_px >= clear && alike {
                owner[n.which] = Some(t);
            }
        }
        let mut grown: Vec<Option<usize>> = vec![None; self.live.len()];
        for (d, t) in owner.iter().enumerate() {
            if let Some(t) = t {
                grown[*t] = Some(d);
            }
        }
        let mut next = Vec::with_capacity(detections.len());
        for (mut track, d) in std::mem::take(&mut self.live).into_iter().zip(grown) {
            match d {
                Some(d) => {
                    track.points.push(Point::of(&detections[d]));
                    next.push(track);
                }
                None => self.keep(track),
            }
        }
        for (d, t) in owner.iter().enumerate() {
            if t.is_none() && single(d) && detections[d].x_px.is_finite() && detections[d].y_px.is_finite() {
                next.push(Tracklet { first: frame, points: vec![Point::of(&detections[d])] });
            }
        }
        self.live = next;
    }

    fn keep(&mut self, track: Tracklet) {
        if track.points.len() >= LEAST {
            self.done.push(track);
        }
    }

    fn end(&mut self) {
        for track in std::mem::take(&mut self.live) {
            self.keep(track);
        }
    }

    /// The tracklets, the longest first.
    pub fn finish(mut self) -> Vec<Tracklet> {
        self.end();
        self.done.sort_by_key(|t| (std::cmp::Reverse(t.points.len()), t.first));
        self.done
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x_px: f64, y_px: f64) -> Detection {
        Detection { x_px, y_px, area_px: 100.0, sigma_px: 0.03, ..Default::default() }
    }

    #[test]
    fn two_that_cross_end_and_no_tracklet_jumps() {
        let mut linker = Linker::default();
        for k in 0..101 {
            let t = f64::from(k);
            // They meet at frame 50 in one place.
            let mut frame = vec![at(100.0 + 2.0 * t, 100.0 + t), at(300.0 - 2.0 * t, 200.0 - t)];
            if (49..53).contains(&k) {
                frame = vec![at(200.0, 150.0)];
            }
            linker.push(k as usize, &frame);
        }
        let found = linker.finish();
        assert_eq!(found.len(), 4, "{found:?}");
        for t in &found {
            let straight = t.points.windows(2).all(|p| {
                let v = p[1].place - p[0].place;
                (v.x.abs() - 2.0).abs() < 1e-9 && (v.y.abs() - 1.0).abs() < 1e-9
            });
            assert!(straight, "{t:?}");
        }
    }

    #[test]
    fn what_competes_ends_a_tracklet() {
        let mut linker = Linker::default();
        for k in 0..60 {
            let t = f64::from(k);
            let mut frame = vec![at(100.0 + 3.0 * t, 100.0)];
            if k == 30 {
                // A glint beside it: which of the two it is nobody knows.
                frame.push(at(100.0 + 3.0 * t + 0.9, 100.0));
            }
            linker.push(k as usize, &frame);
        }
        let found = linker.finish();
        assert_eq!(found.iter().map(|t| (t.first, t.end())).collect::<Vec<_>>(), [(0, 30), (31, 60)]);
    }

    #[test]
    fn a_frame_that_is_missing_ends_all() {
        let mut linker = Linker::default();
        for k in (0..20).chain(21..40) {
            linker.push(k, &[at(50.0 + k as f64, 60.0)]);
        }
        assert_eq!(linker.finish().len(), 2);
    }
}
