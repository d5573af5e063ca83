//! Finds the joints between bodies, orders the bodies from the pivot outwards, and names them.
//!
//! Owns: [`Found`], [`arrange`]. Must not: look for bodies.

use nalgebra::{Isometry2, Vector2};

use super::circle::Circle;
use crate::camera::Plane;
use crate::error::Result;
use crate::rig::{Body, Joint, Node, RIG_SCHEMA, Rig};
use crate::rigid::body::Link;
use crate::rigid::forecast::hung_at;
use crate::rigid::joint::{Shared, Turning};
use crate::rigid::pose::{place, pose_at};
use crate::stop::Stop;

/// A body and its pose in each frame of the sample.
#[derive(Debug, Clone)]
pub struct Found {
    /// Nodes in its own coordinates.
    pub link: Link,
    /// Pose per frame of the sample.
    pub poses: Vec<Option<Isometry2<f64>>>,
}

/// Two points agree on a joint within this, px, and this part of the body's reach.
const JOINT_PX: f64 = 1.0;
const JOINT_PART: f64 = 0.01;

/// A background before a moving camera has at least so many marks, over this part of the picture's shorter side; the camera's own
/// shake turns it by less than this and moves it by less than this part of its extent. A link of so many markers turns.
const BACKGROUND_NODES: usize = 12;
const BACKGROUND_PART: f64 = 0.5;
const BACKGROUND_TURN_RAD: f64 = 0.05;
const BACKGROUND_TRAVEL: f64 = 0.05;

/// Greatest scatter of a joint that closes a loop, px: no other evidence would show that it is none.
const LOOP_PX: f64 = 0.35;
/// Joints nearer together than this are one, px.
const ONE_POINT_PX: f64 = 3.0;

struct Held {
    /// Body, or `None` for the ground.
    on: Option<usize>,
    /// In the body's own coordinates.
    local: Vector2<f64>,
    /// In the coordinates of `on`.
    there: Vector2<f64>,
}

impl Found {
    /// Whether it is a single marker, whose poses have no angle yet.
    fn is_lone(&self) -> bool {
        self.link.nodes.len() == 1
    }

    /// Whether it is the picture's background before a camera that moves: a body of many marks that covers much of a picture
    /// whose shorter side is given, and neither turns nor goes anywhere.
    pub fn is_background(&self, shorter_px: f64) -> bool {
        let t = &self.link.template;
        let span = |k: usize| {
            let (low, high) = t.iter().fold((f64::MAX, f64::MIN), |(l, h), p| (l.min(p[k]), h.max(p[k])));
            high - low
        };
        let extent_px = span(0).max(span(1));
        if t.len() < BACKGROUND_NODES || extent_px < BACKGROUND_PART * shorter_px {
            return false;
        }
        let Some(first) = self.poses.iter().flatten().next() else { return false };
        let still = |p: &&Isometry2<f64>| {
            p.rotation.angle_to(&first.rotation).abs() < BACKGROUND_TURN_RAD
                && (p.translation.vector - first.translation.vector).norm() < BACKGROUND_TRAVEL * extent_px
        };
        let posed = self.poses.iter().flatten().count();
        10 * self.poses.iter().flatten().filter(still).count() >= 9 * posed
    }

    /// Its first node as body `on` sees it (`None` is the ground), in each frame in which both are known.
    fn seen_from<'a>(&'a self, on: Option<&'a Found>) -> impl Iterator<Item = (usize, Vector2<f64>)> + 'a {
        self.poses.iter().enumerate().filter_map(move |(f, pose)| {
            let here = place(pose.as_ref()?, self.link.template[0]);
            match on {
                None => Some((f, here)),
                Some(b) => Some((f, place(&b.poses[f]?.inverse(), here))),
            }
        })
    }

    /// The circle about a point of `on` on which a lone marker goes.
    pub fn circle(&self, on: Option<&Found>) -> Option<Circle> {
        Circle::through(&self.seen_from(on).map(|s| s.1).collect::<Vec<_>>())
    }

    /// Gives a lone marker that goes about `there` of `on` its angle in every frame, zero in the first; returns the
    /// joint in its own coordinates.
    fn turn_about(&mut self, on: Option<&Found>, there: Vector2<f64>) -> Vector2<f64> {
        let mut local: Option<Vector2<f64>> = None;
        for f in 0..self.poses.len() {
            let held = match on {
                None => Some(Isometry2::identity()),
                Some(b) => b.poses[f],
            };
            let (Some(pose), Some(held)) = (self.poses[f], held) else {
                self.poses[f] = None;
                continue;
            };
            let here = place(&pose, self.link.template[0]);
            let ray = place(&held, there) - here;
            let first = *local.get_or_insert(ray + self.link.template[0]);
            let arm = first - self.link.template[0];
            let angle = ray.y.atan2(ray.x) - arm.y.atan2(arm.x);
            self.poses[f] = Some(pose_at(angle, self.link.template[0], here));
        }
        local.unwrap_or_default()
    }
}

fn joint(a: &Found, b: Option<&Found>) -> Option<Turning> {
    if a.is_lone() {
        let c = a.circle(b)?;
        // Where it is on the marker's own link follows once it is hung.
        return Some(Turning {
            first: Vector2::zeros(),
            second: c.middle,
            rms_px: c.rms_px,
            sigma_px: c.rms_px,
        });
    }
    let mut sums = Shared::default();
    for (f, pose) in a.poses.iter().enumerate() {
        let Some(pose) = pose else { continue };
        match b {
            None => sums.add(pose, &Isometry2::identity()),
            Some(b) => {
                if let Some(other) = &b.poses[f] {
                    sums.add(pose, other);
                }
            }
        }
    }
    let t = sums.solve()?;
    let reach = a.link.reach_px(t.first).max(b.map_or(0.0, |b| b.link.reach_px(t.second)));
    (t.rms_px < JOINT_PX.max(JOINT_PART * reach)).then_some(t)
}

/// A rig, and which marker each of its nodes is: the body among those found, and the node of its link.
pub type Arranged = (Rig, Vec<(usize, usize)>);

/// The rig of the bodies: joints found, bodies ordered and named, nodes ordered along them, placed as in frame
/// `reference` of the sample and in recorded pixels, while those of the bodies are in the plane.
///
/// # Errors
/// [`crate::error::Error::Interrupted`] once `stop` was asked for.
#[expect(clippy::too_many_lines, reason = "joining, ordering, naming and placing, in order")]
pub fn arrange(
    found: &[Found],
    reference: usize,
    reference_frame: Option<u64>,
    image_px: [u32; 2],
    plane: &Plane,
    stop: &Stop,
) -> Result<Arranged> {
    let n = found.len();
    let mut found = found.to_vec();
    // What each body hangs on: the ground first, then bodies already hung.
    let mut held: Vec<Option<Held>> = (0..n).map(|_| None).collect();
    let mut order: Vec<usize> = Vec::new();
    let mut ground: Vec<(f64, usize, Turning)> =
        (0..n).filter_map(|b| joint(&found[b], None).map(|t| (t.rms_px, b, t))).collect();
    ground.sort_by(|a, b| a.0.total_cmp(&b.0));
    for (_, b, t) in ground {
        let local = if found[b].is_lone() { found[b].turn_about(None, t.second) } else { t.first };
        held[b] = Some(Held { on: None, local, there: t.second });
        order.push(b);
    }
    if order.is_empty() && n > 0 {
        // Nothing stays: the body with most nodes leads.
        let lead = (0..n).max_by_key(|&b| (found[b].link.nodes.len(), std::cmp::Reverse(b))).unwrap_or(0);
        order.push(lead);
    }
    loop {
        let mut best: Option<(f64, usize, usize, Turning)> = None;
        for b in (0..n).filter(|b| !order.contains(b)) {
            stop.heed()?;
            for &o in order.iter().filter(|&&o| held[o].is_some() || !found[o].is_lone()) {
                if let Some(t) = joint(&found[b], Some(&found[o]))
                    && best.as_ref().is_none_or(|x| t.rms_px < x.0)
                {
                    best = Some((t.rms_px, b, o, t));
                }
            }
        }
        match best {
            Some((_, b, o, t)) => {
                let on = found[o].clone();
                let local =
                    if found[b].is_lone() { found[b].turn_about(Some(&on), t.second) } else { t.first };
                held[b] = Some(Held { on: Some(o), local, there: t.second });
                order.push(b);
            }
            None => match (0..n).find(|b| !order.contains(b)) {
                Some(b) => order.push(b),
                None => break,
            },
        }
    }
    let hung = order.iter().filter(|&&b| held[b].is_some()).count();
    let names: Vec<String> = order
        .iter()
        .enumerate()
        .map(|(k, _)| match (n, hung, k) {
            (2, 2, 0) => "upper".into(),
            (2, 2, _) => "lower".into(),
            (_, h, _) if h == n => format!("link{}", k + 1),
            _ => format!("body{}", k + 1),
        })
        .collect();
    // A body that the reference picture does not show hangs there from its joint.
    let mut poses: Vec<Isometry2<f64>> = found.iter().map(|f| Isometry2::new(f.link.home, 0.0)).collect();
    for &b in &order {
        poses[b] = match (found[b].poses.get(reference).copied().flatten(), &held[b]) {
            (Some(pose), _) => pose,
            (None, Some(Held { on: Some(o), local, there })) => {
                hung_at(&poses[b], *local, place(&poses[*o], *there))
            }
            (None, Some(Held { on: None, local, there })) => hung_at(&poses[b], *local, *there),
            (None, None) => poses[b],
        };
    }
    let pose = |b: usize| poses[b];
    let mut rig = Rig {
        schema: RIG_SCHEMA,
        image_px,
        pixel_aspect: plane.pixel_aspect,
        reference_frame,
        region: None,
        lens: None,
        wanted: Default::default(),
        camera: None,
        bodies: names.iter().map(|name| Body { name: name.clone() }).collect(),
        nodes: Vec::new(),
        joints: Vec::new(),
    };
    let mut markers = Vec::new();
    for (k, &b) in order.iter().enumerate() {
        let link = &found[b].link;
        // Along the link: from its inner joint to what hangs on it, else to the middle of its nodes.
        let inner = held[b].as_ref().map(|h| h.local);
        let outer = (0..n).find_map(|o| held[o].as_ref().filter(|h| h.on == Some(b)).map(|h| h.there));
        let middle = link.template.iter().sum::<Vector2<f64>>() / link.nodes.len().max(1) as f64;
        let axis = match (inner, outer) {
            (Some(i), Some(o)) if (o - i).norm() > 1.0 => o - i,
            (Some(i), _) if (middle - i).norm() > 1.0 => middle - i,
            _ => longest(link),
        };
        let mut along: Vec<usize> = (0..link.template.len()).collect();
        along.sort_by(|&p, &q| axis.dot(&link.template[p]).total_cmp(&axis.dot(&link.template[q])));
        for q in along {
            let p = plane.to_recorded(place(&pose(b), link.template[q]));
            markers.push((b, q));
            rig.nodes.push(Node {
                name: format!("n{}", rig.nodes.len()),
                body: names[k].clone(),
                x_px: p.x,
                y_px: p.y,
            });
        }
    }
    let mut pivots = 0;
    for (k, &b) in order.iter().enumerate() {
        let Some(h) = &held[b] else { continue };
        let p = place(&pose(b), h.local);
        let (name, bodies, p) = match h.on {
            None => {
                pivots += 1;
                let name = if pivots == 1 { "pivot".into() } else { format!("pivot{pivots}") };
                (name, vec![names[k].clone()], h.there)
            }
            Some(o) => {
                let on = order.iter().position(|&x| x == o).unwrap_or(0);
                // Halfway between what both sides say.
                let p = (p + place(&pose(o), h.there)) / 2.0;
                let name = if hung == 2 { "elbow".into() } else { format!("joint{k}") };
                (name, vec![names[on].clone(), names[k].clone()], p)
            }
        };
        let p = plane.to_recorded(p);
        rig.joints.push(Joint { name, bodies, x_px: p.x, y_px: p.y });
    }
    for (a, b, t) in loops(&found, &held, stop)? {
        let ends = [a, b].map(|x| order.iter().position(|&o| o == x).unwrap_or(0));
        let there = (place(&pose(a), t.first) + place(&pose(b), t.second)) / 2.0;
        let p = plane.to_recorded(there);
        rig.joints.push(Joint {
            name: format!("joint{}", rig.joints.len()),
            bodies: ends.map(|k| names[k].clone()).to_vec(),
            x_px: p.x,
            y_px: p.y,
        });
    }
    Ok((rig, markers))
}

/// Points that two bodies share beside the joints on which they hang: where the chain closes.
fn loops(found: &[Found], held: &[Option<Held>], stop: &Stop) -> Result<Vec<(usize, usize, Turning)>> {
    let mut out = Vec::new();
    let hangs = |a: usize, b: usize| held[a].as_ref().is_some_and(|h| h.on == Some(b));
    for a in (0..found.len()).filter(|&a| !found[a].is_lone()) {
        for b in (a + 1..found.len()).filter(|&b| !found[b].is_lone() && !hangs(a, b) && !hangs(b, a)) {
            stop.heed()?;
            let Some(t) = joint(&found[a], Some(&found[b])).filter(|t| t.rms_px < LOOP_PX) else { continue };
            // Three bodies on one point have two joints.
            let own = held[a].iter().map(|h| h.local);
            let others = held.iter().flatten().filter(|h| h.on == Some(a)).map(|h| h.there);
            if own.chain(others).all(|p| (p - t.first).norm() > ONE_POINT_PX) {
                out.push((a, b, t));
            }
        }
    }
    Ok(out)
}

fn longest(link: &Link) -> Vector2<f64> {
    let mut best = Vector2::new(0.0, 1.0);
    let mut span = 0.0;
    for (i, a) in link.template.iter().enumerate() {
        for b in &link.template[i + 1..] {
            if (b - a).norm() > span {
                span = (b - a).norm();
                best = b - a;
            }
        }
    }
    if best.y < 0.0 { -best } else { best }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discover::bodies::link_of;

    /// A grid of 4 x 4 marks over 300 px, with a pose for each angle and shift.
    fn grid(poses: impl Iterator<Item = (f64, f64)>) -> Found {
        let points = (0..16).map(|k| Vector2::new(f64::from(k % 4) * 100.0, f64::from(k / 4) * 100.0));
        let poses = poses.map(|(angle, x)| Some(Isometry2::new(Vector2::new(300.0 + x, 200.0), angle)));
        Found { link: link_of(points.collect(), 0.1), poses: poses.collect() }
    }

    #[test]
    fn a_background_neither_turns_nor_goes_far_and_a_link_or_a_cart_does() {
        let wave = |size: f64| (0..50).map(move |k| size * (0.3 * f64::from(k)).sin());
        assert!(grid(wave(7.0).map(|x| (0.001 * x, x))).is_background(480.0));
        // A link of as many markers, a cart, and a body that is small in its picture.
        assert!(!grid(wave(0.3).map(|a| (a, 0.0))).is_background(480.0));
        assert!(!grid(wave(60.0).map(|x| (0.0, x))).is_background(480.0));
        assert!(!grid(wave(7.0).map(|x| (0.0, x))).is_background(1080.0));
    }
}
