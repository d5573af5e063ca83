//! The centre of a disc by weighted least squares on the pixels of its edge: maximum likelihood for the noise
//! that was learned.
//!
//! Owns: [`DiscFit`], [`Fitted`], [`Ring`]. Must not: decide what is a marker.
//!
//! The model is `base + height * coverage(pixel; x, y, radius)`; all five are free. Of a marker that moved during
//! the exposure the coverage is the mean along its path, whose two components are free as well. Only pixels near
//! the edge are used: they hold all that is known of the centre, and what is inside the marker or farther off (a
//! link's edge, a neighbour) does not matter. Dark markers are turned into bright ones by the sign of their values.

use std::array::from_fn;

use nalgebra::{SMatrix, SVector};
use wide::f32x8;

use super::edge::{EdgeTable, LANES};
use super::levels::{Noise, Side};

/// A rectangle of pixels, raw units; behind the last pixel come [`LANES`] more values that mean nothing.
pub(crate) struct Patch<'a> {
    pub values: &'a [f32],
    pub width: usize,
    pub height: usize,
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
    /// Standard uncertainty of the radius by the noise model, px.
    pub radius_sigma_px: f64,
    /// Weighted sum of squared residuals over its degrees of freedom.
    pub chi2: f64,
    /// Those: pixels less free numbers.
    pub freedom: f64,
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

/// Free numbers of a disc that stands still and of one that moves.
const STILL: usize = 5;
const MOVING: usize = 7;

/// Distance of the places along a path whose mean stands for it, px, and how many there may be: closer ones
/// cannot be told from a line.
const SHIFT_PX: f64 = 0.45;
const MOST_SHIFTS: usize = 32;
/// A path shorter than this cannot be told from none, px.
pub(crate) const LEAST_PATH_PX: f64 = 0.3;

const STEPS: f32x8 = f32x8::new([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);

/// Rounds of Gauss-Newton; two are usual.
const ROUNDS: usize = 10;
/// The last step is the one after which the next would be below this part of the uncertainty.
const SETTLED: f64 = 0.2;
/// How far the first guess may be off before the pixels are chosen anew, px.
const SLACK_PX: f64 = 0.2;

/// Pixels around an edge: place relative to the first guess of the centre, value, and 1 where it counts.
#[derive(Debug, Default)]
pub(crate) struct Ring {
    x: Vec<f32>,
    y: Vec<f32>,
    value: Vec<f32>,
    live: Vec<f32>,
    used: usize,
    saturated: u32,
}

/// `line_k * line_l * weight` for k <= l, where a line is the model's derivative by one of its numbers, or last
/// the residual.
const PRODUCTS: usize = (MOVING + 1) * (MOVING + 2) / 2;

/// Where the product of lines k <= l is.
const fn place(k: usize, l: usize, n: usize) -> usize {
    k * (n + 1) - k * (k + 1) / 2 + l
}

/// Adds line K's products; a function for each line, so that all indices are constants.
#[inline(always)]
fn products<const K: usize, const N: usize>(
    sums: &mut [f32x8; PRODUCTS],
    w: f32x8,
    line: &[f32x8; MOVING + 1],
) {
    if K > N {
        return;
    }
    let weighted = w * line[K];
    for l in K..=N {
        sums[place(K, l, N)] += weighted * line[l];
    }
}

struct Normal<const N: usize> {
    matrix: SMatrix<f64, N, N>,
    gradient: SVector<f64, N>,
    chi2: f64,
    squares: f64,
    count: f64,
}

impl Ring {
    fn begin(&mut self, most: usize) {
        for lanes in [&mut self.x, &mut self.y, &mut self.value, &mut self.live] {
            if lanes.len() < most {
                lanes.resize(most, 0.0);
            }
        }
        self.used = 0;
        self.saturated = 0;
    }

    /// `count` pixels of a row from `values` on, the first at `x`; up to seven beyond are written too and then
    /// overwritten by those that follow.
    fn push(&mut self, x: f32, y: f32, values: &[f32], count: usize) {
        for k in (0..count).step_by(LANES) {
            let (at, first) = (self.used + k, x + k as f32);
            let to = at..at + LANES;
            self.x[to.clone()].copy_from_slice(&(f32x8::splat(first) + STEPS).to_array());
            self.y[to.clone()].copy_from_slice(&[y; LANES]);
            self.live[to.clone()].copy_from_slice(&[1.0; LANES]);
            self.value[to].copy_from_slice(&values[k..k + LANES]);
        }
        self.used += count;
    }

    fn eights(&self) -> impl Iterator<Item = [f32x8; 4]> {
        let n = self.used.div_ceil(LANES);
        let part = |v| <[f32]>::as_chunks::<LANES>(v).0.iter().take(n).map(|&eight| f32x8::new(eight));
        part(&self.x)
            .zip(part(&self.y))
            .zip(part(&self.value).zip(part(&self.live)))
            .map(|((x, y), (value, live))| [x, y, value, live])
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
        if start.smear_px == [0.0; 2] {
            self.settle::<STILL>(patch, start, ring)
        } else {
            self.settle::<MOVING>(patch, start, ring)
        }
    }

    fn settle<const N: usize>(&self, patch: &Patch<'_>, start: &Start, ring: &mut Ring) -> Option<Fitted> {
        let sign = self.side.sign();
        let [x, y, first_radius, base, height] = start.disc;
        let [path_x, path_y] = start.smear_px;
        // Where the pixels were chosen: x, y, radius, length of the path.
        let mut origin = [x, y, first_radius, path_x.hypot(path_y)];
        // Relative to it x and y, as they are radius, base, height and path.
        let all = [0.0, 0.0, first_radius, sign * base, sign * height, path_x, path_y];
        let mut p: [f64; N] = from_fn(|i| all[i]);
        let path = |p: &[f64; N]| if N == MOVING { p[N - 2].hypot(p[N - 1]) } else { 0.0 };
        self.choose(patch, &origin, &start.avoid, ring);
        let (mut round, mut chosen) = (0, 1);
        loop {
            if ring.used < 12 {
                return None;
            }
            let n = self.normal::<N>(ring, &p);
            let factor = n.matrix.cholesky()?;
            let step = factor.solve(&n.gradient);
            round += 1;
            let limit = 0.25 * first_radius.max(2.0);
            let scale = (limit / step[0].abs().max(step[1].abs()).max(step[2].abs())).min(1.0);
            for (v, s) in p.iter_mut().zip(&step) {
                *v += s * scale;
            }
            let at = [origin[0] + p[0], origin[1] + p[1]];
            let strayed = (at[0] - x).hypot(at[1] - y) > 0.5 * first_radius + 1.0
                || p[2] < 0.5 * first_radius
                || p[2] > 1.6 * first_radius
                || p[4] <= 0.0
                || (N == MOVING && !(LEAST_PATH_PX..=2.5 * first_radius).contains(&path(&p)));
            if strayed || p.iter().any(|v| !v.is_finite()) {
                return None;
            }
            let off = p[0].hypot(p[1]) + (p[2] - origin[2]).abs() + (0.5 * (path(&p) - origin[3])).max(0.0);
            if off > SLACK_PX && chosen < 4 {
                origin = [at[0], at[1], p[2], path(&p)];
                p[0] = 0.0;
                p[1] = 0.0;
                self.choose(patch, &origin, &start.avoid, ring);
                chosen += 1;
                continue;
            }
            // Near the end each step is about the product of the one before with what else moved then; not so
            // where pixels come and go by saturation.
            let moved = step[0].hypot(step[1]) * scale;
            let else_moved = step[2].abs() + (step[4] / p[4]).abs() + if N == MOVING { moved } else { 0.0 };
            let next = if ring.saturated > 0 { moved } else { moved * (moved + else_moved) };
            let settled = next * next * (n.matrix[(0, 0)] + n.matrix[(1, 1)]) < 2.0 * SETTLED * SETTLED;
            if (settled && scale >= 1.0) || round >= ROUNDS {
                let unit = |i: usize| SVector::<f64, N>::from_fn(|k, _| f64::from(u8::from(k == i)));
                let variance = |i: usize| factor.solve(&unit(i))[i];
                // What the last step gains.
                let chi2 = n.chi2 - step.dot(&n.gradient);
                let freedom = (n.count - N as f64).max(1.0);
                return Some(Fitted {
                    x_px: at[0],
                    y_px: at[1],
                    radius_px: p[2],
                    base: sign * p[3],
                    height: sign * p[4],
                    radius_sigma_px: variance(2).sqrt(),
                    sigma_px: variance(0).max(variance(1)).sqrt(),
                    chi2: chi2.max(0.0) / freedom,
                    freedom,
                    rms: (n.squares / n.count.max(1.0)).sqrt(),
                    saturated: ring.saturated,
                    smear_px: if N == MOVING { [p[N - 2], p[N - 1]] } else { [0.0; 2] },
                });
            }
        }
    }

    /// Chooses the pixels near the edge of a disc, `[x, y, radius, length of its path]`.
    fn choose(&self, patch: &Patch<'_>, disc: &[f64; 4], avoid: &[[f64; 3]; 2], ring: &mut Ring) {
        let [cx, cy, r, path] = *disc;
        let reach = self.table.reach_px + SLACK_PX + path / 2.0 + self.band_px;
        let (outer, inner) = (r + reach, (r - reach).max(0.0));
        let left = cx - patch.x0;
        let first = (cy - outer - patch.y0).ceil().max(0.0) as usize;
        let last = ((cy + outer - patch.y0).floor() as usize + 1).min(patch.height);
        ring.begin(last.saturating_sub(first) * (patch.width + 2 * LANES));
        for j in first..last {
            let dy = patch.y0 + j as f64 - cy;
            let half = (outer * outer - dy * dy).max(0.0).sqrt();
            let hole = (inner * inner - dy * dy).max(0.0).sqrt();
            // The first pixel at or behind a place, the first one behind it.
            let clip = |i: i32| (i.max(0) as usize).min(patch.width);
            let from = |x: f64| clip(x as i32 + i32::from(f64::from(x as i32) < x));
            let behind = |x: f64| clip(x as i32 + i32::from(x >= 0.0));
            let (a, d) = (from(left - half), behind(left + half));
            let (b, c) = (behind(left - hole), from(left + hole));
            let mut part = |from: usize, to: usize| {
                let values = &patch.values[j * patch.width + from..];
                ring.push((from as f64 - left) as f32, dy as f32, values, to.saturating_sub(from));
            };
            // Left and right of the hole, or all of it.
            if hole > 0.0 && b < c {
                part(a, b);
                part(c, d);
            } else {
                part(a, d);
            }
        }
        // Those that fill up the last eight do not count.
        let filled = ring.used.next_multiple_of(LANES);
        ring.live[ring.used..filled].fill(0.0);
        if self.side == Side::Dark {
            ring.value[..filled].iter_mut().for_each(|v| *v = -*v);
        }
        if avoid.iter().any(|a| a[2] > 0.0) {
            // A pixel that shows, in part, a neighbour's disc.
            let near = self.table.reach_px + SLACK_PX;
            for i in 0..ring.used {
                let (x, y) = (cx + f64::from(ring.x[i]), cy + f64::from(ring.y[i]));
                if avoid.iter().any(|a| a[2] > 0.0 && (x - a[0]).hypot(y - a[1]) < a[2] + near) {
                    ring.live[i] = 0.0;
                }
            }
        }
        if let Some(limit) = self.saturation {
            let limit = (limit * self.side.sign()) as f32;
            for (v, live) in ring.value[..ring.used].iter_mut().zip(&ring.live) {
                ring.saturated += u32::from(*v >= limit && *live > 0.0);
                *v = v.min(limit);
            }
        }
    }

    /// Normal equations at a place; single precision holds a place inside the patch to 1e-6 px.
    fn normal<const N: usize>(&self, ring: &Ring, p: &[f64; N]) -> Normal<N> {
        let sign = self.side.sign() as f32;
        let [x, y, r, base, height]: [f32; 5] = from_fn(|i| p[i] as f32);
        let (read, shot, dark) = (self.noise.read as f32, self.noise.shot as f32, self.noise.dark as f32);
        let limit = self.saturation.map_or(f32::INFINITY, |l| l as f32 * sign);
        // A smeared disc is the mean of discs along its path: x, y, and the part of the path to there.
        let mut shifts = [[x, y, 0.0]; MOST_SHIFTS];
        let mut count = 1;
        if N == MOVING {
            let path = [p[N - 2], p[N - 1]];
            count = ((path[0].hypot(path[1]) / SHIFT_PX).ceil() as usize).clamp(3, MOST_SHIFTS);
            for (k, shift) in shifts[..count].iter_mut().enumerate() {
                let part = (k as f64 + 0.5) / count as f64 - 0.5;
                *shift = [(p[0] + part * path[0]) as f32, (p[1] + part * path[1]) as f32, part as f32];
            }
        }
        let share = 1.0 / count as f32;
        let (read, dark) = (f32x8::splat(read), f32x8::splat(dark));
        let (limit, zero) = (f32x8::splat(limit), f32x8::ZERO);
        let mut sums = [zero; PRODUCTS];
        let (mut squares, mut open) = (zero, zero);
        for [px, py, value, live] in ring.eights() {
            // Coverage, its slopes by x, y and radius, and by the path.
            let mut sum = [zero; 6];
            for [sx, sy, part] in &shifts[..count] {
                let (dx, dy) = (px - *sx, py - *sy);
                let rho = (dx * dx + dy * dy).fast_max(f32x8::splat(1e-6)).sqrt();
                let (c, s) = (dx / rho, dy / rho);
                let (cover, rise) = self.table.at(f32x8::splat(r) - rho, c.abs().fast_min(s.abs()));
                let rise = rise * share;
                let (rise_x, rise_y) = (rise * c, rise * s);
                sum[0] += cover * share;
                sum[1] += rise_x;
                sum[2] += rise_y;
                sum[3] += rise;
                if N == MOVING {
                    sum[4] += rise_x * *part;
                    sum[5] += rise_y * *part;
                }
            }
            let full = sum[0] * height + base;
            let model = full.fast_min(limit);
            // Saturated in the model and in the picture: nothing to learn.
            let known = live & (full.simd_lt(limit) | value.simd_lt(limit));
            let w = known / (read + (model * sign - dark).fast_max(zero) * shot);
            let e = value - model;
            let mut line = [zero; MOVING + 1];
            line[0] = sum[1] * height;
            line[1] = sum[2] * height;
            line[2] = sum[3] * height;
            line[3] = f32x8::splat(1.0);
            line[4] = sum[0];
            if N == MOVING {
                line[5] = sum[4] * height;
                line[6] = sum[5] * height;
            }
            line[N] = e;
            products::<0, N>(&mut sums, w, &line);
            products::<1, N>(&mut sums, w, &line);
            products::<2, N>(&mut sums, w, &line);
            products::<3, N>(&mut sums, w, &line);
            products::<4, N>(&mut sums, w, &line);
            products::<5, N>(&mut sums, w, &line);
            products::<6, N>(&mut sums, w, &line);
            products::<7, N>(&mut sums, w, &line);
            squares += known * e * e;
            open += known;
        }
        // One lane after another, so that every processor adds in the same order.
        let total = |s: f32x8| s.to_array().iter().map(|&v| f64::from(v)).sum::<f64>();
        let product = |k: usize, l: usize| {
            let (k, l) = (k.min(l), k.max(l));
            total(sums[place(k, l, N)])
        };
        Normal {
            matrix: SMatrix::from_fn(product),
            gradient: SVector::from_fn(|k, _| product(k, N)),
            chi2: product(N, N),
            squares: total(squares),
            count: total(open),
        }
    }
}
