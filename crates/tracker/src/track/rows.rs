//! Turns a frame's bodies into rows of nodes.
//!
//! Owns: [`observations`], [`occlusions`], [`Returns`]. Must not: decide anything.

use nalgebra::Vector2;

use super::seen::BodySeen;
use crate::detect::{Detection, Flags};
use crate::observation::{Observation, PART_SIGMA_PX, Status};
use crate::rigid::body::Mechanism;

/// The observations of one frame, in the order of the rig's nodes.
pub fn observations(mechanism: &Mechanism, seen: &[BodySeen], index: &[Detection]) -> Vec<Observation> {
    let mut out = vec![Observation::MISSING; mechanism.nodes];
    for (link, s) in mechanism.links.iter().zip(seen) {
        for (j, &node) in link.nodes.iter().enumerate() {
            if let Some(Some(d)) = s.picks.get(j) {
                let d = &index[*d];
                // A marker half hidden may agree by chance; its own uncertainty is that of a whole one.
                let doubt = d.flags.has(Flags::PARTIAL | Flags::MERGED | Flags::BORDER)
                    || d.area_px < link.whole_px[j];
                let sigma_px = d.sigma_px.hypot(link.excess_px as f32);
                out[node] = Observation {
                    x_px: d.x_px,
                    y_px: d.y_px,
                    sigma_px: if doubt { sigma_px.hypot(PART_SIGMA_PX) } else { sigma_px },
                    area_px: d.area_px,
                    status: Status::Seen,
                };
            } else if let Some(Some(b)) = s.occluded.get(j) {
                let d = &index[b.detection];
                // The blob only shows that the marker is there: its centre is where the body says. What is given
                // as uncertainty is the blob's whole disagreement, so that no fit gains from it.
                out[node] = Observation {
                    x_px: b.place.x,
                    y_px: b.place.y,
                    sigma_px: d.sigma_px.hypot(b.off.norm() as f32),
                    area_px: d.area_px,
                    status: Status::Seen,
                };
            } else if s.open.get(j) == Some(&true) {
                out[node].status = Status::Ambiguous;
            }
        }
    }
    out
}

/// For each node of the rig of which only a part is seen, how far that is from where its body says, px.
pub fn occlusions(mechanism: &Mechanism, seen: &[BodySeen]) -> Vec<Option<Vector2<f64>>> {
    let mut out = vec![None; mechanism.nodes];
    for (link, s) in mechanism.links.iter().zip(seen) {
        for (&node, b) in link.nodes.iter().zip(&s.occluded) {
            out[node] = b.map(|b| b.off);
        }
    }
    out
}

/// Marks the first frame in which a node is seen again.
#[derive(Debug, Clone)]
pub struct Returns {
    /// For each node whether it was seen before, and whether in the last frame.
    past: Vec<(bool, bool)>,
}

impl Returns {
    /// No frame yet.
    pub fn new(nodes: usize) -> Self {
        Self { past: vec![(false, false); nodes] }
    }

    /// Whether a node was seen in the last frame.
    pub fn in_last(&self, node: usize) -> bool {
        self.past[node].1
    }

    /// Marks one frame's nodes; frames must come in order.
    pub fn mark(&mut self, row: &mut [Observation]) {
        for (o, (ever, last)) in row.iter_mut().zip(&mut self.past) {
            let now = o.status == Status::Seen;
            if now && *ever && !*last {
                o.status = Status::Reacquired;
            }
            *ever |= now;
            *last = now;
        }
    }
}
