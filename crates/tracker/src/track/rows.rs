//! Turns a frame's bodies into rows of nodes.
//!
//! Owns: [`observations`], [`occlusions`], [`Returns`]. Must not: decide anything.

use std::f64::consts::PI;

use nalgebra::Vector2;

use super::occluded::firm_place;
use super::seen::BodySeen;
use crate::detect::{Detection, Flags};
use crate::observation::{Observation, PART_SIGMA_PX, Status};
use crate::rigid::body::Mechanism;

/// The observations of one frame, in the order of the rig's nodes.
pub fn observations(mechanism: &Mechanism, seen: &[BodySeen], index: &[Detection]) -> Vec<Observation> {
    let mut out = vec![Observation::MISSING; mechanism.nodes];
    for (b, (link, s)) in mechanism.links.iter().zip(seen).enumerate() {
        for (j, &node) in link.nodes.iter().enumerate() {
            if let Some(Some(d)) = s.picks.get(j) {
                let d = &index[*d];
                let shared_px = shared_px(mechanism, seen, (b, j), d);
                // A marker half hidden may agree by chance; its own uncertainty is that of a whole one.
                let doubt = d.flags.has(Flags::PARTIAL | Flags::MERGED | Flags::BORDER)
                    || d.area_px < link.whole_px[j];
                let sigma_px = d.sigma_px.hypot(link.excess_px as f32).hypot(shared_px as f32);
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

/// The distance of a blob's centre from that of the marker that has it, px, where a marker of another body that is not seen elsewhere is
/// expected within the blob too: the centre is that of both, half as far from one as they are apart. 0 where there is none.
fn shared_px(mechanism: &Mechanism, seen: &[BodySeen], (b, j): (usize, usize), d: &Detection) -> f64 {
    let radius_px = |b: usize, j: usize| (mechanism.links[b].area_px[j].0 / PI).sqrt();
    let centre = Vector2::new(d.x_px, d.y_px);
    let mut most: f64 = 0.0;
    for (o, (link, s)) in mechanism.links.iter().zip(seen).enumerate().filter(|(o, _)| *o != b) {
        for k in (0..link.nodes.len()).filter(|&k| s.picks.get(k).is_some_and(Option::is_none)) {
            let Some(there) = firm_place(link, s, k) else { continue };
            let apart_px = (there - centre).norm();
            if apart_px < radius_px(b, j).min(radius_px(o, k)) {
                most = most.max(apart_px);
            }
        }
    }
    most
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
