//! Names the detections of one frame, given the frames before it.
//!
//! Owns: [`FrameTracker`]. Must not: look ahead; it goes either way through time.
//!
//! Every body is first looked for where its motion carries it, then anywhere. What is found is accepted when it
//! is very unlikely to be chance and no other pose explains as much; else the body stays open. Never guessed.

use super::bodies::Bodies;
use super::chain::find_chains;
use super::motion_priors::MotionPriors;
use super::occluded::find_occluded;
use super::seen::{BodySeen, accepted};
use super::tentative::{Tentative, follow};
use crate::error::Result;
use crate::rigid::body::Mechanism;
use crate::rigid::hypothesis::PoseHypothesis;
use crate::rigid::index::DetectionIndex;
use crate::stop::Stop;

/// Follows bodies through frames in either direction of time.
#[derive(Debug, Clone)]
pub struct FrameTracker {
    /// The bodies.
    pub bodies: Bodies,
    /// For each body hypotheses that may be it and wait for their motion to decide.
    tentative: Vec<Vec<Tentative>>,
    /// Frames in which a search ended at its bound of work; `step_one`, which repairs a frame, does not count.
    pub bounded_frames: u64,
}

impl FrameTracker {
    /// A tracker that knows no pose yet.
    pub fn new(mechanism: Mechanism, priors: MotionPriors) -> Self {
        let tentative = vec![Vec::new(); mechanism.links.len()];
        Self { bodies: Bodies::new(mechanism, priors), tentative, bounded_frames: 0 }
    }

    /// Names the detections of one frame. `time` in frames may go either way. Bodies that are already known in
    /// this frame are given in `known` and stay as they are.
    ///
    /// # Errors
    /// [`crate::error::Error::Interrupted`] once `stop` was asked for; the tracker is then of no use any more.
    pub fn step(
        &mut self,
        time: f64,
        index: &DetectionIndex<'_>,
        known: Option<&[BodySeen]>,
        stop: &Stop,
    ) -> Result<Vec<BodySeen>> {
        let n = self.bodies.mechanism.links.len();
        self.bodies.work.begin_frame();
        let mut seen: Vec<BodySeen> = match known {
            Some(k) => k.to_vec(),
            None => vec![BodySeen::default(); n],
        };
        let mut free = vec![true; index.len()];
        for s in &seen {
            for d in s.detections() {
                free[d] = false;
            }
        }
        let given: Vec<bool> = seen.iter().map(|s| s.fit.is_some()).collect();
        let mut undecided: Vec<Vec<(PoseHypothesis, f64)>> = (0..n).map(|_| Vec::new()).collect();
        let mut settled = vec![false; n];
        let mut is_bounded = false;
        // Step 1: each body by itself, twice, since a body that was found can hold its neighbours.
        for round in 0..2 {
            for k in 0..n {
                let b = self.bodies.mechanism.order[k];
                if seen[b].fit.is_some() {
                    continue;
                }
                let anchors = self.bodies.anchors(b, &seen);
                // A second search may differ only if a joint's place or a look-alike body was found in between.
                if round == 1 && anchors.is_empty() && self.bodies.indistinguishable[b].is_empty() {
                    continue;
                }
                stop.heed()?;
                let got = self.bodies.find(b, time, index, &free, &anchors, &seen);
                is_bounded |= got.is_bounded;
                if got.seen.fit.is_some() || seen[b].picks.is_empty() || round == 1 {
                    seen[b] = got.seen;
                    undecided[b] = got.undecided;
                }
                for d in seen[b].picks.iter().flatten() {
                    free[*d] = false;
                }
            }
        }
        find_chains(&self.bodies, index, &mut free, &mut seen);
        // Step 2: hypotheses that nothing decided are followed until their motion decides.
        for k in 0..n {
            let b = self.bodies.mechanism.order[k];
            if seen[b].fit.is_some() {
                self.tentative[b].clear();
                continue;
            }
            stop.heed()?;
            let anchors = self.bodies.anchors(b, &seen);
            let mut hypotheses = std::mem::take(&mut undecided[b]);
            // Drop hypotheses that could be an indistinguishable body not found yet.
            hypotheses.retain(|(s, _)| !self.bodies.may_be_twin(b, time, index, s, &seen));
            if let Some(s) =
                follow(&mut self.bodies, &mut self.tentative[b], b, time, index, &free, &anchors, hypotheses)
                && !self.bodies.may_be_twin(b, time, index, &s, &seen)
            {
                for d in s.picks.iter().flatten() {
                    free[*d] = false;
                }
                seen[b] = accepted(s, self.bodies.mechanism.links[b].nodes.len());
                settled[b] = true;
            }
        }
        // Step 3: nodes that another thing hides in part.
        for &b in self.bodies.mechanism.order.iter().filter(|&&b| !given[b]) {
            find_occluded(&self.bodies.mechanism, b, index, &mut free, &mut seen);
        }
        // Step 4: the poses that were found go into the bodies' motions.
        for b in 0..n {
            if let Some(f) = &seen[b].fit
                && !given[b]
                // `follow` gave a settled body its motion.
                && !settled[b]
            {
                self.bodies.motions[b].add(time, f);
            }
        }
        self.bounded_frames += u64::from(is_bounded);
        Ok(seen)
    }

    /// Looks for one body with all others as `known` says: the repair of a frame by what both directions of time found.
    pub fn step_one(
        &mut self,
        b: usize,
        time: f64,
        index: &DetectionIndex<'_>,
        known: &[BodySeen],
    ) -> BodySeen {
        self.bodies.work.begin_frame();
        let mut free = vec![true; index.len()];
        for (o, s) in known.iter().enumerate() {
            if o != b && s.fit.is_some() {
                for d in s.detections() {
                    free[d] = false;
                }
            }
        }
        let anchors = self.bodies.anchors(b, known);
        let mut seen = known.to_vec();
        seen[b] = self.bodies.find(b, time, index, &free, &anchors, known).seen;
        find_occluded(&self.bodies.mechanism, b, index, &mut free, &mut seen);
        let got = seen.swap_remove(b);
        if let Some(f) = &got.fit {
            self.bodies.motions[b].add(time, f);
        }
        got
    }
}
