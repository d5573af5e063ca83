//! Packs the pixels near the edge of a disc one after another.
//!
//! Owns: [`Patch`], [`Ring`], [`EdgeLookup`]. Must not: decide which pixels count.
//!
//! Lengths are in units of sqrt(area of a pixel), so that a disc is round where pixels are not square.

use super::edge_table::Spot;
use crate::detect::simd::lanes::{Eight, Job, LANES, work};

/// A rectangle of pixels, raw units; behind the last pixel come [`LANES`] more values that mean nothing.
pub(crate) struct Patch<'a> {
    pub values: &'a [f32],
    pub width: usize,
    pub height: usize,
    /// Values from the start of one row to the next.
    pub stride: usize,
    /// Image coordinates of its first pixel.
    pub x0: f64,
    pub y0: f64,
    /// Width and height of a pixel.
    pub sides: [f64; 2],
}

/// Offsets of a vector's numbers from its first: columns where pixels are packed, rows where circles are cut.
const OFFSETS: [f32; LANES] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];

/// Parts of a row between two circles: left and right of the inner one.
const PARTS: usize = 2;

/// The edge table's values for eight pixels of a ring, kept so that look-up and accumulation are two loops: a processor
/// then overlaps more of the work.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct EdgeLookup {
    pub(super) spot: Spot,
    /// Direction from the disc's centre to the pixel: a disc that moves that way covers more of the pixel.
    pub(super) normal: [[f32; LANES]; 2],
    /// Coverage and its slopes by x, y, radius and path, of a disc that moves.
    pub(super) sums: [[f32; LANES]; 6],
}

/// Pixels of a ring about the edge of a disc, one array for each quantity: place relative to the first guess of the centre,
/// value (raw units; the disc fit turns those of dark markers round and cuts all at saturation), and 1 where the pixel counts,
/// else 0.
#[derive(Debug, Default)]
pub(crate) struct Ring {
    pub x: Vec<f32>,
    pub y: Vec<f32>,
    pub value: Vec<f32>,
    pub live: Vec<f32>,
    /// Number of pixels; those that fill up the last vector do not count.
    pub used: usize,
    /// Saturated pixels, counted by the disc fit.
    pub saturated: u32,
    /// Lookups in the edge table, a vector of pixels each: scratch of the normal equations.
    pub eights: Vec<EdgeLookup>,
}

impl Ring {
    /// Takes the pixels between two distances from a centre.
    pub fn choose(&mut self, patch: &Patch<'_>, centre: [f64; 2], inner: f64, outer: f64) {
        work(Choose { patch, centre, inner, outer, ring: self });
    }

    /// Empties the ring and makes room for `most` pixels.
    fn begin(&mut self, most: usize) {
        for lanes in [&mut self.x, &mut self.y, &mut self.value, &mut self.live] {
            if lanes.len() < most {
                lanes.resize(most, 0.0);
            }
        }
        let eights = most.div_ceil(LANES);
        if self.eights.len() < eights {
            self.eights.resize(eights, EdgeLookup::default());
        }
        self.used = 0;
        self.saturated = 0;
    }

    /// `count` pixels of a row from `values` on, the first at `x` and each `wide`; up to seven beyond are written too
    /// and then overwritten by those that follow.
    #[inline(always)]
    fn push<V: Eight>(&mut self, token: V::Token, [x, y]: [f32; 2], wide: f32, values: &[f32], count: usize) {
        let (steps, y) = (V::load(token, &OFFSETS) * V::splat(token, wide), V::splat(token, y).array());
        for k in (0..count).step_by(LANES) {
            let (at, first) = (self.used + k, x + k as f32 * wide);
            let to = at..at + LANES;
            self.x[to.clone()].copy_from_slice(&(V::splat(token, first) + steps).array());
            self.y[to.clone()].copy_from_slice(&y);
            self.value[to].copy_from_slice(&values[k..k + LANES]);
        }
        self.used += count;
    }
}

/// The job of [`Ring::choose`].
struct Choose<'a> {
    patch: &'a Patch<'a>,
    centre: [f64; 2],
    inner: f64,
    outer: f64,
    ring: &'a mut Ring,
}

impl Job for Choose<'_> {
    type Outcome = ();

    #[inline(always)]
    fn run<V: Eight>(self, token: V::Token) {
        let Self { patch, centre: [cx, cy], outer, inner, ring } = self;
        let all = |v: f64| V::splat(token, v as f32);
        let [wide, high] = patch.sides;
        let (left, above) = (cx - patch.x0, cy - patch.y0);
        let first = ((above - outer).max(0.0) / high) as usize;
        let last = (((above + outer).max(0.0) / high) as usize + 1).min(patch.height);
        // Each of a row's two parts may write up to a vector beyond its end.
        ring.begin(last.saturating_sub(first) * (patch.width + PARTS * LANES));
        let (zero, width) = (all(0.0), all(patch.width as f64));
        // Index of the first pixel right of x.
        let right_of =
            |x: V| (x * all(1.0 / wide) + all(1.0)).max(zero).min(width).trunc().map(|i| i as usize);
        for eight in (first..last).step_by(LANES) {
            let dy = all(eight as f64 * high - above) + V::load(token, &OFFSETS) * all(high);
            let half = |r: f64| (all(r * r) - dy * dy).max(zero).sqrt();
            let (far, near, middle) = (half(outer), half(inner), all(left));
            let (left_outer, left_inner) = (right_of(middle - far), right_of(middle - near));
            let (right_inner, right_outer) = (right_of(middle + near), right_of(middle + far));
            let dy = dy.array();
            for j in eight..last.min(eight + LANES) {
                let k = j - eight;
                // Left and right of the inner circle, or the whole chord where the row misses that circle.
                let parts = if left_inner[k] < right_inner[k] {
                    [(left_outer[k], left_inner[k]), (right_inner[k], right_outer[k])]
                } else {
                    [(left_outer[k], right_outer[k]), (0, 0)]
                };
                for (from, to) in parts {
                    if from < to {
                        let values = &patch.values[j * patch.stride + from..];
                        let first = [(from as f64 * wide - left) as f32, dy[k]];
                        ring.push::<V>(token, first, wide as f32, values, to - from);
                    }
                }
            }
        }
        // Those that fill up the last eight do not count.
        let used = ring.used;
        ring.live[..used].fill(1.0);
        ring.live[used..used.next_multiple_of(LANES)].fill(0.0);
    }
}
