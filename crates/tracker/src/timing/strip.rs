//! Computes the strip along a line that holds all points of a line after rounding.
//!
//! Owns: [`Strip`]. Which slopes a strip of some height allows is exact from the hull of the points.

/// Height below which a strip holds whatever rounding to whole ticks does, ticks.
pub(super) const ROUNDED: f64 = 1.0 - 1e-9;

/// Points (k, ticks) seen from above and from below: the hull that holds all of them.
#[derive(Debug, Default, Clone)]
pub(super) struct Strip {
    /// The first point.
    pub(super) first: (i64, i64),
    upper: Vec<(i64, i64)>,
    lower: Vec<(i64, i64)>,
}

/// Number of ticks by which `b` is later than `a`. Stamps of damaged files may be as far apart as numbers go.
pub(super) fn ticks_between(a: i64, b: i64) -> f64 {
    (i128::from(b) - i128::from(a)) as f64
}

/// Twice the area of a triangle; above 0 if `c` lies to the left of the way from `a` to `b`.
fn turn(a: (i64, i64), b: (i64, i64), c: (i64, i64)) -> i128 {
    let side = |p: (i64, i64)| (i128::from(p.0) - i128::from(a.0), i128::from(p.1) - i128::from(a.1));
    let ((bx, by), (cx, cy)) = (side(b), side(c));
    bx * cy - by * cx
}

impl Strip {
    /// Adds a point to the right of all others.
    pub(super) fn push(&mut self, k: i64, ticks: i64) {
        let point = (k, ticks);
        if self.upper.is_empty() {
            self.first = point;
        }
        while let [.., a, b] = self.upper[..]
            && turn(a, b, point) >= 0
        {
            self.upper.pop();
        }
        self.upper.push(point);
        while let [.., a, b] = self.lower[..]
            && turn(a, b, point) <= 0
        {
            self.lower.pop();
        }
        self.lower.push(point);
    }

    /// Least and greatest of `ticks - step * k` over all points, from the first.
    pub(super) fn heights(&self, step: f64) -> (f64, f64) {
        let off = |p: &(i64, i64)| ticks_between(self.first.1, p.1) - step * (p.0 - self.first.0) as f64;
        let low = self.lower.iter().map(off).fold(f64::INFINITY, f64::min);
        let high = self.upper.iter().map(off).fold(f64::NEG_INFINITY, f64::max);
        (low, high)
    }

    /// Height of the strip of this slope that holds all points, ticks.
    pub(super) fn height(&self, step: f64) -> f64 {
        let (low, high) = self.heights(step);
        high - low
    }

    /// The slope of the lowest strip, and its height; `None` for fewer than two points.
    pub(super) fn lowest(&self) -> Option<(f64, f64)> {
        // The height is convex in the slope and has its corners at the slopes of the hull's edges.
        let slopes = |hull: &[(i64, i64)]| -> Vec<f64> {
            hull.windows(2).map(|w| ticks_between(w[0].1, w[1].1) / (w[1].0 - w[0].0) as f64).collect()
        };
        let slopes = [slopes(&self.upper), slopes(&self.lower)].concat();
        let heights = slopes.into_iter().map(|slope| (slope, self.height(slope)));
        heights.min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// The smallest and the greatest slope of strips up to `height`, around that of the lowest.
    pub(super) fn steps_within(&self, height: f64, best: f64) -> (f64, f64) {
        let length = self.lower.last().map_or(1, |p| p.0 - self.first.0).max(1) as f64;
        let edge = |sign: f64| {
            // Past this the ends alone are further apart.
            let (mut inside, mut outside) = (0.0, 2.0 * (height + 1.0) / length);
            for _ in 0..60 {
                let middle = (inside + outside) / 2.0;
                if self.height(best + sign * middle) < height {
                    inside = middle;
                } else {
                    outside = middle;
                }
            }
            best + sign * inside
        };
        (edge(-1.0), edge(1.0))
    }
}
