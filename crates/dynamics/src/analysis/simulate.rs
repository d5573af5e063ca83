//! Simulates a motion with exact dry friction: DOP853 between located events, energies and works beside the state.

use crate::integrate::flight::{Flight, SIZE, state};
use crate::motion::{energies, flow};
use crate::parameters::Parameters;
use crate::state::{Contact, State};
use crate::terms::TERMS;

pub use crate::integrate::flight::{Event, Failure, Settings};

/// Ending of a simulation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// At the last time.
    Done,
    /// Both joints stuck for good before the last time; the rest of the samples are that rest.
    AtRest,
}

/// One time of a simulation.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// Angles and rates.
    pub x: State<f64>,
    /// Accelerations, rad/s^2.
    pub a: [f64; 2],
    /// Normal forces, N.
    pub normal: [f64; 2],
    /// Dry torques, N m.
    pub dry: [f64; 2],
    /// Kinetic plus potential energy, J.
    pub energy: f64,
    /// Work taken out since the start by each of [`TERMS`], J.
    pub works: [f64; TERMS.len()],
}

/// A simulated motion.
#[derive(Clone, Debug)]
pub struct Run {
    /// One per time asked for.
    pub samples: Vec<Sample>,
    /// Changes of contact, in order.
    pub events: Vec<Event>,
    /// How it ended.
    pub ending: Ending,
    /// When it ended, s.
    pub end_s: f64,
    /// Steps taken.
    pub steps: usize,
}

fn sample(p: &Parameters<f64>, y: &[f64; SIZE], contact: [Contact; 2]) -> Sample {
    let x = state(y);
    let (m, _) = flow(p, &x, contact);
    let [kinetic, potential] = energies(p, &x);
    Sample {
        x,
        a: m.a,
        normal: m.normal,
        dry: m.dry,
        energy: kinetic + potential,
        works: std::array::from_fn(|i| y[4 + i]),
    }
}

/// The motion from `x` at `times[0]`, sampled at `times`.
///
/// # Errors
/// [`Failure`]: a bad state, times that do not increase, or a run that cannot go on.
pub fn simulate(
    p: &Parameters<f64>,
    x: State<f64>,
    times: &[f64],
    settings: &Settings,
) -> Result<Run, Failure> {
    for (i, pair) in times.windows(2).enumerate() {
        if pair[1] <= pair[0] || pair[1].is_nan() {
            return Err(Failure::Times { index: i + 1, before: pair[0], now: pair[1] });
        }
    }
    let (Some(first), Some(last)) = (times.first(), times.last()) else {
        return Err(Failure::Settings("no times were asked for".to_owned()));
    };
    if !first.is_finite() || !last.is_finite() {
        return Err(Failure::Settings(format!("times from {first} to {last} s are not finite")));
    }
    let mut flight = Flight::new(p, x, *first, settings)?;
    let mut run = Run {
        samples: Vec::with_capacity(times.len()),
        events: Vec::new(),
        ending: Ending::Done,
        end_s: *last,
        steps: 0,
    };
    run.samples.push(sample(p, &flight.y, flight.contact));
    let mut next = 1;
    while next < times.len() {
        if flight.at_rest() {
            run.ending = Ending::AtRest;
            run.end_s = flight.t_s;
            let rest = sample(p, &flight.y, flight.contact);
            run.samples.resize(times.len(), rest);
            break;
        }
        let leg = flight.step(*last)?;
        while next < times.len() && times[next] <= flight.t_s {
            let y = leg.dense.at((times[next] - leg.from_s) / leg.h);
            run.samples.push(sample(p, &y, leg.contact));
            next += 1;
        }
        run.events.extend(leg.event);
    }
    run.steps = flight.steps;
    Ok(run)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{damped, pendulum};
    use crate::friction::Friction;
    use crate::parameters::Field;

    fn drop() -> State<f64> {
        [181f64.to_radians(), 181f64.to_radians(), 0.0, 0.0]
    }

    fn times(seconds: u32) -> Vec<f64> {
        (0..=seconds * 100).map(|i| f64::from(i) / 100.0).collect()
    }

    fn balance(run: &Run) -> f64 {
        let e0 = run.samples[0].energy;
        run.samples
            .iter()
            .map(|s| (s.energy + s.works.iter().sum::<f64>() - e0).abs() / e0)
            .fold(0.0, f64::max)
    }

    #[test]
    fn energy_balances_over_a_minute_of_stick_and_slip() {
        let p = damped();
        let run = simulate(&p, drop(), &times(60), &Settings::default()).unwrap();
        assert!(balance(&run) < 1e-9, "{}", balance(&run));
        assert!(run.events.iter().any(|e| e.to == Contact::Stuck));
        assert!(run.events.iter().any(|e| e.from == Contact::Stuck));
        assert_eq!(run.ending, Ending::AtRest);
        // at rest the joints hold what gravity asks of them
        let last = run.samples[run.samples.len() - 1];
        let [s1, s2] = [last.x[0].sin() * p.get(Field::Sigma), last.x[1].sin() * p.get(Field::Kappa)];
        assert!((last.dry[1] + s2).abs() < 1e-12 && (last.dry[0] + s1 + s2).abs() < 1e-12, "{last:?}");
    }

    #[test]
    fn energy_is_kept_without_damping() {
        let run = simulate(&pendulum(), drop(), &times(60), &Settings::default()).unwrap();
        assert!(balance(&run) < 1e-10, "{}", balance(&run));
    }

    #[test]
    fn a_mirrored_start_gives_exactly_the_mirrored_motion() {
        let p = damped();
        let x = [2.9, -1.3, 0.4, 5.0];
        let one = simulate(&p, x, &times(5), &Settings::default()).unwrap();
        let other = simulate(&p, x.map(|v: f64| -v), &times(5), &Settings::default()).unwrap();
        for (a, b) in one.samples.iter().zip(&other.samples) {
            assert_eq!(a.x, b.x.map(|v: f64| -v));
            assert_eq!(a.energy, b.energy);
        }
    }

    #[test]
    fn without_gravity_and_damping_angular_momentum_is_kept() {
        let mut p = pendulum();
        p.set(Field::Sigma, 0.0);
        p.set(Field::Kappa, 0.0);
        p.fixed.g_m_s2 = 0.0;
        let momentum = |x: &State<f64>| {
            let m = crate::motion::mass_matrix(&p, [x[0], x[1]]);
            (m[0] + m[1]) * x[2] + (m[1] + m[2]) * x[3]
        };
        let fine = Settings { tolerance: 1e-14, ..Settings::default() };
        let run = simulate(&p, [0.3, 1.9, 7.0, -11.0], &times(10), &fine).unwrap();
        let l0 = momentum(&run.samples[0].x);
        for s in &run.samples {
            assert!((momentum(&s.x) / l0 - 1.0).abs() < 1e-12, "{}", momentum(&s.x) / l0 - 1.0);
        }
    }

    #[test]
    fn a_pinned_joint_makes_a_single_pendulum() {
        let mut p = damped();
        for field in [Field::MuV1, Field::MuQ1, Field::Rmu1, Field::TauC1, Field::StripDrag] {
            p.set(field, 0.0);
        }
        let settings = Settings { pinned: true, ..Settings::default() };
        let run = simulate(&p, [0.5, 0.9, 0.0, 0.0], &times(5), &settings).unwrap();
        for s in &run.samples {
            // the angle between the links is kept to rounding
            assert!((s.x[1] - s.x[0] - 0.4).abs() < 1e-13 && s.x[2] == s.x[3]);
        }
        // nothing moves in joint 2, so nothing is lost
        assert!(balance(&run) < 1e-10, "{}", balance(&run));
    }

    #[test]
    fn bad_input_is_named() {
        let p = damped();
        let ask = |x: State<f64>, t: &[f64], settings: &Settings| {
            simulate(&p, x, t, settings).unwrap_err().to_string()
        };
        let good = Settings::default();
        assert!(ask([0.0, f64::NAN, 0.0, 0.0], &[0.0, 1.0], &good).contains("not finite"));
        assert!(ask([0.0; 4], &[0.0, 1.0, 1.0], &good).contains("index 2"));
        assert!(ask([0.0; 4], &[], &good).contains("no times"));
        assert!(
            ask([0.0, 0.0, 1.0, 0.0], &[0.0, 1.0], &Settings { pinned: true, ..good }).contains("pinned")
        );
        assert!(ask([0.0; 4], &[0.0, 1.0], &Settings { tolerance: 0.0, ..good }).contains("tolerance"));
        let smooth = Settings { friction: Friction::Smooth(0.0), ..good };
        assert!(ask([0.0; 4], &[0.0, 1.0], &smooth).contains("width"));
    }
}
