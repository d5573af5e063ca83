//! Computes the parts of the shared parameters' covariance: whose errors the information carries, and the scores.
//!
//! Take the solution as linear in its residuals. Each residual, of an angle or of a jump, has a derivative with respect
//! to the shared parameters when the states follow them as they do at the minimum; with these derivatives `J` and weights
//! `W` the shared parameters' error is `-(J' W J)^-1 J' W e`. So their covariance is a sum over the sources of `e`, whatever
//! the weights are: the noise of the angles and the jumps count each with the variance they have, not with the one
//! they were allowed.

use nalgebra::{DMatrix, Matrix4xX, Vector4};

use super::arrow::Spread;
use super::linearise::{Local, Point};
use super::system::Problem;

/// Derivatives of the jump after segment `k` with respect to the shared parameters, the states following it, (4, G).
pub(super) fn pull(problem: &Problem<'_>, locals: &[Local], spreads: &[Spread], k: usize) -> Matrix4xX<f64> {
    let mut pull = &spreads[k + 1].with_shared - locals[k].end_state * &spreads[k].with_shared;
    let mut common = pull.columns_mut(0, problem.common);
    common -= &locals[k].end_common;
    pull
}

/// See [`super::Fit::scores`]; a jump counts with the segment before it.
pub(super) fn scores(
    problem: &Problem<'_>,
    point: &Point,
    locals: &[Local],
    spreads: &[Spread],
    weight: Option<Vector4<f64>>,
) -> DMatrix<f64> {
    let mut out = DMatrix::zeros(locals.len(), problem.shared);
    for (k, (segment, local)) in problem.segments.iter().zip(locals).enumerate() {
        let column = problem.columns(segment);
        for c in 4..local.gradient.len() {
            out[(k, column(c - 4))] += local.gradient[c];
        }
        let through = spreads[k].with_shared.transpose() * local.gradient.fixed_rows::<4>(0);
        let mut row = out.row_mut(k);
        row += through.transpose();
    }
    if let Some(weight) = weight {
        for (k, d) in problem.jumps(point, locals) {
            let part = pull(problem, locals, spreads, k).transpose() * weight.component_mul(&d);
            let mut row = out.row_mut(k);
            row += part.transpose();
        }
    }
    out
}

/// See [`super::Fit::angle_information`].
pub(super) fn angle_information(problem: &Problem<'_>, locals: &[Local], spreads: &[Spread]) -> DMatrix<f64> {
    let g = problem.shared;
    let mut out = DMatrix::zeros(g, g);
    for (k, (segment, local)) in problem.segments.iter().zip(locals).enumerate() {
        let column = problem.columns(segment);
        let mut moves = DMatrix::zeros(local.gradient.len(), g);
        moves.rows_mut(0, 4).copy_from(&spreads[k].with_shared);
        for c in 4..local.gradient.len() {
            moves[(c, column(c - 4))] = 1.0;
        }
        out.gemm_tr(1.0, &moves, &(&local.hessian * &moves), 1.0);
    }
    out
}

/// See [`super::Fit::jump_information`]. `shown` is the jumps' variance over the slack's square, per component.
pub(super) fn jump_information(
    problem: &Problem<'_>,
    locals: &[Local],
    spreads: &[Spread],
    weight: Option<Vector4<f64>>,
    shown: [f64; 4],
) -> DMatrix<f64> {
    let mut out = DMatrix::zeros(problem.shared, problem.shared);
    if let Some(weight) = weight {
        for k in (0..locals.len()).filter(|&k| problem.segments[k].chained) {
            let pull = pull(problem, locals, spreads, k);
            for i in 0..4 {
                let row = pull.row(i).transpose();
                out.ger(weight[i] * shown[i], &row, &row, 1.0);
            }
        }
    }
    out
}
