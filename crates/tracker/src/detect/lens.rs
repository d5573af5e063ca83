//! Corrects centres for the lens's distortion.
//!
//! Owns: [`Undistort`]. Must not: touch images.

use opencv::calib3d;
use opencv::core::{Mat, Point2d, TermCriteria, TermCriteria_COUNT, TermCriteria_EPS, Vector};
use opencv::prelude::*;

use super::detection::Detection;
use crate::error::{Error, Fault, Result};
use crate::rig::Lens;

/// OpenCV's `undistortPoints` with one camera matrix and one set of coefficients. Corrected centres are in
/// pixels of the same camera without distortion.
pub(crate) struct Undistort {
    matrix: Mat,
    distortion: Mat,
    points: Vector<Point2d>,
    straight: Vector<Point2d>,
}

// OpenCV's matrices are reference-counted with atomics and each detector has its own.
impl std::fmt::Debug for Undistort {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Undistort").finish_non_exhaustive()
    }
}

fn failed(e: opencv::Error) -> Error {
    Error::Detect(
        Fault::new("lens", e.to_string())
            .advice("Give the camera matrix and the coefficients as OpenCV's calibrateCamera does"),
    )
}

impl Undistort {
    /// Checks and keeps a lens.
    ///
    /// # Errors
    /// [`Error::Detect`] for numbers that are no camera.
    pub fn new(lens: &Lens) -> Result<Self> {
        let m = &lens.camera_matrix;
        let count = lens.distortion.len();
        let known = [0, 4, 5, 8, 12, 14];
        if !(m[0][0] > 0.0 && m[1][1] > 0.0)
            || m.iter().flatten().chain(&lens.distortion).any(|v| !v.is_finite())
            || !known.contains(&count)
        {
            return Err(Error::Detect(
                Fault::new(
                    "lens",
                    format!(
                        "focal lengths {} and {} px with {count} distortion coefficients are no camera",
                        m[0][0], m[1][1]
                    ),
                )
                .advice("Give focal lengths above 0 and 0, 4, 5, 8, 12 or 14 coefficients"),
            ));
        }
        let distortion = if count == 0 {
            Mat::default()
        } else {
            Mat::from_slice(&lens.distortion).and_then(|m| m.try_clone()).map_err(failed)?
        };
        Ok(Self {
            matrix: Mat::from_slice_2d(m).map_err(failed)?,
            distortion,
            points: Vector::new(),
            straight: Vector::new(),
        })
    }

    /// Moves the centres of detections to where they would be without distortion. An uncertainty grows by the
    /// most that the correction stretches its surroundings in any direction.
    ///
    /// # Errors
    /// [`Error::Detect`] with what OpenCV says.
    pub fn apply(&mut self, detections: &mut [Detection]) -> Result<()> {
        if detections.is_empty() {
            return Ok(());
        }
        // Each centre with a point to its right and one below: their differences are the correction's slopes.
        self.points.clear();
        for d in detections.iter() {
            for (dx, dy) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)] {
                self.points.push(Point2d::new(d.x_px + dx, d.y_px + dy));
            }
        }
        // Five rounds, OpenCV's default, leave 0.01 px at the corners of a wide lens.
        let until = TermCriteria::new(TermCriteria_COUNT + TermCriteria_EPS, 50, 1e-9).map_err(failed)?;
        calib3d::undistort_points_iter(
            &self.points,
            &mut self.straight,
            &self.matrix,
            &self.distortion,
            &Mat::default(),
            &self.matrix,
            until,
        )
        .map_err(failed)?;
        for (i, d) in detections.iter_mut().enumerate() {
            let at = |k: usize| self.straight.get(3 * i + k).map_err(failed);
            let (p, right, below) = (at(0)?, at(1)?, at(2)?);
            let ([a, c], [b, e]) = ([right.x - p.x, right.y - p.y], [below.x - p.x, below.y - p.y]);
            // The largest singular value of [[a, b], [c, e]].
            let stretch = ((a + e).hypot(c - b) + (a - e).hypot(c + b)) / 2.0;
            d.sigma_px *= stretch as f32;
            d.x_px = p.x;
            d.y_px = p.y;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LENS: ([[f64; 3]; 3], [f64; 5]) =
        ([[1400.0, 0.0, 640.0], [0.0, 1410.0, 500.0], [0.0, 0.0, 1.0]], [-0.21, 0.08, 0.0012, -0.0007, 0.01]);

    fn lens() -> Lens {
        Lens { camera_matrix: LENS.0, distortion: LENS.1.to_vec() }
    }

    /// Where a camera with the lens sees what one without would see at a place: OpenCV's documented model,
    /// written out here on its own.
    fn distort([x, y]: [f64; 2]) -> [f64; 2] {
        let (m, [k1, k2, p1, p2, k3]) = LENS;
        let (u, v) = ((x - m[0][2]) / m[0][0], (y - m[1][2]) / m[1][1]);
        let r = u * u + v * v;
        let radial = 1.0 + r * (k1 + r * (k2 + r * k3));
        let du = u * radial + 2.0 * p1 * u * v + p2 * (r + 2.0 * u * u);
        let dv = v * radial + p1 * (r + 2.0 * v * v) + 2.0 * p2 * u * v;
        [m[0][0] * du + m[0][2], m[1][1] * dv + m[1][2]]
    }

    #[test]
    fn centres_come_back_to_where_no_lens_would_show_them() {
        let mut undistort = Undistort::new(&lens()).unwrap();
        for x in (0..=1280).step_by(160) {
            for y in (0..=1024).step_by(128) {
                let ideal = [f64::from(x), f64::from(y)];
                let [x_px, y_px] = distort(ideal);
                let mut seen = [Detection { x_px, y_px, sigma_px: 0.01, ..Detection::default() }];
                undistort.apply(&mut seen).unwrap();
                let d = seen[0];
                assert!((d.x_px - ideal[0]).hypot(d.y_px - ideal[1]) < 1e-6, "{ideal:?} {d:?}");
                // The slopes of the model, turned round: a step of the seen place in the worst direction.
                let part = |dx: f64, dy: f64| {
                    let [a, b] = distort([ideal[0] + dx, ideal[1] + dy]);
                    let [c, e] = distort([ideal[0] - dx, ideal[1] - dy]);
                    [(a - c) / (2.0 * (dx + dy)), (b - e) / (2.0 * (dx + dy))]
                };
                let ([a, c], [b, e]) = (part(0.01, 0.0), part(0.0, 0.01));
                let least = ((a + e).hypot(c - b) - (a - e).hypot(c + b)) / 2.0;
                // Differences over a whole pixel: the slope changes by under 1e-3 over it.
                assert!((f64::from(d.sigma_px) / 0.01 * least - 1.0).abs() < 1e-3, "{ideal:?} {d:?}");
            }
        }
    }

    #[test]
    fn without_distortion_nothing_moves() {
        let plain = Lens { distortion: Vec::new(), ..lens() };
        let mut seen = [Detection { x_px: 33.3, y_px: 44.4, sigma_px: 0.5, ..Detection::default() }];
        Undistort::new(&plain).unwrap().apply(&mut seen).unwrap();
        assert!((seen[0].x_px - 33.3).abs() < 1e-9 && (seen[0].y_px - 44.4).abs() < 1e-9);
        assert!((seen[0].sigma_px - 0.5).abs() < 1e-6);
    }

    #[test]
    fn what_is_no_camera_is_refused() {
        let bad = [
            Lens { distortion: vec![0.1; 3], ..lens() },
            Lens { camera_matrix: [[0.0; 3]; 3], ..lens() },
            Lens { distortion: vec![f64::NAN; 5], ..lens() },
        ];
        for lens in bad {
            let text = Undistort::new(&lens).unwrap_err().to_string();
            assert!(text.contains("no camera") && text.contains("4, 5, 8"), "{text}");
        }
    }
}
