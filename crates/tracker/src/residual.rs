//! Computes how well the nodes of a table keep their places in their bodies, and how they move.
//!
//! Owns: [`NodeMotion`], [`residuals`]. Must not: change a table.

use nalgebra::Vector2;

use crate::rig::Rig;
use crate::rigid::body::Mechanism;
use crate::rigid::pose::{Pair, fit_pose, place};
use crate::table::Rows;

/// The residuals and speed of one node by a table. `None` where too little was seen.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct NodeMotion {
    /// Stretches without it after it was first seen.
    pub gaps: u64,
    /// Root mean square distance to its place in the body, px per coordinate, over frames with three nodes of the
    /// body seen or more. The body is as it stands in the rig file.
    pub residual_px: Option<f64>,
    /// Greatest step from frame to frame, px.
    pub fastest_px: Option<f64>,
}

/// For each node of the rig, in its order.
pub fn residuals(rig: &Rig, rows: &Rows) -> Vec<NodeMotion> {
    let mechanism = Mechanism::new(rig, 0.0);
    let n = rig.nodes.len();
    let mut out = vec![NodeMotion { gaps: 0, residual_px: None, fastest_px: None }; n];
    let mut squares = vec![(0.0, 0_u64); n];
    let mut last: Vec<Option<(usize, Vector2<f64>)>> = vec![None; n];
    for t in 0..rows.frames() {
        let at = |k: usize| {
            let p = Vector2::new(rows.xy_px[2 * (t * n + k)], rows.xy_px[2 * (t * n + k) + 1]);
            p.x.is_finite().then(|| rig.pixel_aspect.to_square(p))
        };
        for k in 0..n {
            let Some(p) = at(k) else { continue };
            if let Some((before, q)) = last[k] {
                if before + 1 == t {
                    let step = (p - q).norm();
                    out[k].fastest_px = Some(out[k].fastest_px.map_or(step, |f| f.max(step)));
                } else {
                    out[k].gaps += 1;
                }
            }
            last[k] = Some((t, p));
        }
        for link in &mechanism.links {
            let seen: Vec<(usize, Pair)> = link
                .nodes
                .iter()
                .zip(&link.template)
                .filter_map(|(&k, &local)| {
                    let sigma_px = f64::from(rows.sigma_px[t * n + k]).max(1e-3);
                    Some((k, Pair { local, place: at(k)?, sigma_px }))
                })
                .collect();
            if seen.len() < 3 {
                continue;
            }
            let pairs: Vec<Pair> = seen.iter().map(|s| s.1).collect();
            let Some(fit) = fit_pose(&pairs) else { continue };
            for (k, p) in seen {
                squares[k].0 += (place(&fit.pose, p.local) - p.place).norm_squared() / 2.0;
                squares[k].1 += 1;
            }
        }
    }
    for (o, (sum, count)) in out.iter_mut().zip(squares) {
        o.residual_px = (count > 0).then(|| (sum / count as f64).sqrt());
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synth::preset;
    use crate::track::tests::bed::{Bed, QUIET, hide};

    #[test]
    fn gaps_residuals_and_speed_are_those_of_the_film() {
        let mut scene = preset("clean", 2000).unwrap();
        scene.links.iter_mut().for_each(|l| l.width_px = 0.0);
        hide(&mut scene, 300, 20, &["n4"]);
        hide(&mut scene, 500, 7, &["n4"]);
        let bed = Bed::new(&scene, QUIET);
        let rig = bed.film.rig(0);
        let found = residuals(&rig, &bed.rows(&rig));
        assert!(found[4].gaps >= 2 && found[0].gaps < found[4].gaps, "{found:?}");
        for (k, f) in found.iter().enumerate() {
            // Noise of 0.03 px less what the pose takes up: three of 2 n numbers, and unevenly between the nodes.
            let residual = f.residual_px.unwrap();
            assert!(residual > 0.3 * 0.03 && residual < 1.2 * 0.03, "n{k} {residual}");
            let steps = bed.truth.frames.windows(2).map(|w| {
                let (a, b) = (&w[0].nodes[k], &w[1].nodes[k]);
                (b.x_px - a.x_px).hypot(b.y_px - a.y_px)
            });
            let fastest = steps.fold(0.0, f64::max);
            // Noise of two places, at most five standard deviations.
            assert!((f.fastest_px.unwrap() - fastest).abs() < 0.25, "n{k} {f:?} {fastest}");
        }
    }
}
