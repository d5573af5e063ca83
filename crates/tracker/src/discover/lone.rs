//! Finds markers that belong to no body of three: alone, or the only one of their link.
//!
//! Owns: [`find_lone`]. Here frames are linked by nearness, since there are no distances to go by.

use nalgebra::{Isometry2, Vector2};
use rayon::prelude::*;

use super::arrange::Found;
use super::bodies::{self, FLOOR_PX, link_of, looks_whole};
use super::sample::Sample;
use crate::detect::Detection;
use crate::error::Result;
use crate::rigid::body::Link;
use crate::rigid::pose::{Pair, fit_pose, place};
use crate::stop::Stop;
use crate::store::PlaneView;

/// Frames linked at most.
const FRAMES: usize = 3000;
/// Markers alone that are kept at most, those that are seen longest: each may be any other, so the work of following them
/// grows with the square of their number.
pub const MOST_LONE: usize = 100;
/// Frames a path must have to be a marker's.
const LEAST: usize = 6;

/// A marker's way through the recording.
#[derive(Debug, Clone)]
struct Path {
    at: Vec<(usize, Vector2<f64>)>,
    /// Areas and elongations of its detections.
    shape: Vec<(f32, f32)>,
    /// Whether each is the whole of one marker: the others' centres are not its.
    whole: Vec<bool>,
}

impl Path {
    fn guess(&self, frame: usize) -> Option<Vector2<f64>> {
        let &(f0, p0) = self.at.last()?;
        let h = (frame - f0) as f64;
        Some(match self.at.len() {
            1 => p0,
            n => {
                let (f1, p1) = self.at[n - 2];
                p0 + (p0 - p1) / (f0 - f1) as f64 * h
            }
        })
    }

    /// Whether its detections look alike and round, as a marker's do and a hand's do not.
    fn is_marker(&self) -> bool {
        let mut areas: Vec<f32> = self.shape.iter().map(|s| s.0).collect();
        areas.sort_by(f32::total_cmp);
        let mut long: Vec<f32> = self.shape.iter().map(|s| s.1).collect();
        long.sort_by(f32::total_cmp);
        let n = areas.len();
        // Blur of length L makes a disc of radius r by 0.64 L / r larger and, in second moments, sqrt(1 + L^2 / 3 r^2)
        // times as long as wide. Four fifths within 1.6 in area allow a speed that comes to blur of r; a median length
        // of 1.8 allows blur of 2.6 r throughout.
        areas[n - 1 - n / 10] < 1.6 * areas[n / 10] && long[n / 2] < 1.8
    }

    fn travelled(&self) -> f64 {
        let first = self.at[0].1;
        self.at.iter().map(|p| (p.1 - first).norm()).fold(0.0, f64::max)
    }
}

/// Where a body's nodes are, nearer than this, what is seen is theirs, px.
const OWN_PX: f64 = 10.0;
/// Distances that scatter by less are constant, px, and the same as a part of the distance.
const RIGID_PX: f64 = 0.5;
const RIGID_PART: f64 = 0.004;
/// Turn of the line between two markers from which their distance says something, rad.
const TURNED_RAD: f64 = 0.3;
/// Joints nearer together than this are one, px.
const SAME_JOINT_PX: f64 = 3.0;

/// The detections of a frame that are no node of the bodies; `None` where not every body is found.
fn left_over(links: &[Link], frame: &[Detection]) -> Option<Vec<Detection>> {
    let mut out = frame.to_vec();
    for (link, s) in links.iter().zip(bodies::poses(links, frame)) {
        let places = link.places(&s?.fit.pose);
        out.retain(|d| places.iter().all(|p| (p - Vector2::new(d.x_px, d.y_px)).norm() > OWN_PX));
    }
    Some(out)
}

/// Whether something moves that is no node of the bodies, in most of the sample's frames that show them all.
///
/// # Errors
/// [`crate::error::Error::Interrupted`] once `stop` was asked for.
pub fn others_move(sample: &Sample, links: &[Link], stop: &Stop) -> Result<bool> {
    let rest: Vec<usize> = sample
        .moving
        .par_iter()
        .filter_map(|f| stop.heed().map(|()| left_over(links, f)).transpose())
        .map(|rest| rest.map(|rest| rest.len()))
        .collect::<Result<_>>()?;
    Ok(2 * rest.iter().filter(|&&n| n > 0).count() > rest.len())
}

/// Markers that are on no body of three, with their places in the sample's frames, and how many more there were than are kept.
///
/// # Errors
/// [`crate::error::Error::Interrupted`] once `stop` was asked for.
pub fn find_lone(
    store: &PlaneView<'_>,
    sample: &Sample,
    standing: &[Vector2<f64>],
    links: &[Link],
    stop: &Stop,
) -> Result<(Vec<Found>, usize)> {
    let mut linked = 0;
    let mut open: Vec<Path> = Vec::new();
    let mut done: Vec<Path> = Vec::new();
    let mut scratch = Vec::new();
    for i in 0..store.len().min(FRAMES) {
        stop.heed()?;
        store.read(i, &mut scratch);
        let Some(rest) = left_over(links, &scratch) else { continue };
        linked += 1;
        let mut free: Vec<(Vector2<f64>, (f32, f32), bool)> = rest
            .iter()
            .map(|d| (Vector2::new(d.x_px, d.y_px), (d.area_px, d.elongation), looks_whole(d)))
            .filter(|(p, ..)| standing.iter().all(|s| (s - p).norm() > super::sample::STILL_PX))
            .collect();
        // Nearest pairs first, each used once.
        let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
        for (k, path) in open.iter().enumerate() {
            let Some(guess) = path.guess(i) else { continue };
            for (d, (p, ..)) in free.iter().enumerate() {
                let gate = if path.at.len() == 1 { 40.0 } else { 15.0 };
                let r = (p - guess).norm();
                if r < gate {
                    pairs.push((r, k, d));
                }
            }
        }
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut used = vec![false; free.len()];
        let mut grown = vec![false; open.len()];
        for (_, k, d) in pairs {
            if !used[d] && !grown[k] {
                used[d] = true;
                grown[k] = true;
                open[k].at.push((i, free[d].0));
                open[k].shape.push(free[d].1);
                open[k].whole.push(free[d].2);
            }
        }
        let mut still = Vec::new();
        for path in open.drain(..) {
            let last = path.at.last().map_or(0, |p| p.0);
            if i - last > 3 { done.push(path) } else { still.push(path) }
        }
        open = still;
        let mut keep = used.iter();
        free.retain(|_| !keep.next().copied().unwrap_or(false));
        open.extend(free.into_iter().map(|(p, s, w)| Path {
            at: vec![(i, p)],
            shape: vec![s],
            whole: vec![w],
        }));
    }
    done.append(&mut open);
    // Occluded bodies that make a rig already, what is seen for a moment is no part of it.
    let least = if links.is_empty() { LEAST } else { LEAST.max(linked / 5) };
    done.retain(|p| p.at.len() >= least && p.travelled() > 10.0 && p.is_marker());
    done.sort_by_key(|p| std::cmp::Reverse(p.at.len()));
    // Paths that overlap in time are different markers; one that fits none beside it may be any of them.
    let mut kept: Vec<Path> = Vec::new();
    for path in done {
        stop.heed()?;
        let span = |p: &Path| (p.at[0].0, p.at[p.at.len() - 1].0);
        let (a, b) = span(&path);
        let overlaps = |q: &Path| {
            let (c, d) = span(q);
            a <= d && c <= b
        };
        if kept.iter().all(overlaps) {
            kept.push(path);
        }
    }
    let left_out = kept.len().saturating_sub(MOST_LONE);
    kept.truncate(MOST_LONE);
    let found = kept.iter().map(|path| found_of(path, sample)).collect();
    Ok((found, left_out))
}

/// A marker alone, with its places in the sample's frames.
fn found_of(path: &Path, sample: &Sample) -> Found {
    let mut poses = vec![None; sample.frames.len()];
    for (&(f, p), _) in path.at.iter().zip(&path.whole).filter(|(_, whole)| **whole) {
        if let Ok(k) = sample.frames.binary_search(&f) {
            poses[k] = Some(Isometry2::new(p, 0.0));
        }
    }
    Found { link: link_of(vec![path.at[0].1], FLOOR_PX), poses }
}

/// Makes one body of every two lone markers that keep their distance, unless one hangs on the other: then one of them
/// goes about a point of the ground or of a body, and the other does not, or is farther out along a chain of them.
///
/// # Errors
/// [`crate::error::Error::Interrupted`] once `stop` was asked for.
pub fn pair_up(found: &mut Vec<Found>, stop: &Stop) -> Result<()> {
    while let Some((i, j, body)) = next_pair(found, stop)? {
        found[i] = body;
        found.remove(j);
    }
    Ok(())
}

fn next_pair(found: &[Found], stop: &Stop) -> Result<Option<(usize, usize, Found)>> {
    let lone: Vec<usize> = (0..found.len()).filter(|&k| found[k].link.nodes.len() == 1).collect();
    // What a marker goes about: the first of the ground and the bodies that it circles, and where.
    let about = |k: usize| {
        let holders = std::iter::once(None).chain(found.iter().map(Some));
        holders
            .enumerate()
            .filter(|(_, b)| b.is_none_or(|b| b.link.nodes.len() > 1))
            .find_map(|(h, b)| found[k].circle(b).map(|c| (h, c.middle)))
    };
    let joints: Vec<Option<(usize, Vector2<f64>)>> =
        lone.iter().map(|&k| stop.heed().map(|()| about(k))).collect::<Result<_>>()?;
    // How far out along a chain each is: one that keeps its distance from a marker that hangs, hangs on that.
    let mut out: Vec<Option<usize>> = joints.iter().map(|j| j.map(|_| 0)).collect();
    for level in 0..lone.len() {
        for a in (0..lone.len()).filter(|&a| joints[a].is_none()) {
            stop.heed()?;
            let hangs =
                |b: usize| out[b] == Some(level) && rigid_pair(&found[lone[b]], &found[lone[a]]).is_some();
            if out[a].is_none() && (0..lone.len()).any(hangs) {
                out[a] = Some(level + 1);
            }
        }
    }
    // Those about one point first: a body found may be what the next hang on.
    for together in [true, false] {
        for (a, &i) in lone.iter().enumerate() {
            for (b, &j) in lone.iter().enumerate().skip(a + 1) {
                stop.heed()?;
                let one = match (&joints[a], &joints[b]) {
                    (Some(p), Some(q)) => together && p.0 == q.0 && (p.1 - q.1).norm() < SAME_JOINT_PX,
                    (None, None) => !together && out[a] == out[b],
                    _ => false,
                };
                if one && let Some(body) = rigid_pair(&found[i], &found[j]) {
                    return Ok(Some((i, j, body)));
                }
            }
        }
    }
    Ok(None)
}

/// Two lone markers as one body, if they keep their distance while they turn.
fn rigid_pair(a: &Found, b: &Found) -> Option<Found> {
    let at = |f: &Found, k: usize| f.poses[k].map(|p| place(&p, f.link.template[0]));
    let both: Vec<Option<(Vector2<f64>, Vector2<f64>)>> =
        (0..a.poses.len()).map(|k| Some((at(a, k)?, at(b, k)?))).collect();
    let arms: Vec<Vector2<f64>> = both.iter().flatten().map(|(p, q)| q - p).collect();
    let first = *arms.first().filter(|_| arms.len() >= LEAST)?;
    let mean = arms.iter().map(|v| v.norm()).sum::<f64>() / arms.len() as f64;
    let scatter = (arms.iter().map(|v| (v.norm() - mean).powi(2)).sum::<f64>() / arms.len() as f64).sqrt();
    let turned = arms.iter().map(|v| first.perp(v).atan2(first.dot(v)).abs()).fold(0.0, f64::max);
    if scatter > RIGID_PX.max(RIGID_PART * mean) || turned < TURNED_RAD {
        return None;
    }
    let (p, q) = both.iter().flatten().next().copied()?;
    let link = link_of(vec![p, p + (q - p) * (mean / (q - p).norm())], FLOOR_PX);
    let poses = both
        .iter()
        .map(|both| {
            let (p, q) = (*both)?;
            let pair = |k: usize, place| Pair { local: link.template[k], place, sigma_px: FLOOR_PX };
            fit_pose(&[pair(0, p), pair(1, q)]).map(|f| f.pose)
        })
        .collect();
    Some(Found { link, poses })
}
