//! Leaves open what cannot be told of markers that are said to be at one place.
//!
//! Owns: [`leave_open`]. Must not: know how they were followed.

use crate::observation::{Observation, Status};

/// Two markers of one size are not nearer to each other than this, in radii: they are one, or one hides the other.
const APART_RADII: f64 = 0.25;
/// Radii of markers of one size are within this ratio.
const ONE_SIZE: f64 = 1.5;

/// Leaves open which of two markers of one size is at a place where both are said to be.
pub(super) fn leave_open(row: &mut [Observation], radius_px: &[f64]) {
    let one = |a: usize, b: usize| {
        let (small, large) = (radius_px[a].min(radius_px[b]), radius_px[a].max(radius_px[b]));
        let apart = (row[a].x_px - row[b].x_px).hypot(row[a].y_px - row[b].y_px);
        large < ONE_SIZE * small && apart < APART_RADII * small
    };
    let open: Vec<usize> = (0..row.len()).filter(|&a| (0..row.len()).any(|b| b != a && one(a, b))).collect();
    for k in open {
        row[k] = Observation { status: Status::Ambiguous, ..Observation::MISSING };
    }
}
