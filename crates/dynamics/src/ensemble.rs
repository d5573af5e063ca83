//! Many motions at once, on all cores; the results do not depend on how many there are.

use rayon::prelude::*;

use crate::motion::State;
use crate::parameters::Parameters;
use crate::simulate::{Failure, Run, Settings, simulate};

/// One motion of an ensemble.
#[derive(Clone, Copy, Debug)]
pub struct Case {
    /// The pendulum.
    pub parameters: Parameters<f64>,
    /// Where it starts.
    pub state: State<f64>,
}

/// [`simulate`] for every case, in their order.
#[must_use]
pub fn ensemble(cases: &[Case], times: &[f64], settings: &Settings) -> Vec<Result<Run, Failure>> {
    // Runs differ in cost by stick and chaos, so they are handed out singly.
    cases.par_iter().with_max_len(1).map(|c| simulate(&c.parameters, c.state, times, settings)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::{Field, Fixed};

    #[test]
    fn an_ensemble_is_its_runs_in_order() {
        let fixed = Fixed {
            m1_kg: 0.3,
            m2_kg: 0.12,
            l1_m: 0.17,
            g_m_s2: 9.81,
            lower_inner_m: 0.0,
            lower_outer_m: 0.15,
        };
        let mut p = Parameters::zero(fixed);
        for (field, value) in [
            (Field::Psi, 3.4e-3),
            (Field::Lambda, 4.2e-4),
            (Field::A3, 1.4e-3),
            (Field::Sigma, 0.45),
            (Field::Kappa, 0.08),
            (Field::TauC1, 1e-4),
        ] {
            p.set(field, value);
        }
        let cases: Vec<Case> =
            (0..7).map(|i| Case { parameters: p, state: [0.3 * f64::from(i), 1.0, 0.0, 0.0] }).collect();
        let times = [0.0, 0.5, 1.0];
        for (case, run) in cases.iter().zip(ensemble(&cases, &times, &Settings::default())) {
            let alone = simulate(&p, case.state, &times, &Settings::default()).unwrap();
            assert_eq!(run.unwrap().samples[2].x, alone.samples[2].x);
        }
    }
}
