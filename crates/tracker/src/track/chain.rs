//! Names the single markers of a chain together, where no one of them is known by itself.
//!
//! Owns: [`find_chains`]. Must not: undo a name.
//!
//! A link of one marker says little: anything at its distance from its joint may be it. A chain of such links says much: each
//! marker has its distance from the one before it, and after two markers of a chain went by each other only one way of naming them
//! has all the distances.

use std::f64::consts::PI;

use super::bodies::Bodies;
use super::false_matches::CHANCE_ANYWHERE;
use super::motion_priors::LEAST_REACH_PX;
use super::seen::{BodySeen, accepted};
use crate::detect::Flags;
use crate::rigid::body::Holder;
use crate::rigid::hypothesis::{Anchor, PoseHypothesis};
use crate::rigid::index::DetectionIndex;
use crate::rigid::pose::{Pair, fit_pose};
use crate::rigid::search::REACH_SIGMA;

/// Links of one marker in a row that are named together: their ways of being named grow with each.
const LONGEST: usize = 6;
/// Ways of naming that are looked at; where there are more, nothing is named.
const MOST_WAYS: usize = 64;
/// A way of naming is possible up to twice the distance, from where a marker must be, at which it is believed.
const RIVAL: f64 = 2.0;

/// One way of naming a chain.
#[derive(Clone)]
struct Way {
    seen: Vec<BodySeen>,
    free: Vec<bool>,
    /// Expected number of sets of unrelated detections that pass so.
    chance: f64,
    /// Whether each marker is where it is believed, and not only where it is possible.
    fits: bool,
}

/// Names chains of single markers that are not all found, where exactly one way of naming them has all the distances. Markers that
/// are found by their motion alone, with nothing known on which they hang, must have the same name in it.
pub(super) fn find_chains(
    bodies: &Bodies,
    index: &DetectionIndex<'_>,
    free: &mut [bool],
    seen: &mut [BodySeen],
) {
    let lone = |b: usize| bodies.mechanism.links[b].nodes.len() == 1;
    let loose = |b: &usize| lone(*b) && seen[*b].fit.is_some() && bodies.anchors(*b, &seen[..]).is_empty();
    if (0..seen.len()).all(|b| !lone(b) || seen[b].fit.is_some()) {
        return;
    }
    let mut start = Way { seen: seen.to_vec(), free: free.to_vec(), chance: 1.0, fits: true };
    for b in (0..seen.len()).filter(loose) {
        seen[b].detections().for_each(|d| start.free[d] = true);
        start.seen[b] = BodySeen::default();
    }
    for &head in &bodies.mechanism.order {
        let chain = chain(bodies, head, &start.seen);
        if chain.len() < 2 || chain.iter().all(|&b| seen[b].fit.is_some()) {
            continue;
        }
        let unrelated = start.free.iter().filter(|&&f| f).count().saturating_sub(chain.len()) as f64;
        let Some(ways) = chain.iter().try_fold(vec![start.clone()], |ways, &b| {
            let next: Vec<Way> = ways.iter().flat_map(|w| carried(bodies, index, b, w, unrelated)).collect();
            (next.len() <= MOST_WAYS).then_some(next)
        }) else {
            continue;
        };
        let [only] = &ways[..] else { continue };
        let same = |&b: &usize| seen[b].fit.is_none() || seen[b].picks == only.seen[b].picks;
        if only.fits && only.chance < CHANCE_ANYWHERE && chain.iter().all(same) {
            for &b in &chain {
                seen[b] = only.seen[b].clone();
                seen[b].detections().for_each(|d| free[d] = false);
            }
            start = only.clone();
        }
    }
}

/// Bodies of one marker that are not found, each hanging on the one before, the first on what is known.
fn chain(bodies: &Bodies, head: usize, seen: &[BodySeen]) -> Vec<usize> {
    let mechanism = &bodies.mechanism;
    let lone = |b: usize| mechanism.links[b].nodes.len() == 1 && seen[b].fit.is_none();
    if !lone(head) || bodies.anchors(head, seen).is_empty() {
        return Vec::new();
    }
    let mut chain = vec![head];
    while let Some(&last) = chain.last() {
        let hangs = |b: usize| {
            let hinges = mechanism.hinges.iter().filter(move |h| h.body == b);
            hinges.map(|h| h.holder).any(|h| matches!(h, Holder::Body(o, _) if o == last))
        };
        let mut next = (0..mechanism.links.len()).filter(|&b| lone(b) && !chain.contains(&b) && hangs(b));
        match (next.next(), next.next()) {
            (Some(b), None) if chain.len() < LONGEST => chain.push(b),
            _ => break,
        }
    }
    chain
}

/// The ways of naming that add body `b` to one; `unrelated` detections are none of the chain's.
fn carried(bodies: &Bodies, index: &DetectionIndex<'_>, b: usize, way: &Way, unrelated: f64) -> Vec<Way> {
    let anchors = bodies.anchors(b, &way.seen);
    let Some(anchor) = anchors.first() else { return Vec::new() };
    let link = &bodies.mechanism.links[b];
    let radius_px = (link.template[0] - anchor.local).norm();
    let reach_px = radius_px.max(LEAST_REACH_PX);
    let density = unrelated.max(bodies.priors.clutter) / (PI * reach_px * reach_px);
    let search = bodies.search(b, index, &way.free, &anchors, None);
    // Two discs that run together have a centre each; of what the picture's border cuts, or something hides, the centre is off.
    let centred = |d: &usize| {
        let flags = index.get(*d).flags;
        way.free[*d] && !flags.has(Flags::BORDER) && (!flags.has(Flags::PARTIAL) || search.whole(0, *d))
    };
    let mut out = Vec::new();
    for d in (0..index.len()).filter(centred) {
        let off_px = ((index.place(d) - anchor.place).norm() - radius_px).abs();
        let gate_px = REACH_SIGMA * search.sigma(0, d).hypot(anchor.sigma_px);
        if off_px > RIVAL * gate_px {
            continue;
        }
        let node = Pair { local: link.template[0], place: index.place(d), sigma_px: search.sigma(0, d) };
        let Some(hypothesis) = hung(anchor, node, d) else { continue };
        let mut next = way.clone();
        next.free[d] = false;
        next.fits &= off_px < gate_px;
        // A ring about the joint, twice the gate wide.
        next.chance *= (density * 4.0 * PI * radius_px * gate_px).min(1.0);
        next.seen[b] = accepted(hypothesis, 1);
        out.push(next);
    }
    out
}

/// A body that hangs at `anchor` and has detection `d` as its one marker.
fn hung(anchor: &Anchor, node: Pair, d: usize) -> Option<PoseHypothesis> {
    let joint = Pair { local: anchor.local, place: anchor.place, sigma_px: anchor.sigma_px };
    let fit = fit_pose(&[joint, node])?;
    Some(PoseHypothesis { chi2: fit.chi2, fit, picks: vec![Some(d)], inliers: 1 })
}
