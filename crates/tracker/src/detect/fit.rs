//! The centre of a disc by weighted least squares on the pixels of its edge: maximum likelihood for the noise
//! that was learned.
//!
//! Owns: [`DiscFit`], [`Fitted`], [`Ring`]. Must not: decide what is a marker.
//!
//! The model is `base + height * coverage(pixel; x, y, radius)`; all five are free. Only pixels near the edge
//! are used: they hold all that is known of the centre, and what is inside the marker or farther off (a link's
//! edge, a neighbour) does not matter. Dark markers are turned into bright ones by the sign of their values.

use std::array::from_fn;

use nalgebra::{SMatrix, SVector};

use super::edge::EdgeTable;
use super::levels::{Noise, Side};

/// A rectangle of pixels, raw units.
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
    /// Pixels that were saturated.
    pub saturated: u32,
    /// Path of the centre during the exposure, px; zero where none shows.
    pub smear_px: [f64; 2],
}

/// What a fit needs beside the pixels.
#[derive(Clone, Copy)]
pub(crate) struct DiscFit<'a> {
    pub table: &'a EdgeTable,
    pub noise: Noise,
    pub side: Side,
    pub saturation: Option<f64>,
    /// Pixels beyond the blurred edge, on both sides, that tell base and height.
    pub band_px: f64,
    /// Mean square of weighted residuals that markers of this recording usually have.
    pub usual_chi2: f64,
}

/// Where a fit begins and what it leaves alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Start {
    /// `[x, y, radius, base, height]`.
    pub disc: [f64; 5],
    /// Path of the centre during the exposure, px.
    pub smear_px: [f64; 2],
    /// Discs of neighbours, `[x, y, radius]`; a radius of 0 is none.
    pub avoid: [[f64; 3]; 2],
}

/// Places along the path of a smeared disc; 0.6 px apart they cannot be told from a line.
const SHIFTS: usize = 7;

/// Rounds of Gauss-Newton; two or three are used.
const ROUNDS: usize = 8;
/// A step below this part of the uncertainty is the last: the next would be far smaller.
const SETTLED: f64 = 0.3;
/// How far the first guess may be off before the pixels are chosen anew, px.
const SLACK_PX: f64 = 0.35;

/// Pixels around an edge, relative to the first guess of the centre, eight by eight; `live` is 0 for those that
/// fill up the last eight.
#[derive(Debug, Default)]
pub(crate) struct Ring {
    eights: Vec<[[f32; 8]; 4]>,
    /// Number, sum and sum of squares of values relative to the first base: of pixels outside, inside.
    flat: [[f64; 3]; 2],
    used: u32,
    saturated: u32,
}

/// `line_k * line_l * weight` for k <= l, where a line is the model's derivatives by x, y, radius, base and
/// height, then the residual.
const PRODUCTS: usize = 21;

struct Normal {
    sums: [f64; PRODUCTS],
    squares: f64,
}

fn product(k: usize, l: usize) -> usize {
    let (k, l) = (k.min(l), k.max(l));
    k * 6 - k * (k + 1) / 2 + l
}

impl Ring {
    fn push(&mut self, dx: f32, dy: f32, value: f32) {
        let lane = self.used as usize % 8;
        if lane == 0 {
            // Fillers lie far outside, where nothing has a slope.
            self.eights.push([[1.0; 8], [1.0; 8], [0.0; 8], [0.0; 8]]);
        }
        if let Some(last) = self.eights.last_mut() {
            last[0][lane] = dx;
            last[1][lane] = dy;
            last[2][lane] = value;
            last[3][lane] = 1.0;
        }
        self.used += 1;
    }
}

impl DiscFit<'_> {
    /// Whether a value is at the end of the recording's range on the markers' side.
    pub fn saturated(&self, value: f64) -> bool {
        self.saturation.is_some_and(|limit| match self.side {
            Side::Bright => value >= limit,
            Side::Dark => value <= limit,
        })
    }

    /// Fits a disc from a start; `None` where it does not come to rest near it.
    pub fn fit(&self, patch: &Patch<'_>, start: &Start, ring: &mut Ring) -> Option<Fitted> {
        let sign = self.side.sign();
        let mut origin = start.disc;
        origin[3] *= sign;
        origin[4] *= sign;
        let first = origin;
        // Relative to the origin: x, y; as they are: radius, base, height.
        let mut p = [0.0, 0.0, origin[2], origin[3], origin[4]];
        self.choose(patch, &origin, start, ring);
        let (mut round, mut chosen) = (0, 1);
        loop {
            if ring.used < 12 {
                return None;
            }
            let n = self.normal(ring, &p, origin[3], start.smear_px);
            let matrix = SMatrix::<f64, 5, 5>::from_fn(|i, j| n.sums[product(i, j)]);
            let factor = matrix.cholesky()?;
            let step = factor.solve(&SVector::<f64, 5>::from_fn(|i, _| n.sums[product(i, 5)]));
            round += 1;
            let limit = 0.25 * first[2].max(2.0);
            let scale = (limit / step[0].abs().max(step[1].abs()).max(step[2].abs())).min(1.0);
            let moved = step[0].hypot(step[1]) * scale;
            let settled = moved * moved * (n.sums[product(0, 0)] + n.sums[product(1, 1)])
                < 2.0 * SETTLED * SETTLED
                || moved < 1e-4;
            for (v, s) in p.iter_mut().zip(&step) {
                *v += s * scale;
            }
            let at = [origin[0] + p[0], origin[1] + p[1]];
            let strayed = (at[0] - first[0]).hypot(at[1] - first[1]) > 0.5 * first[2] + 1.0
                || p[2] < 0.5 * first[2]
                || p[2] > 1.6 * first[2]
                || p[4] <= 0.0;
            if strayed || p.iter().any(|v| !v.is_finite()) {
                return None;
            }
            if p[0].hypot(p[1]) + (p[2] - origin[2]).abs() > SLACK_PX && chosen < 4 {
                origin = [at[0], at[1], p[2], p[3], p[4]];
                p[0] = 0.0;
                p[1] = 0.0;
                self.choose(patch, &origin, start, ring);
                chosen += 1;
                continue;
            }
            if settled || round >= ROUNDS {
                let all = f64::from(ring.used) + ring.flat[0][0] + ring.flat[1][0];
                let inverse = factor.inverse();
                return Some(Fitted {
                    x_px: at[0],
                    y_px: at[1],
                    radius_px: p[2],
                    base: sign * p[3],
                    height: sign * p[4],
                    sigma_px: inverse[(0, 0)].max(inverse[(1, 1)]).sqrt(),
                    chi2: n.sums[product(5, 5)].max(0.0) / (all - 5.0).max(1.0),
                    rms: (n.squares.max(0.0) / all).sqrt(),
                    saturated: ring.saturated,
                    smear_px: start.smear_px,
                });
            }
        }
    }

    /// Chooses the pixels near the edge of a disc: those on it one by one, those beside it in sums.
    fn choose(&self, patch: &Patch<'_>, disc: &[f64; 5], start: &Start, ring: &mut Ring) {
        let [cx, cy, r, base, _] = *disc;
        ring.eights.clear();
        ring.flat = [[0.0; 3]; 2];
        ring.used = 0;
        ring.saturated = 0;
        let path = start.smear_px[0].hypot(start.smear_px[1]);
        let edge = self.table.reach_px + SLACK_PX + path / 2.0;
        let (outer, inner) = (r + edge + self.band_px, (r - edge - self.band_px).max(0.0));
        let near = (((r + edge) * (r + edge)) as f32, ((r - edge).max(0.0) * (r - edge).max(0.0)) as f32);
        let (sign, base) = (self.side.sign() as f32, base as f32);
        let limit = self.saturation.map_or(f32::INFINITY, |l| l as f32 * sign);
        let guard = start.avoid.iter().any(|a| a[2] > 0.0);
        let rows = patch.values.len() / patch.width;
        let first = (cy - outer - patch.y0).ceil().max(0.0) as usize;
        let last = ((cy + outer - patch.y0).floor() as usize + 1).min(rows);
        for j in first..last {
            let dy = patch.y0 + j as f64 - cy;
            let reach = (outer * outer - dy * dy).max(0.0).sqrt();
            let hole = (inner * inner - dy * dy).max(0.0).sqrt();
            let clip = |x: f64| (x.max(0.0) as usize).min(patch.width);
            let left = cx - patch.x0;
            let row = &patch.values[j * patch.width..(j + 1) * patch.width];
            let (a, d) = (clip((left - reach).ceil()), clip((left + reach).floor() + 1.0));
            let (b, c) = (clip((left - hole).floor() + 1.0), clip((left + hole).ceil()));
            // Left and right of the hole, or all of it.
            let parts =
                if hole > 0.0 && b < c { [(a, b.max(a)), (c, d.max(c))] } else { [(a, d.max(a)), (0, 0)] };
            let dy = dy as f32;
            for (from, to) in parts {
                let mut dx = (from as f64 - left) as f32;
                let mut sums = [[0.0f32; 3]; 2];
                for &value in &row[from..to] {
                    let q = dx * dx + dy * dy;
                    let v = value * sign;
                    if guard && self.belongs_to_another(start, cx + f64::from(dx), cy + f64::from(dy)) {
                        dx += 1.0;
                        continue;
                    }
                    if v >= limit {
                        ring.saturated += 1;
                    }
                    if q < near.0 && q > near.1 {
                        ring.push(dx, dy, v.min(limit));
                    } else if v < limit {
                        // A saturated pixel inside says nothing.
                        let s = &mut sums[usize::from(q <= near.1)];
                        let h = v - base;
                        s[0] += 1.0;
                        s[1] += h;
                        s[2] += h * h;
                    }
                    dx += 1.0;
                }
                for (all, part) in ring.flat.iter_mut().zip(sums) {
                    for (a, s) in all.iter_mut().zip(part) {
                        *a += f64::from(s);
                    }
                }
            }
        }
    }

    /// Whether a pixel shows, in part, a neighbour's disc.
    fn belongs_to_another(&self, start: &Start, x: f64, y: f64) -> bool {
        start
            .avoid
            .iter()
            .any(|a| a[2] > 0.0 && (x - a[0]).hypot(y - a[1]) < a[2] + self.table.reach_px + SLACK_PX)
    }

    /// Normal equations at a place; single precision holds a place inside the patch to 1e-6 px.
    fn normal(&self, ring: &Ring, p: &[f64; 5], flat_base: f64, smear_px: [f64; 2]) -> Normal {
        let sign = self.side.sign();
        let [x, y, r, base, height] = p.map(|v| v as f32);
        let (read, shot, dark) = (self.noise.read as f32, self.noise.shot as f32, self.noise.dark as f32);
        let sign32 = sign as f32;
        let limit = self.saturation.map_or(f32::INFINITY, |l| l as f32 * sign32);
        // A smeared disc is the mean of discs along its path.
        let count = if smear_px == [0.0; 2] { 1 } else { SHIFTS };
        let share = 1.0 / count as f32;
        let shifts: [[f32; 2]; SHIFTS] = from_fn(|k| {
            let part = ((k as f32 + 0.5) * share - 0.5) * f32::from(u8::from(count > 1));
            [x + part * smear_px[0] as f32, y + part * smear_px[1] as f32]
        });
        let mut sums = [[0.0f32; 8]; PRODUCTS];
        let mut squares = [0.0f32; 8];
        for [px, py, value, live] in &ring.eights {
            let (mut cover, mut slope, mut gc, mut gs) = ([0.0; 8], [0.0; 8], [0.0; 8], [0.0; 8]);
            for [sx, sy] in &shifts[..count] {
                let dx: [f32; 8] = from_fn(|i| px[i] - sx);
                let dy: [f32; 8] = from_fn(|i| py[i] - sy);
                let rho: [f32; 8] = from_fn(|i| (dx[i] * dx[i] + dy[i] * dy[i]).max(1e-12).sqrt());
                let c: [f32; 8] = from_fn(|i| dx[i] / rho[i]);
                let s: [f32; 8] = from_fn(|i| dy[i] / rho[i]);
                let minor: [f32; 8] = from_fn(|i| c[i].abs().min(s[i].abs()));
                let (part, rise) = self.table.at(rho.map(|rho| r - rho), minor);
                for i in 0..8 {
                    cover[i] += part[i] * share;
                    let rise = rise[i] * share;
                    slope[i] += rise;
                    gc[i] += rise * c[i];
                    gs[i] += rise * s[i];
                }
            }
            let full: [f32; 8] = from_fn(|i| base + height * cover[i]);
            let model = full.map(|m| m.min(limit));
            let w: [f32; 8] = from_fn(|i| {
                // Saturated in the model and in the picture: nothing to learn.
                let open = if full[i] < limit || value[i] < limit { live[i] } else { 0.0 };
                open / (read + shot * (sign32 * model[i] - dark).max(0.0))
            });
            let g: [f32; 8] = from_fn(|i| height * slope[i]);
            let e: [f32; 8] = from_fn(|i| value[i] - model[i]);
            let line = [gc.map(|v| v * height), gs.map(|v| v * height), g, [1.0; 8], cover, e];
            let mut at = 0;
            for k in 0..6 {
                let wk: [f32; 8] = from_fn(|i| w[i] * line[k][i]);
                for l in &line[k..] {
                    for i in 0..8 {
                        sums[at][i] += wk[i] * l[i];
                    }
                    at += 1;
                }
            }
            for i in 0..8 {
                squares[i] += live[i] * e[i] * e[i];
            }
        }
        let mut n = Normal {
            sums: sums.map(|s| s.iter().map(|&v| f64::from(v)).sum()),
            squares: squares.iter().map(|&v| f64::from(v)).sum(),
        };
        // Pixels beside the edge: coverage 0 or 1, no slope.
        for (inside, [count, sum, square]) in ring.flat.iter().enumerate() {
            let cover = inside as f64;
            let model = p[3] + cover * p[4];
            let w = 1.0 / self.noise.variance(sign * model);
            let off = model - flat_base;
            let error = sum - count * off;
            let squared = square - 2.0 * off * sum + count * off * off;
            n.sums[product(3, 3)] += w * count;
            n.sums[product(3, 4)] += w * count * cover;
            n.sums[product(4, 4)] += w * count * cover;
            n.sums[product(3, 5)] += w * error;
            n.sums[product(4, 5)] += w * error * cover;
            n.sums[product(5, 5)] += w * squared;
            n.squares += squared;
        }
        n
    }
}
