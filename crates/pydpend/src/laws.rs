//! Passes the table of laws to Python, whose lists of coefficients, units and words are made from it.

use dynamics::{RATIOS, TERMS};
use pyo3::prelude::*;

/// One row of `dynamics::TERMS`.
#[pyclass(frozen, get_all, name = "Law", module = "pydpend._native")]
pub struct PyLaw {
    name: &'static str,
    unit: &'static str,
    law: &'static str,
    share: Option<&'static str>,
    joint: &'static str,
    words: &'static str,
    source: &'static str,
    is_of_the_paper: bool,
    is_force: bool,
    is_signed: bool,
}

/// One row of `dynamics::RATIOS`.
#[pyclass(frozen, get_all, name = "Ratio", module = "pydpend._native")]
pub struct PyRatio {
    name: &'static str,
    unit: &'static str,
    words: &'static str,
    is_of_one_link: bool,
}

/// The laws, in the order of powers and works.
#[pyfunction]
pub fn laws() -> Vec<PyLaw> {
    TERMS
        .iter()
        .map(|t| PyLaw {
            name: t.field.name(),
            unit: t.field.unit(),
            law: t.law.name(),
            share: t.law.share(),
            joint: t.place.name(),
            words: t.words,
            source: t.source,
            is_of_the_paper: t.law.is_of_the_paper(),
            is_force: t.is_force(),
            is_signed: t.is_signed(),
        })
        .collect()
}

/// The ratios of the model's constants to psi that a fit may free.
#[pyfunction]
pub fn ratios() -> Vec<PyRatio> {
    RATIOS
        .iter()
        .map(|r| PyRatio {
            name: r.field.name(),
            unit: r.unit,
            words: r.words,
            is_of_one_link: r.is_of_one_link,
        })
        .collect()
}
