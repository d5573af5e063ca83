//! Flags a blob by its shape: saturated, at a border, more than one marker, less than one.
//!
//! Owns: [`judge`], [`two_discs`]. Must not: move a centre.

use super::disc::Disc;
use super::disc_fit::Fitted;
use super::window::Centre;
use crate::detect::detection::Flags;
use crate::detect::label::components::Blob;
use crate::detect::levels::Levels;

/// Standard deviations between the median and the ninth decile of a normal distribution.
const DECILE_SIGMA: f64 = 1.28;
/// Saturated pixels from which a blob is flagged as saturated.
pub(crate) const SATURATED_PIXELS: u32 = 3;
/// Ratio of a blob's area to a marker's from which it may be two markers.
const MERGED_AREA: f64 = 1.3;
/// Longer over shorter axis from which a blob of such an area is two markers.
const MERGED_ELONGATION: f64 = 1.4;
/// Least relative slack of a marker's area below which it is a part.
const LEAST_AREA_SLACK: f64 = 0.06;
/// Areas, in units of one marker's, of blobs that are tried as two markers.
const TWO_AREAS: std::ops::RangeInclusive<f64> = 1.25..=2.4;
/// Half the distance of two markers' centres, in radii, from which two discs are tried.
const TWO_APART_RADII: f64 = 0.45;

/// Mean square of weighted residuals above which a blob is not a whole marker: three times what the worst of
/// the learned markers have.
pub(crate) fn misfit_limit(levels: &Levels) -> f64 {
    levels.marker.map_or(f64::INFINITY, |m| 3.0 * m.chi2_high.max(1.0))
}

/// Whether a disc fits worse than any whole marker. Where the learned ones fit as well as their noise lets them, six
/// standard deviations of chi-square beyond that are too many.
fn misfit(f: &Fitted, levels: &Levels) -> bool {
    let Some(m) = levels.marker else { return false };
    let spread = (2.0 / f.freedom).sqrt();
    let usual = (m.chi2 - 1.0).max(m.chi2_high - 1.0 - DECILE_SIGMA * spread).max(0.0);
    f.chi2 > misfit_limit(levels).min(1.0 + 6.0 * spread + 15.0 * usual)
}

/// By how much a disc is too large (above 1) or too small (below -1) for a marker: in noise a hidden edge and a second
/// marker behind show in the radius before they do in the misfit. The limit is 4.5 standard deviations of what the
/// noise and the markers' own radii do, at least a hundredth. Where markers are clear the misfit is enough, and one
/// marker may well be a little larger than the others.
fn wrong_size(f: &Fitted, levels: &Levels) -> f64 {
    let Some(m) = levels.marker.filter(|_| !levels.high_contrast()) else { return 0.0 };
    let own = m.radius_spread * m.radius_px / DECILE_SIGMA;
    let sigma = own.max(f.radius_sigma_px * f.chi2.max(1.0).sqrt());
    (f.radius_px - m.radius_px) / (4.5 * sigma).max(0.01 * m.radius_px)
}

/// Flags of a blob: saturated, at a border, more than one marker, less than one. Where discs are fitted to whole markers
/// (`fits_discs`), a blob that no disc fits is none.
pub(crate) fn judge(blob: &Blob, centre: &Centre, levels: &Levels, fits_discs: bool) -> Flags {
    let mut flags = 0;
    if centre.saturated >= SATURATED_PIXELS {
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
        let slack = (4.0 * marker.radius_spread).max(0.5 * edge).max(LEAST_AREA_SLACK);
        let noise = levels.noise.variance(levels.noise.dark).sqrt() / levels.contrast;
        let ratio = area / whole;
        let misfit = centre.fitted.map_or(fits_discs, |f| misfit(&f, levels));
        let size = centre.fitted.map_or(0.0, |f| wrong_size(&f, levels));
        if (ratio > MERGED_AREA
            && (misfit || blob.elongation(levels.pixel_aspect.sides()) > MERGED_ELONGATION))
            || size > 1.0
        {
            flags |= Flags::MERGED;
        } else if misfit || size < -1.0 || ratio < 1.0 - slack - 2.0 * noise {
            flags |= Flags::PARTIAL;
        }
    }
    Flags(flags)
}

/// Two equal discs that would give a blob its area and its longer axis;
/// `None` where it does not look like two markers.
pub(crate) fn two_discs(blob: &Blob, levels: &Levels) -> Option<[Disc; 2]> {
    let (whole, marker) = (levels.marker_area_px?, levels.marker?);
    if !TWO_AREAS.contains(&(blob.area as f64 / whole)) || blob.border {
        return None;
    }
    let r = marker.radius_px;
    let sides = levels.pixel_aspect.sides();
    let apart = (blob.axes(sides)[0] - r * r / 4.0).max(0.0).sqrt();
    if apart < TWO_APART_RADII * r {
        return None;
    }
    let ([x, y], [ax, ay]) = (blob.mean(), blob.direction(sides));
    let [dx, dy] = [apart * ax / sides[0], apart * ay / sides[1]];
    let at = |x_px, y_px| Disc { x_px, y_px, radius_px: r };
    Some([at(x - dx, y - dy), at(x + dx, y + dy)])
}
