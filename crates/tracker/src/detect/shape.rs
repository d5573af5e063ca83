//! What a blob's shape says about how far its centre can be trusted.
//!
//! Owns: [`judge`]. Must not: move a centre.

use super::Flags;
use super::centre::Centre;
use super::levels::Levels;
use super::runs::Blob;

/// Flags of a blob: saturated, at a border, more than one marker, less than one.
pub(crate) fn judge(blob: &Blob, centre: &Centre, levels: &Levels) -> Flags {
    let mut flags = 0;
    if centre.saturated >= 3 {
        flags |= Flags::SATURATED;
    }
    if blob.border {
        flags |= Flags::BORDER;
    }
    if let Some(whole) = levels.marker_area_px {
        let part = blob.area as f64 / whole;
        if part > 1.5 && (blob.elongation() > 1.35 || blob.fill() < 0.9) {
            flags |= Flags::MERGED;
        }
        if part < 0.75 {
            flags |= Flags::PARTIAL;
        }
    }
    Flags(flags)
}
