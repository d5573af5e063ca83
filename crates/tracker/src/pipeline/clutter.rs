//! Decides whether most of what stands out in a recording is its background.
//!
//! Owns: [`is_cluttered`], [`is_cluttered_sample`]. Must not: find bodies.

use std::sync::Arc;

use crate::detect::{DetectSettings, Detection, Detector, Levels};
use crate::error::Result;
use crate::frame::Frame;
use crate::store::DetectionStore;

/// Number of frames that are looked at.
const FRAMES: usize = 25;
/// Maximum number of detections of a frame that are looked at.
const MOST_DETECTIONS: usize = 300;
/// Distance within which a detection stands at the same place in another frame, px: noise, and the camera's shake.
const SAME_PLACE_PX: f64 = 1.5;
/// Part of the frames in which a detection must be at the same place to stand still. Markers rest too, but in fewer frames.
const STANDING_PART: f64 = 0.85;
/// Least number of detections that stand still: a mechanism may carry fewer markers that hardly move.
const LEAST_STANDING: usize = 12;
/// Part of the detections that must stand still.
const CLUTTER_PART: f64 = 0.6;

/// Least number of detections in a frame whose sizes are compared: so many markers of one mechanism are made alike.
const MANY: usize = 15;
/// Ratio of the upper to the lower quartile of areas from which on detections are not made alike.
const UNLIKE: f64 = 3.0;

/// Whether most of what was detected is the background's, among which bodies are not sought first: it stands still, or is many
/// and of all sizes.
///
/// # Errors
/// That of the store.
pub(super) fn is_cluttered(store: &DetectionStore) -> Result<bool> {
    let n = store.len();
    let frames: Vec<Vec<Detection>> = (0..n)
        .step_by(n.div_ceil(FRAMES).max(1))
        .map(|i| {
            let mut found = Vec::new();
            store.read(i, &mut found);
            found
        })
        .collect();
    store.check()?;
    Ok(shows_clutter(&frames))
}

/// Whether a sample of frames, looked at before detection, shows clutter.
///
/// # Errors
/// Those of detection.
pub(super) fn is_cluttered_sample(
    frames: &[Frame],
    levels: &Arc<Levels>,
    settings: &DetectSettings,
) -> Result<bool> {
    let mut detector = Detector::new(Arc::clone(levels), settings)?;
    let mut all: Vec<Vec<Detection>> = Vec::with_capacity(frames.len());
    for frame in frames.iter().filter(|f| f.plane.is_some()) {
        let mut found = Vec::new();
        detector.detect(frame, &mut found)?;
        if all.is_empty() && found.len() < LEAST_STANDING {
            return Ok(false);
        }
        all.push(found);
    }
    Ok(shows_clutter(&all))
}

fn shows_clutter(found: &[Vec<Detection>]) -> bool {
    let mut areas: Vec<f64> = found.iter().flatten().map(|d| f64::from(d.area_px)).collect();
    let places = |f: &Vec<Detection>| f.iter().take(MOST_DETECTIONS).map(|d| [d.x_px, d.y_px]).collect();
    let frames: Vec<Vec<[f64; 2]>> = found.iter().map(places).collect();
    let mut counts: Vec<[usize; 2]> =
        (0..frames.len()).map(|i| [frames[i].len(), standing(&frames, i)]).collect();
    counts.sort_unstable();
    let Some(&[all, standing]) = counts.get(counts.len() / 2) else { return false };
    let stands = standing >= LEAST_STANDING && standing as f64 >= CLUTTER_PART * all as f64;
    areas.sort_unstable_by(f64::total_cmp);
    let quartile = |part: usize| areas.get(areas.len() * part / 4).copied().unwrap_or(0.0);
    stands || all >= MANY && quartile(3) > UNLIKE * quartile(1)
}

/// Detections of a frame that stand still.
fn standing(frames: &[Vec<[f64; 2]>], i: usize) -> usize {
    let near = |a: &[f64; 2], b: &[f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]) < SAME_PLACE_PX;
    let there = |p: &[f64; 2]| frames.iter().filter(|f| f.iter().any(|q| near(p, q))).count();
    frames[i].iter().filter(|p| there(p) as f64 >= STANDING_PART * frames.len() as f64).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_of_a_background_stand_still_and_markers_do_not() {
        let marks = |k: usize| (0..20).map(move |i| [30.0 * i as f64 + 0.1 * (k % 3) as f64, 50.0]);
        let markers = |k: usize| (0..9).map(move |i| [10.0 * i as f64 + 7.0 * k as f64, 150.0]);
        let both: Vec<Vec<[f64; 2]>> = (0..25).map(|k| marks(k).chain(markers(k)).collect()).collect();
        assert!((0..25).all(|i| standing(&both, i) == 20));
        let moving: Vec<Vec<[f64; 2]>> = (0..25).map(|k| markers(k).collect()).collect();
        assert!((0..25).all(|i| standing(&moving, i) == 0));
    }
}
