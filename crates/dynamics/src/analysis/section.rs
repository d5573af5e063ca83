//! Computes Poincaré sections: where a motion passes a given angle of one link, in a given direction.

use std::f64::consts::TAU;

use crate::analysis::simulate::{Failure, Settings};
use crate::integrate::flight::Flight;
use crate::parameters::Parameters;
use crate::state::State;

/// Number of points of each step at which the angle is examined.
const LOOKS: u32 = 8;

/// The condition `phi = angle (mod 2 pi)`.
#[derive(Clone, Copy, Debug)]
pub struct Section {
    /// The link, 0 or 1.
    pub link: usize,
    /// Its angle, rad.
    pub angle_rad: f64,
    /// Only with this sign of its rate; 0 for both.
    pub direction: f64,
}

/// States on the section, with their times, for `duration_s` from `x`. The angles are as they are, not reduced.
///
/// # Errors
/// As [`crate::analysis::simulate::simulate`].
pub fn poincare(
    p: &Parameters<f64>,
    x: State<f64>,
    duration_s: f64,
    section: Section,
    settings: &Settings,
) -> Result<Vec<(f64, State<f64>)>, Failure> {
    let mut flight = Flight::new(p, x, 0.0, settings)?;
    let mut found = Vec::new();
    // The number of whole turns past the section's angle: it changes by one at a crossing.
    let turns = |x: &State<f64>| ((x[section.link] - section.angle_rad) / TAU).floor();
    while flight.t_s < duration_s && !flight.at_rest() {
        let leg = flight.step(duration_s)?;
        let mut before = 0.0;
        let mut count = turns(&leg.dense.first::<4>(0.0));
        for look in 1..=LOOKS {
            let here = f64::from(look) / f64::from(LOOKS);
            let now = turns(&leg.dense.first::<4>(here));
            if now != count {
                let (mut a, mut b) = (before, here);
                for _ in 0..60 {
                    let middle = 0.5 * (a + b);
                    if turns(&leg.dense.first::<4>(middle)) == count { a = middle } else { b = middle }
                }
                let state = leg.dense.first::<4>(b);
                let rate = state[2 + section.link];
                if section.direction == 0.0 || section.direction * rate > 0.0 {
                    found.push((leg.from_s + b * leg.h, state));
                }
            }
            before = here;
            count = now;
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::pendulum;
    use crate::parameters::Field;

    #[test]
    fn a_pinned_pendulum_passes_its_lowest_point_twice_a_period() {
        let p = pendulum();
        let settings = Settings { pinned: true, ..Settings::default() };
        let section = Section { link: 0, angle_rad: 0.0, direction: 1.0 };
        let amplitude: f64 = 1e-3;
        let found = poincare(&p, [amplitude, amplitude, 0.0, 0.0], 20.0, section, &settings).unwrap();
        let sum = |fields: [Field; 2]| fields.iter().map(|f| p.get(*f)).sum::<f64>();
        let inertia = 2.0 * (sum([Field::Psi, Field::Lambda]) + sum([Field::Zeta, Field::A3]));
        let weight = sum([Field::Sigma, Field::Kappa]);
        // period of a small swing, with the amplitude's first correction
        let period = TAU * (inertia / weight).sqrt() * (1.0 + amplitude * amplitude / 16.0);
        for (k, (t, x)) in found.iter().enumerate() {
            let expected = period * (0.75 + k as f64);
            // the next correction is of order amplitude^4; the rest is the integrator
            assert!((t - expected).abs() < 1e-9, "{t} {expected}");
            assert!(x[0].abs() < 1e-13 && x[2] > 0.0);
        }
        assert_eq!(found.len(), ((20.0 / period) - 0.75).floor() as usize + 1);
    }
}
