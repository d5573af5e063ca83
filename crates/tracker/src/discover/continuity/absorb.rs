//! Gives tracklets to bodies that explain them.
//!
//! Owns: [`absorb`]. Must not: give a tracklet that two markers explain alike.

use nalgebra::Vector2;

use super::body::TrackletBody;
use super::evidence::Evidence;
use crate::discover::median::middle;

/// Distance within which a tracklet is at a marker's place in the body, px, and its scatter there.
const SAME_PX: f64 = 1.2;
const SCATTER_PX: f64 = 0.4;
/// Frames that show a new marker of the body.
const NEW_FRAMES: usize = 25;
/// All but 5 % of them are within this of its place, px.
const FAR_PX: f64 = 1.6;
/// Frames that show that a tracklet keeps its distances from single markers, and by how much half of them are off, px.
const DISTANCE_FRAMES: usize = 20;
const DISTANCE_PX: f64 = 0.3;
/// A rival must be worse by this, px.
const CLEAR_PX: f64 = 0.15;
/// Costs of a claim by distances alone, and of one to a new marker, px.
const DISTANCE_COST_PX: f64 = 0.3;
const NEW_COST_PX: f64 = 2.0;

/// A body's claim on a tracklet.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Claim {
    cost_px: f64,
    body: usize,
    /// `None` is a new one.
    marker: Option<usize>,
}

/// Gives tracklets that are `free` to bodies until nothing changes. Whether anything did.
pub(super) fn absorb(evidence: &Evidence<'_>, bodies: &mut [TrackletBody], free: &mut [bool]) -> bool {
    let mut changed = false;
    loop {
        let mut again = false;
        for (t, free) in free.iter_mut().enumerate().filter(|(_, free)| **free) {
            let mut claims: Vec<Claim> = Vec::new();
            for (body, b) in bodies.iter().enumerate() {
                claims.extend(by_pose(evidence, b, t).map(|(cost_px, marker)| Claim {
                    cost_px,
                    body,
                    marker,
                }));
                claims.extend(by_distance(evidence, b, t).map(|(cost_px, q)| Claim {
                    cost_px,
                    body,
                    marker: Some(q),
                }));
            }
            claims.sort_by(|a, b| a.cost_px.total_cmp(&b.cost_px));
            let Some(&best) = claims.first() else { continue };
            let rival = claims.iter().find(|c| {
                (c.body, c.marker) != (best.body, best.marker)
                    && !(c.body == best.body && (c.marker.is_none() || best.marker.is_none()))
            });
            if rival.is_some_and(|r| r.cost_px < best.cost_px + CLEAR_PX) {
                continue;
            }
            *free = false;
            again = true;
            let mut markers = std::mem::take(&mut bodies[best.body].markers);
            match best.marker {
                Some(q) => markers[q].push(t),
                None => markers.push(vec![t]),
            }
            bodies[best.body] = TrackletBody::fit(evidence, markers);
        }
        if !again {
            return changed;
        }
        changed = true;
    }
}

/// A claim by the body's poses: on a marker that is seen nowhere meanwhile, or on a new one.
fn by_pose(evidence: &Evidence<'_>, b: &TrackletBody, t: usize) -> Option<(f64, Option<usize>)> {
    let local: Vec<Vector2<f64>> = b.local(evidence, t).map(|l| l.1).collect();
    if local.len() < 3 {
        return None;
    }
    let at = middle(&local);
    let mut off: Vec<f64> = local.iter().map(|l| (l - at).norm()).collect();
    off.sort_by(f64::total_cmp);
    let scatter_px = off[off.len() / 2];
    let nearest =
        (0..b.shape.len()).map(|q| ((b.shape[q] - at).norm(), q)).min_by(|x, y| x.0.total_cmp(&y.0))?;
    if nearest.0 < SAME_PX && scatter_px < SCATTER_PX {
        return b.free(evidence, nearest.1, t).then_some((nearest.0 + scatter_px, Some(nearest.1)));
    }
    let limit_px = 3.0 * evidence.sigma_px + 0.05 + 0.001 * at.norm();
    let steady = local.len() >= NEW_FRAMES && scatter_px < limit_px && off[off.len() * 95 / 100] < FAR_PX;
    // Two markers of a body are not at one place.
    (steady && nearest.0 > 2.0 * SAME_PX).then_some((NEW_COST_PX + scatter_px, None))
}

/// A claim by the distances from the body's markers, one by one: of a body of two, one of which is hidden, no pose is
/// known.
fn by_distance(evidence: &Evidence<'_>, b: &TrackletBody, t: usize) -> Option<(f64, usize)> {
    (0..b.markers.len())
        .filter(|&q| b.free(evidence, q, t))
        .filter_map(|q| {
            let mut off: Vec<f64> = Vec::new();
            for (o, tracklets) in b.markers.iter().enumerate().filter(|(o, _)| *o != q) {
                let distance_px = (b.shape[o] - b.shape[q]).norm();
                for &other in tracklets {
                    off.extend(evidence.shared(t, other).filter_map(|k| {
                        let d = (evidence.place(t, k)? - evidence.place(other, k)?).norm();
                        Some((d - distance_px).abs())
                    }));
                }
            }
            off.sort_by(f64::total_cmp);
            let enough = off.len() >= DISTANCE_FRAMES;
            let cost_px = *off.get(off.len() / 2)?;
            let steady = cost_px < DISTANCE_PX && off[off.len() * 3 / 4] < 2.0 * DISTANCE_PX;
            (enough && steady).then_some((cost_px + DISTANCE_COST_PX, q))
        })
        .min_by(|x, y| x.0.total_cmp(&y.0))
}
