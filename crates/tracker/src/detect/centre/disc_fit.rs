//! Fits the centre of a disc by weighted least squares on the pixels of its edge: maximum likelihood for the noise
//! that was learned.
//!
//! Owns: [`DiscFit`], [`Fitted`]. Must not: decide what is a marker.
//!
//! The model is `base + height * coverage(pixel; x, y, radius)`; all five are free. Of a marker that moved during
//! the exposure the coverage is the mean along its path, whose two components are free as well. Only pixels near
//! the edge are used: they hold all that is known of the centre, and what is inside the marker or farther off (a
//! link's edge, a neighbour) does not matter. Dark markers are turned into bright ones by the sign of their values.

use std::array::from_fn;

use super::disc::Disc;
use super::edge_pixels::{Patch, Ring};
use super::normal_equations::{DiscModel, Factor, MOVING, Normal, STILL};
use crate::detect::settings::Polarity;
use crate::detect::simd::lanes::LANES;

/// A fitted disc.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Fitted {
    pub x_px: f64,
    pub y_px: f64,
    pub radius_px: f64,
    /// Brightness outside and its change to the inside, raw units.
    pub base: f64,
    pub height: f64,
    /// Standard uncertainty of x and y by the noise model, the greater of the two, px.
    pub sigma_px: f64,
    /// Standard uncertainty of the radius by the noise model, px.
    pub radius_sigma_px: f64,
    /// Weighted sum of squared residuals over its degrees of freedom.
    pub chi2: f64,
    /// Degrees of freedom: pixels less free numbers.
    pub freedom: f64,
    /// Root mean square residual, raw units.
    pub rms: f64,
    /// Pixels that were saturated.
    pub saturated: u32,
    /// Path of the centre during the exposure, px; zero where none shows.
    pub smear_px: [f64; 2],
}

impl Fitted {
    /// The disc.
    pub fn disc(&self) -> Disc {
        Disc { x_px: self.x_px, y_px: self.y_px, radius_px: self.radius_px }
    }
}

/// The fit of a disc: its model, and which pixels it takes.
#[derive(Clone, Copy)]
pub(crate) struct DiscFit<'a> {
    pub model: DiscModel<'a>,
    /// Pixels beyond the blurred edge, on both sides, that tell base and height.
    pub band_px: f64,
    /// Mean square of weighted residuals that markers of this recording usually have.
    pub usual_chi2: f64,
}

/// The first guess of a fit, with the numbers that the fit leaves alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Start {
    pub disc: Disc,
    /// Brightness outside and its change to the inside, raw units.
    pub base: f64,
    pub height: f64,
    /// Path of the centre during the exposure, px.
    pub smear_px: [f64; 2],
    /// Discs of neighbours.
    pub avoid: [Option<Disc>; 2],
}

/// A path shorter than this cannot be told from none, px.
pub(crate) const LEAST_PATH_PX: f64 = 0.3;

/// Rounds of Gauss-Newton; one is usual where a disc is alone, else two.
const ROUNDS: usize = 10;
/// The last step is the one after which the next would be below this part of the uncertainty.
const SETTLED: f64 = 0.2;
/// How far the first guess may be off before the pixels are chosen anew, px.
const SLACK_PX: f64 = 0.2;

impl DiscFit<'_> {
    /// Fits a disc from a start; `None` where it does not come to rest near it.
    pub fn fit(&self, patch: &Patch<'_>, start: &Start, ring: &mut Ring) -> Option<Fitted> {
        if start.smear_px == [0.0; 2] {
            self.settle::<STILL>(patch, start, ring)
        } else {
            self.settle::<MOVING>(patch, start, ring)
        }
    }

    fn settle<const N: usize>(&self, patch: &Patch<'_>, start: &Start, ring: &mut Ring) -> Option<Fitted> {
        let sign = self.model.polarity.sign();
        let Disc { x_px: x, y_px: y, radius_px: first_radius } = start.disc;
        let [path_x, path_y] = start.smear_px;
        // Where the pixels were chosen, and for a path of which length.
        let (mut origin, mut origin_path) = (start.disc, path_x.hypot(path_y));
        // Relative to it x and y, as they are radius, base, height and path.
        let all = [0.0, 0.0, first_radius, sign * start.base, sign * start.height, path_x, path_y];
        let mut p: [f64; N] = from_fn(|i| all[i]);
        let length = |x: f64, y: f64| (x * x + y * y).sqrt();
        let path = |p: &[f64; N]| if N == MOVING { length(p[N - 2], p[N - 1]) } else { 0.0 };
        self.choose(patch, origin, origin_path, &start.avoid, ring);
        let (mut round, mut chosen) = (0, 1);
        loop {
            if ring.used < 12 {
                return None;
            }
            let n = Normal::at(&self.model, ring, &p);
            let factor = Factor::new(&n.matrix)?;
            let step = factor.solve(&n.gradient);
            round += 1;
            let limit = 0.25 * first_radius.max(2.0);
            let scale = (limit / step[0].abs().max(step[1].abs()).max(step[2].abs())).min(1.0);
            for (v, s) in p.iter_mut().zip(&step) {
                *v += s * scale;
            }
            let at = [origin.x_px + p[0], origin.y_px + p[1]];
            let strayed = length(at[0] - x, at[1] - y) > 0.5 * first_radius + 1.0
                || p[2] < 0.5 * first_radius
                || p[2] > 1.6 * first_radius
                || p[4] <= 0.0
                || (N == MOVING && !(LEAST_PATH_PX..=2.5 * first_radius).contains(&path(&p)));
            if strayed || p.iter().any(|v| !v.is_finite()) {
                return None;
            }
            let off = length(p[0], p[1])
                + (p[2] - origin.radius_px).abs()
                + (0.5 * (path(&p) - origin_path)).max(0.0);
            if off > SLACK_PX && chosen < 4 {
                (origin, origin_path) = (Disc { x_px: at[0], y_px: at[1], radius_px: p[2] }, path(&p));
                p[0] = 0.0;
                p[1] = 0.0;
                self.choose(patch, origin, origin_path, &start.avoid, ring);
                chosen += 1;
                continue;
            }
            // Near the end each step is about the product of the one before with what else moved then; not so
            // where pixels come and go by saturation.
            let moved = length(step[0], step[1]) * scale;
            let else_moved = step[2].abs() + (step[4] / p[4]).abs() + if N == MOVING { moved } else { 0.0 };
            let next = if ring.saturated > 0 { moved } else { moved * (moved + else_moved) };
            let settled = next * next * (n.matrix[0][0] + n.matrix[1][1]) < 2.0 * SETTLED * SETTLED;
            if (settled && scale >= 1.0) || round >= ROUNDS {
                // What the last step gains.
                let chi2 = n.chi2 - step.iter().zip(&n.gradient).map(|(s, g)| s * g).sum::<f64>();
                let freedom = (n.count - N as f64).max(1.0);
                return Some(Fitted {
                    x_px: at[0],
                    y_px: at[1],
                    radius_px: p[2],
                    base: sign * p[3],
                    height: sign * p[4],
                    radius_sigma_px: factor.variance(2).sqrt(),
                    sigma_px: factor.variance(0).max(factor.variance(1)).sqrt(),
                    chi2: chi2.max(0.0) / freedom,
                    freedom,
                    rms: (n.squares / n.count.max(1.0)).sqrt(),
                    saturated: ring.saturated,
                    smear_px: if N == MOVING { [p[N - 2], p[N - 1]] } else { [0.0; 2] },
                });
            }
        }
    }

    /// Chooses the pixels near the edge of a disc that moved along a path of `path_px`.
    fn choose(
        &self,
        patch: &Patch<'_>,
        disc: Disc,
        path_px: f64,
        avoid: &[Option<Disc>; 2],
        ring: &mut Ring,
    ) {
        let Disc { x_px: cx, y_px: cy, radius_px: r } = disc;
        let reach = self.model.table.reach_px + SLACK_PX + path_px / 2.0 + self.band_px;
        let (outer, inner) = (r + reach, (r - reach).max(0.0));
        ring.choose(patch, [cx, cy], inner, outer);
        let filled = ring.used.next_multiple_of(LANES);
        if self.model.polarity == Polarity::Dark {
            ring.value[..filled].iter_mut().for_each(|v| *v = -*v);
        }
        if avoid.iter().any(Option::is_some) {
            // A pixel that shows, in part, a neighbour's disc.
            let near = self.model.table.reach_px + SLACK_PX;
            for i in 0..ring.used {
                let (x, y) = (cx + f64::from(ring.x[i]), cy + f64::from(ring.y[i]));
                let covers = |a: &Disc| (x - a.x_px).hypot(y - a.y_px) < a.radius_px + near;
                if avoid.iter().flatten().any(covers) {
                    ring.live[i] = 0.0;
                }
            }
        }
        if let Some(limit) = self.model.saturation {
            let limit = (limit * self.model.polarity.sign()) as f32;
            for (v, live) in ring.value[..ring.used].iter_mut().zip(&ring.live) {
                ring.saturated += u32::from(*v >= limit && *live > 0.0);
                *v = v.min(limit);
            }
        }
    }
}
