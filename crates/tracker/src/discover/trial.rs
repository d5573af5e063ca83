//! Tries rigs on a stretch of the recording, and takes the one that names most without undoing what is certain.
//!
//! Owns: [`choose`]. Must not: find bodies.

use std::collections::HashMap;

use super::discovery::Discovery;
use crate::error::{Error, Result};
use crate::link::Tracklet;
use crate::message::Message;
use crate::rig::Rig;
use crate::stop::Stop;
use crate::store::DetectionStore;
use crate::track::track_recording;

/// Frames before and after the reference picture in which a rig is tried.
const FRAMES: usize = 300;
/// Cost, in rows, of a row that gives a tracklet a second name.
const COST: f64 = 5.0;
/// A reading that comes earlier stands unless a later one is better by this part of what is seen.
const BETTER: f64 = 0.01;
/// Or names as many nodes in fewer bodies and is worse by no more than this: bodies that always move as one are one.
const AS_GOOD: f64 = 0.002;

/// Of the readings, the likelier first, the one that names most; the first one's error where none names anything.
///
/// # Errors
/// That of the first reading; [`Error::Interrupted`] once `stop` was asked for.
pub(super) fn choose(
    store: &DetectionStore,
    tracklets: &[Tracklet],
    readings: Vec<Result<Discovery>>,
    stop: &Stop,
) -> Result<Discovery> {
    let mut best: Option<(f64, Discovery)> = None;
    let mut fault: Option<Error> = None;
    for reading in readings {
        match reading {
            Err(Error::Interrupted) => return Err(Error::Interrupted),
            Err(e) => {
                fault.get_or_insert(e);
            }
            Ok(found) => {
                let worth = worth(store, tracklets, &found.rig, stop)?;
                let simpler = |rig: &Rig| {
                    found.rig.nodes.len() >= rig.nodes.len()
                        && found.rig.bodies.len() < rig.bodies.len()
                        && loose(&found.rig) <= loose(rig)
                };
                if best.as_ref().is_none_or(|(most, b)| {
                    worth > most + BETTER || worth > most - AS_GOOD && simpler(&b.rig)
                }) {
                    best = Some((worth, found));
                }
            }
        }
    }
    match (best, fault) {
        (Some((_, found)), _) => Ok(found),
        (None, Some(fault)) => Err(fault),
        (None, None) => {
            Err(Error::Rig(crate::error::Fault::new("recording", Message::from("nothing was read"))))
        }
    }
}

/// Bodies without a joint.
fn loose(rig: &Rig) -> usize {
    let hangs = |name: &String| rig.joints.iter().any(|j| j.bodies.contains(name));
    rig.bodies.iter().filter(|b| !hangs(&b.name)).count()
}

/// Rows that are named less those that contradict a tracklet, as a part of the tracklets' points.
fn worth(store: &DetectionStore, tracklets: &[Tracklet], rig: &Rig, stop: &Stop) -> Result<f64> {
    let first = store.stamp(0).index;
    let reference = rig.reference_frame.map_or(0, |r| r.saturating_sub(first) as usize);
    let range = reference.saturating_sub(FRAMES)..(reference + FRAMES).min(store.len());
    let stretch = store.stretch(range.clone())?;
    // What is at a place of a frame is found by its bits: a place is given as it was detected, but for a camera's rounding.
    let key = |x: f64, y: f64| ((x * 64.0).round() as i64, (y * 64.0).round() as i64);
    let mut at: HashMap<(usize, i64, i64), usize> = HashMap::new();
    let mut points = 0_usize;
    for (t, tracklet) in tracklets.iter().enumerate().filter(|(_, t)| t.extent_px() > 6.0) {
        for i in range.start.max(tracklet.first)..range.end.min(tracklet.end()) {
            let p = rig.pixel_aspect.to_recorded(tracklet.points[i - tracklet.first].place);
            let (x, y) = key(p.x, p.y);
            for (dx, dy) in [(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)] {
                at.entry((i, x + dx, y + dy)).or_insert(t);
            }
            points += 1;
        }
    }
    let mut names: HashMap<usize, Vec<usize>> = HashMap::new();
    let nodes = rig.nodes.len();
    let outcome = track_recording(&stretch, rig, stop, &mut |stamp, row| {
        let i = (stamp.index - first) as usize;
        for (node, o) in row.iter().enumerate().filter(|(_, o)| o.x_px.is_finite()) {
            let (x, y) = key(o.x_px, o.y_px);
            if let Some(&t) = at.get(&(i, x, y)) {
                names.entry(t).or_insert_with(|| vec![0; nodes])[node] += 1;
            }
        }
        Ok(())
    });
    match outcome {
        Ok(_) => {}
        Err(Error::Interrupted) => return Err(Error::Interrupted),
        Err(_) => return Ok(f64::NEG_INFINITY),
    }
    let (mut named, mut against) = (0, 0);
    for counts in names.values() {
        let most = counts.iter().max().copied().unwrap_or(0);
        let all: usize = counts.iter().sum();
        named += all;
        against += all - most;
    }
    Ok((named as f64 - COST * against as f64) / points.max(1) as f64)
}
