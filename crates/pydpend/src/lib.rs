//! Python module `pydpend._tracker`.
mod simulation;

use pyo3::prelude::*;

/// The compiled half of pydpend.
#[pymodule]
mod _tracker {
    #[pymodule_export]
    use super::simulation::{poincare_section, simulate_ensemble, simulate_motion, tangent_growth};
}
