//! The sub-pixel centre of a blob and how sure it is.
//!
//! Owns: [`Centre`], [`Window`]. Must not: decide what is a marker.

use super::levels::{Levels, Side};
use super::mask::Spans;
use super::pixels::Pixels;
use super::runs::Blob;

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
}

/// Heights around a blob, in the detector's scratch.
#[derive(Debug, Default)]
pub(crate) struct Window {
    heights: Vec<f32>,
    row: Vec<u16>,
    x0: usize,
    y0: usize,
    width: usize,
    height: usize,
    ring: Vec<f32>,
}

/// Pixels that the window reaches beyond the blob: two for the edge's foot, two for the background.
const MARGIN: usize = 4;

impl Window {
    fn load(&mut self, pixels: &Pixels<'_>, blob: &Blob) {
        self.x0 = (blob.x0 as usize).saturating_sub(MARGIN);
        self.y0 = (blob.y0 as usize).saturating_sub(MARGIN);
        self.width = (blob.x1 as usize + MARGIN + 1).min(pixels.width) - self.x0;
        self.height = (blob.y1 as usize + MARGIN + 1).min(pixels.height) - self.y0;
        self.row.resize(self.width, 0);
        self.heights.clear();
        for y in self.y0..self.y0 + self.height {
            pixels.read(y, self.x0, &mut self.row);
            self.heights.extend(self.row.iter().map(|&v| f32::from(v)));
        }
    }

    /// The centre by intensity against the local background, over a disc that reaches two pixels beyond the
    /// blob; in three rounds, each about the centre of the one before.
    pub fn weighted(&mut self, pixels: &Pixels<'_>, spans: &Spans, blob: &Blob, levels: &Levels) -> Centre {
        self.load(pixels, blob);
        let sign = levels.side.sign();
        let [mut cx, mut cy] = blob.mean();
        let reach = blob.axes().0.map(|v| 2.0 * v.sqrt());
        let radius = reach[0] + 2.0;
        let (inner, outer) = (radius * radius, (radius + 1.5).powi(2));
        let mut result = Centre::default();
        let threshold = levels.threshold(cx, cy);
        for _ in 0..3 {
            // The background is the median of a ring just outside.
            self.ring.clear();
            for (j, row) in self.heights.chunks_exact(self.width).enumerate() {
                for (i, &v) in row.iter().enumerate() {
                    let (dx, dy) = ((self.x0 + i) as f64 - cx, (self.y0 + j) as f64 - cy);
                    let q = dx * dx + dy * dy;
                    if q > inner && q <= outer && sign * (f64::from(v) - threshold) < 0.0 {
                        self.ring.push(v);
                    }
                }
            }
            let base = if self.ring.is_empty() {
                levels.background.at(cx, cy)
            } else {
                f64::from(self.ring.iter().sum::<f32>()) / self.ring.len() as f64
            };
            let (mut s, mut sx, mut sy, mut q, mut n) = (0.0, 0.0, 0.0, 0.0, 0.0);
            result.saturated = 0;
            result.peak = 0.0;
            for (j, row) in self.heights.chunks_exact(self.width).enumerate() {
                for (i, &v) in row.iter().enumerate() {
                    let (dx, dy) = ((self.x0 + i) as f64 - cx, (self.y0 + j) as f64 - cy);
                    let d = dx * dx + dy * dy;
                    if d > inner || !spans.holds(self.x0 + i, self.y0 + j) {
                        continue;
                    }
                    let v = f64::from(v);
                    let h = sign * (v - base);
                    s += h;
                    sx += h * dx;
                    sy += h * dy;
                    n += 0.5 * d;
                    q += 0.5 * d * levels.noise.variance(v);
                    result.peak = result.peak.max(h);
                    result.saturated += u32::from(levels.saturation.is_some_and(|l| match levels.side {
                        Side::Bright => v >= l,
                        Side::Dark => v <= l,
                    }));
                }
            }
            if s <= 0.0 {
                break;
            }
            // The background's own error moves nothing while the disc is whole.
            let _ = n;
            cx += sx / s;
            cy += sy / s;
            result.sigma_px = q.sqrt() / s;
        }
        result.x_px = cx;
        result.y_px = cy;
        result
    }
}
