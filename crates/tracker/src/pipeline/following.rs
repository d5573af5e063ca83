//! Makes the table from detections: finds the rig if none is given, follows the markers, writes the rows.

use std::sync::atomic::Ordering;

use serde_json::json;

use super::ahead::End;
use super::clutter::is_cluttered;
use super::moving::{self, Outcome};
use super::observer::{Observer, Stage};
use super::open_names::OpenNames;
use super::opening::{Attended, on_threads};
use super::reading::Run;
use super::repeats::Repeats;
use super::sizes::{MOST_SIZES, Sizes};
use super::state;
use super::summary::{EDITS, RunSummary};
use super::times::times;
use super::unclear::Unclear;
use crate::discover::{Discovery, discover};
use crate::edits::{Decided, Replay, Seen};
use crate::error::{Error, Fault, FaultKind, Result};
use crate::frame::Ending;
use crate::gaps::Damage;
use crate::message::{Message, Setting};
use crate::name::shown;
use crate::observation::Observation;
use crate::rig::Rig;
use crate::rigid::search::MOST_SEEDS;
use crate::source::Interlaced;
use crate::table::{
    NodeSummary, NodeTable, Rows, RunEnding, SCHEMA_VERSION, SourceFacts, TableMeta, TableWriter, Tally,
};
use crate::timing::{self, Clock, Steps, Timing};
use crate::track::track_recording;

/// Facts of the rows that are told at the end.
struct Watched {
    tally: Tally,
    open_names: OpenNames,
    repeats: Repeats,
    sizes: Sizes,
}

impl Watched {
    fn of(given: Option<&Rig>, rig: &Rig) -> Self {
        Self {
            tally: Tally::new(rig),
            open_names: OpenNames::default(),
            repeats: Repeats::default(),
            sizes: Sizes::of(given, rig),
        }
    }

    /// Takes the rows that the tracker saw, before a person's edits.
    fn seen(&mut self, observations: &[Observation]) {
        self.sizes.push(observations);
        self.repeats.push(observations);
    }

    /// Takes the rows that are written, with a person's edits.
    fn written(&mut self, frame: u64, time_s: f64, observations: &[Observation]) {
        self.tally.push(observations);
        self.open_names.push(frame, time_s, observations);
    }
}

impl<'a> Run<'a> {
    /// Finds the rig if it is not given, follows the markers, writes the table.
    /// Where there is clutter what moves is looked at first; why it is `unclear` is told.
    pub fn finish(
        &mut self,
        end: Option<End>,
        observer: &mut dyn Observer,
        unclear: &mut Option<Unclear>,
    ) -> Result<RunSummary> {
        if self.store.is_empty() && end.is_none() {
            return Err(Error::Interrupted);
        }
        let stopped = end.is_none();
        let settings = self.settings;
        let open = !stopped && unclear.is_none() && moving::comes_first(settings);
        if open && is_cluttered(&self.store)? {
            match moving::run_first(settings, observer)? {
                Outcome::Followed(summary) => {
                    settings.output.as_ref().map_or(Ok(()), |output| state::remove(output))?;
                    return Ok(*summary);
                }
                Outcome::Unclear(why) => *unclear = Some(why),
            }
        }
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
        let mut found = Attended::default().run(observer, leave, |attended| {
            on_threads(self.settings.threads, || discover(&self.store, image_px, &attended.stop))
        })?;
        self.store.check()?;
        found.rig.region = found.rig.region.or_else(|| self.detect.region.clone());
        found.rig.lens = found.rig.lens.or_else(|| self.detect.lens.clone());
        found.rig.wanted = self.settings.asked().clone();
        Ok(found)
    }

    fn follow(&mut self, end: Option<End>, observer: &mut dyn Observer) -> Result<RunSummary> {
        if self.store.is_empty() {
            return Err(self.no_frames(end.map(|e| e.ending)));
        }
        let (timing, clock) = self.times()?;
        self.warnings.extend(timing::notes(&timing));
        let rig = self.rig(end.is_none(), observer)?;
        self.check_count(&rig)?;
        observer.stage(Stage::Track, Some(self.store.len() as u64));
        let mut writer = self.writer(&rig)?;
        let mut rows = self.settings.collect.then(Rows::default);
        let mut watched = Watched::of(self.settings.rig.as_ref(), &rig);
        let mut replay = self.replay(&rig, end.is_some())?;
        // A run that was stopped while it read is only stopped here if the user does not want to wait.
        let mut stop = end.is_none();
        let reading_was_stopped = stop;
        let mut done = 0;
        let (gaps, reasons) = end.as_ref().map(|e| (e.gaps.clone(), e.reasons.clone())).unwrap_or_default();
        let mut damage = Damage { gaps, reasons, ..Damage::default() };
        let attended = Attended::default();
        let leave = |o: &mut dyn Observer| if reading_was_stopped { o.abandoned() } else { o.interrupted() };
        let tracked = attended.run(observer, leave, |attended| {
            track_recording(&self.store, &rig, &attended.stop, &mut |stamp, observations| {
                let time_s = clock.seconds(done, stamp.ticks);
                watched.seen(observations);
                let observations = replay.made(stamp.index, observations);
                if let Some(writer) = &mut writer {
                    writer.push(stamp.index, time_s, observations)?;
                }
                if let Some(rows) = &mut rows {
                    rows.push(stamp.index, time_s, observations);
                }
                watched.written(stamp.index, time_s, observations);
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
            Ok(summary) => {
                observer.progress(done);
                self.warnings.extend(bounded_words(summary.bounded_frames));
            }
            Err(Error::Interrupted) if done > 0 => {}
            Err(error) => return Err(error),
        }
        self.store.check()?;
        self.warnings.extend(watched.repeats.words());
        let nodes = watched.tally.summary();
        let doubtful = if stop { Vec::new() } else { self.judge(&nodes, &mut watched.sizes)? };
        let told = watched.open_names.told(&rig, &nodes, timing.rate_hz).filter(|_| !stop);
        let (open, words) = told.unzip();
        self.warnings.extend(words);
        let ending = end.map(|e| e.ending).filter(|_| !stop);
        let decided = replay.finish();
        let meta = self.meta(rig, timing, damage, ending, decided.as_ref());
        self.warnings.extend(meta.damage.gaps.dropped_words().map(Message::from));
        self.warnings.extend(decided.map(|d| d.words().into()));
        self.tell_beyond(stop || matches!(meta.ending, RunEnding::Early { .. }));
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
            moving: false,
            doubtful,
            not_followed: Vec::new(),
            open: open.unwrap_or_default(),
            nodes,
            warnings: std::mem::take(&mut self.warnings),
            table: rows.map(|rows| NodeTable { meta: meta.clone(), rows }),
            meta,
        })
    }

    /// The table that is written, if one was asked for.
    fn writer(&self, rig: &Rig) -> Result<Option<TableWriter>> {
        let output = self.settings.output.as_ref();
        output.map(|output| TableWriter::create(output, rig, self.settings.cells)).transpose()
    }

    /// Tells frames that were asked for beyond the recording's end, unless reading ended before it.
    fn tell_beyond(&mut self, ended_early: bool) {
        if let (Some(last), false) = (self.store.len().checked_sub(1), ended_early) {
            self.warnings.extend(self.settings.beyond(self.store.stamp(last).index));
        }
    }

    /// The decisions of people, to be made on the rows; `to_end`: the recording was read to its end.
    fn replay(&self, rig: &Rig, to_end: bool) -> Result<Replay<'a>> {
        let settings = self.settings;
        let is_all = settings.frames.is_none() && to_end;
        Replay::new(settings.edits.as_ref(), rig, Seen::Detections(&self.store), is_all)
    }

    /// Refuses a rig of another number of nodes than there are markers, if that was said.
    fn check_count(&self, rig: &Rig) -> Result<()> {
        if let Some(count) = self.settings.asked().markers
            && count != rig.nodes.len()
        {
            return Err(Error::Rig(
                Fault::of(Setting::Markers, format!("{count} are wanted, and {} stand out", rig.nodes.len()))
                    .advice("Point at each of them with " + Setting::Marker),
            ));
        }
        Ok(())
    }

    /// Nodes that hardly are markers, of which it is told why.
    ///
    /// # Errors
    /// [`Error::Rig`] where no node of a rig that was found is ever seen, or all of them change their sizes so much.
    fn judge(&mut self, nodes: &[NodeSummary], sizes: &mut Sizes) -> Result<Vec<String>> {
        if self.settings.rig.is_none() && nodes.iter().all(|n| n.seen == 0) {
            return Err(Error::Rig(
                Fault::new("recording", "what stands out cannot be told apart in any frame")
                    .of_kind(FaultKind::NothingFound)
                    .advice(
                        "Point at each marker with "
                            + Setting::Marker
                            + ", or give a rig with "
                            + Setting::Rig,
                    ),
            ));
        }
        let mut doubtful: Vec<String> = sizes.uneven().map(|k| nodes[k].node.clone()).collect();
        if !doubtful.is_empty()
            && doubtful.len() == nodes.len()
            && self.settings.rig.is_none()
            && moving::applies(self.settings)
        {
            return Err(Error::Rig(
                Fault::new(
                    "recording",
                    format!(
                        "what stands out changes its size by more than a factor {MOST_SIZES}, as no disc does: it is an arm, a hand \
                         or several things"
                    ),
                )
                .of_kind(FaultKind::NothingFound)
                .advice("If it is a marker, say so with " + Setting::Threshold),
            ));
        }
        if !doubtful.is_empty() {
            self.warnings.push(format!(
                "{} changes size by more than a factor {MOST_SIZES}, as no disc does: an arm, a hand or several things may be taken \
                 for a marker", doubtful.join(", ")
            ).into());
        }
        // Where the rig or the look of markers was given, it is known what is seldom seen.
        if self.settings.rig.is_none() && moving::applies(self.settings) {
            for node in nodes.iter().filter(|n| moving::is_seldom(n)) {
                let rows = (node.seen + node.missing + node.ambiguous).max(1);
                let part = 100.0 * node.seen as f64 / rows as f64;
                self.warnings.push(
                    Message::from(format!(
                        "{} is seen in {part:.0} % of the frames. If it is there in more of them, point at it with ",
                        node.node
                    )) + Setting::Marker,
                );
                if !doubtful.contains(&node.node) {
                    doubtful.push(node.node.clone());
                }
            }
        }
        Ok(doubtful)
    }

    /// The rig that is given, or the one found.
    fn rig(&mut self, stopped: bool, observer: &mut dyn Observer) -> Result<Rig> {
        if let Some(rig) = &self.settings.rig {
            // The same but for rounding, or it would have been refused.
            return Ok(Rig { pixel_aspect: self.facts.pixel_aspect, ..rig.clone() });
        }
        let mut found = self.find(stopped, observer)?;
        self.warnings.append(&mut found.warnings);
        Ok(found.rig)
    }

    /// The table's metadata; `ending` is the recording's, `None` where the run was stopped.
    fn meta(
        &self,
        rig: Rig,
        timing: Timing,
        damage: Damage,
        ending: Option<Ending>,
        decided: Option<&Decided>,
    ) -> TableMeta {
        let mut settings = self.settings_json();
        if let Some(decided) = decided {
            settings[EDITS] = decided.to_json();
        }
        TableMeta {
            schema_version: SCHEMA_VERSION,
            tool: TableMeta::this_tool(),
            settings,
            source: SourceFacts {
                rate_hz: timing.rate_hz,
                rate_origin: timing.rate_origin,
                ..self.facts.clone()
            },
            time: Some(timing),
            ending: match ending {
                None => RunEnding::Interrupted,
                Some(Ending::Early { frames, byte, reason }) => {
                    RunEnding::Early { frames, byte, reason: self.base_names(&reason) }
                }
                Some(_) if damage.is_damaged() => RunEnding::Damaged,
                Some(_) => RunEnding::Complete,
            },
            rig,
            damage,
        }
    }

    /// The times of the frames, from all their stamps.
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
                    .of_kind(FaultKind::Damaged)
                    .advice("Copy the recording again")
            }
            (Some(frames), _) => {
                Fault::new(&self.settings.input, format!("it ends before frame {}", frames.start))
                    .of_kind(FaultKind::Setting)
                    .advice("Give a range of frames that are there")
            }
            (None, _) => Fault::new(&self.settings.input, "it has no frames")
                .of_kind(FaultKind::Damaged)
                .advice("Copy the recording again"),
        };
        Error::Source(fault)
    }

    /// The settings that were given and the levels that were learned. Neither threads nor folders: they change nothing.
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
        let wanted = self.settings.wanted_json();
        if !wanted.is_null() {
            settings["wanted"] = wanted;
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

/// The warning of frames in which more stood out than is tried.
fn bounded_words(frames: u64) -> Option<Message> {
    let which = if frames == 1 { "one frame".to_owned() } else { format!("{frames} frames") };
    let words = format!(
        "in {which} so much stands out that only part of it was tried for where a body may be, the {MOST_SEEDS} spots whose \
         centres are known best. Leave out what are no markers with "
    );
    (frames > 0).then(|| Message::from(words) + Setting::Threshold)
}
