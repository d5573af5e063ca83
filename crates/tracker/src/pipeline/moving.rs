//! Follows what moves where no markers stand out, and makes nodes of it.
//!
//! Owns: [`applies`], [`is_wanted`], [`run`]. Must not: find anything itself; `moving` does.

use std::sync::atomic::Ordering;

use serde_json::{Value, json};

use super::observer::{Observer, Stage};
use super::opening::{Attended, on_threads, open};
use super::request::fits;
use super::settings::RunSettings;
use super::summary::{MOVING, RunSummary};
use super::times::times;
use crate::detect::DetectSettings;
use crate::error::{Error, Result};
use crate::frame::{Ending, SourceInfo};
use crate::gaps::{Damage, Gaps};
use crate::message::Message;
use crate::moving::{Followed, Track, WorkFilm, follow};
use crate::observation::{Observation, Status};
use crate::rig::{Body, Node, RIG_SCHEMA, Rig};
use crate::source::{self, OpenOptions};
use crate::store::FrameStamp;
use crate::table::{
    NodeSummary, NodeTable, Rows, RunEnding, SCHEMA_VERSION, SourceFacts, TableMeta, TableWriter, Tally,
};
use crate::timing::{self, Steps};

/// Confidence from which on what moves is named: right results of the films with truth have 0.2 to 0.8, and of the wrong ones
/// none has more than 0.16 (docs/validation.md, "What moves").
const LEAST_CONFIDENCE: f64 = 0.2;
/// Part of the decoded frames in which one marker at least must be seen for the rig to be believed.
const LEAST_SEEN: f64 = 0.5;
/// A marker this near to the place that a given rig has for a node is that node, in radii.
const NAMED_RADII: f64 = 1.0;
/// From this part of the radius on it is said that a centre is not well known.
const TELL_SIGMA_RADII: f64 = 0.1;

/// What came of looking at what moves.
pub(super) enum Outcome {
    /// It is followed.
    Followed(Box<RunSummary>),
    /// Why nothing is named.
    Unclear(String),
}

/// Whether what moves may be followed in place of markers: only where nothing was said of how markers look, and a rig that was
/// given is one of single nodes.
pub(super) fn applies(settings: &RunSettings) -> bool {
    let single = |rig: &Rig| rig.joints.is_empty() && rig.bodies.len() == rig.nodes.len();
    let said = settings.detect != DetectSettings::default() || !settings.rig.as_ref().is_none_or(single);
    !said && !source::is_read_once(&settings.input)
}

/// Whether markers were not found, or are seen in so few frames that what was taken for them is something else.
pub(super) fn is_wanted(markers: &Result<RunSummary>) -> bool {
    match markers {
        Ok(summary) => {
            let seldom = |n: &NodeSummary| {
                let rows = n.seen + n.missing + n.ambiguous;
                rows == 0 || (n.seen as f64) < LEAST_SEEN * rows as f64
            };
            summary.meta.ending != RunEnding::Interrupted && summary.nodes.iter().all(seldom)
        }
        Err(error) => matches!(error, Error::Detect(_) | Error::Rig(_)),
    }
}

/// Follows what moves in a recording and writes the table, if it is clear what is meant.
///
/// # Errors
/// Those of reading, and of the table; [`Error::Interrupted`] if the observer asks to stop.
pub(super) fn run(settings: &RunSettings, observer: &mut dyn Observer) -> Result<Outcome> {
    let options = OpenOptions { colour: true, ..settings.open.clone() };
    let mut source = open(&settings.input, &options, observer)?;
    let info = source.info().clone();
    let facts = SourceFacts::of(&info, &source::files(&settings.input)?)?;
    if let Some(rig) = &settings.rig {
        fits(rig, &facts)?;
    }
    let frames = settings.frames.clone().unwrap_or(0..u64::MAX);
    let total = facts.declared_frames.map(|n| n.min(frames.end).saturating_sub(frames.start));
    observer.stage(Stage::Moving, total);
    let attended = Attended::default();
    let found = attended.run(
        observer,
        |o| o.interrupted(),
        |attended| {
            let mut tell =
                |index: u64| attended.done.store(index.saturating_sub(frames.start), Ordering::Relaxed);
            let film = WorkFilm::read(source.as_mut(), frames.clone(), &attended.stop, &mut tell)?;
            let followed = on_threads(settings.threads, || follow(&film))?;
            Ok(match followed {
                None => Err("nothing moves smoothly before a still background".to_owned()),
                Some(f) if f.confidence < LEAST_CONFIDENCE => Err(unclear(&f, film.shrink() as f64)),
                Some(followed) => Ok(Moving::of(&film, followed)),
            })
        },
    )?;
    match found {
        Err(why) => Ok(Outcome::Unclear(why)),
        Ok(moving) => moving.write(settings, &info, facts),
    }
}

/// Why what moves is not named.
fn unclear(followed: &Followed, scale: f64) -> String {
    let others = followed.tracks.len() + followed.others.len() - 1;
    format!(
        "of what moves the likeliest marker is {}, and it explains too little of what looks like it (confidence {:.2}, {} is \
         needed); {others} others move",
        look(followed, scale),
        followed.confidence,
        LEAST_CONFIDENCE,
    )
}

/// A marker's look in words.
fn look(followed: &Followed, scale: f64) -> String {
    let bright = if followed.model.sign > 0.0 { "bright" } else { "dark" };
    format!("{bright}, {:.0} px across", 2.0 * followed.radius_px * scale)
}

/// What was followed, in the recording's own pixels and frames.
struct Moving {
    followed: Followed,
    scale: f64,
    copies: usize,
    decoded: usize,
    stamps: Vec<FrameStamp>,
    /// By frame, then track.
    rows: Vec<Vec<Observation>>,
    ending: Ending,
    gaps: Gaps,
}

impl Moving {
    fn of(film: &WorkFilm, mut followed: Followed) -> Self {
        // The one that is seen first is first.
        followed.tracks.sort_by_key(|t| t.spots().next().map(|(k, _)| k));
        let rows = rows(film, &followed.tracks);
        Self {
            scale: film.shrink() as f64,
            copies: film.copies(),
            decoded: film.decoded(),
            stamps: film.stamps().to_vec(),
            ending: film.ending().clone(),
            gaps: film.gaps().clone(),
            followed,
            rows,
        }
    }

    fn write(mut self, settings: &RunSettings, info: &SourceInfo, facts: SourceFacts) -> Result<Outcome> {
        let rig = match &settings.rig {
            None => self.rig(&facts),
            Some(rig) => {
                let Some(order) = self.named(rig) else {
                    return Ok(Outcome::Unclear("what moves is not at the places of the rig".into()));
                };
                for row in &mut self.rows {
                    *row = order.iter().map(|&k| row[k]).collect();
                }
                Rig { pixel_aspect: facts.pixel_aspect, ..rig.clone() }
            }
        };
        let mut steps = Steps::default();
        self.stamps.iter().for_each(|s| steps.push(s.ticks));
        let (timing, clock) = times(info, &steps, self.stamps.first().map_or(0, |s| s.index))?;
        let mut writer = match &settings.output {
            Some(output) => Some(TableWriter::create(output, &rig, settings.cells)?),
            None => None,
        };
        let mut collected = settings.collect.then(Rows::default);
        let mut tally = Tally::new(&rig);
        for (place, (stamp, observations)) in self.stamps.iter().zip(&self.rows).enumerate() {
            let time_s = clock.seconds(place as u64, stamp.ticks);
            if let Some(writer) = &mut writer {
                writer.push(stamp.index, time_s, observations)?;
            }
            if let Some(collected) = &mut collected {
                collected.push(stamp.index, time_s, observations);
            }
            tally.push(observations);
        }
        let mut damage = Damage { gaps: self.gaps.clone(), ..Damage::default() };
        self.stamps.iter().filter(|s| !s.decoded).for_each(|s| damage.undecoded.push(s.index));
        let mut warnings = info.warnings.clone();
        warnings.extend(timing::notes(&timing));
        warnings.extend(damage.gaps.dropped_words().map(Message::from));
        warnings.extend(self.notes());
        let mut doubtful = Vec::new();
        for (node, usual) in self.doubtful() {
            let name = rig.nodes[node].name.clone();
            warnings.push(
                format!(
                    "the centre of {name} depends on what is taken for the marker: brightness, colour and outline have centres \
                     that differ; its standard uncertainty is {usual:.1} px in half of the frames"
                )
                .into(),
            );
            doubtful.push(name);
        }
        let meta = TableMeta {
            schema_version: SCHEMA_VERSION,
            tool: TableMeta::this_tool(),
            settings: self.settings_json(settings, &facts),
            source: SourceFacts { rate_hz: timing.rate_hz, rate_origin: timing.rate_origin, ..facts },
            time: Some(timing),
            ending: match self.ending {
                Ending::Early { frames, byte, reason } => RunEnding::Early { frames, byte, reason },
                Ending::Complete if damage.is_damaged() => RunEnding::Damaged,
                Ending::Complete => RunEnding::Complete,
            },
            rig,
            damage,
        };
        if let Some(writer) = writer {
            writer.finish(&meta)?;
        }
        Ok(Outcome::Followed(Box::new(RunSummary {
            frames: self.rows.len() as u64,
            resumed: 0,
            resumable: false,
            moving: true,
            doubtful,
            nodes: tally.summary(),
            warnings,
            table: collected.map(|rows| NodeTable { meta: meta.clone(), rows }),
            meta,
        })))
    }

    fn settings_json(&self, settings: &RunSettings, facts: &SourceFacts) -> Value {
        let detect = DetectSettings { pixel_aspect: facts.pixel_aspect, ..settings.detect.clone() };
        let mut all = json!({
            "detect": detect,
            MOVING: {
                "bright": self.followed.model.sign > 0.0,
                "octave": self.followed.model.octave,
                "radius_px": self.followed.radius_px * self.scale,
                "confidence": self.followed.confidence,
                "others": self.followed.others.len(),
                "copies": self.copies,
            },
            "fps": settings.open.fps,
            "decoder": settings.open.decoder,
            "frames": settings.frames_json(),
            "rig": if settings.rig.is_some() { "given" } else { "found" },
        });
        if !settings.interlaced_json().is_null() {
            all["interlaced"] = settings.interlaced_json();
        }
        all
    }

    /// For each node of a given rig the column of the marker that is at its place in the reference frame; `None` where one has
    /// none.
    fn named(&self, rig: &Rig) -> Option<Vec<usize>> {
        let near_px = NAMED_RADII * self.followed.radius_px * self.scale;
        let row = &self.rows[self.stamps.iter().position(|s| Some(s.index) == rig.reference_frame)?];
        let mut order = Vec::with_capacity(rig.nodes.len());
        for node in &rig.nodes {
            let off = |k: &usize| (row[*k].x_px - node.x_px).hypot(row[*k].y_px - node.y_px);
            let free = (0..row.len()).filter(|k| !order.contains(k) && row[*k].status.is_seen());
            order.push(free.min_by(|a, b| off(a).total_cmp(&off(b))).filter(|k| off(k) < near_px)?);
        }
        Some(order)
    }

    /// One body for each node; the reference frame is the first in which all are seen, if there is one.
    fn rig(&self, facts: &SourceFacts) -> Rig {
        let image = |o: &Observation| [o.x_px, o.y_px];
        let whole = self.rows.iter().position(|r| r.iter().all(|o| o.status.is_seen()));
        let place = |node: usize| match whole {
            Some(frame) => image(&self.rows[frame][node]),
            None => self.rows.iter().map(|r| &r[node]).find(|o| o.status.is_seen()).map_or([0.0; 2], image),
        };
        let name = |node: usize| format!("body{}", node + 1);
        let count = self.followed.tracks.len();
        Rig {
            schema: RIG_SCHEMA,
            image_px: [facts.width, facts.height],
            pixel_aspect: facts.pixel_aspect,
            reference_frame: whole.map(|f| self.stamps[f].index),
            region: None,
            lens: None,
            bodies: (0..count).map(|k| Body { name: name(k) }).collect(),
            nodes: (0..count)
                .map(|k| {
                    let [x_px, y_px] = place(k);
                    Node { name: format!("n{k}"), body: name(k), x_px, y_px }
                })
                .collect(),
            joints: Vec::new(),
        }
    }

    /// Columns whose usual standard uncertainty is a large part of the radius, with that uncertainty, px.
    fn doubtful(&self) -> Vec<(usize, f32)> {
        let limit = TELL_SIGMA_RADII * self.followed.radius_px * self.scale;
        let usual = |node: usize| {
            let seen = self.rows.iter().map(|r| &r[node]).filter(|o| o.status.is_seen());
            let mut sigma: Vec<f32> = seen.map(|o| o.sigma_px).collect();
            sigma.sort_unstable_by(f32::total_cmp);
            sigma.get(sigma.len() / 2).copied()
        };
        let columns = 0..self.rows.first().map_or(0, Vec::len);
        columns.filter_map(|k| Some((k, usual(k).filter(|s| f64::from(*s) > limit)?))).collect()
    }

    /// How it was found, in words.
    fn notes(&self) -> Vec<Message> {
        let count = self.followed.tracks.len();
        let markers = if count == 1 { "marker" } else { "markers" };
        let others = match self.followed.others.len() {
            0 => String::new(),
            1 => "; one more thing moves and is not followed".into(),
            n => format!("; {n} more things move and are not followed"),
        };
        let mut notes: Vec<Message> = vec![
            format!(
                "no markers stand out from an even background: followed what moves, {count} {markers} of one look ({}), with \
                 confidence {:.2} of 1{others}. No bodies are made of them. Look at the overlay before you use the table",
                look(&self.followed, self.scale),
                self.followed.confidence,
            )
            .into(),
        ];
        if self.copies > 0 {
            notes.push(
                format!(
                    "{} of {} frames are copies of the frame before them: their times are those of the file, not of what they \
                     show",
                    self.copies, self.decoded
                )
                .into(),
            );
        }
        notes
    }
}

/// The nodes of every frame.
fn rows(film: &WorkFilm, tracks: &[Track]) -> Vec<Vec<Observation>> {
    let scale = film.shrink() as f64;
    let unknown = |decoded: bool| if decoded { Observation::MISSING } else { Observation::UNDECODED };
    let mut rows: Vec<Vec<Observation>> =
        film.stamps().iter().map(|s| vec![unknown(s.decoded); tracks.len()]).collect();
    for (node, track) in tracks.iter().enumerate() {
        let mut last = None;
        for (picture, spot) in track.spots() {
            let back = last.is_some_and(|l| l + 1 < picture);
            last = Some(picture);
            // A copy shows the marker where the frame before it does.
            for (nth, &row) in film.frames(picture).iter().enumerate() {
                rows[row][node] = Observation {
                    x_px: film.recorded_px(spot.x),
                    y_px: film.recorded_px(spot.y),
                    sigma_px: (track.sigma_px(spot) * scale) as f32,
                    area_px: (spot.area * scale * scale) as f32,
                    status: if back && nth == 0 { Status::Reacquired } else { Status::Seen },
                };
            }
        }
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::moving::{Direction, Model};

    #[test]
    fn what_moves_is_followed_only_where_nothing_was_said_of_markers() {
        let plain = RunSettings { input: env!("CARGO_MANIFEST_DIR").into(), ..RunSettings::default() };
        assert!(applies(&plain));
        let said = RunSettings {
            detect: DetectSettings { min_area_px: Some(5.0), ..DetectSettings::default() },
            ..plain
        };
        assert!(!applies(&said));
    }

    #[test]
    fn only_missing_markers_make_it_wanted() {
        let fault = || crate::error::Fault::new("film", "no marker");
        assert!(is_wanted(&Err(Error::Detect(fault()))));
        assert!(is_wanted(&Err(Error::Rig(fault()))));
        assert!(!is_wanted(&Err(Error::Source(fault()))));
        assert!(!is_wanted(&Err(Error::Interrupted)));
    }

    #[test]
    fn a_centre_is_doubtful_from_a_tenth_of_the_radius_on() {
        let model = Model { direction: Direction::LUMA, sign: 1.0, octave: 1 };
        let followed =
            Followed { model, tracks: Vec::new(), radius_px: 5.0, confidence: 0.5, others: Vec::new() };
        let seen = |sigma_px: f32| Observation { sigma_px, status: Status::Seen, ..Observation::MISSING };
        // A work picture of half the size: the radius is 10 px. A node that is never seen is not doubtful.
        let rows = vec![vec![seen(0.9), seen(1.1), Observation::MISSING]; 3];
        let moving = Moving {
            followed,
            scale: 2.0,
            copies: 0,
            decoded: 3,
            stamps: Vec::new(),
            rows,
            ending: Ending::Complete,
            gaps: Gaps::default(),
        };
        assert_eq!(moving.doubtful(), [(1, 1.1)]);
    }
}
