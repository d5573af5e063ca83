//! Converts a rig between Python, where it is JSON, and its file.
//!
//! Owns: the JSON and TOML forms of a rig.

use std::path::PathBuf;

use numpy::ndarray::{Array2, Array3};
use numpy::{PyArray2, PyArray3, PyReadonlyArray2, ToPyArray};
use pyo3::prelude::*;
use tracker::camera::NUMBERS;
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

/// Places (n, 2) in recorded pixels in the plane in which a rig's bodies are rigid, with the most that lengths about each are
/// stretched there, (n, 3).
#[pyfunction]
pub fn plane_places<'py>(
    py: Python<'py>,
    rig: &str,
    recorded_px: PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let plane = rig_of_json(rig).map_err(|e| raise(py, e))?.plane();
    let given = recorded_px.as_array();
    let mut out = Array2::zeros((given.nrows(), 3));
    for (to, from) in out.rows_mut().into_iter().zip(given.rows()) {
        let (place, stretch) = plane.flatten([from[0], from[1]]);
        to.into_iter().zip([place[0], place[1], stretch]).for_each(|(to, v)| *to = v);
    }
    Ok(out.to_pyarray(py))
}

/// The derivatives of places (n, 2) in the plane of a rig's bodies by the camera's five numbers, px, (n, 2, 5).
#[pyfunction]
pub fn plane_slopes<'py>(
    py: Python<'py>,
    rig: &str,
    recorded_px: PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let rig = rig_of_json(rig).map_err(|e| raise(py, e))?;
    let (camera, aspect) = (rig.view(), rig.pixel_aspect);
    let given = recorded_px.as_array();
    let mut out = Array3::zeros((given.nrows(), 2, NUMBERS));
    for (mut to, from) in out.outer_iter_mut().zip(given.rows()) {
        let slopes = camera.slopes(aspect.to_square([from[0], from[1]].into())).by_numbers;
        to.indexed_iter_mut().for_each(|(at, v)| *v = slopes[at]);
    }
    Ok(out.to_pyarray(py))
}

/// The way back, (n, 2).
#[pyfunction]
pub fn recorded_places<'py>(
    py: Python<'py>,
    rig: &str,
    plane_px: PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let plane = rig_of_json(rig).map_err(|e| raise(py, e))?.plane();
    let mut out = plane_px.as_array().to_owned();
    for mut row in out.rows_mut() {
        [row[0], row[1]] = plane.recorded([row[0], row[1]]);
    }
    Ok(out.to_pyarray(py))
}
