//! The centre of a disc by weighted least squares on the pixels of its edge: maximum likelihood for the noise
//! that was learned.
//!
//! Owns: [`DiscFit`], [`Fitted`]. Must not: decide what is a marker.
//!
//! The model is `base + height * coverage(pixel; x, y, radius)`; all five are free. Only pixels near the edge
//! are used: they hold all that is known of the centre, and what is inside the marker or farther off (a link's
//! edge, a neighbour) does not matter.

use nalgebra::{SMatrix, SVector};

use super::edge::EdgeTable;
use super::levels::{Noise, Side};

/// Heights of a rectangle of pixels, raw units.
pub(crate) struct Patch<'a> {
    pub values: &'a [f32],
    pub width: usize,
    /// Image coordinates of its first pixel.
    pub x0: f64,
    pub y0: f64,
}

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
    /// Weighted sum of squared residuals over its degrees of freedom.
    pub chi2: f64,
    /// Root mean square residual, raw units.
    pub rms: f64,
    /// Pixels used and pixels that were saturated.
    pub pixels: u32,
    pub saturated: u32,
}

/// What a fit needs beside the pixels.
pub(crate) struct DiscFit<'a> {
    pub table: &'a EdgeTable,
    pub noise: Noise,
    pub side: Side,
    pub saturation: Option<f64>,
}

/// Pixels beyond the blurred edge, on both sides, that tell base and height.
const BAND_PX: f64 = 1.25;
/// Rounds of Gauss-Newton; two or three are used.
const ROUNDS: usize = 12;

#[derive(Default)]
struct Normal {
    a: [[f64; 5]; 5],
    b: [f64; 5],
    chi2: f64,
    squares: f64,
    pixels: u32,
    saturated: u32,
}

impl DiscFit<'_> {
    /// Whether a value is at the end of the recording's range on the markers' side.
    pub fn saturated(&self, value: f64) -> bool {
        self.saturation.is_some_and(|limit| match self.side {
            Side::Bright => value >= limit,
            Side::Dark => value <= limit,
        })
    }

    /// Fits a disc from a start `[x, y, radius, base, height]`; `None` where it does not come to rest near it.
    pub fn fit(&self, patch: &Patch<'_>, start: [f64; 5]) -> Option<Fitted> {
        let mut p = start;
        let mut round = 0;
        loop {
            let n = self.normal(patch, &p);
            if n.pixels < 12 {
                return None;
            }
            let (step, covariance): ([f64; 5], [f64; 5]) = solve(&n.a, &n.b)?;
            round += 1;
            let limit = 0.25 * start[2].max(2.0);
            let scale = (limit / step[0].abs().max(step[1].abs()).max(step[2].abs())).min(1.0);
            let moved = step[0].hypot(step[1]) * scale;
            let sigma = covariance[0].max(covariance[1]).sqrt();
            let settled = moved < 0.05 * sigma || moved < 1e-4;
            for (v, s) in p.iter_mut().zip(step) {
                *v += s * scale;
            }
            let strayed = (p[0] - start[0]).hypot(p[1] - start[1]) > 0.5 * start[2] + 1.0
                || p[2] < 0.5 * start[2]
                || p[2] > 1.6 * start[2]
                || p[4] * self.side.sign() <= 0.0;
            if strayed || p.iter().any(|v| !v.is_finite()) {
                return None;
            }
            if settled || round == ROUNDS {
                let free = f64::from(n.pixels.saturating_sub(5).max(1));
                return Some(Fitted {
                    x_px: p[0],
                    y_px: p[1],
                    radius_px: p[2],
                    base: p[3],
                    height: p[4],
                    sigma_px: sigma,
                    chi2: n.chi2 / free,
                    rms: (n.squares / f64::from(n.pixels)).sqrt(),
                    pixels: n.pixels,
                    saturated: n.saturated,
                });
            }
        }
    }

    /// Normal equations at a place.
    fn normal(&self, patch: &Patch<'_>, p: &[f64; 5]) -> Normal {
        let [cx, cy, r, base, height] = *p;
        let mut n = Normal::default();
        let band = self.table.reach_px + BAND_PX;
        let (outer, inner) = (r + band, (r - band).max(0.0));
        let rows = patch.values.len() / patch.width;
        let first = (cy - outer - patch.y0).ceil().max(0.0) as usize;
        let last = ((cy + outer - patch.y0).floor() as usize + 1).min(rows);
        for j in first..last {
            let dy = patch.y0 + j as f64 - cy;
            let reach = (outer * outer - dy * dy).max(0.0).sqrt();
            let hole = (inner * inner - dy * dy).max(0.0).sqrt();
            let from = (cx - reach - patch.x0).ceil().max(0.0) as usize;
            let to = ((cx + reach - patch.x0).floor() as usize + 1).min(patch.width);
            for i in from..to {
                let dx = patch.x0 + i as f64 - cx;
                if dx.abs() < hole {
                    continue;
                }
                let rho = dx.hypot(dy).max(1e-6);
                let (c, s) = (dx / rho, dy / rho);
                let (cover, slope) = self.table.at((r - rho) as f32, c.abs().min(s.abs()) as f32);
                let (cover, slope) = (f64::from(cover), f64::from(slope));
                let mut model = base + height * cover;
                let value = f64::from(patch.values[j * patch.width + i]);
                if let Some(limit) = self.saturation {
                    if self.saturated(value) {
                        n.saturated += 1;
                        if self.saturated(model) {
                            continue;
                        }
                    } else if self.saturated(model) {
                        model = limit;
                    }
                }
                let w = 1.0 / self.noise.variance(model);
                let e = value - model;
                let g = height * slope;
                let jacobian = [g * c, g * s, g, 1.0, cover];
                for (k, jk) in jacobian.iter().enumerate() {
                    let wj = w * jk;
                    n.b[k] += wj * e;
                    for (l, jl) in jacobian.iter().enumerate().take(k + 1) {
                        n.a[k][l] += wj * jl;
                    }
                }
                n.chi2 += w * e * e;
                n.squares += e * e;
                n.pixels += 1;
            }
        }
        n
    }
}

/// Solves `a x = b` for a symmetric positive matrix given by its lower triangle; also the diagonal of its
/// inverse. `None` where it is not positive.
fn solve(a: &[[f64; 5]; 5], b: &[f64; 5]) -> Option<([f64; 5], [f64; 5])> {
    let full = SMatrix::<f64, 5, 5>::from_fn(|i, j| a[i.max(j)][i.min(j)]);
    let factor = full.cholesky()?;
    let step = factor.solve(&SVector::<f64, 5>::from_row_slice(b));
    let inverse = factor.inverse();
    Some((step.into(), inverse.diagonal().into()))
}
