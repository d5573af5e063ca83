//! Learns the background of a recording and its noise, robust against the markers on it.
//!
//! Owns: [`Background`]. Must not: know which side markers are on.

use nalgebra::{SMatrix, SVector};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::detect::quantile::{quantile, sorted};

/// A smooth surface under the markers: a quadratic in x and y, raw units.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Background {
    /// Coefficients of 1, u, v, u^2, u v, v^2 with u, v from -1 to 1 across the image.
    pub coefficients: [f64; 6],
    /// Width and height of the image, px.
    pub image_px: [u32; 2],
}

impl Background {
    fn terms(u: f64, v: f64) -> [f64; 6] {
        [1.0, u, v, u * u, u * v, v * v]
    }

    /// The background at a place, raw units.
    pub fn at(&self, x_px: f64, y_px: f64) -> f64 {
        let half = self.image_px.map(|n| ((f64::from(n) - 1.0) / 2.0).max(0.5));
        let (u, v) = (x_px / half[0] - 1.0, y_px / half[1] - 1.0);
        Self::terms(u, v).iter().zip(self.coefficients).map(|(t, c)| t * c).sum()
    }

    /// Whether it is the same everywhere.
    pub fn is_flat(&self) -> bool {
        self.coefficients[1..].iter().all(|&c| c == 0.0)
    }

    /// Its value in the middle of the image, raw units; of a flat one its value everywhere.
    pub fn median(&self) -> f64 {
        self.coefficients[0]
    }
}

/// Side of the tiles whose medians the surface is laid through, px.
const TILE_PX: usize = 32;

/// The surface through the medians of tiles over all frames, by least absolute deviations: tiles covered by
/// markers, links or hands do not pull it. Flat where tiles say no more than that.
pub(crate) fn learn(images: &[Vec<u16>], width: usize, height: usize) -> Background {
    let image_px = [width as u32, height as u32];
    let rows: Vec<usize> = (0..height).step_by(TILE_PX).collect();
    let row_of_tiles = |&y0: &usize| {
        let mut tiles = Vec::new();
        let mut values: Vec<u16> = Vec::new();
        for x0 in (0..width).step_by(TILE_PX) {
            values.clear();
            let (y1, x1) = ((y0 + TILE_PX).min(height), (x0 + TILE_PX).min(width));
            for (i, image) in images.iter().enumerate() {
                // Every third pixel, another third in each frame.
                for y in y0..y1 {
                    values.extend(image[y * width + x0..y * width + x1].iter().skip((y + i) % 3).step_by(3));
                }
            }
            if values.is_empty() {
                continue;
            }
            let middle = values.len() / 2;
            let median = f64::from(*values.select_nth_unstable(middle).1);
            let u = (x0 + x1 - 1) as f64 / (width as f64 - 1.0).max(1.0) - 1.0;
            let v = (y0 + y1 - 1) as f64 / (height as f64 - 1.0).max(1.0) - 1.0;
            tiles.push((Background::terms(u, v), median));
        }
        tiles
    };
    let tiles: Vec<([f64; 6], f64)> = rows.par_iter().flat_map_iter(row_of_tiles).collect();
    let medians = sorted(tiles.iter().map(|t| t.1));
    let middle = quantile(&medians, 0.5);
    let flat = Background { coefficients: [middle, 0.0, 0.0, 0.0, 0.0, 0.0], image_px };
    if tiles.len() < 24 {
        return flat;
    }
    let mut c = SVector::<f64, 6>::zeros();
    c[0] = middle;
    for _ in 0..40 {
        let (mut a, mut b) = (SMatrix::<f64, 6, 6>::zeros(), SVector::<f64, 6>::zeros());
        for (t, m) in &tiles {
            let t = SVector::<f64, 6>::from_row_slice(t);
            // Half a grey level: medians are whole numbers.
            let w = 1.0 / (m - t.dot(&c)).abs().max(0.5);
            a += t * t.transpose() * w;
            b += t * (*m * w);
        }
        let Some(new) = a.cholesky().map(|l| l.solve(&b)) else { return flat };
        let change = (new - c).abs().max();
        c = new;
        if change < 1e-3 {
            break;
        }
    }
    let deviation = |c: &SVector<f64, 6>| -> f64 {
        tiles.iter().map(|(t, m)| (m - SVector::<f64, 6>::from_row_slice(t).dot(c)).abs()).sum()
    };
    let mut level = SVector::<f64, 6>::zeros();
    level[0] = middle;
    let span = quantile(&medians, 0.9) - quantile(&medians, 0.1);
    // A surface is kept where it explains more than a third of what a level leaves, and more than rounding.
    if span <= 2.0 || deviation(&c) > 0.67 * deviation(&level) {
        return flat;
    }
    Background { coefficients: c.into(), image_px }
}

/// Variance of a background sample, raw units squared, from second differences along rows; never below that
/// of rounding to whole numbers.
pub(crate) fn noise_variance(images: &[Vec<u16>], width: usize) -> f64 {
    // How often each absolute difference comes, in each image.
    let counts = images.par_iter().map(|image| {
        let mut counts = vec![0u64; 4 * usize::from(u16::MAX) + 1];
        for (y, row) in image.chunks_exact(width).enumerate() {
            for w in row.windows(3).skip(y % 7).step_by(7) {
                counts[(i32::from(w[0]) - 2 * i32::from(w[1]) + i32::from(w[2])).unsigned_abs() as usize] +=
                    1;
            }
        }
        counts
    });
    let Some(counts) = counts.reduce_with(|mut all, one| {
        all.iter_mut().zip(one).for_each(|(a, b)| *a += b);
        all
    }) else {
        return 1.0 / 12.0;
    };
    let n: u64 = counts.iter().sum();
    let mut below = 0;
    let Some(m) = counts.iter().position(|&c| {
        below += c;
        below > n / 2
    }) else {
        return 1.0 / 12.0;
    };
    // Whole numbers tie: interpolate the median inside its tie.
    let (tied, below) = (counts[m] as f64, (below - counts[m]) as f64);
    let inside = (n as f64 / 2.0 - below) / tied;
    let median = if m == 0 { 0.5 * inside } else { m as f64 - 0.5 + inside };
    // Median of |N(0, 1)| is 0.6745; a second difference has six times the variance.
    ((median / 0.6745).powi(2) / 6.0).max(1.0 / 12.0)
}
