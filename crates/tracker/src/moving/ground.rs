//! The still ground of a response: what each place answers through most of the recording, and its noise.
//!
//! Owns: [`Ground`]. Must not: find anything.

use rayon::prelude::*;

use super::response::{Direction, Response};

/// Pictures that teach the ground, spread over the recording.
pub const PICTURES: usize = 31;
/// Part of the pictures that may show a marker at rest before it is taken for ground: 1 less this. A marker may rest for up to
/// 65 % of a recording.
const QUANTILE: f64 = 0.35;
/// Standard deviation over median absolute deviation of normal noise.
const SIGMA_OVER_MAD: f32 = 1.4826;
/// Least noise of the full octave, grey levels: rounding to whole levels, as the response sees it.
const LEAST_NOISE: f32 = 0.25;

/// The ground of one octave along one direction.
#[derive(Debug, Clone)]
pub struct Ground {
    /// Low quantile of the response, against which bright markers stand out, and the high one, for dark markers.
    low: Vec<f32>,
    high: Vec<f32>,
    /// One over the noise.
    inverse_noise: Vec<f32>,
}

impl Ground {
    /// From responses of one octave in several pictures.
    pub fn learn(samples: &[Response], direction: Direction, octave: usize) -> Self {
        let count = samples.first().map_or(0, |r| r.width * r.height);
        let n = samples.len();
        let rank = |part: f64| (part * (n - 1) as f64).round() as usize;
        let (low_rank, middle_rank, high_rank) = (rank(QUANTILE), rank(0.5), rank(1.0 - QUANTILE));
        let all: Vec<[f32; 4]> = (0..count)
            .into_par_iter()
            .map_init(
                || vec![0f32; n],
                |values, i| {
                    for (v, r) in values.iter_mut().zip(samples) {
                        let [y, b, d] = r.at(i);
                        *v = direction.of(y, b, d);
                    }
                    values.sort_unstable_by(f32::total_cmp);
                    let (low, middle, high) = (values[low_rank], values[middle_rank], values[high_rank]);
                    for v in values.iter_mut() {
                        *v = (*v - middle).abs();
                    }
                    let (_, mad, _) = values.select_nth_unstable_by(middle_rank, f32::total_cmp);
                    [low, high, SIGMA_OVER_MAD * *mad, middle]
                },
            )
            .collect();
        let mut scatter: Vec<f32> = all.iter().map(|a| a[2]).collect();
        let usual = if scatter.is_empty() {
            1.0
        } else {
            let k = scatter.len() / 2;
            *scatter.select_nth_unstable_by(k, f32::total_cmp).1
        };
        let usual = usual.max(LEAST_NOISE / (1 + octave) as f32);
        // Where a marker passes or light flickers the scatter is larger; no more of it counts than tells a busy place.
        let inverse_noise = all.iter().map(|a| 1.0 / usual.hypot(0.5 * a[2].min(6.0 * usual))).collect();
        Self {
            low: all.iter().map(|a| a[0]).collect(),
            high: all.iter().map(|a| a[1]).collect(),
            inverse_noise,
        }
    }

    /// The response that is new against the ground, in units of the noise: for bright markers (`sign` 1) or dark ones (-1).
    pub fn standing_out(&self, response: &[f32], sign: f32) -> Vec<f32> {
        let ground = if sign > 0.0 { &self.low } else { &self.high };
        response
            .iter()
            .zip(ground)
            .zip(&self.inverse_noise)
            .map(|((&l, &g), &i)| (sign * l).min(sign * (l - g)) * i)
            .collect()
    }

    /// The response against its surroundings, new or not, in units of the noise.
    pub fn against_noise(&self, response: &[f32], sign: f32) -> Vec<f32> {
        response.iter().zip(&self.inverse_noise).map(|(&l, &i)| sign * l * i).collect()
    }

    /// Noise of a place, grey levels.
    pub fn noise(&self, i: usize) -> f32 {
        1.0 / self.inverse_noise[i]
    }
}

/// `count` indices spread evenly over `n`.
pub fn spread(n: usize, count: usize) -> Vec<usize> {
    let mut all: Vec<usize> =
        (0..count).map(|k| (k as f64 * (n - 1) as f64 / (count.max(2) - 1) as f64) as usize).collect();
    all.dedup();
    all
}
