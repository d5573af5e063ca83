//! Motion priors: the prediction error and the clutter to expect in a recording.
//!
//! Owns: [`MotionPriors`]. Must not: learn (`prior_estimator` does).

use nalgebra::Vector2;

use crate::rigid::body::Mechanism;
use crate::rigid::forecast::PredictionError;

/// Least reach of a body from its origin, px: a shorter one would turn a place's error into any angle.
pub(super) const LEAST_REACH_PX: f64 = 30.0;
/// Step of a body at its reach in the first frame that it is followed through, px.
const FIRST_STEP_PX: f64 = 25.0;
/// Step of the origin of a body of several nodes in that frame, px: its origin may be far from its markers.
const FIRST_BODY_STEP_PX: f64 = 150.0;
/// Step of a single marker in that frame, px.
const FIRST_MARKER_STEP_PX: f64 = 40.0;
/// Half width of the angles of a body of several nodes in that frame, rad: above pi, which is every angle.
const ANY_ANGLE_RAD: f64 = 4.0;
/// Lower bound of the prediction error before anything is learned, px.
const FLOOR_ERROR_PX: f64 = 1.0;
/// Detections per frame that are no node, before anything is learned.
const FIRST_CLUTTER: f64 = 0.5;

/// Motion priors of a recording.
#[derive(Debug, Clone)]
pub struct MotionPriors {
    /// Per body: lower bound of the prediction error.
    pub floor: Vec<PredictionError>,
    /// Per body: largest step from one frame to the next.
    pub first: Vec<PredictionError>,
    /// Detections per frame that are no node and do not stand still.
    pub clutter: f64,
    /// Places where something stands that is no node, px.
    pub standing: Vec<Vector2<f64>>,
    /// Added to every detection's uncertainty in square, px.
    pub floor_px: f64,
}

impl MotionPriors {
    /// Priors of any recording, before anything is learned of it.
    pub fn unknown(mechanism: &Mechanism, floor_px: f64) -> Self {
        let each = |k: f64| -> Vec<PredictionError> {
            mechanism
                .links
                .iter()
                .map(|l| {
                    let reach = l.reach_px(Vector2::zeros()).max(LEAST_REACH_PX);
                    PredictionError { angle_rad: k / reach, origin_px: k }
                })
                .collect()
        };
        let mut first = each(FIRST_STEP_PX);
        for (f, l) in first.iter_mut().zip(&mechanism.links) {
            if l.nodes.len() > 1 {
                f.angle_rad = ANY_ANGLE_RAD;
                f.origin_px = FIRST_BODY_STEP_PX;
            } else {
                f.origin_px = FIRST_MARKER_STEP_PX;
            }
        }
        Self { floor: each(FLOOR_ERROR_PX), first, clutter: FIRST_CLUTTER, standing: Vec::new(), floor_px }
    }
}
