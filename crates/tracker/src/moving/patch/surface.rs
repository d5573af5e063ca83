//! A part of a picture as a smooth surface: the cubic spline through its pixels.
//!
//! Owns: [`Surface`]. Must not: know of templates.

/// Pole of the cubic B-spline's inverse filter, sqrt(3) - 2, and its gain, 6 (Unser, Aldroubi, Eden, IEEE Trans. Signal Process. 41,
/// 821, 1993).
const POLE: f64 = -0.267_949_192_431_122_7;
const GAIN: f64 = 6.0;
/// Terms of the filter's first sum: the pole to this power is below 1e-12.
const FIRST_TERMS: usize = 21;

/// A plane's part as a surface, in pixels of the whole plane.
pub struct Surface {
    x0: usize,
    y0: usize,
    width: usize,
    height: usize,
    coefficients: Vec<f64>,
}

impl Surface {
    /// Of a plane of `width` x `height` pixels the part within `reach` px of a place, or of what of it is in the plane; `None`
    /// where nothing to speak of is.
    pub fn around(plane: &[f32], (width, height): (usize, usize), at: [f64; 2], reach: f64) -> Option<Self> {
        let range = |c: f64, n: usize| {
            let from = (c - reach).floor().max(0.0) as usize;
            let to = ((c + reach).ceil().max(0.0) as usize + 1).min(n);
            (from, to.saturating_sub(from))
        };
        let ((x0, w), (y0, h)) = (range(at[0], width), range(at[1], height));
        if w < 4 || h < 4 {
            return None;
        }
        let mut all: Vec<f64> =
            (y0..y0 + h).flat_map(|y| plane[y * width + x0..][..w].iter().map(|&v| f64::from(v))).collect();
        for row in all.chunks_exact_mut(w) {
            filter(row);
        }
        let mut column = vec![0.0; h];
        for x in 0..w {
            (0..h).for_each(|y| column[y] = all[y * w + x]);
            filter(&mut column);
            (0..h).for_each(|y| all[y * w + x] = column[y]);
        }
        Some(Self { x0, y0, width: w, height: h, coefficients: all })
    }

    /// Value at a place; `None` outside, and nearer to the border than the spline reaches.
    pub fn value(&self, [x, y]: [f64; 2]) -> Option<f64> {
        let (i, j, u, v) = self.cell(x, y)?;
        let (a, b) = (weights(u), weights(v));
        Some(self.sum(i, j, &a, &b))
    }

    /// Value and gradient at a place.
    pub fn gradient(&self, [x, y]: [f64; 2]) -> Option<(f64, [f64; 2])> {
        let (i, j, u, v) = self.cell(x, y)?;
        let (a, b) = (weights(u), weights(v));
        let slopes = [self.sum(i, j, &slopes(u), &b), self.sum(i, j, &a, &slopes(v))];
        Some((self.sum(i, j, &a, &b), slopes))
    }

    /// The first of four columns and rows about a place, and the place's parts of a pixel.
    fn cell(&self, x: f64, y: f64) -> Option<(usize, usize, f64, f64)> {
        let (x, y) = (x - self.x0 as f64, y - self.y0 as f64);
        let inside = |v: f64, n: usize| v >= 1.0 && v < n as f64 - 2.0;
        if !inside(x, self.width) || !inside(y, self.height) {
            return None;
        }
        Some((x as usize - 1, y as usize - 1, x.fract(), y.fract()))
    }

    fn sum(&self, i: usize, j: usize, a: &[f64; 4], b: &[f64; 4]) -> f64 {
        let mut sum = 0.0;
        for (k, w) in b.iter().enumerate() {
            let row = &self.coefficients[(j + k) * self.width + i..][..4];
            sum += w * (a[0] * row[0] + a[1] * row[1] + a[2] * row[2] + a[3] * row[3]);
        }
        sum
    }
}

/// Weights of four coefficients at part `t` of the way from the second to the third.
fn weights(t: f64) -> [f64; 4] {
    let s = 1.0 - t;
    [
        s * s * s / 6.0,
        (4.0 - 6.0 * t * t + 3.0 * t * t * t) / 6.0,
        (4.0 - 6.0 * s * s + 3.0 * s * s * s) / 6.0,
        t * t * t / 6.0,
    ]
}

/// Their derivatives.
fn slopes(t: f64) -> [f64; 4] {
    let s = 1.0 - t;
    [-s * s / 2.0, -2.0 * t + 1.5 * t * t, 2.0 * s - 1.5 * s * s, t * t / 2.0]
}

/// From samples to coefficients of the spline through them; the samples go on beyond their ends as in a mirror.
fn filter(line: &mut [f64]) {
    let n = line.len();
    let mirrored = |k: usize| {
        let k = k % (2 * n - 2);
        if k < n { k } else { 2 * n - 2 - k }
    };
    line.iter_mut().for_each(|v| *v *= GAIN);
    let mut power = 1.0;
    let mut first = 0.0;
    for k in 0..FIRST_TERMS {
        first += power * line[mirrored(k)];
        power *= POLE;
    }
    line[0] = first;
    for k in 1..n {
        line[k] += POLE * line[k - 1];
    }
    line[n - 1] = POLE / (POLE * POLE - 1.0) * (line[n - 1] + POLE * line[n - 2]);
    for k in (0..n - 1).rev() {
        line[k] = POLE * (line[k + 1] - line[k]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_surface_passes_through_its_pixels_and_has_the_slope_of_a_smooth_picture() {
        let (w, h) = (40, 30);
        let f = |x: f64, y: f64| 100.0 + 30.0 * (0.3 * x + 0.1 * y).sin() + 20.0 * (0.25 * y).cos();
        let plane: Vec<f32> = (0..w * h).map(|i| f((i % w) as f64, (i / w) as f64) as f32).collect();
        let s = Surface::around(&plane, (w, h), [20.0, 15.0], 12.0).unwrap();
        assert!((s.value([18.0, 14.0]).unwrap() - f(18.0, 14.0)).abs() < 1e-4);
        let (v, [gx, gy]) = s.gradient([20.3, 13.6]).unwrap();
        // The spline's error is of fourth order in the step: 0.3^4 / 384 of the amplitude.
        assert!((v - f(20.3, 13.6)).abs() < 0.005, "{v}");
        let phase: f64 = 0.3 * 20.3 + 0.1 * 13.6;
        assert!((gx - 9.0 * phase.cos()).abs() < 0.02, "{gx}");
        assert!((gy - (3.0 * phase.cos() - 5.0 * (0.25 * 13.6f64).sin())).abs() < 0.02, "{gy}");
        assert!(s.value([5.0, 15.0]).is_none() && s.value([f64::NAN, 15.0]).is_none());
        assert!(Surface::around(&plane, (w, h), [200.0, 15.0], 12.0).is_none());
    }
}
