//! Half hidden markers: the detection beside the place that a firm body gives a node not seen.
//!
//! Owns: [`Beside`], [`look_beside`]. Must not: move a pose (what is beside is no part of it).

use nalgebra::Vector2;

use super::engine::BodySeen;
use super::mechanism::Link;
use super::nearest::Sky;
use super::rigid::place;
use crate::detect::Flags;

/// How far the centre of a marker that is at least half seen may be from the marker's, in radii: that of half a
/// disc is 0.42 from its centre.
const BESIDE_RADII: f64 = 0.5;
/// The same where the marker's size is not known, px.
const BESIDE_PX: f64 = 2.0;
/// How well a node's place must be known for a detection beside it to be its, px.
const FIRM_PX: f64 = 0.3;

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

/// Finds half hidden markers: where a body's pose is firm, the detection beside the place of a node not seen.
pub fn look_beside(link: &Link, sky: &Sky<'_>, free: &mut [bool], seen: &mut BodySeen) {
    let Some(fit) = &seen.fit else { return };
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
        if part.flags.has(Flags::MERGED) {
            // It may all be the other marker.
            continue;
        }
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
