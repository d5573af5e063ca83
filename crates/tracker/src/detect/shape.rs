//! What a blob's shape says about how far its centre can be trusted.
//!
//! Owns: [`judge`], [`two_discs`]. Must not: move a centre.

use super::Flags;
use super::centre::Centre;
use super::levels::Levels;
use super::runs::Blob;

/// Mean square of weighted residuals above which a blob is not a whole marker: three times what the worst of
/// the learned markers have.
pub(crate) fn misfit_limit(levels: &Levels) -> f64 {
    levels.marker.map_or(f64::INFINITY, |m| 3.0 * m.chi2_high.max(1.0))
}

/// Flags of a blob: saturated, at a border, more than one marker, less than one.
pub(crate) fn judge(blob: &Blob, centre: &Centre, levels: &Levels) -> Flags {
    let mut flags = 0;
    if centre.saturated >= 3 {
        flags |= Flags::SATURATED;
    }
    if blob.border {
        flags |= Flags::BORDER;
    }
    if centre.parted {
        flags |= Flags::MERGED;
    }
    let area = blob.area as f64;
    if let (Some(whole), Some(marker)) = (levels.marker_area_px, levels.marker) {
        // Markers of one size: the spread of radii counts twice in the area; pixels on the edge come and go.
        let edge = 2.0 * (std::f64::consts::PI / whole).sqrt();
        let slack = (4.0 * marker.radius_spread).max(0.5 * edge).max(0.06);
        let noise = levels.noise.variance(levels.noise.dark).sqrt() / levels.contrast;
        let ratio = area / whole;
        let misfit = centre.fitted.map_or(f64::INFINITY, |f| f.chi2) > misfit_limit(levels);
        if ratio > 1.3 && (misfit || blob.elongation() > 1.4) {
            flags |= Flags::MERGED;
        } else if misfit || ratio < 1.0 - slack - 2.0 * noise {
            flags |= Flags::PARTIAL;
        }
    }
    Flags(flags)
}

/// Where two equal discs would have to be to give a blob its area and its longer axis, `[x, y, radius]` each;
/// `None` where it does not look like two markers.
pub(crate) fn two_discs(blob: &Blob, levels: &Levels) -> Option<[[f64; 3]; 2]> {
    let (whole, marker) = (levels.marker_area_px?, levels.marker?);
    if !(1.25..=2.4).contains(&(blob.area as f64 / whole)) || blob.border {
        return None;
    }
    let r = marker.radius_px;
    let apart = (blob.axes()[0] - r * r / 4.0).max(0.0).sqrt();
    if apart < 0.45 * r {
        return None;
    }
    let ([x, y], [ax, ay]) = (blob.mean(), blob.direction());
    Some([[x - apart * ax, y - apart * ay, r], [x + apart * ax, y + apart * ay, r]])
}
