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

use super::edge::{EdgeTable, Spot};
use super::lanes::{Eight, Job, LANES, work};
use super::levels::{Noise, Side};

/// A rectangle of pixels, raw units; behind the last pixel come [`LANES`] more values that mean nothing.
pub(crate) struct Patch<'a> {
    pub values: &'a [f32],
    pub width: usize,
    pub height: usize,
    /// Values from the start of one row to the next.
    pub stride: usize,
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

const STEPS: [f32; LANES] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];

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
    /// What is found of eight pixels on the way to the normal equations.
    eights: Vec<Found>,
}

/// Of eight pixels of a ring. A processor does more at once where the way to the table and the way on from it are two
/// loops.
#[derive(Debug, Clone, Copy, Default)]
struct Found {
    spot: Spot,
    /// The edge's normal, inwards from the disc's edge to larger coverage.
    normal: [[f32; LANES]; 2],
    /// Coverage and its slopes by x, y, radius and path, of a disc that moves.
    sums: [[f32; LANES]; 6],
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
fn products<V: Eight, const K: usize, const N: usize>(
    sums: &mut [V; PRODUCTS],
    w: V,
    line: &[V; MOVING + 1],
) {
    if K > N {
        return;
    }
    let weighted = w * line[K];
    for l in K..=N {
        sums[place(K, l, N)] += weighted * line[l];
    }
}

/// The normal equations of a round.
struct Normal<const N: usize> {
    matrix: [[f64; N]; N],
    gradient: [f64; N],
    chi2: f64,
    squares: f64,
    count: f64,
}

/// A symmetric matrix as L D L^T, D a diagonal above 0 and L below it, with ones on it.
struct Factor<const N: usize> {
    lower: [[f64; N]; N],
    inverse: [f64; N],
}

impl<const N: usize> Factor<N> {
    /// `None` where the matrix is not positive.
    #[inline(always)]
    fn new(matrix: &[[f64; N]; N]) -> Option<Self> {
        let (mut lower, mut inverse) = ([[0.0; N]; N], [0.0; N]);
        for j in 0..N {
            // What is left of column j, of which the first is D's.
            let mut left: [f64; N] = from_fn(|i| matrix[i][j]);
            for k in 0..j {
                // lower[j][k] holds D L so far; L itself is needed once.
                let l = lower[j][k] * inverse[k];
                for i in j..N {
                    left[i] -= lower[i][k] * l;
                }
            }
            if !(left[j] > 0.0) {
                return None;
            }
            inverse[j] = 1.0 / left[j];
            for i in j..N {
                lower[i][j] = left[i];
            }
        }
        for i in 0..N {
            for k in 0..i {
                lower[i][k] *= inverse[k];
            }
        }
        Some(Self { lower, inverse })
    }

    /// L^-1 times a vector of which only zeros are before `first`.
    #[inline(always)]
    fn down(&self, mut v: [f64; N], first: usize) -> [f64; N] {
        for k in first..N {
            for i in k + 1..N {
                v[i] -= self.lower[i][k] * v[k];
            }
        }
        v
    }

    /// The inverse times a vector.
    #[inline(always)]
    fn solve(&self, v: &[f64; N]) -> [f64; N] {
        let down = self.down(*v, 0);
        let mut v: [f64; N] = from_fn(|i| down[i] * self.inverse[i]);
        for k in (0..N).rev() {
            for i in 0..k {
                v[i] -= self.lower[k][i] * v[k];
            }
        }
        v
    }

    /// The inverse's diagonal at i.
    #[inline(always)]
    fn variance(&self, i: usize) -> f64 {
        let unit = self.down(from_fn(|k| if k == i { 1.0 } else { 0.0 }), i);
        (i..N).map(|k| unit[k] * unit[k] * self.inverse[k]).sum()
    }
}

impl Ring {
    fn begin(&mut self, most: usize) {
        for lanes in [&mut self.x, &mut self.y, &mut self.value, &mut self.live] {
            if lanes.len() < most {
                lanes.resize(most, 0.0);
            }
        }
        let eights = most.div_ceil(LANES);
        if self.eights.len() < eights {
            self.eights.resize(eights, Found::default());
        }
        self.used = 0;
        self.saturated = 0;
    }

    /// `count` pixels of a row from `values` on, the first at `x`; up to seven beyond are written too and then
    /// overwritten by those that follow.
    #[inline(always)]
    fn push<V: Eight>(&mut self, token: V::Token, x: f32, y: f32, values: &[f32], count: usize) {
        let (steps, y) = (V::of(token, &STEPS), V::all(token, y).array());
        for k in (0..count).step_by(LANES) {
            let (at, first) = (self.used + k, x + k as f32);
            let to = at..at + LANES;
            self.x[to.clone()].copy_from_slice(&(V::all(token, first) + steps).array());
            self.y[to.clone()].copy_from_slice(&y);
            self.value[to].copy_from_slice(&values[k..k + LANES]);
        }
        self.used += count;
    }
}

/// Chooses the pixels near the edge of a disc.
struct Choose<'a> {
    patch: &'a Patch<'a>,
    /// The disc's centre, greatest and least distance from it.
    centre: [f64; 2],
    outer: f64,
    inner: f64,
    ring: &'a mut Ring,
}

impl Job for Choose<'_> {
    type Outcome = ();

    #[inline(always)]
    fn run<V: Eight>(self, token: V::Token) {
        let Self { patch, centre: [cx, cy], outer, inner, ring } = self;
        let all = |v: f64| V::all(token, v as f32);
        let (left, above) = (cx - patch.x0, cy - patch.y0);
        let first = (above - outer).max(0.0) as usize;
        let last = ((above + outer).max(0.0) as usize + 1).min(patch.height);
        ring.begin(last.saturating_sub(first) * (patch.width + 2 * LANES));
        let (zero, width) = (all(0.0), all(patch.width as f64));
        // The first pixel behind a place.
        let behind = |x: V| (x + all(1.0)).most(zero).least(width).whole().map(|i| i as usize);
        for eight in (first..last).step_by(LANES) {
            let dy = all(eight as f64 - above) + V::of(token, &STEPS);
            let half = |r: f64| (all(r * r) - dy * dy).most(zero).root();
            let (far, near, middle) = (half(outer), half(inner), all(left));
            let (a, b) = (behind(middle - far), behind(middle - near));
            let (c, d) = (behind(middle + near), behind(middle + far));
            let dy = dy.array();
            for j in eight..last.min(eight + LANES) {
                let k = j - eight;
                // Left and right of the hole, or all of it.
                let parts = if b[k] < c[k] { [(a[k], b[k]), (c[k], d[k])] } else { [(a[k], d[k]), (0, 0)] };
                for (from, to) in parts {
                    if from < to {
                        let values = &patch.values[j * patch.stride + from..];
                        ring.push::<V>(token, (from as f64 - left) as f32, dy[k], values, to - from);
                    }
                }
            }
        }
        // Those that fill up the last eight do not count.
        let used = ring.used;
        ring.live[..used].fill(1.0);
        ring.live[used..used.next_multiple_of(LANES)].fill(0.0);
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
        let length = |x: f64, y: f64| (x * x + y * y).sqrt();
        let path = |p: &[f64; N]| if N == MOVING { length(p[N - 2], p[N - 1]) } else { 0.0 };
        self.choose(patch, &origin, &start.avoid, ring);
        let (mut round, mut chosen) = (0, 1);
        loop {
            if ring.used < 12 {
                return None;
            }
            let n = work(Equations::<N> { fit: self, ring: &mut *ring, p: &p });
            let factor = Factor::new(&n.matrix)?;
            let step = factor.solve(&n.gradient);
            round += 1;
            let limit = 0.25 * first_radius.max(2.0);
            let scale = (limit / step[0].abs().max(step[1].abs()).max(step[2].abs())).min(1.0);
            for (v, s) in p.iter_mut().zip(&step) {
                *v += s * scale;
            }
            let at = [origin[0] + p[0], origin[1] + p[1]];
            let strayed = length(at[0] - x, at[1] - y) > 0.5 * first_radius + 1.0
                || p[2] < 0.5 * first_radius
                || p[2] > 1.6 * first_radius
                || p[4] <= 0.0
                || (N == MOVING && !(LEAST_PATH_PX..=2.5 * first_radius).contains(&path(&p)));
            if strayed || p.iter().any(|v| !v.is_finite()) {
                return None;
            }
            let off = length(p[0], p[1]) + (p[2] - origin[2]).abs() + (0.5 * (path(&p) - origin[3])).max(0.0);
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

    /// Chooses the pixels near the edge of a disc, `[x, y, radius, length of its path]`.
    fn choose(&self, patch: &Patch<'_>, disc: &[f64; 4], avoid: &[[f64; 3]; 2], ring: &mut Ring) {
        let [cx, cy, r, path] = *disc;
        let reach = self.table.reach_px + SLACK_PX + path / 2.0 + self.band_px;
        let (outer, inner) = (r + reach, (r - reach).max(0.0));
        work(Choose { patch, centre: [cx, cy], outer, inner, ring: &mut *ring });
        let filled = ring.used.next_multiple_of(LANES);
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
}

/// Normal equations at a place; single precision holds a place inside the patch to 1e-6 px.
struct Equations<'a, const N: usize> {
    fit: &'a DiscFit<'a>,
    ring: &'a mut Ring,
    p: &'a [f64; N],
}

impl<const N: usize> Job for Equations<'_, N> {
    type Outcome = Normal<N>;

    #[inline(always)]
    fn run<V: Eight>(self, token: V::Token) -> Normal<N> {
        let Self { fit, ring, p } = self;
        let all = |v: f32| V::all(token, v);
        let of = |v: &[f32; LANES]| V::of(token, v);
        let sign = fit.side.sign() as f32;
        let [x, y, r, base, height]: [f32; 5] = from_fn(|i| p[i] as f32);
        let limit = fit.saturation.map_or(f32::INFINITY, |l| l as f32 * sign);
        let n = ring.used.div_ceil(LANES);
        let eights = |v| &<[f32]>::as_chunks::<LANES>(v).0[..n];
        let (places_x, places_y) = (eights(&ring.x), eights(&ring.y));
        let (values, lives) = (eights(&ring.value), eights(&ring.live));
        let found = &mut ring.eights[..n];
        let (r, zero, one, least) = (all(r), all(0.0), all(1.0), all(1e-6));
        // Where the edge of a disc about (x, y) is, of all pixels.
        let look = |found: &mut [Found], x: f32, y: f32| {
            for ((found, px), py) in found.iter_mut().zip(places_x).zip(places_y) {
                let (dx, dy) = (of(px) - all(x), of(py) - all(y));
                let rho = (dx * dx + dy * dy).most(least).root();
                let inverse = one.over(rho);
                let (c, s) = (dx * inverse, dy * inverse);
                found.spot = fit.table.spot(token, r - rho, c.size().least(s.size()));
                found.normal = [c.array(), s.array()];
            }
        };
        if N == MOVING {
            // A smeared disc is the mean of discs along its path, each by the part of the path to there.
            let path = [p[N - 2], p[N - 1]];
            let count = ((path[0].hypot(path[1]) / SHIFT_PX).ceil() as usize).clamp(3, MOST_SHIFTS);
            let share = all(1.0 / count as f32);
            found.iter_mut().for_each(|f| f.sums = Default::default());
            for k in 0..count {
                let part = (k as f64 + 0.5) / count as f64 - 0.5;
                look(found, (p[0] + part * path[0]) as f32, (p[1] + part * path[1]) as f32);
                for f in found.iter_mut() {
                    let (cover, rise) = fit.table.at::<V>(token, &f.spot);
                    let rise = rise * share;
                    let (rise_x, rise_y) = (rise * of(&f.normal[0]), rise * of(&f.normal[1]));
                    let part = all(part as f32);
                    let more = [cover * share, rise_x, rise_y, rise, rise_x * part, rise_y * part];
                    for (sum, more) in f.sums.iter_mut().zip(more) {
                        *sum = (of(sum) + more).array();
                    }
                }
            }
        } else {
            look(found, x, y);
        }
        let (base, height, sign) = (all(base), all(height), all(sign));
        let [read, shot, dark] = [fit.noise.read, fit.noise.shot, fit.noise.dark].map(|v| all(v as f32));
        let limit = all(limit);
        let mut sums = [zero; PRODUCTS];
        let (mut squares, mut open) = (zero, zero);
        for ((found, value), live) in found.iter().zip(values).zip(lives) {
            // Coverage, its slopes by x, y and radius, and by the path.
            let sum = if N == MOVING {
                found.sums.map(|s| of(&s))
            } else {
                let (cover, rise) = fit.table.at::<V>(token, &found.spot);
                [cover, rise * of(&found.normal[0]), rise * of(&found.normal[1]), rise, zero, zero]
            };
            let value = of(value);
            let full = sum[0] * height + base;
            let model = full.least(limit);
            // Saturated in the model and in the picture: nothing to learn.
            let known = of(live).where_below(full, value, limit);
            let w = known.over(read + (model * sign - dark).most(zero) * shot);
            let e = value - model;
            let mut line = [zero; MOVING + 1];
            line[0] = sum[1] * height;
            line[1] = sum[2] * height;
            line[2] = sum[3] * height;
            line[3] = one;
            line[4] = sum[0];
            if N == MOVING {
                line[5] = sum[4] * height;
                line[6] = sum[5] * height;
            }
            line[N] = e;
            products::<V, 0, N>(&mut sums, w, &line);
            products::<V, 1, N>(&mut sums, w, &line);
            products::<V, 2, N>(&mut sums, w, &line);
            products::<V, 3, N>(&mut sums, w, &line);
            products::<V, 4, N>(&mut sums, w, &line);
            products::<V, 5, N>(&mut sums, w, &line);
            products::<V, 6, N>(&mut sums, w, &line);
            products::<V, 7, N>(&mut sums, w, &line);
            squares += known * e * e;
            open += known;
        }
        // In one order for every processor.
        let total = |s: V| -> f64 {
            let [a, b, c, d, e, f, g, h] = s.array().map(f64::from);
            ((a + e) + (c + g)) + ((b + f) + (d + h))
        };
        let mut totals = [0.0; PRODUCTS];
        for (total_of, sum) in totals.iter_mut().zip(&sums[..(N + 1) * (N + 2) / 2]) {
            *total_of = total(*sum);
        }
        let product = |k: usize, l: usize| totals[place(k.min(l), k.max(l), N)];
        Normal {
            matrix: from_fn(|k| from_fn(|l| product(k, l))),
            gradient: from_fn(|k| product(k, N)),
            chi2: product(N, N),
            squares: total(squares),
            count: total(open),
        }
    }
}
