//! Fits the circle on which a marker goes about a joint that has no marker.
//!
//! Owns: [`Circle`]. A lone marker has no angle of its own; that it keeps its distance from a point of the image or of
//! another body shows where its link turns.

use nalgebra::{Matrix3, Vector2, Vector3};

/// Scatter of the radius up to which places lie on a circle, px, and the same as a part of the radius.
const SCATTER_PX: f64 = 0.5;
const SCATTER_PART: f64 = 0.004;
/// Least places.
const LEAST: usize = 20;
/// Part of the circle that must be seen, rad, where the marker goes to and fro on it.
const SPREAD_RAD: f64 = 0.5;
/// Part of the circle that must be seen, rad, where it does not: a parabola follows a circle for a while.
const WIDE_RAD: f64 = 2.5;

/// A circle through places.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Circle {
    /// Its middle, px.
    pub middle: Vector2<f64>,
    /// Root mean square distance of the places from it, px.
    pub rms_px: f64,
}

impl Circle {
    /// The circle on which all `places` lie, in the order of time; `None` if they lie on none or show too little of
    /// it.
    pub fn through(places: &[Vector2<f64>]) -> Option<Self> {
        if places.len() < LEAST {
            return None;
        }
        let n = places.len() as f64;
        let mean = places.iter().sum::<Vector2<f64>>() / n;
        // |p|^2 = 2 c p + k is linear in the middle c (Kasa); about the mean it is well conditioned.
        let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for p in places {
            let q = p - mean;
            let row = Vector3::new(q.x, q.y, 1.0);
            normal += row * row.transpose();
            right += row * q.norm_squared();
        }
        let x = normal.cholesky()?.solve(&right);
        let offset = Vector2::new(x[0], x[1]) / 2.0;
        let radius = (x[2] + offset.norm_squared()).max(0.0).sqrt();
        let middle = mean + offset;
        let square: f64 = places.iter().map(|p| ((p - middle).norm() - radius).powi(2)).sum();
        let rms_px = (square / (n - 3.0)).sqrt();
        if rms_px.is_nan() || rms_px > SCATTER_PX.max(SCATTER_PART * radius) || radius < 10.0 * SCATTER_PX {
            return None;
        }
        let (mut angle, mut low, mut high, mut way) = (0.0, 0.0_f64, 0.0_f64, 0.0);
        for pair in places.windows(2) {
            let (a, b) = (pair[0] - middle, pair[1] - middle);
            let step = a.perp(&b).atan2(a.dot(&b));
            angle += step;
            way += f64::abs(step);
            low = low.min(angle);
            high = high.max(angle);
        }
        let spread = high - low;
        (spread > WIDE_RAD || (spread > SPREAD_RAD && way > 1.5 * spread)).then_some(Self { middle, rms_px })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn swing(angle: impl Fn(f64) -> f64) -> Vec<Vector2<f64>> {
        (0..200)
            .map(|k| {
                let (s, c) = angle(f64::from(k) / 200.0).sin_cos();
                Vector2::new(300.0 + 150.0 * s, 200.0 + 150.0 * c)
            })
            .collect()
    }

    #[test]
    fn a_swing_shows_its_pivot() {
        let c = Circle::through(&swing(|t| 0.4 * (20.0 * t).sin())).unwrap();
        assert!((c.middle - Vector2::new(300.0, 200.0)).norm() < 1e-6, "{c:?}");
    }

    #[test]
    fn a_throw_and_a_short_arc_show_none() {
        let thrown: Vec<_> =
            (0..60).map(f64::from).map(|t| Vector2::new(4.0 * t, 0.05 * (t - 30.0).powi(2))).collect();
        assert_eq!(Circle::through(&thrown), None);
        assert_eq!(Circle::through(&swing(|t| 0.4 * t)), None);
    }
}
