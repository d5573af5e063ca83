//! Holds the rows of a node table in memory, column by column.
//!
//! Owns: [`Rows`], [`NodeTable`], the names of the columns, the words of the column `status`. Must not: read or write files.

use super::TableMeta;
use crate::error::{Error, Fault, Place};
use crate::observation::{Observation, STATUSES, Status};

/// Columns of the table in their order.
pub const COLUMNS: [&str; 9] =
    ["frame", "time_s", "node", "body", "x_px", "y_px", "sigma_px", "area_px", "status"];

/// The words of the column `status`, by their number in [`Rows::status`].
pub const STATUS_WORDS: [&str; STATUSES.len()] =
    ["missing", "seen", "reacquired", "ambiguous", "undecoded", "manual"];

/// T frames of N nodes, column by column. What is not seen is NaN.
#[derive(Debug, Clone, Default)]
pub struct Rows {
    /// Index in the recording, (T,).
    pub frame: Vec<i64>,
    /// Time in s, (T,).
    pub time_s: Vec<f64>,
    /// Centres in px, (T, N, 2): x right, y down.
    pub xy_px: Vec<f64>,
    /// Standard uncertainty of each coordinate in px, (T, N).
    pub sigma_px: Vec<f32>,
    /// Blob area in px, (T, N).
    pub area_px: Vec<f32>,
    /// [`Status`] as a number, (T, N).
    pub status: Vec<u8>,
}

impl Rows {
    /// Number of frames.
    pub fn frames(&self) -> usize {
        self.frame.len()
    }

    /// Adds one frame; `observations` is in the order of the rig's nodes.
    pub fn push(&mut self, frame: u64, time_s: f64, observations: &[Observation]) {
        self.frame.push(frame as i64);
        self.time_s.push(time_s);
        for o in observations {
            // Only what is seen has a place; whatever else the caller holds is not part of the table.
            let o = if o.status.is_seen() {
                *o
            } else {
                Observation { status: o.status, ..Observation::MISSING }
            };
            self.xy_px.extend([o.x_px, o.y_px]);
            self.sigma_px.push(o.sigma_px);
            self.area_px.push(o.area_px);
            self.status.push(o.status as u8);
        }
    }

    /// Empties it and keeps its memory.
    pub fn clear(&mut self) {
        self.frame.clear();
        self.time_s.clear();
        self.xy_px.clear();
        self.sigma_px.clear();
        self.area_px.clear();
        self.status.clear();
    }

    /// The observation of node `n` of `nodes` in the `t`-th frame; `None` outside.
    pub fn observation(&self, t: usize, n: usize, nodes: usize) -> Option<Observation> {
        let k = t * nodes + n;
        (n < nodes && t < self.frames()).then(|| Observation {
            x_px: self.xy_px[2 * k],
            y_px: self.xy_px[2 * k + 1],
            sigma_px: self.sigma_px[k],
            area_px: self.area_px[k],
            status: Status::from_number(self.status[k]).unwrap_or_default(),
        })
    }

    /// Whether all values are the same, bit for bit but for NaN.
    pub fn same(&self, other: &Self) -> bool {
        let same64 = |a: &[f64], b: &[f64]| {
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a == b || (a.is_nan() && b.is_nan()))
        };
        let same32 = |a: &[f32], b: &[f32]| {
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a == b || (a.is_nan() && b.is_nan()))
        };
        self.frame == other.frame
            && same64(&self.time_s, &other.time_s)
            && same64(&self.xy_px, &other.xy_px)
            && same32(&self.sigma_px, &other.sigma_px)
            && same32(&self.area_px, &other.area_px)
            && self.status == other.status
    }
}

/// A node table with all that is known of where it comes from.
#[derive(Debug, Clone)]
pub struct NodeTable {
    /// Rig, recording, settings, ending.
    pub meta: TableMeta,
    /// The rows.
    pub rows: Rows,
}

impl NodeTable {
    /// Number of nodes N.
    pub fn nodes(&self) -> usize {
        self.meta.rig.nodes.len()
    }

    /// Number of frames T.
    pub fn frames(&self) -> usize {
        self.rows.frames()
    }
}

/// A fault that names a row of a table, counted from 0 over all its rows.
pub(super) fn row_fault(name: &str, row: usize, problem: String) -> Error {
    Error::Table(Fault::new(name, problem).at(Place::Row(row as u64)))
}
