//! Sums and solves the normal equations of a disc's fit.
//!
//! Owns: [`DiscModel`], [`Normal`], [`Factor`]. Must not: choose pixels, or take a step.

use std::array::from_fn;

use super::edge_pixels::{EdgeLookup, Ring};
use super::edge_table::EdgeTable;
use crate::detect::noise::Noise;
use crate::detect::settings::Polarity;
use crate::detect::simd::lanes::{Eight, Job, LANES, work};

/// Number of free parameters of a disc that stands still, and of one that moves during the exposure.
pub(crate) const STILL: usize = 5;
pub(crate) const MOVING: usize = 7;

/// Distance (px) and numbers of the discs along the path of a marker that moves during the exposure; their mean is the blurred
/// disc. A path longer than 14.4 px has the greatest number, farther apart.
const PATH_STEP_PX: f64 = 0.45;
const LEAST_PATH_SAMPLES: usize = 3;
const MAX_PATH_SAMPLES: usize = 32;
/// Least distance of a pixel from the centre, squared: the direction there is not defined.
const LEAST_DISTANCE_SQUARED: f32 = 1e-6;

/// The model of a disc's pixels: the edge's coverage, the noise of a sample, and the value at which samples saturate.
#[derive(Clone, Copy)]
pub(crate) struct DiscModel<'a> {
    pub table: &'a EdgeTable,
    pub noise: Noise,
    pub polarity: Polarity,
    /// Raw units; `None` where no sample saturates.
    pub saturation: Option<f64>,
}

impl DiscModel<'_> {
    /// Whether a value is at the end of the recording's range on the markers' side.
    pub fn saturated(&self, value: f64) -> bool {
        self.saturation.is_some_and(|limit| match self.polarity {
            Polarity::Bright => value >= limit,
            Polarity::Dark => value <= limit,
        })
    }
}

/// Sums of `line_k * line_l * weight` for k <= l, where a line holds the model's derivative by one parameter for each
/// pixel (a column of the Jacobian), and the last line the residual: the upper triangle of the normal equations with their
/// right-hand side.
const PRODUCTS: usize = (MOVING + 1) * (MOVING + 2) / 2;

/// Index of the product of lines k <= l of N parameters in that triangle, stored row by row.
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
pub(crate) struct Normal<const N: usize> {
    pub matrix: [[f64; N]; N],
    pub gradient: [f64; N],
    /// Weighted sum of squared residuals, and the sum of squared residuals.
    pub chi2: f64,
    pub squares: f64,
    /// Pixels that count.
    pub count: f64,
}

impl<const N: usize> Normal<N> {
    /// The equations at the parameters `[x, y, radius, base, height, path]`: brightness outside, brightness inside less that, and
    /// two numbers of the path; single precision holds a place inside the patch to 1e-6 px.
    pub fn at(model: &DiscModel<'_>, ring: &mut Ring, p: &[f64; N]) -> Self {
        work(Equations { model, ring, p })
    }
}

/// A symmetric matrix as L D L^T, D a diagonal above 0 and L below it, with ones on it.
pub(crate) struct Factor<const N: usize> {
    lower: [[f64; N]; N],
    inverse: [f64; N],
}

impl<const N: usize> Factor<N> {
    /// `None` where the matrix is not positive.
    #[inline(always)]
    pub fn new(matrix: &[[f64; N]; N]) -> Option<Self> {
        let (mut lower, mut inverse) = ([[0.0; N]; N], [0.0; N]);
        for j in 0..N {
            // Column j less the columns before it; its entry j is D's.
            let mut left: [f64; N] = from_fn(|i| matrix[i][j]);
            for k in 0..j {
                // lower[j][k] holds D L so far; L itself is needed once.
                let l = lower[j][k] * inverse[k];
                for i in j..N {
                    left[i] -= lower[i][k] * l;
                }
            }
            // NaN is refused, too.
            if left[j].is_nan() || left[j] <= 0.0 {
                return None;
            }
            inverse[j] = 1.0 / left[j];
            for i in j..N {
                lower[i][j] = left[i];
            }
        }
        for (i, row) in lower.iter_mut().enumerate() {
            for (l, inverse) in row[..i].iter_mut().zip(&inverse) {
                *l *= inverse;
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
    pub fn solve(&self, v: &[f64; N]) -> [f64; N] {
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
    pub fn variance(&self, i: usize) -> f64 {
        let unit = self.down(from_fn(|k| if k == i { 1.0 } else { 0.0 }), i);
        (i..N).map(|k| unit[k] * unit[k] * self.inverse[k]).sum()
    }
}

/// The job that sums the normal equations over a ring.
struct Equations<'a, const N: usize> {
    model: &'a DiscModel<'a>,
    ring: &'a mut Ring,
    p: &'a [f64; N],
}

impl<const N: usize> Job for Equations<'_, N> {
    type Outcome = Normal<N>;

    #[inline(always)]
    #[expect(clippy::too_many_lines, reason = "one loop over vectors, which no call may interrupt")]
    fn run<V: Eight>(self, token: V::Token) -> Normal<N> {
        let Self { model, ring, p } = self;
        let all = |v: f32| V::splat(token, v);
        let of = |v: &[f32; LANES]| V::load(token, v);
        let sign = model.polarity.sign() as f32;
        let [x, y, r, base, height]: [f32; 5] = from_fn(|i| p[i] as f32);
        let limit = model.saturation.map_or(f32::INFINITY, |l| l as f32 * sign);
        let n = ring.used.div_ceil(LANES);
        let eights = |v| &<[f32]>::as_chunks::<LANES>(v).0[..n];
        let (places_x, places_y) = (eights(&ring.x), eights(&ring.y));
        let (values, lives) = (eights(&ring.value), eights(&ring.live));
        let found = &mut ring.eights[..n];
        let (r, zero, one, least) = (all(r), all(0.0), all(1.0), all(LEAST_DISTANCE_SQUARED));
        // Where the edge of a disc about (x, y) is, of all pixels.
        let look = |found: &mut [EdgeLookup], x: f32, y: f32| {
            for ((found, px), py) in found.iter_mut().zip(places_x).zip(places_y) {
                let (dx, dy) = (of(px) - all(x), of(py) - all(y));
                let rho = (dx * dx + dy * dy).max(least).sqrt();
                let inverse = one.div(rho);
                let (c, s) = (dx * inverse, dy * inverse);
                let direction = if model.table.square {
                    c.abs().min(s.abs())
                } else {
                    (s.abs() - c.abs() + one) * all(0.5)
                };
                found.spot = model.table.spot(token, r - rho, direction);
                found.normal = [c.array(), s.array()];
            }
        };
        if N == MOVING {
            // A smeared disc is the mean of discs along its path; the slope by the path is that by the place, times the part of
            // the path up to there.
            let path = [p[N - 2], p[N - 1]];
            let count = ((path[0].hypot(path[1]) / PATH_STEP_PX).ceil() as usize)
                .clamp(LEAST_PATH_SAMPLES, MAX_PATH_SAMPLES);
            let share = all(1.0 / count as f32);
            found.iter_mut().for_each(|f| f.sums = Default::default());
            for k in 0..count {
                let part = (k as f64 + 0.5) / count as f64 - 0.5;
                look(found, (p[0] + part * path[0]) as f32, (p[1] + part * path[1]) as f32);
                for f in found.iter_mut() {
                    let (cover, rise) = model.table.at::<V>(token, &f.spot);
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
        let [read, shot, dark] =
            [model.noise.read, model.noise.shot, model.noise.dark].map(|v| all(v as f32));
        let limit = all(limit);
        let mut sums = [zero; PRODUCTS];
        let (mut squares, mut counted) = (zero, zero);
        for ((found, value), live) in found.iter().zip(values).zip(lives) {
            // Coverage, its slopes by x, y and radius, and by the path.
            let sum = if N == MOVING {
                found.sums.map(|s| of(&s))
            } else {
                let (cover, rise) = model.table.at::<V>(token, &found.spot);
                [cover, rise * of(&found.normal[0]), rise * of(&found.normal[1]), rise, zero, zero]
            };
            let value = of(value);
            let full = sum[0] * height + base;
            let predicted = full.min(limit);
            // Saturated in the model and in the picture: nothing to learn.
            let known = of(live).where_below(full, value, limit);
            let w = known.div(read + (predicted * sign - dark).max(zero) * shot);
            let e = value - predicted;
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
            counted += known;
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
            count: total(counted),
        }
    }
}
