//! Spots: local maxima of what stands out, with place, size and look.
//!
//! Owns: [`Spot`], [`spots`]. Must not: know of other pictures.

use super::ground::Ground;

/// Pixels of an octave that one spot may cover; a larger one belongs to a larger octave.
const MOST_CELLS: usize = 500;
/// Part of its peak down to which a spot reaches.
const REACH: f32 = 0.5;
/// Candidates that are followed to their edge for each spot wanted: close ones turn out to be parts of a larger one.
const CANDIDATES: usize = 4;

/// One spot, in pixels of the full octave.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spot {
    /// Centre, px.
    pub x: f64,
    /// Centre, px.
    pub y: f64,
    /// Response at its peak, grey levels.
    pub peak: f64,
    /// Area above half of the peak, px.
    pub area: f64,
    /// Longer over shorter axis.
    pub elongation: f64,
    /// Direction of the longer axis, rad.
    pub direction: f64,
    /// Length of the longer axis, px.
    pub length: f64,
    /// How far it stands out, in units of the noise.
    pub snr: f64,
    /// Uncertainty of the centre beside its scatter, px: by how much it depends on the way it is found.
    pub doubt_px: f64,
}

impl Spot {
    /// Logarithms of peak and area: its look.
    pub fn look(&self) -> [f64; 2] {
        [self.peak.ln(), self.area.ln()]
    }
}

/// The strongest spots of one octave, at most `most`. `out` is what stands out in units of the noise, `response` along the
/// same direction.
pub fn spots(
    out: &[f32],
    response: &[f32],
    ground: Option<&Ground>,
    (width, height): (usize, usize),
    octave: usize,
    (limit, most): (f32, usize),
) -> Vec<Spot> {
    let mut peaks = maxima(out, width, height, limit);
    if peaks.len() > CANDIDATES * most {
        peaks.select_nth_unstable_by(CANDIDATES * most, |a, b| b.1.total_cmp(&a.1));
        peaks.truncate(CANDIDATES * most);
    }
    peaks.sort_unstable_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    let noise = |i: usize| ground.map_or(1.0, |g| g.noise(i));
    let mut label = vec![0u32; width * height];
    let mut cells: Vec<usize> = Vec::with_capacity(MOST_CELLS + 8);
    let mut found = Vec::new();
    let scale = (1usize << octave) as f64;
    for (k, &(start, snr)) in peaks.iter().enumerate() {
        if label[start] != 0 {
            continue;
        }
        let top = snr * noise(start);
        let level = REACH * top;
        cells.clear();
        cells.push(start);
        label[start] = k as u32 + 1;
        let mut next = 0;
        let mut sums = [0f64; 6];
        let (cx, cy) = ((start % width) as f64, (start / width) as f64);
        while let Some(&i) = cells.get(next) {
            next += 1;
            let (x, y) = (i % width, i / width);
            // Saturated half way up: the centre of the area rather than of the peak.
            let v = f64::from((out[i] * noise(i) - level).min(0.5 * (top - level)));
            let (dx, dy) = (x as f64 - cx, y as f64 - cy);
            for (s, m) in sums.iter_mut().zip([1.0, dx, dy, dx * dx, dx * dy, dy * dy]) {
                *s += v * m;
            }
            for yy in y.saturating_sub(1)..(y + 2).min(height) {
                for xx in x.saturating_sub(1)..(x + 2).min(width) {
                    let j = yy * width + xx;
                    if label[j] == 0 && cells.len() < MOST_CELLS && out[j] * noise(j) > level {
                        label[j] = k as u32 + 1;
                        cells.push(j);
                    }
                }
            }
        }
        let [w, x, y, xx, xy, yy] = sums;
        if cells.len() >= MOST_CELLS || w <= 0.0 {
            continue;
        }
        let (mx, my) = (x / w, y / w);
        let (a, b, c) = (xx / w - mx * mx + 1.0 / 12.0, xy / w - mx * my, yy / w - my * my + 1.0 / 12.0);
        let e = ((a - c) / 2.0).hypot(b);
        let (long, short) = ((a + c) / 2.0 + e, ((a + c) / 2.0 - e).max(0.05));
        found.push(Spot {
            x: (cx + mx + 0.5) * scale - 0.5,
            y: (cy + my + 0.5) * scale - 0.5,
            peak: f64::from(response[start].abs().max(0.1)),
            area: cells.len() as f64 * scale * scale,
            elongation: (long / short).sqrt(),
            direction: 0.5 * (2.0 * b).atan2(a - c),
            length: long.sqrt() * scale * 12f64.sqrt(),
            snr: f64::from(snr),
            doubt_px: f64::INFINITY,
        });
        if found.len() >= most {
            break;
        }
    }
    found
}

/// Local maxima above a limit, each with its value.
fn maxima(out: &[f32], width: usize, height: usize, limit: f32) -> Vec<(usize, f32)> {
    let mut peaks = Vec::new();
    for y in 0..height {
        for x in 0..width {
            let i = y * width + x;
            let v = out[i];
            if v <= limit {
                continue;
            }
            let (y0, y1) = (y.saturating_sub(1), (y + 2).min(height));
            let (x0, x1) = (x.saturating_sub(1), (x + 2).min(width));
            if (y0..y1).all(|yy| out[yy * width + x0..yy * width + x1].iter().all(|&o| o <= v)) {
                peaks.push((i, v));
            }
        }
    }
    peaks
}
