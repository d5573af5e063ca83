//! The one way through: source, detect, track, table, in that order, for every front end.
//!
//! Owns: [`run`], [`RunSettings`], [`RunSummary`], [`Observer`], what a killed run leaves and how it goes on.
//! Must not: print, read a clock, or do any of the four parts' work.

mod ahead;
mod detecting;
mod observer;
mod opening;
mod state;
mod times;

use std::ops::Range;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use serde_json::json;

pub use observer::{Observer, Silent, Stage};
pub use opening::open;
pub(crate) use opening::{learn, sample};
pub use state::partial_path;
pub use times::{survey, times};

use crate::csv_text::Cells;
use crate::detect::{DetectSettings, Levels};
use crate::discover::{Discovery, discover};
use crate::error::{Error, Fault, Place, Result};
use crate::frame::{Ending, FrameSource, SourceInfo};
use crate::gaps::Damage;
use crate::message::{Message, SETUP, Setting};
use crate::name::{shown, text};
use crate::output;
use crate::rig::Rig;
use crate::source::{self, Interlaced, OpenOptions, threads_note};
use crate::store::{DetectionStore, Spool};
use crate::table::{
    Fingerprint, NodeSummary, NodeTable, Rows, RunEnding, SCHEMA_VERSION, SourceFacts, TableMeta,
    TableWriter, Tally, changed, table_files,
};
use crate::timing::{self, Clock, Steps, Timing};
use crate::track::track_recording;
use ahead::End;
use state::State;

/// What to do where the output is there already.
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

/// What to run.
#[derive(Debug, Clone, Default)]
pub struct RunSettings {
    /// The recording, as [`crate::source::open`] takes it.
    pub input: String,
    /// The table; `None` only collects rows in memory.
    pub output: Option<PathBuf>,
    /// What to do where the output is there already.
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
    /// Threads for detection; 0 is one for each core. The result is the same for any number.
    pub threads: usize,
    /// How a CSV writes names.
    pub cells: Cells,
    /// Files besides the recording that are read, which the output never replaces.
    pub reads: Vec<PathBuf>,
}

impl RunSettings {
    /// How interlaced film is read, `null` unless that was said.
    fn interlaced_json(&self) -> serde_json::Value {
        json!(Some(self.open.interlaced).filter(|i| *i != Interlaced::Refuse))
    }

    /// The first frame and one past the last; `null` for an open end, as in `--frames 5..`.
    fn frames_json(&self) -> serde_json::Value {
        json!(self.frames.as_ref().map(|r| [Some(r.start), (r.end < u64::MAX).then_some(r.end)]))
    }
}

/// What came of a run.
#[derive(Debug, Clone)]
pub struct RunSummary {
    /// What the table says of itself.
    pub meta: TableMeta,
    /// Frames in the table.
    pub frames: u64,
    /// Frames taken over from an earlier run.
    pub resumed: u64,
    /// Whether a run that was stopped can go on, with what it left beside the table.
    pub resumable: bool,
    /// What became of each node.
    pub nodes: Vec<NodeSummary>,
    /// What a user should know, a sentence each.
    pub warnings: Vec<Message>,
    /// The table, if it was asked for.
    pub table: Option<NodeTable>,
}

impl RunSummary {
    /// Names of nodes that were never seen or stayed lost: gone at the end for longer than they ever were before.
    pub fn lost(&self) -> Vec<&str> {
        self.nodes.iter().filter(|n| n.stayed_lost()).map(|n| n.node.as_str()).collect()
    }
}

/// Frames looked at before detection.
const SAMPLES: usize = 12;

/// Follows the markers of a recording and writes the table.
///
/// If the observer asks to stop, the table of what was done so far is written and says so; with an output the
/// state to go on from is kept beside it.
///
/// # Errors
/// The error of the part that failed; [`Error::Interrupted`] if the run was stopped before there was anything to
/// write; [`Error::Table`] if the output is there already.
pub fn run(settings: &RunSettings, observer: &mut dyn Observer) -> Result<RunSummary> {
    let files = check(settings)?;
    observer.stage(Stage::Open, None);
    let source = open(&settings.input, &settings.open, observer)?;
    let request = Request::new(settings, source.info(), files)?;
    if let Some(done) = already_done(settings, &request)? {
        return Ok(done);
    }
    let (mut run, source) = Run::begin(settings, request, source, observer)?;
    let fresh = run.resumed == 0;
    let outcome = run.detect(source, observer).and_then(|end| run.finish(end, observer));
    // Only a run that was stopped or ran out of disk can go on; any other would fail again.
    if let (Err(error), Some(output), true) = (&outcome, &settings.output, fresh)
        && !matches!(error, Error::Table(_) | Error::Interrupted)
    {
        let _ = state::remove(output);
    }
    outcome
}

/// What can be refused before anything is read. Gives the files of the recording.
fn check(settings: &RunSettings) -> Result<Vec<PathBuf>> {
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
                .advice("Go on with " + Setting::Resume + ", or begin anew with " + Setting::Force),
        ));
    }
    Ok(files)
}

/// What is asked of a recording, once it is open.
struct Request {
    /// None where the recording cannot be read again.
    files: Vec<PathBuf>,
    facts: SourceFacts,
    info: SourceInfo,
    detect: DetectSettings,
    state: State,
}

impl Request {
    fn new(settings: &RunSettings, info: &SourceInfo, files: Vec<PathBuf>) -> Result<Self> {
        let facts = SourceFacts::of(info, &files)?;
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
fn already_done(settings: &RunSettings, request: &Request) -> Result<Option<RunSummary>> {
    let Some(output) = &settings.output else { return Ok(None) };
    if settings.existing != Existing::Resume || partial_path(output).exists() || !output.exists() {
        return Ok(None);
    }
    let table = crate::table::read_table(output)?;
    if table.meta.ending == RunEnding::Interrupted {
        let partial = partial_path(output);
        return Err(Error::Table(
            Fault::new(
                text(output),
                format!("its run was stopped, but its state {} is gone", text(&partial)),
            )
            .advice(state::anew()),
        ));
    }
    request.state.made(&table.meta, output)?;
    if let Some(file) = changed(&request.files, output)? {
        return Err(Error::Table(
            Fault::new(
                text(output),
                format!("its run is complete, and {} was written or replaced since then", text(file)),
            )
            .advice(state::anew()),
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
    Ok(Some(RunSummary {
        frames: table.frames() as u64,
        resumed: table.frames() as u64,
        resumable: false,
        nodes: table.summary(),
        warnings: vec![format!("{} was complete already", text(output)).into()],
        meta: table.meta.clone(),
        table: settings.collect.then_some(table),
    }))
}

/// A run between its steps.
struct Run<'a> {
    settings: &'a RunSettings,
    /// Those of the recording; none where it cannot be read again.
    files: Vec<PathBuf>,
    /// When they were changed, as the run found them.
    changes: Option<String>,
    detect: DetectSettings,
    facts: SourceFacts,
    info: SourceInfo,
    levels: Arc<Levels>,
    store: DetectionStore,
    resumed: u64,
    /// How reading ended, if an earlier run read all of the recording.
    finished: Option<End>,
    warnings: Vec<Message>,
}

impl<'a> Run<'a> {
    /// Learns what detection needs, or takes it from an earlier run.
    fn begin(
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
        if settings.existing == Existing::Resume
            && let Some(output) = &settings.output
            && let Some(earlier) = state.resume(output)?
        {
            let store = DetectionStore::on_spool(earlier.spool)?.of_pixels(aspect);
            let (resumed, levels) = (store.len() as u64, Arc::new(earlier.levels));
            let finished = earlier.end;
            let run = Self {
                settings,
                files,
                changes,
                detect,
                facts,
                info,
                levels,
                store,
                resumed,
                finished,
                warnings,
            };
            return Ok((run, source));
        }
        observer.stage(Stage::Learn, None);
        let (source, samples) = sample(source, SAMPLES, observer)?;
        let levels = learn(samples, &detect, settings.threads, observer)?;
        if observer.interrupted() {
            return Err(Error::Interrupted);
        }
        let store = match &settings.output {
            Some(output) if files.is_empty() => {
                // Nothing could go on from a state of this run; one of an earlier run is not this run's.
                state::remove(output)?;
                DetectionStore::new()
            }
            Some(output) => DetectionStore::on_spool(state.create(output, &levels)?)?,
            None => DetectionStore::new(),
        }
        .of_pixels(aspect);
        let (resumed, finished, levels) = (0, None, Arc::new(levels));
        let run = Self {
            settings,
            files,
            changes,
            detect,
            facts,
            info,
            levels,
            store,
            resumed,
            finished,
            warnings,
        };
        Ok((run, source))
    }

    /// Reads the recording through. `None` if the user stopped it.
    fn detect(&mut self, source: Box<dyn FrameSource>, observer: &mut dyn Observer) -> Result<Option<End>> {
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

    /// How the recording ended; not well if it became another one while it was read.
    fn unchanged(&self, end: End) -> Result<End> {
        if self.files.is_empty() || self.changes == Some(Fingerprint::of(&self.files)?.changes) {
            return Ok(end);
        }
        let reason =
            "it was written or replaced while it was read, so its frames may be of two recordings".into();
        Ok(End { ending: Ending::Early { frames: self.store.len() as u64, byte: None, reason }, ..end })
    }

    /// Finds the rig if it is not given, follows the markers, writes the table.
    fn finish(&mut self, end: Option<End>, observer: &mut dyn Observer) -> Result<RunSummary> {
        if self.store.is_empty() && end.is_none() {
            return Err(Error::Interrupted);
        }
        let stopped = end.is_none();
        let followed = self.follow(end, observer);
        if stopped && matches!(followed, Err(Error::Rig(_))) {
            // Too little was seen for a table; the state to go on from is there.
            return Err(Error::Interrupted);
        }
        followed
    }

    /// Finds the rig in what was detected, which is not all where the reading was `stopped`.
    fn find(&self, stopped: bool, observer: &mut dyn Observer) -> Result<Discovery> {
        observer.stage(Stage::Rig, None);
        let image_px = [self.facts.width, self.facts.height];
        let leave = |o: &mut dyn Observer| if stopped { o.abandoned() } else { o.interrupted() };
        let mut found = opening::Attended::default().run(observer, leave, |attended| {
            opening::on_threads(self.settings.threads, || discover(&self.store, image_px, &attended.stop))
        })?;
        self.store.check()?;
        found.rig.region = found.rig.region.or_else(|| self.detect.region.clone());
        found.rig.lens = found.rig.lens.or_else(|| self.detect.lens.clone());
        Ok(found)
    }

    fn follow(&mut self, end: Option<End>, observer: &mut dyn Observer) -> Result<RunSummary> {
        if self.store.is_empty() {
            return Err(self.no_frames(end.map(|e| e.ending)));
        }
        let (timing, clock) = self.times()?;
        self.warnings.extend(timing::notes(&timing));
        let rig = match &self.settings.rig {
            // The same but for rounding, or it would have been refused.
            Some(rig) => Rig { pixel_aspect: self.facts.pixel_aspect, ..rig.clone() },
            None => {
                let mut found = self.find(end.is_none(), observer)?;
                self.warnings.append(&mut found.warnings);
                found.rig
            }
        };
        let total = self.store.len() as u64;
        observer.stage(Stage::Track, Some(total));
        let mut writer = match &self.settings.output {
            Some(output) => Some(TableWriter::create(output, &rig, self.settings.cells)?),
            None => None,
        };
        let mut rows = self.settings.collect.then(Rows::default);
        let mut tally = Tally::new(&rig);
        // A run that was stopped while it read is only stopped here if the user does not want to wait.
        let mut stop = end.is_none();
        let reading_was_stopped = stop;
        let mut done = 0;
        let mut damage =
            Damage { gaps: end.as_ref().map(|e| e.gaps.clone()).unwrap_or_default(), ..Damage::default() };
        let attended = opening::Attended::default();
        let leave = |o: &mut dyn Observer| if reading_was_stopped { o.abandoned() } else { o.interrupted() };
        let tracked = attended.run(observer, leave, |attended| {
            track_recording(&self.store, &rig, &attended.stop, &mut |stamp, observations| {
                let time_s = clock.seconds(done, stamp.ticks);
                if let Some(writer) = &mut writer {
                    writer.push(stamp.index, time_s, observations)?;
                }
                if let Some(rows) = &mut rows {
                    rows.push(stamp.index, time_s, observations);
                }
                tally.push(observations);
                if !stamp.decoded {
                    damage.undecoded.push(stamp.index);
                }
                done += 1;
                attended.done.store(done, Ordering::Relaxed);
                attended.stop.heed()
            })
        });
        stop |= attended.stop.asked();
        match tracked {
            Ok(_) => observer.progress(done),
            Err(Error::Interrupted) if done > 0 => {}
            Err(error) => return Err(error),
        }
        self.store.check()?;
        let meta = TableMeta {
            schema_version: SCHEMA_VERSION,
            tool: TableMeta::this_tool(),
            settings: self.settings_json(),
            source: SourceFacts {
                rate_hz: timing.rate_hz,
                rate_origin: timing.rate_origin,
                ..self.facts.clone()
            },
            time: Some(timing),
            ending: match end.map(|e| e.ending) {
                _ if stop => RunEnding::Interrupted,
                Some(Ending::Early { frames, byte, reason }) => {
                    RunEnding::Early { frames, byte, reason: self.base_names(&reason) }
                }
                _ if damage.is_damaged() => RunEnding::Damaged,
                _ => RunEnding::Complete,
            },
            rig,
            damage,
        };
        self.warnings.extend(meta.damage.gaps.dropped_words().map(Message::from));
        if let Some(writer) = writer {
            writer.finish(&meta)?;
        }
        if let (Some(output), false) = (&self.settings.output, stop) {
            state::remove(output)?;
        }
        Ok(RunSummary {
            frames: done,
            resumed: self.resumed,
            resumable: stop && self.settings.output.is_some() && !self.files.is_empty(),
            nodes: tally.summary(),
            warnings: std::mem::take(&mut self.warnings),
            table: rows.map(|rows| NodeTable { meta: meta.clone(), rows }),
            meta,
        })
    }

    /// What the frames' times are, from all their stamps.
    fn times(&self) -> Result<(Timing, Clock)> {
        let mut steps = Steps::default();
        for i in 0..self.store.len() {
            steps.push(self.store.stamp(i).ticks);
        }
        let first = self.store.stamp(0).index;
        self.store.check()?;
        times(&self.info, &steps, first)
    }

    fn no_frames(&self, ending: Option<Ending>) -> Error {
        let fault = match (&self.settings.frames, ending) {
            (_, Some(Ending::Early { reason, .. })) => {
                Fault::new(&self.settings.input, format!("not one frame could be read ({reason})"))
                    .advice("Copy the recording again")
            }
            (Some(frames), _) => {
                Fault::new(&self.settings.input, format!("it ends before frame {}", frames.start))
                    .advice("Give a range of frames that are there")
            }
            (None, _) => {
                Fault::new(&self.settings.input, "it has no frames").advice("Copy the recording again")
            }
        };
        Error::Source(fault)
    }

    /// What was asked for and what was learned. Neither threads nor folders: they change nothing.
    fn settings_json(&self) -> serde_json::Value {
        let mut settings = json!({
            "detect": self.detect,
            "levels": *self.levels,
            "fps": self.settings.open.fps,
            "decoder": self.settings.open.decoder,
            "frames": self.settings.frames_json(),
            "rig": if self.settings.rig.is_some() { "given" } else { "found" },
        });
        if self.settings.open.interlaced != Interlaced::Refuse {
            settings["interlaced"] = self.settings.interlaced_json();
        }
        settings
    }

    /// A message with the recording's name without its folder.
    fn base_names(&self, words: &str) -> String {
        words
            .replace(&self.settings.input, &self.facts.name)
            .replace(&shown(&self.settings.input), &self.facts.name)
    }
}

/// Whether a rig belongs to a recording of this size and of these pixels.
fn fits(rig: &Rig, facts: &SourceFacts) -> Result<()> {
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
