//! Checks what is asked of a recording: before anything is read, and once the recording is open.
//!
//! Owns: [`check`], [`Request`], [`already_done`]. Must not: read frames.

use std::path::PathBuf;

use super::settings::{Existing, RunSettings};
use super::state::{State, anew, partial_path};
use super::summary::{EDITS, MOVING, RunSummary};
use crate::detect::DetectSettings;
use crate::error::{Error, Fault, FaultKind, Place, Result};
use crate::frame::SourceInfo;
use crate::message::{SETUP, Setting};
use crate::name::text;
use crate::output;
use crate::rig::Rig;
use crate::source;
use crate::store::Spool;
use crate::table::{RunEnding, SourceFacts, changed, read_table, table_files};

/// Refuses what can be refused before anything is read. Gives the files of the recording.
pub(super) fn check(settings: &RunSettings) -> Result<Vec<PathBuf>> {
    if let Some(frames) = &settings.frames
        && frames.is_empty()
    {
        return Err(Error::Argument(
            Fault::of(Setting::Frames, format!("{}..{} holds no frame", frames.start, frames.end))
                .advice("Give the first frame and one past the last"),
        ));
    }
    let files = source::files(&settings.input)?;
    let Some(output) = &settings.output else { return Ok(files) };
    let tables = table_files(output)?;
    let replace = settings.existing != Existing::Refuse;
    let reads = [&files[..], &settings.reads].concat();
    output::check(&tables, &reads, replace).map_err(Error::Table)?;
    let partial = partial_path(output);
    output::check(std::slice::from_ref(&partial), &reads, true).map_err(Error::Table)?;
    if settings.existing == Existing::Resume && source::is_read_once(&settings.input) {
        let what = if settings.input == "-" { "standard input" } else { "a pipe or an address" };
        return Err(Error::Argument(
            Fault::of(Setting::Resume, format!("{what} cannot be read again")).advice("Give a file"),
        ));
    }
    // Whatever else lies where the state would, it is refused now and not when the recording is open.
    if Spool::is_at(&partial)? && !replace {
        return Err(Error::Table(
            Fault::new(text(&partial), "an earlier run was stopped and can go on")
                .of_kind(FaultKind::Exists)
                .advice("Go on with " + Setting::Resume + ", or begin anew with " + Setting::Force),
        ));
    }
    Ok(files)
}

/// A request to a recording that is open.
pub(super) struct Request {
    /// None where the recording cannot be read again.
    pub files: Vec<PathBuf>,
    pub facts: SourceFacts,
    pub info: SourceInfo,
    pub detect: DetectSettings,
    pub state: State,
}

impl Request {
    pub fn new(settings: &RunSettings, info: &SourceInfo, files: Vec<PathBuf>) -> Result<Self> {
        let facts = SourceFacts::of(info, &files)?;
        if let Some(edits) = &settings.edits {
            edits.belongs(&facts)?;
        }
        let mut detect = settings.detect.clone();
        detect.pixel_aspect = facts.pixel_aspect;
        if let Some(rig) = &settings.rig {
            fits(rig, &facts)?;
            detect.region = detect.region.or_else(|| rig.region.clone());
            detect.lens = detect.lens.or_else(|| rig.lens.clone());
        }
        let state = State::new(settings, &facts, &detect, &files)?;
        Ok(Self { files, facts, info: info.clone(), detect, state })
    }
}

/// The summary of a finished table, where there is nothing to go on with. It must be the table that is asked for.
pub(super) fn already_done(settings: &RunSettings, request: &Request) -> Result<Option<RunSummary>> {
    let Some(output) = &settings.output else { return Ok(None) };
    if settings.existing != Existing::Resume || partial_path(output).exists() || !output.exists() {
        return Ok(None);
    }
    let table = read_table(output)?;
    if table.meta.ending == RunEnding::Interrupted {
        let partial = partial_path(output);
        return Err(Error::Table(
            Fault::new(
                text(output),
                format!("its run was stopped, but its state {} is gone", text(&partial)),
            )
            .of_kind(FaultKind::Missing)
            .advice(anew()),
        ));
    }
    request.state.made(&table.meta, output)?;
    if let Some(file) = changed(&request.files, output)? {
        return Err(Error::Table(
            Fault::new(
                text(output),
                format!("its run is complete, and {} was written or replaced since then", text(file)),
            )
            .advice(anew()),
        ));
    }
    let rig = (table.meta.settings["rig"] == "given").then_some(&table.meta.rig);
    let asked = settings.rig.as_ref().map(|r| Rig { pixel_aspect: request.facts.pixel_aspect, ..r.clone() });
    if rig != asked.as_ref() {
        return Err(Error::Table(
            Fault::new(text(output), "its run is complete and had another rig")
                .advice("Give " + Setting::Rig + " as it was then, or begin anew with " + Setting::Force),
        ));
    }
    let before = table.meta.settings[EDITS]["sha256"].as_str();
    if before != settings.edits.as_ref().map(|e| e.sha256.as_str()) {
        return Err(Error::Table(
            Fault::new(text(output), "its run is complete and had other edits")
                .advice("Give " + Setting::Edits + " as it was then, or begin anew with " + Setting::Force),
        ));
    }
    Ok(Some(RunSummary {
        frames: table.frames() as u64,
        resumed: table.frames() as u64,
        resumable: false,
        doubtful: Vec::new(),
        not_followed: Vec::new(),
        open: Vec::new(),
        moving: table.meta.settings.get(MOVING).is_some(),
        nodes: table.summary(),
        warnings: vec![format!("{} was complete already", text(output)).into()],
        meta: table.meta.clone(),
        table: settings.collect.then_some(table),
    }))
}

/// Whether a rig belongs to a recording of this size and of these pixels.
pub(super) fn fits(rig: &Rig, facts: &SourceFacts) -> Result<()> {
    let image_px = [facts.width, facts.height];
    if rig.image_px != image_px {
        let [w, h] = rig.image_px;
        return Err(Error::Rig(
            Fault::new(
                "rig",
                format!(
                    "it is for images of {w} x {h} px, the recording has {} x {}",
                    image_px[0], image_px[1]
                ),
            )
            .advice("Make one for this recording with " + SETUP),
        ));
    }
    if !rig.pixel_aspect.agrees(facts.pixel_aspect) {
        let origin = facts.pixel_aspect_origin.words();
        return Err(Error::Rig(
            Fault::new(
                "rig",
                format!(
                    "it is for pixels of {} (width:height), the recording's are {}, {origin}",
                    rig.pixel_aspect, facts.pixel_aspect
                ),
            )
            .at(Place::Key("pixel_aspect".into()))
            .advice(
                "Make one for this recording with "
                    + SETUP
                    + ", or say what is true with "
                    + Setting::PixelAspect,
            ),
        ));
    }
    Ok(())
}
