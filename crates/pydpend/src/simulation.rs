//! Passes simulation, ensembles, sections and exponents to Python: conversions only.

use std::collections::HashMap;

use dynamics::Contact;
use dynamics::TERMS;
use dynamics::analysis::ensemble::{Case, ensemble};
use dynamics::analysis::lyapunov::{Growth, growth_rates};
use dynamics::analysis::section::{Section, poincare};
use dynamics::analysis::simulate::{Ending, Failure, Run, Settings};
use dynamics::friction::Friction;
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, ToPyArray};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::dynamics::parameters;

fn settings(tolerance: f64, width_rad_s: Option<f64>, pinned: bool) -> Settings {
    Settings { tolerance, friction: width_rad_s.map_or(Friction::Exact, Friction::Smooth), pinned }
}

fn failed(failure: &Failure) -> PyErr {
    PyValueError::new_err(failure.to_string())
}

/// A contact as one number: the sign of sliding, 0 stuck, NaN smooth.
fn contact(c: Contact) -> f64 {
    match c {
        Contact::Slip(sign) => sign,
        Contact::Stuck => 0.0,
        Contact::Smooth(_) => f64::NAN,
    }
}

fn table<'py>(py: Python<'py>, flat: &[f64], columns: usize) -> PyResult<Bound<'py, PyArray2<f64>>> {
    flat.to_pyarray(py).reshape([flat.len() / columns, columns])
}

/// One motion as arrays: `state` (T, 4), `a` (T, 2), `normal` (T, 2), `dry` (T, 2), `energy` (T,), `works` (T, terms),
/// `events` (E, 4: time, joint 0/1, contact before, contact after), `at_rest`, `end_s`, `steps`.
fn run_dict<'py>(py: Python<'py>, run: &Run) -> PyResult<Bound<'py, PyDict>> {
    let flat = |f: &dyn Fn(&dynamics::analysis::simulate::Sample) -> Vec<f64>| -> Vec<f64> {
        run.samples.iter().flat_map(f).collect()
    };
    let out = PyDict::new(py);
    out.set_item("state", table(py, &flat(&|s| s.x.to_vec()), 4)?)?;
    out.set_item("a", table(py, &flat(&|s| s.a.to_vec()), 2)?)?;
    out.set_item("normal", table(py, &flat(&|s| s.normal.to_vec()), 2)?)?;
    out.set_item("dry", table(py, &flat(&|s| s.dry.to_vec()), 2)?)?;
    out.set_item("energy", flat(&|s| vec![s.energy]).to_pyarray(py))?;
    out.set_item("works", table(py, &flat(&|s| s.works.to_vec()), TERMS.len())?)?;
    let events: Vec<f64> =
        run.events.iter().flat_map(|e| [e.t_s, e.joint as f64, contact(e.from), contact(e.to)]).collect();
    out.set_item("events", table(py, &events, 4)?)?;
    out.set_item("at_rest", run.ending == Ending::AtRest)?;
    out.set_item("end_s", run.end_s)?;
    out.set_item("steps", run.steps)?;
    Ok(out)
}

/// The motion from `state` (phi1, phi2, w1, w2), sampled at `times_s`. `model` has the names of `dynamics::Field` and
/// m1, m2, l1, g, lower_inner, lower_outer. Raises ValueError with the whole message.
#[pyfunction]
#[pyo3(signature = (model, state, times_s, *, tolerance, width_rad_s=None, pinned=false))]
pub fn simulate_motion<'py>(
    py: Python<'py>,
    model: HashMap<String, f64>,
    state: [f64; 4],
    times_s: PyReadonlyArray1<'py, f64>,
    tolerance: f64,
    width_rad_s: Option<f64>,
    pinned: bool,
) -> PyResult<Bound<'py, PyDict>> {
    let p = parameters(&model)?;
    let times = times_s.as_array().to_vec();
    let ask = settings(tolerance, width_rad_s, pinned);
    let run = py
        .detach(|| dynamics::analysis::simulate::simulate(&p, state, &times, &ask))
        .map_err(|e| failed(&e))?;
    run_dict(py, &run)
}

type Many<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<bool>>);

/// Many motions on all cores: `states` (K, 4), one model for all or one each. Returns states (K*T, 4), energies
/// (K*T,) and which came to rest (K,).
#[pyfunction]
#[pyo3(signature = (models, states, times_s, *, tolerance, width_rad_s=None, pinned=false))]
pub fn simulate_ensemble<'py>(
    py: Python<'py>,
    models: Vec<HashMap<String, f64>>,
    states: PyReadonlyArray2<'py, f64>,
    times_s: PyReadonlyArray1<'py, f64>,
    tolerance: f64,
    width_rad_s: Option<f64>,
    pinned: bool,
) -> PyResult<Many<'py>> {
    let pendulums = models.iter().map(parameters).collect::<PyResult<Vec<_>>>()?;
    let rows = states.as_array();
    if rows.shape()[1] != 4 || (pendulums.len() != 1 && pendulums.len() != rows.shape()[0]) {
        return Err(PyValueError::new_err("states: give (K, 4), and one model or K"));
    }
    let cases: Vec<Case> = rows
        .outer_iter()
        .enumerate()
        .map(|(i, r)| Case {
            parameters: pendulums[if pendulums.len() == 1 { 0 } else { i }],
            state: std::array::from_fn(|k| r[k]),
        })
        .collect();
    let times = times_s.as_array().to_vec();
    let ask = settings(tolerance, width_rad_s, pinned);
    let runs = py.detach(|| ensemble(&cases, &times, &ask));
    let (mut x, mut energy, mut rest) = (Vec::new(), Vec::new(), Vec::new());
    for (i, run) in runs.iter().enumerate() {
        let run = run.as_ref().map_err(|e| PyValueError::new_err(format!("run {i}: {e}")))?;
        x.extend(run.samples.iter().flat_map(|s| s.x));
        energy.extend(run.samples.iter().map(|s| s.energy));
        rest.push(run.ending == Ending::AtRest);
    }
    Ok((table(py, &x, 4)?, energy.to_pyarray(py), rest.to_pyarray(py)))
}

/// Passages of a link through an angle: rows of time and state, (K, 5).
#[pyfunction]
#[pyo3(signature = (model, state, duration_s, *, link, angle_rad, direction, tolerance, pinned=false))]
#[expect(clippy::too_many_arguments, reason = "one keyword each in Python")]
pub fn poincare_section<'py>(
    py: Python<'py>,
    model: HashMap<String, f64>,
    state: [f64; 4],
    duration_s: f64,
    link: usize,
    angle_rad: f64,
    direction: f64,
    tolerance: f64,
    pinned: bool,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    if link > 1 {
        return Err(PyValueError::new_err(format!("link {link}: there are 0 and 1")));
    }
    let p = parameters(&model)?;
    let ask = settings(tolerance, None, pinned);
    let section = Section { link, angle_rad, direction };
    let found = py.detach(|| poincare(&p, state, duration_s, section, &ask)).map_err(|e| failed(&e))?;
    let flat: Vec<f64> = found.iter().flat_map(|(t, x)| [*t, x[0], x[1], x[2], x[3]]).collect();
    table(py, &flat, 5)
}

/// Rates of growth of a tangent vector, one per counted interval, 1/s.
#[pyfunction]
pub fn tangent_growth<'py>(
    py: Python<'py>,
    model: HashMap<String, f64>,
    state: [f64; 4],
    interval_s: f64,
    skipped: usize,
    counted: usize,
    tolerance: f64,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let p = parameters(&model)?;
    let ask = Growth { interval_s, skipped, counted, tolerance };
    let rates = py.detach(|| growth_rates(&p, state, &ask)).map_err(|e| failed(&e))?;
    Ok(rates.to_pyarray(py))
}
