//! Estimates angle, rate and acceleration from noisy angles: Kalman filter and smoother of a Wiener process.
//!
//! The highest derivative carried is driven by white noise: with three components (angle, rate, acceleration) the
//! jerk is white noise of intensity `q` (rad^2/s^5), with four the jerk is carried and its derivative is white. The
//! noise is found by maximum likelihood: one intensity for the whole record together with a common factor on the
//! measurement's uncertainties, then one intensity for each stretch of time, since a pendulum that tumbles and then
//! swings out is not stationary. Times may be irregular; a missing angle is a time without an update.

use nalgebra::{SMatrix, SVector};

/// Angles of one link.
#[derive(Clone, Copy, Debug)]
pub struct Measured<'a> {
    /// Times, ascending, s.
    pub t_s: &'a [f64],
    /// Angles, rad; not a number where not seen.
    pub phi_rad: &'a [f64],
    /// Standard uncertainties, rad, positive where the angle is seen.
    pub sigma_rad: &'a [f64],
}

/// Noise of process and measurement.
#[derive(Clone, Debug)]
pub struct Noise {
    /// Factor on the given standard uncertainties.
    pub factor: f64,
    /// Times at which the intensity is given, s; between them its logarithm is linear, beyond them constant.
    pub knots_s: Vec<f64>,
    /// Logarithm of the intensity at the knots.
    pub log_q: Vec<f64>,
}

/// Smoothed states and their covariances, one per time.
#[derive(Clone, Debug)]
pub struct Smoothed<const N: usize> {
    /// Angle, rate, acceleration (and jerk).
    pub state: Vec<SVector<f64, N>>,
    /// Their covariances.
    pub covariance: Vec<SMatrix<f64, N, N>>,
    /// Logarithm of the likelihood of the angles.
    pub log_likelihood: f64,
}

/// Prior standard deviations of the components, far beyond any pendulum: rad, rad/s, rad/s^2, ...
const PRIOR: [f64; 4] = [1e1, 1e2, 1e4, 1e6];

/// One step of the Wiener process: transition and noise for an intensity of one.
#[derive(Clone, Copy)]
struct Transition<const N: usize> {
    dt: f64,
    f: SMatrix<f64, N, N>,
    q: SMatrix<f64, N, N>,
}

impl<const N: usize> Transition<N> {
    fn new(dt: f64) -> Self {
        let factorial = [1.0, 1.0, 2.0, 6.0];
        #[allow(clippy::cast_possible_wrap, clippy::cast_possible_truncation)] // indices below 4
        let power = |n: usize| dt.powi(n as i32);
        let f = SMatrix::from_fn(|i, j| if j >= i { power(j - i) / factorial[j - i] } else { 0.0 });
        #[allow(clippy::cast_precision_loss)] // indices below 4
        let q = SMatrix::from_fn(|i, j| {
            let (a, b) = (N - 1 - i, N - 1 - j);
            power(a + b + 1) / (factorial[a] * factorial[b] * (a + b + 1) as f64)
        });
        Self { dt, f, q }
    }
}

/// Intensity as a function of time.
struct Intensity<'a> {
    noise: &'a Noise,
    at: usize,
}

impl Intensity<'_> {
    fn get(&mut self, t: f64) -> f64 {
        let (knots, log_q) = (&self.noise.knots_s, &self.noise.log_q);
        while self.at + 1 < knots.len() && knots[self.at + 1] < t {
            self.at += 1;
        }
        let here = log_q[self.at];
        let Some(next) = knots.get(self.at + 1) else { return here.exp() };
        let x = ((t - knots[self.at]) / (next - knots[self.at])).clamp(0.0, 1.0);
        (here + x * (log_q[self.at + 1] - here)).exp()
    }
}

/// Results of the forward pass that the backward pass needs.
struct Kept<const N: usize> {
    state: SVector<f64, N>,
    covariance: SMatrix<f64, N, N>,
    gain: SVector<f64, N>,
    innovation: f64,
    /// Variance of the innovation; infinite where there was no angle.
    variance: f64,
}

/// Sums of the innovations: their count, squares over variance, and logarithms of variance.
#[derive(Clone, Copy, Debug, Default)]
struct Score {
    count: f64,
    squares: f64,
    logs: f64,
}

/// The forward pass; `keep` gets the filtered state after each time. The first `N` innovations, which only replace
/// the prior, are not scored.
fn forward<const N: usize>(
    data: Measured<'_>,
    noise: &Noise,
    mut keep: impl FnMut(Kept<N>, &Transition<N>),
) -> Score {
    let mut score = Score::default();
    let mut intensity = Intensity { noise, at: 0 };
    let first = data.phi_rad.iter().find(|p| p.is_finite()).copied().unwrap_or(0.0);
    let mut x = SVector::<f64, N>::zeros();
    x[0] = first;
    let mut p = SMatrix::<f64, N, N>::from_diagonal(&SVector::from_fn(|i, _| PRIOR[i] * PRIOR[i]));
    let mut step = Transition::<N>::new(0.0);
    let mut seen = 0;
    for (i, t) in data.t_s.iter().enumerate() {
        let dt = if i == 0 { 0.0 } else { t - data.t_s[i - 1] };
        if dt != step.dt {
            step = Transition::new(dt);
        }
        if dt > 0.0 {
            let q = intensity.get(t - 0.5 * dt);
            x = step.f * x;
            p = step.f * p * step.f.transpose() + step.q * q;
        }
        let mut kept = Kept {
            state: x,
            covariance: p,
            gain: SVector::zeros(),
            innovation: 0.0,
            variance: f64::INFINITY,
        };
        if data.phi_rad[i].is_finite() {
            let r = (noise.factor * data.sigma_rad[i]).powi(2);
            let column: SVector<f64, N> = p.column(0).into();
            let s = column[0] + r;
            let e = data.phi_rad[i] - x[0];
            let gain = column / s;
            x += gain * e;
            p -= gain * column.transpose();
            p = (p + p.transpose()) * 0.5;
            seen += 1;
            if seen > N {
                score.count += 1.0;
                score.squares += e * e / s;
                score.logs += s.ln();
            }
            kept = Kept { state: x, covariance: p, gain, innovation: e, variance: s };
        }
        keep(kept, &step);
    }
    score
}

impl Score {
    /// Logarithm of the likelihood.
    fn log_likelihood(&self) -> f64 {
        -0.5 * (self.squares + self.logs + self.count * std::f64::consts::TAU.ln())
    }
}

/// Smoothed states for a given noise (modified Bryson-Frazier form: no inverse of a covariance is needed).
#[must_use]
pub fn smooth<const N: usize>(data: Measured<'_>, noise: &Noise) -> Smoothed<N> {
    let n = data.t_s.len();
    let mut kept: Vec<Kept<N>> = Vec::with_capacity(n);
    let score = forward(data, noise, |k, _| kept.push(k));
    let mut out = Smoothed {
        state: vec![SVector::zeros(); n],
        covariance: vec![SMatrix::zeros(); n],
        log_likelihood: score.log_likelihood(),
    };
    // The adjoint variables: they carry what later angles say back in time.
    let mut l = SVector::<f64, N>::zeros();
    let mut big = SMatrix::<f64, N, N>::zeros();
    let mut step = Transition::<N>::new(0.0);
    for i in (0..n).rev() {
        let k = &kept[i];
        out.state[i] = k.state - k.covariance * l;
        let p = k.covariance - k.covariance * big * k.covariance;
        out.covariance[i] = (p + p.transpose()) * 0.5;
        if k.variance.is_finite() {
            let mut c = SMatrix::<f64, N, N>::identity();
            for row in 0..N {
                c[(row, 0)] -= k.gain[row];
            }
            l = c.transpose() * l;
            big = c.transpose() * big * c;
            l[0] -= k.innovation / k.variance;
            big[(0, 0)] += 1.0 / k.variance;
        }
        if i > 0 {
            let dt = data.t_s[i] - data.t_s[i - 1];
            if dt != step.dt {
                step = Transition::new(dt);
            }
            l = step.f.transpose() * l;
            big = step.f.transpose() * big * step.f;
            big = (big + big.transpose()) * 0.5;
        }
    }
    out
}

/// Largest roughness of the proxy of the truth in [`calibrate`] over that of the likeliest process, as a logarithm.
const ROUGHER: f64 = 3.0;

/// Factors by which the standard uncertainties of angle, rate and acceleration are to be multiplied.
///
/// The smoother's covariance is that of a Wiener process. A pendulum is smoother than one: most of the error is
/// noise that the smoother lets through, and there is less of it than the process would add by its own roughness.
/// So the error is measured on the smoother itself, which is linear: `white` (unit normal numbers, one per time)
/// passed through it is the noise part; what it takes away from a less smoothed version of the same motion is the
/// part that it flattens, less the noise in that version. Mean squares over the record, in units of the covariance.
#[must_use]
pub fn calibrate<const N: usize>(
    data: Measured<'_>,
    noise: &Noise,
    smoothed: &Smoothed<N>,
    white: &[f64],
) -> [f64; 3] {
    let again = |noise: &Noise, angles: &dyn Fn(usize) -> f64| {
        let phi: Vec<f64> = (0..data.t_s.len())
            .map(|i| if data.phi_rad[i].is_finite() { angles(i) } else { f64::NAN })
            .collect();
        smooth::<N>(Measured { phi_rad: &phi, ..data }, noise).state
    };
    let rough = Noise { log_q: noise.log_q.iter().map(|q| q + ROUGHER).collect(), ..noise.clone() };
    let unit = |i: usize| noise.factor * data.sigma_rad[i] * white[i];
    let passed = again(noise, &unit);
    let proxy = again(&rough, &|i| data.phi_rad[i]);
    let proxy_noise = again(&rough, &unit);
    let flattened = again(noise, &|i| proxy[i][0]);
    let flattened_noise = again(noise, &|i| proxy_noise[i][0]);
    let mut factors = [1.0; 3];
    for (c, factor) in factors.iter_mut().enumerate().take(N) {
        let mut sum = 0.0;
        let mut lost = 0.0;
        let mut count = 0.0;
        for i in 0..data.t_s.len() {
            let variance = smoothed.covariance[i][(c, c)];
            if variance > 0.0 && data.phi_rad[i].is_finite() {
                sum += passed[i][c].powi(2) / variance;
                lost += (flattened[i][c] - proxy[i][c]).powi(2) / variance;
                lost -= (flattened_noise[i][c] - proxy_noise[i][c]).powi(2) / variance;
                count += 1.0;
            }
        }
        if count > 100.0 {
            *factor = ((sum + f64::max(lost, 0.0)) / count).sqrt();
        }
    }
    factors
}

/// Least factor on the sigmas: a film in whole pixels at rest has no scatter at all.
const LEAST_FACTOR: f64 = 1e-3;

/// Added to the logarithm of every stretch's intensity. Within a stretch the motion is rough and quiet in turn, and
/// between the knots a line in the logarithm passes below the mean; a process a little too rough costs a few percent
/// of accuracy, one too smooth flattens peaks that its covariance knows nothing of. Chosen on simulated drops with
/// seeds apart from the tests': it raises the likelihood there and leaves [`calibrate`] little bias to estimate.
const PRUDENCE: f64 = 1.5;

/// Settings of the search for the noise.
#[derive(Clone, Copy, Debug)]
pub struct Search {
    /// Whether the given uncertainties may be scaled by a common factor.
    pub scale: bool,
    /// Length of the stretches with an intensity of their own, s; not finite for one intensity.
    pub stretch_s: f64,
}

/// The noise that makes the angles most likely.
#[must_use]
pub fn learn<const N: usize>(data: Measured<'_>, search: &Search) -> Noise {
    let constant = |log_q: f64, factor: f64| Noise { factor, knots_s: vec![0.0], log_q: vec![log_q] };
    let (start, end) = (data.t_s.first().copied().unwrap_or(0.0), data.t_s.last().copied().unwrap_or(0.0));
    // With all variances in proportion, the states do not change: the factor follows from the squares.
    let whole = |log_ratio: f64| {
        let score = forward::<N>(data, &constant(log_ratio, 1.0), |_, _| {});
        if !search.scale {
            return (score.log_likelihood(), 1.0);
        }
        let count = score.count.max(1.0);
        let factor = (score.squares / count).sqrt().max(LEAST_FACTOR);
        (-0.5 * (score.squares / (factor * factor) + score.logs + 2.0 * count * factor.ln()), factor)
    };
    let best = maximum(|x| whole(x).0, -10.0, 50.0, 13, 0.02);
    let factor = whole(best).1;
    let log_q = best + 2.0 * factor.ln();
    if !search.stretch_s.is_finite() || end - start < 2.0 * search.stretch_s {
        return constant(log_q, factor);
    }
    let mut noise = Noise { factor, knots_s: Vec::new(), log_q: Vec::new() };
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a count of stretches
    let pieces = ((end - start) / search.stretch_s).round() as usize;
    let mut from = 0;
    for piece in 0..pieces {
        #[allow(clippy::cast_precision_loss)]
        let until_s = start + (end - start) * (piece + 1) as f64 / pieces as f64;
        let to = from + data.t_s[from..].partition_point(|t| *t <= until_s);
        let part = Measured {
            t_s: &data.t_s[from..to],
            phi_rad: &data.phi_rad[from..to],
            sigma_rad: &data.sigma_rad[from..to],
        };
        // Enough angles to say anything beyond those that replace the prior.
        if part.phi_rad.iter().filter(|p| p.is_finite()).count() >= 10 * N {
            let local = |x: f64| {
                let score = forward::<N>(part, &constant(x, factor), |_, _| {});
                // A weak pull to the whole record's intensity: a still pendulum's is minus infinity.
                score.log_likelihood() - 0.5 * ((x - log_q) / 10.0).powi(2)
            };
            noise.knots_s.push(0.5 * (part.t_s[0] + part.t_s[part.t_s.len() - 1]));
            noise.log_q.push(PRUDENCE + maximum(local, log_q - 30.0, log_q + 12.0, 9, 0.1));
        }
        from = to;
    }
    if noise.knots_s.is_empty() { constant(log_q, factor) } else { noise }
}

/// Place of the maximum of `f` on `[a, b]`: a grid of `points`, then golden sections down to `width`.
fn maximum(f: impl Fn(f64) -> f64, a: f64, b: f64, points: u32, width: f64) -> f64 {
    let spacing = (b - a) / f64::from(points - 1);
    let mut best = (a, f64::NEG_INFINITY);
    for i in 0..points {
        let x = a + spacing * f64::from(i);
        let y = f(x);
        if y > best.1 {
            best = (x, y);
        }
    }
    let golden = 0.5 * (5f64.sqrt() - 1.0);
    let (mut lo, mut hi) = (best.0 - spacing, best.0 + spacing);
    let (mut x1, mut x2) = (hi - golden * (hi - lo), lo + golden * (hi - lo));
    let (mut y1, mut y2) = (f(x1), f(x2));
    while hi - lo > width {
        if y1 > y2 {
            (hi, x2, y2) = (x2, x1, y1);
            x1 = hi - golden * (hi - lo);
            y1 = f(x1);
        } else {
            (lo, x1, y1) = (x1, x2, y2);
            x2 = lo + golden * (hi - lo);
            y2 = f(x2);
        }
    }
    0.5 * (lo + hi)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};

    /// The smoother against Gaussian conditioning of the whole process at once.
    #[test]
    fn equals_the_conditional_distribution() {
        let t_s = [0.0, 0.1, 0.25, 0.3, 0.5, 0.55];
        let phi_rad = [0.3, 0.1, f64::NAN, -0.2, -0.1, 0.4];
        let sigma_rad = [0.05, 0.1, 0.1, 0.02, 0.05, 0.05];
        let data = Measured { t_s: &t_s, phi_rad: &phi_rad, sigma_rad: &sigma_rad };
        let noise = Noise { factor: 1.5, knots_s: vec![0.0], log_q: vec![3.0] };
        let ours = smooth::<3>(data, &noise);
        // One least-squares problem for all states: prior, process and angles, each in its own sigmas.
        let n = t_s.len();
        let mut rows: Vec<(DVector<f64>, f64)> = Vec::new();
        for c in 0..3 {
            let mut row = DVector::zeros(3 * n);
            row[c] = 1.0 / PRIOR[c];
            rows.push((row, if c == 0 { 0.3 / PRIOR[0] } else { 0.0 }));
        }
        for i in 1..n {
            let s = Transition::<3>::new(t_s[i] - t_s[i - 1]);
            let white = (s.q * 3f64.exp()).cholesky().unwrap().l().try_inverse().unwrap();
            for c in 0..3 {
                let mut row = DVector::zeros(3 * n);
                for k in 0..3 {
                    row[3 * i + k] = white[(c, k)];
                    row[3 * i - 3 + k] = -(white * s.f)[(c, k)];
                }
                rows.push((row, 0.0));
            }
        }
        for i in (0..n).filter(|i| phi_rad[*i].is_finite()) {
            let mut row = DVector::zeros(3 * n);
            row[3 * i] = 1.0 / (1.5 * sigma_rad[i]);
            rows.push((row, phi_rad[i] / (1.5 * sigma_rad[i])));
        }
        let a = DMatrix::from_fn(rows.len(), 3 * n, |r, c| rows[r].0[c]);
        let b = DVector::from_fn(rows.len(), |r, _| rows[r].1);
        let qr = a.qr();
        let inverse = qr.r().try_inverse().unwrap();
        let mean = &inverse * (qr.q().transpose() * b);
        let post = &inverse * inverse.transpose();
        for i in 0..n {
            for c in 0..3 {
                let sigma = post[(3 * i + c, 3 * i + c)].sqrt();
                // The rows differ in size by 1e8 from the wide prior: half the digits are left.
                // Half the digits are lost where the wide prior is subtracted: at the first times.
                assert!((ours.state[i][c] - mean[3 * i + c]).abs() < 1e-6 * sigma, "{i} {c}");
                assert!((ours.covariance[i][(c, c)].sqrt() / sigma - 1.0).abs() < 1e-4, "{i} {c}");
            }
        }
    }

    #[test]
    fn finds_the_noise_of_a_made_process() {
        use rand::{RngExt as _, SeedableRng as _};
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        let mut normal = move || {
            (-2.0 * rng.random::<f64>().ln()).sqrt() * (std::f64::consts::TAU * rng.random::<f64>()).cos()
        };
        let (n, dt, q, sigma): (u32, f64, f64, f64) = (20_000, 1e-3, 1e5, 2e-3);
        let step = Transition::<3>::new(dt);
        let root = (step.q * q).cholesky().unwrap().l();
        let mut x = SVector::<f64, 3>::zeros();
        let (mut t_s, mut phi, mut truth) = (Vec::new(), Vec::new(), Vec::new());
        for i in 0..n {
            x = step.f * x + root * SVector::<f64, 3>::from_fn(|_, _| normal());
            t_s.push(f64::from(i) * dt);
            phi.push(x[0] + sigma * normal());
            truth.push(x);
        }
        // Uncertainties given twice too small: the factor must come out as two.
        let sigma_rad = vec![0.5 * sigma; phi.len()];
        let data = Measured { t_s: &t_s, phi_rad: &phi, sigma_rad: &sigma_rad };
        let noise = learn::<3>(data, &Search { scale: true, stretch_s: f64::INFINITY });
        // 20000 angles give the factor to 0.5 %; the 2000 or so independent stretches of the process give q to 10 %.
        assert!((noise.factor - 2.0).abs() < 0.03, "{}", noise.factor);
        assert!((noise.log_q[0] - q.ln()).abs() < 0.3, "{} {}", noise.log_q[0], q.ln());
        let out = smooth::<3>(data, &noise);
        for c in 0..3 {
            let z: f64 = out
                .state
                .iter()
                .zip(&out.covariance)
                .zip(&truth)
                .map(|((s, p), x)| (s[c] - x[c]).powi(2) / p[(c, c)])
                .sum::<f64>()
                / f64::from(n);
            assert!((z - 1.0).abs() < 0.15, "component {c}: {z}");
        }
    }
}
