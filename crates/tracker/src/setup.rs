//! Finds the rig of a recording, with an annotated picture and advice.
//!
//! Owns: [`find`], [`Setup`]. Must not: find markers, bodies or places itself, or write files.

use std::sync::Arc;

use crate::detect::{DetectSettings, Detection, Detector, Flags};
use crate::discover::advice::advise;
use crate::error::{Error, Fault, FaultKind, Place, Result};
use crate::frame::Frame;
use crate::message::Message;
use crate::overlay::{self, Picture, still};
use crate::pipeline::{self, Candidates, Existing, Observer, RunSettings, Stage};
use crate::pixel_aspect::PixelAspect;
use crate::rig::Rig;
use crate::source::OpenOptions;
use crate::table::RunEnding;

/// The rig of a recording, with the reference picture and warnings.
#[derive(Debug)]
pub struct Setup {
    /// Nodes, bodies, joints and the reference picture.
    pub rig: Rig,
    /// Warnings about the rig and the recording, a sentence each.
    pub warnings: Vec<Message>,
    /// How the recording ended.
    pub ending: RunEnding,
    /// The reference picture with the rig and all other detections drawn.
    pub picture: Picture,
}

/// Finds the rig of a recording, which is read through for it and once more up to the reference picture. The output and
/// the rig of `settings` are not used.
///
/// # Errors
/// The error of the part that failed; [`Error::Interrupted`] if the observer asks to stop.
pub fn find(settings: &RunSettings, observer: &mut dyn Observer) -> Result<Setup> {
    if settings.input == "-" {
        return Err(Error::Argument(
            Fault::new("input", "standard input cannot be read again for the picture").advice("Give a file"),
        ));
    }
    let mut observer = Hears { inner: observer, candidates: Candidates::default() };
    let observer = &mut observer;
    let settings = RunSettings {
        output: None,
        existing: Existing::Refuse,
        collect: true,
        rig: None,
        ..settings.clone()
    };
    let summary = pipeline::run(&settings, observer)?;
    if summary.meta.ending == RunEnding::Interrupted {
        return Err(Error::Interrupted);
    }
    let mut warnings = summary.warnings;
    warnings.extend(summary.meta.damage.words().map(Into::into));
    if let RunEnding::Early { reason, .. } = &summary.meta.ending {
        warnings.push(format!("the recording ended early: {reason}").into());
    }
    let rig = summary.meta.rig;
    if let (Some(table), false) = (&summary.table, summary.moving) {
        warnings
            .extend(advise(&rig, &table.rows, summary.meta.source.rate_hz).into_iter().map(Message::from));
    }
    let index = rig.reference_frame.unwrap_or(0);
    let (frame, detections, _) = frame_at(&settings, index, !summary.moving, observer)?;
    let saturated = detections.iter().filter(|d| d.flags.has(Flags::SATURATED)).count();
    if saturated > 0 {
        warnings.push(format!(
            "{saturated} of {} markers are saturated in the reference picture: their centres are less exact. Less \
             light or a shorter exposure helps",
            detections.len()
        ).into());
    }
    let others = observer.candidates.all.iter().filter(|c| !c.followed).cloned().collect::<Vec<_>>();
    warnings.extend(others.iter().map(|c| format!("also moving, number {}", c.line()).into()));
    let picture = still(&frame, &rig, &detections, &others)?;
    Ok(Setup { rig, warnings, ending: summary.meta.ending, picture })
}

/// The picture of what was found where it is not clear what is meant: each with its number and its path.
///
/// # Errors
/// Those of reading and of drawing; [`Error::Interrupted`] if the observer asks to stop.
pub fn picture_of(
    settings: &RunSettings,
    found: &Candidates,
    observer: &mut dyn Observer,
) -> Result<Picture> {
    let (frame, _, aspect) = frame_at(settings, found.frame, false, observer)?;
    overlay::candidates(&frame, aspect, &found.all)
}

/// Hears of what else moves.
struct Hears<'a> {
    inner: &'a mut dyn Observer,
    candidates: Candidates,
}

impl Observer for Hears<'_> {
    fn stage(&mut self, stage: Stage, total: Option<u64>) {
        self.inner.stage(stage, total);
    }

    fn candidates(&mut self, found: Candidates) {
        self.inner.candidates(found.clone());
        self.candidates = found;
    }

    fn progress(&mut self, done: u64) {
        self.inner.progress(done);
    }

    fn interrupted(&mut self) -> bool {
        self.inner.interrupted()
    }

    fn abandoned(&mut self) -> bool {
        self.inner.abandoned()
    }
}

/// A frame of a recording and, if that is wanted, what is detected in it.
fn frame_at(
    settings: &RunSettings,
    index: u64,
    detects: bool,
    observer: &mut dyn Observer,
) -> Result<(Frame, Vec<Detection>, PixelAspect)> {
    let RunSettings { input, open, detect, threads, .. } = settings;
    // Detection looks at brightness alone, with and without the colours of the picture.
    let open = OpenOptions { colour: true, ..open.clone() };
    let mut source = pipeline::open(input, &open, observer)?;
    let detect = DetectSettings { pixel_aspect: source.info().pixel_aspect, ..detect.clone() };
    let mut detector = None;
    if detects {
        let (whole, samples) = pipeline::sample(source, 24, observer)?;
        source = whole;
        let levels = pipeline::learn(samples, &detect, *threads, observer)?;
        detector = Some(Detector::new(Arc::new(levels), &detect)?);
    }
    let mut detections = Vec::new();
    while let Some(frame) = source.next_frame()? {
        if observer.interrupted() {
            return Err(Error::Interrupted);
        }
        if frame.index == index {
            if let Some(detector) = &mut detector {
                detector.detect(&frame, &mut detections)?;
            }
            return Ok((frame, detections, detect.pixel_aspect));
        }
    }
    Err(Error::Source(
        Fault::new(input, "it ends before this frame").of_kind(FaultKind::Damaged).at(Place::Frame(index)),
    ))
}
