//! Computes the sub-pixel centre of a blob and its uncertainty from the pixels around it.
//!
//! Owns: [`Centre`], [`Window`]. Must not: decide what is a marker.
//!
//! A disc is a circle in the world, not in pixels that are wider than high: places are in recorded pixels, but lengths
//! (radii, paths, uncertainties) are in units of sqrt(area of a pixel).

use super::disc::Disc;
use super::disc_fit::{DiscFit, Fitted, LEAST_PATH_PX, Start};
use super::edge_pixels::{Patch, Ring};
use crate::detect::label::components::Blob;
use crate::detect::label::mask::Spans;
use crate::detect::levels::Levels;
use crate::detect::pixels::Pixels;
use crate::detect::settings::Polarity;
use crate::detect::simd::lanes::{Eight, Job, LANES, work};

/// A centre and what was seen on the way to it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Centre {
    pub x_px: f64,
    pub y_px: f64,
    pub sigma_px: f64,
    /// Largest height above the local background, raw units.
    pub peak: f64,
    /// Pixels at the end of the recording's range.
    pub saturated: u32,
    /// The disc, if one was fitted.
    pub fitted: Option<Fitted>,
    /// Whether brightness falls and rises again on the way along it.
    pub parted: bool,
}

/// Heights around a blob, in the detector's scratch.
#[derive(Debug)]
pub(crate) struct Window {
    /// Width and height of a pixel.
    sides: [f64; 2],
    heights: Vec<f32>,
    row: Vec<u16>,
    x0: usize,
    y0: usize,
    width: usize,
    height: usize,
    /// Values from the start of one row to the next: whole eights, of which those behind the last pixel mean nothing.
    stride: usize,
    ground: Vec<f32>,
    ring: Ring,
}

/// Floor of the centroid's uncertainty, px: pixel-phase bias of a small sharp blob (measured in `tests/accuracy`).
const SHAPE_PX: f64 = 0.01;
/// Distance, px, and part of the radius within which the moments' disc must agree with the blob to begin the fit from it.
const NEAR_PX: f64 = 0.5;
const NEAR_RADIUS: f64 = 0.2;
/// Ratio of chi-square to the usual one from which a path is tried: five standard deviations of chi-square over some
/// hundred pixels, and worth the time.
const SMEARED_CHI2: f64 = 1.6;
/// Ratio of chi-square with a path to that without below which the path is believed.
const SMEARED_GAIN: f64 = 0.7;
/// Distance beyond the blurred edge, on both sides, at which base and top are first looked at, px.
const BEYOND_EDGE_PX: f64 = 0.7;

/// Longer over shorter axis from which a blob may be two beside each other.
const LONG: f64 = 1.6;
/// Height of a gap between two markers, as a part of the lower one's: blurred edges that touch fill half of it.
const GAP: f64 = 0.6;
/// Stretches along a blob.
const STRETCHES: usize = 48;

/// Rounds of the centroid, each about the centre of the one before.
const CENTROID_ROUNDS: usize = 3;

/// Pixels that the window reaches beyond the blob: two for the edge's foot, two for the background.
const MARGIN: usize = 4;

impl Window {
    /// For pixels of the given sides.
    pub fn new(sides: [f64; 2]) -> Self {
        Self {
            sides,
            heights: Vec::new(),
            row: Vec::new(),
            x0: 0,
            y0: 0,
            width: 0,
            height: 0,
            stride: 0,
            ground: Vec::new(),
            ring: Ring::default(),
        }
    }

    /// From a place to the middle of pixel (i, j) of the window.
    fn way(&self, [i, j]: [usize; 2], x: f64, y: f64) -> [f64; 2] {
        [((self.x0 + i) as f64 - x) * self.sides[0], ((self.y0 + j) as f64 - y) * self.sides[1]]
    }

    fn load(&mut self, pixels: &Pixels<'_>, blob: &Blob, margin: usize) {
        let [across, down] = self.sides.map(|side| (margin as f64 / side).ceil() as usize);
        self.x0 = (blob.x0 as usize).saturating_sub(across);
        self.y0 = (blob.y0 as usize).saturating_sub(down);
        self.width = (blob.x1 as usize + across + 1).min(pixels.width) - self.x0;
        self.height = (blob.y1 as usize + down + 1).min(pixels.height) - self.y0;
        self.stride = self.width.next_multiple_of(LANES);
        self.heights.resize(self.height * self.stride + LANES, 0.0);
        let (from, size) = ([self.x0, self.y0], [self.width, self.height]);
        pixels.floats(from, size, &mut self.row, &mut self.heights);
    }

    /// Rows of the window.
    fn rows(&self) -> impl Iterator<Item = &[f32]> {
        self.heights[..self.height * self.stride].chunks_exact(self.stride).map(|row| &row[..self.width])
    }

    /// Middle of the values at eight places around (cx, cy) at a distance; `None` where all lie outside.
    fn around(&self, cx: f64, cy: f64, distance: f64) -> Option<f64> {
        let mut values = [0.0f32; 8];
        let mut n = 0;
        let (left, above) = (cx - self.x0 as f64 + 0.5, cy - self.y0 as f64 + 0.5);
        for (dx, dy) in [
            (1.0, 0.0),
            (0.7, 0.7),
            (0.0, 1.0),
            (-0.7, 0.7),
            (-1.0, 0.0),
            (-0.7, -0.7),
            (0.0, -1.0),
            (0.7, -0.7),
        ] {
            let (i, j) = (left + distance * dx / self.sides[0], above + distance * dy / self.sides[1]);
            if i >= 0.0 && j >= 0.0 && (i as usize) < self.width && (j as usize) < self.height {
                values[n] = self.heights[j as usize * self.stride + i as usize];
                n += 1;
            }
        }
        if n == values.len() {
            return Some(f64::from(middle(values)));
        }
        values[..n].sort_unstable_by(f32::total_cmp);
        (n > 0).then(|| f64::from(values[(n - 1) / 2] + values[n / 2]) / 2.0)
    }

    /// The disc with the window's first moments above the base, and of that height.
    fn moments(&self, base: f64, height: f64) -> Disc {
        let values = &self.heights[..self.height * self.stride];
        let [sum, sum_x, sum_y] = work(Sums { values, width: self.width, stride: self.stride });
        let (w, h) = (self.width as f64, self.height as f64);
        let ground = base * w * h;
        let light = sum - ground;
        let x = (sum_x - ground * (w - 1.0) / 2.0) / light;
        let y = (sum_y - ground * (h - 1.0) / 2.0) / light;
        Disc {
            x_px: self.x0 as f64 + x,
            y_px: self.y0 as f64 + y,
            radius_px: (light / height / std::f64::consts::PI).max(0.0).sqrt(),
        }
    }

    /// A disc fitted to a blob's edge, smeared along a path where that explains it better; `None` where none
    /// fits. `avoid` are discs of neighbours.
    pub fn fit(
        &mut self,
        pixels: &Pixels<'_>,
        blob: &Blob,
        fit: &DiscFit<'_>,
        avoid: [Option<Disc>; 2],
    ) -> Option<Fitted> {
        self.load(pixels, blob, (fit.model.table.reach_px + fit.band_px + 1.0).ceil() as usize);
        let whole = Disc::of_area(blob.mean(), blob.area as f64);
        let mut start = self.start(fit, whole, avoid)?;
        // Of a disc alone on its ground moments are so near that one round is enough.
        let found = self.moments(start.base, start.height);
        let near = (found.x_px - whole.x_px).abs() < NEAR_PX
            && (found.y_px - whole.y_px).abs() < NEAR_PX
            && (found.radius_px / whole.radius_px - 1.0).abs() < NEAR_RADIUS;
        if near && avoid == [None; 2] {
            start.disc = found;
        }
        let sharp = self.run(fit, &start)?;
        if sharp.chi2 < SMEARED_CHI2 * fit.usual_chi2.max(1.0) {
            return Some(sharp);
        }
        let Some(smear_px) = self.smear(&sharp) else { return Some(sharp) };
        let path = smear_px[0].hypot(smear_px[1]);
        self.load(pixels, blob, (fit.model.table.reach_px + fit.band_px + path / 2.0 + 1.0).ceil() as usize);
        let start = Start { disc: sharp.disc(), base: sharp.base, height: sharp.height, smear_px, avoid };
        match self.run(fit, &start) {
            Some(smeared) if smeared.chi2 < SMEARED_GAIN * sharp.chi2 => Some(smeared),
            _ => Some(sharp),
        }
    }

    /// One of two discs in a blob, whose pixels are kept out of it.
    pub fn fit_beside(
        &mut self,
        pixels: &Pixels<'_>,
        blob: &Blob,
        fit: &DiscFit<'_>,
        disc: Disc,
        other: Disc,
    ) -> Option<Fitted> {
        self.load(pixels, blob, (fit.model.table.reach_px + fit.band_px + 1.0).ceil() as usize);
        let start = self.start(fit, disc, [Some(other), None])?;
        self.run(fit, &start)
    }

    fn run(&mut self, fit: &DiscFit<'_>, start: &Start) -> Option<Fitted> {
        let patch = Patch {
            values: &self.heights,
            width: self.width,
            stride: self.stride,
            height: self.height,
            x0: self.x0 as f64 * self.sides[0],
            y0: self.y0 as f64 * self.sides[1],
            sides: self.sides,
        };
        let [wide, high] = self.sides;
        let scaled = |d: Disc| Disc { x_px: d.x_px * wide, y_px: d.y_px * high, ..d };
        let start = Start { disc: scaled(start.disc), avoid: start.avoid.map(|d| d.map(scaled)), ..*start };
        let mut fitted = fit.fit(&patch, &start, &mut self.ring)?;
        fitted.x_px /= wide;
        fitted.y_px /= high;
        Some(fitted)
    }

    fn start(&self, fit: &DiscFit<'_>, disc: Disc, avoid: [Option<Disc>; 2]) -> Option<Start> {
        let Disc { x_px: cx, y_px: cy, radius_px: radius } = disc;
        let base = self.around(cx, cy, radius + fit.model.table.reach_px + BEYOND_EDGE_PX)?;
        let top = self.around(cx, cy, (radius - fit.model.table.reach_px - BEYOND_EDGE_PX).max(0.0))?;
        Some(Start { disc, base, height: top - base, smear_px: [0.0; 2], avoid })
    }

    /// The path that would give a disc its second moments: along the longer axis the variance grows by a
    /// twelfth of the path's square. `None` where it is too short to be seen or longer than the disc.
    fn smear(&self, disc: &Fitted) -> Option<[f64; 2]> {
        let outer = (disc.radius_px + 3.0).powi(2);
        let (mut s, mut xx, mut xy, mut yy, mut sx, mut sy) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        for (j, row) in self.rows().enumerate() {
            for (i, &v) in row.iter().enumerate() {
                let [dx, dy] = self.way([i, j], disc.x_px, disc.y_px);
                if dx * dx + dy * dy <= outer {
                    let h = (f64::from(v) - disc.base) / disc.height;
                    s += h;
                    sx += h * dx;
                    sy += h * dy;
                    xx += h * dx * dx;
                    xy += h * dx * dy;
                    yy += h * dy * dy;
                }
            }
        }
        if s <= 0.0 {
            return None;
        }
        let (mx, my) = (sx / s, sy / s);
        let (xx, xy, yy) = (xx / s - mx * mx, xy / s - mx * my, yy / s - my * my);
        let twice = (xx - yy).hypot(2.0 * xy);
        let path = (12.0 * twice).sqrt();
        let angle = 0.5 * (2.0 * xy).atan2(xx - yy);
        (path > LEAST_PATH_PX && path < 2.0 * disc.radius_px)
            .then(|| [path * angle.cos(), path * angle.sin()])
    }

    /// Variances of the pixels just outside and just inside of a fitted disc's edge, appended to `flat`.
    pub fn flat_variances(
        &mut self,
        pixels: &Pixels<'_>,
        blob: &Blob,
        fitted: &Fitted,
        fit: &DiscFit<'_>,
        flat: &mut [Vec<f64>; 2],
    ) {
        let reach = fit.model.table.reach_px + fitted.smear_px[0].hypot(fitted.smear_px[1]) / 2.0;
        self.load(pixels, blob, (reach + 3.0).ceil() as usize);
        let mut sums = [[0.0; 3]; 2];
        for (j, row) in self.rows().enumerate() {
            for (i, &v) in row.iter().enumerate() {
                let [dx, dy] = self.way([i, j], fitted.x_px, fitted.y_px);
                let inside = fitted.radius_px - dx.hypot(dy);
                let v = f64::from(v);
                let lost = fit.model.saturated(v);
                if inside.abs() > reach && inside.abs() < reach + 2.0 && !lost {
                    let s = &mut sums[usize::from(inside > 0.0)];
                    let h = v - fitted.base - if inside > 0.0 { fitted.height } else { 0.0 };
                    s[0] += 1.0;
                    s[1] += h;
                    s[2] += h * h;
                }
            }
        }
        for (s, f) in sums.iter().zip(flat) {
            if s[0] >= 12.0 {
                f.push((s[2] - s[1] * s[1] / s[0]) / (s[0] - 1.0));
            }
        }
    }

    /// Whether heights above the ground fall below [`GAP`] of those on both sides somewhere along the
    /// blob's longer axis, near that axis.
    fn parted(&self, blob: &Blob, ground: f64, sign: f64) -> bool {
        let ([mx, my], [ax, ay]) = (blob.mean(), blob.direction(self.sides));
        // Of a bar, 0.92 of its length, so that what comes behind its ends is left out; 0.55 of its width.
        let [long, short] = blob.axes(self.sides).map(|v| 1.6 * v.sqrt());
        let mut sums = [[0.0; 2]; STRETCHES];
        for (j, row) in self.rows().enumerate() {
            for (i, &v) in row.iter().enumerate() {
                let [dx, dy] = self.way([i, j], mx, my);
                let along = ((dx * ax + dy * ay) / long + 1.0) / 2.0 * STRETCHES as f64;
                if (dx * ay - dy * ax).abs() < 0.6 * short && (0.0..STRETCHES as f64).contains(&along) {
                    let s = &mut sums[along as usize];
                    s[0] += sign * (f64::from(v) - ground);
                    s[1] += 1.0;
                }
            }
        }
        let (mut highest, mut lowest_since) = (0.0f64, f64::INFINITY);
        for h in sums.iter().filter(|s| s[1] > 0.0).map(|s| (s[0] / s[1]).max(0.0)) {
            if lowest_since < GAP * highest.min(h) {
                return true;
            }
            if h > highest {
                (highest, lowest_since) = (h, f64::INFINITY);
            }
            lowest_since = lowest_since.min(h);
        }
        false
    }

    /// The centre by intensity against the local background, over a disc that reaches two pixels beyond the
    /// blob; in three rounds, each about the centre of the one before.
    pub fn weighted(&mut self, pixels: &Pixels<'_>, spans: &Spans, blob: &Blob, levels: &Levels) -> Centre {
        self.load(pixels, blob, MARGIN);
        let sign = levels.polarity.sign();
        let [mut cx, mut cy] = blob.mean();
        let reach = blob.axes(self.sides).map(|v| 2.0 * v.sqrt());
        let radius = reach[0] + 2.0;
        let (inner, outer) = (radius * radius, (radius + 1.5).powi(2));
        // Where all in all nothing rises above the background there is no centre by intensity: the marker is then somewhere
        // in the blob's box, with the standard uncertainty of an even distribution over its longer side.
        let side_px = f64::from((blob.x1 - blob.x0).max(blob.y1 - blob.y0) + 1);
        let anywhere_px = (side_px / 12f64.sqrt()).hypot(SHAPE_PX);
        let mut result = Centre::default();
        let threshold = levels.threshold(cx, cy);
        let mut ground = std::mem::take(&mut self.ground);
        for _ in 0..CENTROID_ROUNDS {
            // The background is the mean of a ring just outside.
            ground.clear();
            for (j, row) in self.rows().enumerate() {
                for (i, &v) in row.iter().enumerate() {
                    let [dx, dy] = self.way([i, j], cx, cy);
                    let q = dx * dx + dy * dy;
                    if q > inner && q <= outer && sign * (f64::from(v) - threshold) < 0.0 {
                        ground.push(v);
                    }
                }
            }
            let base = if ground.is_empty() {
                levels.background.at(cx, cy)
            } else {
                f64::from(ground.iter().sum::<f32>()) / ground.len() as f64
            };
            let (mut s, mut sx, mut sy, mut q) = (0.0, 0.0, 0.0, 0.0);
            result.saturated = 0;
            result.peak = 0.0;
            for (j, row) in self.rows().enumerate() {
                for (i, &v) in row.iter().enumerate() {
                    let [dx, dy] = self.way([i, j], cx, cy);
                    let d = dx * dx + dy * dy;
                    if d > inner || !spans.holds(self.x0 + i, self.y0 + j) {
                        continue;
                    }
                    let v = f64::from(v);
                    let h = sign * (v - base);
                    s += h;
                    sx += h * dx;
                    sy += h * dy;
                    q += 0.5 * d * levels.noise.variance(v);
                    result.peak = result.peak.max(h);
                    result.saturated += u32::from(levels.saturation.is_some_and(|l| match levels.polarity {
                        Polarity::Bright => v >= l,
                        Polarity::Dark => v <= l,
                    }));
                }
            }
            let moved = (sx / s).hypot(sy / s);
            if s <= 0.0 || moved > radius {
                [cx, cy] = blob.mean();
                result.sigma_px = anywhere_px;
                break;
            }
            // The background's own error moves nothing while the disc is whole.
            cx += sx / s / self.sides[0];
            cy += sy / s / self.sides[1];
            result.sigma_px = (q.sqrt() / s).hypot(SHAPE_PX);
        }
        self.ground = ground;
        result.parted =
            blob.elongation(self.sides) > LONG && self.parted(blob, threshold - sign * levels.height, sign);
        result.x_px = cx;
        result.y_px = cy;
        result
    }
}

/// Middle of eight values: the mean of the fourth and the fifth in order. Two sorted fours, of which the greater half is
/// the greater of each value and its opposite.
fn middle(values: [f32; 8]) -> f32 {
    let order = |a: f32, b: f32| if a < b { (a, b) } else { (b, a) };
    let four = |v: [f32; 4]| {
        let ((a, b), (c, d)) = (order(v[0], v[1]), order(v[2], v[3]));
        let ((a, c), (b, d)) = (order(a, c), order(b, d));
        let (b, c) = order(b, c);
        [a, b, c, d]
    };
    let [a, b, c, d, e, f, g, h] = values;
    let (one, two) = (four([a, b, c, d]), four([e, f, g, h]));
    let pairs: [(f32, f32); 4] = std::array::from_fn(|i| order(one[i], two[3 - i]));
    let lower = pairs.iter().fold(f32::NEG_INFINITY, |m, p| if p.0 > m { p.0 } else { m });
    let upper = pairs.iter().fold(f32::INFINITY, |m, p| if p.1 < m { p.1 } else { m });
    (lower + upper) / 2.0
}

/// Sums of values, of values by column and of values by row, from the window's corner.
struct Sums<'a> {
    values: &'a [f32],
    width: usize,
    stride: usize,
}

impl Job for Sums<'_> {
    type Outcome = [f64; 3];

    #[inline(always)]
    fn run<V: Eight>(self, token: V::Token) -> [f64; 3] {
        let mut sums = [0.0; 3];
        // Eight columns after eight.
        for left in (0..self.width).step_by(LANES) {
            let (mut plain, mut by_row) = (V::splat(token, 0.0), V::splat(token, 0.0));
            let (mut j, one) = (V::splat(token, 0.0), V::splat(token, 1.0));
            for row in self.values.chunks_exact(self.stride) {
                if let Some(eight) = row[left..].first_chunk() {
                    let v = V::load(token, eight);
                    plain += v;
                    by_row += v * j;
                    j += one;
                }
            }
            let columns = plain.array().into_iter().zip(by_row.array()).take(self.width - left);
            for (i, (plain, by_row)) in columns.enumerate() {
                sums[0] += f64::from(plain);
                sums[1] += f64::from(plain) * (left + i) as f64;
                sums[2] += f64::from(by_row);
            }
        }
        sums
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    #[test]
    fn the_middle_of_eight_is_that_of_the_sorted() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for _ in 0..2000 {
            // With ties.
            let values: [f32; 8] = std::array::from_fn(|_| rng.random_range(0..9u8).into());
            let mut sorted = values;
            sorted.sort_unstable_by(f32::total_cmp);
            assert_eq!(middle(values), (sorted[3] + sorted[4]) / 2.0, "{values:?}");
        }
    }
}
