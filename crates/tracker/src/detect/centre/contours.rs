//! Computes the paper's centre: OpenCV's `findContours` and `moments` (Section 5.2).
//!
//! Owns: [`contour_centres`]. It is what `--centroid contour` uses, and the oracle of the tests.

use opencv::core::{CV_8UC1, Mat, Point, Vector};
use opencv::imgproc::{self, CHAIN_APPROX_NONE, RETR_EXTERNAL};
use opencv::prelude::*;

use super::contour::Contour;
use crate::error::{Error, Fault, Result};

fn failed(e: opencv::Error) -> Error {
    Error::Detect(Fault::new("OpenCV", e.to_string()))
}

/// Outer contours of a mask (0 is background), row after row without gaps, in OpenCV's order.
///
/// OpenCV's own threads are switched off: its callers are parallel themselves.
///
/// # Errors
/// [`Error::Detect`] with what OpenCV says.
pub(crate) fn contour_centres(mask: &[u8], width: usize, height: usize) -> Result<Vec<Contour>> {
    static SINGLE: std::sync::Once = std::sync::Once::new();
    let mut threads = Ok(());
    SINGLE.call_once(|| threads = opencv::core::set_num_threads(1));
    threads.map_err(failed)?;
    let flat = Mat::from_slice(mask).map_err(failed)?;
    let image = flat.reshape(1, height as i32).map_err(failed)?;
    debug_assert_eq!(image.typ(), CV_8UC1);
    debug_assert_eq!(image.cols(), width as i32);
    let mut contours: Vector<Vector<Point>> = Vector::new();
    imgproc::find_contours(&image, &mut contours, RETR_EXTERNAL, CHAIN_APPROX_NONE, Point::new(0, 0))
        .map_err(failed)?;
    let mut centres = Vec::with_capacity(contours.len());
    for contour in &contours {
        let m = imgproc::moments(&contour, false).map_err(failed)?;
        if m.m00 > 0.0 {
            centres.push(Contour { x_px: m.m10 / m.m00, y_px: m.m01 / m.m00, area_px: m.m00 });
        }
    }
    Ok(centres)
}
