//! The film maker: films with known truth, of any planar mechanism of rigid links with markers on them.
//!
//! ```text
//! Scene (TOML) + MotionTable ─▶ Film ─▶ expected image ─noise─▶ recorded frame ─▶ file, SyntheticSource
//!                                  └──▶ truth: place, visible part, angles
//! ```
//!
//! Owns: [`Scene`], [`MotionTable`], [`Film`], the presets, writing films and truth. Must not: know of pendulums or
//! metres, or of detection and tracking, which it exists to judge.
//!
//! A frame's time is the middle of its exposure. Everything random comes from the scene's seed and the frame's
//! index, so frames may be made in any order and by any number of threads. The noise model is in [`noise`].

mod camera_raw;
pub mod coverage;
pub mod encode;
mod motion;
mod motion_file;
pub mod noise;
mod presets;
mod render;
pub mod scene;
mod scene_check;
mod sink;
mod spline;
mod truth;
mod truth_table;
mod write;
mod write_options;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

pub use motion::MotionTable;
pub use presets::{PRESETS, paper_layout, preset};
pub use scene::Scene;
pub use sink::files as film_files;
pub use truth::{FrameTruth, NodeTruth};
pub use truth_table::{Truth, TruthWriter};
pub use write::write;
pub use write_options::WriteOptions;

use crate::error::Result;
use crate::frame::{Frame, PixelFormat, TimeBase};
use crate::pixel_aspect::PixelAspect;
use crate::rig::{Body, Joint, Node, RIG_SCHEMA, Rig};
use motion::{Mechanism, bar};
use scene::{Glint, within};

/// A scene ready to be filmed. Shared between threads; nothing in it changes.
#[derive(Debug, Clone)]
pub struct Film {
    scene: Scene,
    mechanism: Mechanism,
    ground: Vec<f32>,
    /// Pixel numbers of hot pixels.
    hot: Vec<usize>,
    /// All glints, by first frame.
    glints: Vec<Glint>,
    /// Longest duration among them.
    longest_glint: u64,
    /// For each marker the index of its link.
    marker_links: Vec<usize>,
    time_base: TimeBase,
}

impl Film {
    /// A film of a scene; its motion table, if it names one, is read.
    ///
    /// # Errors
    /// [`crate::error::Error::Film`] for a scene that makes no sense or a motion that is too short.
    pub fn new(scene: &Scene) -> Result<Self> {
        match &scene.motion {
            Some(m) => Self::build(scene, Some(&MotionTable::read(&m.file)?)),
            None => Self::build(scene, None),
        }
    }

    /// A film of a scene that moves as `motion` says, from its first time on (or the scene's `motion.start_s`).
    ///
    /// # Errors
    /// As [`Film::new`].
    pub fn with_motion(scene: &Scene, motion: &MotionTable) -> Result<Self> {
        Self::build(scene, Some(motion))
    }

    fn build(scene: &Scene, table: Option<&MotionTable>) -> Result<Self> {
        scene.check("scene")?;
        let mechanism = Mechanism::new(scene, table)?;
        let mut rng = ChaCha8Rng::seed_from_u64(scene.seed);
        // Frames use streams from 0 up, links from the top down; these two lie between.
        rng.set_stream(1 << 62);
        let mut uniform = || (rng.next_u64() >> 11) as f64 / (1u64 << 53) as f64;
        let [w, h] = scene.image_px;
        let pixels = f64::from(w) * f64::from(h);
        let hot = (0..scene.camera.hot_pixels).map(|_| (uniform() * pixels) as usize).collect();
        let glints = glints(scene);
        Ok(Self {
            ground: render::ground(scene),
            mechanism,
            hot,
            longest_glint: glints.iter().map(|g| g.count).max().unwrap_or(0),
            glints,
            marker_links: scene.markers.iter().filter_map(|m| scene.link_index(&m.link)).collect(),
            time_base: scene.time_base()?,
            scene: scene.clone(),
        })
    }

    /// The scene.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Number of frames.
    pub fn frames(&self) -> u64 {
        self.scene.frames
    }

    /// Seconds per tick; frame `i` is at tick `i`.
    pub fn time_base(&self) -> TimeBase {
        self.time_base
    }

    /// Time of a frame, the middle of its exposure, s.
    pub fn time_s(&self, index: u64) -> f64 {
        self.time_base.seconds(index as i64)
    }

    /// Bytes per pixel of a recorded frame: 1 up to 8 bits, else 2.
    pub fn bytes_per_pixel(&self) -> usize {
        if self.scene.camera.depth_bits > 8 { 2 } else { 1 }
    }

    /// Expected levels of a frame, row by row, into `out` (cleared first): what the mean over many recordings would
    /// be without saturation and rounding. See [`noise`].
    pub fn expected(&self, index: u64, out: &mut Vec<f32>) {
        render::expected(self, index, out);
        for &pixel in &self.hot {
            out[pixel] += self.scene.camera.hot_level as f32;
        }
    }

    /// Variance of a recorded level expected at `level`, see [`noise::variance`].
    pub fn variance(&self, level: f64) -> f64 {
        noise::variance(&self.scene.camera, level)
    }

    /// Recorded levels of a frame, row by row without padding, one byte or two (little-endian) per pixel, into `out`
    /// (cleared first).
    pub fn render(&self, index: u64, out: &mut Vec<u8>) {
        let mut expected = Vec::new();
        self.expected(index, &mut expected);
        noise::record(&self.scene.camera, self.scene.seed, index, &expected, out);
    }

    /// A recorded frame as a source hands it out.
    pub fn frame(&self, index: u64) -> Frame {
        let mut plane = Vec::new();
        self.render(index, &mut plane);
        let [width, height] = self.scene.image_px;
        Frame {
            index,
            ticks: index as i64,
            width,
            height,
            stride: width as usize * self.bytes_per_pixel(),
            format: self.format(),
            depth_bits: self.scene.camera.depth_bits,
            plane: Some(Box::new(plane)),
        }
    }

    /// How recorded frames are stored.
    pub fn format(&self) -> PixelFormat {
        if self.scene.camera.depth_bits > 8 { PixelFormat::Gray16 } else { PixelFormat::Gray8 }
    }

    /// What is true of a frame.
    pub fn truth(&self, index: u64) -> FrameTruth {
        let scene = &self.scene;
        let size = scene.image_px.map(f64::from);
        let time_s = self.time_s(index);
        let mut poses = Vec::new();
        let n = render::instants(self, index, &mut poses);
        // The seen part changes slowly: at most 16 instants of the exposure tell it.
        let n = n.min(16);
        let hidden_links = self.hidden_links(index);
        let hidden_markers = self.hidden_markers(index);
        let black = scene.dropouts.iter().any(|d| within(index, d.first, d.count));
        let mut nodes = vec![
            NodeTruth { x_px: 0.0, y_px: 0.0, mean_x_px: 0.0, mean_y_px: 0.0, visible: 0.0 };
            scene.markers.len()
        ];
        let (mut quads, mut discs) = (Vec::new(), Vec::new());
        for k in 0..n {
            self.mechanism.poses(time_s + render::instant_s(scene.camera.exposure_s, k, n), &mut poses);
            for (j, m) in scene.markers.iter().enumerate() {
                let link = self.marker_links[j];
                let at = poses[link].point(m.at_px);
                nodes[j].mean_x_px += at[0] / n as f64;
                nodes[j].mean_y_px += at[1] / n as f64;
                if black || hidden_links[link] || hidden_markers[j] {
                    continue;
                }
                quads.clear();
                discs.clear();
                quads
                    .extend((0..link).filter(|&i| !hidden_links[i]).filter_map(|i| bar(scene, i, &poses[i])));
                quads.extend(scene.screens.iter().map(|s| coverage::Quad {
                    origin: [0.0, 0.0],
                    along: [1.0, 0.0],
                    across: [0.0, 1.0],
                    u: [s.edges_px[0], s.edges_px[2]],
                    v: [s.edges_px[1], s.edges_px[3]],
                }));
                for (o, other) in scene.markers.iter().enumerate() {
                    let front = self.marker_links[o];
                    let before = front < link || (front == link && o > j);
                    if before && !hidden_links[front] && !hidden_markers[o] {
                        let p = poses[front].point(other.at_px);
                        discs.push([p[0], p[1], other.radius_px]);
                    }
                }
                nodes[j].visible += truth::visible_part(at, m.radius_px, &quads, &discs, size) / n as f64;
            }
        }
        self.mechanism.poses(time_s, &mut poses);
        for (j, m) in scene.markers.iter().enumerate() {
            [nodes[j].x_px, nodes[j].y_px] = poses[self.marker_links[j]].point(m.at_px);
        }
        FrameTruth { frame: index, time_s, nodes, phi_rad: poses.iter().map(|p| p.phi_rad).collect() }
    }

    /// The rig of the scene as it stands in frame `index`, with its joints: what a perfect `tracker setup` finds.
    pub fn rig(&self, index: u64) -> Rig {
        let scene = &self.scene;
        let mut poses = Vec::new();
        self.mechanism.poses(self.time_s(index), &mut poses);
        let nodes = (scene.markers.iter().zip(&self.marker_links))
            .map(|(m, &l)| {
                let [x_px, y_px] = poses[l].point(m.at_px);
                Node { name: m.name.clone(), body: m.link.clone(), x_px, y_px }
            })
            .collect();
        let mut joints = Vec::new();
        for (i, l) in scene.links.iter().enumerate() {
            let [x_px, y_px] = poses[i].joint;
            let (name, bodies) = match &l.parent {
                Some(p) => (format!("joint{i}"), vec![p.clone(), l.name.clone()]),
                None if l.velocity_px_s.is_some() => continue,
                None => {
                    (if i == 0 { "pivot".to_string() } else { format!("pivot{i}") }, vec![l.name.clone()])
                }
            };
            joints.push(Joint { name, bodies, x_px, y_px });
        }
        Rig {
            schema: RIG_SCHEMA,
            image_px: scene.image_px,
            pixel_aspect: PixelAspect::SQUARE,
            reference_frame: Some(index),
            region: None,
            lens: None,
            bodies: scene
                .links
                .iter()
                .filter(|l| scene.markers.iter().any(|m| m.link == l.name))
                .map(|l| Body { name: l.name.clone() })
                .collect(),
            nodes,
            joints,
        }
    }

    fn hidden_links(&self, index: u64) -> Vec<bool> {
        let now: Vec<_> = self.scene.hidden.iter().filter(|h| within(index, h.first, h.count)).collect();
        self.scene.links.iter().map(|l| now.iter().any(|h| h.links.contains(&l.name))).collect()
    }

    fn hidden_markers(&self, index: u64) -> Vec<bool> {
        let now: Vec<_> = self.scene.hidden.iter().filter(|h| within(index, h.first, h.count)).collect();
        self.scene.markers.iter().map(|m| now.iter().any(|h| h.markers.contains(&m.name))).collect()
    }

    /// Glints that shine in a frame.
    fn glints_at(&self, index: u64) -> impl Iterator<Item = &Glint> {
        let earliest = (index + 1).saturating_sub(self.longest_glint);
        let from = self.glints.partition_point(|g| g.first < earliest);
        let to = self.glints.partition_point(|g| g.first <= index);
        self.glints[from..to.max(from)].iter().filter(move |g| within(index, g.first, g.count))
    }
}

/// Stated and random glints, by their first frame.
fn glints(scene: &Scene) -> Vec<Glint> {
    let mut all = scene.glint_list.clone();
    if let Some(g) = &scene.glints {
        let mut rng = ChaCha8Rng::seed_from_u64(scene.seed);
        rng.set_stream((1 << 62) + 1);
        let mut uniform = || (rng.next_u64() >> 11) as f64 / (1u64 << 53) as f64;
        let between = |[low, high]: [f64; 2], u: f64| low + u * (high - low);
        for first in 0..scene.frames {
            // As many as on average, the rest by chance.
            let count = g.per_frame.floor() as u64 + u64::from(uniform() < g.per_frame.fract());
            for _ in 0..count {
                all.push(Glint {
                    first,
                    count: 1 + (uniform() * g.longest as f64) as u64,
                    at_px: [
                        uniform() * f64::from(scene.image_px[0]) - 0.5,
                        uniform() * f64::from(scene.image_px[1]) - 0.5,
                    ],
                    radius_px: between(g.radius_px, uniform()),
                    level: between(g.level, uniform()),
                });
            }
        }
    }
    all.sort_by_key(|g| g.first);
    all
}

#[cfg(test)]
mod tests;
