//! Holds the places that are compared with a film's truth, and the figures of the comparison.
//!
//! Owns: [`Tracked`], [`Score`] and its parts. Must not: compare.

use serde::Serialize;

use crate::table::NodeTable;

/// Visible part of a marker below which it need not be found.
pub const HALF: f64 = 0.5;
/// Visible part from which on a marker is fully visible; supersampled parts are known to 0.01.
pub const FULL: f64 = 0.99;

/// Places from a node table.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Tracked {
    /// Names of the nodes.
    pub nodes: Vec<String>,
    /// Indices of the frames, increasing.
    pub frames: Vec<u64>,
    /// Places by frame, then node, px; NaN where not seen.
    pub xy_px: Vec<[f64; 2]>,
    /// Stated standard uncertainties by frame, then node, px; empty if there are none.
    pub sigma_px: Vec<f32>,
}

impl From<&NodeTable> for Tracked {
    fn from(table: &NodeTable) -> Self {
        Self {
            nodes: table.meta.rig.nodes.iter().map(|n| n.name.clone()).collect(),
            frames: table.rows.frame.iter().map(|&f| f as u64).collect(),
            xy_px: table.rows.xy_px.chunks_exact(2).map(|p| [p[0], p[1]]).collect(),
            sigma_px: table.rows.sigma_px.clone(),
        }
    }
}

/// A tracked node and the true one it stands for.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Match {
    /// Name in the table.
    pub node: String,
    /// Name in the truth; `None` if it agrees with no marker that another node does not agree with more.
    pub truth: Option<String>,
    /// Part of the rows with this marker at least half visible in which the node agrees.
    pub coverage: f64,
}

/// Delay with which markers that came back were seen again.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Reacquisition {
    /// Times that a marker became fully visible again.
    pub cases: u64,
    /// Of these, seen in the very frame.
    pub at_once: u64,
    /// Seen within three frames, those at once included.
    pub within_3: u64,
    /// Not seen before it was hidden again or the recording ended.
    pub never: u64,
    /// Longest wait, frames, those never seen included.
    pub longest: u64,
}

/// Error of one body's angle.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AngleError {
    /// The body.
    pub body: String,
    /// Root mean square, deg, over frames in which at least two of its markers agree.
    pub rms_deg: f64,
    /// Largest, deg.
    pub worst_deg: f64,
    /// Frames.
    pub frames: u64,
}

/// The comparison of a node table with the truth.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Score {
    /// Frames compared: those of the truth that the table has.
    pub frames: u64,
    /// Frames of the truth that the table lacks.
    pub frames_missing: u64,
    /// Which node stands for which.
    pub matches: Vec<Match>,
    /// True nodes that no tracked one stands for.
    pub unmatched: Vec<String>,
    /// Rows in which a marker is at least half visible.
    pub visible_rows: u64,
    /// Of these, rows in which its node agrees.
    pub covered_rows: u64,
    /// `covered_rows / visible_rows`.
    pub coverage: f64,
    /// Wrong identities, rows.
    pub wrong: u64,
    /// Changes of the marker a node agrees with.
    pub switches: u64,
    /// Rows at the place of no visible marker.
    pub false_positives: u64,
    /// Markers coming back.
    pub reacquisition: Reacquisition,
    /// Root mean square error along x, px; markers fully visible.
    pub rms_x_px: f64,
    /// Root mean square error along y, px; markers fully visible.
    pub rms_y_px: f64,
    /// Mean error, x and y, px; markers fully visible.
    pub bias_px: [f64; 2],
    /// Standard deviation of error over stated uncertainty, both axes; `None` if none is stated.
    pub error_over_sigma: Option<f64>,
    /// Angle errors by body, in the truth's order.
    pub angles: Vec<AngleError>,
    /// The first wrong rows: frame, node, the marker it is at. At most ten.
    pub first_wrong: Vec<(u64, String, String)>,
}
