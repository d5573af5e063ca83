//! Assembles and solves the whole problem: cost, normal equations, the step within the bounds.

use nalgebra::{DMatrix, DVector, Matrix4, Matrix4xX, Vector4};
use rayon::prelude::*;

use super::arrow::{Arrow, Block, Eliminated};
use super::linearise::{Local, Point, linearise, trial};
use super::problem::{CAMERA_NUMBERS, Recording, Segment, Settings};

/// Number of directions the largest dual number has.
pub(super) const MAX_DIRECTIONS: usize = 24;

/// Recordings, segments, what is free, and how many common unknowns (`common` those of the motion).
pub(super) struct Problem<'a> {
    pub(super) recordings: &'a [Recording<'a>],
    pub(super) segments: &'a [Segment],
    pub(super) settings: &'a Settings,
    pub(super) common: usize,
    pub(super) shared: usize,
    /// Where the cameras' numbers begin among the shared parameters: they are the last.
    pub(super) cameras_at: usize,
}

/// Least relative information that counts, tried in turn.
const RIDGES: [f64; 4] = [1e-13, 1e-11, 1e-9, 1e-7];

/// Maximum number of dampings tried in one step.
const TRIES: usize = 12;
/// Relative error of the cost from the integration's rounding, grown by the motion.
const ROUNDING: f64 = 1e-9;

/// Outcome of a step.
pub(super) struct Step {
    /// Where it leads; `None` where the cost does not fall.
    pub(super) next: Option<Point>,
    /// Fall of half chi-square; where it does not fall, the greatest fall that was possible.
    pub(super) gain: f64,
    /// Half chi-square before.
    pub(super) cost: f64,
    /// The damping that it needed.
    pub(super) damping: f64,
}

impl Problem<'_> {
    pub(super) fn locals(&self, point: &Point) -> Vec<Local> {
        let one = |(k, segment): (usize, &Segment)| {
            let recording = &self.recordings[segment.recording];
            match 4 + self.common {
                0..=4 => linearise::<4>(recording, segment, k, point, self.settings),
                5..=12 => linearise::<12>(recording, segment, k, point, self.settings),
                13..=16 => linearise::<16>(recording, segment, k, point, self.settings),
                17..=20 => linearise::<20>(recording, segment, k, point, self.settings),
                _ => linearise::<MAX_DIRECTIONS>(recording, segment, k, point, self.settings),
            }
        };
        threads::install(|| self.segments.par_iter().enumerate().map(one).collect())
    }

    /// Half the robust sum of squares with the jumps, without derivatives.
    pub(super) fn cost(&self, point: &Point, weight: Option<Vector4<f64>>) -> f64 {
        let one = |(k, s): (usize, &Segment)| {
            trial(&self.recordings[s.recording], s, k, point, self.settings.huber)
        };
        let trials: Vec<_> = threads::install(|| self.segments.par_iter().enumerate().map(one).collect());
        let mut cost: f64 = trials.iter().map(|t| t.cost).sum::<f64>() + point.camera_cost();
        if let Some(weight) = weight {
            for (k, t) in trials.iter().enumerate() {
                if self.segments[k].chained {
                    let d = Vector4::from(point.states[k + 1]) - t.end;
                    cost += 0.5 * d.component_mul(&d).dot(&weight);
                }
            }
        }
        if cost.is_finite() { cost } else { f64::INFINITY }
    }

    pub(super) fn local_cost(&self, point: &Point, locals: &[Local], weight: Option<Vector4<f64>>) -> f64 {
        let mut cost: f64 = locals.iter().map(|l| l.cost).sum::<f64>() + point.camera_cost();
        if let Some(weight) = weight {
            for (k, d) in self.jumps(point, locals) {
                debug_assert!(self.segments[k].chained);
                cost += 0.5 * d.component_mul(&d).dot(&weight);
            }
        }
        cost
    }

    pub(super) fn jumps<'b>(
        &'b self,
        point: &'b Point,
        locals: &'b [Local],
    ) -> impl Iterator<Item = (usize, Vector4<f64>)> + 'b {
        (0..self.segments.len())
            .filter(|&k| self.segments[k].chained)
            .map(|k| (k, Vector4::from(point.states[k + 1]) - locals[k].end))
    }

    /// Column in the shared parameters of each of a segment's local unknowns after its state.
    pub(super) fn columns(&self, segment: &Segment) -> impl Fn(usize) -> usize + use<> {
        let (common, recording, cameras_at) = (self.common, segment.recording, self.cameras_at);
        let zeros = common + 2 * usize::from(self.settings.zeros);
        let camera = self.recordings[recording].camera.map_or(0, |c| c.camera);
        move |c| match c {
            _ if c < common => c,
            _ if c < zeros => common + 2 * recording + (c - common),
            _ => cameras_at + CAMERA_NUMBERS * camera + (c - zeros),
        }
    }

    pub(super) fn assemble(&self, point: &Point, locals: &[Local], weight: Option<Vector4<f64>>) -> Arrow {
        let g = self.shared;
        let mut arrow = Arrow {
            blocks: Vec::with_capacity(locals.len()),
            corner: DMatrix::zeros(g, g),
            gradient: DVector::zeros(g),
            damped: DVector::zeros(g),
        };
        for (segment, local) in self.segments.iter().zip(locals) {
            let column = self.columns(segment);
            let extra = local.gradient.len() - 4;
            let mut shared = Matrix4xX::zeros(g);
            for c in 0..extra {
                let to = column(c);
                arrow.gradient[to] += local.gradient[4 + c];
                for r in 0..4 {
                    shared[(r, to)] += local.hessian[(r, 4 + c)];
                }
                for r in 0..extra {
                    arrow.corner[(column(r), to)] += local.hessian[(4 + r, 4 + c)];
                }
            }
            let own: Matrix4<f64> = local.hessian.fixed_view::<4, 4>(0, 0).into();
            arrow.blocks.push(Block {
                own,
                damped: own.diagonal(),
                next: None,
                shared,
                gradient: local.gradient.fixed_rows::<4>(0).into(),
            });
        }
        arrow.damped = arrow.corner.diagonal();
        for (c, number) in point.cameras.iter().flatten().enumerate() {
            arrow.corner[(self.cameras_at + c, self.cameras_at + c)] += 1.0;
            arrow.gradient[self.cameras_at + c] += number;
        }
        if let Some(weight) = weight {
            let w = Matrix4::from_diagonal(&weight);
            for (k, d) in self.jumps(point, locals) {
                let (a, b) = (&locals[k].end_state, &locals[k].end_common);
                let wd = weight.component_mul(&d);
                let (aw, bw) = (a.transpose() * w, b.transpose() * w);
                let mut common = arrow.corner.view_mut((0, 0), (self.common, self.common));
                common += &bw * b;
                let mut gradient = arrow.gradient.rows_mut(0, self.common);
                gradient -= b.transpose() * wd;
                let block = &mut arrow.blocks[k];
                block.own += aw * a;
                block.next = Some(-aw);
                block.gradient -= a.transpose() * wd;
                let mut left = block.shared.columns_mut(0, self.common);
                left += aw * b;
                let after = &mut arrow.blocks[k + 1];
                after.own += w;
                after.gradient += wd;
                let mut right = after.shared.columns_mut(0, self.common);
                right -= w * b;
            }
        }
        arrow
    }

    /// The step of the shared parameters: the minimiser of the quadratic model with the bounds kept (active set).
    pub(super) fn shared_step(&self, point: &Point, done: &Eliminated) -> Option<DVector<f64>> {
        let g = self.shared;
        let mut fixed: Vec<Option<f64>> = vec![None; g];
        for _ in 0..=g {
            let free: Vec<usize> = (0..g).filter(|&i| fixed[i].is_none()).collect();
            let mut step = DVector::from_iterator(g, fixed.iter().map(|f| f.unwrap_or(0.0)));
            let right = -(&done.corner_gradient + &done.corner * &step);
            let scale: Vec<f64> =
                free.iter().map(|&i| 1.0 / done.corner[(i, i)].max(f64::MIN_POSITIVE).sqrt()).collect();
            let m = |ridge: f64| {
                DMatrix::from_fn(free.len(), free.len(), |r, c| {
                    done.corner[(free[r], free[c])] * scale[r] * scale[c] + if r == c { ridge } else { 0.0 }
                })
            };
            // Directions that rounding has left no information on are not moved along.
            let factor = RIDGES.iter().find_map(|&ridge| m(ridge).cholesky())?;
            let v = DVector::from_iterator(free.len(), free.iter().zip(&scale).map(|(&i, s)| right[i] * s));
            let solved = factor.solve(&v);
            for (n, &i) in free.iter().enumerate() {
                step[i] = solved[n] * scale[n];
            }
            let mut held = false;
            for (i, field) in self.settings.free.iter().enumerate() {
                let now = point.parameters.get(*field);
                if fixed[i].is_none() && self.settings.bounded.contains(field) && now + step[i] < 0.0 {
                    fixed[i] = Some(-now);
                    held = true;
                }
            }
            if !held {
                return Some(step);
            }
        }
        None
    }

    /// One Gauss-Newton step, damped until the cost falls.
    pub(super) fn step(
        &self,
        point: &Point,
        locals: &[Local],
        weight: Option<Vector4<f64>>,
        damping: &mut f64,
    ) -> Step {
        let arrow = self.assemble(point, locals, weight);
        let cost = self.local_cost(point, locals, weight);
        let mut out = Step { next: None, gain: f64::INFINITY, cost, damping: *damping };
        for _ in 0..TRIES {
            out.damping = *damping;
            let found = arrow
                .eliminate(*damping)
                .and_then(|done| self.shared_step(point, &done).map(|shared| (done.states(&shared), shared)));
            if let Some((states, shared)) = found {
                let promised = -0.5 * arrow.slope(&states, &shared);
                let next = self.moved(point, &shared, &states);
                let gain = cost - self.cost(&next, weight);
                if gain >= -1e-12 * cost {
                    *damping = if *damping < 1e-9 { 0.0 } else { *damping * 0.1 };
                    return Step { next: Some(next), gain, ..out };
                }
                if promised < ROUNDING * cost {
                    // What is left to gain is less than the cost is known to.
                    return Step { gain: promised, ..out };
                }
            }
            *damping = (*damping * 10.0).max(1e-6);
        }
        out
    }

    pub(super) fn moved(&self, point: &Point, shared: &DVector<f64>, states: &[Vector4<f64>]) -> Point {
        let mut next = point.clone();
        for (i, field) in self.settings.free.iter().enumerate() {
            let mut value = point.parameters.get(*field) + shared[i];
            if self.settings.bounded.contains(field) {
                value = value.max(0.0);
            }
            next.parameters.set(*field, value);
        }
        if self.settings.clock {
            next.clock_scale += shared[self.settings.free.len()];
        }
        if self.settings.zeros {
            for (r, zeros) in next.zeros_rad.iter_mut().enumerate() {
                zeros[0] += shared[self.common + 2 * r];
                zeros[1] += shared[self.common + 2 * r + 1];
            }
        }
        for (c, number) in next.cameras.iter_mut().flatten().enumerate() {
            *number += shared[self.cameras_at + c];
        }
        for (x, dx) in next.states.iter_mut().zip(states) {
            for i in 0..4 {
                x[i] += dx[i];
            }
        }
        next
    }
}

/// Inverse of a symmetric matrix scaled to a unit diagonal, directions below 1e-12 left out.
pub(super) fn pseudo_inverse(m: &DMatrix<f64>) -> DMatrix<f64> {
    let n = m.nrows();
    if n == 0 {
        return m.clone();
    }
    let scale =
        DVector::from_iterator(n, (0..n).map(|i| 1.0 / m[(i, i)].abs().max(f64::MIN_POSITIVE).sqrt()));
    let scaled = DMatrix::from_fn(n, n, |r, c| m[(r, c)] * scale[r] * scale[c]);
    let eigen = scaled.symmetric_eigen();
    let inverse = eigen.eigenvalues.map(|v| if v > 1e-12 { 1.0 / v } else { 0.0 });
    let core = &eigen.eigenvectors * DMatrix::from_diagonal(&inverse) * eigen.eigenvectors.transpose();
    DMatrix::from_fn(n, n, |r, c| core[(r, c)] * scale[r] * scale[c])
}
