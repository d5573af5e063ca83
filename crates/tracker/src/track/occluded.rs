//! Finds half hidden markers: the detection beside the place that a firm body gives a node not seen.
//!
//! Owns: [`find_occluded`]. Must not: move a pose (what is beside is no part of it).
//!
//! A blob in which markers run together shows all of them of which its area leaves a half, each at the place that its
//! own body gives it.

use std::f64::consts::PI;

use nalgebra::Vector2;

use super::seen::{BodySeen, Occluded};
use crate::detect::Flags;
use crate::rigid::body::{LEAST_PART, Link, Mechanism};
use crate::rigid::index::DetectionIndex;
use crate::rigid::pose::place;

/// How far the centre of a marker that is at least half seen may be from the marker's, in radii: that of half a
/// disc is 0.42 from its centre.
const BESIDE_RADII: f64 = 0.5;
/// Greatest distance of the centres where the marker's size is not known, px.
const BESIDE_PX: f64 = 2.0;
/// Discs no farther apart than this run together in the picture, px: blur and the threshold's edge.
const TOUCH_PX: f64 = 2.0;
/// How well a node's place must be known for a detection beside it to be its, px.
const FIRM_PX: f64 = 0.3;

/// Finds half hidden markers: where a body's pose is firm, the detection beside the place of a node not seen.
pub fn find_occluded(
    mechanism: &Mechanism,
    body: usize,
    index: &DetectionIndex<'_>,
    free: &mut [bool],
    seen: &mut [BodySeen],
) {
    for j in 0..mechanism.links[body].nodes.len() {
        if let Some(found) = occluded(mechanism, (body, j), index, free, seen) {
            free[found.detection] = false;
            seen[body].occluded[j] = Some(found);
        }
    }
}

/// The detection beside the place of a node not seen, if its body's pose is firm.
fn occluded(
    mechanism: &Mechanism,
    (body, j): (usize, usize),
    index: &DetectionIndex<'_>,
    free: &[bool],
    seen: &[BodySeen],
) -> Option<Occluded> {
    let link = &mechanism.links[body];
    if seen[body].picks.get(j).is_none_or(Option::is_some) {
        return None;
    }
    let there = firm_place(link, &seen[body], j)?;
    let (usual, scatter) = link.area_px[j];
    let radius = (usual / PI).sqrt();
    let near = if usual > 0.0 { BESIDE_RADII * radius } else { BESIDE_PX };
    let found = |detection: usize| Occluded { detection, place: there, off: index.place(detection) - there };
    let (d, r) = index.nearest(there, near.max(2.0 * radius))?;
    let part = index.get(d);
    let area_px = f64::from(part.area_px);
    if part.flags.has(Flags::MERGED) {
        // Only where every marker that may be in it is known is it told what of it is whose.
        let company = company(mechanism, (body, j), there, d, seen)?;
        if !company.is_empty() {
            let others: f64 = company.iter().map(|c| c.1).sum();
            let own = area_px - others;
            let picked = seen.iter().any(|s| s.picks.contains(&Some(d)));
            if picked || own < LEAST_PART * usual + 3.0 * scatter {
                return None;
            }
            // Its centre is that of all of them.
            let own = own.min(usual);
            let sum = company.iter().map(|c| c.1 * c.0).sum::<Vector2<f64>>() + own * there;
            let off = (sum / (others + own) - index.place(d)).norm();
            return (off <= near).then(|| found(d));
        }
        if area_px > usual + 4.0 * scatter {
            return None;
        }
    }
    // The more is hidden, the farther off is the rest: what is whole is not beside.
    let hidden = (1.0 - (area_px - 3.0 * scatter) / usual).max(0.0);
    let most = radius * (1.1 * hidden + 0.1) + 4.0 * f64::from(part.sigma_px);
    let off = usual == 0.0 || r <= most;
    let fit = seen[body].fit.as_ref()?;
    let nearer = link
        .template
        .iter()
        .enumerate()
        .any(|(k, &t)| k != j && (place(&fit.pose, t) - index.place(d)).norm() < r);
    (r <= near && free[d] && off && !nearer).then(|| found(d))
}

/// The place of a node by its body's pose, if the pose is known firmly.
pub(super) fn firm_place(link: &Link, seen: &BodySeen, j: usize) -> Option<Vector2<f64>> {
    let local = link.template[j];
    seen.fit.as_ref().filter(|f| f.sigma_at(local) <= FIRM_PX).map(|f| place(&f.pose, local))
}

/// The other markers that may be in the blob `d` with a node at `there`, each with its area; `None` where that is not
/// known of all.
fn company(
    mechanism: &Mechanism,
    (body, j): (usize, usize),
    there: Vector2<f64>,
    d: usize,
    seen: &[BodySeen],
) -> Option<Vec<(Vector2<f64>, f64)>> {
    let radius = |area_px: f64| (area_px / PI).sqrt();
    let own = radius(mechanism.links[body].area_px[j].0);
    let mut out = Vec::new();
    for (o, (link, s)) in mechanism.links.iter().zip(seen).enumerate() {
        for k in 0..link.nodes.len() {
            let elsewhere = s.picks.get(k).copied().flatten().is_some_and(|p| p != d);
            if (o, k) == (body, j) || elsewhere {
                continue;
            }
            let place = firm_place(link, s, k)?;
            let area_px = link.area_px[k].0;
            if area_px <= 0.0 {
                return None;
            }
            if (place - there).norm() < own + radius(area_px) + TOUCH_PX {
                out.push((place, area_px));
            }
        }
    }
    Some(out)
}
