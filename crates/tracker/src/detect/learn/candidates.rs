//! Chooses polarity and threshold: tries both and judges them by the blobs that come.
//!
//! Owns: the choice. Must not: find centres.

use rayon::prelude::*;

use super::background::Background;
use crate::detect::label::components::{Blob, Labeller};
use crate::detect::label::plan::Plan;
use crate::detect::pixels::Pixels;
use crate::detect::settings::Polarity;
use crate::frame::PixelFormat;

/// Sample images and what is known of them.
pub(crate) struct Field<'a> {
    pub images: &'a [Vec<u16>],
    pub width: usize,
    pub height: usize,
    /// Width and height of a pixel.
    pub pixel_sides: [f64; 2],
    pub background: &'a Background,
    /// Noise variance of the background.
    pub read: f64,
}

impl Field<'_> {
    /// Stride over the sample images.
    fn step(&self) -> usize {
        self.images.len().div_ceil(FRAMES).max(1)
    }
}

/// A blob that looks like a marker.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Candidate {
    /// Pixels beyond the threshold.
    pub area: f64,
    /// Height of its upper quarter above the background, raw units.
    pub contrast: f64,
    /// The blob, and the sample image it is in.
    pub blob: Blob,
    pub image: usize,
    /// How much it counts for its threshold.
    pub weight: f64,
}

/// The best choice and the blobs it gives.
pub(crate) struct Choice {
    pub polarity: Polarity,
    pub height: f64,
    pub blobs: Vec<Candidate>,
}

/// Frames in which thresholds are tried.
const FRAMES: usize = 6;
/// Thresholds tried for each polarity.
const STEPS: usize = 20;

/// Heights above the background as an image of their own, as bytes of 16-bit samples.
fn heights(field: &Field<'_>, image: &[u16], polarity: Polarity) -> Vec<u8> {
    let flat = field.background.is_flat();
    let level = field.background.median();
    // Rounded, and 0 below the background.
    let height = |v: u16, b: f64| (polarity.sign() * (f64::from(v) - b) + 0.5) as u16;
    let of_level: Vec<u16> =
        if flat { (0..=u16::MAX).map(|v| height(v, level)).collect() } else { Vec::new() };
    let mut bytes = Vec::with_capacity(image.len() * 2);
    for (y, row) in image.chunks_exact(field.width).enumerate() {
        if flat {
            bytes.extend(row.iter().flat_map(|&v| of_level[usize::from(v)].to_le_bytes()));
        } else {
            bytes.extend(
                row.iter()
                    .enumerate()
                    .flat_map(|(x, &v)| height(v, field.background.at(x as f64, y as f64)).to_le_bytes()),
            );
        }
    }
    bytes
}

/// The polarity and height whose blobs look most like markers; `fixed` is a threshold in raw units.
pub(crate) fn best(field: &Field<'_>, polarities: &[Polarity], fixed: Option<f64>) -> Option<Choice> {
    let sigma = field.read.sqrt();
    let fields: Vec<(Polarity, Vec<Vec<u8>>, f64)> = polarities
        .iter()
        .map(|&polarity| {
            let maps: Vec<Vec<u8>> =
                field.images.par_iter().step_by(field.step()).map(|i| heights(field, i, polarity)).collect();
            let top = top_height(&maps);
            (polarity, maps, top)
        })
        .collect();
    let highest = fields.iter().map(|f| f.2).fold(0.0, f64::max);
    let mut found: Option<(f64, Choice)> = None;
    for (polarity, maps, top) in &fields {
        let fixed = fixed.map(|t| polarity.sign() * (t - field.background.median()));
        if fixed.is_some_and(|h| h <= 0.0) {
            continue;
        }
        let low = (4.0 * sigma).max(2.0);
        if fixed.is_none() && *top <= low {
            continue;
        }
        let tried: Vec<f64> = match fixed {
            Some(h) => vec![h],
            None => {
                (0..STEPS).map(|i| low * (0.97 * top / low).powf(i as f64 / (STEPS - 1) as f64)).collect()
            }
        };
        let mut trials: Vec<(f64, f64, Vec<Candidate>)> = tried
            .par_iter()
            .map(|&h| {
                let blobs = markers(field, maps, h, sigma);
                let score = blobs.iter().map(|b| b.weight * b.contrast / highest).sum();
                (h, score, blobs)
            })
            .collect();
        let best = (0..trials.len()).max_by(|&a, &b| trials[a].1.total_cmp(&trials[b].1))?;
        let score = trials[best].1;
        if score <= 0.0 || found.as_ref().is_some_and(|f| f.0 >= score) {
            continue;
        }
        // The stretch of thresholds that are nearly as good; inside it, half of the height of a weak marker.
        let good = |i: &usize| trials[*i].1 >= 0.97 * score;
        let first = (0..=best).rev().take_while(good).last().unwrap_or(best);
        let last = (best..trials.len()).take_while(good).last().unwrap_or(best);
        let weak = weighted_quantile(&trials[best].2, |b| b.contrast, 0.1);
        let height = (0.5 * weak).max((4.0 * sigma).min(0.7 * weak)).clamp(trials[first].0, trials[last].0);
        let blobs =
            if fixed.is_some() { trials.swap_remove(best).2 } else { markers(field, maps, height, sigma) };
        if !blobs.is_empty() {
            found = Some((score, Choice { polarity: *polarity, height, blobs }));
        }
    }
    found.map(|f| f.1)
}

/// The value below which a part of the blobs lies, each counted by its contrast and weight: a few faint blobs
/// that are no markers pull nothing, a link half as bright as the other does.
pub(crate) fn weighted_quantile(blobs: &[Candidate], value: impl Fn(&Candidate) -> f64, part: f64) -> f64 {
    let mut all: Vec<(f64, f64)> = blobs.iter().map(|b| (value(b), b.contrast * b.weight)).collect();
    all.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let total: f64 = all.iter().map(|b| b.1).sum();
    let mut below = 0.0;
    for &(v, weight) in &all {
        below += weight;
        if below >= part * total {
            return v;
        }
    }
    all.last().map_or(0.0, |b| b.0)
}

/// The height that a few pixels of each frame exceed: above single hot pixels.
fn top_height(maps: &[Vec<u8>]) -> f64 {
    let counts = maps.par_iter().map(|map| {
        let mut counts = vec![0usize; 65536];
        for b in map.chunks_exact(2) {
            counts[usize::from(u16::from_le_bytes([b[0], b[1]]))] += 1;
        }
        counts
    });
    let counts = counts.reduce_with(|mut all, one| {
        all.iter_mut().zip(one).for_each(|(a, b)| *a += b);
        all
    });
    let mut seen = 0;
    for (h, n) in counts.as_deref().unwrap_or_default().iter().enumerate().rev() {
        seen += n;
        if seen >= 12 * maps.len() {
            return h as f64;
        }
    }
    0.0
}

/// Blobs at a height that are compact, not small, and steep at their edge.
fn markers(field: &Field<'_>, maps: &[Vec<u8>], height: f64, sigma: f64) -> Vec<Candidate> {
    let threshold = height.ceil().clamp(1.0, 65535.0) as u16;
    let plan = Plan::uniform(field.width, field.height, threshold, Polarity::Bright);
    let most = field.width * field.height / 5;
    let mut labeller = Labeller::default();
    let mut blobs: Vec<Blob> = Vec::new();
    let mut all = Vec::new();
    for (k, map) in maps.iter().enumerate() {
        let image = k * field.step();
        let pixels = Pixels::of_samples(map, field.width, field.height, PixelFormat::Gray16);
        labeller.find(&pixels, &plan, Polarity::Bright, &mut blobs);
        for blob in &blobs {
            let area = blob.area as usize;
            if !(5..=most).contains(&area)
                || blob.elongation(field.pixel_sides) > 6.0
                || blob.fill(field.pixel_sides) < 0.7
            {
                continue;
            }
            if let Some(c) = judge(&pixels, blob, threshold, sigma, image) {
                all.push(c);
            }
        }
    }
    all
}

fn judge(pixels: &Pixels<'_>, blob: &Blob, threshold: u16, sigma: f64, image: usize) -> Option<Candidate> {
    let mut values: Vec<u16> = Vec::new();
    let mut row = vec![0; (blob.x1 - blob.x0 + 1) as usize];
    for y in blob.y0..=blob.y1 {
        pixels.read(y as usize, blob.x0 as usize, &mut row);
        values.extend(row.iter().filter(|&&v| v >= threshold));
    }
    if values.is_empty() {
        return None;
    }
    values.sort_unstable();
    let upper = f64::from(values[(values.len() - 1) * 3 / 4]);
    if upper - f64::from(threshold) < 1.5 * sigma {
        return None;
    }
    // Of a steep blob most pixels are above the middle between the threshold and its top.
    let middle = (upper + f64::from(threshold)) / 2.0;
    let above = values.iter().filter(|&&v| f64::from(v) >= middle).count() as f64 / values.len() as f64;
    let border = if blob.border { 0.3 } else { 1.0 };
    let area = blob.area as f64;
    Some(Candidate { area, contrast: upper, blob: *blob, image, weight: above * border * area.sqrt() })
}
