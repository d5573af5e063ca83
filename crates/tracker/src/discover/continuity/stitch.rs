//! Joins bodies that are one: those that never turn against each other, and those that are never seen together.
//!
//! Owns: [`merge`], [`stitch`].

use std::f64::consts::{PI, TAU};

use nalgebra::{Isometry2, Vector2};

use super::body::TrackletBody;
use super::evidence::Evidence;
use crate::rigid::joint::Turning;
use crate::rigid::pose::{Pair, fit_pose, place};

/// Frames in which both are posed, and how far both turned in them, rad, for a verdict that they turn as one.
const TOGETHER_FRAMES: usize = 40;
const TURNED_RAD: f64 = 0.3;
/// Greatest turn of two bodies against each other that are one, rad.
const AS_ONE_RAD: f64 = 0.03;
/// Greatest wandering of a marker of one in the other, px.
const WANDERS_PX: f64 = 0.5;
/// Bodies that are posed in more frames together are two.
const NEVER_FRAMES: usize = 3;
/// Markers and joints of two pieces agree within this, px.
const AGREE_PX: f64 = 0.8;
/// Frames over which a turn is carried on, those of the tail it is carried on from, and how far off it may be, rad.
const CARRIED_FRAMES: usize = 60;
const TAIL: usize = 12;
const CARRIED_RAD: f64 = 0.7;
/// A second way to lay one on the other is ruled out if it is farther off by this factor and angle.
const CLEAR_TIMES: f64 = 2.0;
const CLEAR_RAD: f64 = 0.3;
/// Agreement of the poses on a joint, px, and in standard uncertainties.
const JOINT_PX: f64 = 0.3;
const JOINT_SIGMA: f64 = 8.0;
/// Misfit of the best fixed point of a body that has none, px.
const WANDERING_PX: f64 = 5.0;

/// Makes one of two bodies that turn as one. Whether it did.
pub(super) fn merge(evidence: &Evidence<'_>, bodies: &mut Vec<TrackletBody>) -> bool {
    for i in 0..bodies.len() {
        for j in 0..bodies.len() {
            if i == j || bodies[j].markers.len() > bodies[i].markers.len() || !as_one(&bodies[i], &bodies[j])
            {
                continue;
            }
            let from = bodies[j].clone();
            let mut markers = bodies[i].markers.clone();
            let both: Vec<usize> = (0..from.poses.len())
                .filter(|&k| bodies[i].poses[k].is_some() && from.poses[k].is_some())
                .collect();
            for (q, tracklets) in from.markers.into_iter().enumerate() {
                let places: Vec<Vector2<f64>> = both
                    .iter()
                    .filter_map(|&k| {
                        let there = place(&from.poses[k]?, from.shape[q]);
                        Some(place(&bodies[i].poses[k]?.inverse(), there))
                    })
                    .collect();
                let at = crate::discover::median::middle(&places);
                let same = (0..markers.len()).find(|&m| {
                    m < bodies[i].shape.len()
                        && (bodies[i].shape[m] - at).norm() < AGREE_PX
                        && tracklets.iter().all(|&t| bodies[i].free(evidence, m, t))
                });
                match same {
                    Some(m) => markers[m].extend(tracklets),
                    None => markers.push(tracklets),
                }
            }
            bodies[i] = TrackletBody::fit(evidence, markers);
            bodies.remove(j);
            return true;
        }
    }
    false
}

fn as_one(a: &TrackletBody, b: &TrackletBody) -> bool {
    let both: Vec<(Isometry2<f64>, Isometry2<f64>)> =
        a.poses.iter().zip(&b.poses).filter_map(|(a, b)| Some(((*a)?, (*b)?))).collect();
    if both.len() < TOGETHER_FRAMES {
        return false;
    }
    let spread = |angles: &mut dyn Iterator<Item = f64>| {
        let (mut last, mut sum, mut low, mut high) = (None, 0.0, 0.0_f64, 0.0_f64);
        for a in angles {
            sum += last.map_or(0.0, |l: f64| turned(a - l));
            last = Some(a);
            low = low.min(sum);
            high = high.max(sum);
        }
        high - low
    };
    let against = spread(&mut both.iter().map(|(a, b)| a.rotation.angle() - b.rotation.angle()));
    let turns = spread(&mut both.iter().map(|(a, _)| a.rotation.angle()));
    if against > AS_ONE_RAD || turns < TURNED_RAD {
        return false;
    }
    b.shape.iter().all(|&t| {
        let seen: Vec<Vector2<f64>> = both.iter().map(|(a, b)| place(&a.inverse(), place(b, t))).collect();
        let middle = crate::discover::median::middle(&seen);
        let mut off: Vec<f64> = seen.iter().map(|p| (p - middle).norm()).collect();
        off.sort_by(f64::total_cmp);
        off[off.len() * 95 / 100] < WANDERS_PX
    })
}

/// The nearest turn to none, rad.
fn turned(angle: f64) -> f64 {
    (angle + PI).rem_euclid(TAU) - PI
}

/// A way to lay the pieces of `from` on `to`.
struct Fitting {
    to: usize,
    from: usize,
    /// For each marker of `from` that of `to`; `None` is a new one.
    markers: Vec<Option<usize>>,
    off_px: f64,
    /// Joints with the same third body that agree.
    common: usize,
}

/// Makes one of the two pieces of a body that agree best, of those never seen together. Whether it did.
pub(super) fn stitch(evidence: &Evidence<'_>, bodies: &mut Vec<TrackletBody>) -> bool {
    let joints = joints(evidence, bodies);
    // Two bodies that are seen at the same time, or of which one alone turns about a point of the ground.
    let different = |a: usize, b: usize| {
        let both = bodies[a].poses.iter().zip(&bodies[b].poses).filter(|(a, b)| a.is_some() && b.is_some());
        both.count() > NEVER_FRAMES || clash(&joints, bodies, a, b)
    };
    let mut all: Vec<Fitting> = Vec::new();
    for to in 0..bodies.len() {
        for from in 0..bodies.len() {
            let key = |b: usize| (bodies[b].markers.len(), std::cmp::Reverse(b));
            if to != from && key(to) > key(from) && !different(to, from) {
                all.extend(fitting(evidence, bodies, &joints, to, from));
            }
        }
    }
    // A piece that may be of either of two bodies is that one's with which it has a joint in common, if the other has none.
    let open = |f: &Fitting| {
        all.iter().filter(|o| o.common >= f.common.min(1)).any(|o| {
            [(f.to, f.from), (f.from, f.to)].into_iter().any(|(shared, own)| {
                let rival = if o.to == shared { o.from } else { o.to };
                (o.to == shared || o.from == shared) && rival != own && different(own, rival)
            })
        })
    };
    let best = all.iter().filter(|f| !open(f)).min_by(|x, y| x.off_px.total_cmp(&y.off_px));
    let Some(f) = best else { return false };
    let (to, from) = (f.to, f.from);
    let mut markers = bodies[to].markers.clone();
    for (tracklets, q) in bodies[from].markers.clone().into_iter().zip(f.markers.clone()) {
        match q {
            Some(q) => markers[q].extend(tracklets),
            None => markers.push(tracklets),
        }
    }
    bodies[to] = TrackletBody::fit(evidence, markers);
    bodies.remove(from);
    true
}

/// Whether one of two turns about a point of the ground and the other surely about none.
fn clash(
    joints: &[Vec<(Option<usize>, Turning)>],
    bodies: &[TrackletBody],
    one: usize,
    other: usize,
) -> bool {
    let grounded = |b: usize| joints[b].iter().any(|(o, _)| o.is_none());
    let wanders = |b: usize| bodies[b].joint(None).is_some_and(|t| t.rms_px > WANDERING_PX);
    grounded(one) && wanders(other) || grounded(other) && wanders(one)
}

/// The joints of each body: with which other (`None` is the ground), and where.
fn joints(evidence: &Evidence<'_>, bodies: &[TrackletBody]) -> Vec<Vec<(Option<usize>, Turning)>> {
    let limit = JOINT_PX.max(JOINT_SIGMA * evidence.sigma_px);
    (0..bodies.len())
        .map(|b| {
            std::iter::once(None)
                .chain((0..bodies.len()).filter(|&o| o != b).map(Some))
                .filter_map(|o| Some((o, bodies[b].joint(o.map(|o| &bodies[o]))?)))
                .filter(|(_, t)| t.rms_px < limit)
                .collect()
        })
        .collect()
}

/// The one way to lay `from` on `to`, if there is one.
fn fitting(
    evidence: &Evidence<'_>,
    bodies: &[TrackletBody],
    joints: &[Vec<(Option<usize>, Turning)>],
    to: usize,
    from: usize,
) -> Option<Fitting> {
    let (a, b) = (&bodies[to], &bodies[from]);
    let mut common: Vec<(Vector2<f64>, Vector2<f64>)> = Vec::new();
    for (o, t) in &joints[to] {
        for (p, s) in &joints[from] {
            if o == p && (t.second - s.second).norm() < AGREE_PX {
                common.push((t.first, s.first));
            }
        }
    }
    let mut ways: Vec<(f64, Vec<Option<usize>>, Isometry2<f64>)> = Vec::new();
    for pose in layings(a, b, &common) {
        let markers: Vec<Option<usize>> = b
            .shape
            .iter()
            .map(|&t| {
                let at = place(&pose, t);
                (0..a.shape.len()).find(|&q| (a.shape[q] - at).norm() < AGREE_PX)
            })
            .collect();
        let matched = markers.iter().flatten().count();
        let alike = matched == b.shape.len() || matched >= 3;
        let once = markers.iter().flatten().all(|q| markers.iter().filter(|m| **m == Some(*q)).count() == 1);
        let apart = markers
            .iter()
            .zip(&b.markers)
            .all(|(q, tracklets)| q.is_none_or(|q| tracklets.iter().all(|&t| a.free(evidence, q, t))));
        let held = common.iter().all(|(u, w)| (place(&pose, *w) - u).norm() < 1.5 * AGREE_PX);
        if !alike || !once || !apart || !held || ways.iter().any(|w| w.1 == markers) {
            continue;
        }
        let off = markers
            .iter()
            .zip(&b.shape)
            .filter_map(|(q, &t)| Some((a.shape[(*q)?] - place(&pose, t)).norm()));
        let off_px = off.fold(0.0, f64::max);
        ways.push((off_px, markers, pose));
    }
    let strong = b.shape.len() + common.len() >= 3;
    // How far each way is from where the turn before the gap leads.
    let carried: Vec<Option<f64>> = ways.iter().map(|w| carried_off(evidence, a, b, &w.2)).collect();
    let mut order: Vec<usize> = (0..ways.len()).collect();
    order.sort_by(|&x, &y| {
        let key = |k: usize| carried[k].unwrap_or(f64::INFINITY);
        key(x).total_cmp(&key(y))
    });
    let &first = order.first()?;
    let clear = match order.get(1) {
        None => strong || carried[first].is_some_and(|c| c < CARRIED_RAD),
        Some(&second) => match (carried[first], carried[second]) {
            (Some(c), Some(d)) => c < CARRIED_RAD && d > CLEAR_TIMES * c + CLEAR_RAD,
            _ => false,
        },
    };
    let (off_px, markers, _) = ways.swap_remove(first);
    clear.then_some(Fitting { to, from, markers, off_px, common: common.len() })
}

/// Poses of `b` in `a` in which its farthest two points, markers or common joints, are on two points of the same kind.
fn layings(
    a: &TrackletBody,
    b: &TrackletBody,
    common: &[(Vector2<f64>, Vector2<f64>)],
) -> Vec<Isometry2<f64>> {
    let n = b.shape.len();
    let mut far: Option<(f64, usize, usize)> = None;
    for i in 0..n {
        for j in i + 1..n {
            let d = (b.shape[i] - b.shape[j]).norm();
            if far.is_none_or(|f| d > f.0) {
                far = Some((d, i, j));
            }
        }
    }
    let Some((d, i, j)) = far else { return Vec::new() };
    let mut out = Vec::new();
    let lay = |pairs: &[(Vector2<f64>, Vector2<f64>)]| {
        let pairs: Vec<Pair> =
            pairs.iter().map(|&(local, place)| Pair { local, place, sigma_px: 1.0 }).collect();
        fit_pose(&pairs).map(|f| f.pose)
    };
    for p in 0..a.shape.len() {
        for q in 0..a.shape.len() {
            if p == q || ((a.shape[p] - a.shape[q]).norm() - d).abs() > AGREE_PX {
                continue;
            }
            let mut pairs = vec![(b.shape[i], a.shape[p]), (b.shape[j], a.shape[q])];
            pairs.extend(common.iter().map(|&(u, w)| (w, u)));
            out.extend(lay(&pairs));
        }
    }
    out
}

/// By how much the turn of `a`, carried on over the gap, misses that of `b` laid on it by `pose`, rad.
fn carried_off(
    evidence: &Evidence<'_>,
    a: &TrackletBody,
    b: &TrackletBody,
    pose: &Isometry2<f64>,
) -> Option<f64> {
    let posed = |x: &TrackletBody| (0..x.poses.len()).filter(|&k| x.poses[k].is_some()).collect::<Vec<_>>();
    let (of_a, of_b) = (posed(a), posed(b));
    let frame = |k: usize| evidence.frames[k] as f64;
    // The shortest gap between a frame of the one and a frame of the other.
    let mut gap: Option<(f64, usize, usize)> = None;
    for &x in &of_a {
        let at = of_b.partition_point(|&y| y < x);
        for y in [at.checked_sub(1).map(|i| of_b[i]), of_b.get(at).copied()].into_iter().flatten() {
            let d = (frame(x) - frame(y)).abs();
            if gap.is_none_or(|g| d < g.0) {
                gap = Some((d, x, y));
            }
        }
    }
    let (length, x, y) = gap.filter(|g| g.0 <= CARRIED_FRAMES as f64)?;
    let tail: Vec<usize> = if y > x {
        of_a.iter().rev().filter(|&&k| k <= x).take(TAIL).copied().collect()
    } else {
        of_a.iter().filter(|&&k| k >= x).take(TAIL).copied().collect()
    };
    let near: Vec<usize> =
        tail.into_iter().filter(|&k| (frame(k) - frame(x)).abs() <= 2.0 * TAIL as f64 + length).collect();
    let mut angle = 0.0;
    let mut last = None;
    let points: Vec<(f64, f64)> = near
        .iter()
        .filter_map(|&k| {
            let now = a.poses[k]?.rotation.angle();
            angle += last.map_or(now, |l: f64| turned(now - l));
            last = Some(now);
            Some((frame(k) - frame(y), angle))
        })
        .collect();
    let there = line_at_zero(&points)?;
    // Where b would have a, laid on it.
    let said = (b.poses[y]? * pose.inverse()).rotation.angle();
    Some(turned(said - there).abs())
}

/// The straight line, or the parabola through six points or more, at 0.
fn line_at_zero(points: &[(f64, f64)]) -> Option<f64> {
    let degree = match points.len() {
        0 => return None,
        1 | 2 => 0,
        3..=5 => 1,
        _ => 2,
    };
    let scale = points.iter().map(|p| p.0.abs()).fold(1.0, f64::max);
    let mut normal = nalgebra::Matrix3::zeros();
    let mut right = nalgebra::Vector3::zeros();
    for &(t, v) in points {
        let t = t / scale;
        let row = nalgebra::Vector3::new(
            1.0,
            if degree > 0 { t } else { 0.0 },
            if degree > 1 { t * t } else { 0.0 },
        );
        normal += row * row.transpose();
        right += row * v;
    }
    for k in degree + 1..3 {
        normal[(k, k)] = 1.0;
    }
    Some(normal.cholesky()?.solve(&right)[0])
}
