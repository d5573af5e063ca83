//! Searches a frame's detections for a body: tests the poses under which its nodes would be seen, up to a bound.
//!
//! Owns: [`Search`]. Must not: choose between hypotheses (`track` does).
//!
//! A pose follows from two joints, from a joint and one node, or from two nodes. Each pose that follows from
//! the detections, up to `MOST_TRIALS`, is tested on all nodes of the body and refitted on those that agree.

use std::f64::consts::PI;

use nalgebra::{Isometry2, Vector2};

use super::body::{LEAST_PART, Link};
use super::forecast::{Forecast, hung_at};
use super::hypothesis::{Anchor, Found, PoseHypothesis};
use super::index::DetectionIndex;
use super::pose::{Pair, PoseFit, fit_pose, place, pose_at};
use super::work::Work;

/// Gate of a detection about its node, in standard uncertainties: of nine nodes in 1e5 frames two are beyond it by chance
/// (Rayleigh: exp(-k^2 / 2) = 2.2e-6 at 5.1).
pub const REACH_SIGMA: f64 = 5.1;
/// Pairs of nodes from which a free body is sought: all pairs of eleven nodes are 55.
pub const PAIRS: usize = 60;
/// Detections that pairs of nodes are sought among, at most: those whose centres are known best. Bodies have tens of nodes, and
/// every scene that was followed without a bound has fewer (docs/validation/identity.md); noise has thousands, and its pairs millions.
pub const MOST_SEEDS: usize = 400;
/// Poses that one search tests, at most: 0.1 s of work.
pub const MOST_TRIALS: usize = 50_000;
/// Detections or pairs of them that are glanced at in the time in which one place is looked up.
const GLANCES: usize = 8;
/// Rounds of picking detections and fitting the pose, at most.
const REFINE_ROUNDS: usize = 6;
/// Distance of two anchors that fix the pose alone, in their standard uncertainties: the angle is then known to 1/20 rad.
const LEAST_BASE_SIGMA: f64 = 20.0;
/// Least distance of two nodes from which a pose is computed, in gates: a shorter base turns the pose by more than 1/4 rad.
const LEAST_SPAN_REACHES: f64 = 4.0;
/// Half width of the angles, rad, below which an arc about the expected place is searched and not the whole circle.
const NARROW_WINDOW_RAD: f64 = 1.5;

/// A search for one body in one frame.
#[derive(Clone, Copy)]
pub struct Search<'a> {
    /// The body.
    pub link: &'a Link,
    /// Points known from elsewhere.
    pub anchors: &'a [Anchor],
    /// The detections.
    pub index: &'a DetectionIndex<'a>,
    /// Detections that no other body has.
    pub free: &'a [bool],
    /// Where the body must be; `None` is anywhere.
    pub window: Option<Forecast>,
    /// Deviations, in standard uncertainties, up to which a detection agrees.
    pub reach_sigma: f64,
    /// Added to every detection's uncertainty in square, px.
    pub floor_px: f64,
    /// Pairs of nodes from which a free pose is sought, the longest first: they turn least with noise.
    pub pairs: usize,
    /// Budget of work for the search.
    pub work: &'a Work,
}

/// An angle brought into -pi to pi, rad.
fn turned(a: f64) -> f64 {
    let t = a.rem_euclid(std::f64::consts::TAU);
    if t > PI { t - std::f64::consts::TAU } else { t }
}

impl Search<'_> {
    /// Standard uncertainty of detection `d` as node `j`, px.
    pub fn sigma(&self, j: usize, d: usize) -> f64 {
        let own = f64::from(self.index.get(d).sigma_px).max(1e-3);
        // A detection that may be a part of a marker has no wider gate, unless the node's area proves it whole.
        let doubted = !self.index.whole(d) && self.whole(j, d);
        let cut = if doubted { self.link.cut_px(j, self.index.get(d).area_px) } else { 0.0 };
        (own * own + cut * cut + self.link.slack_px[j].powi(2) + self.floor_px.powi(2)).sqrt()
    }

    /// Whether detection `d` is the whole of node `j`, as far as its picture tells. Where the node's size is known,
    /// a blob that the detector calls a part is the whole if nothing of its area lacks.
    pub fn whole(&self, j: usize, d: usize) -> bool {
        let whole_px = self.link.whole_px[j];
        let area_px = self.index.get(d).area_px;
        let one = if whole_px > 0.0 { self.index.single(d) } else { self.index.whole(d) };
        one && area_px >= whole_px
    }

    /// Whether so little is left of node `j` that its centre says nothing.
    fn remnant(&self, j: usize, d: usize) -> bool {
        f64::from(self.index.get(d).area_px) < LEAST_PART * self.link.area_px[j].0
    }

    /// Standard uncertainty of a detection of node `j` before it is known which, px: that of the least exact one.
    fn usual_sigma(&self, j: usize) -> f64 {
        let own = self.index.widest_px();
        (own * own + self.link.slack_px[j].powi(2) + self.floor_px.powi(2)).sqrt()
    }

    /// Whether a pose is one that the window allows.
    fn allowed(&self, pose: &Isometry2<f64>) -> bool {
        let Some(w) = &self.window else { return true };
        if turned(pose.rotation.angle() - w.pose.rotation.angle()).abs() > w.angle_rad {
            return false;
        }
        // With an anchor the place follows from it.
        !self.anchors.is_empty()
            || (pose.translation.vector - w.pose.translation.vector).norm()
                <= w.origin_px + self.reach_sigma * self.floor_px
    }

    /// The hypothesis refined from a pose known to `slack_rad`, if any node is seen.
    pub fn refine(
        &self,
        pose: Isometry2<f64>,
        about: Vector2<f64>,
        slack_rad: f64,
    ) -> Option<PoseHypothesis> {
        let n = self.link.nodes.len();
        let mut pose = pose;
        let mut slack = slack_rad;
        let mut picks: Vec<Option<usize>> = vec![None; n];
        let mut about = about;
        let mut result = None;
        for round in 0..REFINE_ROUNDS {
            self.work.spend(n);
            let mut new: Vec<Option<usize>> = vec![None; n];
            let mut distance = vec![f64::INFINITY; n];
            for j in 0..n {
                let there = place(&pose, self.link.template[j]);
                let lever = (self.link.template[j] - about).norm();
                let wide = self.reach_sigma * (self.usual_sigma(j) + slack * lever);
                if let Some((d, r)) = self.index.nearest(there, wide)
                    && self.free[d]
                    && r <= self.reach_sigma * (self.sigma(j, d) + slack * lever)
                {
                    // A detection is one node at most: the nearer one.
                    if let Some(other) = (0..j).find(|&k| new[k] == Some(d)) {
                        if distance[other] <= r {
                            continue;
                        }
                        new[other] = None;
                    }
                    new[j] = Some(d);
                    distance[j] = r;
                }
            }
            let pairs = self.pairs(&new);
            let fit = self.fit(&pairs, &pose)?;
            slack = 0.0;
            about = fit.centre;
            pose = fit.pose;
            let same = new == picks;
            picks = new;
            result = Some(fit);
            if same && round > 0 {
                break;
            }
        }
        let fit = result?;
        // Last test, at the fitted pose and with its own uncertainty no excuse.
        let mut chi2 = 0.0;
        let mut inliers = 0;
        for (j, pick) in picks.iter_mut().enumerate() {
            if let Some(d) = *pick {
                let r = (place(&fit.pose, self.link.template[j]) - self.index.place(d)).norm();
                let s = self.sigma(j, d);
                if r > self.reach_sigma * s || self.remnant(j, d) {
                    *pick = None;
                } else if self.whole(j, d) {
                    inliers += 1;
                    chi2 += (r / s).powi(2);
                }
            }
        }
        // The anchors must agree too.
        for a in self.anchors {
            if (place(&fit.pose, a.local) - a.place).norm() > self.reach_sigma * a.sigma_px {
                return None;
            }
        }
        (inliers > 0 && self.allowed(&fit.pose)).then_some(PoseHypothesis { fit, picks, inliers, chi2 })
    }

    /// Points of the body and their places: the anchors, and the whole detections.
    fn pairs(&self, picks: &[Option<usize>]) -> Vec<Pair> {
        let mut pairs: Vec<Pair> = self
            .anchors
            .iter()
            .map(|a| Pair { local: a.local, place: a.place, sigma_px: a.sigma_px })
            .collect();
        for (j, pick) in picks.iter().enumerate() {
            if let Some(d) = *pick
                && self.whole(j, d)
            {
                let sigma_px = self.sigma(j, d);
                pairs.push(Pair { local: self.link.template[j], place: self.index.place(d), sigma_px });
            }
        }
        pairs
    }

    /// A pose from the pairs; from a single one the angle is kept.
    fn fit(&self, pairs: &[Pair], pose: &Isometry2<f64>) -> Option<PoseFit> {
        fit_pose(pairs).or_else(|| {
            let p = pairs.first()?;
            // No more than every angle: it comes back in the next forecast.
            let turn = self.window.map_or(PI, |w| w.angle_rad.min(PI));
            Some(PoseFit {
                pose: hung_at(pose, p.local, p.place),
                centre: p.local,
                sigma_angle_rad: turn,
                sigma_centre_px: p.sigma_px,
                chi2: 0.0,
            })
        })
    }

    /// All hypotheses, the best (most nodes, then least chi-square) first.
    pub fn run(&self) -> Found {
        let mut found = Found::default();
        let link = self.link;
        let n = link.nodes.len();
        let mut near = Vec::new();
        self.work.spend(self.free.len() / GLANCES + 1);
        if let Some((a, b)) = self.far_anchors() {
            // Two anchors fix the pose.
            let pairs = [a, b].map(|a| Pair { local: a.local, place: a.place, sigma_px: a.sigma_px });
            if let Some(fit) = fit_pose(&pairs) {
                self.test(fit.pose, fit.centre, fit.sigma_angle_rad, &mut found);
            }
        } else if let Some(a) = self.anchors.first() {
            for j in 0..n {
                let arm = link.template[j] - a.local;
                let radius = arm.norm();
                let reach = self.reach_sigma * self.usual_sigma(j).hypot(a.sigma_px);
                if radius <= reach {
                    // A node at the joint gives no angle.
                    if let Some(w) = &self.window
                        && n == 1
                    {
                        self.test(hung_at(&w.pose, a.local, a.place), a.local, 0.0, &mut found);
                    } else if n == 1 {
                        self.test(pose_at(0.0, a.local, a.place), a.local, 0.0, &mut found);
                    }
                    continue;
                }
                match &self.window {
                    Some(w) if w.angle_rad < NARROW_WINDOW_RAD => {
                        let there = place(&hung_at(&w.pose, a.local, a.place), link.template[j]);
                        self.index.within(there, radius * w.angle_rad + reach, &mut near);
                    }
                    _ => self.index.within(a.place, radius + reach, &mut near),
                }
                for &d in &near {
                    let ray = self.index.place(d) - a.place;
                    if !self.free[d] || !self.whole(j, d) || (ray.norm() - radius).abs() > reach {
                        continue;
                    }
                    let angle = ray.y.atan2(ray.x) - arm.y.atan2(arm.x);
                    let slack = self.sigma(j, d).hypot(a.sigma_px) / radius;
                    self.test(pose_at(angle, a.local, a.place), a.local, slack, &mut found);
                }
            }
        } else if n == 1 {
            if let Some(w) = &self.window {
                self.index.within(w.pose.translation.vector, w.origin_px, &mut near);
                for &d in &near {
                    if self.free[d] {
                        let pose = hung_at(&w.pose, link.template[0], self.index.place(d));
                        self.test(pose, link.template[0], 0.0, &mut found);
                    }
                }
            }
        } else {
            self.by_pairs(&mut found);
        }
        found.hypotheses.sort_by(|a, b| b.inliers.cmp(&a.inliers).then(a.chi2.total_cmp(&b.chi2)));
        found
    }

    /// Two anchors far enough apart to fix the pose alone.
    fn far_anchors(&self) -> Option<(Anchor, Anchor)> {
        let a = *self.anchors.first()?;
        let b = self.anchors[1..]
            .iter()
            .copied()
            .max_by(|x, y| (x.local - a.local).norm().total_cmp(&(y.local - a.local).norm()))?;
        ((b.local - a.local).norm() > LEAST_BASE_SIGMA * a.sigma_px.hypot(b.sigma_px)).then_some((a, b))
    }

    /// Poses from two nodes: every pair of detections at the distance of a pair of nodes.
    fn by_pairs(&self, found: &mut Found) {
        let link = self.link;
        let n = link.nodes.len();
        let mut node_distances: Vec<(f64, usize, usize)> = Vec::new();
        for i in 0..n {
            for j in i + 1..n {
                node_distances.push(((link.template[i] - link.template[j]).norm(), i, j));
            }
        }
        node_distances.sort_by(|a, b| b.0.total_cmp(&a.0));
        node_distances.truncate(self.pairs);
        let mut seeds: Vec<usize> =
            (0..self.index.len()).filter(|&d| self.free[d] && self.index.whole(d)).collect();
        if seeds.len() > MOST_SEEDS {
            found.is_bounded = true;
            seeds.sort_by(|&a, &b| self.index.get(a).sigma_px.total_cmp(&self.index.get(b).sigma_px));
            seeds.truncate(MOST_SEEDS);
            seeds.sort_unstable();
        }
        let pairs = seeds.len() * seeds.len().saturating_sub(1) / 2;
        if pairs > 0 && self.work.is_spent() {
            found.is_bounded = true;
            return;
        }
        self.work.spend(pairs / GLANCES);
        let mut detection_distances: Vec<(f64, usize, usize)> = Vec::with_capacity(pairs);
        for (k, &d) in seeds.iter().enumerate() {
            for &e in &seeds[k + 1..] {
                detection_distances.push(((self.index.place(d) - self.index.place(e)).norm(), d, e));
            }
        }
        detection_distances.sort_by(|a, b| a.0.total_cmp(&b.0));
        for &(span, i, j) in &node_distances {
            let sigma = self.usual_sigma(i).hypot(self.usual_sigma(j));
            let reach = self.reach_sigma * sigma;
            if span <= LEAST_SPAN_REACHES * reach {
                continue;
            }
            let first = detection_distances.partition_point(|g| g.0 < span - reach);
            for &(gap, d, e) in detection_distances[first..].iter().take_while(|g| g.0 <= span + reach) {
                debug_assert!(gap >= span - reach);
                if found.trials >= MOST_TRIALS || self.work.is_spent() {
                    found.is_bounded = true;
                    return;
                }
                for (d, e) in [(d, e), (e, d)] {
                    let pairs = [(i, d), (j, e)].map(|(j, d)| Pair {
                        local: link.template[j],
                        place: self.index.place(d),
                        sigma_px: self.sigma(j, d),
                    });
                    if let Some(fit) = fit_pose(&pairs) {
                        self.test(fit.pose, fit.centre, fit.sigma_angle_rad, found);
                    }
                }
            }
        }
    }

    /// Refines a pose and keeps what comes of it, if the window allows it and no hypothesis with the same detections is there.
    fn test(&self, pose: Isometry2<f64>, about: Vector2<f64>, slack_rad: f64, found: &mut Found) {
        if let Some(w) = &self.window {
            // The seed's own uncertainty widens the window here; the fitted pose is held to it.
            let off = turned(pose.rotation.angle() - w.pose.rotation.angle()).abs();
            if off > w.angle_rad + self.reach_sigma * slack_rad {
                return;
            }
        }
        if self.work.is_spent() {
            found.is_bounded = true;
            return;
        }
        found.trials += 1;
        if let Some(s) = self.refine(pose, about, slack_rad) {
            found.keep(s);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::detect::Detection;

    /// Side of the picture, px.
    const SIDE: f64 = 720.0;

    /// Nine nodes about (300, 300) px.
    fn link() -> Link {
        let along = |i: f64| Vector2::new(17.0 * i - 70.0, 13.0 * (2.1 * i).sin() + 0.3 * i * i);
        let template: Vec<Vector2<f64>> = (0..9).map(|i| along(f64::from(i))).collect();
        let n = template.len();
        Link {
            nodes: (0..n).collect(),
            template,
            slack_px: vec![0.05; n],
            whole_px: vec![0.0; n],
            area_px: vec![(0.0, 0.0); n],
            home: Vector2::new(300.0, 300.0),
            excess_px: 0.0,
        }
    }

    fn spot(place: Vector2<f64>, sigma_px: f32) -> Detection {
        Detection { x_px: place.x, y_px: place.y, sigma_px, ..Default::default() }
    }

    /// Spots anywhere in the picture.
    fn noise(count: usize, sigma_px: f32) -> Vec<Detection> {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        (0..count)
            .map(|_| spot(Vector2::new(SIDE * rng.random::<f64>(), SIDE * rng.random::<f64>()), sigma_px))
            .collect()
    }

    fn run(link: &Link, detections: &[Detection]) -> Found {
        let (index, free) = (DetectionIndex::new(detections), vec![true; detections.len()]);
        let work = Work::of(u64::MAX);
        Search {
            link,
            anchors: &[],
            index: &index,
            free: &free,
            window: None,
            reach_sigma: REACH_SIGMA,
            floor_px: 0.05,
            pairs: PAIRS,
            work: &work,
        }
        .run()
    }

    #[test]
    fn the_work_is_bounded_however_much_stands_out() {
        let link = link();
        for (count, sigma_px, is_bounded) in
            [(40, 0.1, false), (150, 0.1, false), (1000, 0.1, true), (6000, 0.1, true), (399, 3.0, true)]
        {
            let found = run(&link, &noise(count, sigma_px));
            assert_eq!(found.is_bounded, is_bounded, "{count}: {} trials", found.trials);
            assert!(found.trials <= MOST_TRIALS && found.hypotheses.len() <= found.trials, "{count}");
            // None twice.
            let different: HashSet<_> = found.hypotheses.iter().map(|h| h.picks.clone()).collect();
            assert_eq!(different.len(), found.hypotheses.len(), "{count}");
        }
    }

    #[test]
    fn a_body_whose_centres_are_known_best_is_found_among_thousands_of_spots() {
        let link = link();
        let mut detections = noise(3000, 0.3);
        detections.extend(link.template.iter().map(|t| spot(t + link.home, 0.05)));
        let found = run(&link, &detections);
        assert!(found.is_bounded);
        let best = &found.hypotheses[0];
        assert_eq!(best.inliers, 9);
        assert!((best.fit.pose.translation.vector - link.home).norm() < 0.1);
    }
}
