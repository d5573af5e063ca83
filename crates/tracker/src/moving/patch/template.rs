//! The template of a thing: values of its pixels, and how they change as it moves.
//!
//! Owns: [`Pose`], [`Template`]. Must not: search.
//!
//! # Bound
//! A picture shows the template T moved by a pose p (shift, turn, size), with a gain a, an offset b and white noise of variance
//! s^2 on each of N pixels: `f_i = a T(u_i; p) + b + n_i`. With J the N x 4 derivatives of a T by p, projected off T and 1 (the gain and
//! the offset are not known), Fisher's information on p is `J'J / s^2`, and no unbiased estimate of p has a covariance below
//!
//! `C = s^2 (J'J)^-1` (Cramer and Rao).
//!
//! The template is itself cut from a picture with the same noise. What its noise shifts is the same in every picture, in the
//! thing's own coordinates, and has covariance C again: about the thing's true place, each place has the bound `2 C`. Where noise is not white
//! (a codec's, that of pixels between pixels) the least-squares estimate has the covariance
//! `(J'J)^-1 J'SJ (J'J)^-1` with S the covariance of what remains, f - T, which is measured on what remains.

use nalgebra::{SMatrix, SVector};

use super::surface::Surface;

/// Number of parameters of a pose.
pub const FREE: usize = 4;
/// A matrix and a vector of the parameters.
pub type Square = SMatrix<f64, FREE, FREE>;
pub type Line = SVector<f64, FREE>;

/// The place, turn and size at which a template is seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// The place that was pointed at, px.
    pub x: f64,
    /// The place that was pointed at, px.
    pub y: f64,
    /// Turn from column to row, rad.
    pub angle: f64,
    /// Logarithm of the size over the template's.
    pub log_size: f64,
}

impl Pose {
    /// The place of a point of the template, px.
    pub fn place(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        let [c, s] = self.columns();
        [self.x + c * u - s * v, self.y + s * u + c * v]
    }

    /// Size times cosine and sine of the turn.
    fn columns(&self) -> [f64; 2] {
        let (s, c) = self.angle.sin_cos();
        [c, s].map(|v| v * self.log_size.exp())
    }

    /// The pose from which the template, moved by `step` in its own coordinates, looks as it does from this one.
    pub fn less(&self, step: &Line) -> Self {
        let back = Self { x: 0.0, y: 0.0, angle: -step[2], log_size: -step[3] };
        let [u, v] = back.place([-step[0], -step[1]]);
        let [x, y] = self.place([u, v]);
        Self { x, y, angle: self.angle - step[2], log_size: self.log_size - step[3] }
    }

    /// The point of the template that is at a place.
    pub fn point(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let (dx, dy) = (x - self.x, y - self.y);
        let [c, s] = self.columns();
        let square = c * c + s * s;
        [(c * dx + s * dy) / square, (c * dy - s * dx) / square]
    }

    /// The distance of the place from another pose's, px.
    pub fn off(&self, other: &Self) -> f64 {
        (self.x - other.x).hypot(self.y - other.y)
    }
}

/// The template of a thing in one picture.
#[derive(Clone)]
pub struct Template {
    /// Its pixels, px from the place that was pointed at.
    pub points: Vec<[f64; 2]>,
    /// Their values less the mean, over `contrast`.
    pub values: Vec<f64>,
    /// Root of the sum of squares of the values less the mean, grey levels.
    pub contrast: f64,
    /// Derivatives of the values by shift (px), turn (rad) and logarithm of size, off the mean and off the values themselves.
    pub slopes: Vec<Line>,
    /// Inverse of the sum of their products.
    pub inverse: Square,
    /// Half of its extent, px.
    pub radius_px: f64,
    /// For each pixel of a square of `side` the index of the point there.
    grid: Vec<Option<usize>>,
    side: usize,
    /// Place of the grid's middle from the place that was pointed at, px.
    off: [f64; 2],
}

impl Template {
    /// Pixels of a template at least: six for each unknown.
    pub const LEAST_POINTS: usize = 36;

    /// Of the pixels about a place that `covers`, in a picture's surface; `None` where they are few, or alike.
    pub fn cut(
        surface: &Surface,
        pose: &Pose,
        radius: usize,
        covers: impl Fn(i64, i64) -> bool,
    ) -> Option<Self> {
        let middle = [pose.x.round(), pose.y.round()];
        let side = 2 * radius + 1;
        let (mut points, mut values, mut gradients) = (Vec::new(), Vec::new(), Vec::new());
        let mut grid = vec![None; side * side];
        let at = |k: usize| k as f64 - radius as f64;
        for j in 0..side {
            for i in 0..side {
                let pixel = [middle[0] + at(i), middle[1] + at(j)];
                if at(i).hypot(at(j)) > radius as f64 + 0.5 || !covers(pixel[0] as i64, pixel[1] as i64) {
                    continue;
                }
                let Some((value, gradient)) = surface.gradient(pixel) else { continue };
                grid[j * side + i] = Some(points.len());
                points.push([pixel[0] - pose.x, pixel[1] - pose.y]);
                values.push(value);
                gradients.push(gradient);
            }
        }
        if points.len() < Self::LEAST_POINTS {
            return None;
        }
        let contrast = normalise(&mut values)?;
        let mut slopes: Vec<Line> = points
            .iter()
            .zip(&gradients)
            .map(|(&[u, v], &[gx, gy])| Line::new(gx, gy, gy * u - gx * v, gx * u + gy * v) / contrast)
            .collect();
        let mean = slopes.iter().sum::<Line>() / slopes.len() as f64;
        let along: Line = slopes.iter().zip(&values).map(|(s, v)| (s - mean) * *v).sum();
        slopes.iter_mut().zip(&values).for_each(|(s, v)| *s -= mean + along * *v);
        let inverse = information(&slopes).cholesky()?.inverse();
        let radius_px = radius as f64;
        let off = [middle[0] - pose.x, middle[1] - pose.y];
        Some(Self { points, values, contrast, slopes, inverse, radius_px, grid, side, off })
    }

    /// Standard deviation of the shift for noise of so many grey levels in the picture alone, px an axis.
    pub fn bound_px(&self, noise: f64) -> f64 {
        let both = self.inverse[(0, 0)] + self.inverse[(1, 1)];
        noise / self.contrast * (both / 2.0).sqrt()
    }

    /// Standard deviation of the shift, px of the template an axis, from what remains of the values: its covariance among pixels near
    /// each other counts (`LAGS`).
    pub fn sigma_px(&self, remains: &[f64]) -> f64 {
        let mut middle = Square::zeros();
        let lags = -LAGS..=LAGS;
        for (dy, dx) in lags.clone().flat_map(|dy| lags.clone().map(move |dx| (dy, dx))) {
            if dy < 0 || (dy == 0 && dx < 0) {
                continue;
            }
            let (mut product, mut count, mut sum) = (0.0, 0usize, Square::zeros());
            for (place, a) in self.grid.iter().enumerate() {
                let (Some(a), Some(b)) = (*a, self.beside(place, dx, dy)) else { continue };
                product += remains[a] * remains[b];
                count += 1;
                sum += self.slopes[a] * self.slopes[b].transpose();
            }
            let covariance = product / count.saturating_sub(FREE + 2).max(1) as f64;
            middle += if dx == 0 && dy == 0 { sum } else { sum + sum.transpose() } * covariance;
        }
        let c = self.inverse * middle * self.inverse;
        // What remains is off the slopes, which hides a part of its covariance: white noise of the same size is the least.
        let squares: f64 = remains.iter().map(|r| r * r).sum();
        let white =
            squares / (remains.len() - FREE - 2) as f64 * (self.inverse[(0, 0)] + self.inverse[(1, 1)]);
        ((c[(0, 0)] + c[(1, 1)]).max(white) / 2.0).sqrt()
    }

    /// Whether a point is one of its pixels.
    pub fn covers(&self, [u, v]: [f64; 2]) -> bool {
        let half = (self.side / 2) as f64;
        let (i, j) = ((u - self.off[0]).round() + half, (v - self.off[1]).round() + half);
        let inside = |k: f64| k >= 0.0 && k < self.side as f64;
        inside(i) && inside(j) && self.grid[j as usize * self.side + i as usize].is_some()
    }

    fn beside(&self, place: usize, dx: i64, dy: i64) -> Option<usize> {
        let side = self.side as i64;
        let (x, y) = (place as i64 % side + dx, place as i64 / side + dy);
        let inside = (0..side).contains(&x) && (0..side).contains(&y);
        if inside { self.grid[(y * side + x) as usize] } else { None }
    }
}

/// Pixels apart up to which what remains is taken to hang together.
const LAGS: i64 = 2;

fn information(slopes: &[Line]) -> Square {
    slopes.iter().map(|s| s * s.transpose()).sum()
}

/// Makes values of mean 0 and sum of squares 1; the root of the sum of squares before, `None` of values that are alike.
pub fn normalise(values: &mut [f64]) -> Option<f64> {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    values.iter_mut().for_each(|v| *v -= mean);
    let contrast = values.iter().map(|v| v * v).sum::<f64>().sqrt();
    if contrast < 1e-6 {
        return None;
    }
    values.iter_mut().for_each(|v| *v /= contrast);
    Some(contrast)
}
