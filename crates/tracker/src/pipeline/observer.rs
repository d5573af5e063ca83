//! Defines who watches a run: progress, and the wish to stop.
//!
//! Owns: [`Observer`], [`Stage`]. Must not: hold a clock; observers may.

use super::candidates::Candidates;

/// Stage of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// Opening the recording.
    Open,
    /// Learning thresholds and noise from frames spread over it.
    Learn,
    /// Reading it through and detecting markers.
    Detect,
    /// Finding bodies and joints.
    Rig,
    /// Following the markers and writing the table.
    Track,
    /// Looking at what moves, where no markers stand out.
    Moving,
    /// Drawing the table into the recording.
    Draw,
}

impl Stage {
    /// A word for people.
    pub fn as_str(self) -> &'static str {
        match self {
            Stage::Open => "opening",
            Stage::Learn => "learning",
            Stage::Detect => "detecting",
            Stage::Rig => "finding the rig",
            Stage::Track => "tracking",
            Stage::Moving => "looking at what moves",
            Stage::Draw => "drawing",
        }
    }
}

/// Watches a run. All calls come from the thread that called `run`.
pub trait Observer {
    /// A stage begins; `total` frames are ahead, if that is known.
    fn stage(&mut self, _stage: Stage, _total: Option<u64>) {}

    /// The candidates among what moves are told: where it is unclear which are meant, and where more moves than is followed.
    fn candidates(&mut self, _found: Candidates) {}

    /// So many frames of the stage are done. Called some hundred times a second at most per thousand frames.
    fn progress(&mut self, _done: u64) {}

    /// Whether to stop: what was done is then made into a table. Asked often; must be cheap.
    fn interrupted(&mut self) -> bool {
        false
    }

    /// Whether to leave the table too, once stopped: the user asked twice, or waits too long.
    fn abandoned(&mut self) -> bool {
        false
    }
}

/// Watches nothing.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Observer for Silent {}
