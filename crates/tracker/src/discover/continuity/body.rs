//! Fits a body's shape and poses to the tracklets of its markers.
//!
//! Owns: [`TrackletBody`]. Must not: decide which tracklets these are.

use nalgebra::{Isometry2, Translation2, Vector2};

use super::evidence::Evidence;
use crate::discover::arrange::Found;
use crate::discover::bodies::{FLOOR_PX, link_of};
use crate::rigid::joint::{Shared, Turning};
use crate::rigid::pose::{Pair, fit_pose, place};

/// Rounds in which shape and poses are fitted to each other.
const ROUNDS: usize = 12;
/// Misfit at which a centre loses half of its weight, px, and the same in standard uncertainties.
const SOFT_PX: f64 = 0.15;
const SOFT_SIGMA: f64 = 5.0;

/// A body with its poses, and which tracklets its markers are.
#[derive(Debug, Clone)]
pub struct FoundBody {
    /// The body.
    pub found: Found,
    /// For each node of its link the tracklets of the evidence.
    pub markers: Vec<Vec<usize>>,
}

/// A body whose markers are tracklets.
#[derive(Debug, Clone)]
pub(super) struct TrackletBody {
    /// For each marker its tracklets, of which no two coexist.
    pub markers: Vec<Vec<usize>>,
    /// Places of the markers in the body, px, about their mean.
    pub shape: Vec<Vector2<f64>>,
    /// In each frame of the evidence.
    pub poses: Vec<Option<Isometry2<f64>>>,
}

impl TrackletBody {
    /// Fits shape and poses.
    pub(super) fn fit(evidence: &Evidence<'_>, markers: Vec<Vec<usize>>) -> Self {
        let n = evidence.frames.len();
        let mut seen: Vec<Vec<(usize, Vector2<f64>)>> = vec![Vec::new(); n];
        for (q, tracklets) in markers.iter().enumerate() {
            for &t in tracklets {
                for k in evidence.spans[t].clone() {
                    if let Some(p) = evidence.place(t, k) {
                        seen[k].push((q, p));
                    }
                }
            }
        }
        let mut shape: Vec<Option<Vector2<f64>>> = vec![None; markers.len()];
        // The first of the frames with most markers; the others are put to it one by one.
        if let Some(most) = seen.iter().rev().max_by_key(|s| s.len()) {
            for &(q, p) in most {
                shape[q] = Some(p);
            }
        }
        let soft_px = SOFT_PX.max(SOFT_SIGMA * evidence.sigma_px);
        let pose = |shape: &[Option<Vector2<f64>>], seen: &[(usize, Vector2<f64>)]| {
            let pairs: Vec<Pair> = seen
                .iter()
                .filter_map(|&(q, place)| Some(Pair { local: shape[q]?, place, sigma_px: evidence.sigma_px }))
                .collect();
            let first = fit_pose(&pairs)?.pose;
            if pairs.len() == 2 {
                return Some(first);
            }
            let softened: Vec<Pair> = pairs
                .iter()
                .map(|p| {
                    let off = (place(&first, p.local) - p.place).norm();
                    Pair { sigma_px: p.sigma_px * (1.0 + (off / soft_px).powi(2)).sqrt(), ..*p }
                })
                .collect();
            fit_pose(&softened).map(|f| f.pose)
        };
        for _ in 0..ROUNDS {
            let mut sums = vec![(0.0, Vector2::zeros()); markers.len()];
            for s in seen.iter().filter(|s| s.len() > 1) {
                let Some(pose) = pose(&shape, s) else { continue };
                let back = pose.inverse();
                for &(q, p) in s {
                    let local = place(&back, p);
                    let w = shape[q].map_or(1.0, |t| 1.0 / (1.0 + ((local - t).norm() / soft_px).powi(2)));
                    sums[q].0 += w;
                    sums[q].1 += w * local;
                }
            }
            for (t, (w, sum)) in shape.iter_mut().zip(sums) {
                if w > 0.0 {
                    *t = Some(sum / w);
                }
            }
        }
        let known: Vec<Vector2<f64>> = shape.iter().flatten().copied().collect();
        let mean = known.iter().sum::<Vector2<f64>>() / known.len().max(1) as f64;
        let poses = seen.iter().map(|s| pose(&shape, s).map(|p| p * Translation2::from(mean))).collect();
        let shape = shape.into_iter().map(|t| t.unwrap_or(mean) - mean).collect();
        Self { markers, shape, poses }
    }

    /// A tracklet as the body sees it, in the frames in which both are known.
    pub(super) fn local<'a>(
        &'a self,
        evidence: &'a Evidence<'_>,
        t: usize,
    ) -> impl Iterator<Item = (usize, Vector2<f64>)> + 'a {
        evidence.spans[t]
            .clone()
            .filter_map(move |k| Some((k, place(&self.poses[k]?.inverse(), evidence.place(t, k)?))))
    }

    /// Whether a tracklet may be marker `q`, which is seen nowhere while it is.
    pub(super) fn free(&self, evidence: &Evidence<'_>, q: usize, t: usize) -> bool {
        self.markers[q].iter().all(|&o| !evidence.coexist(o, t))
    }

    /// The point that it shares with another, or with the ground.
    pub(super) fn joint(&self, other: Option<&Self>) -> Option<Turning> {
        let mut sums = Shared::default();
        for (k, pose) in self.poses.iter().enumerate() {
            let Some(pose) = pose else { continue };
            match other {
                None => sums.add(pose, &Isometry2::identity()),
                Some(o) => {
                    if let Some(o) = &o.poses[k] {
                        sums.add(pose, o);
                    }
                }
            }
        }
        sums.solve()
    }

    /// As a rig is arranged from.
    pub(super) fn found(&self) -> FoundBody {
        let home = self.poses.iter().flatten().next().map_or(Vector2::zeros(), |p| p.translation.vector);
        let link = link_of(self.shape.iter().map(|t| t + home).collect(), FLOOR_PX);
        let found = Found { link, poses: self.poses.clone() };
        FoundBody { found, markers: self.markers.clone() }
    }
}
