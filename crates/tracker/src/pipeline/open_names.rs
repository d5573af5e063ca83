//! Tells which names stay open in a recording, and the likeliest cause.
//!
//! Owns: [`OpenNames`]. Must not: name anything.

use crate::discover::advice::causes;
use crate::message::Message;
use crate::observation::Observation;
use crate::rig::Rig;
use crate::table::{NodeSummary, Rows};

/// Part of a node's rows from which on it is told that its name stays open: fewer are a moment in which it crosses another.
const OPEN_PART: f64 = 0.01;
/// Frames in which causes are looked for.
const FRAMES: usize = 4000;

/// The first frames of a table, in which the cause is looked for where names stay open.
#[derive(Debug, Default)]
pub(super) struct OpenNames {
    rows: Rows,
}

impl OpenNames {
    /// Takes in the next frame.
    pub fn push(&mut self, frame: u64, time_s: f64, observations: &[Observation]) {
        if self.rows.frames() < FRAMES {
            self.rows.push(frame, time_s, observations);
        }
    }

    /// The nodes whose names stay open, and a sentence on them.
    pub fn told(
        &self,
        rig: &Rig,
        nodes: &[NodeSummary],
        rate_hz: Option<f64>,
    ) -> Option<(Vec<String>, Message)> {
        let is_open = |n: &&NodeSummary| {
            let rows = (n.seen + n.missing + n.ambiguous).max(1);
            n.ambiguous as f64 > OPEN_PART * rows as f64
        };
        let open: Vec<&NodeSummary> = nodes.iter().filter(is_open).collect();
        let most = open.iter().map(|n| n.ambiguous).max()?;
        let names: Vec<String> = open.iter().map(|n| n.node.clone()).collect();
        let cause = match causes(rig, &self.rows, rate_hz).into_iter().next() {
            Some(cause) => format!("Likeliest because {cause}"),
            None => {
                "Likeliest because markers are hidden, run together, or come back where another may be too"
                    .into()
            }
        };
        let words = format!(
            "in up to {most} frames something is seen that may be {}, and another marker too: these rows are ambiguous. {cause}",
            names.join(" or ")
        );
        Some((names, words.into()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observation::Status;
    use crate::table::Tally;
    use crate::track::tests::bed::{Bed, QUIET, scene, tumble};

    #[test]
    fn names_that_stay_open_are_told_with_their_cause_and_single_rows_are_not() {
        let link = ("rod", None, [360.0, 360.0], tumble(0.0, 5.0));
        let made = scene(2000, &[link], &[[20.0, 5.0], [90.0, -9.0]].map(|at| ("rod", at)));
        let rig = Bed::new(&made, QUIET).film.rig(0);
        let told = |ambiguous: u64| {
            let (mut names, mut tally) = (OpenNames::default(), Tally::new(&rig));
            for frame in 0..200_u64 {
                let status = if frame < ambiguous { Status::Ambiguous } else { Status::Seen };
                let seen = Observation { x_px: 100.0, y_px: 100.0, status, ..Observation::MISSING };
                let row = vec![seen; rig.nodes.len()];
                names.push(frame, frame as f64, &row);
                tally.push(&row);
            }
            names.told(&rig, &tally.summary(), Some(500.0))
        };
        assert!(told(2).is_none());
        let (names, words) = told(3).unwrap();
        assert_eq!(names.len(), 2);
        let words = words.to_string();
        assert!(
            words.contains("in up to 3 frames") && words.contains("which look the same after half a turn"),
            "{words}"
        );
    }
}
