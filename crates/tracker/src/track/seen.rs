//! Holds what a frame says about one body: its pose, and which detection is which of its nodes.
//!
//! Owns: [`BodySeen`], [`Occluded`]. Must not: decide anything.

use nalgebra::Vector2;

use crate::rigid::hypothesis::PoseHypothesis;
use crate::rigid::pose::PoseFit;

/// The evidence of one frame about one body.
#[derive(Debug, Clone, Default)]
pub struct BodySeen {
    /// The accepted pose.
    pub fit: Option<PoseFit>,
    /// For each node of the body its detection.
    pub picks: Vec<Option<usize>>,
    /// For each node of the body whether something seen may be it.
    pub open: Vec<bool>,
    /// For each node of the body a detection beside its place, as a half hidden marker's is. No part of the pose.
    pub occluded: Vec<Option<Occluded>>,
}

impl BodySeen {
    /// Detections that are nodes of the body.
    pub fn detections(&self) -> impl Iterator<Item = usize> {
        self.picks.iter().flatten().copied().chain(self.occluded.iter().flatten().map(|b| b.detection))
    }
}

/// The visible part of a half hidden marker, or the blob in which it runs together with others.
#[derive(Debug, Clone, Copy)]
pub struct Occluded {
    /// The detection.
    pub detection: usize,
    /// Where the body says the marker's centre is, px.
    pub place: Vector2<f64>,
    /// The detection's centre from there, px.
    pub off: Vector2<f64>,
}

/// The evidence of an accepted hypothesis about a body of `n` nodes.
pub(super) fn accepted(s: PoseHypothesis, n: usize) -> BodySeen {
    BodySeen { fit: Some(s.fit), picks: s.picks, open: vec![false; n], occluded: vec![None; n] }
}
