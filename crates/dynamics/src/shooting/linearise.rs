//! One segment's residuals, its part of the normal equations, and its end, with exact derivatives.

use nalgebra::{DMatrix, DVector, Matrix4, Matrix4xX, Vector4};

use super::path::{Span, follow};
use super::problem::{Recording, Segment, Settings};
use crate::parameters::Parameters;
use crate::scalar::{Dual, Real};
use crate::state::State;

/// Where the fit stands.
#[derive(Clone, Debug)]
pub struct Point {
    /// Parameters of the motion.
    pub parameters: Parameters<f64>,
    /// True time per clock time.
    pub stretch: f64,
    /// Angle zeros of each recording, rad: measured = true + zero.
    pub zeros_rad: Vec<[f64; 2]>,
    /// State at each segment's start.
    pub states: Vec<State<f64>>,
}

/// A segment's contribution. Local unknowns: state (4), free parameters, clock, the recording's two zeros.
pub struct Local {
    /// Second derivatives (Gauss-Newton), (L, L).
    pub hessian: DMatrix<f64>,
    /// Gradient, (L,).
    pub gradient: DVector<f64>,
    /// Half the robust sum of squares.
    pub cost: f64,
    /// Sum of `weight * residual^2` and number of residuals, per link.
    pub squares: [f64; 2],
    /// Residuals counted, per link.
    pub counts: [usize; 2],
    /// State at the segment's end.
    pub end: Vector4<f64>,
    /// Its derivatives with respect to the state, and the other local unknowns but the zeros.
    pub end_state: Matrix4<f64>,
    /// (4, parameters and clock).
    pub end_common: Matrix4xX<f64>,
    /// Whether a joint stuck.
    pub stuck: bool,
}

/// Huber's weight and half-cost of a standardised residual.
#[inline]
fn huber(r: f64, limit: f64) -> (f64, f64) {
    let size = r.abs();
    if size <= limit { (1.0, 0.5 * r * r) } else { (limit / size, limit * (size - 0.5 * limit)) }
}

/// Only the cost and the end: for trial steps.
pub struct Trial {
    /// Half the robust sum of squares.
    pub cost: f64,
    /// State at the segment's end.
    pub end: Vector4<f64>,
}

/// Cost of one segment at a point.
pub fn trial(recording: &Recording<'_>, segment: &Segment, k: usize, point: &Point, limit: f64) -> Trial {
    let times = &recording.t_s[segment.first..segment.last];
    let span = Span { start_s: segment.start_s, end_s: segment.end_s, times_s: times };
    let zeros = point.zeros_rad[segment.recording];
    let mut cost = 0.0;
    let end = follow(&point.parameters, point.states[k], &span, point.stretch, false, |n, x| {
        let i = segment.first + n;
        for j in 0..2 {
            if recording.seen(i, j) {
                let r = (x[j] + zeros[j] - recording.phi_rad[j][i]) / recording.sigma_rad[j][i];
                cost += huber(r, limit).1;
            }
        }
    });
    let end = Vector4::from(end.state);
    Trial { cost: if end.iter().all(|v| v.is_finite()) { cost } else { f64::INFINITY }, end }
}

/// Information on the state of a link that is not there, that holds it where it is: of the size of a milliradian's.
const HELD: f64 = 1e6;

/// Everything of one segment at a point, with `N` directions: the state and up to `N - 4` common unknowns.
pub fn linearise<const N: usize>(
    recording: &Recording<'_>,
    segment: &Segment,
    k: usize,
    point: &Point,
    settings: &Settings,
) -> Local {
    let common = settings.free.len() + usize::from(settings.clock);
    let zeros_at = 4 + common;
    let size = zeros_at + 2 * usize::from(settings.zeros);
    let mut p: Parameters<Dual<N>> = point.parameters.lift();
    for (i, field) in settings.free.iter().enumerate() {
        p.set(*field, Dual::variable(point.parameters.get(*field), 4 + i));
    }
    let stretch = if settings.clock {
        Dual::variable(point.stretch, 4 + settings.free.len())
    } else {
        Dual::constant(point.stretch)
    };
    let x0: State<Dual<N>> = std::array::from_fn(|i| Dual::variable(point.states[k][i], i));
    let times = &recording.t_s[segment.first..segment.last];
    let span = Span { start_s: segment.start_s, end_s: segment.end_s, times_s: times };
    let zeros = point.zeros_rad[segment.recording];

    // Per link: sums over samples of weight * (1, derivative) x (1, derivative) in the upper triangle.
    let mut sums = [[[0.0; N]; N]; 2];
    let mut slopes = [[0.0; N]; 2];
    let mut with_residual = [[0.0; N]; 2];
    let (mut weights, mut residuals) = ([0.0; 2], [0.0; 2]);
    let (mut cost, mut squares, mut counts) = (0.0, [0.0; 2], [0; 2]);
    let end = follow(&p, x0, &span, stretch, false, |n, x| {
        let i = segment.first + n;
        for j in 0..2 {
            if !recording.seen(i, j) {
                continue;
            }
            let scale = 1.0 / recording.sigma_rad[j][i];
            let r = (x[j].v + zeros[j] - recording.phi_rad[j][i]) * scale;
            let (weight, half) = huber(r, settings.huber);
            cost += half;
            squares[j] += weight * r * r;
            counts[j] += 1;
            let (w, wr) = (weight * scale * scale, weight * scale * r);
            let d = &x[j].d;
            for a in 0..N {
                let wa = w * d[a];
                slopes[j][a] += wa;
                with_residual[j][a] += wr * d[a];
                for b in 0..N {
                    sums[j][a][b] += wa * d[b];
                }
            }
            weights[j] += w;
            residuals[j] += wr;
        }
    });

    let mut hessian = DMatrix::zeros(size, size);
    let mut gradient = DVector::zeros(size);
    for j in 0..2 {
        for a in 0..zeros_at {
            gradient[a] += with_residual[j][a];
            for b in 0..zeros_at {
                hessian[(a, b)] += sums[j][a][b];
            }
        }
        if settings.zeros {
            let z = zeros_at + j;
            gradient[z] += residuals[j];
            hessian[(z, z)] += weights[j];
            for a in 0..zeros_at {
                hessian[(a, z)] += slopes[j][a];
                hessian[(z, a)] += slopes[j][a];
            }
        }
    }
    for i in recording.links..2 {
        // A link that is not there rests at zero; nothing else depends on its state.
        for a in [i, 2 + i] {
            hessian[(a, a)] += HELD;
        }
    }
    Local {
        hessian,
        gradient,
        cost: if end.state.iter().all(|s| s.v.is_finite()) { cost } else { f64::INFINITY },
        squares,
        counts,
        end: Vector4::from(end.state.map(|s| s.v)),
        end_state: Matrix4::from_fn(|i, c| end.state[i].d[c]),
        end_common: Matrix4xX::from_fn(common, |i, c| end.state[i].d[4 + c]),
        stuck: end.stuck,
    }
}
