//! Follows pose hypotheses between which nothing decides yet, until their motion does.
//!
//! Owns: [`Tentative`]. Must not: look for a body anew.

use nalgebra::Vector2;

use super::bodies::Bodies;
use super::body_search::Open;
use super::false_matches::CHANCE_ANYWHERE;
use crate::rigid::forecast::Motion;
use crate::rigid::hypothesis::{Anchor, PoseHypothesis};
use crate::rigid::index::DetectionIndex;

/// Greatest number of undecided hypotheses of a body that are followed at once: a bound of work.
const MOST_TENTATIVE: usize = 8;
/// Frames in a row without its body after which a hypothesis is dropped.
const MOST_MISSED_FRAMES: u32 = 3;
/// Distance that a hypothesis must move for its motion to prove anything, px: what stands still scatters and shakes by less.
const PROOF_PX: f64 = 3.0;

/// Greatest expected number of false matches that a hypothesis begins with: with more it would never be believed.
const MOST_CHANCE: f64 = 1e3;

/// A hypothesis that could be chance, followed until it no longer can be.
#[derive(Debug, Clone)]
pub(super) struct Tentative {
    motion: Motion,
    /// Expected number of false matches as good: the product over the steps in which the hypothesis moved, which unrelated
    /// detections would have to follow each time anew.
    chance: f64,
    /// Places of its nodes when `chance` was last multiplied: what stands still proves nothing.
    proved: Vec<Vector2<f64>>,
    missed: u32,
}

/// Carries on the hypotheses of a body that nothing decided yet, and begins new ones; the one that stands, if
/// now one does.
pub(super) fn follow(
    bodies: &mut Bodies,
    waiting: &mut Vec<Tentative>,
    b: usize,
    time: f64,
    index: &DetectionIndex<'_>,
    free: &[bool],
    anchors: &[Anchor],
    undecided: Vec<(PoseHypothesis, f64)>,
) -> Option<PoseHypothesis> {
    let link = &bodies.mechanism.links[b];
    let mut now: Vec<Option<PoseHypothesis>> = Vec::new();
    let mut kept: Vec<Tentative> = Vec::new();
    for mut t in std::mem::take(waiting) {
        let Some(w) = t.motion.forecast(time, bodies.priors.floor[b], bodies.priors.first[b]) else {
            continue;
        };
        let w = anchors.first().map_or(w, |a| w.hung(a.local, a.place));
        let search = bodies.search(b, index, free, anchors, Some(w));
        let mut open = Open::new(link.nodes.len());
        match bodies.resolve(&search, f64::INFINITY, &mut open) {
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
                if t.missed <= MOST_MISSED_FRAMES {
                    kept.push(t);
                    now.push(None);
                }
            }
        }
    }
    for (s, chance) in undecided {
        let same = now.iter().flatten().any(|o| o.picks == s.picks);
        if !same && kept.len() < MOST_TENTATIVE {
            let mut motion = Motion::default();
            motion.add(time, &s.fit);
            let proved = link.places(&s.fit.pose);
            kept.push(Tentative { motion, chance: chance.min(MOST_CHANCE), proved, missed: 0 });
            now.push(Some(s));
        }
    }
    let (mut kept, mut now) = without_duplicates(kept, now);
    // One that is beyond chance stands if all others are gone.
    if matches!((&kept[..], &now[..]), ([t], [Some(_)]) if t.chance < CHANCE_ANYWHERE) {
        bodies.motions[b] = kept.swap_remove(0).motion;
        return now.swap_remove(0);
    }
    *waiting = kept;
    None
}

/// Without those that came to see the same as another: of each such group the least likely by chance stays.
fn without_duplicates(
    kept: Vec<Tentative>,
    now: Vec<Option<PoseHypothesis>>,
) -> (Vec<Tentative>, Vec<Option<PoseHypothesis>>) {
    let mut out: Vec<(Tentative, Option<PoseHypothesis>)> = Vec::new();
    for (t, s) in kept.into_iter().zip(now) {
        let same = |o: &Option<PoseHypothesis>| matches!((o, &s), (Some(o), Some(s)) if o.picks == s.picks);
        match out.iter_mut().find(|(_, o)| same(o)) {
            Some(o) if t.chance < o.0.chance => *o = (t, s),
            Some(_) => {}
            None => out.push((t, s)),
        }
    }
    out.into_iter().unzip()
}
