//! One frame's detections to named nodes, given the frames before it.
//!
//! Owns: [`Engine`], [`BodySeen`]. Must not: look ahead; it goes either way through time.
//!
//! Every body is first looked for where its motion carries it, then anywhere. What is found is accepted when it
//! is very unlikely to be chance and no other pose explains as much; else the body stays open. Never guessed.

use super::beside::{Beside, look_beside};
use super::chance::{likeness, twins};
use super::constellation::{Anchor, Search, Sighting};
use super::finding::accepted;
use super::habits::Habits;
use super::mechanism::{Holder, Mechanism};
use super::nearest::Sky;
use super::predict::{Forecast, Motion};
use super::rigid::{PoseFit, place};
use super::undecided::Tentative;

/// What a frame says about one body.
#[derive(Debug, Clone, Default)]
pub struct BodySeen {
    /// The accepted pose.
    pub fit: Option<PoseFit>,
    /// For each node of the body its detection.
    pub picks: Vec<Option<usize>>,
    /// For each node of the body whether something seen may be it.
    pub open: Vec<bool>,
    /// For each node of the body a detection beside its place, as a half hidden marker's is. No part of the pose.
    pub beside: Vec<Option<Beside>>,
}

impl BodySeen {
    /// Detections that are nodes of the body.
    pub fn detections(&self) -> impl Iterator<Item = usize> {
        self.picks.iter().flatten().copied().chain(self.beside.iter().flatten().map(|b| b.detection))
    }
}

/// Deviations up to which a detection agrees with its node. With nine nodes and 1e5 frames a true one is lost to
/// chance in one of 1e4 (Rayleigh: exp(-k^2 / 2) = 2.5e-6 at 5.1).
pub const REACH_SIGMA: f64 = 5.1;
/// Greatest expected number of chance sightings for a body found anywhere.
pub(super) const CHANCE_ANYWHERE: f64 = 1e-5;
/// Pairs of nodes from which a free body is sought.
pub const PAIRS: usize = 60;

/// Follows bodies through frames in either direction of time.
#[derive(Debug, Clone)]
pub struct Engine {
    /// Templates and hinges.
    pub mechanism: Mechanism,
    /// What to reckon with.
    pub habits: Habits,
    /// The last poses of each body.
    pub motions: Vec<Motion>,
    /// For each body sightings that may be it and wait for their motion to decide.
    pub(super) tentative: Vec<Vec<Tentative>>,
    /// For each body the least turn that maps it on itself as far as two nodes, rad.
    pub(super) likeness: Vec<f64>,
    /// For each body those that look the same.
    pub(super) twins: Vec<Vec<usize>>,
}

impl Engine {
    /// A tracker that knows no pose yet.
    pub fn new(mechanism: Mechanism, habits: Habits) -> Self {
        let motions = vec![Motion::default(); mechanism.links.len()];
        let likeness = (0..mechanism.links.len()).map(|b| likeness(&mechanism, &habits, b)).collect();
        let twins = twins(&mechanism, &habits);
        let tentative = vec![Vec::new(); mechanism.links.len()];
        Self { mechanism, habits, motions, tentative, likeness, twins }
    }

    /// Points of a body known from the ground and from bodies whose pose is known.
    pub fn anchors(&self, body: usize, fits: &[BodySeen]) -> Vec<Anchor> {
        let mut out: Vec<Anchor> = Vec::new();
        for h in self.mechanism.hinges.iter().filter(|h| h.body == body) {
            match h.holder {
                Holder::Ground(p) => out.push(Anchor { local: h.local, place: p, sigma_px: h.sigma_px }),
                Holder::Body(o, there) => {
                    if let Some(f) = &fits[o].fit {
                        let sigma_px = h.sigma_px.hypot(f.sigma_at(there));
                        out.push(Anchor { local: h.local, place: place(&f.pose, there), sigma_px });
                    }
                }
            }
        }
        out.sort_by(|a, b| a.sigma_px.total_cmp(&b.sigma_px));
        out
    }

    /// Where a body is expected at `time`.
    pub fn forecast(&self, body: usize, time: f64, anchors: &[Anchor]) -> Option<Forecast> {
        let f = self.motions[body].forecast(time, self.habits.floor[body], self.habits.first[body])?;
        Some(anchors.first().map_or(f, |a| f.hung(a.local, a.place)))
    }

    /// Names the detections of one frame. `time` in frames may go either way. Bodies that are already known in
    /// this frame are given in `known` and stay as they are.
    pub fn step(&mut self, time: f64, sky: &Sky<'_>, known: Option<&[BodySeen]>) -> Vec<BodySeen> {
        let n = self.mechanism.links.len();
        let mut seen: Vec<BodySeen> = match known {
            Some(k) => k.to_vec(),
            None => vec![BodySeen::default(); n],
        };
        let mut free = vec![true; sky.len()];
        for s in &seen {
            for d in s.detections() {
                free[d] = false;
            }
        }
        let given: Vec<bool> = seen.iter().map(|s| s.fit.is_some()).collect();
        let mut undecided: Vec<Vec<(Sighting, f64)>> = (0..n).map(|_| Vec::new()).collect();
        let mut settled = vec![false; n];
        // Twice: a body that was found can hold its neighbours.
        for round in 0..2 {
            for k in 0..n {
                let b = self.mechanism.order[k];
                if seen[b].fit.is_some() {
                    continue;
                }
                let anchors = self.anchors(b, &seen);
                // What its twin was found to be is no longer open.
                if round == 1 && anchors.is_empty() && self.twins[b].is_empty() {
                    continue;
                }
                let got = self.find(b, time, sky, &free, &anchors, &seen);
                if got.seen.fit.is_some() || seen[b].picks.is_empty() || round == 1 {
                    seen[b] = got.seen;
                    undecided[b] = got.undecided;
                }
                for d in seen[b].picks.iter().flatten() {
                    free[*d] = false;
                }
            }
        }
        for k in 0..n {
            let b = self.mechanism.order[k];
            if seen[b].fit.is_some() {
                self.tentative[b].clear();
                continue;
            }
            let anchors = self.anchors(b, &seen);
            let mut waiting = std::mem::take(&mut undecided[b]);
            // Whatever it does, it may be the other.
            waiting.retain(|(s, _)| !self.may_be_twin(b, time, sky, s, &seen));
            if let Some(s) = self.follow(b, time, sky, &free, &anchors, waiting)
                && !self.may_be_twin(b, time, sky, &s, &seen)
            {
                for d in s.picks.iter().flatten() {
                    free[*d] = false;
                }
                seen[b] = accepted(s, self.mechanism.links[b].nodes.len());
                settled[b] = true;
            }
        }
        for &b in self.mechanism.order.iter().filter(|&&b| !given[b]) {
            look_beside(&self.mechanism, b, sky, &mut free, &mut seen);
        }
        for b in 0..n {
            if let Some(f) = &seen[b].fit
                && !given[b]
                && !settled[b]
            {
                self.motions[b].add(time, f);
            }
        }
        seen
    }

    pub(super) fn search<'a>(
        &'a self,
        b: usize,
        sky: &'a Sky<'a>,
        free: &'a [bool],
        anchors: &'a [Anchor],
        window: Option<Forecast>,
    ) -> Search<'a> {
        Search {
            link: &self.mechanism.links[b],
            anchors,
            sky,
            free,
            window,
            reach_sigma: REACH_SIGMA,
            floor_px: self.habits.floor_px,
            pairs: PAIRS,
        }
    }

    /// Looks for one body with all others as `known` says.
    pub fn step_one(&mut self, b: usize, time: f64, sky: &Sky<'_>, known: &[BodySeen]) -> BodySeen {
        let mut free = vec![true; sky.len()];
        for (o, s) in known.iter().enumerate() {
            if o != b && s.fit.is_some() {
                for d in s.detections() {
                    free[d] = false;
                }
            }
        }
        let anchors = self.anchors(b, known);
        let mut seen = known.to_vec();
        seen[b] = self.find(b, time, sky, &free, &anchors, known).seen;
        look_beside(&self.mechanism, b, sky, &mut free, &mut seen);
        let got = seen.swap_remove(b);
        if let Some(f) = &got.fit {
            self.motions[b].add(time, f);
        }
        got
    }
}
