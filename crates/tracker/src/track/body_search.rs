//! Finds one body: near its predicted pose first, then in the whole frame; accepts or rejects the best hypothesis.
//!
//! Owns: [`SearchOutcome`]. Must not: carry anything from frame to frame.

use std::f64::consts::PI;

use nalgebra::{Isometry2, Vector2};

use super::bodies::Bodies;
use super::false_matches::{CHANCE_ANYWHERE, expected_false_matches};
use super::seen::{BodySeen, accepted};
use crate::rigid::body::Holder;
use crate::rigid::forecast::{Forecast, hung_at};
use crate::rigid::hypothesis::{Anchor, PoseHypothesis};
use crate::rigid::index::DetectionIndex;
use crate::rigid::pose::place;
use crate::rigid::search::{REACH_SIGMA, Search};

/// Greatest expected number of false matches for a body found at its predicted pose: in a recording of 1e3 frames with the body
/// hidden in each, two false ones are expected. The made films of docs/validation/identity.md have none.
const CHANCE_EXPECTED: f64 = 2e-3;
/// Greatest expected number of false matches where every node was seen in the frame before and is seen again near by: a
/// frame in which the body went and something else came is rare by itself.
const CHANCE_NEAR: f64 = 1e-2;
/// Greatest expected number of false matches for a single marker that hangs on nothing: only its motion tells it. The
/// bound is the fraction of its hidden frames in which another mover may be taken for it, and only while its gate is wide:
/// 40 px about a first place with one other mover in 0.3 Mpx are 0.02, a gap of four frames comes to 0.1, and once its
/// rates are known 3 px are 1e-4. Tested on balls in a shaking picture, on an occluded pendulum and on a ball toss.
const CHANCE_SINGLE: f64 = 0.1;
/// Around a place where something stands, a single marker is not told from it, px.
const STANDING_PX: f64 = 6.0;
/// Poses that put every node closer together than this give the same names, px: a half hidden marker shifts a
/// pose by less.
const SAME_POSE_PX: f64 = 5.0;

/// Two markers that come nearer than this to where they are expected are not expected any better, px: what a step of a body that
/// starts to move is off by.
const LEAST_MISS_PX: f64 = 1.0;
/// Number of trials that a pair has to be near: the doublings of a distance from `LEAST_MISS_PX` up to the widest gate, 128 px.
const NEARER: f64 = 7.0;

/// Ratio of distances: a body is accepted over an indistinguishable one if it is 3 times closer to its own prediction.
const TWIN_RATIO: f64 = 3.0;

/// Outcome of the search for one body.
pub(super) struct SearchOutcome {
    pub(super) seen: BodySeen,
    /// Hypotheses between which nothing decides, each with the expected number of false matches of the best.
    pub(super) undecided: Vec<(PoseHypothesis, f64)>,
    /// More stood out than is tried.
    pub(super) is_bounded: bool,
}

/// The detections of a frame that may be a body's, as far as nothing decides.
pub(super) struct Open {
    /// For each node whether something that is seen may be it.
    pub(super) nodes: Vec<bool>,
    /// More stood out than was tried.
    pub(super) is_bounded: bool,
}

impl Open {
    pub(super) fn new(nodes: usize) -> Self {
        Self { nodes: vec![false; nodes], is_bounded: false }
    }
}

impl Bodies {
    /// Looks for one body; `known` are the bodies found so far in this frame.
    pub(super) fn find(
        &self,
        b: usize,
        time: f64,
        index: &DetectionIndex<'_>,
        free: &[bool],
        anchors: &[Anchor],
        known: &[BodySeen],
    ) -> SearchOutcome {
        let n = self.mechanism.links[b].nodes.len();
        let nothing =
            |open: Vec<bool>| BodySeen { fit: None, picks: vec![None; n], open, occluded: vec![None; n] };
        let mut open = Open::new(n);
        if index.is_empty() {
            return SearchOutcome { seen: nothing(open.nodes), undecided: Vec::new(), is_bounded: false };
        }
        let accept = |s: PoseHypothesis, is_bounded: bool| {
            let seen = if self.may_be_twin(b, time, index, &s, known) {
                nothing(s.picks.iter().map(Option::is_some).collect())
            } else {
                accepted(s, n)
            };
            SearchOutcome { seen, undecided: Vec::new(), is_bounded }
        };
        let forecast = self.forecast(b, time, anchors);
        // A body of one node that hangs on nothing has no angle to be lost.
        let single = n == 1 && anchors.is_empty();
        let moving: Vec<bool>;
        let free = if single {
            // Nothing but its motion tells it from what stands still.
            let is_standing =
                |d: usize| self.priors.standing.iter().any(|p| (p - index.place(d)).norm() < STANDING_PX);
            moving = (0..index.len()).map(|d| free[d] && !is_standing(d)).collect();
            &moving
        } else {
            free
        };
        if let Some(s) = self.find_near(b, time, index, free, anchors) {
            return accept(s, false);
        }
        if let Some(w) = forecast.filter(|w| single || w.angle_rad < PI) {
            // The usual case: every node near its expected place, and no other turn can look like it.
            let search = self.search(b, index, free, anchors, Some(w));
            let about = anchors.first().map_or(Vector2::zeros(), |a| a.local);
            let is_narrow = 2.0 * w.angle_rad < self.self_symmetry_rad[b];
            if is_narrow
                && let Some(s) = search.refine(w.pose, about, w.angle_rad)
                && (s.inliers == n || s.inliers >= 3)
                && s.inliers >= 2
                && self.chance(&search, &s, 1) < CHANCE_ANYWHERE
            {
                return accept(s, false);
            }
            let limit = match n {
                1 if single => CHANCE_SINGLE,
                1 if self.motions[b].was_just_seen(time) => CHANCE_NEAR,
                _ => CHANCE_EXPECTED,
            };
            match self.resolve(&search, limit, &mut open) {
                Ok((s, _)) => return accept(s, open.is_bounded),
                // What is open where it is expected is not looked for elsewhere.
                Err(undecided) if single || (n == 1 && !undecided.is_empty()) => {
                    let is_bounded = open.is_bounded;
                    return SearchOutcome { seen: nothing(open.nodes), undecided, is_bounded };
                }
                Err(_) => {}
            }
            if let Some(s) = self.find_last_node(b, time, index, free, anchors) {
                return accept(s, open.is_bounded);
            }
        }
        let search = self.search(b, index, free, anchors, None);
        match self.resolve(&search, CHANCE_ANYWHERE, &mut open) {
            Ok((s, _)) => accept(s, open.is_bounded),
            Err(undecided) => {
                let is_bounded = open.is_bounded;
                SearchOutcome { seen: nothing(open.nodes), undecided, is_bounded }
            }
        }
    }

    /// A body whose rates are not known yet: all of its nodes seen, each nearer to where it was in the frame before
    /// than half the way to the next node. Plain nearest neighbours; all that a symmetric body has to go by.
    fn find_near(
        &self,
        b: usize,
        time: f64,
        index: &DetectionIndex<'_>,
        free: &[bool],
        anchors: &[Anchor],
    ) -> Option<PoseHypothesis> {
        let link = &self.mechanism.links[b];
        let n = link.nodes.len();
        let pose = self.motions[b].fresh(time).filter(|_| n > 1)?;
        let half = link.spacing_px() / 2.0;
        let (pose, about) = match anchors.first() {
            Some(a) => (hung_at(&pose, a.local, a.place), a.local),
            None => (pose, Vector2::zeros()),
        };
        let reach = link.reach_px(about).max(1.0);
        let window = Forecast { pose, angle_rad: half / reach, origin_px: half };
        let search = self.search(b, index, free, anchors, Some(window));
        let s = search.refine(pose, about, half / (REACH_SIGMA * reach))?;
        let near = self.moved_px(b, &s) < half;
        (s.inliers == n && near && self.chance(&search, &s, 1) < CHANCE_NEAR).then_some(s)
    }

    /// The distance of a hypothesis from a body's newest pose: that of the farthest of its nodes, px.
    fn moved_px(&self, b: usize, s: &PoseHypothesis) -> f64 {
        self.motions[b].newest_pose().map_or(f64::INFINITY, |before| self.apart_px(b, &s.fit.pose, &before))
    }

    /// The distance of two poses of a body: that of the farthest of its nodes, px.
    fn apart_px(&self, b: usize, one: &Isometry2<f64>, other: &Isometry2<f64>) -> f64 {
        let far = |&t: &Vector2<f64>| (place(one, t) - place(other, t)).norm();
        self.mechanism.links[b].template.iter().map(far).fold(0.0, f64::max)
    }

    /// A body of which one node is left, held by a joint, where its motion so far predicts it within 1.5 px, which a half hidden
    /// marker may be off, or within 3 px where its area shows that it is whole.
    fn find_last_node(
        &self,
        b: usize,
        time: f64,
        index: &DetectionIndex<'_>,
        free: &[bool],
        anchors: &[Anchor],
    ) -> Option<PoseHypothesis> {
        let a = anchors.first()?;
        let w = self.motions[b].settled_forecast(time)?.hung(a.local, a.place);
        let mut open = Open::new(self.mechanism.links[b].nodes.len());
        let search = self.search(b, index, free, anchors, Some(w));
        self.resolve(&search, CHANCE_EXPECTED, &mut open).ok().map(|(s, _)| s)
    }

    /// Whether a body that looks the same and was not found yet in this frame may be what was found.
    pub(super) fn may_be_twin(
        &self,
        b: usize,
        time: f64,
        index: &DetectionIndex<'_>,
        s: &PoseHypothesis,
        known: &[BodySeen],
    ) -> bool {
        self.indistinguishable[b]
            .iter()
            .filter(|&&o| known[o].fit.is_none() && !self.would_be_chance(b, o, time, s))
            .any(|&o| {
                let mut only = vec![false; index.len()];
                s.picks.iter().flatten().for_each(|&d| only[d] = true);
                let anchors = self.anchors(o, known);
                let window = self.forecast(o, time, &anchors).filter(|w| w.angle_rad < PI);
                let found = self.search(o, index, &only, &anchors, window).run();
                // What could not be tried through may be it.
                found.is_bounded
                    || found.hypotheses.iter().any(|t| t.inliers >= s.inliers && self.hangs(o, t, known))
            })
    }

    /// Whether the twin is too unlikely to be what is seen: body `b`, seen in the frame before, is found where it is expected, both
    /// hang on nothing, and the twin may be in many more places.
    fn would_be_chance(&self, b: usize, twin: usize, time: f64, s: &PoseHypothesis) -> bool {
        let hangs = |b: usize| self.mechanism.hinges.iter().any(|h| h.body == b);
        if hangs(b) || hangs(twin) || !self.motions[b].was_just_seen(time) {
            return false;
        }
        let Some(w) = self.forecast(b, time, &[]) else { return false };
        if self.motions[twin].was_just_seen(time)
            && let Some(o) = self.forecast(twin, time, &[])
        {
            // Both were just seen: nearest neighbours, by a clear margin.
            let own_px = self.apart_px(b, &s.fit.pose, &w.pose);
            let other_px = (s.fit.pose.translation.vector - o.pose.translation.vector).norm();
            return TWIN_RATIO * own_px < other_px;
        }
        let off_px = (s.fit.pose.translation.vector - w.pose.translation.vector).norm();
        let off_rad = s.fit.pose.rotation.angle_to(&w.pose.rotation).abs();
        // A single marker has no angle.
        let turns = self.mechanism.links[b].nodes.len() > 1;
        let room = |w: &Forecast| {
            let area_px = (PI * w.origin_px.powi(2)).min(self.mechanism.image_px);
            area_px * if turns { w.angle_rad.min(PI) / PI } else { 1.0 }
        };
        let elsewhere = self.forecast(twin, time, &[]).map_or(self.mechanism.image_px, |w| room(&w));
        off_px <= w.origin_px && (!turns || off_rad <= w.angle_rad) && room(&w) < CHANCE_EXPECTED * elsewhere
    }

    /// Whether a body seen so could hang where it must: a neighbour that was not found itself, but whose other
    /// joint's place is known, still has its own length.
    fn hangs(&self, b: usize, s: &PoseHypothesis, known: &[BodySeen]) -> bool {
        self.mechanism.hinges.iter().filter(|h| h.body == b).all(|h| {
            let Holder::Body(o, there) = h.holder else { return true };
            if known[o].fit.is_some() {
                return true;
            }
            let here = place(&s.fit.pose, h.local);
            self.anchors(o, known).iter().all(|a| {
                let sigma_px = h.sigma_px.hypot(a.sigma_px).hypot(s.fit.sigma_at(h.local));
                let length = (there - a.local).norm();
                ((here - a.place).norm() - length).abs() < REACH_SIGMA * sigma_px.max(self.priors.floor_px)
            })
        })
    }

    /// The hypothesis that stands, if one does, with its expected number of false matches; else those between which
    /// nothing decides, and marks on the nodes that something seen may be.
    #[allow(clippy::type_complexity, reason = "what stands, or all that may")]
    pub(super) fn resolve(
        &self,
        search: &Search<'_>,
        limit: f64,
        open: &mut Open,
    ) -> Result<(PoseHypothesis, f64), Vec<(PoseHypothesis, f64)>> {
        let found = search.run();
        open.is_bounded |= found.is_bounded;
        let mut hypotheses = found.hypotheses.into_iter();
        let Some(best) = hypotheses.next() else { return Err(Vec::new()) };
        let chance = self.chance(search, &best, found.trials);
        let least = if best.inliers > 2 { best.inliers - 1 } else { best.inliers };
        let rivals: Vec<PoseHypothesis> = hypotheses
            .take_while(|s| s.inliers >= least)
            .filter(|s| !of_three(s, &best))
            .filter(|s| {
                search
                    .link
                    .template
                    .iter()
                    .any(|&t| (place(&s.fit.pose, t) - place(&best.fit.pose, t)).norm() > SAME_POSE_PX)
            })
            .collect();
        if chance < limit && rivals.is_empty() {
            return Ok((best, chance));
        }
        let undecided: Vec<(PoseHypothesis, f64)> =
            rivals.into_iter().chain([best]).map(|s| (s, chance)).collect();
        for (s, _) in &undecided {
            for (o, p) in open.nodes.iter_mut().zip(&s.picks) {
                *o |= p.is_some();
            }
        }
        Err(undecided)
    }

    fn chance(&self, search: &Search<'_>, s: &PoseHypothesis, trials: usize) -> f64 {
        let within = |search: &Search<'_>| {
            expected_false_matches(search, s, trials, &self.priors, self.mechanism.image_px)
        };
        let anywhere = within(search);
        let pair = search.link.nodes.len() == 2 && s.inliers == 2 && search.anchors.is_empty();
        let Some(w) = search.window.filter(|_| pair) else { return anywhere };
        // Two nodes that hang on nothing have nothing but where they are expected: how near to it counts, not how far it might be.
        let link = search.link;
        let far = |&t: &Vector2<f64>| (place(&s.fit.pose, t) - place(&w.pose, t)).norm();
        let off_px = link.template.iter().map(far).fold(LEAST_MISS_PX, f64::max);
        let near = Forecast { angle_rad: off_px / link.reach_px(Vector2::zeros()), origin_px: off_px, ..w };
        anywhere.min(NEARER * within(&Search { window: Some(near), ..*search }))
    }
}

/// Whether `s` is two of the three markers that are the whole of `best`: any two are a pair either way round, and what
/// is expected by chance of `best` is that the third is where it is.
fn of_three(s: &PoseHypothesis, best: &PoseHypothesis) -> bool {
    best.picks.len() == 3
        && best.inliers == 3
        && s.inliers == 2
        && s.picks.iter().flatten().all(|&d| best.picks.contains(&Some(d)))
}
