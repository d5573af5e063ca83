//! Finds links of one marker among the tracklets that are left: they go about a point of the ground or of a body.
//!
//! Owns: [`hanging`], [`levels`]. Must not: change bodies.

use nalgebra::{Isometry2, Vector2};

use super::body::{FoundBody, TrackletBody};
use super::evidence::Evidence;
use super::pairs::PairFacts;
use crate::discover::arrange::Found;
use crate::discover::bodies::{FLOOR_PX, link_of};
use crate::discover::circle::Circle;
use crate::rigid::pose::place;

/// Circles whose middles and radii differ by less are one, px, and the same as a part of the radius.
const SAME_PX: f64 = 1.5;
const SAME_PART: f64 = 0.03;
/// A marker that goes about a point by less than 5 px, the least radius of a circle that is found, stays within this, px.
const NEAR_PIVOT_PX: f64 = 12.0;
/// Part of the frames that a marker must be seen in.
const LEAST_PART: f64 = 0.1;
/// Part of the frames that a marker must be seen in which goes about no point.
const LONE_PART: f64 = 0.3;

/// The point about which a single marker turns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Holder {
    Ground,
    Body(usize),
    /// Another single marker, by its place among them.
    Marker(usize),
}

/// A marker that goes about a point.
struct Hanging {
    holder: Holder,
    middle: Vector2<f64>,
    radius_px: f64,
    tracklets: Vec<usize>,
}

/// For each tracklet whether it goes about a point of the ground, or keeps its distance from one that does and goes about none
/// itself, and so on along a chain; `rigid` says which two keep their distance. Of two tracklets of which one hangs on the other the
/// distance is a link's that has no marker of its own, and no body's.
pub(super) fn levels(evidence: &Evidence<'_>, rigid: &dyn Fn(usize, usize) -> bool) -> Vec<Option<usize>> {
    let n = evidence.tracklets.len();
    let places = |t: usize| -> Vec<Vector2<f64>> {
        evidence.spans[t].clone().filter_map(|k| evidence.place(t, k)).collect()
    };
    let circles: Vec<(Circle, f64)> = (0..n)
        .filter_map(|t| {
            let places = places(t);
            Circle::through(&places).map(|c| (c, (places[0] - c.middle).norm()))
        })
        .collect();
    // A short piece of a circle's marker shows no circle of its own.
    let on_circle = |t: usize| {
        let places = places(t);
        let near = |(c, radius): &(Circle, f64)| {
            let off = |p: &Vector2<f64>| ((p - c.middle).norm() - radius).abs();
            !places.is_empty() && places.iter().all(|p| off(p) < SAME_PX + SAME_PART * radius)
        };
        circles.iter().any(near)
    };
    // So near to its pivot a marker shows no circle, and hangs on no other.
    let at_pivot = |t: usize| evidence.tracklets[t].extent_px() < NEAR_PIVOT_PX;
    let mut out: Vec<Option<usize>> = (0..n).map(|t| (on_circle(t) || at_pivot(t)).then_some(0)).collect();
    for level in 0..n {
        let mut again = false;
        for t in 0..n {
            let hangs = |o: usize| out[o] == Some(level) && rigid(o, t);
            if out[t].is_none() && (0..n).any(hangs) {
                out[t] = Some(level + 1);
                again = true;
            }
        }
        if !again {
            return out;
        }
    }
    out
}

/// Single markers, with their places as poses.
pub(super) fn hanging(evidence: &Evidence<'_>, bodies: &[TrackletBody], free: &[bool]) -> Vec<FoundBody> {
    let mut all: Vec<Hanging> = Vec::new();
    for t in (0..evidence.tracklets.len()).filter(|&t| free[t]) {
        let ground: Vec<(usize, Vector2<f64>)> =
            evidence.spans[t].clone().filter_map(|k| Some((k, evidence.place(t, k)?))).collect();
        let of_body =
            |(b, body): (usize, &TrackletBody)| (Holder::Body(b), body.local(evidence, t).collect());
        let seen_from =
            std::iter::once((Holder::Ground, ground)).chain(bodies.iter().enumerate().map(of_body));
        let best = seen_from
            .filter_map(|(holder, places): (Holder, Vec<(usize, Vector2<f64>)>)| {
                let places: Vec<Vector2<f64>> = places.into_iter().map(|p| p.1).collect();
                let circle = Circle::through(&places)?;
                Some((circle, holder, (places[0] - circle.middle).norm()))
            })
            .min_by(|x, y| x.0.rms_px.total_cmp(&y.0.rms_px));
        let Some((circle, holder, radius_px)) = best else { continue };
        let same = |h: &&mut Hanging| {
            h.holder == holder
                && (h.middle - circle.middle).norm() < SAME_PX + SAME_PART * radius_px
                && (h.radius_px - radius_px).abs() < SAME_PX + SAME_PART * radius_px
                && h.tracklets.iter().all(|&o| !evidence.coexist(o, t))
        };
        match all.iter_mut().find(same) {
            Some(h) => h.tracklets.push(t),
            None => all.push(Hanging { holder, middle: circle.middle, radius_px, tracklets: vec![t] }),
        }
    }
    hang_on_markers(evidence, free, &mut all);
    let frames = |tracklets: &[usize]| tracklets.iter().map(|&t| evidence.spans[t].len()).sum::<usize>();
    let enough =
        |tracklets: &[usize], part: f64| frames(tracklets) as f64 >= part * evidence.frames.len() as f64;
    all.retain(|h| enough(&h.tracklets, LEAST_PART));
    let used: Vec<usize> = all.iter().flat_map(|h| h.tracklets.iter().copied()).collect();
    let lone = (0..evidence.tracklets.len())
        .filter(|&t| free[t] && !used.contains(&t) && enough(&[t], LONE_PART))
        .map(|t| vec![t]);
    all.iter().map(|h| h.tracklets.clone()).chain(lone).filter_map(|t| single(evidence, &t)).collect()
}

/// Adds the free tracklets that keep their distance from a single marker that hangs, and from those that then hang on it.
fn hang_on_markers(evidence: &Evidence<'_>, free: &[bool], all: &mut Vec<Hanging>) {
    let mut holder = 0;
    while holder < all.len() {
        for t in (0..evidence.tracklets.len()).filter(|&t| free[t]) {
            if all.iter().any(|h| h.tracklets.contains(&t)) {
                continue;
            }
            let facts = |&o: &usize| PairFacts::of(evidence, o, t).filter(PairFacts::rigid);
            let Some(facts) = all[holder].tracklets.iter().find_map(facts) else { continue };
            let (radius_px, middle, holder) = (facts.distance_px, Vector2::zeros(), Holder::Marker(holder));
            let same = |h: &&mut Hanging| {
                h.holder == holder
                    && (h.radius_px - radius_px).abs() < SAME_PX + SAME_PART * radius_px
                    && h.tracklets.iter().all(|&o| !evidence.coexist(o, t))
            };
            match all.iter_mut().find(same) {
                Some(h) => h.tracklets.push(t),
                None => all.push(Hanging { holder, middle, radius_px, tracklets: vec![t] }),
            }
        }
        holder += 1;
    }
}

/// A body of one marker.
fn single(evidence: &Evidence<'_>, tracklets: &[usize]) -> Option<FoundBody> {
    let mut poses: Vec<Option<Isometry2<f64>>> = vec![None; evidence.frames.len()];
    for &t in tracklets {
        for k in evidence.spans[t].clone() {
            if let Some(p) = evidence.place(t, k) {
                poses[k] = Some(Isometry2::new(p, 0.0));
            }
        }
    }
    let first = place(&poses.iter().flatten().next().copied()?, Vector2::zeros());
    let found = Found { link: link_of(vec![first], FLOOR_PX), poses };
    Some(FoundBody { found, markers: vec![tracklets.to_vec()] })
}
