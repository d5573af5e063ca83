//! Raises each error of the tracker as its own Python exception, those of `pydpend.errors`.
//!
//! Must not: define exceptions; Python does, so that they have one home.

use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use pyo3::types::{PyTuple, PyType};
use tracker::error::Error;
use tracker::message::{Message, Piece};

/// An exception of `pydpend.errors` by its name.
pub fn exception(py: Python<'_>, class: &str, message: &Message) -> PyErr {
    let found = py
        .import("pydpend.errors")
        .and_then(|m| m.getattr(class))
        .and_then(|c| Ok((c.cast_into::<PyType>()?, to_python(py, message)?.unbind())));
    match found {
        Ok((class, message)) => PyErr::from_type(class, (message,)),
        // The package is broken: that is then what there is to say.
        Err(error) => error,
    }
}

/// A `Message` of `pydpend.errors`, its settings and steps still data.
pub fn to_python<'py>(py: Python<'py>, message: &Message) -> PyResult<Bound<'py, PyAny>> {
    let errors = py.import("pydpend.errors")?;
    let piece = |(i, piece): (usize, &Piece)| match piece {
        Piece::Text(text) => Ok(text.into_pyobject(py)?.into_any()),
        // What a message begins with is what it is about.
        Piece::Setting { setting, value: None } if i > 0 && setting.is_switch() => {
            errors.getattr("Setting")?.call1((setting.name(), true))
        }
        Piece::Setting { setting, value } => {
            errors.getattr("Setting")?.call1((setting.name(), value, i == 0))
        }
        Piece::Step(step) => errors.getattr("Step")?.call1((step.command.as_ref(), step.call.as_ref())),
    };
    let pieces = message.pieces().iter().enumerate().map(piece).collect::<PyResult<Vec<_>>>()?;
    errors.getattr("Message")?.call1((PyTuple::new(py, pieces)?,))
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
    let raised = exception(py, class, &error.message());
    match raised.value(py).setattr("kind", error.kind().name()) {
        Ok(()) => raised,
        Err(error) => error,
    }
}

/// A refusal of an argument: `name: problem. Advice`.
pub fn argument(py: Python<'_>, name: &str, problem: impl std::fmt::Display, advice: &str) -> PyErr {
    exception(py, "ArgumentError", &format!("{name}: {problem}. {advice}").into())
}
