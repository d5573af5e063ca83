//! Converts a rig between Python, where it is JSON, and its file.
//!
//! Owns: the JSON and TOML forms of a rig.

use std::path::PathBuf;

use pyo3::prelude::*;
use tracker::error::{Error, Fault};
use tracker::rig::Rig;

use crate::errors::raise;

/// A rig from its JSON, checked.
pub fn rig_of_json(text: &str) -> tracker::error::Result<Rig> {
    let rig: Rig = serde_json::from_str(text).map_err(|e| Error::Rig(Fault::new("rig", e.to_string())))?;
    rig.check("rig")?;
    Ok(rig)
}

/// Reads a rig file and gives it as JSON.
#[pyfunction]
pub fn read_rig(py: Python<'_>, path: PathBuf) -> PyResult<String> {
    let rig = Rig::read(&path).map_err(|e| raise(py, e))?;
    rig_json(&rig).map_err(|e| raise(py, e))
}

/// A rig as JSON.
pub fn rig_json(rig: &Rig) -> tracker::error::Result<String> {
    serde_json::to_string(rig).map_err(|e| Error::Rig(Fault::new("rig", e.to_string())))
}

/// Writes a rig, given as JSON, as TOML.
#[pyfunction]
pub fn write_rig(py: Python<'_>, path: PathBuf, rig: &str) -> PyResult<()> {
    rig_of_json(rig).and_then(|r| r.write(&path)).map_err(|e| raise(py, e))
}

/// A rig's TOML from its JSON.
#[pyfunction]
pub fn rig_toml(py: Python<'_>, rig: &str) -> PyResult<String> {
    rig_of_json(rig).and_then(|r| r.to_toml()).map_err(|e| raise(py, e))
}
