//! Counts what became of each node as the rows go by.
//!
//! Owns: [`Tally`], [`NodeSummary`]. Must not: keep rows.

use serde::Serialize;

use super::NodeTable;
use crate::observation::{Observation, Status};
use crate::rig::Rig;

/// Summary of one node over a recording.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NodeSummary {
    /// Its name.
    pub node: String,
    /// Its body.
    pub body: String,
    /// Frames in which its place is known.
    pub seen: u64,
    /// Frames among them in which a person said where it is, or what is it.
    pub manual: u64,
    /// How often it came back.
    pub reacquired: u64,
    /// Frames without it.
    pub missing: u64,
    /// Frames in which something may have been it.
    pub ambiguous: u64,
    /// Frames that could not be decoded; they count for none of the others.
    pub undecoded: u64,
    /// Frames in the longest stretch without its place from which it came back.
    pub longest_gap: u64,
    /// Frames at the end without its place: all of them if it was never seen.
    pub missing_at_end: u64,
    /// Root of the mean square of its standard uncertainty where seen, px; `None` if never seen.
    pub sigma_px: Option<f64>,
}

impl NodeSummary {
    /// Whether it was never seen, or is gone at the end for longer than it ever was before. A node that is hidden
    /// now and then and happens to be so in the last frame is not lost.
    pub fn stayed_lost(&self) -> bool {
        self.missing_at_end > self.longest_gap
    }
}

/// Counts what becomes of each node.
#[derive(Debug, Clone)]
pub struct Tally {
    nodes: Vec<NodeSummary>,
    squares: Vec<f64>,
}

impl Tally {
    /// Nothing counted yet.
    pub fn new(rig: &Rig) -> Self {
        let nodes: Vec<_> = rig
            .nodes
            .iter()
            .map(|node| NodeSummary {
                node: node.name.clone(),
                body: node.body.clone(),
                seen: 0,
                manual: 0,
                reacquired: 0,
                missing: 0,
                ambiguous: 0,
                undecoded: 0,
                longest_gap: 0,
                missing_at_end: 0,
                sigma_px: None,
            })
            .collect();
        Self { squares: vec![0.0; nodes.len()], nodes }
    }

    /// Counts one frame; `observations` is in the order of the rig's nodes.
    pub fn push(&mut self, observations: &[Observation]) {
        for ((node, square), o) in self.nodes.iter_mut().zip(&mut self.squares).zip(observations) {
            match o.status {
                Status::Seen | Status::Reacquired | Status::Manual => {
                    node.seen += 1;
                    node.manual += u64::from(o.status == Status::Manual);
                    node.reacquired += u64::from(o.status == Status::Reacquired);
                    node.longest_gap = node.longest_gap.max(node.missing_at_end);
                    node.missing_at_end = 0;
                    *square += f64::from(o.sigma_px).powi(2);
                    continue;
                }
                Status::Ambiguous => node.ambiguous += 1,
                Status::Missing => node.missing += 1,
                Status::Undecoded => {
                    // Nothing is known: the frame neither ends a gap nor makes it longer.
                    node.undecoded += 1;
                    continue;
                }
            }
            node.missing_at_end += 1;
        }
    }

    /// The summary of each node so far, in the rig's order.
    pub fn summary(&self) -> Vec<NodeSummary> {
        let mut nodes = self.nodes.clone();
        for (node, square) in nodes.iter_mut().zip(&self.squares) {
            node.sigma_px = (node.seen > 0).then(|| (square / node.seen as f64).sqrt());
        }
        nodes
    }
}

impl NodeTable {
    /// The summary of each node.
    pub fn summary(&self) -> Vec<NodeSummary> {
        let nodes = self.nodes();
        let mut tally = Tally::new(&self.meta.rig);
        let mut frame = Vec::with_capacity(nodes);
        for t in 0..self.frames() {
            frame.clear();
            frame.extend((0..nodes).filter_map(|n| self.rows.observation(t, n, nodes)));
            tally.push(&frame);
        }
        tally.summary()
    }
}
