//! Defines the settings of a run.
//!
//! Owns: [`RunSettings`], [`Existing`]. Must not: look at a recording.

use std::ops::Range;
use std::path::PathBuf;

use serde_json::json;

use crate::csv_text::Cells;
use crate::detect::DetectSettings;
use crate::edits::Edits;
use crate::message::{Message, Setting};
use crate::rig::Rig;
use crate::source::{Interlaced, OpenOptions};
use crate::wanted::Wanted;

/// Treatment of an output that is there already.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Existing {
    /// Refuse.
    #[default]
    Refuse,
    /// Begin anew and replace it.
    Replace,
    /// Go on where an earlier run stopped; begin anew where none did.
    Resume,
}

/// Settings of a run.
#[derive(Debug, Clone, Default)]
pub struct RunSettings {
    /// The recording, as [`crate::source::open`] takes it.
    pub input: String,
    /// The table; `None` only collects rows in memory.
    pub output: Option<PathBuf>,
    /// Treatment of an output that is there already.
    pub existing: Existing,
    /// Whether the summary holds the table.
    pub collect: bool,
    /// The rig; `None` is found in the recording.
    pub rig: Option<Rig>,
    /// How the recording is read.
    pub open: OpenOptions,
    /// Frames to follow, the last one not among them; `None` is all.
    pub frames: Option<Range<u64>>,
    /// How markers are detected.
    pub detect: DetectSettings,
    /// Markers to follow; the default is those that stand out, or else those that move if it is clear which are meant.
    pub wanted: Wanted,
    /// Threads for detection; 0 is one for each core. The result is the same for any number.
    pub threads: usize,
    /// Decisions of people, made on the rows before they are written.
    pub edits: Option<Edits>,
    /// How a CSV writes names.
    pub cells: Cells,
    /// Files besides the recording that are read, which the output never replaces.
    pub reads: Vec<PathBuf>,
}

impl RunSettings {
    /// The setting for interlaced film, `null` unless it was given.
    pub(super) fn interlaced_json(&self) -> serde_json::Value {
        json!(Some(self.open.interlaced).filter(|i| *i != Interlaced::Refuse))
    }

    /// The markers that are to be followed: by the settings, or else by the rig.
    pub(super) fn asked(&self) -> &Wanted {
        let of_rig = self.rig.as_ref().map(|r| &r.wanted).filter(|_| self.wanted.is_default());
        of_rig.unwrap_or(&self.wanted)
    }

    /// The markers asked for as JSON, `null` unless something was asked.
    pub(super) fn wanted_json(&self) -> serde_json::Value {
        json!(Some(self.asked()).filter(|w| !w.is_default()))
    }

    /// The warning of a recording that is whole and ends before the frames that were asked for, its last frame being `last`.
    pub(super) fn beyond(&self, last: u64) -> Option<Message> {
        let asked = self.frames.as_ref().filter(|f| f.end < u64::MAX && last.saturating_add(1) < f.end)?;
        let words = format!("frames up to {} were asked for with ", asked.end - 1);
        Some(Message::from(words) + Setting::Frames + format!(", and the recording ends with frame {last}"))
    }

    /// The first frame and one past the last; `null` for an open end, as in `--frames 5..`.
    pub(super) fn frames_json(&self) -> serde_json::Value {
        json!(self.frames.as_ref().map(|r| [Some(r.start), (r.end < u64::MAX).then_some(r.end)]))
    }
}
