//! Each error of the tracker as its own Python exception, those of `pydpend.errors`.
//!
//! Must not: define exceptions; Python does, so that they have one home.

use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use pyo3::types::PyType;
use tracker::error::Error;

/// An exception of `pydpend.errors` by its name.
pub fn exception(py: Python<'_>, class: &str, message: String) -> PyErr {
    match py
        .import("pydpend.errors")
        .and_then(|m| m.getattr(class))
        .and_then(|c| Ok(c.cast_into::<PyType>()?))
    {
        Ok(class) => PyErr::from_type(class, message),
        // The package is broken: that is then what there is to say.
        Err(error) => error,
    }
}

/// The Python exception of a tracker's error.
pub fn raise(py: Python<'_>, error: Error) -> PyErr {
    let class = match &error {
        Error::Source(_) => "SourceError",
        Error::Detect(_) => "DetectError",
        Error::Rig(_) => "RigError",
        Error::Table(_) => "TableError",
        Error::Film(_) => "FilmError",
        Error::Argument(_) => "ArgumentError",
        Error::Interrupted => return PyKeyboardInterrupt::new_err(()),
        _ => "TrackerError",
    };
    exception(py, class, error.to_string())
}

/// A refusal of an argument: `name: problem. Advice`.
pub fn argument(py: Python<'_>, name: &str, problem: impl std::fmt::Display, advice: &str) -> PyErr {
    exception(py, "ArgumentError", format!("{name}: {problem}. {advice}"))
}
