//! Gauss-Newton with Levenberg's damping on the arrow-shaped problem, and the slack.

use nalgebra::{DMatrix, DVector, Matrix4, Matrix4xX, Vector4};
use rayon::prelude::*;

use super::arrow::{Arrow, Block, Eliminated};
use super::linearise::{Local, Point, linearise, trial};
use super::problem::{Progress, Recording, Segment, Settings, ShootingError, Slack, Status};
use crate::parameters::Field;

/// A finished fit.
pub struct Fit {
    /// The solution.
    pub point: Point,
    /// Names of the border: free fields, then `clock`, then two zeros for each recording.
    pub free: Vec<Field>,
    /// Marginal second derivatives of half chi-square with respect to the border, (G, G).
    pub information: DMatrix<f64>,
    /// Gradient there; not zero only for parameters held at a bound.
    pub gradient: DVector<f64>,
    /// Each segment's part of the border's gradient with the states eliminated, (K, G): what a sandwich estimate of
    /// the covariance is made of.
    pub scores: DMatrix<f64>,
    /// Standard deviations allowed to the jumps of `[phi1, phi2, w1, w2]`.
    pub slack: [f64; 4],
    /// Median standard deviations of a segment's state from its own samples.
    pub own_sigma: [f64; 4],
    /// Mean squared jump over slack squared, per component, with the degrees of freedom counted.
    pub joint_chi2: [f64; 4],
    /// Sum of weighted squared residuals, per link.
    pub squares: [f64; 2],
    /// Number of residuals, per link.
    pub counts: [usize; 2],
    /// Degrees of freedom the states take up beyond the border's (trace of the states' influence).
    pub state_freedom: f64,
    /// Segments in which a joint stuck.
    pub stuck: usize,
    /// Steps taken.
    pub iterations: usize,
    /// How it ended.
    pub status: Status,
}

/// Number of directions the largest dual number has.
const MOST: usize = 24;

struct Problem<'a> {
    recordings: &'a [Recording<'a>],
    segments: &'a [Segment],
    settings: &'a Settings,
    common: usize,
    border: usize,
}

impl Problem<'_> {
    fn locals(&self, point: &Point) -> Vec<Local> {
        let one = |(k, segment): (usize, &Segment)| {
            let recording = &self.recordings[segment.recording];
            match 4 + self.common {
                0..=4 => linearise::<4>(recording, segment, k, point, self.settings),
                5..=12 => linearise::<12>(recording, segment, k, point, self.settings),
                13..=16 => linearise::<16>(recording, segment, k, point, self.settings),
                17..=20 => linearise::<20>(recording, segment, k, point, self.settings),
                _ => linearise::<MOST>(recording, segment, k, point, self.settings),
            }
        };
        self.segments.par_iter().enumerate().map(one).collect()
    }

    /// Half the robust sum of squares with the jumps, without derivatives.
    fn cost(&self, point: &Point, weight: Option<Vector4<f64>>) -> f64 {
        let trials: Vec<_> = self
            .segments
            .par_iter()
            .enumerate()
            .map(|(k, s)| trial(&self.recordings[s.recording], s, k, point, self.settings.huber))
            .collect();
        let mut cost: f64 = trials.iter().map(|t| t.cost).sum();
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

    fn local_cost(&self, point: &Point, locals: &[Local], weight: Option<Vector4<f64>>) -> f64 {
        let mut cost: f64 = locals.iter().map(|l| l.cost).sum();
        if let Some(weight) = weight {
            for (k, d) in self.jumps(point, locals) {
                debug_assert!(self.segments[k].chained);
                cost += 0.5 * d.component_mul(&d).dot(&weight);
            }
        }
        cost
    }

    fn jumps<'b>(
        &'b self,
        point: &'b Point,
        locals: &'b [Local],
    ) -> impl Iterator<Item = (usize, Vector4<f64>)> + 'b {
        (0..self.segments.len())
            .filter(|&k| self.segments[k].chained)
            .map(|k| (k, Vector4::from(point.states[k + 1]) - locals[k].end))
    }

    /// Column in the border of each of a segment's local unknowns after its state.
    fn columns(&self, segment: &Segment) -> impl Fn(usize) -> usize + use<> {
        let (common, recording) = (self.common, segment.recording);
        move |c| if c < common { c } else { common + 2 * recording + (c - common) }
    }

    fn assemble(&self, point: &Point, locals: &[Local], weight: Option<Vector4<f64>>) -> Arrow {
        let g = self.border;
        let mut arrow = Arrow {
            blocks: Vec::with_capacity(locals.len()),
            corner: DMatrix::zeros(g, g),
            gradient: DVector::zeros(g),
        };
        for (segment, local) in self.segments.iter().zip(locals) {
            let column = self.columns(segment);
            let extra = local.gradient.len() - 4;
            let mut border = Matrix4xX::zeros(g);
            for c in 0..extra {
                let to = column(c);
                arrow.gradient[to] += local.gradient[4 + c];
                for r in 0..4 {
                    border[(r, to)] += local.hessian[(r, 4 + c)];
                }
                for r in 0..extra {
                    arrow.corner[(column(r), to)] += local.hessian[(4 + r, 4 + c)];
                }
            }
            arrow.blocks.push(Block {
                own: local.hessian.fixed_view::<4, 4>(0, 0).into(),
                next: None,
                border,
                gradient: local.gradient.fixed_rows::<4>(0).into(),
            });
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
                let mut left = block.border.columns_mut(0, self.common);
                left += aw * b;
                let after = &mut arrow.blocks[k + 1];
                after.own += w;
                after.gradient += wd;
                let mut right = after.border.columns_mut(0, self.common);
                right -= w * b;
            }
        }
        arrow
    }

    /// The border's step: the minimiser of the quadratic model with the bounds kept (active set).
    fn border_step(&self, point: &Point, done: &Eliminated) -> Option<DVector<f64>> {
        let g = self.border;
        let mut fixed: Vec<Option<f64>> = vec![None; g];
        for _ in 0..=g {
            let free: Vec<usize> = (0..g).filter(|&i| fixed[i].is_none()).collect();
            let mut step = DVector::from_iterator(g, fixed.iter().map(|f| f.unwrap_or(0.0)));
            let right = -(&done.corner_gradient + &done.corner * &step);
            let scale: Vec<f64> =
                free.iter().map(|&i| 1.0 / done.corner[(i, i)].max(f64::MIN_POSITIVE).sqrt()).collect();
            let m = DMatrix::from_fn(free.len(), free.len(), |r, c| {
                done.corner[(free[r], free[c])] * scale[r] * scale[c] + if r == c { 1e-13 } else { 0.0 }
            });
            let v = DVector::from_iterator(free.len(), free.iter().zip(&scale).map(|(&i, s)| right[i] * s));
            let solved = m.cholesky()?.solve(&v);
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

    fn moved(&self, point: &Point, border: &DVector<f64>, states: &[Vector4<f64>]) -> Point {
        let mut next = point.clone();
        for (i, field) in self.settings.free.iter().enumerate() {
            let mut value = point.parameters.get(*field) + border[i];
            if self.settings.bounded.contains(field) {
                value = value.max(0.0);
            }
            next.parameters.set(*field, value);
        }
        if self.settings.clock {
            next.stretch += border[self.settings.free.len()];
        }
        if self.settings.zeros {
            for (r, zeros) in next.zeros_rad.iter_mut().enumerate() {
                zeros[0] += border[self.common + 2 * r];
                zeros[1] += border[self.common + 2 * r + 1];
            }
        }
        for (x, dx) in next.states.iter_mut().zip(states) {
            for i in 0..4 {
                x[i] += dx[i];
            }
        }
        next
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Standard deviations of the segments' states from their own samples alone: the median of each component.
fn own_sigma(locals: &[Local]) -> Option<[f64; 4]> {
    let covariances: Vec<Matrix4<f64>> = locals
        .iter()
        .filter_map(|l| {
            let own: Matrix4<f64> = l.hessian.fixed_view::<4, 4>(0, 0).into();
            let scale = own.diagonal().map(|d| 1.0 / d.sqrt());
            let s = Matrix4::from_diagonal(&scale);
            (s * own * s).try_inverse().map(|m| s * m * s)
        })
        .filter(|m| m.diagonal().iter().all(|v| *v > 0.0))
        .collect();
    if covariances.is_empty() {
        return None;
    }
    Some(std::array::from_fn(|i| median(covariances.iter().map(|m| m[(i, i)].sqrt()).collect())))
}

/// Jumps squared and their degrees of freedom, per component.
fn joints(
    problem: &Problem<'_>,
    point: &Point,
    locals: &[Local],
    done: &Eliminated,
    slack: [f64; 4],
) -> ([f64; 4], [f64; 4]) {
    let spreads = done.covariances();
    let corner = pseudo_inverse(&done.corner);
    let (mut squares, mut freedom) = ([0.0; 4], [0.0; 4]);
    for (k, d) in problem.jumps(point, locals) {
        let (a, b) = (&locals[k].end_state, &locals[k].end_common);
        let (here, after) = (&spreads[k], &spreads[k + 1]);
        let cross = a * here.with_next;
        let mut pull = &after.with_border - a * &here.with_border;
        let mut common = pull.columns_mut(0, problem.common);
        common -= b;
        let through = &pull * &corner;
        for i in 0..4 {
            let known = after.own[(i, i)] - 2.0 * cross[(i, i)] + (a * here.own * a.transpose())[(i, i)];
            let variance = known + through.row(i).dot(&pull.row(i));
            squares[i] += d[i] * d[i];
            freedom[i] += (1.0 - variance / (slack[i] * slack[i])).clamp(0.0, 1.0);
        }
    }
    (squares, freedom)
}

/// Inverse of a symmetric matrix scaled to a unit diagonal, directions below 1e-12 left out.
fn pseudo_inverse(m: &DMatrix<f64>) -> DMatrix<f64> {
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

/// Fits. `start` gives parameters, zeros and states (one per segment); `progress` may stop it by returning false.
///
/// # Errors
/// Nothing to fit, too many free parameters, or a start from which nothing is determined.
pub fn fit(
    recordings: &[Recording<'_>],
    segments: &[Segment],
    start: Point,
    settings: &Settings,
    progress: &mut dyn FnMut(&Progress) -> bool,
) -> Result<Fit, ShootingError> {
    if segments.is_empty() || start.states.len() != segments.len() {
        return Err(ShootingError::Empty);
    }
    let common = settings.free.len() + usize::from(settings.clock);
    if 4 + common > MOST {
        return Err(ShootingError::TooMany(common, MOST - 4));
    }
    let border = common + 2 * recordings.len() * usize::from(settings.zeros);
    let problem = Problem { recordings, segments, settings, common, border };
    let chained = segments.iter().any(|s| s.chained);

    let mut point = start;
    let mut locals = problem.locals(&point);
    if !locals.iter().all(|l| l.cost.is_finite()) {
        return Err(ShootingError::NotFinite);
    }
    let mut own = own_sigma(&locals).ok_or(ShootingError::Singular)?;
    // The first steps are nearly free of the joints, so that the states settle before the laws are asked.
    let floor = |own: [f64; 4]| match settings.slack {
        Slack::Relative(f) | Slack::Learned(f) => own.map(|s| s * f),
        Slack::Fixed(s) => s,
    };
    let mut slack = match settings.slack {
        Slack::Fixed(s) => s,
        Slack::Relative(f) | Slack::Learned(f) => own.map(|s| s * f.max(30.0)),
    };
    let weight = |slack: [f64; 4]| chained.then(|| Vector4::from(slack.map(|s| 1.0 / (s * s))));
    let mut damping = 1e-4;
    let mut status = Status::IterationLimit;
    let mut iterations = 0;
    let mut settled = !chained || matches!(settings.slack, Slack::Fixed(_));
    let mut joint_chi2 = [f64::NAN; 4];
    while iterations < settings.max_iterations {
        let arrow = problem.assemble(&point, &locals, weight(slack));
        let cost = problem.local_cost(&point, &locals, weight(slack));
        let mut accepted = false;
        let mut gain = 0.0;
        for _ in 0..12 {
            let Some(done) = arrow.eliminate(damping) else {
                damping = (damping * 10.0).max(1e-6);
                continue;
            };
            let Some(step) = problem.border_step(&point, &done) else {
                damping = (damping * 10.0).max(1e-6);
                continue;
            };
            let next = problem.moved(&point, &step, &done.states(&step));
            let next_cost = problem.cost(&next, weight(slack));
            if next_cost <= cost * (1.0 + 1e-12) {
                gain = cost - next_cost;
                point = next;
                accepted = true;
                damping = if damping < 1e-9 { 0.0 } else { damping * 0.1 };
                break;
            }
            damping = (damping * 10.0).max(1e-6);
        }
        iterations += 1;
        if accepted {
            locals = problem.locals(&point);
        }
        let (sum, count) = locals
            .iter()
            .fold((0.0, 0), |(s, n), l| (s + l.squares[0] + l.squares[1], n + l.counts[0] + l.counts[1]));
        let report = Progress {
            iteration: iterations,
            max_iterations: settings.max_iterations,
            chi2: sum / count as f64,
        };
        if !progress(&report) {
            status = Status::Stopped;
            break;
        }
        // 1e-3 in half chi-square is a step of less than 0.05 standard deviations in any direction.
        let still = gain < 1e-3;
        if !settled && (still || gain < 0.01 * cost || !accepted) {
            own = own_sigma(&locals).unwrap_or(own);
            let lowest = floor(own);
            let next = match settings.slack {
                Slack::Learned(_) => {
                    let Some(done) = problem.assemble(&point, &locals, weight(slack)).eliminate(0.0) else {
                        status = Status::Stalled;
                        break;
                    };
                    let (squares, freedom) = joints(&problem, &point, &locals, &done, slack);
                    std::array::from_fn(|i| {
                        joint_chi2[i] = squares[i] / (freedom[i].max(1e-9) * slack[i] * slack[i]);
                        (squares[i] / freedom[i].max(1e-3))
                            .sqrt()
                            .clamp(slack[i] / 10.0, slack[i] * 10.0)
                            .max(lowest[i])
                    })
                }
                _ => std::array::from_fn(|i| (slack[i] / 10.0).max(lowest[i])),
            };
            let change = (0..4).map(|i| (next[i] / slack[i]).ln().abs()).fold(0.0, f64::max);
            slack = next;
            // A slack known to 2 % changes no standard error that is quoted to two digits.
            if change > 0.02 {
                continue;
            }
            if matches!(settings.slack, Slack::Relative(_)) {
                settled = true;
            }
        }
        if still && accepted {
            status = Status::Converged;
            break;
        }
        if !accepted {
            status = if damping > 1e3 { Status::Stalled } else { Status::Converged };
            break;
        }
    }
    let done =
        problem.assemble(&point, &locals, weight(slack)).eliminate(0.0).ok_or(ShootingError::Singular)?;
    let spreads = done.covariances();
    let state_freedom =
        spreads.iter().zip(&locals).map(|(s, l)| (s.own * l.hessian.fixed_view::<4, 4>(0, 0)).trace()).sum();
    let sum = |f: &dyn Fn(&Local) -> [f64; 2]| {
        locals.iter().fold([0.0; 2], |a, l| [a[0] + f(l)[0], a[1] + f(l)[1]])
    };
    Ok(Fit {
        squares: sum(&|l| l.squares),
        counts: locals.iter().fold([0; 2], |a, l| [a[0] + l.counts[0], a[1] + l.counts[1]]),
        stuck: locals.iter().filter(|l| l.stuck).count(),
        free: settings.free.clone(),
        scores: scores(&problem, &point, &locals, &spreads, weight(slack)),
        information: done.corner,
        gradient: done.corner_gradient,
        slack,
        own_sigma: own,
        joint_chi2,
        state_freedom,
        iterations,
        status,
        point,
    })
}

/// See [`Fit::scores`]; a jump counts with the segment before it.
fn scores(
    problem: &Problem<'_>,
    point: &Point,
    locals: &[Local],
    spreads: &[super::arrow::Spread],
    weight: Option<Vector4<f64>>,
) -> DMatrix<f64> {
    let mut out = DMatrix::zeros(locals.len(), problem.border);
    for (k, (segment, local)) in problem.segments.iter().zip(locals).enumerate() {
        let column = problem.columns(segment);
        for c in 4..local.gradient.len() {
            out[(k, column(c - 4))] += local.gradient[c];
        }
        let through = spreads[k].with_border.transpose() * local.gradient.fixed_rows::<4>(0);
        let mut row = out.row_mut(k);
        row += through.transpose();
    }
    if let Some(weight) = weight {
        for (k, d) in problem.jumps(point, locals) {
            let mut pull = &spreads[k + 1].with_border - locals[k].end_state * &spreads[k].with_border;
            let mut common = pull.columns_mut(0, problem.common);
            common -= &locals[k].end_common;
            let part = pull.transpose() * weight.component_mul(&d);
            let mut row = out.row_mut(k);
            row += part.transpose();
        }
    }
    out
}
