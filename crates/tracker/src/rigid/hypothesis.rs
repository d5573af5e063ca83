//! Pose hypotheses of one body in one frame, and the points that hold the body.
//!
//! Owns: [`Anchor`], [`PoseHypothesis`], [`Found`]. Must not: look for a pose (`search` does).

use std::collections::HashSet;

use nalgebra::Vector2;

use super::pose::PoseFit;

/// Hypotheses up to which each is compared with a new one; beyond, a table is quicker.
const FEW_HYPOTHESES: usize = 32;

/// A point of the body whose place in the image is known from elsewhere: the pivot, a neighbour's joint.
#[derive(Debug, Clone, Copy)]
pub struct Anchor {
    /// In the body's coordinates, px.
    pub local: Vector2<f64>,
    /// In the image, px.
    pub place: Vector2<f64>,
    /// Standard uncertainty of each coordinate, px.
    pub sigma_px: f64,
}

/// A pose hypothesis: a pose and the detections that agree with it.
#[derive(Debug, Clone)]
pub struct PoseHypothesis {
    /// The pose, fitted on anchors and whole detections.
    pub fit: PoseFit,
    /// For each node of the body its detection.
    pub picks: Vec<Option<usize>>,
    /// Number of nodes whose whole detection agrees.
    pub inliers: usize,
    /// Sum of squared residuals of the nodes over their variances.
    pub chi2: f64,
}

/// Outcome of a search.
#[derive(Debug, Default)]
pub struct Found {
    /// Hypotheses with different detections, the best first.
    pub hypotheses: Vec<PoseHypothesis>,
    /// Poses that the detections allowed and that were tested.
    pub trials: usize,
    /// There were more detections or poses than are tried.
    pub is_bounded: bool,
    /// Detections of the hypotheses, once these are many.
    known: HashSet<Vec<Option<usize>>>,
}

impl Found {
    /// Keeps a hypothesis unless one with the same detections is known.
    pub(super) fn keep(&mut self, hypothesis: PoseHypothesis) {
        let is_new = if self.hypotheses.len() < FEW_HYPOTHESES {
            !self.hypotheses.iter().any(|other| other.picks == hypothesis.picks)
        } else {
            if self.known.is_empty() {
                self.known.extend(self.hypotheses.iter().map(|other| other.picks.clone()));
            }
            self.known.insert(hypothesis.picks.clone())
        };
        if is_new {
            self.hypotheses.push(hypothesis);
        }
    }
}
