//! The user's limits of where markers are and how they look.
//!
//! Owns: [`Limits`]. Must not: find anything.

use super::picture::Picture;
use super::spot::Spot;
use crate::rig::Region;

/// The limits of spots. By default all pass.
#[derive(Debug, Clone, Default)]
pub struct Limits {
    /// Where they may be, px of the recording.
    pub region: Option<Region>,
    /// Pixels of the recording along one pixel of a work picture.
    pub shrink: usize,
    /// 1 where markers are brighter than what is around them, -1 where they are darker; `None` is either.
    pub sign: Option<f32>,
    /// Brightness, 0 to 255, that a pixel of a bright marker exceeds at least and that one of a dark marker falls below.
    pub level: Option<f32>,
}

impl Limits {
    /// For each pixel of an octave of such a size whether it is in the region; `None` where all are.
    pub fn mask(&self, (width, height): (usize, usize), octave: usize) -> Option<Vec<bool>> {
        let region = self.region.as_ref()?;
        let scale = (self.shrink.max(1) << octave) as f64;
        let recorded = |v: usize| (v as f64 + 0.5) * scale - 0.5;
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| [x, y]));
        Some(pixels.map(|p| region.contains(p.map(recorded))).collect())
    }

    /// Whether a spot may be a marker that is brighter (1) or darker (-1) than its surroundings, by its own brightness.
    pub fn allow(&self, spot: &Spot, picture: &Picture, sign: f32) -> bool {
        let Some(level) = self.level else { return true };
        let pixel = |v: f64, n: usize| (v.round().max(0.0) as usize).min(n.saturating_sub(1));
        let (x, y) = (pixel(spot.x, picture.width), pixel(spot.y, picture.height));
        let around = |c: usize, n: usize| c.saturating_sub(1)..(c + 2).min(n);
        around(y, picture.height)
            .flat_map(|j| around(x, picture.width).map(move |i| j * picture.width + i))
            .any(|k| sign * (f32::from(picture.luma[k]) - level) > 0.0)
    }
}
