//! The recording with nodes, names, bodies, trails and gaps drawn into it, as pictures.
//!
//! Owns: [`Overlay`], [`still`], [`film`]. Must not: track: it draws what a table says.
//!
//! Every stroke has a dark rim, so that it is read on bright and on dark ground.

use std::collections::VecDeque;
use std::path::Path;
use std::sync::Arc;

use nalgebra::{Isometry2, Vector2};
use opencv::core::{Mat, Point, Scalar, Vector};
use opencv::prelude::*;
use opencv::{imgcodecs, imgproc};

use crate::detect::{DetectSettings, Detection, Detector, Levels};
use crate::error::{Error, Fault, Place, Result};
use crate::film::encode::{Codec, VideoSettings, VideoWriter};
use crate::frame::{Frame, PixelFormat, TimeBase};
use crate::pipeline::{Observer, Stage};
use crate::rig::Rig;
use crate::source::{self, OpenOptions};
use crate::table::NodeTable;
use crate::track::mechanism::{Holder, Mechanism};
use crate::track::predict::{Motion, Unrest, hung_at};
use crate::track::rigid::{Pair, fit_pose, place};
use crate::track::{Observation, Status};

/// Frames that a trail is long.
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

fn failed(e: opencv::Error) -> Error {
    Error::Film(Fault::new("overlay", format!("drawing failed ({e})")))
}

/// Draws frame after frame of one recording.
pub struct Overlay {
    rig: Rig,
    mechanism: Mechanism,
    motions: Vec<Motion>,
    trails: Vec<VecDeque<Vector2<f64>>>,
    scale: f64,
}

impl Overlay {
    /// For a checked rig.
    pub fn new(rig: &Rig) -> Self {
        let mechanism = Mechanism::new(rig, 0.3);
        Self {
            motions: vec![Motion::default(); mechanism.links.len()],
            trails: vec![VecDeque::new(); rig.nodes.len()],
            // Marks as large in a picture of 4000 px as in one of 1280 px.
            scale: (f64::from(rig.image_px[0].max(rig.image_px[1])) / 1280.0).clamp(0.4, 4.0),
            rig: rig.clone(),
            mechanism,
        }
    }

    /// Poses that the nodes seen, the joints and the motion before give.
    fn poses(&mut self, time: f64, row: &[Observation]) -> Vec<Option<Isometry2<f64>>> {
        let n = self.mechanism.links.len();
        let mut out: Vec<Option<Isometry2<f64>>> = vec![None; n];
        let none = Unrest { angle_rad: 0.0, origin_px: 0.0 };
        for &b in &self.mechanism.order {
            let link = &self.mechanism.links[b];
            let mut pairs: Vec<Pair> = Vec::new();
            for (&node, &local) in link.nodes.iter().zip(&link.template) {
                if row[node].x_px.is_finite() {
                    let place = Vector2::new(row[node].x_px, row[node].y_px);
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

    /// One frame with everything drawn: 8-bit blue, green, red. `row` is in the order of the rig's nodes.
    ///
    /// # Errors
    /// [`Error::Film`] if the frame is not of the rig's size or drawing fails.
    pub fn draw(&mut self, frame: &Frame, time_s: Option<f64>, row: &[Observation]) -> Result<Mat> {
        let mut picture = colour(frame)?;
        let poses = self.poses(frame.index as f64, row);
        let bodies = self.rig.node_bodies();
        for (trail, o) in self.trails.iter_mut().zip(row) {
            if o.x_px.is_finite() {
                trail.push_back(Vector2::new(o.x_px, o.y_px));
            }
            if trail.len() > TRAIL || (!o.x_px.is_finite() && !trail.is_empty()) {
                trail.pop_front();
            }
        }
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
                let p = Vector2::new(o.x_px, o.y_px);
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
        self.write(&mut picture, &text, Vector2::new(12.0, 26.0) * s, [255.0; 3])?;
        Ok(picture)
    }

    fn stroke(
        &self,
        picture: &mut Mat,
        a: Vector2<f64>,
        b: Vector2<f64>,
        body: usize,
        thick: f64,
    ) -> Result<()> {
        let (Some(a), Some(b)) = (fine(a), fine(b)) else { return Ok(()) };
        let w = (thick * self.scale).round().max(1.0) as i32;
        for (colour, width) in [([20.0; 3], w + 2), (colour_of(body), w)] {
            imgproc::line(picture, a, b, scalar(colour), width, imgproc::LINE_AA, SHIFT).map_err(failed)?;
        }
        Ok(())
    }

    fn ring(
        &self,
        picture: &mut Mat,
        at: Vector2<f64>,
        radius: f64,
        colour: [f64; 3],
        thick: f64,
    ) -> Result<()> {
        let Some(at) = fine(at) else { return Ok(()) };
        let r = (radius * f64::from(1 << SHIFT)).round() as i32;
        let w = (thick * self.scale).round().max(1.0) as i32;
        for (colour, width) in [([20.0; 3], w + 2), (colour, w)] {
            imgproc::circle(picture, at, r, scalar(colour), width, imgproc::LINE_AA, SHIFT)
                .map_err(failed)?;
        }
        Ok(())
    }

    fn write(&self, picture: &mut Mat, text: &str, at: Vector2<f64>, colour: [f64; 3]) -> Result<()> {
        if fine(at).is_none() {
            return Ok(());
        }
        let at = Point::new(at.x.round() as i32, at.y.round() as i32);
        let size = 0.5 * self.scale;
        let w = self.scale.round().max(1.0) as i32;
        for (colour, width) in [([20.0; 3], w + 2), (colour, w)] {
            let font = imgproc::FONT_HERSHEY_SIMPLEX;
            imgproc::put_text(picture, text, at, font, size, scalar(colour), width, imgproc::LINE_AA, false)
                .map_err(failed)?;
        }
        Ok(())
    }
}

fn colour_of(body: usize) -> [f64; 3] {
    COLOURS[body % COLOURS.len()]
}

fn scalar(c: [f64; 3]) -> Scalar {
    Scalar::new(c[0], c[1], c[2], 255.0)
}

/// A place in OpenCV's fixed-point pixels; `None` far outside any picture.
fn fine(p: Vector2<f64>) -> Option<Point> {
    let k = f64::from(1 << SHIFT);
    (p.x.abs() < 1e5 && p.y.abs() < 1e5)
        .then(|| Point::new((p.x * k).round() as i32, (p.y * k).round() as i32))
}

/// The frame's brightness as an 8-bit picture of three channels; black where it could not be decoded. Deep
/// recordings are shown by their upper 8 bits.
fn colour(frame: &Frame) -> Result<Mat> {
    let (w, h) = (frame.width as usize, frame.height as usize);
    let gray = gray8(frame)?;
    let mat = Mat::from_slice(&gray).map_err(failed)?;
    let mat = mat.reshape(1, h as i32).map_err(failed)?;
    debug_assert_eq!(mat.cols() as usize, w);
    let mut out = Mat::default();
    imgproc::cvt_color_def(&mat, &mut out, imgproc::COLOR_GRAY2BGR).map_err(failed)?;
    Ok(out)
}

/// Samples of a frame by their upper 8 bits, row by row.
fn gray8(frame: &Frame) -> Result<Vec<u8>> {
    let (w, h) = (frame.width as usize, frame.height as usize);
    let Some(plane) = &frame.plane else { return Ok(vec![0; w * h]) };
    let bytes = plane.bytes();
    let short = || {
        Error::Film(Fault::new(
            "overlay",
            format!("a frame of {} bytes is too short for {w} x {h}", bytes.len()),
        ))
    };
    let down = frame.depth_bits.saturating_sub(8);
    let shown = |v: u32| (v >> down).min(255) as u8;
    let mut out = Vec::with_capacity(w * h);
    match frame.format {
        PixelFormat::Gray8 => {
            for y in 0..h {
                out.extend_from_slice(bytes.get(y * frame.stride..y * frame.stride + w).ok_or_else(short)?);
            }
        }
        PixelFormat::Gray16 => {
            for y in 0..h {
                let row = bytes.get(y * frame.stride..y * frame.stride + 2 * w).ok_or_else(short)?;
                out.extend(row.chunks_exact(2).map(|b| shown(u32::from(u16::from_le_bytes([b[0], b[1]])))));
            }
        }
        PixelFormat::Packed10 | PixelFormat::Packed12 => {
            let bits = frame.format.bits_per_pixel() as usize;
            for y in 0..h {
                for x in 0..w {
                    let first =
                        if frame.stride == 0 { (y * w + x) * bits } else { y * frame.stride * 8 + x * bits };
                    let mut v = 0_u32;
                    // A sample touches two bytes at most for 10 and 12 bits.
                    for k in 0..2 {
                        v = v << 8 | u32::from(*bytes.get(first / 8 + k).ok_or_else(short)?);
                    }
                    out.push(shown(v >> (16 - first % 8 - bits) & ((1 << bits) - 1)));
                }
            }
        }
    }
    Ok(out)
}

/// Writes a picture; its kind is known by the ending of `path`.
///
/// # Errors
/// [`Error::Film`] if the ending is not known or the file cannot be written.
pub fn save(picture: &Mat, path: &Path) -> Result<()> {
    let name = path.display().to_string();
    let ending = path.extension().map_or_else(String::new, |e| format!(".{}", e.to_string_lossy()));
    let mut bytes: Vector<u8> = Vector::new();
    let done = imgcodecs::imencode_def(&ending, picture, &mut bytes).unwrap_or(false);
    if !done {
        return Err(Error::Film(
            Fault::new(&name, format!("pictures cannot be written as {ending:?}")).advice("Name it .png"),
        ));
    }
    std::fs::write(path, bytes.as_slice())
        .map_err(|e| Error::Film(Fault::new(&name, format!("the picture cannot be written ({e})"))))
}

/// A still of the reference frame with the rig drawn, and marks on detections that are no node.
///
/// # Errors
/// As [`Overlay::draw`].
pub fn still(frame: &Frame, rig: &Rig, detections: &[Detection]) -> Result<Mat> {
    let mut row = vec![Observation::MISSING; rig.nodes.len()];
    for (o, n) in row.iter_mut().zip(&rig.nodes) {
        o.x_px = n.x_px;
        o.y_px = n.y_px;
        o.sigma_px = 0.1;
        o.area_px = 1.0;
        o.status = Status::Seen;
    }
    let mut overlay = Overlay::new(rig);
    let mut picture = overlay.draw(frame, None, &row)?;
    for d in detections {
        let p = Vector2::new(d.x_px, d.y_px);
        if rig.nodes.iter().all(|n| (Vector2::new(n.x_px, n.y_px) - p).norm() > 3.0) {
            overlay.ring(&mut picture, p, 6.0 * overlay.scale, [128.0; 3], 1.0)?;
        }
    }
    Ok(picture)
}

/// The picture as planes of brightness and half-size colour (I420, full range), for an encoder. The last row and
/// column are left out where there is no even number of them.
///
/// # Errors
/// [`Error::Film`] if OpenCV fails.
pub fn planes(picture: &Mat) -> Result<Vec<u8>> {
    let (w, h) = (picture.cols() & !1, picture.rows() & !1);
    let even = picture.roi(opencv::core::Rect::new(0, 0, w, h)).map_err(failed)?.clone_pointee();
    let mut out = Mat::default();
    imgproc::cvt_color_def(&even, &mut out, imgproc::COLOR_BGR2YUV_I420).map_err(failed)?;
    let mut planes = out.data_bytes().map_err(failed)?.to_vec();
    // OpenCV gives television levels (16 to 235, colour 16 to 240); the film says full range.
    let (luma, chroma) = planes.split_at_mut((w * h) as usize);
    let stretch = |v: f64| v.round().clamp(0.0, 255.0) as u8;
    let of_luma: Vec<u8> = (0..256).map(|v| stretch((f64::from(v) - 16.0) * 255.0 / 219.0)).collect();
    let of_chroma: Vec<u8> =
        (0..256).map(|v| stretch((f64::from(v) - 128.0) * 255.0 / 224.0 + 128.0)).collect();
    luma.iter_mut().for_each(|v| *v = of_luma[usize::from(*v)]);
    chroma.iter_mut().for_each(|v| *v = of_chroma[usize::from(*v)]);
    Ok(planes)
}

/// How the film with the drawings is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FilmSettings {
    /// Frames a second at which it plays.
    pub play_fps: u32,
    /// x264's constant rate factor.
    pub quality: u32,
}

impl Default for FilmSettings {
    fn default() -> Self {
        Self { play_fps: 30, quality: 20 }
    }
}

/// Writes the recording with its table drawn into it. Frames that the table does not have are left out.
///
/// # Errors
/// [`Error::Source`] if the recording cannot be read, [`Error::Table`] if it is not the table's,
/// [`Error::Film`] if the film cannot be written, [`Error::Interrupted`] if the observer asks to stop.
pub fn film(
    input: &str,
    open: &OpenOptions,
    table: &NodeTable,
    output: &Path,
    settings: &FilmSettings,
    observer: &mut dyn Observer,
) -> Result<()> {
    let rig = &table.meta.rig;
    let n = rig.nodes.len();
    let mut source = source::open(input, open)?;
    let [w, h] = rig.image_px;
    let info = source.info();
    if [info.width, info.height] != [w, h] {
        return Err(Error::Table(
            Fault::new(input, format!("{} x {} px, the table is of {w} x {h} px", info.width, info.height))
                .advice("Give the recording that the table was made from"),
        ));
    }
    let mut writer = VideoWriter::create(
        output,
        &VideoSettings {
            width: w & !1,
            height: h & !1,
            depth_bits: 8,
            time_base: TimeBase { numerator: 1, denominator: u64::from(settings.play_fps.max(1)) },
            codec: Codec::H264,
            quality: Some(settings.quality),
            speed: Some("veryfast".into()),
            gray_only: false,
        },
    )?;
    observer.stage(Stage::Track, Some(table.frames() as u64));
    let mut overlay = Overlay::new(rig);
    let mut t = 0;
    while let Some(frame) = source.next_frame()? {
        while t < table.frames() && (table.rows.frame[t] as u64) < frame.index {
            t += 1;
        }
        if t == table.frames() {
            break;
        }
        if table.rows.frame[t] as u64 != frame.index {
            continue;
        }
        let row: Vec<Observation> =
            (0..n).map(|k| table.rows.observation(t, k, n).unwrap_or(Observation::MISSING)).collect();
        let picture = overlay.draw(&frame, Some(table.rows.time_s[t]), &row)?;
        writer.write_i420(&planes(&picture)?)?;
        observer.progress(t as u64);
        if observer.interrupted() {
            writer.finish()?;
            return Err(Error::Interrupted);
        }
    }
    writer.finish()
}

/// A frame of a recording and what is detected in it.
///
/// # Errors
/// Those of the source and of detection; [`Error::Source`] if there is no such frame.
pub fn frame_at(
    input: &str,
    open: &OpenOptions,
    detect: &DetectSettings,
    index: u64,
) -> Result<(Frame, Vec<Detection>)> {
    let mut source = source::open(input, open)?;
    let levels = Levels::learn(&source.sample(24)?, detect)?;
    let mut detections = Vec::new();
    while let Some(frame) = source.next_frame()? {
        if frame.index == index {
            Detector::new(Arc::new(levels), detect)?.detect(&frame, &mut detections)?;
            return Ok((frame, detections));
        }
    }
    Err(Error::Source(Fault::new(input, "it ends before this frame").at(Place::Frame(index))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::{Body, Node};

    fn rig() -> Rig {
        let node = |name: &str, x_px: f64| Node { name: name.into(), body: "b".into(), x_px, y_px: 40.0 };
        Rig {
            schema: 1,
            image_px: [128, 96],
            reference_frame: None,
            region: None,
            lens: None,
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
        }
    }

    #[test]
    fn marks_differ_from_bright_and_from_dark_ground() {
        for ground in [0_u8, 128, 255] {
            let picture = still(&frame(ground), &rig(), &[]).unwrap();
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
    fn packed_samples_are_shown_by_their_upper_bits() {
        // 0xABC and 0x123 in three bytes.
        let f = Frame {
            index: 0,
            ticks: 0,
            width: 2,
            height: 1,
            stride: 0,
            format: PixelFormat::Packed12,
            depth_bits: 12,
            plane: Some(Box::new(vec![0xAB, 0xC1, 0x23])),
        };
        assert_eq!(gray8(&f).unwrap(), [0xAB, 0x12]);
    }
}
