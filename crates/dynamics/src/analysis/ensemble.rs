//! Simulates many motions at once, on all cores; the results do not depend on how many there are.

use rayon::prelude::*;

use crate::analysis::simulate::{Failure, Run, Settings, simulate};
use crate::parameters::Parameters;
use crate::state::State;

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
    threads::install(|| {
        cases.par_iter().with_max_len(1).map(|c| simulate(&c.parameters, c.state, times, settings)).collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::damped;

    #[test]
    fn an_ensemble_is_its_runs_in_order() {
        let p = damped();
        let cases: Vec<Case> =
            (0..7).map(|i| Case { parameters: p, state: [0.3 * f64::from(i), 1.0, 0.0, 0.0] }).collect();
        let times = [0.0, 0.5, 1.0];
        for (case, run) in cases.iter().zip(ensemble(&cases, &times, &Settings::default())) {
            let alone = simulate(&p, case.state, &times, &Settings::default()).unwrap();
            assert_eq!(run.unwrap().samples[2].x, alone.samples[2].x);
        }
    }
}
