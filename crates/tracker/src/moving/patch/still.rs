//! The still background: pictures from all over the recording, by which a thing is told from the wall behind it.
//!
//! Owns: [`Still`], [`Cover`]. Must not: know how a thing moves.

use rayon::prelude::*;

use super::search::Plane;
use super::template::{Pose, Template};
use crate::error::Result;
use crate::moving::ground::{PICTURES, spread};
use crate::moving::picture::{Film, Picture};
use crate::moving::tracklet::median;

/// A pixel is a thing's if it differs from the same pixel in this part of the other pictures: a thing may rest in the others.
const DIFFERS_PART: f64 = 0.5;
/// By so many standard deviations of the noise.
const DIFFERS_SIGMA: f32 = 5.0;
/// Standard deviation of one of two normal values over the median of how much they differ: 1.4826 / sqrt(2).
const SIGMA_OF_DIFFERENCE: f64 = 1.048;
/// Least noise, grey levels: rounding to whole ones, and what a codec leaves.
const LEAST_NOISE: f64 = 1.0;
/// A pixel is the thing's, whatever its own brightness, where so many of 5 x 5 about it differ.
const NEAR_COUNT: usize = 9;
/// A pixel is the thing's where so many of 5 x 5 about it move with it: more than half.
const MOST_COUNT: usize = 13;
/// A pixel that is seen again within so many standard deviations moves with the thing: one of the difference of two pixels is 1.4.
const MOVES_SIGMA: f64 = 4.0;
/// Distance of the pixels that teach the noise.
const NOISE_STRIDE: usize = 13;
/// Part of a template's likeness, and part of all pictures, from which on a thing at one place stands still there.
const ALIKE_PART: f64 = 0.9;
const STANDS_PART: f64 = 0.9;
/// A person points beside what they mean by so many pixels at most.
const OFF_PX: i64 = 5;

/// Brightness of a picture.
pub fn plane(picture: &Picture) -> Plane {
    Plane {
        values: picture.luma.iter().map(|&v| f32::from(v)).collect(),
        size: (picture.width, picture.height),
    }
}

/// Pictures from all over the recording.
pub struct Still {
    planes: Vec<Plane>,
    /// Standard deviation of a pixel, grey levels.
    pub noise: f64,
}

/// The pixels about a place that a thing covers.
pub struct Cover {
    at: [f64; 2],
    middle: [i64; 2],
    reach: i64,
    covered: Vec<bool>,
    /// How many.
    pub count: usize,
}

impl Cover {
    /// The part of it that is no nearer to its border than `by` px: there each pixel shows the thing alone.
    pub fn inner(&self, by: i64) -> Self {
        let side = 2 * self.reach + 1;
        let whole = |k: usize| {
            let (x, y) = (
                k as i64 % side - self.reach + self.middle[0],
                k as i64 / side - self.reach + self.middle[1],
            );
            let around = -by..=by;
            around
                .clone()
                .all(|dy| around.clone().all(|dx| dx * dx + dy * dy > by * by || self.inside(x + dx, y + dy)))
        };
        let covered: Vec<bool> = (0..self.covered.len()).map(|k| self.covered[k] && whole(k)).collect();
        let count = covered.iter().filter(|c| **c).count();
        Self { covered, count, ..*self }
    }

    /// Whether a pixel is covered, or beyond what was looked at.
    fn inside(&self, x: i64, y: i64) -> bool {
        let beyond = (x - self.middle[0]).abs().max((y - self.middle[1]).abs()) > self.reach;
        beyond || self.holds(x, y)
    }

    /// Whether a pixel is covered.
    pub fn holds(&self, x: i64, y: i64) -> bool {
        let (i, j) = (x - self.middle[0] + self.reach, y - self.middle[1] + self.reach);
        let side = 2 * self.reach + 1;
        (0..side).contains(&i) && (0..side).contains(&j) && self.covered[(j * side + i) as usize]
    }
}

impl Still {
    /// Of a recording.
    pub fn learn(film: &dyn Film) -> Result<Self> {
        let n = film.count();
        let planes: Vec<Plane> = spread(n, PICTURES.min(n))
            .into_par_iter()
            .map(|i| {
                film.heed()?;
                Ok(plane(&film.read(i)?))
            })
            .collect::<Result<_>>()?;
        let mut differences: Vec<f64> = planes
            .windows(2)
            .flat_map(|p| {
                let pairs = p[0].values.iter().zip(&p[1].values).step_by(NOISE_STRIDE);
                pairs.map(|(a, b)| f64::from((a - b).abs())).collect::<Vec<_>>()
            })
            .collect();
        let noise = (SIGMA_OF_DIFFERENCE * median(&mut differences)).max(LEAST_NOISE);
        Ok(Self { planes, noise })
    }

    /// Pixels of a picture that a thing at a place covers, within `reach` px: connected ones that differ from the still background.
    pub fn cover(&self, picture: &Plane, at: [f64; 2], reach: usize) -> Cover {
        let middle = at.map(|v| v.round() as i64);
        let reach = reach as i64;
        let side = (2 * reach + 1) as usize;
        let pixel = |k: usize| {
            let (i, j) = ((k % side) as i64 - reach, (k / side) as i64 - reach);
            let (x, y) = (middle[0] + i, middle[1] + j);
            let (w, h) = picture.size;
            let inside = (0..w as i64).contains(&x) && (0..h as i64).contains(&y);
            inside.then(|| y as usize * w + x as usize)
        };
        let limit = DIFFERS_SIGMA * self.noise as f32;
        let least = (DIFFERS_PART * self.planes.len() as f64).ceil() as usize;
        let differs: Vec<bool> = (0..side * side)
            .map(|k| {
                pixel(k).is_some_and(|p| {
                    let now = picture.values[p];
                    self.planes.iter().filter(|s| (s.values[p] - now).abs() > limit).count() >= least
                })
            })
            .collect();
        let most: Vec<bool> = (0..side * side)
            .map(|k| around(k, side, 2).filter(|n| differs[*n]).count() >= NEAR_COUNT)
            .collect();
        connected(at, middle, reach, &most)
    }

    /// Pixels that a thing covers, from places at which it was seen elsewhere: pixels that are there again, and that stand less still than
    /// they move with it.
    pub fn grown(&self, picture: &Plane, cover: &Cover, seen: &[(Pose, Plane)]) -> Cover {
        let (middle, reach) = (cover.middle, cover.reach);
        let side = (2 * reach + 1) as usize;
        let limit = MOVES_SIGMA * self.noise;
        let (mut again, mut moves) = (vec![false; side * side], vec![false; side * side]);
        for k in 0..side * side {
            let (i, j) = ((k % side) as i64 - reach, (k / side) as i64 - reach);
            let [x, y] = [middle[0] + i, middle[1] + j].map(|v| v as f64);
            let Some(now) = picture.at([x, y]).filter(|_| i * i + j * j <= reach * reach) else { continue };
            let off = |v: Option<f64>| v.map_or(f64::INFINITY, |v| (v - now).abs());
            let mut with: Vec<f64> = seen
                .iter()
                .map(|(pose, p)| off(p.at(pose.place([x - cover.at[0], y - cover.at[1]]))))
                .collect();
            let mut still: Vec<f64> = self.planes.iter().map(|p| off(p.at([x, y]))).collect();
            let (with, still) = (median(&mut with), median(&mut still));
            again[k] = with < limit;
            moves[k] = again[k] && still > with;
        }
        let most = |k: usize| around(k, side, 2).filter(|n| moves[*n]).count() >= MOST_COUNT;
        let whole: Vec<bool> = (0..side * side).map(|k| again[k] && most(k)).collect();
        connected(cover.at, middle, reach, &whole)
    }

    /// Whether what is at a pose is there in nearly all of the recording: a wall and no thing that moves.
    pub fn stands(&self, template: &Template, pose: &Pose, likeness: f64) -> bool {
        let alike = |p: &&Plane| p.likeness(template, pose).is_some_and(|l| l > ALIKE_PART * likeness);
        let count = self.planes.iter().filter(alike).count();
        count as f64 >= STANDS_PART * self.planes.len() as f64
    }
}

/// A pixel of a square and those within `by` columns and rows of it.
fn around(k: usize, side: usize, by: usize) -> impl Iterator<Item = usize> {
    let range = move |c: usize| c.saturating_sub(by)..(c + by + 1).min(side);
    range(k / side).flat_map(move |y| range(k % side).map(move |x| y * side + x))
}

/// The connected pixels at a place, or nearest to it.
fn connected(at: [f64; 2], middle: [i64; 2], reach: i64, inside: &[bool]) -> Cover {
    let side = (2 * reach + 1) as usize;
    let off = |k: usize| ((k % side) as i64 - reach).pow(2) + ((k / side) as i64 - reach).pow(2);
    let start = (0..side * side).filter(|&k| inside[k]).min_by_key(|&k| off(k));
    let mut covered = vec![false; side * side];
    let mut open: Vec<usize> = start.into_iter().filter(|&k| off(k) <= OFF_PX * OFF_PX).collect();
    open.iter().for_each(|&k| covered[k] = true);
    let mut count = open.len();
    while let Some(k) = open.pop() {
        for n in around(k, side, 1).filter(|n| inside[*n]) {
            if !covered[n] {
                covered[n] = true;
                count += 1;
                open.push(n);
            }
        }
    }
    Cover { at, middle, reach, covered, count }
}
