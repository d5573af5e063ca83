//! Finds rigid bodies by the constancy of distances over the whole recording.
//!
//! Owns: [`find_bodies`], [`poses`]. Must not: link frames by nearness: a marker may go any way between two of
//! them, only distances count.
//!
//! Between two frames every rigid motion that takes three or more detections to detections is a body, or
//! several bodies that happen to stand alike. Over many frames only bodies stay together.

use nalgebra::{Isometry2, Vector2};
use rayon::prelude::*;

use super::median::middle;
use super::sample::Sample;
use crate::detect::{Detection, Flags};
use crate::error::Result;
use crate::rigid::body::Link;
use crate::rigid::hypothesis::PoseHypothesis;
use crate::rigid::index::DetectionIndex;
use crate::rigid::pose::place;
use crate::rigid::search::Search;
use crate::rigid::work::{MOST_OF_FRAME, Work};
use crate::stop::Stop;

/// Frames from which bodies are sought.
const BASES: usize = 16;
/// Frames with which each is compared.
const COMPARED: usize = 120;
/// Deviations, in standard uncertainties, up to which a distance is the same.
const REACH_SIGMA: f64 = 4.5;
/// Unmodelled scatter of a centre, px (codec, lens, bending).
pub const FLOOR_PX: f64 = 0.06;
/// Pairs of detections from which motions are sought.
const PAIRS: usize = 250;
/// Work of comparing a base with a frame, and of finding the poses of all bodies in a frame.
const GROUPS_WORK: u64 = 100_000;
const POSES_WORK: u64 = 200_000;
/// Detections of a frame beyond which it is no base: it is full of glints.
const CROWD: usize = 120;

fn at(d: &Detection) -> Vector2<f64> {
    Vector2::new(d.x_px, d.y_px)
}

/// A body of points in its own coordinates.
pub fn link_of(points: Vec<Vector2<f64>>, slack_px: f64) -> Link {
    let home = points.iter().sum::<Vector2<f64>>() / points.len().max(1) as f64;
    Link {
        nodes: (0..points.len()).collect(),
        slack_px: vec![slack_px; points.len()],
        whole_px: vec![0.0; points.len()],
        area_px: vec![(0.0, 0.0); points.len()],
        template: points.iter().map(|p| p - home).collect(),
        home,
        excess_px: 0.0,
    }
}

/// Hypotheses of a free body in a frame, best first.
pub fn hypotheses(
    link: &Link,
    index: &DetectionIndex<'_>,
    free: &[bool],
    pairs: usize,
    work: &Work,
) -> Vec<PoseHypothesis> {
    let search = Search {
        link,
        anchors: &[],
        index,
        free,
        window: None,
        reach_sigma: REACH_SIGMA,
        floor_px: FLOOR_PX,
        pairs,
        work,
    };
    search.run().hypotheses
}

/// Pose of each body in each frame of the sample, where at least three of its nodes are seen and no other pose
/// explains as many; with the detections that are its nodes.
pub fn poses(links: &[Link], frame: &[Detection]) -> Vec<Option<PoseHypothesis>> {
    let index = DetectionIndex::new(frame);
    let mut free = vec![true; index.len()];
    let mut out = vec![None; links.len()];
    let mut order: Vec<usize> = (0..links.len()).collect();
    order.sort_by_key(|&b| std::cmp::Reverse(links[b].nodes.len()));
    let work = Work::of(POSES_WORK);
    for b in order {
        let mut found = hypotheses(&links[b], &index, &free, 60, &work).into_iter();
        let Some(best) = found.next().filter(|s| s.inliers >= 3) else { continue };
        let rival = found.take_while(|s| s.inliers + 1 >= best.inliers.max(4)).any(|s| {
            links[b].template.iter().any(|&t| (place(&s.fit.pose, t) - place(&best.fit.pose, t)).norm() > 2.0)
        });
        if rival {
            continue;
        }
        for d in best.picks.iter().flatten() {
            free[*d] = false;
        }
        out[b] = Some(best);
    }
    out
}

/// Two bodies of which one has all markers of the other at the same distances.
///
/// # Errors
/// [`crate::error::Error::Interrupted`] once `stop` was asked for.
pub fn alike(links: &[Link], stop: &Stop) -> Result<Option<(usize, usize)>> {
    let work = Work::of(MOST_OF_FRAME);
    for a in 0..links.len() {
        for b in (0..links.len()).filter(|&b| b != a && links[b].nodes.len() >= links[a].nodes.len()) {
            stop.heed()?;
            let point = |p: &Vector2<f64>| Detection { x_px: p.x, y_px: p.y, ..Default::default() };
            let points: Vec<Detection> = links[b].template.iter().map(point).collect();
            let found =
                hypotheses(&links[a], &DetectionIndex::new(&points), &vec![true; points.len()], PAIRS, &work);
            if found.first().is_some_and(|s| s.inliers == links[a].nodes.len()) {
                return Ok(Some((a, b)));
            }
        }
    }
    Ok(None)
}

/// Groups of points of one frame that keep their distances: for each body its points, px.
fn groups(base: &[Detection], others: &[&[Detection]], stop: &Stop) -> Result<Vec<Vec<Vector2<f64>>>> {
    let n = base.len();
    let link = link_of(base.iter().map(at).collect(), FLOOR_PX);
    let mut together = vec![0_u32; n * n];
    let mut both = vec![0_u32; n * n];
    let mut seen = vec![0_u32; n];
    for other in others {
        stop.heed()?;
        let index = DetectionIndex::new(other);
        let work = Work::of(GROUPS_WORK);
        let mut used_b = vec![false; other.len()];
        let mut motion: Vec<Option<usize>> = vec![None; n];
        let found = hypotheses(&link, &index, &vec![true; other.len()], PAIRS, &work);
        for (m, s) in found.iter().enumerate() {
            let fresh: Vec<(usize, usize)> = s
                .picks
                .iter()
                .enumerate()
                .filter_map(|(i, d)| d.map(|d| (i, d)))
                .filter(|&(i, d)| motion[i].is_none() && !used_b[d])
                .collect();
            if s.inliers < 3 {
                break;
            }
            if fresh.len() < 3 {
                continue;
            }
            for (i, d) in fresh {
                motion[i] = Some(m);
                used_b[d] = true;
            }
        }
        for i in 0..n {
            let Some(mi) = motion[i] else { continue };
            seen[i] += 1;
            for j in 0..n {
                if let Some(mj) = motion[j] {
                    both[i * n + j] += 1;
                    together[i * n + j] += u32::from(mi == mj);
                }
            }
        }
    }
    let least = (others.len() as u32 / 10).max(4);
    let mut taken: Vec<bool> = seen.iter().map(|&s| s < least).collect();
    let mut out = Vec::new();
    for i in 0..n {
        if taken[i] {
            continue;
        }
        let members: Vec<usize> = (0..n)
            .filter(|&j| !taken[j] && both[i * n + j] >= 3 && 2 * together[i * n + j] > both[i * n + j])
            .collect();
        if members.len() >= 3 {
            for &j in &members {
                taken[j] = true;
            }
            out.push(members.iter().map(|&j| at(&base[j])).collect());
        }
    }
    Ok(out)
}

/// The bodies of three or more nodes, each in its own coordinates.
///
/// # Errors
/// [`crate::error::Error::Interrupted`] once `stop` was asked for.
pub fn find_bodies(sample: &Sample, stop: &Stop) -> Result<Vec<Link>> {
    let m = sample.frames.len();
    // Bases: the frames with most detections that are not a crowd of glints, spread over the recording.
    let mut counts: Vec<usize> = sample.moving.iter().map(Vec::len).collect();
    counts.sort_unstable();
    let Some(&usual) = counts.get(m / 2) else { return Ok(Vec::new()) };
    let mut bases: Vec<usize> = (0..m)
        .filter(|&f| sample.moving[f].len() >= usual.max(3) && sample.moving[f].len() <= CROWD)
        .collect();
    if bases.len() > BASES {
        bases = (0..BASES).map(|k| bases[k * bases.len() / BASES]).collect();
    }
    let compared: Vec<&[Detection]> = (0..m.min(COMPARED))
        .map(|k| sample.moving[k * m / m.min(COMPARED)].as_slice())
        .filter(|d| d.len() >= 3)
        .collect();
    let mut best: Vec<Vec<Vector2<f64>>> = Vec::new();
    let all: Vec<_> =
        bases.par_iter().map(|&f| groups(&sample.moving[f], &compared, stop)).collect::<Result<_>>()?;
    for found in all {
        let size = |g: &[Vec<Vector2<f64>>]| g.iter().map(Vec::len).sum::<usize>();
        // More nodes; for as many the more bodies: two that stood alike are not one.
        if (size(&found), found.len()) > (size(&best), best.len()) {
            best = found;
        }
    }
    let mut links: Vec<Link> = best.into_iter().map(|p| link_of(p, FLOOR_PX)).collect();
    // Two equal bodies are never told apart, so nothing can be added to them.
    if alike(&links, stop)?.is_none_or(|(a, b)| links[a].nodes.len() != links[b].nodes.len()) {
        complete(&mut links, sample, stop)?;
    }
    Ok(links)
}

/// Whether a detection is the whole of one marker, as far as its picture tells.
pub fn looks_whole(d: &Detection) -> bool {
    !d.flags.has(Flags::MERGED | Flags::PARTIAL | Flags::BORDER)
}

/// Adds to each body the points that stay with it in several frames, and drops nodes that are never seen.
fn complete(links: &mut Vec<Link>, sample: &Sample, stop: &Stop) -> Result<()> {
    let mut areas: Vec<f32> = sample.moving.iter().flatten().map(|d| d.area_px).collect();
    areas.sort_by(f32::total_cmp);
    let usual = areas.get(areas.len() / 2).copied().unwrap_or(0.0);
    let apart_px = (1.3 * (f64::from(usual) / std::f64::consts::PI).sqrt()).max(3.0);
    for _ in 0..4 {
        let mut local: Vec<Vec<Vec<Vector2<f64>>>> =
            links.iter().map(|l| vec![Vec::new(); l.nodes.len()]).collect();
        let mut spare: Vec<Vec<(usize, Vector2<f64>)>> = vec![Vec::new(); links.len()];
        let mut known = vec![0_usize; links.len()];
        let posed: Vec<_> = sample
            .moving
            .par_iter()
            .map(|frame| stop.heed().map(|()| poses(links, frame)))
            .collect::<Result<_>>()?;
        for (f, (frame, found)) in sample.moving.iter().zip(posed).enumerate() {
            let mut used = vec![false; frame.len()];
            for s in found.iter().flatten() {
                for d in s.picks.iter().flatten() {
                    used[*d] = true;
                }
            }
            for (b, s) in found.iter().enumerate() {
                let Some(s) = s else { continue };
                known[b] += 1;
                let back: Isometry2<f64> = s.fit.pose.inverse();
                for (j, d) in s.picks.iter().enumerate() {
                    if let Some(d) = d {
                        local[b][j].push(place(&back, at(&frame[*d])));
                    }
                }
                for (d, used) in used.iter().enumerate() {
                    if !used && looks_whole(&frame[d]) {
                        spare[b].push((f, place(&back, at(&frame[d]))));
                    }
                }
            }
        }
        let mut changed = false;
        for (b, link) in links.iter_mut().enumerate() {
            stop.heed()?;
            let mut points: Vec<Vector2<f64>> = Vec::new();
            for seen in &local[b] {
                if seen.len() * 50 >= known[b] && seen.len() >= 3 {
                    points.push(middle(seen));
                } else {
                    changed = true;
                }
            }
            let before = points.len();
            // A node of another body comes again to the same place where both turn back at once, for a few frames.
            let least = (known[b] / 10).max(6);
            for p in crowds(&spare[b], least) {
                // The rest of a half hidden marker, within a radius of its centre, is no marker of its own.
                if points.iter().all(|q| (p - q).norm() > apart_px) {
                    points.push(p);
                }
            }
            changed |= points.len() != before;
            *link = link_of(points, FLOOR_PX);
        }
        links.retain(|l| l.nodes.len() >= 3);
        if !changed {
            break;
        }
    }
    Ok(())
}

/// Places to which points of at least `least` frames come.
fn crowds(points: &[(usize, Vector2<f64>)], least: usize) -> Vec<Vector2<f64>> {
    const NEAR_PX: f64 = 0.8;
    let stars: Vec<Detection> =
        points.iter().map(|p| Detection { x_px: p.1.x, y_px: p.1.y, ..Default::default() }).collect();
    let index = DetectionIndex::new(&stars);
    let mut near = Vec::new();
    let mut taken = vec![false; points.len()];
    let mut out = Vec::new();
    // Strided seeds: a crowd of many frames is met by one of them.
    let step = (points.len() / 3000).max(1);
    for k in (0..points.len()).step_by(step) {
        if taken[k] {
            continue;
        }
        index.within(points[k].1, NEAR_PX, &mut near);
        let mut frames: Vec<usize> = near.iter().map(|&i| points[i].0).collect();
        frames.dedup();
        if frames.len() >= least {
            let centre = middle(&near.iter().map(|&i| points[i].1).collect::<Vec<_>>());
            index.within(centre, 4.0 * NEAR_PX, &mut near);
            for &i in &near {
                taken[i] = true;
            }
            out.push(centre);
        }
    }
    out
}
