//! Python module `pydpend._tracker`.
use pyo3::prelude::*;

/// The compiled half of pydpend.
#[pymodule]
mod _tracker {}
