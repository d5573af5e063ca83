//! Tracks the nodes of a given rig live, frame by frame: nothing is filled in later.
//!
//! Owns: [`Tracker`]. Must not: look ahead.

use super::frame_tracker::FrameTracker;
use super::motion_priors::MotionPriors;
use super::rows::{Returns, observations, occlusions};
use crate::camera::Plane;
use crate::detect::Detection;
use crate::error::{Error, Fault, Result};
use crate::observation::Observation;
use crate::rig::Rig;
use crate::rigid::body::Mechanism;
use crate::rigid::index::DetectionIndex;
use crate::stop::Stop;
use crate::store::FrameStamp;

/// Follows the nodes of a given rig through a live recording, frame by frame. Nothing is filled in later.
#[derive(Debug, Clone)]
pub struct Tracker {
    frame_tracker: FrameTracker,
    plane: Plane,
    returns: Returns,
    last: Option<FrameStamp>,
}

impl Tracker {
    /// A tracker for a checked rig.
    ///
    /// # Errors
    /// [`Error::Rig`] where the rig is not valid.
    pub fn new(rig: &Rig) -> Result<Self> {
        rig.check("rig")?;
        let mechanism = Mechanism::new(rig, 0.3);
        let priors = MotionPriors::unknown(&mechanism, 0.05);
        let returns = Returns::new(mechanism.nodes);
        let frame_tracker = FrameTracker::new(mechanism, priors);
        Ok(Self { frame_tracker, plane: rig.plane(), returns, last: None })
    }

    /// The nodes in the next frame, in the rig's order; detections and nodes are in recorded pixels.
    ///
    /// # Errors
    /// [`Error::Argument`] if the frame does not come after the one before it.
    pub fn step(&mut self, stamp: &FrameStamp, detections: &[Detection]) -> Result<Vec<Observation>> {
        if let Some(last) = self.last
            && stamp.index <= last.index
        {
            return Err(Error::Argument(
                Fault::new(
                    "Tracker::step",
                    format!("frame {} comes after frame {}", stamp.index, last.index),
                )
                .advice("Give frames in the order of recording"),
            ));
        }
        self.last = Some(*stamp);
        let detections: Vec<Detection> =
            detections.iter().map(|d| d.to_square(self.plane.pixel_aspect).to_plane(&self.plane)).collect();
        let index = DetectionIndex::new(&detections);
        let seen = self.frame_tracker.step(stamp.index as f64, &index, None, &Stop::default())?;
        let mut row = observations(&self.frame_tracker.bodies.mechanism, &seen, &detections);
        for (k, occluded) in occlusions(&self.frame_tracker.bodies.mechanism, &seen).into_iter().enumerate() {
            // Live, a part is believed only if the marker was seen in the frame before.
            if occluded.is_some() && !self.returns.in_last(k) {
                row[k] = Observation::MISSING;
            }
        }
        row.iter_mut().for_each(|o| *o = o.to_recorded(&self.plane));
        self.returns.mark(&mut row);
        Ok(row)
    }
}
