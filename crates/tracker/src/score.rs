//! How good a node table is, measured against the truth of a film.
//!
//! Owns: [`Tracked`], [`Score`], [`score`]. Must not: know how the table was made.
//!
//! Names need not agree: a tracked node stands for the true node at whose place it is most often, each true node being
//! given away once. What is counted, with a place *agreeing* with a marker when it is within the limit (2 px) of it:
//!
//! - **coverage**: of all rows in which a true marker is at least half visible, the part in which its node agrees;
//! - **wrong**: rows whose place agrees with another marker and not with the node's own: a wrong identity;
//! - **switches**: how often the marker that a node agrees with changes;
//! - **false positives**: rows whose place agrees with no marker of which anything can be seen;
//! - **reacquisition**: each time a marker has been less than half visible (or is so at the start) and is fully visible
//!   again, the number of frames until its node agrees;
//! - **errors** of fully visible markers per axis, and of the angle between each body's tracked and true places.

mod compare;

use serde::Serialize;

use crate::error::{Error, Fault, Result};
use crate::film::Truth;
use crate::table::NodeTable;
use compare::Comparison;

/// Distance within which a place agrees with a marker, px.
pub const LIMIT_PX: f64 = 2.0;
/// A marker of which less is seen need not be found.
pub const HALF: f64 = 0.5;
/// A marker is fully visible when no more than this is missing; supersampled parts are known to 0.01.
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

/// How long markers that came back were not seen.
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

/// Compares a table with the truth; `limit_px` is [`LIMIT_PX`] unless there is a reason.
///
/// # Errors
/// [`Error::Argument`] if the two have no frame in common or the lengths do not fit.
pub fn score(tracked: &Tracked, truth: &Truth, limit_px: f64) -> Result<Score> {
    let n = tracked.nodes.len();
    if n == 0 || tracked.xy_px.len() != n * tracked.frames.len() {
        return Err(Error::Argument(Fault::new(
            "nodes",
            format!("{} places for {} frames of {n} nodes", tracked.xy_px.len(), tracked.frames.len()),
        )));
    }
    let rows = pair_frames(tracked, truth);
    if rows.is_empty() {
        return Err(Error::Argument(
            Fault::new("nodes", "no frame is both in the table and in the truth")
                .advice("Give the truth of the same film"),
        ));
    }
    Comparison { tracked, truth, rows, limit2: limit_px * limit_px }.score()
}

/// (row of the table, row of the truth) of each frame that both have.
fn pair_frames(tracked: &Tracked, truth: &Truth) -> Vec<(usize, usize)> {
    let mut pairs = Vec::new();
    let mut i = 0;
    for (k, frame) in truth.frames.iter().enumerate() {
        while i < tracked.frames.len() && tracked.frames[i] < frame.frame {
            i += 1;
        }
        if tracked.frames.get(i) == Some(&frame.frame) {
            pairs.push((i, k));
        }
    }
    pairs
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::{Film, preset};

    /// The truth of a short film and a table that says just that where a marker is half visible.
    fn perfect(name: &str) -> (Truth, Tracked) {
        let mut scene = preset(name, 1).unwrap();
        scene.frames = 300;
        let truth = Truth::of(&Film::new(&scene).unwrap());
        let tracked = Tracked {
            nodes: truth.nodes.iter().map(|(n, _)| format!("my {n}")).collect(),
            frames: truth.frames.iter().map(|f| f.frame).collect(),
            xy_px: truth
                .frames
                .iter()
                .flat_map(|f| {
                    f.nodes.iter().map(|n| if n.visible >= HALF { [n.x_px, n.y_px] } else { [f64::NAN; 2] })
                })
                .collect(),
            sigma_px: Vec::new(),
        };
        (truth, tracked)
    }

    #[test]
    fn the_truth_itself_is_without_fault() {
        for name in ["clean", "late", "dropout", "occluded"] {
            let (truth, tracked) = perfect(name);
            let s = score(&tracked, &truth, LIMIT_PX).unwrap();
            assert_eq!((s.wrong, s.switches, s.false_positives), (0, 0, 0), "{name}");
            assert_eq!(s.coverage, 1.0);
            assert_eq!(s.reacquisition.at_once, s.reacquisition.cases);
            assert_eq!(s.rms_x_px, 0.0);
            assert!(s.angles.iter().all(|a| a.rms_deg < 1e-10));
            assert_eq!(s.matches[3].truth.as_deref(), Some("n3"));
        }
        assert!(score(&perfect("late").1, &perfect("late").0, LIMIT_PX).unwrap().reacquisition.cases >= 5);
    }

    #[test]
    fn swapped_names_are_wrong_from_then_on() {
        let (truth, mut tracked) = perfect("clean");
        for row in 200..300 {
            tracked.xy_px.swap(row * 9, row * 9 + 1);
        }
        let s = score(&tracked, &truth, LIMIT_PX).unwrap();
        // Both are fully visible throughout: markers of the link in front.
        assert_eq!((s.wrong, s.switches), (200, 2));
        assert_eq!(s.first_wrong[0], (200, "my n0".into(), "n1".into()));
        assert!(s.coverage < 1.0);
    }

    #[test]
    fn places_of_nothing_are_false_positives() {
        let (truth, mut tracked) = perfect("clean");
        for row in 0..7 {
            tracked.xy_px[row * 9 + 4] = [5.0, 5.0];
        }
        let s = score(&tracked, &truth, LIMIT_PX).unwrap();
        assert_eq!((s.false_positives, s.wrong), (7, 0));
    }

    #[test]
    fn late_reacquisition_is_counted_in_frames() {
        let (truth, mut tracked) = perfect("clean");
        let hide = |truth: &mut Truth, frames: std::ops::Range<usize>| {
            frames.for_each(|f| truth.frames[f].nodes[0].visible = 0.0);
        };
        let mut truth = truth;
        hide(&mut truth, 50..60);
        hide(&mut truth, 100..110);
        for row in (50..62).chain(100..110) {
            tracked.xy_px[row * 9] = [f64::NAN; 2];
        }
        let s = score(&tracked, &truth, LIMIT_PX).unwrap();
        let mine = |r: &Reacquisition| (r.cases, r.at_once, r.longest);
        let (_, untouched) = perfect("clean");
        let rest = score(&untouched, &perfect("clean").0, LIMIT_PX).unwrap().reacquisition;
        assert_eq!(mine(&s.reacquisition), (rest.cases + 2, rest.at_once + 1, 2));
    }

    #[test]
    fn errors_and_angles_are_measured() {
        let (truth, mut tracked) = perfect("clean");
        tracked.xy_px.iter_mut().for_each(|p| p[0] += 0.25);
        tracked.sigma_px = vec![0.25; tracked.xy_px.len()];
        let s = score(&tracked, &truth, LIMIT_PX).unwrap();
        assert!((s.rms_x_px - 0.25).abs() < 1e-9 && s.rms_y_px < 1e-9 && (s.bias_px[0] - 0.25).abs() < 1e-9);
        assert!((s.error_over_sigma.unwrap() - 0.5f64.sqrt()).abs() < 1e-9);
        assert!(s.angles[0].rms_deg < 1e-9);
        // Turn everything by a tenth of a degree about the pivot.
        let (sin, cos) = 0.1f64.to_radians().sin_cos();
        for p in &mut tracked.xy_px {
            let (x, y) = (p[0] - 360.25, p[1] - 360.0);
            *p = [360.25 + cos * x - sin * y, 360.0 + sin * x + cos * y];
        }
        let s = score(&tracked, &truth, LIMIT_PX).unwrap();
        assert!((s.angles[1].rms_deg - 0.1).abs() < 1e-9, "{:?}", s.angles);
    }
}
