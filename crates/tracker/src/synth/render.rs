//! Makes the image of a frame: what is expected of it, and what a camera records of that.
//!
//! Owns: the order of painting and the mean over the exposure. Levels are `f32`; each is right to about 1e-5 of a level.
//! Painting is from the back to the front: ground and distractors, the last link with its markers, ..., the first
//! link with its markers, glints, screens. Where edges of two things share a pixel their coverages are multiplied.

use super::canvas::Canvas;
use super::coverage::Quad;
use super::film::Film;
use super::motion::Pose;
use super::noise;
use super::scene::within;
use crate::frame::Frame;

/// Longest way that a marker goes between two of the instants that stand for an exposure, px. The midpoint rule
/// then errs by less than a tenth of a percent of an edge pixel's level.
const SUB_STEP_PX: f64 = 0.125;
/// Most instants of one exposure.
const MAX_INSTANTS: usize = 512;

/// The instants that stand for the exposure of a frame: so many that no marker moves far between them.
pub(super) fn instants(film: &Film, index: u64, poses: &mut Vec<Pose>) -> usize {
    let exposure = film.scene.camera.exposure_s;
    if exposure <= 0.0 {
        return 1;
    }
    let t = film.time_s(index);
    // Two halves, so that a marker which turns back within the exposure is seen to move.
    let mut places: [Vec<[f64; 2]>; 3] = Default::default();
    for (k, place) in places.iter_mut().enumerate() {
        film.mechanism.poses(t + exposure * (0.5 * k as f64 - 0.5), poses);
        for (i, l) in film.scene.links.iter().enumerate() {
            for end in l.along_px {
                place.push(film.seen(poses[i].point([end, 0.0])));
            }
        }
        let markers = film.scene.markers.iter().zip(&film.marker_links);
        place.extend(markers.map(|(m, &l)| film.seen(poses[l].point(m.at_px))));
    }
    let way = (0..places[0].len())
        .map(|i| {
            let [a, b, c] = [places[0][i], places[1][i], places[2][i]];
            (b[0] - a[0]).hypot(b[1] - a[1]) + (c[0] - b[0]).hypot(c[1] - b[1])
        })
        .fold(0.0, f64::max);
    ((way / SUB_STEP_PX).ceil() as usize).clamp(1, MAX_INSTANTS)
}

/// Middle of instant `k` of `n`, s after the frame's time.
pub(super) fn instant_s(exposure_s: f64, k: usize, n: usize) -> f64 {
    exposure_s * ((k as f64 + 0.5) / n as f64 - 0.5)
}

/// Expected levels of a frame before hot pixels, row by row, into `out`.
fn expected(film: &Film, index: u64, out: &mut Vec<f32>) {
    let scene = &film.scene;
    let [w, h] = scene.image_px.map(|v| v as usize);
    out.clear();
    if scene.dropouts.iter().any(|d| within(index, d.first, d.count)) {
        out.resize(w * h, scene.camera.black as f32);
        return;
    }
    out.extend_from_slice(&film.ground);
    let mut poses = Vec::new();
    let n = instants(film, index, &mut poses);
    let hidden_links = film.hidden_links(index);
    let hidden_markers = film.hidden_markers(index);
    let mut canvas = Canvas::on(&film.ground, w, h, scene);
    for k in 0..n {
        film.mechanism.poses(film.time_s(index) + instant_s(scene.camera.exposure_s, k, n), &mut poses);
        for i in (0..scene.links.len()).rev() {
            if hidden_links[i] {
                continue;
            }
            let l = &scene.links[i];
            if let Some(quad) = film.seen_bar(i, &poses[i]) {
                canvas.quad(&quad, l.level * l.light);
            }
            for (j, m) in scene.markers.iter().enumerate() {
                if film.marker_links[j] == i && !hidden_markers[j] {
                    let at = poses[i].point(m.at_px);
                    canvas.disc(film.seen(at), m.radius_px * film.scale(at), m.level * l.light);
                }
            }
        }
        for g in film.glints_at(index) {
            canvas.glint(g.at_px, g.radius_px, g.level);
        }
        for s in &scene.screens {
            let [x0, y0, x1, y1] = s.edges_px;
            let quad =
                Quad { origin: [0.0, 0.0], along: [1.0, 0.0], across: [0.0, 1.0], u: [x0, x1], v: [y0, y1] };
            canvas.quad(&quad, s.level);
        }
        canvas.harvest(out, 1.0 / n as f32);
    }
}

impl Film {
    /// Expected levels of a frame, row by row, into `out` (cleared first): what the mean over many recordings would
    /// be without saturation and rounding. See [`noise`].
    pub fn expected(&self, index: u64, out: &mut Vec<f32>) {
        expected(self, index, out);
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
            colour: None,
        }
    }
}
