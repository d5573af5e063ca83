//! Makes the paper's pendulum with the corrected constants, for tests.

use crate::parameters::{Field, Fixed, Parameters};

/// Without damping.
pub fn pendulum() -> Parameters<f64> {
    let fixed = Fixed {
        m1_kg: 0.3057,
        m2_kg: 0.1225,
        l1_m: 0.1719,
        g_m_s2: 9.81,
        lower_inner_m: -0.0081,
        lower_outer_m: 0.1511,
    };
    with(
        Parameters::zero(fixed),
        &[
            (Field::Psi, 3.431e-3),
            (Field::Lambda, 4.193e-4),
            (Field::Zeta, 1.86e-8),
            (Field::A3, 1.4257e-3),
            (Field::Sigma, 0.4502),
            (Field::Kappa, 0.08136),
        ],
    )
}

/// Damped by every law of a bearing and by drag, with dry friction strong enough to stick.
pub fn damped() -> Parameters<f64> {
    with(
        pendulum(),
        &[
            (Field::MuV1, 1.76e-5),
            (Field::MuV2, 5e-6),
            (Field::MuQ1, 1.4e-5),
            (Field::Rmu1, 3e-5),
            (Field::Rmu2, 3e-5),
            (Field::TauC1, 4e-3),
            (Field::TauC2, 1e-3),
            (Field::StripDrag, 1e-6),
        ],
    )
}

/// With every term there is.
pub fn all_terms() -> Parameters<f64> {
    with(
        damped(),
        &[
            (Field::MuQ2, 3e-7),
            (Field::TauC1, 1e-4),
            (Field::TauC2, 2e-5),
            (Field::AddedInertia, 1e-5),
            (Field::Tilt, 0.01),
            (Field::Offset1, 1e-5),
            (Field::Offset2, -2e-5),
        ],
    )
}

fn with(mut p: Parameters<f64>, values: &[(Field, f64)]) -> Parameters<f64> {
    for (field, value) in values {
        p.set(*field, *value);
    }
    p
}
