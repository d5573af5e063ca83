//! Maps places of the plane to the picture and back, with slopes.
//!
//! Owns: [`Camera`], [`Slopes`], [`BY_EYE`]. Must not: estimate anything.
//!
//! ```text
//! plane P ─▶ m = B (P - c) / R ─▶ q = m / (1 - v·m) ─▶ picture p = c + R q (1 + k |q|²)
//! B = exp(-[[a, b], [b, -a]])      c: middle of the picture, R: half its diagonal, both in square pixels
//! ```
//! Any homography is such a B and v up to scale, turn and shift of the plane. For a pinhole camera of focal length f tilted
//! by t towards the direction phi, v has the length R tan(t) / f and (a, b) = -1/2 ln(cos t) (cos 2 phi, sin 2 phi).

use nalgebra::{Matrix2, Matrix2x5, Vector2, Vector5};

/// Numbers of a camera: a, b, v1, v2, k.
pub const NUMBERS: usize = 5;

/// Standard deviations of the numbers of a camera aimed by eye: 3 deg off square at two picture widths, pixels square to 0.2 %, a
/// lens that moves the corners by 3 %. They hold what the motion does not tell; a looser prior does harm there.
pub const BY_EYE: [f64; NUMBERS] = [0.001, 0.001, 0.01, 0.01, 0.03];

/// Part of the way to the fold of a barrel distortion up to which it is inverted: beyond it two places of the plane have one
/// picture.
const FOLD_PART: f64 = 0.95;

/// A camera of five numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    numbers: [f64; NUMBERS],
    /// Middle of the picture, px.
    middle: Vector2<f64>,
    /// Half the picture's diagonal, px.
    radius_px: f64,
    forth: Matrix2<f64>,
    back: Matrix2<f64>,
}

/// The derivatives of a place of the plane.
#[derive(Debug, Clone, Copy)]
pub struct Slopes {
    /// The place in the plane, px.
    pub place: Vector2<f64>,
    /// By the place in the picture.
    pub by_picture: Matrix2<f64>,
    /// By the camera's numbers, px.
    pub by_numbers: Matrix2x5<f64>,
}

/// exp([[a, b], [b, -a]]).
fn stretch(a: f64, b: f64) -> Matrix2<f64> {
    let r = a.hypot(b);
    Matrix2::identity() * r.cosh() + Matrix2::new(a, b, b, -a) * sinhc(r)
}

/// sinh(r) / r.
fn sinhc(r: f64) -> f64 {
    if r < 1e-4 { 1.0 + r * r / 6.0 } else { r.sinh() / r }
}

/// (cosh(r) - sinh(r) / r) / r², whose limit at 0 is 1/3.
fn slope_of_sinhc(r: f64) -> f64 {
    if r < 1e-2 { 1.0 / 3.0 + r * r / 30.0 } else { (r.cosh() - sinhc(r)) / (r * r) }
}

impl Camera {
    /// The camera of numbers a, b, v1, v2, k for a picture of a width and height in square pixels.
    pub fn new(numbers: [f64; NUMBERS], size_px: [f64; 2]) -> Self {
        let [w, h] = size_px;
        let [a, b, ..] = numbers;
        Self {
            numbers,
            middle: Vector2::new((w - 1.0) / 2.0, (h - 1.0) / 2.0),
            radius_px: w.hypot(h) / 2.0,
            forth: stretch(-a, -b),
            back: stretch(a, b),
        }
    }

    /// A pinhole camera of a focal length of `focal_px`, turned by `tilt_rad` away from facing the plane towards the direction
    /// `towards_rad` (x right, y down), with the lens's `k` and pixels `height` times as high as they are taken for.
    pub fn tilted(
        tilt_rad: f64,
        towards_rad: f64,
        focal_px: f64,
        k: f64,
        height: f64,
        size_px: [f64; 2],
    ) -> Self {
        let radius_px = size_px[0].hypot(size_px[1]) / 2.0;
        let strength = -0.5 * tilt_rad.cos().ln();
        let plain = stretch(-strength * (2.0 * towards_rad).cos(), -strength * (2.0 * towards_rad).sin());
        let vanishing =
            Vector2::new(towards_rad.cos(), towards_rad.sin()) * (radius_px * tilt_rad.tan() / focal_px);
        // Pixels that are higher than they are taken for make the picture flatter.
        let flat = Matrix2::new(1.0, 0.0, 0.0, 1.0 / height);
        // flat * plain is a symmetric stretch after a turn of the plane: the stretch is the root of its square.
        let both = flat * plain;
        let square = (both * both.transpose()).symmetric_eigen();
        let mean = (square.eigenvalues[0] * square.eigenvalues[1]).sqrt().ln() / 2.0;
        let log = square.eigenvectors
            * Matrix2::from_diagonal(&square.eigenvalues.map(|e| e.ln() / 2.0 - mean))
            * square.eigenvectors.transpose();
        // The mean is the plane's scale.
        let vanishing = flat.try_inverse().unwrap_or_else(Matrix2::identity) * vanishing;
        Self::new([-log[(0, 0)], -log[(0, 1)], vanishing.x, vanishing.y, k], size_px)
    }

    /// a, b, v1, v2, k.
    pub fn numbers(&self) -> [f64; NUMBERS] {
        self.numbers
    }

    /// The camera of the same picture with other numbers.
    #[must_use]
    pub fn with(&self, numbers: [f64; NUMBERS]) -> Self {
        let [a, b, ..] = numbers;
        Self { numbers, forth: stretch(-a, -b), back: stretch(a, b), ..*self }
    }

    /// Half the picture's diagonal, px.
    pub fn radius_px(&self) -> f64 {
        self.radius_px
    }

    /// Middle of the picture, px.
    pub fn middle(&self) -> Vector2<f64> {
        self.middle
    }

    fn vanishing(&self) -> Vector2<f64> {
        Vector2::new(self.numbers[2], self.numbers[3])
    }

    /// The place in the picture of a place of the plane, px.
    pub fn to_picture(&self, plane: Vector2<f64>) -> Vector2<f64> {
        let m = self.forth * (plane - self.middle) / self.radius_px;
        let q = m / (1.0 - self.vanishing().dot(&m));
        self.middle + q * (self.radius_px * (1.0 + self.numbers[4] * q.norm_squared()))
    }

    /// Distance from the middle without the lens, in R, of a distance `r` in the picture.
    fn straightened(&self, r: f64) -> f64 {
        let k = self.numbers[4];
        let most = if k < 0.0 { FOLD_PART / (-3.0 * k).sqrt() } else { f64::INFINITY };
        let mut s = r.min(most);
        for _ in 0..20 {
            let step = (s * (1.0 + k * s * s) - r) / (1.0 + 3.0 * k * s * s).max(0.05);
            s = (s - step).clamp(0.0, most);
            if step.abs() < 1e-15 {
                break;
            }
        }
        s
    }

    /// The place in the plane of a place in the picture, px.
    pub fn to_plane(&self, picture: Vector2<f64>) -> Vector2<f64> {
        let u = (picture - self.middle) / self.radius_px;
        let r = u.norm();
        let q = if r > 1e-12 { u * (self.straightened(r) / r) } else { u };
        let m = q / (1.0 + self.vanishing().dot(&q));
        self.middle + self.back * m * self.radius_px
    }

    /// Place in the plane of a point of the picture, and how much longer lengths about it are there, in the direction in which they are longest.
    pub fn flatten(&self, picture: Vector2<f64>) -> (Vector2<f64>, f64) {
        let s = self.slopes(picture);
        let m = s.by_picture;
        let even = (m[(0, 0)] + m[(1, 1)]).hypot(m[(1, 0)] - m[(0, 1)]);
        let odd = (m[(0, 0)] - m[(1, 1)]).hypot(m[(1, 0)] + m[(0, 1)]);
        (s.place, (even + odd) / 2.0)
    }

    /// Place in the plane of a point of the picture, with its slopes.
    pub fn slopes(&self, picture: Vector2<f64>) -> Slopes {
        let [a, b, .., k] = self.numbers;
        let v = self.vanishing();
        let u = (picture - self.middle) / self.radius_px;
        let r = u.norm();
        let s = self.straightened(r);
        let steep = 1.0 / (1.0 + 3.0 * k * s * s).max(0.05);
        let (q, dq_du) = if r > 1e-12 {
            let e = u / r;
            (e * s, Matrix2::identity() * (s / r) + e * e.transpose() * (steep - s / r))
        } else {
            (u, Matrix2::identity())
        };
        let w = 1.0 + v.dot(&q);
        let m = q / w;
        let dm_dq = (Matrix2::identity() - m * v.transpose()) / w;
        let big = self.radius_px;
        let (f, g) = (sinhc(a.hypot(b)), slope_of_sinhc(a.hypot(b)));
        let symmetric = Matrix2::new(a, b, b, -a);
        let by_a = (Matrix2::identity() * (a * f) + symmetric * (a * g) + Matrix2::new(f, 0.0, 0.0, -f)) * m;
        let by_b = (Matrix2::identity() * (b * f) + symmetric * (b * g) + Matrix2::new(0.0, f, f, 0.0)) * m;
        let by_v = self.back * (-m * q.transpose() / w);
        let by_k = self.back * dm_dq * (-q * (s * s * steep));
        Slopes {
            place: self.middle + self.back * m * big,
            by_picture: self.back * dm_dq * dq_du,
            by_numbers: Matrix2x5::from_columns(&[
                by_a * big,
                by_b * big,
                by_v.column(0) * big,
                by_v.column(1) * big,
                by_k * big,
            ]),
        }
    }

    /// The numbers as a vector.
    pub fn vector(&self) -> Vector5<f64> {
        Vector5::from(self.numbers)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [f64; 2] = [720.0, 560.0];

    fn cameras() -> Vec<Camera> {
        vec![
            Camera::new([0.0; 5], SIZE),
            Camera::new([0.01, -0.02, 0.06, -0.03, -0.2], SIZE),
            Camera::new([-0.002, 0.0, 0.0, 0.12, 0.1], SIZE),
            Camera::tilted(0.2, 0.7, 1400.0, -0.1, 1.05, SIZE),
        ]
    }

    #[test]
    fn there_and_back_is_the_same_place() {
        for camera in cameras() {
            for x in (60..660).step_by(60) {
                for y in (60..500).step_by(40) {
                    let p = Vector2::new(f64::from(x), f64::from(y));
                    let back = camera.to_picture(camera.to_plane(p));
                    assert!((back - p).norm() < 1e-9, "{camera:?} {p:?} {back:?}");
                }
            }
        }
    }

    #[test]
    fn slopes_are_differences() {
        for camera in cameras() {
            for p in [Vector2::new(100.0, 80.0), Vector2::new(600.0, 420.0), Vector2::new(359.5, 279.5)] {
                let s = camera.slopes(p);
                assert!((s.place - camera.to_plane(p)).norm() < 1e-9);
                // Central differences err by h² times the third derivative, some 1e-3 / px², and by rounding.
                let h = 1e-2;
                for axis in 0..2 {
                    let mut e = Vector2::zeros();
                    e[axis] = h;
                    let d = (camera.to_plane(p + e) - camera.to_plane(p - e)) / (2.0 * h);
                    assert!((d - s.by_picture.column(axis)).norm() < 1e-6, "{d:?} {s:?}");
                }
                for k in 0..NUMBERS {
                    let moved = |sign: f64| {
                        let mut numbers = camera.numbers();
                        numbers[k] += sign * 1e-5;
                        camera.with(numbers).to_plane(p)
                    };
                    let d = (moved(1.0) - moved(-1.0)) / 2e-5;
                    assert!((d - s.by_numbers.column(k)).norm() < 1e-4, "{k}: {d:?} {s:?}");
                }
            }
        }
    }

    #[test]
    fn a_tilted_pinhole_is_what_optics_says() {
        // A camera at a height of f over the middle, turned by t about the picture's y axis: a point (x, y) of the plane is
        // at f (x cos t, y) / (f + x sin t), but for scale and shift. Distances in the plane come back up to one scale.
        let (tilt, focal) = (0.3_f64, 1500.0);
        let camera = Camera::tilted(tilt, 0.0, focal, 0.0, 1.0, SIZE);
        let see = |x: f64, y: f64| {
            let depth = focal - x * tilt.sin();
            camera.middle() + Vector2::new(focal * x * tilt.cos() / depth, focal * y / depth)
        };
        let plane = [(0.0, 0.0), (100.0, 20.0), (-150.0, 90.0), (40.0, -200.0)].map(|(x, y)| {
            let p = camera.to_plane(see(x, y));
            (Vector2::new(x, y), p)
        });
        let ratio = |i: usize, j: usize| (plane[i].1 - plane[j].1).norm() / (plane[i].0 - plane[j].0).norm();
        for (i, j) in [(0, 2), (0, 3), (1, 2), (1, 3), (2, 3)] {
            assert!((ratio(i, j) / ratio(0, 1) - 1.0).abs() < 1e-9, "{i} {j}");
        }
    }

    #[test]
    fn high_pixels_flatten_the_picture_of_a_tilted_camera() {
        let plain = Camera::tilted(0.2, 0.7, 1400.0, 0.0, 1.0, SIZE);
        let high = Camera::tilted(0.2, 0.7, 1400.0, 0.0, 1.1, SIZE);
        let places = [[100.0, 100.0], [500.0, 130.0], [300.0, 400.0], [600.0, 500.0]].map(Vector2::from);
        let lengths = |see: &dyn Fn(Vector2<f64>) -> Vector2<f64>| {
            let p = places.map(see);
            [(p[0] - p[1]).norm(), (p[1] - p[2]).norm(), (p[2] - p[3]).norm(), (p[3] - p[0]).norm()]
        };
        let flatter = |p: Vector2<f64>| {
            let d = p - plain.middle();
            plain.middle() + Vector2::new(d.x, d.y / 1.1)
        };
        let (one, other) = (lengths(&|p| plain.to_plane(p)), lengths(&|p| high.to_plane(flatter(p))));
        for k in 1..4 {
            assert!((one[k] / one[0] - other[k] / other[0]).abs() < 1e-9, "{one:?} {other:?}");
        }
    }
}
