//! Test bed: any scene of the film maker as detections, without pixels: its truth with noise.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

use crate::detect::{Detection, Flags};
use crate::discover::{Discovery, discover};
use crate::observation::Status;
use crate::rig::Rig;
use crate::score::{LIMIT_PX, Score, Tracked, score};
use crate::stop::Stop;
use crate::store::{DetectionStore, FrameStamp};
use crate::synth::scene::{Hidden, Link, LinkMotion, Marker};
use crate::synth::{Film, MotionTable, Scene, Truth, preset};
use crate::table::Rows;
use crate::track::track_recording;

/// A scene that was filmed and detected.
pub struct Bed {
    pub film: Film,
    pub truth: Truth,
    pub store: DetectionStore,
}

/// The tracker's observations of a film, and the truth.
pub struct Followed {
    pub score: Score,
    /// By frame, then node of the rig.
    pub status: Vec<Status>,
}

impl Followed {
    /// Runs of frames in which a node is not given, for messages.
    pub fn runs(&self) -> String {
        let n = self.score.matches.len();
        let mut out = String::new();
        for k in 0..n {
            out += &format!("\n{} {:.3}:", self.score.matches[k].node, self.score.matches[k].coverage);
            let column: Vec<Status> = self.status.iter().skip(k).step_by(n).copied().collect();
            let mut first = 0;
            for run in column.chunk_by(|a, b| a.is_seen() == b.is_seen()) {
                if !run[0].is_seen() {
                    out += &format!(" {first}..{} {}", first + run.len(), run[0].as_str());
                }
                first += run.len();
            }
        }
        out
    }
}

/// Faults with which detections are made from a truth.
#[derive(Debug, Clone, Copy, Default)]
pub struct Faults {
    /// Noise of each coordinate, px.
    pub noise_px: f64,
    /// How far the camera shakes each way, px.
    pub shake_px: f64,
    /// Glints in a frame, each for that frame only.
    pub glints: usize,
}

/// Least part of a marker that is detected.
const DETECTED: f64 = 0.3;

impl Bed {
    pub fn new(scene: &Scene, faults: Faults) -> Self {
        Self::of(Film::new(scene).unwrap(), faults)
    }

    /// A scene that moves as a table says.
    pub fn moving(scene: &Scene, motion: &MotionTable, faults: Faults) -> Self {
        Self::of(Film::with_motion(scene, motion).unwrap(), faults)
    }

    fn of(film: Film, faults: Faults) -> Self {
        let scene = film.scene();
        let mut truth = Truth::of(&film);
        let mut rng = ChaCha8Rng::seed_from_u64(scene.seed);
        let noise = Normal::new(0.0, faults.noise_px).unwrap();
        let size = scene.image_px.map(f64::from);
        let mut store = DetectionStore::new();
        for frame in &mut truth.frames {
            let shake = [0, 1].map(|_| faults.shake_px * (2.0 * rng.random::<f64>() - 1.0));
            // Place, radius, part seen.
            let mut seen: Vec<([f64; 2], f64, f64)> = Vec::new();
            for (n, m) in frame.nodes.iter_mut().zip(&scene.markers) {
                n.x_px += shake[0];
                n.y_px += shake[1];
                if n.visible >= DETECTED {
                    seen.push(([n.x_px, n.y_px], m.radius_px, n.visible));
                }
            }
            for d in &scene.distractors {
                seen.push(([d.at_px[0] + shake[0], d.at_px[1] + shake[1]], d.radius_px, 1.0));
            }
            for _ in 0..faults.glints {
                seen.push((size.map(|s| s * rng.random::<f64>()), 5.0, 1.0));
            }
            let mut detections: Vec<Detection> = Vec::new();
            for blob in blobs(&seen) {
                let area = |&i: &usize| std::f64::consts::PI * seen[i].1.powi(2) * seen[i].2;
                let area_px: f64 = blob.iter().map(area).sum();
                let middle =
                    |axis: usize| blob.iter().map(|i| area(i) * seen[*i].0[axis]).sum::<f64>() / area_px;
                detections.push(Detection {
                    x_px: middle(0) + noise.sample(&mut rng),
                    y_px: middle(1) + noise.sample(&mut rng),
                    sigma_px: faults.noise_px as f32,
                    area_px: area_px as f32,
                    peak: 200.0,
                    elongation: 1.0,
                    flags: Flags(match blob[..] {
                        [i] if seen[i].2 < 0.99 => Flags::PARTIAL,
                        [_] => 0,
                        _ => Flags::MERGED,
                    }),
                });
            }
            detections.sort_by(|a, b| a.y_px.total_cmp(&b.y_px).then(a.x_px.total_cmp(&b.x_px)));
            let stamp = FrameStamp { index: frame.frame, ticks: frame.frame as i64, decoded: true };
            store.push(stamp, &detections).unwrap();
        }
        Self { film, truth, store }
    }

    /// Follows a rig; names are compared as the score does.
    pub fn follow(&self, rig: &Rig) -> Followed {
        let mut tracked =
            Tracked { nodes: rig.nodes.iter().map(|n| n.name.clone()).collect(), ..Tracked::default() };
        let mut status = Vec::new();
        track_recording(&self.store, rig, &Stop::default(), &mut |stamp, row| {
            tracked.frames.push(stamp.index);
            for o in row {
                tracked.xy_px.push([o.x_px, o.y_px]);
                status.push(o.status);
            }
            Ok(())
        })
        .unwrap();
        Followed { score: score(&tracked, &self.truth, LIMIT_PX).unwrap(), status }
    }

    /// The node table's rows for a rig.
    pub fn rows(&self, rig: &Rig) -> Rows {
        let mut rows = Rows::default();
        let rate_hz = self.film.scene().rate_hz;
        track_recording(&self.store, rig, &Stop::default(), &mut |stamp, row| {
            rows.push(stamp.index, stamp.index as f64 / rate_hz, row);
            Ok(())
        })
        .unwrap();
        rows
    }

    /// The rig found in it.
    pub fn discover(&self) -> Discovery {
        discover(&self.store, self.film.scene().image_px, &Stop::default()).unwrap()
    }
}

/// Discs (place, radius, part seen) that touch are one blob: the indices of each blob's.
fn blobs(discs: &[([f64; 2], f64, f64)]) -> Vec<Vec<usize>> {
    let mut out: Vec<Vec<usize>> = Vec::new();
    for (i, &(p, r, _)) in discs.iter().enumerate() {
        let touches = |&k: &usize| (discs[k].0[0] - p[0]).hypot(discs[k].0[1] - p[1]) < discs[k].1 + r;
        let (mut with, apart): (Vec<_>, Vec<_>) = out.into_iter().partition(|b| b.iter().any(touches));
        out = apart;
        out.push(with.drain(..).flatten().chain([i]).collect());
    }
    out
}

/// A scene of links without bars, so that nothing hides anything: name, parent, joint, motion.
pub fn scene(
    seed: u64,
    links: &[(&str, Option<&str>, [f64; 2], LinkMotion)],
    markers: &[(&str, [f64; 2])],
) -> Scene {
    let mut s = preset("clean", seed).unwrap();
    s.links = links
        .iter()
        .map(|(name, parent, joint_px, motion)| Link {
            name: (*name).into(),
            parent: parent.map(String::from),
            joint_px: *joint_px,
            velocity_px_s: None,
            along_px: [0.0; 2],
            width_px: 0.0,
            level: 0.0,
            light: 1.0,
            motion: Some(motion.clone()),
        })
        .collect();
    s.markers = markers
        .iter()
        .enumerate()
        .map(|(k, (link, at_px))| Marker {
            name: format!("m{k}"),
            link: (*link).into(),
            at_px: *at_px,
            radius_px: 6.0,
            level: 200.0,
        })
        .collect();
    s
}

pub fn tumble(phi_rad: f64, rate_rad_s: f64) -> LinkMotion {
    LinkMotion::Tumble { phi_rad, rate_rad_s, frequency_hz: 2.0 }
}

/// Markers hidden for `count` frames from `first`.
pub fn hide(scene: &mut Scene, first: u64, count: u64, markers: &[&str]) {
    let markers = markers.iter().map(|m| (*m).into()).collect();
    scene.hidden.push(Hidden { first, count, links: Vec::new(), markers });
}

pub const QUIET: Faults = Faults { noise_px: 0.03, shake_px: 0.0, glints: 0 };
