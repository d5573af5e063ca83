//! Lens correction of centres.
//!
//! Owns: [`Undistort`]. Must not: touch images.

use opencv::calib3d;
use opencv::core::{Mat, Point2d, Vector};
use opencv::prelude::*;

use super::Detection;
use crate::error::{Error, Fault, Place, Result};
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
            .at(Place::Key("lens".into()))
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
                .at(Place::Key("lens".into()))
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

    /// Moves the centres of detections to where they would be without distortion.
    ///
    /// # Errors
    /// [`Error::Detect`] with what OpenCV says.
    pub fn apply(&mut self, detections: &mut [Detection]) -> Result<()> {
        if detections.is_empty() {
            return Ok(());
        }
        self.points.clear();
        for d in detections.iter() {
            self.points.push(Point2d::new(d.x_px, d.y_px));
        }
        calib3d::undistort_points(
            &self.points,
            &mut self.straight,
            &self.matrix,
            &self.distortion,
            &Mat::default(),
            &self.matrix,
        )
        .map_err(failed)?;
        for (d, p) in detections.iter_mut().zip(&self.straight) {
            d.x_px = p.x;
            d.y_px = p.y;
        }
        Ok(())
    }
}
