//! Interpolates a table of angles or places with cubic splines.

/// A cubic spline through points of increasing time; twice continuously differentiable.
///
/// End slopes are those of the cubic through the four outermost points, so the error is of fourth order in the
/// step everywhere.
#[derive(Debug, Clone)]
pub(crate) struct Spline {
    t: Vec<f64>,
    y: Vec<f64>,
    /// Slopes at the points.
    m: Vec<f64>,
}

impl Spline {
    /// Through `(t, y)`, `t` increasing, at least one point and as many of `y`; the caller has checked that.
    pub(crate) fn new(t: &[f64], y: &[f64]) -> Self {
        let n = t.len();
        let mut m = vec![0.0; n];
        if n >= 2 {
            m[0] = end_slope(&t[..n.min(4)], &y[..n.min(4)]);
            let (tail_t, tail_y): (Vec<f64>, Vec<f64>) =
                (0..n.min(4)).map(|k| (t[n - 1 - k], y[n - 1 - k])).unzip();
            m[n - 1] = end_slope(&tail_t, &tail_y);
        }
        if n >= 3 {
            // Continuity of the second derivative: a tridiagonal system for the inner slopes.
            let (mut c, mut d) = (vec![0.0; n], vec![0.0; n]);
            for i in 1..n - 1 {
                let (a, b) = (t[i] - t[i - 1], t[i + 1] - t[i]);
                let (low, diagonal, high) = (1.0 / a, 2.0 / a + 2.0 / b, 1.0 / b);
                let mut right = 3.0 * ((y[i] - y[i - 1]) / (a * a) + (y[i + 1] - y[i]) / (b * b));
                if i == 1 {
                    right -= low * m[0];
                }
                if i == n - 2 {
                    right -= high * m[n - 1];
                }
                let low = if i == 1 { 0.0 } else { low };
                let w = diagonal - low * c[i - 1];
                c[i] = high / w;
                d[i] = (right - low * d[i - 1]) / w;
            }
            m[n - 2] = d[n - 2];
            for i in (1..n - 2).rev() {
                m[i] = d[i] - c[i] * m[i + 1];
            }
        }
        Self { t: t.to_vec(), y: y.to_vec(), m }
    }

    /// Value at `at`; beyond the ends the last piece is continued.
    pub(crate) fn value(&self, at: f64) -> f64 {
        let n = self.t.len();
        if n == 1 {
            return self.y[0];
        }
        let i = self.t.partition_point(|&t| t <= at).clamp(1, n - 1) - 1;
        let h = self.t[i + 1] - self.t[i];
        let s = (at - self.t[i]) / h;
        let (y0, y1, m0, m1) = (self.y[i], self.y[i + 1], self.m[i] * h, self.m[i + 1] * h);
        let rise = y1 - y0;
        y0 + s * (m0 + s * (3.0 * rise - 2.0 * m0 - m1 + s * (m0 + m1 - 2.0 * rise)))
    }
}

/// Slope at the first of up to four points of the polynomial through them.
fn end_slope(t: &[f64], y: &[f64]) -> f64 {
    // Newton's divided differences; their derivative at the first point.
    let mut table = y.to_vec();
    let (mut slope, mut product) = (0.0, 1.0);
    for order in 1..t.len() {
        for i in 0..t.len() - order {
            table[i] = (table[i + 1] - table[i]) / (t[i + order] - t[i]);
        }
        slope += table[0] * product;
        product *= t[0] - t[order];
    }
    slope
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cubic_is_reproduced() {
        let f = |t: f64| 1.0 - 2.0 * t + 0.5 * t * t - 0.25 * t.powi(3);
        let t = [0.0, 0.3, 0.9, 1.0, 1.7, 2.0];
        let s = Spline::new(&t, &t.map(f));
        for at in [-0.05, 0.0, 0.1, 0.3, 0.55, 0.95, 1.5, 2.0, 2.05] {
            assert!((s.value(at) - f(at)).abs() < 1e-12, "{at}");
        }
    }

    #[test]
    fn the_error_falls_with_the_fourth_power_of_the_step() {
        let worst = |n: usize| {
            let t: Vec<f64> = (0..=n).map(|i| i as f64 / n as f64).collect();
            let y: Vec<f64> = t.iter().map(|t| (7.0 * t).sin()).collect();
            let s = Spline::new(&t, &y);
            (0..1000)
                .map(|i| f64::from(i) / 1000.0)
                .map(|a| (s.value(a) - (7.0 * a).sin()).abs())
                .fold(0.0, f64::max)
        };
        let ratio = worst(20) / worst(40);
        assert!((10.0..25.0).contains(&ratio), "{ratio}");
    }

    #[test]
    fn few_points_still_make_a_curve() {
        assert_eq!(Spline::new(&[1.0], &[3.0]).value(9.0), 3.0);
        assert!((Spline::new(&[0.0, 2.0], &[1.0, 5.0]).value(0.5) - 2.0).abs() < 1e-15);
        let three = Spline::new(&[0.0, 1.0, 2.0], &[0.0, 1.0, 4.0]);
        assert!((three.value(1.5) - 2.25).abs() < 1e-12);
    }
}
