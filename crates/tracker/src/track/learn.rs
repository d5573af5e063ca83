//! What a recording says of a rig before its markers are named for good: templates, joints, unrest, clutter.
//!
//! Owns: [`Lessons`]. Must not: name markers in the output.

use nalgebra::{Isometry2, Vector2};

use super::joints::Shared;
use super::mechanism::{Holder, Mechanism};
use super::nearest::Sky;
use super::rigid::place;
use super::tracker::{BodySeen, Habits};

/// Samples kept of each node; beyond, every second one is dropped and only every second taken.
const SAMPLES: usize = 1024;
/// What stays within this stands still, px.
const SAME_PLACE_PX: f64 = 3.0;
/// Places of left-over detections kept.
const PLACES: usize = 256;
/// Nothing is known better than this, px: what a template cannot say of a real body (lens, bending).
const LEAST_SLACK_PX: f64 = 0.02;

/// Seen places of one node in its body's coordinates.
#[derive(Debug, Clone, Default)]
struct Samples {
    at: Vec<(Vector2<f64>, f64, f64)>,
    every: usize,
    count: usize,
}

impl Samples {
    fn add(&mut self, local: Vector2<f64>, sigma_px: f64, area_px: f64) {
        self.every = self.every.max(1);
        if self.count.is_multiple_of(self.every) {
            if self.at.len() == SAMPLES {
                let mut keep = 0;
                self.at.retain(|_| {
                    keep += 1;
                    keep % 2 == 1
                });
                self.every *= 2;
            }
            self.at.push((local, sigma_px, area_px));
        }
        self.count += 1;
    }
}

fn median(values: &mut [f64]) -> Option<f64> {
    let n = values.len();
    (n > 0).then(|| *values.select_nth_unstable_by(n / 2, f64::total_cmp).1)
}

/// What the frames seen so far say.
#[derive(Debug, Clone)]
pub struct Lessons {
    /// For each body and node.
    nodes: Vec<Vec<Samples>>,
    /// For each joint.
    joints: Vec<Shared>,
    frames: usize,
    left_over: usize,
    /// Places of what is left over, and in how many frames.
    places: Vec<(Vector2<f64>, usize)>,
}

impl Lessons {
    /// Nothing seen yet.
    pub fn new(mechanism: &Mechanism) -> Self {
        let joints = mechanism.hinges.iter().map(|h| h.joint + 1).max().unwrap_or(0);
        Self {
            nodes: mechanism.links.iter().map(|l| vec![Samples::default(); l.nodes.len()]).collect(),
            joints: vec![Shared::default(); joints],
            frames: 0,
            left_over: 0,
            places: Vec::new(),
        }
    }

    /// Takes in one frame.
    pub fn add(&mut self, mechanism: &Mechanism, seen: &[BodySeen], sky: &Sky<'_>) {
        let firm = |s: &BodySeen| {
            s.fit
                .as_ref()
                .filter(|_| s.picks.iter().flatten().count() >= 3.min(s.picks.len()))
                .map(|f| f.pose)
        };
        let mut used = 0;
        for (s, samples) in seen.iter().zip(&mut self.nodes) {
            used += s.picks.iter().flatten().count();
            let Some(pose) = firm(s) else { continue };
            for (pick, sample) in s.picks.iter().zip(samples) {
                if let Some(d) = *pick
                    && sky.whole(d)
                {
                    let local = place(&pose.inverse(), sky.place(d));
                    sample.add(local, f64::from(sky.get(d).sigma_px), f64::from(sky.get(d).area_px));
                }
            }
        }
        for h in &mechanism.hinges {
            let Some(pose) = firm(&seen[h.body]) else { continue };
            match h.holder {
                Holder::Ground(_) => self.joints[h.joint].add(&pose, &Isometry2::identity()),
                // Both sides are in the list: each joint once.
                Holder::Body(o, _) if h.body < o => {
                    if let Some(other) = firm(&seen[o]) {
                        self.joints[h.joint].add(&pose, &other);
                    }
                }
                Holder::Body(..) => {}
            }
        }
        let mut node = vec![false; sky.len()];
        for d in seen.iter().flat_map(BodySeen::detections) {
            node[d] = true;
        }
        for d in (0..sky.len()).filter(|&d| !node[d]) {
            let at = sky.place(d);
            match self.places.iter().position(|p| (p.0 - at).norm() < SAME_PLACE_PX) {
                Some(k) => self.places[k].1 += 1,
                None if self.places.len() < PLACES => self.places.push((at, 1)),
                None => {}
            }
        }
        self.frames += 1;
        self.left_over += sky.len().saturating_sub(used);
    }

    /// The mechanism and habits as the frames say; what they do not say stays.
    pub fn apply(&self, mechanism: &mut Mechanism, habits: &mut Habits) {
        for (link, samples) in mechanism.links.iter_mut().zip(&self.nodes) {
            for (j, s) in samples.iter().enumerate() {
                let mut x: Vec<f64> = s.at.iter().map(|p| p.0.x).collect();
                let mut y: Vec<f64> = s.at.iter().map(|p| p.0.y).collect();
                // Medians: half hidden markers pull to one side.
                let (Some(x), Some(y)) = (median(&mut x), median(&mut y)) else { continue };
                if s.at.len() < 20 {
                    continue;
                }
                let centre = Vector2::new(x, y);
                let mut square: Vec<f64> = s.at.iter().map(|p| (p.0 - centre).norm_squared()).collect();
                let mut own: Vec<f64> = s.at.iter().map(|p| p.1 * p.1).collect();
                // The median of a Rayleigh square is 2 ln 2 of the variance of one coordinate.
                let scatter = median(&mut square).unwrap_or(0.0) / (2.0 * std::f64::consts::LN_2);
                let explained = median(&mut own).unwrap_or(0.0);
                // Areas change with blur and noise, so the limit is below what is usual by four times their scatter.
                let mut area: Vec<f64> = s.at.iter().map(|p| p.2).collect();
                let usual = median(&mut area).unwrap_or(0.0);
                let mut off: Vec<f64> = area.iter().map(|a| (a - usual).abs()).collect();
                let scatter_px = 1.48 * median(&mut off).unwrap_or(0.0);
                link.whole_px[j] = (usual - (4.0 * scatter_px).max(0.08 * usual)).max(0.0) as f32;
                link.area_px[j] = (usual, scatter_px);
                link.template[j] = centre;
                link.slack_px[j] = (scatter - explained).max(0.0).sqrt().max(LEAST_SLACK_PX);
            }
        }
        for h in &mut mechanism.hinges {
            let Some(t) = self.joints.get(h.joint).and_then(Shared::solve) else { continue };
            let sigma_px = t.rms_px.hypot(t.sigma_px).max(LEAST_SLACK_PX);
            match &mut h.holder {
                Holder::Ground(p) => {
                    h.local = t.first;
                    *p = t.second;
                }
                Holder::Body(o, there) => {
                    (h.local, *there) = if h.body < *o { (t.first, t.second) } else { (t.second, t.first) };
                }
            }
            h.sigma_px = sigma_px;
        }
        if self.frames >= 20 {
            let standing: Vec<&(Vector2<f64>, usize)> =
                self.places.iter().filter(|p| 3 * p.1 >= self.frames).collect();
            let still: usize = standing.iter().map(|p| p.1).sum();
            habits.standing = standing.iter().map(|p| p.0).collect();
            let moving = self.left_over.saturating_sub(still);
            habits.clutter = (moving as f64 / self.frames as f64).max(0.05);
        }
        habits.floor_px = LEAST_SLACK_PX;
    }
}
