//! Estimates the slack: the standard deviation allowed to the jump between a segment's end and the next one's start.
//!
//! The motion of a recording is cut into segments, each with a state of its own at its start ([`super::problem`]). A jump is
//! the difference of a segment's start from where the one before it ends; where the equations are right, all jumps are 0.

use nalgebra::{DVector, Matrix4, Vector4};

use super::arrow::Eliminated;
use super::linearise::{Local, Point};
use super::system::{Problem, pseudo_inverse};

/// Largest change of the slack, as a logarithm, at which the estimate has converged: a slack known to 2 % changes no standard
/// error that is quoted to two digits.
pub(super) const SLACK_TOLERANCE: f64 = 0.02;
/// Maximum number of guesses at the slack: ten are enough where the data determine it, and else the last guess is given.
const MAX_GUESSES: usize = 40;
/// Change of the logarithm of a weight over which a derivative is taken: far above rounding, far below curvature.
const STEP: f64 = 0.02;

/// Greatest factor between two guesses at the slack.
const MOST_CHANGE: f64 = 10.0;
/// Least degrees of freedom by which a chi-square is divided, and by which the next guess is: the smaller one only keeps a
/// quotient finite, the greater one keeps a guess from an estimate of nothing.
const LEAST_FREEDOM: f64 = 1e-9;
const LEAST_FREEDOM_OF_GUESS: f64 = 1e-3;

/// Median; NaN of no values.
fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Standard deviations of the segments' states from their own samples alone: the median of each component.
pub(super) fn own_sigma(locals: &[Local]) -> Option<[f64; 4]> {
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

/// Jumps squared and their degrees of freedom, per component, after the step that minimises the linear problem.
fn jumps_squared(
    problem: &Problem<'_>,
    point: &Point,
    locals: &[Local],
    done: &Eliminated,
    shared: &DVector<f64>,
    slack: [f64; 4],
) -> ([f64; 4], [f64; 4]) {
    let states = done.states(shared);
    let parameters = shared.rows(0, problem.common);
    let spreads = done.covariances();
    let corner = pseudo_inverse(&done.corner);
    let (mut squares, mut freedom) = ([0.0; 4], [0.0; 4]);
    for (k, jump) in problem.jumps(point, locals) {
        let (a, b) = (&locals[k].end_state, &locals[k].end_common);
        let moved = Vector4::from_iterator((b * parameters).iter().copied());
        let jump_left: Vector4<f64> = jump + states[k + 1] - a * states[k] - moved;
        let (here, after) = (&spreads[k], &spreads[k + 1]);
        let cross = a * here.with_next;
        let mut jump_by_shared = &after.with_shared - a * &here.with_shared;
        let mut common = jump_by_shared.columns_mut(0, problem.common);
        common -= b;
        let by_covariance = &jump_by_shared * &corner;
        for i in 0..4 {
            let known = after.own[(i, i)] - 2.0 * cross[(i, i)] + (a * here.own * a.transpose())[(i, i)];
            let variance = known + by_covariance.row(i).dot(&jump_by_shared.row(i));
            squares[i] += jump_left[i] * jump_left[i];
            freedom[i] += (1.0 - variance / (slack[i] * slack[i])).clamp(0.0, 1.0);
        }
    }
    (squares, freedom)
}

/// A learned slack, and the chi-square of the jumps it was learned from.
#[derive(Clone, Copy)]
pub(super) struct Learned {
    pub(super) slack: [f64; 4],
    pub(super) chi2: [f64; 4],
}

/// The slack that makes the jumps' chi-square one, not below `lowest`, with the problem taken as linear where it
/// stands: the motion need not be followed again for every guess. `None` when the states are not determined.
pub(super) fn learned(
    problem: &Problem<'_>,
    point: &Point,
    locals: &[Local],
    start: [f64; 4],
    lowest: [f64; 4],
) -> Option<Learned> {
    let mut now = Learned { slack: start, chi2: [f64::NAN; 4] };
    let mut solved: Option<Learned> = None;
    for _ in 0..MAX_GUESSES {
        let slack = now.slack;
        let weight = Vector4::from(slack.map(|s| 1.0 / (s * s)));
        let done = problem.assemble(point, locals, Some(weight)).eliminate(0.0);
        let step = done.and_then(|done| problem.shared_step(point, &done).map(|shared| (done, shared)));
        let Some((done, shared)) = step else {
            if let Some(before) = solved {
                // The weights of the jumps are so large that rounding makes the equations singular: the motion is not the right
                // one yet.
                return Some(before);
            }
            if slack == lowest {
                return None;
            }
            // The weights are so small that rounding loses the common unknowns.
            now.slack = std::array::from_fn(|i| (slack[i] / MOST_CHANGE).max(lowest[i]));
            continue;
        };
        let (squares, freedom) = jumps_squared(problem, point, locals, &done, &shared, slack);
        now.chi2 =
            std::array::from_fn(|i| squares[i] / (freedom[i].max(LEAST_FREEDOM) * slack[i] * slack[i]));
        solved = Some(now);
        now.slack = std::array::from_fn(|i| {
            let wanted = (squares[i] / freedom[i].max(LEAST_FREEDOM_OF_GUESS)).sqrt();
            wanted.clamp(slack[i] / MOST_CHANGE, slack[i] * MOST_CHANGE).max(lowest[i])
        });
        if apart(now.slack, slack) < SLACK_TOLERANCE {
            break;
        }
    }
    Some(now)
}

/// Observed variance of the jumps over the slack's square, not below zero: one common to the components `given`, 1 for the
/// others, whose slack was learned.
///
/// With `H` the part of the hat matrix between jumps (each over its slack), `f = tr(1 - H)` over the given components
/// and `K = sum (1 - H)^2` over pairs of them, the expected sum of squares of their jumps, over the slack's square, is
/// `f - K + ratio K`. `H` depends on the weights as `dH = (H - H^2) d ln w`, so `K = f + df/d ln w`.
pub(super) fn jump_variance_ratio(
    problem: &Problem<'_>,
    point: &Point,
    locals: &[Local],
    slack: [f64; 4],
    given: [bool; 4],
) -> [f64; 4] {
    let sums = |shift: f64| {
        let slack = std::array::from_fn(|i| slack[i] * if given[i] { (-0.5 * shift).exp() } else { 1.0 });
        let weight = Vector4::from(slack.map(|s| 1.0 / (s * s)));
        let done = problem.assemble(point, locals, Some(weight)).eliminate(0.0)?;
        let shared = problem.shared_step(point, &done)?;
        let (squares, freedom) = jumps_squared(problem, point, locals, &done, &shared, slack);
        let over = |v: &dyn Fn(usize) -> f64| (0..4).filter(|&i| given[i]).map(v).sum::<f64>();
        Some((over(&|i| squares[i] / (slack[i] * slack[i])), over(&|i| freedom[i])))
    };
    let found = || {
        let (squares, freedom) = sums(0.0)?;
        let slope = (sums(STEP)?.1 - sums(-STEP)?.1) / (2.0 * STEP);
        let pair_sum = freedom + slope;
        // Nothing is known of jumps that no data contradict: they are taken to be as large as allowed.
        (pair_sum > 0.0).then(|| (1.0 + (squares - freedom) / pair_sum).max(0.0))
    };
    let common = if given.contains(&true) { found().unwrap_or(1.0) } else { 1.0 };
    given.map(|g| if g { common } else { 1.0 })
}

/// Largest difference of two slacks, as a logarithm.
pub(super) fn apart(a: [f64; 4], b: [f64; 4]) -> f64 {
    (0..4).map(|i| (a[i] / b[i]).ln().abs()).fold(0.0, f64::max)
}
