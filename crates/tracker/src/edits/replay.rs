//! Makes the decisions on the rows as they go by, and counts them.
//!
//! Owns: [`Replay`], [`Decided`], [`edited`]. Must not: read files, or choose what is decided.

use std::collections::BTreeMap;
use std::ops::Range;

use serde_json::{Value, json};

use super::decision::{Decision, What};
use super::file::Edits;
use super::linked::{Nothing, Seen, follow};
use crate::error::Result;
use crate::message::Setting;
use crate::observation::{Observation, Status};
use crate::rig::Rig;
use crate::store::FrameStamp;
use crate::table::{NodeTable, Rows};

/// Two markers whose centres are nearer than this are one, px: the smallest that are detected are larger. Who had the name of
/// what a person names otherwise loses it.
const ONE_PLACE_PX: f64 = 0.5;

/// A decision ready to be made.
#[derive(Debug)]
struct Ready {
    what: What,
    span: Range<u64>,
    node: usize,
    /// The other node of an exchange.
    with: usize,
    /// Places by frame, of a place and a name.
    places: BTreeMap<u64, Observation>,
}

/// Rows of one node that people decided.
#[derive(Debug, Clone, PartialEq, Eq)]
struct OfNode {
    rows: u64,
    first: u64,
    last: u64,
}

/// The rows that people decided.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Decided {
    decisions: usize,
    sha256: String,
    /// Of each node that has any, in the rig's order.
    nodes: Vec<(String, OfNode)>,
}

impl Decided {
    /// How many rows.
    pub fn rows(&self) -> u64 {
        self.nodes.iter().map(|(_, n)| n.rows).sum()
    }

    /// How many rows and where, in a sentence.
    pub fn words(&self) -> String {
        let rows = self.rows();
        let were = if rows == 1 { "1 row was".to_owned() } else { format!("{rows} rows were") };
        let of_node = |(name, n): &(String, OfNode)| {
            let frames = if n.first == n.last {
                format!("frame {}", n.first)
            } else {
                format!("frames {} to {}", n.first, n.last)
            };
            format!("{} of {name} in {frames}", n.rows)
        };
        let all: Vec<String> = self.nodes.iter().map(of_node).collect();
        if all.is_empty() {
            return "no row was decided by a person: no decision is about these frames".into();
        }
        format!("{were} decided by a person: {}", all.join(", "))
    }

    /// For the table's metadata.
    pub fn to_json(&self) -> Value {
        let of_node = |(name, n): &(String, OfNode)| json!({"node": name, "rows": n.rows, "first_frame": n.first, "last_frame": n.last});
        json!({
            "sha256": self.sha256,
            "decisions": self.decisions,
            "rows": self.rows(),
            "nodes": self.nodes.iter().map(of_node).collect::<Vec<_>>(),
            "words": self.words(),
        })
    }
}

/// Makes decisions on a finished table, by its rows alone. Its metadata stay.
///
/// # Errors
/// As [`Replay::new`], and where the decisions are about another film.
pub fn edited(mut table: NodeTable, edits: &Edits) -> Result<NodeTable> {
    edits.belongs(&table.meta.source)?;
    let (count, nodes) = (table.frames(), table.nodes());
    let rows: Vec<Vec<Observation>> = (0..count)
        .map(|t| (0..nodes).filter_map(|n| table.rows.observation(t, n, nodes)).collect())
        .collect();
    let stamp = |t: usize| {
        let decoded = rows[t].iter().all(|o| o.status != Status::Undecoded);
        FrameStamp { index: table.rows.frame[t] as u64, ticks: t as i64, decoded }
    };
    let stamps: Vec<FrameStamp> = (0..count).map(stamp).collect();
    let mut replay = Replay::new(Some(edits), &table.meta.rig, Seen::Rows(&stamps, &rows), false)?;
    let mut out = Rows::default();
    for (t, row) in rows.iter().enumerate() {
        out.push(stamps[t].index, table.rows.time_s[t], replay.made(stamps[t].index, row));
    }
    table.rows = out;
    Ok(table)
}

/// The state of a node in the last frame.
#[derive(Debug, Clone, Default)]
struct Last {
    seen: bool,
    ever: bool,
    decided: bool,
    of_node: Option<OfNode>,
}

/// Makes decisions on rows in the order of their frames.
#[derive(Debug)]
pub struct Replay<'a> {
    edits: Option<&'a Edits>,
    names: Vec<String>,
    all: Vec<Ready>,
    last: Vec<Last>,
    decided: Vec<bool>,
    row: Vec<Observation>,
}

impl<'a> Replay<'a> {
    /// Checks the decisions against rig and recording and follows what was named. `is_all`: the frames are all that the
    /// recording has; decisions about others are mistakes then, and are left out otherwise. Without edits all rows stay.
    ///
    /// # Errors
    /// [`crate::error::Error::Argument`] naming file and line of a node, a frame or a detection that is not there.
    pub fn new(edits: Option<&'a Edits>, rig: &Rig, seen: Seen<'_>, is_all: bool) -> Result<Self> {
        let nodes = rig.nodes.len();
        Ok(Self {
            edits,
            names: rig.nodes.iter().map(|n| n.name.clone()).collect(),
            all: edits.map_or_else(|| Ok(Vec::new()), |edits| ready(edits, rig, seen, is_all))?,
            last: vec![Last::default(); nodes],
            decided: vec![false; nodes],
            row: Vec::with_capacity(nodes),
        })
    }

    /// One frame's row with the decisions made, in the order of the rig's nodes; frames come in their order.
    pub fn made<'b>(&'b mut self, frame: u64, row: &'b [Observation]) -> &'b [Observation] {
        if self.edits.is_none() {
            return row;
        }
        let mut own = std::mem::take(&mut self.row);
        row.clone_into(&mut own);
        self.apply(frame, &mut own);
        self.row = own;
        &self.row
    }

    fn apply(&mut self, frame: u64, row: &mut [Observation]) {
        self.decided.fill(false);
        if row.iter().all(|o| o.status != Status::Undecoded) {
            for ready in self.all.iter().filter(|r| r.span.contains(&frame)) {
                ready.apply(frame, row, &mut self.decided);
            }
        }
        for ((o, last), &decided) in row.iter_mut().zip(&mut self.last).zip(&self.decided) {
            // Whether a node came back is seen from the row before it, which may be another now.
            if last.decided && !decided && o.status.is_seen() {
                o.status = if last.ever && !last.seen { Status::Reacquired } else { Status::Seen };
            }
            if o.status != Status::Undecoded {
                last.seen = o.status.is_seen();
                last.ever |= last.seen;
                last.decided = decided;
            }
            if decided {
                let n = last.of_node.get_or_insert(OfNode { rows: 0, first: frame, last: frame });
                n.rows += 1;
                n.last = frame;
            }
        }
    }

    /// The rows that were decided; `None` without edits.
    pub fn finish(self) -> Option<Decided> {
        let edits = self.edits?;
        let nodes = self.names.into_iter().zip(self.last).filter_map(|(name, l)| Some((name, l.of_node?)));
        let (decisions, sha256) = (edits.decisions.len(), edits.sha256.clone());
        Some(Decided { decisions, sha256, nodes: nodes.collect() })
    }
}

/// The decisions, each with its nodes and places.
fn ready(edits: &Edits, rig: &Rig, seen: Seen<'_>, is_all: bool) -> Result<Vec<Ready>> {
    edits.fits(rig)?;
    let known = seen.frames();
    let mut all = Vec::with_capacity(edits.decisions.len());
    for (k, decision) in edits.decisions.iter().enumerate() {
        let span = decision.span();
        if is_all {
            within(edits, k, decision, &known)?;
        }
        if let Some(frame) = decision.frame {
            if !known.contains(&frame) {
                continue;
            }
            if !seen.is_decoded(frame) {
                let problem =
                    format!("frame {frame} could not be decoded: nobody knows where anything is in it");
                return Err(edits.wrong(k, problem, "Take the decision out"));
            }
        }
        let index = |name: &String| rig.nodes.iter().position(|n| n.name == *name).unwrap_or(usize::MAX);
        all.push(Ready {
            what: decision.what,
            places: places(edits, k, decision, seen)?,
            span,
            node: index(&decision.node),
            with: decision.with.as_ref().map_or(usize::MAX, index),
        });
    }
    Ok(all)
}

impl Ready {
    fn apply(&self, frame: u64, row: &mut [Observation], decided: &mut [bool]) {
        match self.what {
            What::NoMarker => {
                row[self.node] = Observation::MISSING;
                decided[self.node] = true;
            }
            What::Place | What::Name => {
                let Some(place) = self.places.get(&frame) else { return };
                row[self.node] = *place;
                decided[self.node] = true;
                for (k, o) in row.iter_mut().enumerate() {
                    let apart_px = (o.x_px - place.x_px).hypot(o.y_px - place.y_px);
                    if k != self.node && o.status.is_seen() && apart_px < ONE_PLACE_PX {
                        *o = Observation::MISSING;
                        decided[k] = true;
                    }
                }
            }
            What::Exchange => {
                row.swap(self.node, self.with);
                for k in [self.node, self.with] {
                    if row[k].status.is_seen() {
                        row[k].status = Status::Manual;
                    }
                    decided[k] = true;
                }
            }
        }
    }
}

/// Refuses a decision about frames that the recording does not have.
fn within(edits: &Edits, k: usize, decision: &Decision, known: &Range<u64>) -> Result<()> {
    let span = decision.span();
    let last = known.end.saturating_sub(1);
    let beyond = [Some(span.start), decision.frame, Some(span.end - 1).filter(|_| span.end < u64::MAX)];
    match beyond.into_iter().flatten().find(|frame| !known.contains(frame)) {
        None => Ok(()),
        Some(frame) => Err(edits.wrong(
            k,
            format!("the recording has frames {} to {last}, and no frame {frame}", known.start),
            "Correct the frame, or leave the end of the range out",
        )),
    }
}

/// The places by frame that a decision gives.
fn places(
    edits: &Edits,
    k: usize,
    decision: &Decision,
    seen: Seen<'_>,
) -> Result<BTreeMap<u64, Observation>> {
    let (Some(frame), Some(at_px)) = (decision.frame, decision.at_px) else { return Ok(BTreeMap::new()) };
    if let Some(sigma_px) = decision.sigma_px {
        let place = Observation {
            x_px: at_px[0],
            y_px: at_px[1],
            sigma_px: sigma_px as f32,
            status: Status::Manual,
            ..Observation::MISSING
        };
        return Ok(BTreeMap::from([(frame, place)]));
    }
    match follow(seen, frame, at_px, &decision.span())? {
        Ok(found) => Ok(found),
        Err(Nothing::NoFrame) => Ok(BTreeMap::new()),
        Err(Nothing::NotThere(far)) => {
            let near = far.map_or_else(String::new, |px| format!("; the nearest is {px:.1} px away"));
            let problem = format!(
                "nothing is detected at ({}, {}) px of frame {frame} with these settings{near}",
                at_px[0], at_px[1]
            );
            let advice = "Track with the settings with which it was named, such as " + Setting::Threshold;
            Err(edits.wrong(k, problem, advice + ", or place it by hand"))
        }
    }
}
