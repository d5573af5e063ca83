//! Draws nodes, names, bodies, trails and gaps into a frame.
//!
//! Owns: [`Overlay`]. Must not: track: it draws what a table says.
//!
//! Every stroke has a dark rim, so that it is read on bright and on dark ground.

use std::collections::VecDeque;

use nalgebra::{Isometry2, Vector2};
use opencv::core::{Mat, Point, Scalar};
use opencv::imgproc;

use super::picture::{Picture, colour, failed};
use crate::error::Result;
use crate::frame::Frame;
use crate::observation::{Observation, Status};
use crate::rig::Rig;
use crate::rigid::body::{Holder, Mechanism};
use crate::rigid::forecast::{Motion, PredictionError, hung_at};
use crate::rigid::pose::{Pair, fit_pose, place};

/// Length of a trail in frames.
const TRAIL: usize = 40;
/// Bits of a pixel that OpenCV's drawing takes as fractions.
const SHIFT: i32 = 3;
/// Body colours (blue, green, red), far apart also for the colour-blind (Okabe and Ito).
const COLOURS: [[f64; 3]; 6] = [
    [233.0, 180.0, 86.0],
    [0.0, 159.0, 230.0],
    [115.0, 158.0, 0.0],
    [66.0, 228.0, 240.0],
    [167.0, 121.0, 204.0],
    [0.0, 94.0, 213.0],
];

/// Draws frame after frame of one recording.
pub struct Overlay {
    rig: Rig,
    mechanism: Mechanism,
    motions: Vec<Motion>,
    /// In square pixels, as all places here are.
    trails: Vec<VecDeque<Vector2<f64>>>,
    /// Width and height of the pictures, px.
    pub(super) size: [i32; 2],
    /// Pixels of the picture for a square one of the recording.
    zoom: f64,
    /// Size of marks in the picture: 1 in one of 1280 px.
    mark: f64,
    /// Size of marks in square pixels of the recording.
    pub(super) scale: f64,
}

impl Overlay {
    /// For a checked rig; pictures of the recording's size, made wider or higher where its pixels are not square.
    pub fn new(rig: &Rig) -> Self {
        let width = rig.image_px[0];
        let wide = (f64::from(width) * rig.pixel_aspect.ratio()).round() as u32;
        Self::of_width(rig, width.max(wide))
    }

    /// For a checked rig; pictures of so many pixels' width, and in proportion.
    pub fn of_width(rig: &Rig, width: u32) -> Self {
        let mechanism = Mechanism::new(rig, 0.3);
        let [w, h] = rig.image_px.map(f64::from);
        let w = w * rig.pixel_aspect.ratio();
        let zoom = f64::from(width) / w;
        // Marks as large in a picture of 4000 px as in one of 1280 px.
        let mark = (w.max(h) * zoom / 1280.0).clamp(0.4, 4.0);
        Self {
            motions: vec![Motion::default(); mechanism.links.len()],
            trails: vec![VecDeque::new(); rig.nodes.len()],
            size: [width as i32, ((h * zoom).round() as i32).max(1)],
            zoom,
            mark,
            scale: mark / zoom,
            rig: rig.clone(),
            mechanism,
        }
    }

    /// Poses that the nodes seen, the joints and the motion before give.
    fn poses(&mut self, time: f64, row: &[Observation]) -> Vec<Option<Isometry2<f64>>> {
        let n = self.mechanism.links.len();
        let mut out: Vec<Option<Isometry2<f64>>> = vec![None; n];
        let none = PredictionError { angle_rad: 0.0, origin_px: 0.0 };
        for &b in &self.mechanism.order {
            let link = &self.mechanism.links[b];
            let mut pairs: Vec<Pair> = Vec::new();
            for (&node, &local) in link.nodes.iter().zip(&link.template) {
                if row[node].x_px.is_finite() {
                    let place = self.place(&row[node]);
                    pairs.push(Pair { local, place, sigma_px: f64::from(row[node].sigma_px).max(0.01) });
                }
            }
            let held: Vec<Pair> = self
                .mechanism
                .hinges
                .iter()
                .filter(|h| h.body == b)
                .filter_map(|h| {
                    let place = match h.holder {
                        Holder::Ground(p) => p,
                        Holder::Body(o, there) => place(out[o].as_ref()?, there),
                    };
                    Some(Pair { local: h.local, place, sigma_px: 1.0 })
                })
                .collect();
            let some = !pairs.is_empty();
            pairs.extend(&held);
            if some && let Some(fit) = fit_pose(&pairs) {
                self.motions[b].add(time, &fit);
                out[b] = Some(fit.pose);
            } else if let Some(f) = self.motions[b].forecast(time, none, none) {
                out[b] = Some(held.first().map_or(f.pose, |h| hung_at(&f.pose, h.local, h.place)));
            }
        }
        out
    }

    /// Takes a frame's places over without a picture of it: motion and trails go on. Poses of the bodies.
    pub(super) fn follow(&mut self, frame: u64, row: &[Observation]) -> Vec<Option<Isometry2<f64>>> {
        for (trail, o) in self.trails.iter_mut().zip(row) {
            if o.x_px.is_finite() {
                trail.push_back(self.rig.pixel_aspect.to_square(Vector2::new(o.x_px, o.y_px)));
            }
            if trail.len() > TRAIL || (!o.x_px.is_finite() && !trail.is_empty()) {
                trail.pop_front();
            }
        }
        self.poses(frame as f64, row)
    }

    /// One frame with everything drawn. `row` is in the order of the rig's nodes.
    ///
    /// # Errors
    /// [`Error::Film`] if the frame is not of the rig's size or drawing fails.
    pub fn draw(&mut self, frame: &Frame, time_s: Option<f64>, row: &[Observation]) -> Result<Picture> {
        self.drawn(frame, time_s, row).map(Picture)
    }

    /// The drawn frame as OpenCV has it: blue, green, red.
    pub(super) fn drawn(&mut self, frame: &Frame, time_s: Option<f64>, row: &[Observation]) -> Result<Mat> {
        let poses = self.follow(frame.index, row);
        let mut picture = colour(frame, self.size)?;
        let bodies = self.rig.node_bodies();
        let s = self.scale;
        for (k, trail) in self.trails.iter().enumerate() {
            let points: Vec<Vector2<f64>> = trail.iter().copied().collect();
            for pair in points.windows(2) {
                self.stroke(&mut picture, pair[0], pair[1], bodies[k], 1.0)?;
            }
        }
        for (b, pose) in poses.iter().enumerate() {
            let Some(pose) = pose else { continue };
            let link = &self.mechanism.links[b];
            // The body as a line from joint to joint, or through its nodes.
            let mut line: Vec<Vector2<f64>> =
                self.mechanism.hinges.iter().filter(|h| h.body == b).map(|h| place(pose, h.local)).collect();
            for p in &line {
                self.ring(&mut picture, *p, 4.0 * s, [255.0; 3], 1.0)?;
            }
            if line.len() < 2 {
                line.extend(link.template.iter().map(|&t| place(pose, t)));
            }
            for pair in line.windows(2) {
                self.stroke(&mut picture, pair[0], pair[1], b, 1.0)?;
            }
            if let Some(p) = line.first() {
                self.write(
                    &mut picture,
                    &self.rig.bodies[b].name,
                    *p + Vector2::new(8.0, -8.0) * s,
                    colour_of(b),
                )?;
            }
            for (&node, &t) in link.nodes.iter().zip(&link.template) {
                if !row[node].x_px.is_finite() {
                    let p = place(pose, t);
                    let arm = 5.0 * s;
                    for d in [Vector2::new(arm, arm), Vector2::new(arm, -arm)] {
                        self.stroke(&mut picture, p - d, p + d, b, 1.0)?;
                    }
                    let open = row[node].status == Status::Ambiguous;
                    let name = format!("{}{}", self.rig.nodes[node].name, if open { "?" } else { "" });
                    self.write(&mut picture, &name, p + Vector2::new(10.0, 4.0) * s, [160.0; 3])?;
                }
            }
        }
        for (k, o) in row.iter().enumerate() {
            if o.x_px.is_finite() {
                let p = self.place(o);
                let thick = if o.status == Status::Reacquired { 3.0 } else { 1.5 };
                self.ring(&mut picture, p, 9.0 * s, colour_of(bodies[k]), thick)?;
                self.write(
                    &mut picture,
                    &self.rig.nodes[k].name,
                    p + Vector2::new(12.0, 5.0) * s,
                    colour_of(bodies[k]),
                )?;
            }
        }
        let seen = row.iter().filter(|o| o.x_px.is_finite()).count();
        let time = time_s.map_or(String::new(), |t| format!("   {t:.6} s"));
        let mut text = format!("frame {}{time}   {seen}/{}", frame.index, row.len());
        if frame.plane.is_none() {
            text.push_str("   not decoded");
        }
        self.write(&mut picture, &text, self.corner(), [255.0; 3])?;
        Ok(picture)
    }

    pub(super) fn stroke(
        &self,
        picture: &mut Mat,
        a: Vector2<f64>,
        b: Vector2<f64>,
        body: usize,
        thick: f64,
    ) -> Result<()> {
        let (Some(a), Some(b)) = (self.fine(a), self.fine(b)) else { return Ok(()) };
        let w = (thick * self.mark).round().max(1.0) as i32;
        for (colour, width) in [([20.0; 3], w + 2), (colour_of(body), w)] {
            imgproc::line(picture, a, b, scalar(colour), width, imgproc::LINE_AA, SHIFT).map_err(failed)?;
        }
        Ok(())
    }

    pub(super) fn ring(
        &self,
        picture: &mut Mat,
        at: Vector2<f64>,
        radius: f64,
        colour: [f64; 3],
        thick: f64,
    ) -> Result<()> {
        let Some(at) = self.fine(at) else { return Ok(()) };
        let r = (radius * self.zoom * f64::from(1 << SHIFT)).round() as i32;
        let w = (thick * self.mark).round().max(1.0) as i32;
        for (colour, width) in [([20.0; 3], w + 2), (colour, w)] {
            imgproc::circle(picture, at, r, scalar(colour), width, imgproc::LINE_AA, SHIFT)
                .map_err(failed)?;
        }
        Ok(())
    }

    pub(super) fn write(
        &self,
        picture: &mut Mat,
        text: &str,
        at: Vector2<f64>,
        colour: [f64; 3],
    ) -> Result<()> {
        let Some(at) = self.fine(at) else { return Ok(()) };
        let at = Point::new(at.x >> SHIFT, at.y >> SHIFT);
        // Smaller letters cannot be read.
        let size = (0.5 * self.mark).max(0.35);
        let w = self.mark.round().max(1.0) as i32;
        for (colour, width) in [([20.0; 3], w + 2), (colour, w)] {
            let font = imgproc::FONT_HERSHEY_SIMPLEX;
            imgproc::put_text(picture, text, at, font, size, scalar(colour), width, imgproc::LINE_AA, false)
                .map_err(failed)?;
        }
        Ok(())
    }

    /// A ring about something that is no node, and its number beside it.
    pub(super) fn numbered(
        &self,
        picture: &mut Mat,
        at: Vector2<f64>,
        radius_px: f64,
        number: usize,
    ) -> Result<()> {
        let radius = (radius_px + 3.0 * self.scale).max(7.0 * self.scale);
        self.ring(picture, at, radius, colour_of(number), 1.5)?;
        let beside = at + Vector2::new(radius + 2.0 * self.scale, 5.0 * self.scale);
        self.write(picture, &number.to_string(), beside, colour_of(number))
    }

    /// The place of the words about the whole picture, in square pixels.
    pub(super) fn corner(&self) -> Vector2<f64> {
        Vector2::new(12.0, 26.0) * self.scale
    }

    /// A place of the recording in square pixels.
    pub(super) fn square(&self, [x, y]: [f64; 2]) -> Vector2<f64> {
        self.rig.pixel_aspect.to_square(Vector2::new(x, y))
    }

    /// The place of a node, in square pixels.
    fn place(&self, o: &Observation) -> Vector2<f64> {
        self.rig.pixel_aspect.to_square(Vector2::new(o.x_px, o.y_px))
    }

    /// A place of the recording in OpenCV's fixed-point pixels of the picture; `None` far outside it.
    fn fine(&self, p: Vector2<f64>) -> Option<Point> {
        let k = f64::from(1 << SHIFT);
        let half = 0.5 * self.rig.pixel_aspect.ratio();
        let [x, y] = [(p.x, half), (p.y, 0.5)].map(|(v, half)| (v + half) * self.zoom - 0.5);
        (x.abs() < 1e5 && y.abs() < 1e5).then(|| Point::new((x * k).round() as i32, (y * k).round() as i32))
    }
}

fn colour_of(body: usize) -> [f64; 3] {
    COLOURS[body % COLOURS.len()]
}

fn scalar(c: [f64; 3]) -> Scalar {
    Scalar::new(c[0], c[1], c[2], 255.0)
}

#[cfg(test)]
mod tests {
    use opencv::prelude::*;

    use super::*;
    use crate::frame::PixelFormat;
    use crate::overlay::still;
    use crate::pixel_aspect::PixelAspect;
    use crate::rig::{Body, Node};

    fn rig() -> Rig {
        let node = |name: &str, x_px: f64| Node { name: name.into(), body: "b".into(), x_px, y_px: 40.0 };
        Rig {
            schema: 1,
            image_px: [128, 96],
            pixel_aspect: PixelAspect::SQUARE,
            reference_frame: None,
            region: None,
            lens: None,
            wanted: Default::default(),
            camera: None,
            bodies: vec![Body { name: "b".into() }],
            nodes: vec![node("n0", 30.0), node("n1", 90.0)],
            joints: vec![],
        }
    }

    fn frame(level: u8) -> Frame {
        Frame {
            index: 3,
            ticks: 3,
            width: 128,
            height: 96,
            stride: 128,
            format: PixelFormat::Gray8,
            depth_bits: 8,
            plane: Some(Box::new(vec![level; 128 * 96])),
            colour: None,
        }
    }

    #[test]
    fn marks_differ_from_bright_and_from_dark_ground() {
        for ground in [0_u8, 128, 255] {
            let picture = still(&frame(ground), &rig(), &[], &[]).unwrap().0;
            // On the ring of n0 something is brighter than the dark rim and something darker than the colour.
            let mut far = 0;
            for y in 28..53 {
                for x in 18..43 {
                    let p = picture.at_2d::<opencv::core::Vec3b>(y, x).unwrap();
                    far = far.max(p.0.iter().map(|&c| c.abs_diff(ground)).max().unwrap());
                }
            }
            assert!(far > 90, "ground {ground}: at most {far} from it");
        }
    }

    #[test]
    fn marks_stand_at_their_places_in_a_scaled_picture() {
        for width in [64_u32, 128, 256] {
            let mut row = vec![Observation::MISSING; 2];
            row[1] = Observation { x_px: 90.0, y_px: 70.0, status: Status::Seen, ..row[1] };
            let picture = Overlay::of_width(&rig(), width).drawn(&frame(128), None, &row).unwrap();
            assert_eq!((picture.cols(), picture.rows()), (width as i32, width as i32 * 96 / 128));
            // Above and below the marker there is its ring and nothing else.
            let zoom = f64::from(width) / 128.0;
            let (cx, cy) = (90.5 * zoom - 0.5, 70.5 * zoom - 0.5);
            let drawn = |y: i32| {
                let p = picture.at_2d::<opencv::core::Vec3b>(y, cx.round() as i32).unwrap();
                p.0.iter().any(|&c| c.abs_diff(128) > 20)
            };
            let ys: Vec<i32> = (15..picture.rows()).filter(|&y| drawn(y)).collect();
            let middle = f64::from(ys[0] + ys[ys.len() - 1]) / 2.0;
            assert!((middle - cy).abs() <= 1.0, "{width}: {middle} instead of {cy}");
        }
    }
}
