//! Nodes of what moves, and the table of them.
//!
//! Owns: [`Moving`]. Must not: choose what is followed.

use serde_json::{Value, json};

use super::candidates::words;
use super::moving_rows::rows;
use super::repeats::copies_words;
use super::settings::RunSettings;
use super::summary::{EDITS, MOVING, RunSummary};
use super::times::times;
use crate::detect::DetectSettings;
use crate::discover::PathRig;
use crate::edits::{Replay, Seen};
use crate::error::Result;
use crate::frame::{Ending, SourceInfo};
use crate::gaps::Damage;
use crate::message::Message;
use crate::moving::{Marker, WorkFilm};
use crate::observation::Observation;
use crate::rig::{Body, Node, RIG_SCHEMA, Rig};
use crate::store::FrameStamp;
use crate::table::{NodeTable, Rows, RunEnding, SCHEMA_VERSION, SourceFacts, TableMeta, TableWriter, Tally};
use crate::timing::{self, Steps};
use crate::wanted::Wanted;

/// A marker this near to the place that a given rig has for a node is that node, in radii.
const NAMED_RADII: f64 = 1.0;

/// The way in which what is followed was chosen.
pub(super) enum Chosen {
    /// The likeliest answer, with its confidence, the number of other things that move, and a clause of why it is doubtful for
    /// another reason.
    Likeliest { confidence: f64, others: usize, doubt: Option<&'static str> },
    /// A place that the user pointed at.
    Pointed,
    /// A number of the picture that the user named.
    Numbered,
}

/// The nodes that were followed, in the recording's own pixels and frames.
pub(super) struct Moving {
    /// A name for each column.
    pub(super) names: Vec<String>,
    pub(super) markers: Vec<Marker>,
    pub(super) chosen: Chosen,
    pub(super) scale: f64,
    copies: usize,
    decoded: usize,
    pub(super) stamps: Vec<FrameStamp>,
    /// By frame, then track.
    pub(super) rows: Vec<Vec<Observation>>,
    ending: Ending,
    damage: Damage,
    /// Bodies of the columns, where there are any.
    pub(super) bodies: Option<PathRig>,
    /// Rows of shorter tracks, which may be pieces of the columns.
    pub(super) pieces: Vec<Vec<Observation>>,
    /// Places that were pointed at and are not followed, and a sentence on each.
    refused: Vec<(String, Message)>,
}

impl Moving {
    /// Of finished markers, a column for each.
    pub fn of(film: &WorkFilm, markers: Vec<Marker>, chosen: Chosen) -> Self {
        let rows = rows(film, &markers);
        Self {
            names: (0..markers.len()).map(|k| format!("n{k}")).collect(),
            markers,
            chosen,
            scale: film.shrink() as f64,
            copies: film.copies(),
            decoded: film.decoded(),
            stamps: film.stamps().to_vec(),
            ending: film.ending().clone(),
            damage: film.damage().clone(),
            rows,
            bodies: None,
            pieces: Vec::new(),
            refused: Vec::new(),
        }
    }

    /// With names of its columns, and what was pointed at and is not followed.
    pub fn pointed_at(mut self, names: Vec<String>, refused: Vec<(String, Message)>) -> Self {
        (self.names, self.refused) = (names, refused);
        self
    }

    /// Whether all that was pointed at is followed.
    pub fn is_whole(&self) -> bool {
        self.refused.is_empty()
    }

    /// With tracks that may be pieces of its columns.
    pub fn and_pieces(mut self, film: &WorkFilm, pieces: Vec<Marker>) -> Self {
        self.pieces = rows(film, &pieces);
        self
    }

    /// Puts the columns into the order of a rig's nodes, by their places in its reference frame. Whether each node has one.
    pub fn name_by(&mut self, rig: &Rig) -> bool {
        let Some(order) = self.named(rig) else { return false };
        for row in &mut self.rows {
            *row = order.iter().map(|&k| row[k]).collect();
        }
        self.markers = order.iter().map(|&k| self.markers[k].clone()).collect();
        self.names = rig.nodes.iter().map(|n| n.name.clone()).collect();
        true
    }

    /// Names the columns by the nodes of a rig at whose places they were looked for.
    pub fn name_in_order(&mut self, rig: &Rig) {
        self.names = rig.nodes.iter().map(|n| n.name.clone()).collect();
    }

    /// Writes the table. The columns are those of a rig that is given, in its order.
    pub fn write(
        self,
        settings: &RunSettings,
        wanted: &Wanted,
        info: &SourceInfo,
        facts: SourceFacts,
    ) -> Result<RunSummary> {
        let rig = match &settings.rig {
            None => self.rig(&facts, settings, wanted),
            Some(rig) => Rig { pixel_aspect: facts.pixel_aspect, ..rig.clone() },
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
        let seen = Seen::Rows(&self.stamps, &self.rows);
        let mut replay = Replay::new(settings.edits.as_ref(), &rig, seen, settings.frames.is_none())?;
        for (place, (stamp, observations)) in self.stamps.iter().zip(&self.rows).enumerate() {
            let time_s = clock.seconds(place as u64, stamp.ticks);
            let observations = replay.made(stamp.index, observations);
            if let Some(writer) = &mut writer {
                writer.push(stamp.index, time_s, observations)?;
            }
            if let Some(collected) = &mut collected {
                collected.push(stamp.index, time_s, observations);
            }
            tally.push(observations);
        }
        let damage = self.damage.clone();
        let mut warnings = info.warnings.clone();
        warnings.extend(timing::notes(&timing));
        warnings.extend(damage.gaps.dropped_words().map(Message::from));
        let last = self.stamps.last().filter(|_| self.ending == Ending::Complete);
        warnings.extend(last.and_then(|stamp| settings.beyond(stamp.index)));
        warnings.extend(self.notes());
        let doubtful = self.doubts(&rig, &mut warnings);
        let decided = replay.finish();
        warnings.extend(decided.iter().map(|d| Message::from(d.words())));
        let mut meta = TableMeta {
            schema_version: SCHEMA_VERSION,
            tool: TableMeta::this_tool(),
            settings: self.settings_json(settings, wanted, &facts),
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
        if let Some(decided) = &decided {
            meta.settings[EDITS] = decided.to_json();
        }
        if let Some(writer) = writer {
            writer.finish(&meta)?;
        }
        Ok(RunSummary {
            frames: self.rows.len() as u64,
            resumed: 0,
            resumable: false,
            moving: true,
            doubtful,
            open: Vec::new(),
            not_followed: self.refused.into_iter().map(|(place, _)| place).collect(),
            nodes: tally.summary(),
            warnings,
            table: collected.map(|rows| NodeTable { meta: meta.clone(), rows }),
            meta,
        })
    }

    fn settings_json(&self, settings: &RunSettings, wanted: &Wanted, facts: &SourceFacts) -> Value {
        let looks: Vec<Value> = self
            .markers
            .iter()
            .map(|m| match &m.model {
                Some(model) => json!({
                    "bright": model.sign > 0.0,
                    "luma, blue, red": model.direction.0,
                    "octave": model.octave,
                    "radius_px": m.radius_px * self.scale,
                }),
                None => json!({ "by": "picture", "radius_px": m.radius_px * self.scale }),
            })
            .collect();
        let (confidence, others) = match self.chosen {
            Chosen::Likeliest { confidence, others, .. } => (Some(confidence), Some(others)),
            Chosen::Pointed | Chosen::Numbered => (None, None),
        };
        let detect = DetectSettings { pixel_aspect: facts.pixel_aspect, ..settings.detect.clone() };
        let mut all = json!({
            "detect": detect,
            MOVING: {
                "markers": looks,
                "confidence": confidence,
                "others": others,
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
        if !wanted.is_default() {
            all["wanted"] = json!(wanted);
        }
        all
    }

    /// For each node of a given rig the column of the marker that is at its place in the reference frame, or, where there is no
    /// such frame, where it is first seen; `None` where one has none.
    fn named(&self, rig: &Rig) -> Option<Vec<usize>> {
        let row: Vec<Observation> = match rig.reference_frame {
            Some(index) => self.rows[self.stamps.iter().position(|s| s.index == index)?].clone(),
            None => (0..self.markers.len()).map(|k| self.first_seen(k)).collect(),
        };
        let mut order = Vec::with_capacity(rig.nodes.len());
        for node in &rig.nodes {
            let off = |k: &usize| (row[*k].x_px - node.x_px).hypot(row[*k].y_px - node.y_px);
            let near_px = |k: &usize| NAMED_RADII * self.markers[*k].radius_px * self.scale;
            let free = (0..row.len()).filter(|k| !order.contains(k) && row[*k].status.is_seen());
            order.push(free.min_by(|a, b| off(a).total_cmp(&off(b))).filter(|k| off(k) < near_px(k))?);
        }
        Some(order)
    }

    /// The first row of a column in which it is seen, or a missing one.
    fn first_seen(&self, node: usize) -> Observation {
        let seen = self.rows.iter().map(|r| r[node]).find(|o| o.status.is_seen());
        seen.unwrap_or(Observation::MISSING)
    }

    /// One body for each node; the reference frame is the first in which all are seen, if there is one.
    pub(super) fn single_rig(&self, facts: &SourceFacts, settings: &RunSettings, wanted: &Wanted) -> Rig {
        let image = |o: &Observation| [o.x_px, o.y_px];
        let whole = self.rows.iter().position(|r| r.iter().all(|o| o.status.is_seen()));
        let place = |node: usize| match whole {
            Some(frame) => image(&self.rows[frame][node]),
            None => {
                Some(self.first_seen(node)).filter(|o| o.status.is_seen()).as_ref().map_or([0.0; 2], image)
            }
        };
        let name = |node: usize| format!("body{}", node + 1);
        let count = self.markers.len();
        Rig {
            schema: RIG_SCHEMA,
            image_px: [facts.width, facts.height],
            pixel_aspect: facts.pixel_aspect,
            reference_frame: whole.map(|f| self.stamps[f].index),
            region: settings.detect.region.clone(),
            lens: None,
            camera: None,
            wanted: wanted.clone(),
            bodies: (0..count).map(|k| Body { name: name(k) }).collect(),
            nodes: (0..count)
                .map(|k| {
                    let [x_px, y_px] = place(k);
                    Node { name: self.names[k].clone(), body: name(k), x_px, y_px }
                })
                .collect(),
            joints: Vec::new(),
        }
    }

    /// The notes on how the nodes were found.
    fn notes(&self) -> Vec<Message> {
        let count = self.markers.len();
        let markers = if count == 1 { "marker" } else { "markers" };
        let looks = |m: &Marker| words(m, self.scale);
        let what = match &self.chosen {
            Chosen::Likeliest { confidence, others, .. } => {
                let others = match others {
                    0 => String::new(),
                    1 => "; one more thing moves and is not followed".into(),
                    n => format!("; {n} more things move and are not followed"),
                };
                let mut all: Vec<String> = self.markers.iter().map(looks).collect();
                all.dedup();
                let kinds = if all.len() > 1 { "several looks" } else { "one look" };
                let look = all.join("; ");
                format!(
                    "no markers stand out from an even background: followed what moves, {count} {markers} of {kinds} ({look}), \
                     with confidence {confidence:.2} of 1{others}"
                )
            }
            Chosen::Pointed | Chosen::Numbered => {
                let by = if matches!(self.chosen, Chosen::Pointed) { "place" } else { "number" };
                let each = self.names.iter().zip(&self.markers).filter(|(_, m)| m.track.count > 0);
                let each: Vec<String> = each.map(|(n, m)| format!("{n} ({})", looks(m))).collect();
                format!("followed what moves and was named by its {by}: {}", each.join(", "))
            }
        };
        let mut notes: Vec<Message> = vec![
            format!("{what}. {}. Look at the overlay before you use the table", self.bodies_words()).into(),
        ];
        notes.extend(self.refused.iter().map(|(_, words)| words.clone()));
        notes.extend(self.bodies.iter().flat_map(|b| b.warnings.clone()));
        if self.copies > 0 {
            notes.push(copies_words(self.copies, self.decoded));
        }
        notes
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::moving::{Direction, Model, Track};
    use crate::observation::Status;

    /// A column for each radius, in work pictures of half the size.
    fn moving(radii_px: &[f64], rows: Vec<Vec<Observation>>) -> Moving {
        let model = Model { direction: Direction::LUMA, sign: 1.0, octave: 1 };
        let marker = |r: &f64| Marker { track: Track::of(Vec::new(), *r), model: Some(model), radius_px: *r };
        Moving {
            names: (0..radii_px.len()).map(|k| format!("n{k}")).collect(),
            markers: radii_px.iter().map(marker).collect(),
            chosen: Chosen::Likeliest { confidence: 0.5, others: 0, doubt: None },
            scale: 2.0,
            copies: 0,
            decoded: rows.len(),
            stamps: (0..rows.len() as u64)
                .map(|k| FrameStamp { index: k, ticks: k as i64, decoded: true })
                .collect(),
            rows,
            ending: Ending::Complete,
            damage: Damage::default(),
            bodies: None,
            pieces: Vec::new(),
            refused: Vec::new(),
        }
    }

    fn at(x_px: f64) -> Observation {
        Observation { x_px, y_px: 0.0, sigma_px: 0.1, status: Status::Seen, ..Observation::MISSING }
    }

    #[test]
    fn a_centre_is_doubtful_from_a_tenth_of_the_radius_on() {
        let seen = |sigma_px: f32| Observation { sigma_px, ..at(0.0) };
        // A work picture of half the size: the radius is 10 px. A node that is never seen is not doubtful.
        let rows = vec![vec![seen(0.9), seen(1.1), Observation::MISSING]; 3];
        assert_eq!(moving(&[5.0; 3], rows).doubtful(), [(1, 1.1)]);
    }

    #[test]
    fn two_columns_become_one_where_they_are_not_seen_apart() {
        let none = Observation::MISSING;
        let same = |a: &str, b: &str| [[a.to_owned(), b.to_owned()]];
        let mut m = moving(&[5.0; 3], vec![vec![at(1.0), none, at(50.0)], vec![none, at(2.0), at(51.0)]]);
        m.unite(&same("n0", "n1")).unwrap();
        assert_eq!(m.names, ["n0", "n2"]);
        let x = |r: &Vec<Observation>| r.iter().map(|o| o.x_px).collect::<Vec<_>>();
        assert_eq!(m.rows.iter().map(x).collect::<Vec<_>>(), [[1.0, 50.0], [2.0, 51.0]]);
        let error = m.unite(&same("n0", "n2")).unwrap_err().to_string();
        assert!(error.starts_with("same, frame 0: n0 and n2 are both seen, 49 px apart"), "{error}");
        let error = m.unite(&same("n0", "n1")).unwrap_err().to_string();
        assert!(error.contains("n1 is no node") && error.ends_with("n0, n2"), "{error}");
    }
}
