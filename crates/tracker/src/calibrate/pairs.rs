//! Estimates a camera from pairs of markers that may keep their distance.
//!
//! Owns: [`calibrate`]. Must not: know of bodies, poses or joints.
//!
//! Least squares on the logarithm of a pair's distance in the plane less its mean over time: neither lengths nor poses are
//! unknowns. Pairs that are no pairs of one body are weighed down (Cauchy), at first only those that are off by far.

use nalgebra::{Matrix5, Vector2, Vector5};
use rayon::prelude::*;

use crate::camera::{Camera, NUMBERS};
use crate::error::Result;
use crate::stop::Stop;

/// Scatter of the logarithms beside the noise, from stage to stage: pairs that keep their distance to 5 % lead to a camera under
/// which fewer do by chance.
const SCATTER: [f64; 5] = [0.05, 0.02, 0.008, 0.003, 0.0];
/// Steps of a stage, and of the last one.
const STEPS: usize = 6;
const LAST_STEPS: usize = 30;
/// Residual at which half of the weight is lost, in standard uncertainties.
const CAUCHY: f64 = 2.0;
/// Standard deviations of the numbers before anything was seen: no camera that films a mechanism is farther off.
const LOOSE: [f64; NUMBERS] = [0.05, 0.05, 0.15, 0.15, 0.25];
/// Bounds of the numbers.
pub(super) const MOST: [f64; NUMBERS] = [0.12, 0.12, 0.25, 0.25, 0.5];
/// Longest step of a number.
const LONGEST_STEP: f64 = 0.1;
/// Step at which the estimate stands.
const STANDS: f64 = 1e-8;

/// The places of two markers in one frame, in square pixels.
#[derive(Debug, Clone, Copy)]
pub struct PairPlace {
    /// The one.
    pub first: Vector2<f64>,
    /// The other.
    pub second: Vector2<f64>,
}

/// Two markers over time.
#[derive(Debug, Clone)]
pub struct Pair {
    /// Frame by frame.
    pub places: Vec<PairPlace>,
    /// Usual distance, px.
    pub distance_px: f64,
    /// Standard uncertainty of each coordinate, px.
    pub sigma_px: f64,
}

/// One pair's part in a step.
struct Part {
    normal: Matrix5<f64>,
    right: Vector5<f64>,
}

/// Logarithms of the distance and their slopes by the camera's numbers.
fn logs(pair: &Pair, camera: &Camera) -> Vec<(f64, Vector5<f64>)> {
    pair.places
        .iter()
        .map(|p| {
            let (a, b) = (camera.slopes(p.first), camera.slopes(p.second));
            let d = a.place - b.place;
            let square = d.norm_squared().max(1e-9);
            (0.5 * square.ln(), (a.by_numbers - b.by_numbers).transpose() * d / square)
        })
        .collect()
}

/// The mean that is least moved by those far from it.
fn centre(logs: &[(f64, Vector5<f64>)], spread: f64) -> f64 {
    let mut values: Vec<f64> = logs.iter().map(|l| l.0).collect();
    let (_, middle, _) = values.select_nth_unstable_by(logs.len() / 2, f64::total_cmp);
    let mut mean = *middle;
    for _ in 0..3 {
        let (mut sum, mut weights) = (0.0, 0.0);
        for (l, _) in logs {
            let w = cauchy((l - mean) / spread);
            sum += w * l;
            weights += w;
        }
        mean = sum / weights;
    }
    mean
}

fn cauchy(residual: f64) -> f64 {
    1.0 / (1.0 + (residual / CAUCHY).powi(2))
}

fn part(pair: &Pair, camera: &Camera, scatter: f64) -> Part {
    let logs = logs(pair, camera);
    let noise = std::f64::consts::SQRT_2 * pair.sigma_px / pair.distance_px;
    let spread = noise.hypot(scatter);
    let mean = centre(&logs, spread);
    let (mut weights, mut slope) = (0.0, Vector5::zeros());
    for (l, j) in &logs {
        let w = cauchy((l - mean) / spread);
        weights += w;
        slope += j * w;
    }
    slope /= weights;
    let mut out = Part { normal: Matrix5::zeros(), right: Vector5::zeros() };
    for (l, j) in &logs {
        let r = (l - mean) / spread;
        let w = cauchy(r);
        let j = (j - slope) / spread;
        out.normal += w * j * j.transpose();
        out.right -= w * r * j;
    }
    out
}

fn diagonal(sd: [f64; NUMBERS]) -> Vector5<f64> {
    Vector5::from(sd).map(|s| 1.0 / (s * s))
}

/// The camera under which most of the `pairs` keep their distance; `None` without pairs.
///
/// # Errors
/// [`crate::error::Error::Interrupted`] once `stop` was asked for.
pub fn calibrate(pairs: &[Pair], size_px: [f64; 2], stop: &Stop) -> Result<Option<Camera>> {
    if pairs.is_empty() {
        return Ok(None);
    }
    let mut camera = Camera::new([0.0; NUMBERS], size_px);
    for (stage, &scatter) in SCATTER.iter().enumerate() {
        let last = stage + 1 == SCATTER.len();
        let prior = diagonal(LOOSE);
        for _ in 0..if last { LAST_STEPS } else { STEPS } {
            stop.heed()?;
            // Summed in the order of the pairs, so that threads change nothing.
            let parts: Vec<Part> = pairs.par_iter().map(|p| part(p, &camera, scatter)).collect();
            let (mut normal, mut right) =
                (Matrix5::from_diagonal(&prior), -prior.component_mul(&camera.vector()));
            for p in parts {
                normal += p.normal;
                right += p.right;
            }
            let Some(step) = normal.cholesky().map(|c| c.solve(&right)) else { break };
            let longest = step.amax();
            let step = step * (LONGEST_STEP / longest.max(LONGEST_STEP));
            let mut numbers: [f64; NUMBERS] = (camera.vector() + step).into();
            for (n, most) in numbers.iter_mut().zip(MOST) {
                *n = n.clamp(-most, most);
            }
            camera = camera.with(numbers);
            if longest < STANDS {
                break;
            }
        }
    }
    Ok(Some(camera))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turning_pairs_tell_the_camera() {
        let size = [1000.0, 1000.0];
        let truth = Camera::new([0.008, -0.003, 0.05, -0.03, -0.15], size);
        // Three markers of a link that turns about a point which wanders, and a fourth that is on no link.
        let place = |k: usize, local: Vector2<f64>| {
            let t = k as f64 * 0.06;
            let (s, c) = (2.0 * t).sin_cos();
            let joint = Vector2::new(500.0 + 150.0 * t.sin(), 500.0 + 150.0 * t.cos());
            truth.to_picture(joint + Vector2::new(c * local.x - s * local.y, s * local.x + c * local.y))
        };
        let markers = [[20.0, 10.0], [90.0, -20.0], [160.0, 15.0]].map(Vector2::from);
        let mut pairs = Vec::new();
        let pair =
            |one: &dyn Fn(usize) -> Vector2<f64>, other: &dyn Fn(usize) -> Vector2<f64>, distance_px| Pair {
                places: (0..200).map(|k| PairPlace { first: one(k), second: other(k) }).collect(),
                distance_px,
                sigma_px: 0.03,
            };
        for (i, j) in [(0, 1), (0, 2), (1, 2)] {
            let d = (markers[i] - markers[j]).norm();
            pairs.push(pair(&|k| place(k, markers[i]), &|k| place(k, markers[j]), d));
        }
        pairs.push(pair(&|k| place(k, markers[0]), &|k| Vector2::new(600.0 + k as f64 * 0.1, 640.0), 170.0));
        let found = calibrate(&pairs, size, &Stop::default()).unwrap().unwrap();
        for (a, b) in found.numbers().into_iter().zip(truth.numbers()) {
            // Without noise; the loose prior pulls by its weight, 16 to 400 against some 1e6 and more.
            assert!((a - b).abs() < 2e-4, "{:?} {:?}", found.numbers(), truth.numbers());
        }
    }
}
