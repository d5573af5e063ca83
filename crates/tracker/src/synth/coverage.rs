//! Computes exactly how much of a pixel a disc or a turned rectangle covers.
//!
//! Owns: [`disc_rectangle_area`], [`Quad`]. Must not: know of images, light or markers.

/// Antiderivative of the half chord of a circle about the origin, the integral of sqrt(r2 - x2) dx.
fn half_chord_integral(x: f64, r: f64) -> f64 {
    let q = (x / r).clamp(-1.0, 1.0);
    0.5 * r * r * (q * (1.0 - q * q).max(0.0).sqrt() + q.asin())
}

/// Area that the disc of radius `r` about `(cx, cy)` shares with the rectangle `x0..x1`, `y0..y1`.
///
/// Exact up to rounding: the chord is integrated piece by piece between the places where the circle crosses
/// the rectangle's sides.
pub fn disc_rectangle_area(cx: f64, cy: f64, r: f64, x: [f64; 2], y: [f64; 2]) -> f64 {
    let (x0, x1, y0, y1) = (x[0] - cx, x[1] - cx, y[0] - cy, y[1] - cy);
    let (a, b) = (x0.max(-r), x1.min(r));
    if a >= b || y0 >= r || y1 <= -r || y0 >= y1 {
        return 0.0;
    }
    let far_x = x0.abs().max(x1.abs());
    let far_y = y0.abs().max(y1.abs());
    if far_x * far_x + far_y * far_y <= r * r {
        return (x1 - x0) * (y1 - y0);
    }
    // Where the circle crosses the lines y = y0 and y = y1, within a..b.
    let mut cuts = [a, b, b, b, b, b];
    let mut n = 1;
    let mut crossings = [f64::NAN; 4];
    for (k, edge) in [y0, y1].into_iter().enumerate() {
        if edge.abs() < r {
            let c = (r * r - edge * edge).sqrt();
            crossings[2 * k] = -c;
            crossings[2 * k + 1] = c;
        }
    }
    for c in crossings {
        if c > a && c < b {
            cuts[n] = c;
            n += 1;
        }
    }
    cuts[n] = b;
    let cuts = &mut cuts[..=n];
    cuts.sort_unstable_by(f64::total_cmp);
    let mut area = 0.0;
    for piece in cuts.windows(2) {
        let (p, q) = (piece[0], piece[1]);
        if q <= p {
            continue;
        }
        let middle = 0.5 * (p + q);
        let h = (r * r - middle * middle).max(0.0).sqrt();
        if y1 <= -h || y0 >= h {
            continue;
        }
        let arc = half_chord_integral(q, r) - half_chord_integral(p, r);
        let upper = if y1 >= h { arc } else { y1 * (q - p) };
        let lower = if y0 <= -h { -arc } else { y0 * (q - p) };
        area += (upper - lower).max(0.0);
    }
    area
}

/// A rectangle in any direction: a link or a screen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quad {
    /// The point with coordinates (0, 0) of the rectangle, px.
    pub origin: [f64; 2],
    /// Unit vector along, image coordinates.
    pub along: [f64; 2],
    /// Unit vector across, image coordinates.
    pub across: [f64; 2],
    /// Extent along, px.
    pub u: [f64; 2],
    /// Extent across, px.
    pub v: [f64; 2],
}

impl Quad {
    /// Coordinates (along, across) of an image point.
    pub fn local(&self, x: f64, y: f64) -> [f64; 2] {
        let (dx, dy) = (x - self.origin[0], y - self.origin[1]);
        [dx * self.along[0] + dy * self.along[1], dx * self.across[0] + dy * self.across[1]]
    }

    /// Whether an image point is inside.
    pub fn contains(&self, x: f64, y: f64) -> bool {
        let [u, v] = self.local(x, y);
        u >= self.u[0] && u <= self.u[1] && v >= self.v[0] && v <= self.v[1]
    }

    /// Area shared with a disc.
    pub fn disc_area(&self, x: f64, y: f64, r: f64) -> f64 {
        let [u, v] = self.local(x, y);
        disc_rectangle_area(u, v, r, self.u, self.v)
    }

    /// Smallest and largest x and y.
    pub fn bounds(&self) -> ([f64; 2], [f64; 2]) {
        let (mut x, mut y) = ([f64::INFINITY, f64::NEG_INFINITY], [f64::INFINITY, f64::NEG_INFINITY]);
        for u in self.u {
            for v in self.v {
                let px = self.origin[0] + u * self.along[0] + v * self.across[0];
                let py = self.origin[1] + u * self.along[1] + v * self.across[1];
                x = [x[0].min(px), x[1].max(px)];
                y = [y[0].min(py), y[1].max(py)];
            }
        }
        (x, y)
    }

    /// Part of the pixel about `(x, y)` that is covered, 0 to 1; exact.
    pub fn pixel_coverage(&self, x: f64, y: f64) -> f64 {
        let [u, v] = self.local(x, y);
        // Distance inside of the nearest side; half a pixel's diagonal decides most pixels.
        let inside = (u - self.u[0]).min(self.u[1] - u).min(v - self.v[0]).min(self.v[1] - v);
        if inside >= std::f64::consts::FRAC_1_SQRT_2 {
            return 1.0;
        }
        if inside <= -std::f64::consts::FRAC_1_SQRT_2 {
            return 0.0;
        }
        // The pixel in the rectangle's coordinates, clipped by one side after the other.
        let mut polygon = [[0.0; 2]; 8];
        let mut count = 4;
        for (k, [sx, sy]) in [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]].into_iter().enumerate() {
            polygon[k] =
                [u + sx * self.along[0] + sy * self.along[1], v + sx * self.across[0] + sy * self.across[1]];
        }
        for (axis, limit, sign) in
            [(0, self.u[0], 1.0), (0, self.u[1], -1.0), (1, self.v[0], 1.0), (1, self.v[1], -1.0)]
        {
            let mut clipped = [[0.0; 2]; 8];
            let mut kept = 0;
            for k in 0..count {
                let (p, q) = (polygon[k], polygon[(k + 1) % count]);
                let (dp, dq) = (sign * (p[axis] - limit), sign * (q[axis] - limit));
                if dp >= 0.0 {
                    clipped[kept] = p;
                    kept += 1;
                }
                if (dp >= 0.0) != (dq >= 0.0) {
                    let s = dp / (dp - dq);
                    clipped[kept] = [p[0] + s * (q[0] - p[0]), p[1] + s * (q[1] - p[1])];
                    kept += 1;
                }
            }
            polygon = clipped;
            count = kept;
            if count == 0 {
                return 0.0;
            }
        }
        let mut twice = 0.0;
        for k in 0..count {
            let (p, q) = (polygon[k], polygon[(k + 1) % count]);
            twice += p[0] * q[1] - p[1] * q[0];
        }
        (0.5 * twice.abs()).min(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn disc_coverage_over_all_pixels_is_its_area() {
        for (cx, cy, r) in
            [(10.0, 10.0, 4.0), (10.3, 9.71, 6.25), (10.5, 10.5, 0.2), (9.999, 10.0, 0.5), (10.1, 10.2, 1e-3)]
        {
            let mut sum = 0.0;
            for py in 0..21 {
                for px in 0..21 {
                    let (x, y) = (f64::from(px), f64::from(py));
                    let c = disc_rectangle_area(cx, cy, r, [x - 0.5, x + 0.5], [y - 0.5, y + 0.5]);
                    assert!((0.0..=1.0 + 1e-12).contains(&c));
                    sum += c;
                }
            }
            // 441 sums of terms of order 1 rounded at 1e-16: far under 1e-9.
            assert!((sum - PI * r * r).abs() < 1e-9, "{cx} {cy} {r}: {sum}");
        }
    }

    #[test]
    fn disc_coverage_agrees_with_counting_points() {
        // 400 x 400 points per pixel miscount only on the boundary: about perimeter / 400 = 0.004 px.
        let (cx, cy, r) = (0.37, -0.21, 0.8);
        for (px, py) in [(0.0, 0.0), (1.0, 0.0), (0.0, -1.0), (1.0, -1.0), (-1.0, 1.0)] {
            let n = 400;
            let mut hits = 0;
            for i in 0..n {
                for j in 0..n {
                    let x = px - 0.5 + (f64::from(i) + 0.5) / f64::from(n) - cx;
                    let y = py - 0.5 + (f64::from(j) + 0.5) / f64::from(n) - cy;
                    hits += i32::from(x * x + y * y <= r * r);
                }
            }
            let counted = f64::from(hits) / f64::from(n * n);
            let exact = disc_rectangle_area(cx, cy, r, [px - 0.5, px + 0.5], [py - 0.5, py + 0.5]);
            assert!((counted - exact).abs() < 2e-3, "({px}, {py}): {counted} {exact}");
        }
    }

    #[test]
    fn coverage_centroid_is_the_disc_centre() {
        // First moments need the sub-pixel centroid too, so use pixels of 1/8: the remaining error is of
        // boundary pixels only and falls with the square of the pixel.
        let (cx, cy, r, h) = (5.123, 4.877, 3.0, 0.125);
        let (mut s, mut sx, mut sy) = (0.0, 0.0, 0.0);
        for j in 0..88 {
            for i in 0..88 {
                let (x, y) = (f64::from(i) * h, f64::from(j) * h);
                let c =
                    disc_rectangle_area(cx, cy, r, [x - h / 2.0, x + h / 2.0], [y - h / 2.0, y + h / 2.0]);
                s += c;
                sx += c * x;
                sy += c * y;
            }
        }
        assert!((sx / s - cx).abs() < 1e-4 && (sy / s - cy).abs() < 1e-4, "{} {}", sx / s, sy / s);
    }

    #[test]
    fn quad_coverage_over_all_pixels_is_its_area() {
        for turn in [0.0, 0.1, 0.78, 1.2, 2.9] {
            let (s, c) = f64::sin_cos(turn);
            let quad = Quad {
                origin: [20.2, 19.7],
                along: [s, c],
                across: [c, -s],
                u: [-3.0, 11.5],
                v: [-2.2, 1.9],
            };
            let mut sum = 0.0;
            for y in 0..40 {
                for x in 0..40 {
                    sum += quad.pixel_coverage(f64::from(x), f64::from(y));
                }
            }
            assert!((sum - 14.5 * 4.1).abs() < 1e-9, "{turn}: {sum}");
        }
    }
}
