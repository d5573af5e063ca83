//! Prepares a scene for making frames: its motion, what stands still, what hides and glints when.
//!
//! Owns: [`Film`]. Must not: paint.

use nalgebra::Vector2;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use super::canvas::ground;
use super::coverage::Quad;
use super::motion::{Mechanism, MotionTable, Pose, bar};
use super::scene::{Glint, Scene, within};
use crate::camera::Camera;
use crate::error::Result;
use crate::frame::{PixelFormat, TimeBase};
use crate::pixel_aspect::PixelAspect;
use crate::rig::{Body, CameraOrigin, Joint, Node, RIG_SCHEMA, Rig, RigCamera};

/// A scene ready to be filmed. Shared between threads; nothing in it changes.
#[derive(Debug, Clone)]
pub struct Film {
    pub(super) scene: Scene,
    pub(super) mechanism: Mechanism,
    pub(super) ground: Vec<f32>,
    /// Pixel numbers of hot pixels.
    pub(super) hot: Vec<usize>,
    /// All glints, by first frame.
    pub(super) glints: Vec<Glint>,
    /// Longest duration among them.
    pub(super) longest_glint: u64,
    /// For each marker the index of its link.
    pub(super) marker_links: Vec<usize>,
    pub(super) time_base: TimeBase,
    /// The camera that sees the links' plane, in square pixels; `None` is one that looks straight at it.
    pub(super) camera: Option<Camera>,
    /// Width to height of the recorded pixels; they are square where there is no camera.
    pub(super) pixel_aspect: PixelAspect,
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
            ground: ground(scene),
            mechanism,
            hot,
            longest_glint: glints.iter().map(|g| g.count).max().unwrap_or(0),
            glints,
            marker_links: scene.markers.iter().filter_map(|m| scene.link_index(&m.link)).collect(),
            time_base: scene.time_base()?,
            camera: camera(scene),
            pixel_aspect: scene.pixel_aspect(),
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

    /// Width to height of a pixel, as the film says it.
    pub fn pixel_aspect(&self) -> PixelAspect {
        self.pixel_aspect
    }

    /// The form in which recorded frames are stored.
    pub fn format(&self) -> PixelFormat {
        if self.scene.camera.depth_bits > 8 { PixelFormat::Gray16 } else { PixelFormat::Gray8 }
    }

    /// The rig of the scene as it stands in frame `index`, with its joints: what a perfect `pydpend setup` finds.
    pub fn rig(&self, index: u64) -> Rig {
        let scene = &self.scene;
        let mut poses = Vec::new();
        self.mechanism.poses(self.time_s(index), &mut poses);
        let nodes = (scene.markers.iter().zip(&self.marker_links))
            .map(|(m, &l)| {
                let [x_px, y_px] = self.seen(poses[l].point(m.at_px));
                Node { name: m.name.clone(), body: m.link.clone(), x_px, y_px }
            })
            .collect();
        let mut joints = Vec::new();
        for (i, l) in scene.links.iter().enumerate() {
            let [x_px, y_px] = self.seen(poses[i].joint);
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
            pixel_aspect: self.pixel_aspect,
            reference_frame: Some(index),
            region: None,
            lens: None,
            wanted: Default::default(),
            camera: self.camera.map(|c| RigCamera::of(&c, None, CameraOrigin::Given)),
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

    /// The place in the picture of a place of the links' plane.
    pub(super) fn seen(&self, plane: [f64; 2]) -> [f64; 2] {
        let Some(camera) = self.camera else { return plane };
        self.pixel_aspect.to_recorded(camera.to_picture(self.spread(&camera, plane))).into()
    }

    /// A place of the plane in lengths of square pixels, so that things keep the number of recorded pixels that they cover.
    fn spread(&self, camera: &Camera, plane: [f64; 2]) -> Vector2<f64> {
        if self.pixel_aspect.is_square() {
            return plane.into();
        }
        let middle = Vector2::from(self.scene.image_px.map(|n| (f64::from(n) - 1.0) / 2.0));
        camera.middle() + (Vector2::from(plane) - middle) * self.pixel_aspect.ratio().sqrt()
    }

    /// The magnification of small things from the plane to the picture: the root of what their area in recorded pixels gains.
    pub(super) fn scale(&self, plane: [f64; 2]) -> f64 {
        self.camera.map_or(1.0, |c| {
            let there = c.to_picture(self.spread(&c, plane));
            c.slopes(there).by_picture.determinant().abs().powf(-0.5)
        })
    }

    /// The bar of link `index` in the picture; `None` if it has none. It is drawn straight from end to end, as wide as in its
    /// middle: markers are seen where they are, and a bar only hides and is hidden.
    pub(super) fn seen_bar(&self, index: usize, pose: &Pose) -> Option<Quad> {
        let quad = bar(&self.scene, index, pose)?;
        if self.camera.is_none() {
            return Some(quad);
        }
        let [from, to] = quad.u.map(|u| Vector2::from(self.seen(pose.point([u, 0.0]))));
        let along = (to - from).normalize();
        // Recorded pixels that are wide make a bar across them narrow.
        let narrow = along.component_mul(&Vector2::from(self.pixel_aspect.sides())).norm();
        let middle = pose.point([0.5 * (quad.u[0] + quad.u[1]), 0.0]);
        let half = 0.5 * (quad.v[1] - quad.v[0]) * self.scale(middle) * narrow;
        Some(Quad {
            origin: from.into(),
            along: along.into(),
            across: [along.y, -along.x],
            u: [0.0, (to - from).norm()],
            v: [-half, half],
        })
    }

    pub(super) fn hidden_links(&self, index: u64) -> Vec<bool> {
        let now: Vec<_> = self.scene.hidden.iter().filter(|h| within(index, h.first, h.count)).collect();
        self.scene.links.iter().map(|l| now.iter().any(|h| h.links.contains(&l.name))).collect()
    }

    pub(super) fn hidden_markers(&self, index: u64) -> Vec<bool> {
        let now: Vec<_> = self.scene.hidden.iter().filter(|h| within(index, h.first, h.count)).collect();
        self.scene.markers.iter().map(|m| now.iter().any(|h| h.markers.contains(&m.name))).collect()
    }

    /// Glints that shine in a frame.
    pub(super) fn glints_at(&self, index: u64) -> impl Iterator<Item = &Glint> {
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

/// The camera of a scene.
fn camera(scene: &Scene) -> Option<Camera> {
    let v = scene.camera.view?;
    let aspect = scene.pixel_aspect();
    let [w, h] = scene.image_px.map(f64::from);
    let size_px = [w * aspect.ratio(), h];
    // What the film says of its pixels is no error of the camera.
    let height = if aspect.is_square() { v.pixel_height } else { 1.0 };
    let focal_px = v.focal_widths * size_px[0];
    let (tilt, towards) = (v.tilt_deg.to_radians(), v.towards_deg.to_radians());
    Some(Camera::tilted(tilt, towards, focal_px, v.k1, height, size_px))
}
