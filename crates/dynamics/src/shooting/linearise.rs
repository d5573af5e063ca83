//! Linearises one segment: residuals, its part of the normal equations, and its end, with exact derivatives.

use nalgebra::{DMatrix, DVector, Matrix4, Matrix4xX, Vector4};

use super::path::{Span, follow};
use super::problem::{CAMERA_NUMBERS, Recording, Segment, Settings};
use crate::parameters::Parameters;
use crate::scalar::{Dual, Real};
use crate::state::State;

/// Current values of all unknowns of a fit.
#[derive(Clone, Debug)]
pub struct Point {
    /// Parameters of the motion.
    pub parameters: Parameters<f64>,
    /// True time per clock time.
    pub clock_scale: f64,
    /// Angle zeros of each recording, rad: measured = true + zero.
    pub zeros_rad: Vec<[f64; 2]>,
    /// Numbers of each camera in units of their prior standard deviations, 0 before anything was seen.
    pub cameras: Vec<[f64; CAMERA_NUMBERS]>,
    /// State at each segment's start.
    pub states: Vec<State<f64>>,
}

impl Point {
    /// The numbers of a recording's camera; zeros where it has none.
    fn camera_of(&self, recording: &Recording<'_>) -> [f64; CAMERA_NUMBERS] {
        recording.camera.map_or([0.0; CAMERA_NUMBERS], |c| self.cameras[c.camera])
    }

    /// Half the sum of squares of the cameras' numbers: their prior.
    pub(super) fn camera_cost(&self) -> f64 {
        0.5 * self.cameras.iter().flatten().map(|v| v * v).sum::<f64>()
    }
}

/// The camera's part of an angle.
#[inline]
fn added(slopes: &[f64; CAMERA_NUMBERS], numbers: &[f64; CAMERA_NUMBERS]) -> f64 {
    slopes.iter().zip(numbers).map(|(s, n)| s * n).sum()
}

/// A segment's contribution. Local unknowns: state (4), free parameters, clock, the recording's two zeros, its camera's numbers.
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
    /// Its derivatives with respect to the state, and the other local unknowns of the motion.
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
    let camera = point.camera_of(recording);
    let mut cost = 0.0;
    let end = follow(&point.parameters, point.states[k], &span, point.clock_scale, false, |n, x| {
        let i = segment.first + n;
        for j in 0..2 {
            if recording.seen(i, j) {
                let shift = zeros[j] + added(&recording.camera_slopes(i, j), &camera);
                let r = (x[j] + shift - recording.phi_rad[j][i]) / recording.sigma_rad[j][i];
                cost += huber(r, limit).1;
            }
        }
    });
    let end = Vector4::from(end.state);
    Trial { cost: if end.iter().all(|v| v.is_finite()) { cost } else { f64::INFINITY }, end }
}

/// Information on the state of a link that is not there, that holds it where it is: of the size of a milliradian's.
const HELD: f64 = 1e6;

/// Sums over a segment's samples, per link: of weight times (1, derivative) x (1, derivative), and of weighted residuals.
struct Sums<const N: usize> {
    products: [[[f64; N]; N]; 2],
    slopes: [[f64; N]; 2],
    with_residual: [[f64; N]; 2],
    weights: [f64; 2],
    residuals: [f64; 2],
    camera: CameraSums<N>,
}

/// Sums of products with the angles' slopes by the camera's numbers, over both links but where the other factor is a link's.
struct CameraSums<const N: usize> {
    with_motion: [[f64; CAMERA_NUMBERS]; N],
    with_zeros: [[f64; CAMERA_NUMBERS]; 2],
    own: [[f64; CAMERA_NUMBERS]; CAMERA_NUMBERS],
    with_residual: [f64; CAMERA_NUMBERS],
}

impl<const N: usize> Default for CameraSums<N> {
    fn default() -> Self {
        Self {
            with_motion: [[0.0; CAMERA_NUMBERS]; N],
            with_zeros: [[0.0; CAMERA_NUMBERS]; 2],
            own: [[0.0; CAMERA_NUMBERS]; CAMERA_NUMBERS],
            with_residual: [0.0; CAMERA_NUMBERS],
        }
    }
}

impl<const N: usize> CameraSums<N> {
    /// Adds a sample of link `j` with the angle's derivatives `d` by the motion and `g` by the camera.
    fn add(&mut self, j: usize, d: &[f64; N], g: &[f64; CAMERA_NUMBERS], w: f64, wr: f64) {
        for a in 0..CAMERA_NUMBERS {
            let wg = w * g[a];
            for (sum, b) in self.with_motion.iter_mut().zip(d) {
                sum[a] += wg * b;
            }
            for (sum, b) in self.own[a].iter_mut().zip(g) {
                *sum += wg * b;
            }
            self.with_zeros[j][a] += wg;
            self.with_residual[a] += wr * g[a];
        }
    }

    /// Writes its part of the equations, the camera's unknowns from `at` on.
    fn put(
        &self,
        hessian: &mut DMatrix<f64>,
        gradient: &mut DVector<f64>,
        at: usize,
        zeros_at: Option<usize>,
    ) {
        let motion = zeros_at.unwrap_or(at);
        for c in 0..CAMERA_NUMBERS {
            let here = at + c;
            gradient[here] += self.with_residual[c];
            for a in 0..motion {
                hessian[(a, here)] += self.with_motion[a][c];
                hessian[(here, a)] += self.with_motion[a][c];
            }
            if let Some(first) = zeros_at {
                for j in 0..2 {
                    hessian[(first + j, here)] += self.with_zeros[j][c];
                    hessian[(here, first + j)] += self.with_zeros[j][c];
                }
            }
            for a in 0..CAMERA_NUMBERS {
                hessian[(at + a, here)] += self.own[a][c];
            }
        }
    }
}

impl<const N: usize> Default for Sums<N> {
    fn default() -> Self {
        Self {
            products: [[[0.0; N]; N]; 2],
            slopes: [[0.0; N]; 2],
            with_residual: [[0.0; N]; 2],
            weights: [0.0; 2],
            residuals: [0.0; 2],
            camera: CameraSums::default(),
        }
    }
}

impl<const N: usize> Sums<N> {
    /// Adds a sample of link `j`: the angle's derivatives, its weight `w`, and weight times residual `wr`.
    #[inline(always)]
    fn add(&mut self, j: usize, d: &[f64; N], w: f64, wr: f64) {
        for a in 0..N {
            let wa = w * d[a];
            self.slopes[j][a] += wa;
            self.with_residual[j][a] += wr * d[a];
            for (sum, b) in self.products[j][a].iter_mut().zip(d) {
                *sum += wa * b;
            }
        }
        self.weights[j] += w;
        self.residuals[j] += wr;
    }

    /// Second derivatives and gradient with respect to the state, `common` unknowns and, where they are free, two zeros and a
    /// camera.
    fn equations(&self, common: usize, zeros: bool, camera: bool) -> (DMatrix<f64>, DVector<f64>) {
        let zeros_at = 4 + common;
        let camera_at = zeros_at + 2 * usize::from(zeros);
        let size = camera_at + CAMERA_NUMBERS * usize::from(camera);
        let mut hessian = DMatrix::zeros(size, size);
        let mut gradient = DVector::zeros(size);
        for j in 0..2 {
            for a in 0..zeros_at {
                gradient[a] += self.with_residual[j][a];
                for b in 0..zeros_at {
                    hessian[(a, b)] += self.products[j][a][b];
                }
            }
            if zeros {
                let z = zeros_at + j;
                gradient[z] += self.residuals[j];
                hessian[(z, z)] += self.weights[j];
                for a in 0..zeros_at {
                    hessian[(a, z)] += self.slopes[j][a];
                    hessian[(z, a)] += self.slopes[j][a];
                }
            }
        }
        if camera {
            self.camera.put(&mut hessian, &mut gradient, camera_at, zeros.then_some(zeros_at));
        }
        (hessian, gradient)
    }
}

/// Everything of one segment at a point, with `N` directions: the state and up to `N - 4` common unknowns.
pub fn linearise<const N: usize>(
    recording: &Recording<'_>,
    segment: &Segment,
    k: usize,
    point: &Point,
    settings: &Settings,
) -> Local {
    let common = settings.free.len() + usize::from(settings.clock);
    let mut p: Parameters<Dual<N>> = point.parameters.lift();
    for (i, field) in settings.free.iter().enumerate() {
        p.set(*field, Dual::variable(point.parameters.get(*field), 4 + i));
    }
    let clock_scale = if settings.clock {
        Dual::variable(point.clock_scale, 4 + settings.free.len())
    } else {
        Dual::constant(point.clock_scale)
    };
    let x0: State<Dual<N>> = std::array::from_fn(|i| Dual::variable(point.states[k][i], i));
    let times = &recording.t_s[segment.first..segment.last];
    let span = Span { start_s: segment.start_s, end_s: segment.end_s, times_s: times };
    let zeros = point.zeros_rad[segment.recording];
    let camera = point.camera_of(recording);

    let mut sums = Sums::<N>::default();
    let (mut cost, mut squares, mut counts) = (0.0, [0.0; 2], [0; 2]);
    let end = follow(&p, x0, &span, clock_scale, false, |n, x| {
        let i = segment.first + n;
        for j in 0..2 {
            if !recording.seen(i, j) {
                continue;
            }
            let scale = 1.0 / recording.sigma_rad[j][i];
            let slopes = recording.camera_slopes(i, j);
            let shift = zeros[j] + added(&slopes, &camera);
            let r = (x[j].v + shift - recording.phi_rad[j][i]) * scale;
            let (weight, half) = huber(r, settings.huber);
            cost += half;
            squares[j] += weight * r * r;
            counts[j] += 1;
            let (w, wr) = (weight * scale * scale, weight * scale * r);
            sums.add(j, &x[j].d, w, wr);
            if recording.camera.is_some() {
                sums.camera.add(j, &x[j].d, &slopes, w, wr);
            }
        }
    });

    let (mut hessian, gradient) = sums.equations(common, settings.zeros, recording.camera.is_some());
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
