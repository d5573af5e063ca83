//! The backdrop: what each place of the picture shows while no marker is there.
//!
//! Owns: [`Backdrop`]. Must not: know where markers are.

use rayon::prelude::*;

use super::ground::{PICTURES, spread};
use super::model::Model;
use super::picture::Film;
use super::response::{Direction, Planes};
use super::tracklet::median;
use crate::error::Result;

/// Of the pictures looked at, each place's backdrop is the mean of those in which it is least like a marker, but for the very
/// least, which may show a shadow: a marker may rest there in 7 of 10 pictures.
const LEAST_ALIKE: std::ops::Range<f64> = 0.05..0.3;
/// Distance of the places that teach the noise.
const NOISE_STRIDE: usize = 11;
/// Standard deviation over median absolute deviation of normal noise.
const SIGMA_OVER_MAD: f64 = 1.4826;
/// Least noise, grey levels: rounding to whole levels and what compression leaves.
const LEAST_NOISE: f64 = 1.0;

/// The still background of each place of the picture while no marker is there, on one octave.
pub struct Backdrop {
    planes: Planes,
    /// Standard deviation of each plane from picture to picture, grey levels.
    pub noise: [f32; 3],
}

impl Backdrop {
    /// Of a recording, for markers of a model.
    pub fn learn(film: &dyn Film, model: &Model) -> Result<Self> {
        let octave = model.fine_octave();
        let n = film.count();
        let samples: Vec<Planes> = spread(n, PICTURES.min(n))
            .into_par_iter()
            .map(|i| {
                film.heed()?;
                Ok(Planes::of_octave(&film.read(i)?, octave))
            })
            .collect::<Result<_>>()?;
        let (width, height) = samples.first().map_or((0, 0), |s| (s.width, s.height));
        let kinds = samples.first().map_or(0, |s| s.planes.len());
        let alike: Vec<Vec<f32>> = samples
            .par_iter()
            .map(|s| s.along(model.direction).iter().map(|v| model.sign * v).collect())
            .collect();
        let rank = |part: f64| ((part * samples.len() as f64) as usize).min(samples.len().saturating_sub(1));
        let (from, to) = (rank(LEAST_ALIKE.start), rank(LEAST_ALIKE.end));
        let means: Vec<[f32; 3]> = (0..width * height)
            .into_par_iter()
            .map_init(
                || (0..samples.len()).collect::<Vec<usize>>(),
                |order, i| {
                    order.sort_unstable_by(|&a, &b| alike[a][i].total_cmp(&alike[b][i]).then(a.cmp(&b)));
                    let chosen = &order[from..=to];
                    std::array::from_fn(|k| {
                        if k >= kinds {
                            return 0.0;
                        }
                        chosen.iter().map(|&s| samples[s].planes[k][i]).sum::<f32>() / chosen.len() as f32
                    })
                },
            )
            .collect();
        let planes = (0..kinds).map(|k| means.iter().map(|m| m[k]).collect()).collect();
        let noise = std::array::from_fn(|k| {
            samples.first().and_then(|s| s.planes.get(k)).map_or(1.0, |_| noise(&samples, k))
        });
        Ok(Self { planes: Planes { width, height, planes }, noise })
    }

    /// Along a direction, as many columns and rows from a place on.
    pub fn along(
        &self,
        direction: Direction,
        (x0, y0): (usize, usize),
        (width, height): (usize, usize),
    ) -> Vec<f32> {
        self.part((x0, y0), (width, height)).along(direction)
    }

    /// A part of it: as many columns and rows from a place on.
    pub fn part(&self, (x0, y0): (usize, usize), (width, height): (usize, usize)) -> Planes {
        let whole = &self.planes;
        let cut = |p: &Vec<f32>| -> Vec<f32> {
            (y0..y0 + height).flat_map(|y| p[y * whole.width + x0..][..width].iter().copied()).collect()
        };
        Planes { width, height, planes: whole.planes.iter().map(cut).collect() }
    }
}

/// Usual standard deviation of a plane from picture to picture, grey levels.
fn noise(samples: &[Planes], plane: usize) -> f32 {
    let count = samples.first().map_or(0, |s| s.planes[plane].len());
    let mut scatter: Vec<f64> = (0..count)
        .step_by(NOISE_STRIDE)
        .map(|i| {
            let mut values: Vec<f64> = samples.iter().map(|s| f64::from(s.planes[plane][i])).collect();
            let middle = median(&mut values);
            values.iter_mut().for_each(|v| *v = (*v - middle).abs());
            SIGMA_OVER_MAD * median(&mut values)
        })
        .collect();
    median(&mut scatter).max(LEAST_NOISE) as f32
}
