//! Takes frames that differ from each other, and finds what stands still in them.
//!
//! Owns: [`Sample`]. Must not: know of bodies.

use nalgebra::Vector2;

use super::median::middle;
use crate::detect::Detection;
use crate::error::Result;
use crate::rigid::index::DetectionIndex;
use crate::stop::Stop;
use crate::store::PlaneView;

/// Frames looked at, at most.
const FRAMES: usize = 3000;
/// Frames kept, at most.
const KEPT: usize = 400;
/// Below this a place has not changed, px.
const SAME_PLACE_PX: f64 = 1.5;
/// Within this of its middle a marker does not move, px. What half hides a disc shifts its centre by 0.42 of its radius:
/// 6 px for one of 14 px. Tested on standing balls of 2.5 to 15 px (`worst`), and on the ruler of `balltoss`.
pub const STILL_PX: f64 = 6.0;
/// Part of the kept frames in which a standing point is seen at least.
const STANDING_PART: f64 = 0.6;

/// Frames of a recording that differ, with their moving detections.
#[derive(Debug, Default)]
pub struct Sample {
    /// Indices in the store.
    pub frames: Vec<usize>,
    /// For each frame the detections that do not stand still.
    pub moving: Vec<Vec<Detection>>,
    /// Places that stay, px.
    pub standing: Vec<Vector2<f64>>,
    /// Whether all frames look alike.
    pub at_rest: bool,
}

fn at(d: &Detection) -> Vector2<f64> {
    Vector2::new(d.x_px, d.y_px)
}

impl Sample {
    /// Looks through a recording.
    ///
    /// # Errors
    /// [`crate::error::Error::Interrupted`] once `stop` was asked for.
    pub fn take(store: &PlaneView<'_>, stop: &Stop) -> Result<Self> {
        let n = store.len();
        let mut all: Vec<(usize, Vec<Detection>)> = Vec::new();
        let mut scratch = Vec::new();
        for k in 0..n.min(FRAMES) {
            stop.heed()?;
            let i = if n <= FRAMES { k } else { (k as u128 * n as u128 / FRAMES as u128) as usize };
            store.read(i, &mut scratch);
            if scratch.is_empty() {
                continue;
            }
            if let Some((_, last)) = all.last() {
                let index = DetectionIndex::new(last);
                let moved = scratch.iter().filter(|d| index.nearest(at(d), SAME_PLACE_PX).is_none()).count();
                // Noise and a glint make no new frame; a single mover among standing points does.
                if moved == 0 {
                    continue;
                }
            }
            all.push((i, scratch.clone()));
        }
        let m = all.len();
        let kept: Vec<(usize, Vec<Detection>)> = if m <= KEPT {
            all
        } else {
            let mut keep = vec![false; m];
            for k in 0..KEPT {
                keep[k * m / KEPT] = true;
            }
            all.into_iter().zip(keep).filter(|(_, k)| *k).map(|(f, _)| f).collect()
        };
        let mut sample = Self { at_rest: kept.len() < 5, ..Self::default() };
        if !sample.at_rest {
            sample.standing = standing(&kept, stop)?;
        }
        let still: Vec<Detection> = sample
            .standing
            .iter()
            .map(|p| Detection { x_px: p.x, y_px: p.y, ..Default::default() })
            .collect();
        let index = DetectionIndex::new(&still);
        for (i, detections) in kept {
            sample.frames.push(i);
            sample.moving.push(
                detections.into_iter().filter(|d| index.nearest(at(d), SAME_PLACE_PX).is_none()).collect(),
            );
        }
        Ok(sample)
    }
}

impl Sample {
    /// Frames that are given, with what stands still known.
    pub fn of(
        frames: Vec<usize>,
        standing: Vec<Vector2<f64>>,
        store: &PlaneView<'_>,
        stop: &Stop,
    ) -> Result<Self> {
        let still: Vec<Detection> =
            standing.iter().map(|p| Detection { x_px: p.x, y_px: p.y, ..Default::default() }).collect();
        let index = DetectionIndex::new(&still);
        let mut moving = Vec::with_capacity(frames.len());
        for &i in &frames {
            stop.heed()?;
            let mut seen = Vec::new();
            store.read(i, &mut seen);
            seen.retain(|d| index.nearest(at(d), SAME_PLACE_PX).is_none());
            moving.push(seen);
        }
        Ok(Self { frames, moving, standing, at_rest: false })
    }

    /// Counts a place among the standing, and what is seen there no longer among the moving. Whether there was
    /// any such.
    pub fn stands(&mut self, still: Vector2<f64>) -> bool {
        let mut changed = false;
        for frame in &mut self.moving {
            let before = frame.len();
            frame.retain(|d| (at(d) - still).norm() > STILL_PX);
            changed |= frame.len() != before;
        }
        if self.standing.iter().all(|p| (p - still).norm() > SAME_PLACE_PX) {
            self.standing.push(still);
        }
        changed
    }
}

/// The middle of places that are all but a tenth within [`STILL_PX`] of it: a marker that does not move.
pub fn still_place(places: &[Vector2<f64>]) -> Option<Vector2<f64>> {
    if places.is_empty() {
        return None;
    }
    let centre = middle(places);
    let far = places.iter().filter(|p| (*p - centre).norm() > STILL_PX).count();
    (10 * far <= places.len()).then_some(centre)
}

/// Places at which something is seen in most of the frames.
fn standing(kept: &[(usize, Vec<Detection>)], stop: &Stop) -> Result<Vec<Vector2<f64>>> {
    let skies: Vec<DetectionIndex<'_>> = kept.iter().map(|(_, d)| DetectionIndex::new(d)).collect();
    let mut out: Vec<Vector2<f64>> = Vec::new();
    // A standing point is in most frames, so in one of a few.
    for seed in [0, kept.len() / 4, kept.len() / 2, 3 * kept.len() / 4, kept.len() - 1] {
        for d in &kept[seed].1 {
            stop.heed()?;
            let place = at(d);
            if out.iter().any(|p| (p - place).norm() < SAME_PLACE_PX) {
                continue;
            }
            let hits: Vec<Vector2<f64>> = skies
                .iter()
                .filter_map(|s| s.nearest(place, SAME_PLACE_PX).map(|(k, _)| s.place(k)))
                .collect();
            if hits.len() as f64 >= STANDING_PART * kept.len() as f64 {
                out.push(hits.iter().sum::<Vector2<f64>>() / hits.len() as f64);
            }
        }
    }
    out.sort_by(|a, b| a.y.total_cmp(&b.y).then(a.x.total_cmp(&b.x)));
    Ok(out)
}
