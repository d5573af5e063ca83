//! Finds links of one marker among the tracklets that are left: they go about a point of the ground or of a body.
//!
//! Owns: [`hanging`]. Must not: change bodies.

use nalgebra::{Isometry2, Vector2};

use super::body::{FoundBody, TrackletBody};
use super::evidence::Evidence;
use crate::discover::arrange::Found;
use crate::discover::bodies::{FLOOR_PX, link_of};
use crate::discover::circle::Circle;
use crate::rigid::pose::place;

/// Circles whose middles and radii differ by less are one, px, and the same as a part of the radius.
const SAME_PX: f64 = 1.5;
const SAME_PART: f64 = 0.03;
/// Part of the frames that a marker must be seen in.
const LEAST_PART: f64 = 0.1;
/// The same of one that goes about nothing.
const LONE_PART: f64 = 0.3;

/// A marker that goes about a point.
struct Hanging {
    holder: Option<usize>,
    middle: Vector2<f64>,
    radius_px: f64,
    tracklets: Vec<usize>,
}

/// Single markers, with their places as poses.
pub(super) fn hanging(evidence: &Evidence<'_>, bodies: &[TrackletBody], free: &[bool]) -> Vec<FoundBody> {
    let mut all: Vec<Hanging> = Vec::new();
    for t in (0..evidence.tracklets.len()).filter(|&t| free[t]) {
        let ground: Vec<(usize, Vector2<f64>)> =
            evidence.spans[t].clone().filter_map(|k| Some((k, evidence.place(t, k)?))).collect();
        let seen_from = std::iter::once((None, ground))
            .chain(bodies.iter().enumerate().map(|(b, body)| (Some(b), body.local(evidence, t).collect())));
        let best = seen_from
            .filter_map(|(holder, places): (Option<usize>, Vec<(usize, Vector2<f64>)>)| {
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
