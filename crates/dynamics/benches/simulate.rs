//! Time of one minute of simulation, damped with stick and slip and undamped: `cargo bench -p dynamics --bench
//! simulate`. Prints the best of several runs and the energy balance it was had at; best, because other programs
//! can only make a run longer.

use dynamics::analysis::simulate::{Run, Settings, simulate};
use dynamics::parameters::{Field, Fixed, Parameters};
use std::time::Instant;

fn pendulum(damped: bool) -> Parameters<f64> {
    let fixed = Fixed {
        m1_kg: 0.3057,
        m2_kg: 0.1225,
        l1_m: 0.1719,
        g_m_s2: 9.81,
        lower_inner_m: -0.0081,
        lower_outer_m: 0.1511,
    };
    let mut p = Parameters::zero(fixed);
    let model = [
        (Field::Psi, 3.431e-3),
        (Field::Lambda, 4.193e-4),
        (Field::Zeta, 1.86e-8),
        (Field::A3, 1.4257e-3),
        (Field::Sigma, 0.4502),
        (Field::Kappa, 0.08136),
    ];
    let damping = [
        (Field::MuV1, 1.76e-5),
        (Field::MuV2, 5e-6),
        (Field::MuQ1, 1.4e-5),
        (Field::Rmu1, 3e-5),
        (Field::Rmu2, 3e-5),
        (Field::TauC1, 2e-3),
        (Field::TauC2, 2e-4),
        (Field::StripDrag, 1e-6),
    ];
    for (field, value) in model.into_iter().chain(damping.into_iter().take(if damped { 8 } else { 0 })) {
        p.set(field, value);
    }
    p
}

fn balance(run: &Run) -> f64 {
    let e0 = run.samples[0].energy;
    run.samples.iter().map(|s| (s.energy + s.works.iter().sum::<f64>() - e0).abs() / e0).fold(0.0, f64::max)
}

fn main() {
    let start = [181f64.to_radians(), 181f64.to_radians(), 0.0, 0.0];
    let times: Vec<f64> = (0..=60_000).map(|i| f64::from(i) / 1000.0).collect();
    for damped in [true, false] {
        let p = pendulum(damped);
        for tolerance in [3e-13, 1e-12, 1e-11] {
            let settings = Settings { tolerance, ..Settings::default() };
            let mut best = f64::INFINITY;
            let mut last = None;
            for _ in 0..5 {
                let began = Instant::now();
                let run = simulate(&p, start, &times, &settings);
                best = best.min(began.elapsed().as_secs_f64());
                last = run.ok();
            }
            if let Some(run) = last {
                println!(
                    "damped {damped}, tolerance {tolerance:e}: {best:.3} s, {} steps, {} events, balance {:.1e}",
                    run.steps,
                    run.events.len(),
                    balance(&run)
                );
            }
        }
    }
}
