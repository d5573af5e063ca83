//! Reads a recording through into detections, from its beginning or from where an earlier run stopped.
//!
//! Owns: [`Run`], what is learned before detection. Must not: look for a rig or follow markers.

use std::path::PathBuf;
use std::sync::Arc;

use super::ahead::End;
use super::clutter::is_cluttered_sample;
use super::detecting;
use super::moving;
use super::observer::{Observer, Stage};
use super::opening::{learn_and, sample};
use super::request::Request;
use super::settings::{Existing, RunSettings};
use super::state;
use crate::detect::{DetectSettings, Levels};
use crate::error::{Error, Result};
use crate::frame::{Ending, Frame, FrameSource, SourceInfo};
use crate::message::Message;
use crate::source::threads_note;
use crate::store::DetectionStore;
use crate::table::{Fingerprint, SourceFacts};

/// Number of frames that are looked at before detection.
const SAMPLES: usize = 12;

/// A run between its steps.
pub(super) struct Run<'a> {
    pub settings: &'a RunSettings,
    /// Files of the recording; none where it cannot be read again.
    pub files: Vec<PathBuf>,
    /// When they were changed, as the run found them.
    pub changes: Option<String>,
    pub detect: DetectSettings,
    pub facts: SourceFacts,
    pub info: SourceInfo,
    pub levels: Arc<Levels>,
    pub store: DetectionStore,
    pub resumed: u64,
    /// How reading ended, if an earlier run read all of the recording.
    finished: Option<End>,
    /// Whether the frames that were looked at before detection show more background than markers.
    pub cluttered: bool,
    pub warnings: Vec<Message>,
}

/// The source after some of its frames were looked at, what they teach, and whether they are cluttered.
fn learned(
    settings: &RunSettings,
    detect: &DetectSettings,
    source: Box<dyn FrameSource>,
    observer: &mut dyn Observer,
) -> Result<(Box<dyn FrameSource>, Levels, bool)> {
    observer.stage(Stage::Learn, None);
    let (source, samples) = sample(source, SAMPLES, observer)?;
    let (matters, how) = (moving::comes_first(settings), detect.clone());
    let look = move |frames: &[Frame], levels: &Levels| {
        Ok(matters && is_cluttered_sample(frames, &Arc::new(levels.clone()), &how)?)
    };
    let (levels, cluttered) = learn_and(samples, detect, settings.threads, observer, look)?;
    if observer.interrupted() {
        return Err(Error::Interrupted);
    }
    Ok((source, levels, cluttered))
}

impl<'a> Run<'a> {
    /// Learns what detection needs, or takes it from an earlier run.
    pub fn begin(
        settings: &'a RunSettings,
        request: Request,
        source: Box<dyn FrameSource>,
        observer: &mut dyn Observer,
    ) -> Result<(Self, Box<dyn FrameSource>)> {
        let Request { files, facts, info, detect, state } = request;
        let changes = state.changes.clone();
        let mut warnings = source.info().warnings.clone();
        warnings.extend(threads_note(settings.threads));
        let aspect = facts.pixel_aspect;
        if !aspect.is_square() {
            warnings.push(format!("{}, {}", aspect.words(), facts.pixel_aspect_origin.words()).into());
        }
        let earlier = match &settings.output {
            Some(output) if settings.existing == Existing::Resume => state.resume(output)?,
            _ => None,
        };
        let (source, store, levels, finished, cluttered) = match earlier {
            Some(earlier) => {
                let store = DetectionStore::on_spool(earlier.spool)?;
                (source, store, earlier.levels, earlier.end, false)
            }
            None => {
                let (source, levels, cluttered) = learned(settings, &detect, source, observer)?;
                let store = match &settings.output {
                    Some(output) if files.is_empty() => {
                        // Nothing could go on from a state of this run; one of an earlier run is not this run's.
                        state::remove(output)?;
                        DetectionStore::new()
                    }
                    Some(output) => DetectionStore::on_spool(state.create(output, &levels)?)?,
                    None => DetectionStore::new(),
                };
                (source, store, levels, None, cluttered)
            }
        };
        let store = store.of_pixels(aspect);
        let run = Self {
            settings,
            files,
            changes,
            detect,
            facts,
            info,
            levels: Arc::new(levels),
            // A store that is begun is empty.
            resumed: store.len() as u64,
            store,
            finished,
            cluttered,
            warnings,
        };
        Ok((run, source))
    }

    /// Reads the recording through. `None` if the user stopped it.
    pub fn detect(
        &mut self,
        source: Box<dyn FrameSource>,
        observer: &mut dyn Observer,
    ) -> Result<Option<End>> {
        if let Some(end) = self.finished.take() {
            return Ok(Some(end));
        }
        let frames = self.settings.frames.clone().unwrap_or(0..u64::MAX);
        let total = self.facts.declared_frames.map(|n| n.min(frames.end).saturating_sub(frames.start));
        observer.stage(Stage::Detect, total);
        let mut detectors =
            detecting::Detectors::new(self.settings.threads, &self.levels, &self.detect, &self.facts)?;
        let outcome = detecting::detect_all(source, frames, &mut detectors, &mut self.store, observer);
        let end = match outcome {
            Ok(end) => end,
            Err(error) => {
                // What was done is kept; if the disk is full, what is on it already.
                let _ = self.store.close(None);
                return Err(error);
            }
        };
        let end = end.map(|end| self.unchanged(end)).transpose()?;
        let finished = end.as_ref().map(state::finished).transpose()?;
        self.store.close(finished.as_ref())?;
        Ok(end)
    }

    /// The end of the recording; an error if it became another one while it was read.
    fn unchanged(&self, end: End) -> Result<End> {
        if self.files.is_empty() || self.changes == Some(Fingerprint::of(&self.files)?.changes) {
            return Ok(end);
        }
        let reason =
            "it was written or replaced while it was read, so its frames may be of two recordings".into();
        Ok(End { ending: Ending::Early { frames: self.store.len() as u64, byte: None, reason }, ..end })
    }
}
