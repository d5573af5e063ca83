//! Estimates templates, joints, prediction error and clutter from a recording, before its markers are named for good.
//!
//! Owns: [`PriorEstimator`]. Must not: name markers in the output.

use nalgebra::{Isometry2, Vector2};

use super::motion_priors::MotionPriors;
use super::seen::BodySeen;
use crate::rigid::body::{Holder, Mechanism};
use crate::rigid::index::DetectionIndex;
use crate::rigid::joint::Shared;
use crate::rigid::pose::place;

/// Samples kept of each node; beyond, every second one is dropped and only every second taken.
const SAMPLES: usize = 1024;
/// Frames that show every node of a body, fewer say nothing of how it scatters: 50 know it to a tenth.
const LEAST_COMPLETE: usize = 50;
/// Greatest travel of a detection that stands still, px.
const SAME_PLACE_PX: f64 = 3.0;
/// Places of left-over detections kept.
const PLACES: usize = 256;
/// Nothing is known better than this, px: what a template cannot say of a real body (lens, bending).
const LEAST_SLACK_PX: f64 = 0.02;

/// One node in one frame.
#[derive(Debug, Clone, Copy)]
struct Sample {
    /// Place in its body's coordinates.
    local: Vector2<f64>,
    sigma_px: f64,
    area_px: f64,
    /// Whether every node of the body was seen whole in this frame.
    complete: bool,
}

/// Seen places of one node in its body's coordinates.
#[derive(Debug, Clone, Default)]
struct Samples {
    at: Vec<Sample>,
    every: usize,
    count: usize,
}

impl Samples {
    fn add(&mut self, sample: Sample) {
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
            self.at.push(sample);
        }
        self.count += 1;
    }
}

fn median(values: &mut [f64]) -> Option<f64> {
    let n = values.len();
    (n > 0).then(|| *values.select_nth_unstable_by(n / 2, f64::total_cmp).1)
}

/// The variance of each coordinate, px^2, by which the places of a rigid body's nodes scatter beyond their stated uncertainty. A
/// compressed recording moves a whole marker by what its encoder spared, which its pixels do not show; only its body does. `None`
/// where too few frames show every node.
///
/// With n nodes the pose takes three of the 2 n coordinates, so the residuals hold `(2 n - 3) / 2` variances.
fn excess(samples: &[Samples]) -> Option<f64> {
    let (mut scatter, mut stated) = (0.0, 0.0);
    for s in samples {
        let mut seen: Vec<(Vector2<f64>, f64)> =
            s.at.iter().filter(|p| p.complete).map(|p| (p.local, p.sigma_px * p.sigma_px)).collect();
        if seen.len() < LEAST_COMPLETE {
            return None;
        }
        let middle = |axis: usize| median(&mut seen.iter().map(|p| p.0[axis]).collect::<Vec<f64>>());
        let centre = Vector2::new(middle(0)?, middle(1)?);
        let mut squares: Vec<f64> = seen.iter().map(|p| (p.0 - centre).norm_squared()).collect();
        // Beyond five standard deviations it is not noise; the median of a Rayleigh square is 2 ln 2 variances.
        let most = 25.0 * median(&mut squares)? / (2.0 * std::f64::consts::LN_2);
        seen.retain(|p| (p.0 - centre).norm_squared() <= most);
        let n = seen.len() as f64;
        scatter += seen.iter().map(|p| (p.0 - centre).norm_squared()).sum::<f64>() / (2.0 * n);
        stated += seen.iter().map(|p| p.1).sum::<f64>() / n;
    }
    let nodes = samples.len() as f64;
    (nodes >= 2.0).then(|| (2.0 * scatter / (2.0 * nodes - 3.0) - stated / nodes).max(0.0))
}

/// Estimator of templates, joints and motion priors, frame by frame.
#[derive(Debug, Clone)]
pub struct PriorEstimator {
    /// For each body and node.
    nodes: Vec<Vec<Samples>>,
    /// For each joint.
    joints: Vec<Shared>,
    frames: usize,
    left_over: usize,
    /// Places of what is left over, and in how many frames.
    places: Vec<(Vector2<f64>, usize)>,
}

impl PriorEstimator {
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
    pub fn add(&mut self, mechanism: &Mechanism, seen: &[BodySeen], index: &DetectionIndex<'_>) {
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
            let complete = s.picks.iter().all(|p| p.is_some_and(|d| index.whole(d)));
            for (pick, sample) in s.picks.iter().zip(samples) {
                if let Some(d) = *pick
                    && index.whole(d)
                {
                    sample.add(Sample {
                        local: place(&pose.inverse(), index.place(d)),
                        sigma_px: f64::from(index.get(d).sigma_px),
                        area_px: f64::from(index.get(d).area_px),
                        complete,
                    });
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
        let mut node = vec![false; index.len()];
        for d in seen.iter().flat_map(BodySeen::detections) {
            node[d] = true;
        }
        for d in (0..index.len()).filter(|&d| !node[d]) {
            let at = index.place(d);
            match self.places.iter().position(|p| (p.0 - at).norm() < SAME_PLACE_PX) {
                Some(k) => self.places[k].1 += 1,
                None if self.places.len() < PLACES => self.places.push((at, 1)),
                None => {}
            }
        }
        self.frames += 1;
        self.left_over += index.len().saturating_sub(used);
    }

    /// Sets the mechanism and the priors to what the frames say; what they do not say stays.
    pub fn apply(&self, mechanism: &mut Mechanism, priors: &mut MotionPriors) {
        let excess: Vec<Option<f64>> = self.nodes.iter().map(|samples| excess(samples)).collect();
        let known: Vec<f64> = excess.iter().copied().flatten().collect();
        // A body that says nothing of it is seen by the same camera as the others.
        let usual = known.iter().sum::<f64>() / known.len().max(1) as f64;
        for (link, excess) in mechanism.links.iter_mut().zip(excess) {
            link.excess_px = excess.unwrap_or(usual).sqrt();
        }
        for (link, samples) in mechanism.links.iter_mut().zip(&self.nodes) {
            for (j, s) in samples.iter().enumerate() {
                let mut x: Vec<f64> = s.at.iter().map(|p| p.local.x).collect();
                let mut y: Vec<f64> = s.at.iter().map(|p| p.local.y).collect();
                // Medians: half hidden markers pull to one side.
                let (Some(x), Some(y)) = (median(&mut x), median(&mut y)) else { continue };
                if s.at.len() < 20 {
                    continue;
                }
                let centre = Vector2::new(x, y);
                let mut square: Vec<f64> = s.at.iter().map(|p| (p.local - centre).norm_squared()).collect();
                let mut own: Vec<f64> = s.at.iter().map(|p| p.sigma_px * p.sigma_px).collect();
                // The median of a Rayleigh square is 2 ln 2 of the variance of one coordinate.
                let scatter = median(&mut square).unwrap_or(0.0) / (2.0 * std::f64::consts::LN_2);
                let explained = median(&mut own).unwrap_or(0.0);
                // Areas change with blur and noise, so the limit is below what is usual by four times their scatter.
                let mut area: Vec<f64> = s.at.iter().map(|p| p.area_px).collect();
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
            priors.standing = standing.iter().map(|p| p.0).collect();
            let moving = self.left_over.saturating_sub(still);
            priors.clutter = (moving as f64 / self.frames as f64).max(0.05);
        }
        priors.floor_px = LEAST_SLACK_PX;
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, Normal};

    use crate::detect::Detection;
    use crate::pixel_aspect::PixelAspect;
    use crate::rig::{Body, Joint, Node, RIG_SCHEMA, Rig};
    use crate::store::{DetectionStore, FrameStamp};
    use crate::track::track_recording;

    /// Mean stated uncertainty of four markers on a turning body, whose places scatter by `scatter_px` while each
    /// detection says `stated_px`.
    fn stated(scatter_px: f64, stated_px: f32, seed: u64) -> f64 {
        let at = [[60.0, 0.0], [100.0, 25.0], [150.0, -20.0], [200.0, 10.0]];
        let place = |turn: f64, [u, v]: [f64; 2]| {
            [300.0 + u * turn.cos() - v * turn.sin(), 300.0 + u * turn.sin() + v * turn.cos()]
        };
        let nodes = at.iter().enumerate().map(|(i, &p)| {
            let [x_px, y_px] = place(0.0, p);
            Node { name: format!("n{i}"), body: "b".into(), x_px, y_px }
        });
        let rig = Rig {
            schema: RIG_SCHEMA,
            image_px: [600, 600],
            pixel_aspect: PixelAspect::SQUARE,
            reference_frame: Some(0),
            region: None,
            lens: None,
            wanted: Default::default(),
            camera: None,
            bodies: vec![Body { name: "b".into() }],
            nodes: nodes.collect(),
            joints: vec![Joint { name: "pivot".into(), bodies: vec!["b".into()], x_px: 300.0, y_px: 300.0 }],
        };
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let noise = Normal::new(0.0, scatter_px).unwrap();
        let mut store = DetectionStore::new();
        for index in 0..600 {
            let found: Vec<Detection> = at
                .iter()
                .map(|&p| {
                    let [x, y] = place(0.03 * index as f64, p);
                    Detection {
                        x_px: x + noise.sample(&mut rng),
                        y_px: y + noise.sample(&mut rng),
                        sigma_px: stated_px,
                        area_px: 113.0,
                        ..Detection::default()
                    }
                })
                .collect();
            store.push(FrameStamp { index, ticks: index as i64, decoded: true }, &found).unwrap();
        }
        let (mut sum, mut count) = (0.0, 0.0);
        track_recording(&store, &rig, &crate::stop::Stop::default(), &mut |_, row| {
            for o in row.iter().filter(|o| o.status.is_seen()) {
                sum += f64::from(o.sigma_px);
                count += 1.0;
            }
            Ok(())
        })
        .unwrap();
        assert_eq!(count, 2400.0);
        sum / count
    }

    #[test]
    fn what_a_body_scatters_beyond_its_markers_word_is_added_to_it() {
        for seed in 0..3 {
            // 600 frames of five free residuals know a scatter to 1.3 %; three times that, and the template's own.
            let honest = stated(0.01, 0.01, seed);
            assert!((honest / 0.01 - 1.0).abs() < 0.05, "{honest}");
            let spared = stated(0.04, 0.01, seed);
            assert!((spared / 0.04 - 1.0).abs() < 0.05, "{spared}");
            // Never below what the pixels say.
            let modest = stated(0.005, 0.01, seed);
            assert!((modest / 0.01 - 1.0).abs() < 0.01, "{modest}");
        }
    }
}
