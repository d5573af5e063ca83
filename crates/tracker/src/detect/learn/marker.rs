//! Learns what a marker of this recording looks like (radius, blur of its edge) and the noise on it.
//!
//! Owns: [`learn`], [`Sample`]. Must not: choose a threshold.

use rayon::prelude::*;

use crate::detect::centre::disc_fit::{DiscFit, Fitted};
use crate::detect::centre::edge_table::EdgeTable;
use crate::detect::centre::normal_equations::DiscModel;
use crate::detect::centre::window::Window;
use crate::detect::label::components::Blob;
use crate::detect::marker::{LARGEST_MISFIT, Marker};
use crate::detect::noise::Noise;
use crate::detect::pixels::Pixels;
use crate::detect::quantile::{quantile, sorted};
use crate::detect::settings::Polarity;

/// A blob in one of the sample frames.
pub(crate) struct Sample<'a> {
    pub pixels: Pixels<'a>,
    pub blob: Blob,
}

/// Blurs that are tried, px.
const BLURS_PX: [f64; 8] = [0.0, 0.15, 0.3, 0.45, 0.6, 0.8, 1.1, 1.5];
/// Band beside the edge while learning, px.
const BAND_PX: f64 = 1.5;
/// Longer over shorter axis up to which a blob may be a disc, smeared a little.
const ROUND: f64 = 1.4;
/// Blobs that are fitted; more would change nothing.
const MOST: usize = 60;

/// Learns the marker and the noise from blobs of pixels of the given sides; `None` where they are no discs.
#[expect(clippy::too_many_lines, reason = "the steps of one estimate, in order")]
pub(crate) fn learn(
    samples: &[Sample<'_>],
    polarity: Polarity,
    noise: Noise,
    saturation: Option<f64>,
    sides: [f64; 2],
) -> Option<(Marker, Noise)> {
    let step = samples.len().div_ceil(MOST).max(1);
    // Only what may be a disc teaches what discs look like.
    let samples: Vec<&Sample<'_>> = samples
        .iter()
        .step_by(step)
        .filter(|s| !s.blob.border && s.blob.elongation(sides) < ROUND && s.blob.fill(sides) > 0.85)
        .collect();
    let areas = sorted(samples.iter().map(|s| s.blob.area as f64));
    let radius = (quantile(&areas, 0.5) / std::f64::consts::PI).sqrt();
    if samples.is_empty() || radius < 1.2 {
        return None;
    }
    let read = noise.read;
    let fits = |table: &EdgeTable, noise: Noise| -> Vec<(usize, Fitted)> {
        let fit = DiscFit {
            model: DiscModel { table, noise, polarity, saturation },
            band_px: BAND_PX,
            usual_chi2: 1.0,
        };
        (0..samples.len())
            .into_par_iter()
            .map_init(
                || Window::new(sides),
                |window, i| window.fit(&samples[i].pixels, &samples[i].blob, &fit, [None; 2]).map(|f| (i, f)),
            )
            .flatten()
            .filter(|(_, f)| f.rms < LARGEST_MISFIT * f.height.abs() + 2.0 * read.sqrt())
            .collect()
    };
    // Step 1: the blur whose discs fit best, first on the list, then between its neighbours.
    let misfit = |blur: f64, radius: f64| -> f64 {
        let table = EdgeTable::new(radius, blur, sides);
        let found = fits(&table, noise);
        if found.len() * 3 < samples.len() * 2 {
            return f64::INFINITY;
        }
        let squares = sorted(found.iter().map(|(_, f)| f.chi2));
        quantile(&squares, 0.5)
    };
    let tried: Vec<f64> = BLURS_PX.par_iter().map(|&b| misfit(b, radius)).collect();
    let best = (0..tried.len()).min_by(|&a, &b| tried[a].total_cmp(&tried[b]))?;
    if !tried[best].is_finite() {
        return None;
    }
    let (mut low, mut high) =
        (BLURS_PX[best.saturating_sub(1)], BLURS_PX[(best + 1).min(BLURS_PX.len() - 1)]);
    while high - low > 0.02 {
        let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if misfit(a, radius) <= misfit(b, radius) {
            high = b;
        } else {
            low = a;
        }
    }
    let blur =
        if best == 0 && tried[0] <= misfit((low + high) / 2.0, radius) { 0.0 } else { (low + high) / 2.0 };

    // Step 2: with that blur, the noise inside and outside of the discs.
    let table = EdgeTable::new(radius, blur, sides);
    let found = fits(&table, noise);
    let mut flat = [Vec::new(), Vec::new()];
    let fit = DiscFit {
        model: DiscModel { table: &table, noise, polarity, saturation },
        band_px: BAND_PX,
        usual_chi2: 1.0,
    };
    let mut window = Window::new(sides);
    for (i, f) in &found {
        window.flat_variances(&samples[*i].pixels, &samples[*i].blob, f, &fit, &mut flat);
    }
    let mut noise = noise;
    let [outside, inside] = flat.map(|v| sorted(v.into_iter()));
    if outside.len() >= 5 {
        noise.read = quantile(&outside, 0.5).max(1.0 / 12.0);
    }
    let heights = sorted(found.iter().map(|(_, f)| f.height.abs()));
    let bases = sorted(found.iter().map(|(_, f)| f.base));
    if inside.len() >= 5 {
        let rise = quantile(&heights, 0.5);
        // For dark markers the ground is the brighter side.
        let within = quantile(&inside, 0.5);
        let (dark, bright) = match polarity {
            // Light only adds noise, so what is more around a marker than inside is no noise: the edge of its link.
            Polarity::Bright => (noise.read.min(within), within),
            Polarity::Dark => (within, noise.read),
        };
        noise.read = dark.max(1.0 / 12.0);
        noise.shot = ((bright - dark) / rise.max(1.0)).max(0.0);
        noise.dark = match polarity {
            Polarity::Bright => quantile(&bases, 0.5),
            Polarity::Dark => quantile(&bases, 0.5) - rise,
        };
    }

    // Step 3: once more with that noise, for what is typical.
    let found = fits(&table, noise);
    let radii = sorted(found.iter().map(|(_, f)| f.radius_px));
    let squares = sorted(found.iter().map(|(_, f)| f.chi2));
    let radius = quantile(&radii, 0.5);
    Some((
        Marker {
            radius_px: radius,
            radius_spread: (quantile(&radii, 0.9) - quantile(&radii, 0.1)) / 2.0 / radius,
            blur_px: blur,
            chi2: quantile(&squares, 0.5),
            chi2_high: quantile(&squares, 0.9),
        },
        noise,
    ))
}
