//! Estimates a camera together with the shapes and poses of bodies, and says how well it is known.
//!
//! Owns: [`refine`], [`Calibration`]. Must not: know which bodies are joined.
//!
//! Unknowns are the pose of each body in each frame, its shape, and the camera's five numbers. A pose is in the residuals of one
//! frame only, and is eliminated there (Schur).

use nalgebra::{DMatrix, DVector, Matrix2, Matrix2x3, Matrix3, Matrix5, Vector2, Vector3};
use rayon::prelude::*;

use super::pairs::MOST;
use crate::camera::{BY_EYE, Camera, NUMBERS};
use crate::error::Result;
use crate::rigid::pose::{Pair, fit_pose, place};
use crate::stop::Stop;

/// Residual at which half of the weight is lost, in standard uncertainties.
const CAUCHY: f64 = 3.0;
/// Steps at most.
const STEPS: usize = 15;
/// Part by which the cost falls in the last step.
const STANDS: f64 = 1e-7;
/// Numbers that stand or fall together: the stretch, the vanishing line, the lens.
const GROUPS: [&[usize]; 3] = [&[0, 1], &[2, 3], &[4]];

/// A rigid body over time.
#[derive(Debug, Clone)]
pub struct RigidSet {
    /// Places of its markers in the body, px.
    pub shape: Vec<Vector2<f64>>,
    /// For each frame the markers seen, with their places in square pixels.
    pub frames: Vec<Vec<(usize, Vector2<f64>)>>,
}

/// A camera and how well it is known.
#[derive(Debug, Clone, Copy)]
pub struct Calibration {
    /// The camera.
    pub camera: Camera,
    /// Covariance of its numbers.
    pub covariance: Matrix5<f64>,
    /// Squared residuals over their variances with this camera, for each degree of freedom.
    pub chi2: f64,
}

/// One frame's part in a step, its pose eliminated: of the body's shape and the camera.
struct Part {
    normal: DMatrix<f64>,
    right: DVector<f64>,
    cost: f64,
    squares: Vec<f64>,
}

/// A frame of a body of `n` markers; `None` where no pose follows.
fn part(
    seen: &[(usize, Vector2<f64>)],
    shape: &[Vector2<f64>],
    camera: &Camera,
    sigma_px: f64,
) -> Option<Part> {
    let slopes: Vec<_> = seen.iter().map(|(_, p)| camera.slopes(*p)).collect();
    let pairs: Vec<Pair> = seen
        .iter()
        .zip(&slopes)
        .map(|((q, _), s)| Pair { local: shape[*q], place: s.place, sigma_px })
        .collect();
    let pose = fit_pose(&pairs)?.pose;
    let turn: Matrix2<f64> = *pose.rotation.to_rotation_matrix().matrix();
    let n = shape.len();
    let m = 2 * n + NUMBERS;
    let (mut of_pose, mut mixed, mut right_pose) = (Matrix3::zeros(), DMatrix::zeros(3, m), Vector3::zeros());
    let mut out =
        Part { normal: DMatrix::zeros(m, m), right: DVector::zeros(m), cost: 0.0, squares: Vec::new() };
    for ((q, _), s) in seen.iter().zip(&slopes) {
        // A step in the plane as the picture shows it, in standard uncertainties.
        let shown = s.by_picture.try_inverse()? / sigma_px;
        let arm = turn * shape[*q];
        let r = shown * (s.place - place(&pose, shape[*q]));
        let square = r.norm_squared();
        let w = 1.0 / (1.0 + square / (CAUCHY * CAUCHY));
        out.cost += CAUCHY * CAUCHY * (square / (CAUCHY * CAUCHY)).ln_1p();
        out.squares.push(square);
        let by_pose = -shown * Matrix2x3::new(1.0, 0.0, -arm.y, 0.0, 1.0, arm.x);
        let mut by_rest = DMatrix::zeros(2, m);
        by_rest.view_mut((0, 2 * q), (2, 2)).copy_from(&(-shown * turn));
        by_rest.view_mut((0, 2 * n), (2, NUMBERS)).copy_from(&(shown * s.by_numbers));
        of_pose += w * by_pose.transpose() * by_pose;
        right_pose -= w * by_pose.transpose() * r;
        mixed += w * by_pose.transpose() * &by_rest;
        out.right -= w * by_rest.transpose() * r;
        out.normal += w * by_rest.transpose() * by_rest;
    }
    let inverse = of_pose.try_inverse()?;
    out.normal -= mixed.transpose() * inverse * &mixed;
    out.right -= mixed.transpose() * (inverse * right_pose);
    Some(out)
}

/// All bodies at one state.
struct Total {
    normal: DMatrix<f64>,
    right: DVector<f64>,
    cost: f64,
    /// Median of the squared residuals of a marker over that of two normal errors, and how many there are.
    scale: f64,
    count: usize,
}

fn total(
    sets: &[RigidSet],
    shapes: &[Vec<Vector2<f64>>],
    camera: &Camera,
    sigma_px: f64,
    stop: &Stop,
) -> Result<Total> {
    let all: usize = shapes.iter().map(|s| 2 * s.len()).sum();
    let m = all + NUMBERS;
    let mut out =
        Total { normal: DMatrix::zeros(m, m), right: DVector::zeros(m), cost: 0.0, scale: 1.0, count: 0 };
    let mut squares: Vec<f64> = Vec::new();
    let mut freedom = 0.0;
    let mut first = 0;
    for (set, shape) in sets.iter().zip(shapes) {
        stop.heed()?;
        // Summed in the order of the frames, so that threads change nothing.
        let parts: Vec<Part> =
            set.frames.par_iter().filter_map(|seen| part(seen, shape, camera, sigma_px)).collect();
        let n = 2 * shape.len();
        for p in parts {
            out.cost += p.cost;
            freedom += 2.0 * p.squares.len() as f64 - 3.0;
            squares.extend(&p.squares);
            let mut add = |from: (usize, usize), to: (usize, usize), size: (usize, usize)| {
                let mut there = out.normal.view_mut(to, size);
                there += p.normal.view(from, size);
            };
            add((0, 0), (first, first), (n, n));
            add((0, n), (first, all), (n, NUMBERS));
            add((n, 0), (all, first), (NUMBERS, n));
            add((n, n), (all, all), (NUMBERS, NUMBERS));
            let mut there = out.right.rows_mut(first, n);
            there += p.right.rows(0, n);
            let mut there = out.right.rows_mut(all, NUMBERS);
            there += p.right.rows(n, NUMBERS);
        }
        // Turn and shift of a shape are those of its poses: they stay.
        let size: f64 = (first..first + n).map(|i| out.normal[(i, i)]).sum::<f64>().max(1.0);
        for fixed in still(shape) {
            let mut block = out.normal.view_mut((first, first), (n, n));
            block += &fixed * fixed.transpose() * size;
        }
        first += n;
    }
    out.count = 2 * squares.len();
    let used = if squares.is_empty() { 0.0 } else { freedom / out.count as f64 };
    if !squares.is_empty() {
        let half = squares.len() / 2;
        // The median of chi-square with two degrees of freedom is 2 ln 2; the poses took some of the freedom.
        let median = *squares.select_nth_unstable_by(half, f64::total_cmp).1;
        out.scale = median / (2.0 * std::f64::consts::LN_2 * used.max(0.05));
    }
    Ok(out)
}

/// Shifts and turn of a shape, as unit steps of it.
fn still(shape: &[Vector2<f64>]) -> [DVector<f64>; 3] {
    let n = shape.len();
    let mean = shape.iter().sum::<Vector2<f64>>() / n.max(1) as f64;
    let step = |f: &dyn Fn(usize) -> Vector2<f64>| {
        let v = DVector::from_iterator(2 * n, (0..n).flat_map(|q| [f(q).x, f(q).y]));
        let norm = v.norm();
        if norm > 0.0 { v / norm } else { v }
    };
    [
        step(&|_| Vector2::new(1.0, 0.0)),
        step(&|_| Vector2::new(0.0, 1.0)),
        step(&|q| Vector2::new(mean.y - shape[q].y, shape[q].x - mean.x)),
    ]
}

/// The camera under which the bodies are rigid, from `start` on; `None` where a camera that faces the plane squarely does as well.
///
/// # Errors
/// [`crate::error::Error::Interrupted`] once `stop` was asked for.
pub fn refine(start: Camera, sets: &[RigidSet], sigma_px: f64, stop: &Stop) -> Result<Option<Calibration>> {
    let mut free = [true; NUMBERS];
    let mut camera = start;
    loop {
        let Some(Fit { camera: fitted, covariance, count, chi2 }) = fit(camera, free, sets, sigma_px, stop)?
        else {
            return Ok(None);
        };
        // The group that says least goes first, if it says less than chance may (Bayes' criterion).
        let mut least: Option<(f64, &[usize])> = None;
        for group in GROUPS.into_iter().filter(|g| free[g[0]]) {
            let n = group.len();
            let x = DVector::from_iterator(n, group.iter().map(|&i| fitted.numbers()[i]));
            let c = DMatrix::from_fn(n, n, |i, j| covariance[(group[i], group[j])]);
            let Some(inverse) = c.try_inverse() else { continue };
            let worth = (x.transpose() * inverse * &x)[0] / (n as f64 * (count as f64).ln());
            if worth < 1.0 && least.is_none_or(|l| worth < l.0) {
                least = Some((worth, group));
            }
        }
        let Some((_, group)) = least else {
            return Ok(Some(Calibration { camera: fitted, covariance, chi2 }));
        };
        let mut numbers = fitted.numbers();
        for &i in group {
            free[i] = false;
            numbers[i] = 0.0;
        }
        if free == [false; NUMBERS] {
            return Ok(None);
        }
        camera = fitted.with(numbers);
    }
}

/// A camera that was fitted with some of its numbers free.
struct Fit {
    camera: Camera,
    covariance: Matrix5<f64>,
    /// Coordinates that it comes from.
    count: usize,
    /// Chi-square for each degree of freedom.
    chi2: f64,
}

/// Fits the numbers that are `free` with shapes and poses; `None` where the equations have no solution.
fn fit(
    start: Camera,
    free: [bool; NUMBERS],
    sets: &[RigidSet],
    sigma_px: f64,
    stop: &Stop,
) -> Result<Option<Fit>> {
    let mut camera = start;
    let mut shapes: Vec<Vec<Vector2<f64>>> = sets.iter().map(|s| s.shape.clone()).collect();
    let all: usize = shapes.iter().map(|s| 2 * s.len()).sum();
    let kept: Vec<usize> = (0..all).chain((0..NUMBERS).filter(|&i| free[i]).map(|i| all + i)).collect();
    let prior: [f64; NUMBERS] = BY_EYE.map(|s| 1.0 / (s * s));
    let held = |camera: &Camera| -> f64 { camera.numbers().iter().zip(prior).map(|(n, p)| p * n * n).sum() };
    let mut now = total(sets, &shapes, &camera, sigma_px, stop)?;
    for step in 0..STEPS {
        let (normal, right) = with_prior(&now, &camera, &prior, &kept, all);
        let Some(d) = normal.cholesky().map(|c| c.solve(&right)) else { return Ok(None) };
        let before = now.cost + held(&camera);
        let mut part = 1.0;
        let mut better = false;
        for _ in 0..8 {
            let mut numbers = camera.numbers();
            let mut moved = shapes.clone();
            for (&i, v) in kept.iter().zip(d.iter()) {
                if i >= all {
                    numbers[i - all] = (numbers[i - all] + part * v).clamp(-MOST[i - all], MOST[i - all]);
                } else {
                    let (b, q, axis) = coordinate(&shapes, i);
                    moved[b][q][axis] += part * v;
                }
            }
            let there = camera.with(numbers);
            let then = total(sets, &moved, &there, sigma_px, stop)?;
            if then.cost + held(&there) <= before {
                better = before - (then.cost + held(&there)) > STANDS * before;
                (camera, shapes, now) = (there, moved, then);
                break;
            }
            part /= 4.0;
        }
        if !better && step > 0 {
            break;
        }
    }
    let (normal, _) = with_prior(&now, &camera, &prior, &kept, all);
    let Some(inverse) = normal.cholesky().map(|c| c.inverse()) else { return Ok(None) };
    let mut covariance = Matrix5::zeros();
    for (i, &a) in kept.iter().enumerate().filter(|k| *k.1 >= all) {
        for (j, &b) in kept.iter().enumerate().filter(|k| *k.1 >= all) {
            covariance[(a - all, b - all)] = inverse[(i, j)] * now.scale.max(1.0);
        }
    }
    Ok(Some(Fit { camera, covariance, count: now.count, chi2: now.scale }))
}

/// The normal equations of what is free, with the prior on the camera.
fn with_prior(
    now: &Total,
    camera: &Camera,
    prior: &[f64; NUMBERS],
    kept: &[usize],
    all: usize,
) -> (DMatrix<f64>, DVector<f64>) {
    let mut normal = now.normal.clone();
    let mut right = now.right.clone();
    // Residuals that are larger than noise say less than they seem to, beside the prior.
    for i in 0..NUMBERS {
        normal[(all + i, all + i)] += prior[i];
        right[all + i] -= prior[i] * camera.numbers()[i];
    }
    let n = kept.len();
    (DMatrix::from_fn(n, n, |i, j| normal[(kept[i], kept[j])]), DVector::from_fn(n, |i, _| right[kept[i]]))
}

/// Body, marker and axis of the `i`-th coordinate of all shapes.
fn coordinate(shapes: &[Vec<Vector2<f64>>], mut i: usize) -> (usize, usize, usize) {
    for (b, shape) in shapes.iter().enumerate() {
        if i < 2 * shape.len() {
            return (b, i / 2, i % 2);
        }
        i -= 2 * shape.len();
    }
    (0, 0, 0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, Normal};

    /// A double pendulum of three and six markers, 400 frames, seen by a camera with noise.
    fn film(truth: &Camera, sigma_px: f64, seed: u64) -> Vec<RigidSet> {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let normal = Normal::new(0.0, sigma_px).unwrap();
        let shapes = [
            vec![[32.0, -7.0], [84.0, 8.0], [130.0, -6.0]],
            vec![[27.0, 23.0], [52.0, -6.0], [78.0, 24.0], [99.0, -23.0], [122.0, 5.0], [147.0, -22.0]],
        ];
        let mut sets: Vec<RigidSet> = shapes
            .iter()
            .map(|s| RigidSet { shape: s.iter().map(|&p| Vector2::from(p)).collect(), frames: Vec::new() })
            .collect();
        for k in 0..400 {
            let t = 0.02 * f64::from(k);
            let turns = [2.2 * (3.0 * t).sin(), 2.6 * (4.1 * t).sin() + 1.5 * t];
            let elbow = Vector2::new(500.0 + 160.0 * turns[0].sin(), 500.0 + 160.0 * turns[0].cos());
            for (b, joint) in [Vector2::new(500.0, 500.0), elbow].into_iter().enumerate() {
                let (s, c) = turns[b].sin_cos();
                let seen = sets[b]
                    .shape
                    .iter()
                    .map(|p| joint + Vector2::new(p.x * s + p.y * c, p.x * c - p.y * s))
                    .map(|p| truth.to_picture(p))
                    .map(|p| p + Vector2::new(normal.sample(&mut rng), normal.sample(&mut rng)))
                    .enumerate()
                    .collect();
                sets[b].frames.push(seen);
            }
        }
        sets
    }

    #[test]
    fn a_tilted_camera_is_found_within_its_stated_error() {
        let size = [1000.0, 1000.0];
        let truth = Camera::tilted(10f64.to_radians(), 0.5, 2000.0, -0.1, 1.0, size);
        let mut z2 = 0.0;
        for seed in 0..6 {
            let sets = film(&truth, 0.05, seed);
            let start = Camera::new([0.0, 0.0, 0.05, 0.02, -0.05], size);
            let found = refine(start, &sets, 0.05, &Stop::default()).unwrap().unwrap();
            let off =
                nalgebra::Vector5::from(found.camera.numbers()) - nalgebra::Vector5::from(truth.numbers());
            z2 += (off.transpose() * found.covariance.try_inverse().unwrap() * off)[0];
            assert!((found.chi2 - 1.0).abs() < 0.1, "{}", found.chi2);
        }
        // Chi-square with 30 degrees of freedom: 30 +- 7.7, three of these.
        assert!((7.0..54.0).contains(&z2), "{z2}");
    }

    #[test]
    fn a_square_camera_is_not_corrected() {
        let size = [1000.0, 1000.0];
        let sets = film(&Camera::new([0.0; 5], size), 0.05, 9);
        let start = Camera::new([0.0, 0.0, 1e-4, -1e-4, 1e-3], size);
        assert!(refine(start, &sets, 0.05, &Stop::default()).unwrap().is_none());
    }
}
