//! Links a recording, or stretches of a long one.
//!
//! Owns: [`link`]. Must not: hold more than the stretches.

use super::linker::Linker;
use super::tracklet::Tracklet;
use crate::detect::Detection;
use crate::error::Result;
use crate::stop::Stop;
use crate::store::PlaneView;

/// Frames that are linked at most.
const FRAMES: usize = 20_000;
/// Stretches of a longer recording.
const STRETCHES: usize = 10;
/// Detections that are linked at most: some two seconds of work.
const DETECTIONS: usize = 1_000_000;
/// Frames from which the number of detections a frame is estimated.
const COUNTED: usize = 25;
/// Detections of a frame beyond which it is full of glints, and ends all tracklets.
const CROWD: usize = 400;

/// Tracklets of a recording, the longest first; of one of more than 20,000 frames or a million detections, those of ten
/// stretches.
///
/// # Errors
/// [`crate::error::Error::Interrupted`] once `stop` was asked for.
pub fn link(view: &PlaneView<'_>, stop: &Stop) -> Result<Vec<Tracklet>> {
    let n = view.len();
    let mut linker = Linker::default();
    let mut scratch: Vec<Detection> = Vec::new();
    let counted = n.min(COUNTED);
    let mut count = 0;
    for k in 0..counted {
        view.read(k * n / counted, &mut scratch);
        count += scratch.len().min(CROWD);
    }
    let most = FRAMES.min(DETECTIONS * counted / count.max(1));
    let stretches = if n <= most { 1 } else { STRETCHES };
    let length = n.min(most) / stretches;
    for s in 0..stretches {
        let first = s * (n - length) / (stretches - 1).max(1);
        for i in first..first + length {
            stop.heed()?;
            view.read(i, &mut scratch);
            if scratch.len() <= CROWD {
                linker.push(i, &scratch);
            }
        }
    }
    Ok(linker.finish())
}
