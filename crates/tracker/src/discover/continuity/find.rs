//! Forms bodies of tracklets, the surest first, and finds the camera under which they are rigid.
//!
//! Owns: [`bodies`], [`camera`].

use super::absorb::absorb;
use super::body::{FoundBody, TrackletBody};
use super::evidence::Evidence;
use super::hanging::{hanging, levels};
use super::pairs::PairFacts;
use super::stitch::{merge, stitch};
use crate::calibrate::{Calibration, Pair, PairPlace, RigidSet, calibrate, refine};
use crate::camera::Camera;
use crate::error::Result;
use crate::stop::Stop;

/// Frames that a pair must share to tell of the camera.
const PAIR_FRAMES: usize = 40;
/// All but 15 % of its distances vary by no more than this part of it: more than any camera does.
const VARIES: f64 = 0.1;
/// Turn of a pair that says something of the camera, rad.
const TURNED_RAD: f64 = 0.3;
/// Pairs of which a camera is estimated, and frames of each.
const PAIRS: usize = 60;
const PLACES: usize = 200;
/// Tracklets among which groups are sought.
const SEEDS: usize = 100;
/// Frames of a body from which camera and shape are estimated together.
const BUNDLED: usize = 250;

/// The facts of every two tracklets that share enough frames.
pub(super) struct Table {
    n: usize,
    facts: Vec<Option<PairFacts>>,
}

impl Table {
    fn of(evidence: &Evidence<'_>, stop: &Stop) -> Result<Self> {
        use rayon::prelude::*;
        let n = evidence.tracklets.len();
        let rows: Vec<Vec<Option<PairFacts>>> = (0..n)
            .into_par_iter()
            .map(|a| {
                stop.heed()?;
                Ok((0..n).map(|b| if a < b { PairFacts::of(evidence, a, b) } else { None }).collect())
            })
            .collect::<Result<_>>()?;
        Ok(Self { n, facts: rows.into_iter().flatten().collect() })
    }

    fn get(&self, a: usize, b: usize) -> Option<&PairFacts> {
        self.facts[a.min(b) * self.n + a.max(b)].as_ref()
    }

    fn rigid(&self, a: usize, b: usize) -> Option<&PairFacts> {
        self.get(a, b).filter(|f| f.rigid())
    }

    fn pairs(&self) -> impl Iterator<Item = (usize, usize, &PairFacts)> {
        self.facts.iter().enumerate().filter_map(|(i, f)| Some((i / self.n, i % self.n, f.as_ref()?)))
    }
}

/// The camera under which bodies are rigid; `None` where one that faces the plane squarely does as well.
///
/// # Errors
/// [`crate::error::Error::Interrupted`] once `stop` was asked for.
pub fn camera(evidence: &Evidence<'_>, size_px: [f64; 2], stop: &Stop) -> Result<Option<Calibration>> {
    let Some(near) = of_pairs(evidence, size_px, stop)? else { return Ok(None) };
    let bodies = tracklet_bodies(&evidence.through(Some(&near)), stop)?.0;
    let sets: Vec<RigidSet> = bodies.iter().map(|b| rigid_set(evidence, b)).collect();
    refine(near, &sets, evidence.sigma_px, stop)
}

/// A body's markers as the picture shows them.
fn rigid_set(evidence: &Evidence<'_>, body: &TrackletBody) -> RigidSet {
    let mut frames = vec![Vec::new(); evidence.frames.len()];
    for (q, tracklets) in body.markers.iter().enumerate() {
        for &t in tracklets {
            for k in evidence.spans[t].clone() {
                if let Some(p) = evidence.place(t, k) {
                    frames[k].push((q, p));
                }
            }
        }
    }
    frames.retain(|seen| seen.len() > 1);
    let n = frames.len();
    let frames = (0..n.min(BUNDLED)).map(|k| std::mem::take(&mut frames[k * n / n.min(BUNDLED)])).collect();
    RigidSet { shape: body.shape.clone(), frames }
}

/// The camera under which most pairs of tracklets keep their distance; `None` where none keep theirs nearly.
fn of_pairs(evidence: &Evidence<'_>, size_px: [f64; 2], stop: &Stop) -> Result<Option<Camera>> {
    let table = Table::of(evidence, stop)?;
    let mut near: Vec<(usize, usize, &PairFacts)> = table
        .pairs()
        .filter(|(.., f)| f.frames >= PAIR_FRAMES && f.varies < VARIES && f.turned_rad > TURNED_RAD)
        .collect();
    // Those that turn far first: their distances say most, and by chance fewest of them stay.
    near.sort_by(|x, y| {
        let worth = |f: &PairFacts| f.frames as f64 * f.turned_rad.min(3.0);
        worth(y.2).total_cmp(&worth(x.2))
    });
    near.truncate(PAIRS);
    let pairs: Vec<Pair> = near
        .iter()
        .map(|&(a, b, f)| {
            let all: Vec<PairPlace> = evidence
                .shared(a, b)
                .filter_map(|k| {
                    Some(PairPlace { first: evidence.place(a, k)?, second: evidence.place(b, k)? })
                })
                .collect();
            let n = all.len();
            let places = (0..n.min(PLACES)).map(|k| all[k * n / n.min(PLACES)]).collect();
            Pair { places, distance_px: f.distance_px, sigma_px: evidence.sigma_px }
        })
        .collect();
    calibrate(&pairs, size_px, stop)
}

/// Bodies of three, of two and of single markers, with their poses in the frames of the evidence.
///
/// # Errors
/// [`crate::error::Error::Interrupted`] once `stop` was asked for.
pub fn bodies(evidence: &Evidence<'_>, stop: &Stop) -> Result<Vec<FoundBody>> {
    let (bodies, free) = tracklet_bodies(evidence, stop)?;
    let mut found: Vec<FoundBody> = bodies.iter().map(TrackletBody::found).collect();
    found.extend(hanging(evidence, &bodies, &free));
    Ok(found)
}

/// Bodies of two markers and more, and which tracklets are none of theirs.
fn tracklet_bodies(evidence: &Evidence<'_>, stop: &Stop) -> Result<(Vec<TrackletBody>, Vec<bool>)> {
    let table = Table::of(evidence, stop)?;
    let mut free = vec![true; evidence.tracklets.len()];
    let mut bodies: Vec<TrackletBody> = Vec::new();
    let levels = levels(evidence, &|a, b| table.rigid(a, b).is_some());
    while let Some(group) = next_group(&table, &free, &levels) {
        stop.heed()?;
        for &t in &group {
            free[t] = false;
        }
        bodies.push(TrackletBody::fit(evidence, group.into_iter().map(|t| vec![t]).collect()));
        absorb(evidence, &mut bodies, &mut free);
    }
    loop {
        stop.heed()?;
        let merged = merge(evidence, &mut bodies);
        let grown = absorb(evidence, &mut bodies, &mut free);
        if !merged && !grown && !stitch(evidence, &mut bodies) {
            break;
        }
    }
    Ok((bodies, free))
}

/// The tracklets that are most surely one body: three or more that all keep their distances, else two of which none hangs on the
/// other.
fn next_group(table: &Table, free: &[bool], levels: &[Option<usize>]) -> Option<Vec<usize>> {
    let n = table.n.min(SEEDS);
    let there: Vec<usize> = (0..n).filter(|&t| free[t]).collect();
    let mut best: Option<((bool, usize, f64), Vec<usize>)> = None;
    for &seed in &there {
        // From the seed outwards, those first that share most frames with it.
        let mut near: Vec<(usize, usize)> = there
            .iter()
            .filter(|&&t| t != seed)
            .filter_map(|&t| table.rigid(seed, t).map(|f| (f.frames, t)))
            .collect();
        near.sort_by_key(|&(frames, t)| (std::cmp::Reverse(frames), t));
        let mut group = vec![seed];
        for (_, t) in near {
            if group.iter().all(|&g| table.rigid(g, t).is_some()) {
                group.push(t);
            }
        }
        if group.len() < 2 {
            continue;
        }
        let (mut frames, mut rms_px) = (0, 0.0);
        for (i, &a) in group.iter().enumerate() {
            for &b in &group[i + 1..] {
                if let Some(f) = table.rigid(a, b) {
                    frames += f.frames;
                    rms_px += f.rms_px;
                }
            }
        }
        let worth = (group.len() > 2, frames, -rms_px);
        if best.as_ref().is_none_or(|(w, _)| {
            (worth.0, worth.1) > (w.0, w.1) || ((worth.0, worth.1) == (w.0, w.1) && worth.2 > w.2)
        }) {
            best = Some((worth, group));
        }
    }
    let (worth, group) = best?;
    if worth.0 {
        return Some(group);
    }
    // Among pairs that share about as many frames the one whose distance is steadiest.
    let pairs: Vec<(usize, usize, &PairFacts)> = table
        .pairs()
        .filter(|&(a, b, f)| a < n && b < n && free[a] && free[b] && f.rigid() && levels[a] == levels[b])
        .collect();
    let most = pairs.iter().map(|p| p.2.frames).max()?;
    let steady = |f: &PairFacts| f.part / (f.rms_px + 1e-3);
    pairs
        .iter()
        .filter(|p| 2 * p.2.frames >= most)
        .max_by(|x, y| steady(x.2).total_cmp(&steady(y.2)))
        .map(|p| vec![p.0, p.1])
}
