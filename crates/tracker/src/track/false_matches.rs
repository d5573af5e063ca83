//! Computes the expected number of false matches as good as a pose hypothesis (an a-contrario test).
//!
//! Owns: [`expected_false_matches`], [`self_symmetry_rad`], [`indistinguishable`]. Must not: decide what is accepted (`body_search` does).

use std::f64::consts::PI;

use nalgebra::Vector2;

use super::motion_priors::{LEAST_REACH_PX, MotionPriors};
use crate::detect::Detection;
use crate::rigid::body::{Link, Mechanism};
use crate::rigid::hypothesis::{Anchor, PoseHypothesis};
use crate::rigid::index::DetectionIndex;
use crate::rigid::search::{PAIRS, REACH_SIGMA, Search};
use crate::rigid::work::{MOST_OF_FRAME, Work};

/// Greatest expected number of false matches for a body found anywhere in the frame.
pub(super) const CHANCE_ANYWHERE: f64 = 1e-5;
/// How exactly the only node seen of a body must be expected, px: a half hidden disc of 3.6 px radius is off by that (0.42 of
/// its radius).
const LONE_GATE_PX: f64 = 1.5;
/// Gate of the only node seen of a body where its area shows that it is whole, px: twice as wide, since it is not off.
const WHOLE_GATE_PX: f64 = 3.0;

/// Expected number of false matches as good as `s`: poses that unrelated detections would give to `search` in `trials` poses.
/// Unrelated detections are taken to lie all within the body's reach, evenly (`density` per px^2), which is the worst case: one
/// of them agrees with a node with probability `density * pi * radius^2`.
pub fn expected_false_matches(
    search: &Search<'_>,
    s: &PoseHypothesis,
    trials: usize,
    priors: &MotionPriors,
    image_px: f64,
) -> f64 {
    let link = search.link;
    let n = link.nodes.len();
    let others = search.free.iter().filter(|&&f| f).count().saturating_sub(s.inliers) as f64;
    let from = search.anchors.first().map_or(Vector2::zeros(), |a| a.local);
    let reach = link.reach_px(from).max(LEAST_REACH_PX);
    let density = others.max(priors.clutter) / (PI * reach * reach);
    let whole =
        s.picks.iter().enumerate().filter_map(|(j, d)| d.filter(|&d| search.whole(j, d)).map(|d| (j, d)));
    let picked = whole.map(|(j, d)| search.sigma(j, d));
    let radius = REACH_SIGMA * picked.fold(0.0, f64::max);
    let hit = (density * PI * radius * radius).min(1.0);
    // Nodes that fix the pose beside the anchors.
    let base = 2 - search.anchors.len().min(2);
    let gate = search.window.map_or(f64::INFINITY, |w| w.origin_px + w.angle_rad * reach + radius);
    // Pairs of unrelated detections that pass for two nodes of a body that hangs on nothing: the first lies anywhere in the
    // window (pi gate^2), the second at the distance of the nodes, in a strip 2 gate long and 2 radius wide.
    let by_pairs =
        (n * n.saturating_sub(1) / 2) as f64 * (density * PI * gate * gate) * (density * 4.0 * radius * gate);
    if s.inliers > base {
        let k = s.inliers - base;
        let poses = if base == 2 { by_pairs.min(trials as f64) } else { trials as f64 };
        return poses * choose(n.saturating_sub(base).max(k), k) * hit.powi(k as i32);
    }
    let turn = search.window.map_or(PI, |w| w.angle_rad.min(PI));
    if n == 1 && base == 2 {
        let density = others.max(priors.clutter) / image_px;
        let gate = search.window.map_or(f64::INFINITY, |w| w.origin_px + radius);
        return density * PI * gate * gate;
    }
    let area_known = s.picks.iter().zip(&link.whole_px).any(|(p, &whole)| p.is_some() && whole > 0.0);
    let lone_gate = if area_known { WHOLE_GATE_PX } else { LONE_GATE_PX };
    match base {
        // One node on its circle about the anchor: an arc 2 reach turn long and 2 radius wide.
        1 if n > 1 && turn * reach > lone_gate => f64::INFINITY,
        1 => n as f64 * density * 4.0 * radius * reach * turn,
        // One or two nodes of a body that hangs on nothing.
        _ if s.inliers == 1 => f64::INFINITY,
        _ => by_pairs,
    }
}

/// Binomial coefficient.
fn choose(n: usize, k: usize) -> f64 {
    (0..k).map(|i| (n - i) as f64 / (i + 1) as f64).product()
}

/// Standard uncertainty of a body's own nodes as detections, px: usual of a good centre.
const IDEAL_SIGMA_PX: f64 = 0.05;

/// Detections as a body's own nodes would give them, at their places in the body.
fn ideal_detections(link: &Link) -> Vec<Detection> {
    let ideal = |t: &Vector2<f64>| Detection {
        x_px: t.x,
        y_px: t.y,
        sigma_px: IDEAL_SIGMA_PX as f32,
        ..Default::default()
    };
    link.template.iter().map(ideal).collect()
}

/// A search for a body with no expectation of where it is.
fn anywhere<'a>(
    link: &'a Link,
    anchors: &'a [Anchor],
    index: &'a DetectionIndex<'a>,
    free: &'a [bool],
    priors: &MotionPriors,
    work: &'a Work,
) -> Search<'a> {
    let floor_px = priors.floor_px;
    let reach_sigma = REACH_SIGMA;
    Search { link, anchors, index, free, window: None, reach_sigma, floor_px, pairs: PAIRS, work }
}

/// The least turn of a body, about its first joint if it has one, that lays two of its nodes (three where it
/// hangs on nothing) on places of nodes again; infinite if there is none.
pub fn self_symmetry_rad(mechanism: &Mechanism, priors: &MotionPriors, body: usize) -> f64 {
    let link = &mechanism.links[body];
    let ideal = ideal_detections(link);
    let anchors: Vec<Anchor> = mechanism
        .hinges
        .iter()
        .filter(|h| h.body == body)
        .take(1)
        .map(|h| Anchor { local: h.local, place: h.local, sigma_px: h.sigma_px })
        .collect();
    let least = if anchors.is_empty() { 3 } else { 2 };
    let free = vec![true; ideal.len()];
    anywhere(link, &anchors, &DetectionIndex::new(&ideal), &free, priors, &Work::of(MOST_OF_FRAME))
        .run()
        .hypotheses
        .iter()
        .filter(|s| s.inliers >= least)
        .filter(|s| s.picks.iter().enumerate().any(|(j, p)| p.is_some_and(|p| p != j)))
        .map(|s| s.fit.pose.rotation.angle().abs())
        .fold(f64::INFINITY, f64::min)
}

/// For each body the others that look the same: one has all the nodes of the other at the same distances. Any two bodies of
/// one node look the same.
pub fn indistinguishable(mechanism: &Mechanism, priors: &MotionPriors) -> Vec<Vec<usize>> {
    let links = &mechanism.links;
    let work = Work::saved();
    let same = |a: usize, b: usize| {
        let (small, large) = if links[a].nodes.len() < links[b].nodes.len() { (a, b) } else { (b, a) };
        if links[small].nodes.len() == 1 {
            return links[large].nodes.len() == 1;
        }
        let ideal = ideal_detections(&links[large]);
        let free = vec![true; ideal.len()];
        let found = anywhere(&links[small], &[], &DetectionIndex::new(&ideal), &free, priors, &work).run();
        // Where it could not be tried through they are not told apart.
        found.is_bounded || found.hypotheses.first().is_some_and(|s| s.inliers == links[small].nodes.len())
    };
    (0..links.len()).map(|a| (0..links.len()).filter(|&b| b != a && same(a, b)).collect()).collect()
}
