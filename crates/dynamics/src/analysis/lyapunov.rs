//! Computes the largest Lyapunov exponent by the growth of an exactly carried tangent vector.

use crate::analysis::simulate::Failure;
use crate::integrate::dop853::{Step, next_factor};
use crate::motion::accelerations;
use crate::parameters::{Field, Parameters};
use crate::scalar::Dual;
use crate::state::{Contact, State};

/// Settings of an exponent: how long, how often, how exactly.
#[derive(Clone, Copy, Debug)]
pub struct Growth {
    /// Time between two renormalisations of the tangent vector, s.
    pub interval_s: f64,
    /// Intervals at the start that are not counted, while the tangent turns into the growing direction.
    pub skipped: usize,
    /// Intervals counted.
    pub counted: usize,
    /// Local error allowed, as in [`crate::analysis::simulate::Settings`].
    pub tolerance: f64,
}

/// Mean rate of growth of the tangent vector in each counted interval, 1/s. Their mean estimates the exponent.
///
/// # Errors
/// Dry friction (its jumps have no tangent; a pendulum that comes to rest has no exponent anyway), a state that is
/// not finite, a step that becomes too small.
pub fn growth_rates(p: &Parameters<f64>, x: State<f64>, ask: &Growth) -> Result<Vec<f64>, Failure> {
    for field in [Field::Rmu1, Field::Rmu2, Field::TauC1, Field::TauC2] {
        if p.get(field) != 0.0 {
            return Err(Failure::Settings(format!(
                "{} is not zero: the exponent is for motion without dry friction",
                field.name()
            )));
        }
    }
    if !x.iter().all(|v| v.is_finite()) {
        return Err(Failure::State(format!("{x:?} is not finite")));
    }
    if !(ask.interval_s > 0.0 && ask.interval_s.is_finite()) {
        return Err(Failure::Settings(format!(
            "the interval is {} s. Choose a positive one",
            ask.interval_s
        )));
    }
    let lifted: Parameters<Dual<1>> = p.lift();
    let contact = [Contact::Slip(1.0); 2];
    let mut f = |y: &State<Dual<1>>| {
        let a = accelerations(&lifted, y, contact).a;
        [y[2], y[3], a[0], a[1]]
    };
    let (length, time) = scales(p);
    // A start that is in no plane of symmetry.
    let tangent = [0.5, -0.4, 0.6, 0.3];
    let mut y: State<Dual<1>> = std::array::from_fn(|i| Dual { v: x[i], d: [tangent[i]] });
    let mut slope = f(&y);
    let mut h = 1e-3;
    let mut rates = Vec::with_capacity(ask.counted);
    let (mut start_s, mut now) = (0.0, 0.0);
    for interval in 0..ask.skipped + ask.counted {
        let before = size(&y, time);
        let end_s = start_s + ask.interval_s;
        let mut rejected = false;
        while now < end_s {
            let last = now + h >= end_s;
            let step_h = if last { end_s - now } else { h };
            if step_h < 1e-13 && !last {
                return Err(Failure::Stalled { t_s: now, problem: "the step became too small".to_owned() });
            }
            let step = Step::take(&mut f, &y, &slope, step_h);
            let scale: [f64; 4] = std::array::from_fn(|i| ask.tolerance * step.end[i].v.abs().max(length));
            let error = step.error(&scale);
            if error <= 1.0 {
                let factor = next_factor(error, rejected);
                h = if last { h.max(step_h * factor) } else { step_h * factor };
                now = if last { end_s } else { now + step_h };
                (y, slope) = (step.end, step.slope);
                rejected = false;
            } else {
                h = if error.is_finite() { step_h * next_factor(error, true) } else { step_h * 0.1 };
                rejected = true;
            }
        }
        let after = size(&y, time);
        if interval >= ask.skipped {
            rates.push((after / before).ln() / ask.interval_s);
        }
        for v in &mut y {
            v.d[0] /= after;
        }
        slope = f(&y);
        start_s = end_s;
    }
    Ok(rates)
}

/// One radian, and the time in which a small swing moves by its amplitude: they make the tangent's four components
/// comparable. The exponent does not depend on them.
fn scales(p: &Parameters<f64>) -> (f64, f64) {
    let weight = p.get(Field::Sigma) + p.get(Field::Kappa);
    let time = if weight > 0.0 { (2.0 * p.get(Field::Psi) / weight).sqrt() } else { 1.0 };
    (1.0, time)
}

fn size(y: &State<Dual<1>>, time: f64) -> f64 {
    let d = |i: usize| y[i].d[0];
    (d(0).powi(2) + d(1).powi(2) + (d(2) * time).powi(2) + (d(3) * time).powi(2)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::pendulum;

    #[test]
    fn small_swings_do_not_grow_and_the_drop_does() {
        let ask = Growth { interval_s: 1.0, skipped: 10, counted: 100, tolerance: 1e-10 };
        let mean = |x| {
            let r = growth_rates(&pendulum(), x, &ask).unwrap();
            r.iter().sum::<f64>() / 100.0
        };
        // A regular motion's tangent grows at most in proportion to time: ln(110/10)/100 s = 0.02 per second.
        assert!(mean([0.02, 0.01, 0.0, 0.0]).abs() < 0.05);
        // The drop's errors grow 10^8 times in 4 s (issue): several per second.
        assert!(mean([3.1, 3.1, 0.0, 0.0]) > 1.0);
    }

    #[test]
    fn the_tangent_is_the_difference_of_two_neighbours() {
        let p = pendulum();
        let x = [2.0, 1.0, 0.5, -3.0];
        let ask = Growth { interval_s: 0.3, skipped: 0, counted: 1, tolerance: 1e-13 };
        let rate = growth_rates(&p, x, &ask).unwrap()[0];
        let end = |sign: f64| {
            let tangent = [0.5, -0.4, 0.6, 0.3];
            let y = std::array::from_fn(|i| x[i] + sign * 1e-5 * tangent[i]);
            let settings = crate::analysis::simulate::Settings::default();
            crate::analysis::simulate::simulate(&p, y, &[0.0, 0.3], &settings).unwrap().samples[1].x
        };
        let (up, down) = (end(1.0), end(-1.0));
        let (_, time) = scales(&p);
        let y: State<Dual<1>> = std::array::from_fn(|i| Dual { v: 0.0, d: [(up[i] - down[i]) / 2e-5] });
        let start: State<Dual<1>> = [0.5, -0.4, 0.6, 0.3].map(|d| Dual { v: 0.0, d: [d] });
        let expected = (size(&y, time) / size(&start, time)).ln() / 0.3;
        // central differences: h^2 of the third derivatives, 1e-10 of a few hundred
        assert!((rate - expected).abs() < 1e-6, "{rate} {expected}");
    }
}
