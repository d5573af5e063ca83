//! From the scene to the expected image of a frame.
//!
//! Owns: painting and the mean over the exposure. Levels are `f32`; each is right to about 1e-5 of a level.
//! Painting is from the back to the front: ground and distractors, the last link with its markers, ..., the first
//! link with its markers, glints, screens. Where edges of two things share a pixel their coverages are multiplied.

use super::Film;
use super::coverage::{Quad, disc_rectangle_area};
use super::motion::{Pose, bar};
use super::scene::{Scene, within};

/// Longest way that a marker goes between two of the instants that stand for an exposure, px. The midpoint rule
/// then errs by less than a tenth of a percent of an edge pixel's level.
const SUB_STEP_PX: f64 = 0.125;
/// Most instants of one exposure.
const MAX_INSTANTS: usize = 512;

/// Ground, light and things that stand still.
pub(crate) fn ground(scene: &Scene) -> Vec<f32> {
    let [w, h] = scene.image_px;
    let mut canvas = Canvas::new(w as usize, h as usize, scene);
    for y in 0..h as usize {
        for x in 0..w as usize {
            let [fx, fy] = canvas.fraction(x, y);
            let [gx, gy] = scene.light.background_gradient;
            let level = (scene.light.background + gx * fx + gy * fy).max(0.0);
            canvas.pixels[y * w as usize + x] = (scene.camera.black + level * canvas.light(x, y)) as f32;
        }
    }
    for d in &scene.distractors {
        canvas.disc(d.at_px, d.radius_px, d.level);
    }
    canvas.pixels
}

/// An image being painted; remembers in each row which pixels were touched.
struct Canvas<'a> {
    width: usize,
    height: usize,
    pixels: Vec<f32>,
    /// Per row the touched pixels as first..end; first >= end is none.
    touched: Vec<[usize; 2]>,
    black: f64,
    uneven: [f64; 2],
    even: bool,
    ground: Option<&'a [f32]>,
}

impl<'a> Canvas<'a> {
    fn new(width: usize, height: usize, scene: &Scene) -> Self {
        Self {
            width,
            height,
            pixels: vec![0.0; width * height],
            touched: vec![[usize::MAX, 0]; height],
            black: scene.camera.black,
            uneven: scene.light.uneven,
            even: scene.light.uneven == [0.0; 2],
            ground: None,
        }
    }

    fn on(ground: &'a [f32], width: usize, height: usize, scene: &Scene) -> Self {
        let mut canvas = Self::new(0, 0, scene);
        canvas.width = width;
        canvas.height = height;
        canvas.pixels = ground.to_vec();
        canvas.touched = vec![[usize::MAX, 0]; height];
        canvas.ground = Some(ground);
        canvas
    }

    /// Place in the image from -0.5 to 0.5.
    fn fraction(&self, x: usize, y: usize) -> [f64; 2] {
        [
            (x as f64 - 0.5 * (self.width as f64 - 1.0)) / self.width as f64,
            (y as f64 - 0.5 * (self.height as f64 - 1.0)) / self.height as f64,
        ]
    }

    fn light(&self, x: usize, y: usize) -> f64 {
        if self.even {
            return 1.0;
        }
        let [fx, fy] = self.fraction(x, y);
        1.0 + self.uneven[0] * fx + self.uneven[1] * fy
    }

    /// Pixels of one axis that `low..=high` touches, as a range.
    fn span(low: f64, high: f64, size: usize) -> std::ops::Range<usize> {
        let first = (low + 0.5).floor().max(0.0);
        let end = ((high + 0.5).floor() + 1.0).min(size as f64);
        if end <= first { 0..0 } else { first as usize..end as usize }
    }

    fn touch(&mut self, y: usize, x: &std::ops::Range<usize>) {
        let t = &mut self.touched[y];
        *t = [t[0].min(x.start), t[1].max(x.end)];
    }

    /// Puts `level` over what is there, by `coverage`.
    fn put(&mut self, x: usize, y: usize, coverage: f64, level: f64) {
        let value = self.black + level * self.light(x, y);
        let pixel = &mut self.pixels[y * self.width + x];
        *pixel = if coverage >= 1.0 {
            value as f32
        } else {
            (f64::from(*pixel) * (1.0 - coverage) + value * coverage) as f32
        };
    }

    /// Calls `paint` with each pixel of a disc and its coverage.
    fn each_of_disc(
        &mut self,
        [cx, cy]: [f64; 2],
        r: f64,
        mut paint: impl FnMut(&mut Self, usize, usize, f64),
    ) {
        for y in Self::span(cy - r, cy + r, self.height) {
            let (top, bottom) = (y as f64 - 0.5, y as f64 + 0.5);
            // The widest chord of this row.
            let near = if cy < top {
                top - cy
            } else if cy > bottom {
                cy - bottom
            } else {
                0.0
            };
            if near >= r {
                continue;
            }
            let half = (r * r - near * near).sqrt();
            let row = Self::span(cx - half, cx + half, self.width);
            self.touch(y, &row);
            for x in row {
                let px = x as f64;
                let c = disc_rectangle_area(cx, cy, r, [px - 0.5, px + 0.5], [top, bottom]);
                if c > 0.0 {
                    paint(self, x, y, c);
                }
            }
        }
    }

    fn disc(&mut self, centre: [f64; 2], r: f64, level: f64) {
        self.each_of_disc(centre, r, |canvas, x, y, c| canvas.put(x, y, c, level));
    }

    fn glint(&mut self, centre: [f64; 2], r: f64, level: f64) {
        self.each_of_disc(centre, r, |canvas, x, y, c| {
            canvas.pixels[y * canvas.width + x] += (c * level) as f32;
        });
    }

    fn quad(&mut self, quad: &Quad, level: f64) {
        let (bx, by) = quad.bounds();
        let rows = Self::span(by[0], by[1], self.height);
        // Along a row, u and v are linear in x: the row's part within each pair of sides is an interval.
        let (su, sv) = (quad.along[0], quad.across[0]);
        // A pixel reaches half its diagonal towards any side.
        let reach = std::f64::consts::FRAC_1_SQRT_2;
        for y in rows {
            let [u0, v0] = quad.local(0.0, y as f64);
            let (mut low, mut high) = (bx[0], bx[1]);
            // Between these every pixel is wholly inside.
            let (mut first, mut last) = (f64::NEG_INFINITY, f64::INFINITY);
            for (start, slope, [a, b]) in [(u0, su, quad.u), (v0, sv, quad.v)] {
                if slope.abs() < 1e-9 {
                    if start < a - reach || start > b + reach {
                        low = f64::INFINITY;
                    }
                    if start < a + 1.0 || start > b - 1.0 {
                        first = f64::INFINITY;
                    }
                    continue;
                }
                let (p, q) = ((a - reach - start) / slope, (b + reach - start) / slope);
                low = low.max(p.min(q));
                high = high.min(p.max(q));
                let (p, q) = ((a + 1.0 - start) / slope, (b - 1.0 - start) / slope);
                first = first.max(p.min(q));
                last = last.min(p.max(q));
            }
            if low > high {
                continue;
            }
            let row = Self::span(low, high, self.width);
            if row.is_empty() {
                continue;
            }
            self.touch(y, &row);
            for x in row {
                let inside = x as f64 >= first && x as f64 <= last;
                let c = if inside { 1.0 } else { quad.pixel_coverage(x as f64, y as f64) };
                if c > 0.0 {
                    self.put(x, y, c, level);
                }
            }
        }
    }

    /// Adds to `sum` what differs from the ground, `weight` times, and is the ground again.
    fn harvest(&mut self, sum: &mut [f32], weight: f32) {
        let Some(ground) = self.ground else { return };
        for y in 0..self.height {
            let [first, end] = self.touched[y];
            self.touched[y] = [usize::MAX, 0];
            if first >= end {
                continue;
            }
            let row = y * self.width + first..y * self.width + end;
            for ((s, p), g) in
                sum[row.clone()].iter_mut().zip(&mut self.pixels[row.clone()]).zip(&ground[row])
            {
                *s += (*p - *g) * weight;
                *p = *g;
            }
        }
    }
}

/// How many instants stand for the exposure of a frame: so many that no marker moves far between them.
pub(crate) fn instants(film: &Film, index: u64, poses: &mut Vec<Pose>) -> usize {
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
                place.push(poses[i].point([end, 0.0]));
            }
        }
        place
            .extend(film.scene.markers.iter().zip(&film.marker_links).map(|(m, &l)| poses[l].point(m.at_px)));
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
pub(crate) fn instant_s(exposure_s: f64, k: usize, n: usize) -> f64 {
    exposure_s * ((k as f64 + 0.5) / n as f64 - 0.5)
}

/// Expected levels of a frame before hot pixels, row by row, into `out`.
pub(crate) fn expected(film: &Film, index: u64, out: &mut Vec<f32>) {
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
            if let Some(quad) = bar(scene, i, &poses[i]) {
                canvas.quad(&quad, l.level * l.light);
            }
            for (j, m) in scene.markers.iter().enumerate() {
                if film.marker_links[j] == i && !hidden_markers[j] {
                    canvas.disc(poses[i].point(m.at_px), m.radius_px, m.level * l.light);
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
