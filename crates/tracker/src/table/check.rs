//! Checks that a node table is valid, for whoever reads one and for whoever writes one.
//!
//! Owns: [`NodeTable::check`], [`first_fault`]. Must not: read or write.

use rayon::prelude::*;

use super::{NodeTable, Rows, STATUS_WORDS, row_fault};
use crate::error::{Error, Fault, Result};
use crate::observation::Status;
use crate::rig::Rig;

impl NodeTable {
    /// Checks everything a reader may rely on: as many rows as frames times nodes; frames and times increasing;
    /// a place, an uncertainty and an area exactly where a node is seen (what a person placed needs no area); no two nodes at one place in a frame.
    ///
    /// # Errors
    /// [`Error::Table`] naming the first row at fault; `name` is for the message.
    pub fn check(&self, name: &str) -> Result<()> {
        let (frames, nodes, rows) = (self.frames(), self.nodes(), &self.rows);
        let cells = frames * nodes;
        let lengths = [
            rows.time_s.len() * nodes,
            rows.xy_px.len() / 2,
            rows.sigma_px.len(),
            rows.area_px.len(),
            rows.status.len(),
        ];
        if lengths.iter().any(|&n| n != cells) || rows.xy_px.len() % 2 != 0 {
            return Err(Error::Table(Fault::new(
                name,
                format!("columns hold {lengths:?} values, expected {frames} frames x {nodes} nodes"),
            )));
        }
        match first_fault(rows, &self.meta.rig, None) {
            Some((row, problem)) => Err(row_fault(name, row, problem)),
            None => Ok(()),
        }
    }
}

/// The number and time of the frame before some rows.
pub(super) type Before = Option<(i64, f64)>;

/// The first of the rows of whole frames that is wrong, and what is wrong with it.
pub(super) fn first_fault(rows: &Rows, rig: &Rig, before: Before) -> Option<(usize, String)> {
    let block = Block { rows, rig, before };
    threads::install(|| {
        (0..rows.frames()).into_par_iter().filter_map(|t| block.frame_fault(t)).min_by_key(|(row, _)| *row)
    })
}

struct Block<'a> {
    rows: &'a Rows,
    rig: &'a Rig,
    before: Before,
}

impl Block<'_> {
    /// The first row of the `t`-th frame that is wrong, and what is wrong with it.
    fn frame_fault(&self, t: usize) -> Option<(usize, String)> {
        let (rows, nodes) = (self.rows, self.rig.nodes.len());
        let at = |n: usize| t * nodes + n;
        let before = if t > 0 { Some((rows.frame[t - 1], rows.time_s[t - 1])) } else { self.before };
        if rows.frame[t] < 0 {
            return Some((at(0), format!("frame {} is below 0", rows.frame[t])));
        }
        if !rows.time_s[t].is_finite() {
            return Some((at(0), format!("time_s of frame {} is {}", rows.frame[t], rows.time_s[t])));
        }
        if let Some((frame, time_s)) = before {
            if rows.frame[t] <= frame {
                return Some((at(0), format!("frame {} comes after frame {frame}", rows.frame[t])));
            }
            if rows.time_s[t] <= time_s {
                return Some((at(0), format!("time_s {} comes after {time_s}", rows.time_s[t])));
            }
        }
        let undecoded = |n: usize| rows.status[at(n)] == Status::Undecoded as u8;
        if let Some(n) = (1..nodes).find(|&n| undecoded(n) != undecoded(0)) {
            let problem = format!(
                "frame {} is undecoded for one of the nodes {} and {} only: a frame is decoded for all or for none",
                rows.frame[t], self.rig.nodes[0].name, self.rig.nodes[n].name
            );
            return Some((at(n), problem));
        }
        for n in 0..nodes {
            let k = at(n);
            let node = &self.rig.nodes[n].name;
            let Some(status) = Status::from_number(rows.status[k]) else {
                return Some((
                    k,
                    format!("status {} of node {node} is none of {STATUS_WORDS:?}", rows.status[k]),
                ));
            };
            let (x, y, s, a) = (rows.xy_px[2 * k], rows.xy_px[2 * k + 1], rows.sigma_px[k], rows.area_px[k]);
            let problem = if status.is_seen() {
                if !(x.is_finite() && y.is_finite()) {
                    format!("node {node} is {} but its place is ({x}, {y})", status.as_str())
                } else if !(s.is_finite() && s > 0.0) {
                    format!("node {node} is {} but its sigma_px is {s}", status.as_str())
                } else if !(a.is_finite() && a >= 0.0 || status == Status::Manual && a.is_nan()) {
                    format!("node {node} is {} but its area_px is {a}", status.as_str())
                } else if let Some(m) =
                    (0..n).find(|&m| rows.xy_px[2 * at(m)] == x && rows.xy_px[2 * at(m) + 1] == y)
                {
                    format!("nodes {} and {node} are at one place ({x}, {y})", self.rig.nodes[m].name)
                } else {
                    continue;
                }
            } else if !(x.is_nan() && y.is_nan() && s.is_nan() && a.is_nan()) {
                format!("node {node} is {} but has a place, a sigma_px or an area_px", status.as_str())
            } else {
                continue;
            };
            return Some((k, problem));
        }
        None
    }
}
