//! One frame's detections to named nodes, given the frames before it.
//!
//! Owns: [`Engine`] (either direction of time), [`Tracker`] (forwards, live). Must not: look ahead.
//!
//! Every body is first looked for where its motion carries it, then anywhere. What is found is accepted when it
//! is very unlikely to be chance and no other pose explains as much; else the body stays open. Never guessed.

use nalgebra::Vector2;

use super::constellation::{Anchor, Found, Search, Sighting};
use super::mechanism::{Holder, Mechanism};
use super::nearest::Sky;
use super::predict::{Forecast, Motion, Unrest, hung_at};
use super::rigid::{PoseFit, place};
use super::{Observation, Status};
use crate::detect::{Detection, Flags};
use crate::error::{Error, Fault, Result};
use crate::rig::Rig;
use crate::store::FrameStamp;

/// The visible part of a half hidden marker.
#[derive(Debug, Clone, Copy)]
pub struct Beside {
    /// The detection.
    pub detection: usize,
    /// Where the body says the marker's centre is, px.
    pub place: Vector2<f64>,
    /// How far the detection's centre is from it, px.
    pub off_px: f32,
}

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
const REACH_SIGMA: f64 = 5.1;
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
const PAIRS: usize = 60;
/// Undecided sightings followed at once.
const TENTATIVE: usize = 8;
/// How far a sighting must move for its motion to prove anything, px.
const PROOF_PX: f64 = 3.0;
/// How exactly the only node seen of a body must be expected, px.
const LONE_GATE_PX: f64 = 1.5;
/// Poses that put every node closer together than this give the same names, px: a half hidden marker shifts a
/// pose by less.
const SAME_POSE_PX: f64 = 5.0;
/// How far the centre of a marker that is at least half seen may be from the marker's, in radii: that of half a
/// disc is 0.42 from its centre.
const BESIDE_RADII: f64 = 0.5;
/// The same where the marker's size is not known, px.
const BESIDE_PX: f64 = 2.0;
/// How well a node's place must be known for a detection beside it to be its, px.
const FIRM_PX: f64 = 0.3;

/// What was learned of a recording's motion and clutter.
#[derive(Debug, Clone)]
pub struct Habits {
    /// For each body the least unrest to reckon with.
    pub floor: Vec<Unrest>,
    /// For each body how far it may go in a frame.
    pub first: Vec<Unrest>,
    /// Detections per frame that are no node and do not stand still.
    pub clutter: f64,
    /// Places where something stands that is no node, px.
    pub standing: Vec<Vector2<f64>>,
    /// Added to every detection's uncertainty in square, px.
    pub floor_px: f64,
}

impl Habits {
    /// What holds of any recording.
    pub fn unknown(mechanism: &Mechanism, floor_px: f64) -> Self {
        let each = |k: f64| -> Vec<Unrest> {
            mechanism
                .links
                .iter()
                .map(|l| {
                    let reach = l.reach_px(Vector2::zeros()).max(30.0);
                    Unrest { angle_rad: k / reach, origin_px: k }
                })
                .collect()
        };
        let mut first = each(25.0);
        for (f, l) in first.iter_mut().zip(&mechanism.links) {
            if l.nodes.len() > 1 {
                f.angle_rad = 4.0;
                f.origin_px = 150.0;
            } else {
                f.origin_px = 40.0;
            }
        }
        Self { floor: each(1.0), first, clutter: 0.5, standing: Vec::new(), floor_px }
    }
}

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
}

impl Engine {
    /// A tracker that knows no pose yet.
    pub fn new(mechanism: Mechanism, habits: Habits) -> Self {
        let motions = vec![Motion::default(); mechanism.links.len()];
        let likeness = (0..mechanism.links.len()).map(|b| likeness(&mechanism, &habits, b)).collect();
        let tentative = vec![Vec::new(); mechanism.links.len()];
        Self { mechanism, habits, motions, tentative, likeness }
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
                let got = self.find(b, time, sky, &free, &anchors);
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
            let waiting = std::mem::take(&mut undecided[b]);
            if let Some(s) = self.follow(b, time, sky, &free, &anchors, waiting) {
                for d in s.picks.iter().flatten() {
                    free[*d] = false;
                }
                seen[b] = accepted(s, self.mechanism.links[b].nodes.len());
                settled[b] = true;
            }
        }
        for &b in self.mechanism.order.iter().filter(|&&b| !given[b]) {
            self.look_beside(b, sky, &mut free, &mut seen[b]);
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

    /// Finds half hidden markers: where a body's pose is firm, the detection beside the place of a node not seen.
    fn look_beside(&self, b: usize, sky: &Sky<'_>, free: &mut [bool], seen: &mut BodySeen) {
        let Some(fit) = &seen.fit else { return };
        let link = &self.mechanism.links[b];
        for j in 0..link.nodes.len() {
            let local = link.template[j];
            if seen.picks[j].is_some() || fit.sigma_at(local) > FIRM_PX {
                continue;
            }
            let there = place(&fit.pose, local);
            let (usual, scatter) = link.area_px[j];
            let radius = (usual / std::f64::consts::PI).sqrt();
            let limit = if usual > 0.0 { BESIDE_RADII * radius } else { BESIDE_PX };
            let Some((d, r)) = sky.nearest(there, limit) else { continue };
            // The more is hidden, the farther off is the rest: what is whole is not beside.
            let part = &sky.get(d);
            let hidden = (1.0 - (f64::from(part.area_px) - 3.0 * scatter) / usual).max(0.0);
            let most = radius * (1.1 * hidden + 0.1) + 4.0 * f64::from(part.sigma_px);
            let off = usual == 0.0 || r <= most;
            let nearer = link
                .template
                .iter()
                .enumerate()
                .any(|(k, &t)| k != j && (place(&fit.pose, t) - sky.place(d)).norm() < r);
            if free[d] && off && !nearer {
                free[d] = false;
                seen.beside[j] = Some(Beside { detection: d, place: there, off_px: r as f32 });
            }
        }
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
            let found = search.run();
            let mut open = vec![false; link.nodes.len()];
            let trials = found.trials;
            let single = self.judge(b, found, sky, free, anchors, Some(&w), f64::INFINITY, &mut open);
            match single {
                Ok(s) => {
                    let chance = self.chance(b, &s, trials, sky, free, anchors, Some(&w)).min(1.0);
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
        let mut got = self.find(b, time, sky, &free, &anchors).seen;
        self.look_beside(b, sky, &mut free, &mut got);
        if let Some(f) = &got.fit {
            self.motions[b].add(time, f);
        }
        got
    }

    fn find(&self, b: usize, time: f64, sky: &Sky<'_>, free: &[bool], anchors: &[Anchor]) -> Finding {
        let n = self.mechanism.links[b].nodes.len();
        let nothing =
            |open: Vec<bool>| BodySeen { fit: None, picks: vec![None; n], open, beside: vec![None; n] };
        let mut open = vec![false; n];
        if sky.is_empty() {
            return Finding { seen: nothing(open), undecided: Vec::new() };
        }
        let stands = |s: Sighting| Finding { seen: accepted(s, n), undecided: Vec::new() };
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
        if let Some(w) = forecast.filter(|w| single || w.angle_rad < std::f64::consts::PI) {
            // The usual case: every node near its expected place, and no other turn can look like it.
            let search = self.search(b, sky, free, anchors, Some(w));
            let about = anchors.first().map_or(Vector2::zeros(), |a| a.local);
            if 2.0 * w.angle_rad < self.likeness[b]
                && let Some(s) = search.grow(w.pose, about, w.angle_rad)
                && (s.support == n || s.support >= 3)
                && s.support >= 2
                && self.chance(b, &s, 1, sky, free, anchors, Some(&w)) < CHANCE_ANYWHERE
            {
                return stands(s);
            }
            let limit = if single { CHANCE_SINGLE } else { CHANCE_EXPECTED };
            match self.judge(b, search.run(), sky, free, anchors, Some(&w), limit, &mut open) {
                Ok(s) => return stands(s),
                // What is open where it is expected is not looked for elsewhere.
                Err(undecided) if single || (n == 1 && !undecided.is_empty()) => {
                    return Finding { seen: nothing(open), undecided };
                }
                Err(_) => {}
            }
        }
        let search = self.search(b, sky, free, anchors, None);
        match self.judge(b, search.run(), sky, free, anchors, None, CHANCE_ANYWHERE, &mut open) {
            Ok(s) => stands(s),
            Err(undecided) => Finding { seen: nothing(open), undecided },
        }
    }

    /// The sighting that stands, if one does; else those between which nothing decides, and marks on the nodes
    /// that something seen may be.
    #[allow(clippy::too_many_arguments)]
    fn judge(
        &self,
        b: usize,
        found: Found,
        sky: &Sky<'_>,
        free: &[bool],
        anchors: &[Anchor],
        window: Option<&Forecast>,
        limit: f64,
        open: &mut [bool],
    ) -> std::result::Result<Sighting, Vec<(Sighting, f64)>> {
        let link = &self.mechanism.links[b];
        let mut sightings = found.sightings.into_iter();
        let Some(best) = sightings.next() else { return Err(Vec::new()) };
        let chance = self.chance(b, &best, found.trials, sky, free, anchors, window);
        let least = if best.support > 2 { best.support - 1 } else { best.support };
        let rivals: Vec<Sighting> = sightings
            .take_while(|s| s.support >= least)
            .filter(|s| {
                link.template
                    .iter()
                    .any(|&t| (place(&s.fit.pose, t) - place(&best.fit.pose, t)).norm() > SAME_POSE_PX)
            })
            .collect();
        if chance < limit && rivals.is_empty() {
            return Ok(best);
        }
        let undecided: Vec<(Sighting, f64)> = rivals.into_iter().chain([best]).map(|s| (s, chance)).collect();
        for (s, _) in &undecided {
            for (o, p) in open.iter_mut().zip(&s.picks) {
                *o |= p.is_some();
            }
        }
        Err(undecided)
    }

    /// Expected number of sightings as good as this that chance alone would give.
    #[allow(clippy::too_many_arguments)]
    fn chance(
        &self,
        b: usize,
        s: &Sighting,
        trials: usize,
        sky: &Sky<'_>,
        free: &[bool],
        anchors: &[Anchor],
        window: Option<&Forecast>,
    ) -> f64 {
        let link = &self.mechanism.links[b];
        let n = link.nodes.len();
        let others = free.iter().filter(|&&f| f).count().saturating_sub(s.support) as f64;
        let from = anchors.first().map_or(Vector2::zeros(), |a| a.local);
        let reach = link.reach_px(from).max(30.0);
        let density = others.max(self.habits.clutter) / (std::f64::consts::PI * reach * reach);
        let sigma = s
            .picks
            .iter()
            .enumerate()
            .filter_map(|(j, d)| d.map(|d| f64::from(sky.get(d).sigma_px).hypot(link.slack_px[j])))
            .fold(0.0, f64::max)
            .hypot(self.habits.floor_px);
        let radius = REACH_SIGMA * sigma;
        let hit = (density * std::f64::consts::PI * radius * radius).min(1.0);
        let base = if anchors.len() >= 2 {
            0
        } else if anchors.len() == 1 {
            1
        } else {
            2
        };
        let turn = window.map_or(std::f64::consts::PI, |w| w.angle_rad.min(std::f64::consts::PI));
        let gate = window.map_or(f64::INFINITY, |w| w.origin_px + w.angle_rad * reach + radius);
        if s.support > base {
            let k = s.support - base;
            return trials as f64 * choose(n.saturating_sub(base).max(k), k) * hit.powi(k as i32);
        }
        if n == 1 && base == 2 {
            let density = others.max(self.habits.clutter) / self.mechanism.image_px;
            let gate = window.map_or(f64::INFINITY, |w| w.origin_px + radius);
            return density * std::f64::consts::PI * gate * gate;
        }
        match base {
            // One node on its circle about the anchor; half hidden it would not show, so it must be expected
            // within what it may be off.
            1 if n > 1 && turn * reach > LONE_GATE_PX => f64::INFINITY,
            1 => n as f64 * density * 4.0 * radius * reach * turn,
            // One or two nodes of a body that hangs on nothing.
            _ if s.support == 1 => f64::INFINITY,
            _ => {
                let pairs = (n * (n - 1) / 2) as f64;
                pairs * (density * std::f64::consts::PI * gate * gate) * density * 4.0 * radius * gate
            }
        }
    }
}

fn accepted(s: Sighting, n: usize) -> BodySeen {
    BodySeen { fit: Some(s.fit), picks: s.picks, open: vec![false; n], beside: vec![None; n] }
}

fn choose(n: usize, k: usize) -> f64 {
    (0..k).map(|i| (n - i) as f64 / (i + 1) as f64).product()
}

/// The least turn of a body, about its first joint if it has one, that lays two of its nodes (three where it
/// hangs on nothing) on places of nodes again; infinite if there is none.
fn likeness(mechanism: &Mechanism, habits: &Habits, body: usize) -> f64 {
    let link = &mechanism.links[body];
    let stars: Vec<Detection> = link
        .template
        .iter()
        .map(|t| Detection { x_px: t.x, y_px: t.y, sigma_px: 0.05, flags: Flags(0), ..Default::default() })
        .collect();
    let anchors: Vec<Anchor> = mechanism
        .hinges
        .iter()
        .filter(|h| h.body == body)
        .take(1)
        .map(|h| Anchor { local: h.local, place: h.local, sigma_px: h.sigma_px })
        .collect();
    let least = if anchors.is_empty() { 3 } else { 2 };
    let sky = Sky::new(&stars);
    let free = vec![true; stars.len()];
    let search = Search {
        link,
        anchors: &anchors,
        sky: &sky,
        free: &free,
        window: None,
        reach_sigma: REACH_SIGMA,
        floor_px: habits.floor_px,
        pairs: PAIRS,
    };
    search
        .run()
        .sightings
        .iter()
        .filter(|s| s.support >= least)
        .filter(|s| s.picks.iter().enumerate().any(|(j, p)| p.is_some_and(|p| p != j)))
        .map(|s| s.fit.pose.rotation.angle().abs())
        .fold(f64::INFINITY, f64::min)
}

/// The observations of one frame, in the order of the rig's nodes.
pub fn observations(mechanism: &Mechanism, seen: &[BodySeen], sky: &[Detection]) -> Vec<Observation> {
    let mut out = vec![Observation::MISSING; mechanism.nodes];
    for (link, s) in mechanism.links.iter().zip(seen) {
        for (j, &node) in link.nodes.iter().enumerate() {
            if let Some(Some(d)) = s.picks.get(j) {
                let d = &sky[*d];
                // A marker half hidden may agree by chance; its own uncertainty is that of a whole one.
                let doubt = d.flags.has(Flags::PARTIAL | Flags::MERGED | Flags::BORDER)
                    || d.area_px < link.whole_px[j];
                let sigma_px = d.sigma_px.hypot(link.excess_px as f32);
                out[node] = Observation {
                    x_px: d.x_px,
                    y_px: d.y_px,
                    sigma_px: if doubt { sigma_px.hypot(0.2) } else { sigma_px },
                    area_px: d.area_px,
                    status: Status::Seen,
                };
            } else if let Some(Some(b)) = s.beside.get(j) {
                let d = &sky[b.detection];
                // The blob only shows that the marker is there: its centre is where the body says. What is given
                // as uncertainty is the blob's whole disagreement, so that no fit gains from it.
                out[node] = Observation {
                    x_px: b.place.x,
                    y_px: b.place.y,
                    sigma_px: d.sigma_px.hypot(b.off_px),
                    area_px: d.area_px,
                    status: Status::Seen,
                };
            } else if s.open.get(j) == Some(&true) {
                out[node].status = Status::Ambiguous;
            }
        }
    }
    out
}

/// For each node of the rig whether only a part of it is seen.
pub fn partly(mechanism: &Mechanism, seen: &[BodySeen]) -> Vec<bool> {
    let mut out = vec![false; mechanism.nodes];
    for (link, s) in mechanism.links.iter().zip(seen) {
        for (&node, b) in link.nodes.iter().zip(&s.beside) {
            out[node] = b.is_some();
        }
    }
    out
}

/// Marks the first frame in which a node is seen again.
#[derive(Debug, Clone)]
pub struct Returns {
    /// For each node whether it was seen before, and whether in the last frame.
    past: Vec<(bool, bool)>,
}

impl Returns {
    /// No frame yet.
    pub fn new(nodes: usize) -> Self {
        Self { past: vec![(false, false); nodes] }
    }

    /// Whether a node was seen in the last frame.
    pub fn in_last(&self, node: usize) -> bool {
        self.past[node].1
    }

    /// Marks one frame's nodes; frames must come in order.
    pub fn mark(&mut self, row: &mut [Observation]) {
        for (o, (ever, last)) in row.iter_mut().zip(&mut self.past) {
            let now = o.status == Status::Seen;
            if now && *ever && !*last {
                o.status = Status::Reacquired;
            }
            *ever |= now;
            *last = now;
        }
    }
}

/// Follows the nodes of a given rig through a live recording, frame by frame. Nothing is filled in later.
#[derive(Debug, Clone)]
pub struct Tracker {
    engine: Engine,
    returns: Returns,
    last: Option<FrameStamp>,
}

impl Tracker {
    /// A tracker for a checked rig.
    ///
    /// # Errors
    /// [`Error::Rig`] where the rig is not valid.
    pub fn new(rig: &Rig) -> Result<Self> {
        rig.check("rig")?;
        let mechanism = Mechanism::new(rig, 0.3);
        let habits = Habits::unknown(&mechanism, 0.05);
        let returns = Returns::new(mechanism.nodes);
        Ok(Self { engine: Engine::new(mechanism, habits), returns, last: None })
    }

    /// The nodes in the next frame, in the rig's order.
    ///
    /// # Errors
    /// [`Error::Argument`] if the frame does not come after the one before it.
    pub fn step(&mut self, stamp: &FrameStamp, detections: &[Detection]) -> Result<Vec<Observation>> {
        if let Some(last) = self.last
            && stamp.index <= last.index
        {
            return Err(Error::Argument(
                Fault::new(
                    "Tracker::step",
                    format!("frame {} comes after frame {}", stamp.index, last.index),
                )
                .advice("Give frames in the order of recording"),
            ));
        }
        self.last = Some(*stamp);
        let sky = Sky::new(detections);
        let seen = self.engine.step(stamp.index as f64, &sky, None);
        let mut row = observations(&self.engine.mechanism, &seen, detections);
        for (k, partly) in partly(&self.engine.mechanism, &seen).into_iter().enumerate() {
            // Live, a part is believed only if the marker was seen in the frame before.
            if partly && !self.returns.in_last(k) {
                row[k] = Observation::MISSING;
            }
        }
        self.returns.mark(&mut row);
        Ok(row)
    }
}
