//! One frame's detections to named nodes, given the frames before it.
//!
//! Owns: [`Engine`], [`BodySeen`]. Must not: look ahead; it goes either way through time.
//!
//! Every body is first looked for where its motion carries it, then anywhere. What is found is accepted when it
//! is very unlikely to be chance and no other pose explains as much; else the body stays open. Never guessed.

use nalgebra::Vector2;

use super::beside::{Beside, look_beside};
use super::chance::{by_chance, likeness, twins};
use super::constellation::{Anchor, Search, Sighting};
use super::habits::Habits;
use super::mechanism::{Holder, Mechanism};
use super::nearest::Sky;
use super::predict::{Forecast, Motion, hung_at};
use super::rigid::{PoseFit, place};

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
/// Greatest expected number of chance sightings for a body found where its motion carries it.
const CHANCE_EXPECTED: f64 = 2e-3;
/// The same for a single marker that hangs on nothing: all there is to go by is that nothing else is near. Taken
/// for something else only where it is hidden as well.
const CHANCE_SINGLE: f64 = 0.1;
/// Around a place where something stands, a single marker is not told from it, px.
const STANDING_PX: f64 = 6.0;
/// The same for a body found elsewhere.
const CHANCE_ANYWHERE: f64 = 1e-5;
/// Pairs of nodes from which a free body is sought.
pub const PAIRS: usize = 60;
/// Undecided sightings followed at once.
const TENTATIVE: usize = 8;
/// How far a sighting must move for its motion to prove anything, px.
const PROOF_PX: f64 = 3.0;
/// Poses that put every node closer together than this give the same names, px: a half hidden marker shifts a
/// pose by less.
const SAME_POSE_PX: f64 = 5.0;
/// A sighting that could be chance, followed until it no longer can be.
#[derive(Debug, Clone)]
struct Tentative {
    motion: Motion,
    /// Expected number of such by chance, so far.
    chance: f64,
    /// Where its nodes were when that was last lowered: what stands still proves nothing.
    proved: Vec<Vector2<f64>>,
    missed: u32,
}

/// What a search says of a body.
struct Finding {
    seen: BodySeen,
    /// Sightings between which nothing decides, each with its expected number by chance.
    undecided: Vec<(Sighting, f64)>,
}

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
    tentative: Vec<Vec<Tentative>>,
    /// For each body the least turn that maps it on itself as far as two nodes, rad.
    likeness: Vec<f64>,
    /// For each body those that look the same.
    twins: Vec<Vec<usize>>,
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
        let mut f = self.motions[body].forecast(time, self.habits.floor[body], self.habits.first[body])?;
        if let Some(a) = anchors.first() {
            f.pose = hung_at(&f.pose, a.local, a.place);
            f.origin_px = 0.0;
        }
        Some(f)
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
                if round == 1 && anchors.is_empty() {
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
            look_beside(&self.mechanism.links[b], sky, &mut free, &mut seen[b]);
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

    /// Carries on the sightings of a body that nothing decided yet, and begins new ones; the one that stands, if
    /// now one does.
    fn follow(
        &mut self,
        b: usize,
        time: f64,
        sky: &Sky<'_>,
        free: &[bool],
        anchors: &[Anchor],
        undecided: Vec<(Sighting, f64)>,
    ) -> Option<Sighting> {
        let link = &self.mechanism.links[b];
        let mut now: Vec<Option<Sighting>> = Vec::new();
        let mut kept: Vec<Tentative> = Vec::new();
        for mut t in std::mem::take(&mut self.tentative[b]) {
            let Some(mut w) = t.motion.forecast(time, self.habits.floor[b], self.habits.first[b]) else {
                continue;
            };
            if let Some(a) = anchors.first() {
                w.pose = hung_at(&w.pose, a.local, a.place);
                w.origin_px = 0.0;
            }
            let search = self.search(b, sky, free, anchors, Some(w));
            let mut open = vec![false; link.nodes.len()];
            match self.judge(&search, f64::INFINITY, &mut open) {
                Ok((s, chance)) => {
                    let chance = chance.min(1.0);
                    let places = link.places(&s.fit.pose);
                    let moved = places.iter().zip(&t.proved).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
                    // The first step only gives the rate: it proves nothing. Nor does what stands still.
                    if moved > PROOF_PX && t.motion.depth() >= 2 {
                        t.chance *= chance;
                        t.proved = places;
                    }
                    t.motion.add(time, &s.fit);
                    t.missed = 0;
                    kept.push(t);
                    now.push(Some(s));
                }
                Err(_) => {
                    t.missed += 1;
                    if t.missed <= 3 {
                        kept.push(t);
                        now.push(None);
                    }
                }
            }
        }
        for (s, chance) in undecided {
            let same = now.iter().flatten().any(|o| o.picks == s.picks);
            if !same && kept.len() < TENTATIVE {
                let mut motion = Motion::default();
                motion.add(time, &s.fit);
                let proved = link.places(&s.fit.pose);
                kept.push(Tentative { motion, chance: chance.min(1e3), proved, missed: 0 });
                now.push(Some(s));
            }
        }
        // One that is beyond chance stands if all others are gone.
        let alive = now.iter().flatten().count();
        let result = (0..kept.len())
            .find(|&k| kept[k].chance < CHANCE_ANYWHERE && now[k].is_some())
            .filter(|_| alive == 1 && kept.len() == 1)
            .and_then(|k| now[k].clone().map(|s| (k, s)));
        if let Some((k, s)) = result {
            self.motions[b] = kept.swap_remove(k).motion;
            return Some(s);
        }
        self.tentative[b] = kept;
        None
    }

    fn search<'a>(
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
        let mut got = self.find(b, time, sky, &free, &anchors, known).seen;
        look_beside(&self.mechanism.links[b], sky, &mut free, &mut got);
        if let Some(f) = &got.fit {
            self.motions[b].add(time, f);
        }
        got
    }

    /// Looks for one body; `known` are the bodies found so far in this frame.
    fn find(
        &self,
        b: usize,
        time: f64,
        sky: &Sky<'_>,
        free: &[bool],
        anchors: &[Anchor],
        known: &[BodySeen],
    ) -> Finding {
        let n = self.mechanism.links[b].nodes.len();
        let nothing =
            |open: Vec<bool>| BodySeen { fit: None, picks: vec![None; n], open, beside: vec![None; n] };
        let mut open = vec![false; n];
        if sky.is_empty() {
            return Finding { seen: nothing(open), undecided: Vec::new() };
        }
        let stands = |s: Sighting| {
            let seen = if self.may_be_twin(b, time, sky, &s, known) {
                nothing(s.picks.iter().map(Option::is_some).collect())
            } else {
                accepted(s, n)
            };
            Finding { seen, undecided: Vec::new() }
        };
        let forecast = self.forecast(b, time, anchors);
        // A body of one node that hangs on nothing has no angle to be lost.
        let single = n == 1 && anchors.is_empty();
        let moving: Vec<bool>;
        let free = if single {
            // Nothing but its motion tells it from what stands still.
            let stands =
                |d: usize| self.habits.standing.iter().any(|p| (p - sky.place(d)).norm() < STANDING_PX);
            moving = (0..sky.len()).map(|d| free[d] && !stands(d)).collect();
            &moving
        } else {
            free
        };
        if let Some(s) = self.find_near(b, time, sky, free, anchors) {
            return stands(s);
        }
        if let Some(w) = forecast.filter(|w| single || w.angle_rad < std::f64::consts::PI) {
            // The usual case: every node near its expected place, and no other turn can look like it.
            let search = self.search(b, sky, free, anchors, Some(w));
            let about = anchors.first().map_or(Vector2::zeros(), |a| a.local);
            if 2.0 * w.angle_rad < self.likeness[b]
                && let Some(s) = search.grow(w.pose, about, w.angle_rad)
                && (s.support == n || s.support >= 3)
                && s.support >= 2
                && self.chance(&search, &s, 1) < CHANCE_ANYWHERE
            {
                return stands(s);
            }
            let limit = if single { CHANCE_SINGLE } else { CHANCE_EXPECTED };
            match self.judge(&search, limit, &mut open) {
                Ok((s, _)) => return stands(s),
                // What is open where it is expected is not looked for elsewhere.
                Err(undecided) if single || (n == 1 && !undecided.is_empty()) => {
                    return Finding { seen: nothing(open), undecided };
                }
                Err(_) => {}
            }
            if let Some(s) = self.find_last_node(b, time, sky, free, anchors) {
                return stands(s);
            }
        }
        let search = self.search(b, sky, free, anchors, None);
        match self.judge(&search, CHANCE_ANYWHERE, &mut open) {
            Ok((s, _)) => stands(s),
            Err(undecided) => Finding { seen: nothing(open), undecided },
        }
    }

    /// A body whose rates are not known yet: all of its nodes seen, each nearer to where it was in the frame before
    /// than half the way to the next node. Plain nearest neighbours; all that a symmetric body has to go by.
    fn find_near(
        &self,
        b: usize,
        time: f64,
        sky: &Sky<'_>,
        free: &[bool],
        anchors: &[Anchor],
    ) -> Option<Sighting> {
        let link = &self.mechanism.links[b];
        let n = link.nodes.len();
        let pose = self.motions[b].fresh(time).filter(|_| n > 1)?;
        let half = link.spacing_px() / 2.0;
        let (pose, about) = match anchors.first() {
            Some(a) => (hung_at(&pose, a.local, a.place), a.local),
            None => (pose, Vector2::zeros()),
        };
        let search = self.search(b, sky, free, anchors, None);
        let s = search.grow(pose, about, half / (REACH_SIGMA * link.reach_px(about).max(1.0)))?;
        let near = self.moved_px(b, &s) < half;
        (s.support == n && near && self.chance(&search, &s, 1) < CHANCE_EXPECTED).then_some(s)
    }

    /// How far a sighting is from a body's newest pose: the farthest of its nodes, px.
    fn moved_px(&self, b: usize, s: &Sighting) -> f64 {
        let Some(before) = self.motions[b].newest_pose() else { return f64::INFINITY };
        let far = |&t: &Vector2<f64>| (place(&s.fit.pose, t) - place(&before, t)).norm();
        self.mechanism.links[b].template.iter().map(far).fold(0.0, f64::max)
    }

    /// A body of which one node is left, held by a joint: where its motion so far says to within what a half hidden
    /// marker would be off.
    fn find_last_node(
        &self,
        b: usize,
        time: f64,
        sky: &Sky<'_>,
        free: &[bool],
        anchors: &[Anchor],
    ) -> Option<Sighting> {
        let a = anchors.first()?;
        let mut w = self.motions[b].settled_forecast(time)?;
        w.pose = hung_at(&w.pose, a.local, a.place);
        w.origin_px = 0.0;
        let mut open = vec![false; self.mechanism.links[b].nodes.len()];
        let search = self.search(b, sky, free, anchors, Some(w));
        self.judge(&search, CHANCE_EXPECTED, &mut open).ok().map(|(s, _)| s)
    }

    /// Whether a body that looks the same and was not found yet in this frame may be what was found.
    fn may_be_twin(&self, b: usize, time: f64, sky: &Sky<'_>, s: &Sighting, known: &[BodySeen]) -> bool {
        self.twins[b].iter().filter(|&&o| known[o].fit.is_none()).any(|&o| {
            let mut only = vec![false; sky.len()];
            s.picks.iter().flatten().for_each(|&d| only[d] = true);
            let anchors = self.anchors(o, known);
            let window = self.forecast(o, time, &anchors).filter(|w| w.angle_rad < std::f64::consts::PI);
            self.search(o, sky, &only, &anchors, window)
                .run()
                .sightings
                .iter()
                .any(|t| t.support >= s.support && self.hangs(o, t, known))
        })
    }

    /// Whether a body seen so could hang where it must: a neighbour that was not found itself, but whose other
    /// joint's place is known, still has its own length.
    fn hangs(&self, b: usize, s: &Sighting, known: &[BodySeen]) -> bool {
        self.mechanism.hinges.iter().filter(|h| h.body == b).all(|h| {
            let Holder::Body(o, there) = h.holder else { return true };
            if known[o].fit.is_some() {
                return true;
            }
            let here = place(&s.fit.pose, h.local);
            self.anchors(o, known).iter().all(|a| {
                let sigma_px = h.sigma_px.hypot(a.sigma_px).hypot(s.fit.sigma_at(h.local));
                let length = (there - a.local).norm();
                ((here - a.place).norm() - length).abs() < REACH_SIGMA * sigma_px.max(self.habits.floor_px)
            })
        })
    }

    /// The sighting that stands, if one does, with its expected number by chance; else those between which
    /// nothing decides, and marks on the nodes that something seen may be.
    #[allow(clippy::type_complexity, reason = "what stands, or all that may")]
    fn judge(
        &self,
        search: &Search<'_>,
        limit: f64,
        open: &mut [bool],
    ) -> Result<(Sighting, f64), Vec<(Sighting, f64)>> {
        let found = search.run();
        let mut sightings = found.sightings.into_iter();
        let Some(best) = sightings.next() else { return Err(Vec::new()) };
        let chance = self.chance(search, &best, found.trials);
        let least = if best.support > 2 { best.support - 1 } else { best.support };
        let rivals: Vec<Sighting> = sightings
            .take_while(|s| s.support >= least)
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
        let undecided: Vec<(Sighting, f64)> = rivals.into_iter().chain([best]).map(|s| (s, chance)).collect();
        for (s, _) in &undecided {
            for (o, p) in open.iter_mut().zip(&s.picks) {
                *o |= p.is_some();
            }
        }
        Err(undecided)
    }

    fn chance(&self, search: &Search<'_>, s: &Sighting, trials: usize) -> f64 {
        by_chance(search, s, trials, &self.habits, self.mechanism.image_px)
    }
}

fn accepted(s: Sighting, n: usize) -> BodySeen {
    BodySeen { fit: Some(s.fit), picks: s.picks, open: vec![false; n], beside: vec![None; n] }
}
