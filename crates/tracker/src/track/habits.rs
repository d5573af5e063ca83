//! What was learned of a recording's motion and clutter.
//!
//! Owns: [`Habits`]. Must not: learn (`learn` does).

use nalgebra::Vector2;

use crate::rigid::body::Mechanism;
use crate::rigid::forecast::Unrest;

/// What was learned of a recording's motion and clutter.
#[derive(Debug, Clone)]
pub struct Habits {
    /// For each body the least unrest to reckon with.
    pub floor: Vec<Unrest>,
    /// For each body how far it may go in a frame.
    pub first: Vec<Unrest>,
    /// Detections per frame that are no node and do not stand still.
    pub clutter: f64,
    /// Places where something stands that is no node, px.
    pub standing: Vec<Vector2<f64>>,
    /// Added to every detection's uncertainty in square, px.
    pub floor_px: f64,
}

impl Habits {
    /// What holds of any recording.
    pub fn unknown(mechanism: &Mechanism, floor_px: f64) -> Self {
        let each = |k: f64| -> Vec<Unrest> {
            mechanism
                .links
                .iter()
                .map(|l| {
                    let reach = l.reach_px(Vector2::zeros()).max(30.0);
                    Unrest { angle_rad: k / reach, origin_px: k }
                })
                .collect()
        };
        let mut first = each(25.0);
        for (f, l) in first.iter_mut().zip(&mechanism.links) {
            if l.nodes.len() > 1 {
                f.angle_rad = 4.0;
                f.origin_px = 150.0;
            } else {
                f.origin_px = 40.0;
            }
        }
        Self { floor: each(1.0), first, clutter: 0.5, standing: Vec::new(), floor_px }
    }
}
