//! Asks of two tracklets whether they keep their distance.
//!
//! Owns: [`PairFacts`]. Must not: form bodies.

use std::f64::consts::PI;

use nalgebra::Vector2;

use super::evidence::Evidence;

/// Frames that two tracklets must share to be compared.
const LEAST_FRAMES: usize = 30;
/// Distances are not known better than this, px.
const LEAST_SCATTER_PX: f64 = 0.02;
/// Part of these in which the distance is the same. Not all: a marker may be half hidden for a while.
const SAME_PART: f64 = 0.6;
/// All but 3 % of the distances are within this of it, px: what half hides a disc of 6 px moves its centre by 1 px.
const FAR_PX: f64 = 1.6;
/// Frames, or turn in rad, from which on keeping the distance says something.
const MANY_FRAMES: usize = 100;
const TURNED_RAD: f64 = 0.3;
/// Or, between markers, how far a straight way would be from the arc that keeps the distance, in units of what the distances scatter about it: of less
/// motion, seen in few frames, a rigid pair is not told from one that moves straight on.
const ARC_SCATTERS: f64 = 10.0;

/// The relation of two tracklets: how their distance and direction change.
#[derive(Debug, Clone, Copy)]
pub(super) struct PairFacts {
    /// Frames in which both are whole.
    pub frames: usize,
    /// The distance that most have, px.
    pub distance_px: f64,
    /// Part of the frames that have it.
    pub part: f64,
    /// Root mean square of these about it, px.
    pub rms_px: f64,
    /// All but 3 % of the distances are within this of it, px.
    pub far_px: f64,
    /// All but 15 % of the distances are within this part of the median.
    pub varies: f64,
    /// How far the line between them turned, rad.
    pub turned_rad: f64,
    /// Whether both are known to be markers.
    are_markers: bool,
}

impl PairFacts {
    /// `None` where they share too few frames.
    pub(super) fn of(evidence: &Evidence<'_>, a: usize, b: usize) -> Option<Self> {
        let arms: Vec<Vector2<f64>> = evidence
            .shared(a, b)
            .filter_map(|k| Some(evidence.place(b, k)? - evidence.place(a, k)?))
            .collect();
        let frames = arms.len();
        if frames < LEAST_FRAMES {
            return None;
        }
        let mut distances: Vec<f64> = arms.iter().map(|v| v.norm()).collect();
        distances.sort_by(f64::total_cmp);
        let median = distances[frames / 2];
        // The window with most of the distances in it.
        let half_px = 2.0 * (4.0 * evidence.sigma_px + 0.02 + 0.001 * median);
        let (mut first, mut count, mut end) = (0, 0, 0);
        for start in 0..frames {
            while end < frames && distances[end] <= distances[start] + half_px {
                end += 1;
            }
            if end - start > count {
                (first, count) = (start, end - start);
            }
        }
        let distance_px = distances[first + count / 2];
        let off = |d: &f64| (d - distance_px).abs();
        let inside: Vec<f64> = distances.iter().map(off).filter(|&e| e < half_px).collect();
        let rms_px = (inside.iter().map(|e| e * e).sum::<f64>() / inside.len().max(1) as f64).sqrt();
        let mut errors: Vec<f64> = distances.iter().map(off).collect();
        errors.sort_by(f64::total_cmp);
        let mut about: Vec<f64> = distances.iter().map(|d| (d - median).abs()).collect();
        about.sort_by(f64::total_cmp);
        let (mut angle, mut low, mut high) = (0.0, 0.0_f64, 0.0_f64);
        for v in arms.windows(2) {
            angle += v[0].perp(&v[1]).atan2(v[0].dot(&v[1]));
            low = low.min(angle);
            high = high.max(angle);
        }
        Some(Self {
            frames,
            distance_px,
            part: count as f64 / frames as f64,
            rms_px,
            far_px: errors[frames * 97 / 100],
            varies: about[frames * 85 / 100] / median.max(1e-6),
            turned_rad: high - low,
            are_markers: evidence.are_markers,
        })
    }

    /// Height of the arc on which one goes about the other over its chord, px.
    fn sagitta_px(&self) -> f64 {
        self.distance_px * (1.0 - (self.turned_rad.min(PI) / 2.0).cos())
    }

    /// Whether they are on one body, as far as their distance tells.
    pub(super) fn rigid(&self) -> bool {
        self.part > SAME_PART
            && self.far_px < FAR_PX
            && (self.frames >= MANY_FRAMES
                || self.turned_rad > TURNED_RAD
                || self.are_markers && self.sagitta_px() > ARC_SCATTERS * self.rms_px.max(LEAST_SCATTER_PX))
    }
}
