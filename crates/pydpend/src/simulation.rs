//! Passes simulation, ensembles, sections and exponents to Python: conversions only.

use std::collections::HashMap;

use dynamics::Contact;
use dynamics::analysis::ensemble::{Case, ensemble};
use dynamics::analysis::lyapunov::{Growth, growth_rates};
use dynamics::analysis::section::{Section, poincare};
use dynamics::analysis::simulate::{Ending, Failure, Run, Sample, Settings, simulate};
use dynamics::friction::Friction;
use numpy::{PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2, ToPyArray};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays::rows;
use crate::dynamics::parameters;

/// Settings of the integrator.
#[pyclass(frozen, module = "pydpend._native")]
pub struct IntegratorSettings(Settings);

#[pymethods]
impl IntegratorSettings {
    /// `width_rad_s` of smooth dry friction, `None` where it is exact.
    #[new]
    #[pyo3(signature = (*, tolerance, width_rad_s=None, pinned=false))]
    fn new(tolerance: f64, width_rad_s: Option<f64>, pinned: bool) -> Self {
        let friction = width_rad_s.map_or(Friction::Exact, Friction::Smooth);
        Self(Settings { tolerance, friction, pinned })
    }
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

/// One motion at T samples, with E events.
#[pyclass(frozen, get_all, module = "pydpend._native")]
pub struct SimulatedMotion {
    state: Py<PyArray2<f64>>,
    a: Py<PyArray2<f64>>,
    normal: Py<PyArray2<f64>>,
    dry: Py<PyArray2<f64>>,
    energy: Py<PyArray1<f64>>,
    works: Py<PyArray2<f64>>,
    events: Py<PyArray2<f64>>,
    at_rest: bool,
    end_s: f64,
}

impl SimulatedMotion {
    fn of(py: Python<'_>, run: &Run) -> PyResult<Self> {
        fn columns<const N: usize>(
            py: Python<'_>,
            run: &Run,
            of: fn(&Sample) -> [f64; N],
        ) -> PyResult<Py<PyArray2<f64>>> {
            let all: Vec<[f64; N]> = run.samples.iter().map(of).collect();
            rows(py, &all).map(Bound::unbind)
        }
        let energy: Vec<f64> = run.samples.iter().map(|s| s.energy).collect();
        let events: Vec<[f64; 4]> =
            run.events.iter().map(|e| [e.t_s, e.joint as f64, contact(e.from), contact(e.to)]).collect();
        Ok(Self {
            state: columns(py, run, |s| s.x)?,
            a: columns(py, run, |s| s.a)?,
            normal: columns(py, run, |s| s.normal)?,
            dry: columns(py, run, |s| s.dry)?,
            energy: energy.to_pyarray(py).unbind(),
            works: columns(py, run, |s| s.works)?,
            events: rows(py, &events)?.unbind(),
            at_rest: run.ending == Ending::AtRest,
            end_s: run.end_s,
        })
    }
}

/// The motion from `state` (phi1, phi2, w1, w2), sampled at `times_s`. `model` has the names of `dynamics::Field` and
/// m1, m2, l1, g, lower_inner, lower_outer. Raises ValueError with the whole message.
#[pyfunction]
pub fn simulate_motion(
    py: Python<'_>,
    model: HashMap<String, f64>,
    state: [f64; 4],
    times_s: PyReadonlyArray1<'_, f64>,
    settings: &IntegratorSettings,
) -> PyResult<SimulatedMotion> {
    let p = parameters(&model)?;
    let times = times_s.as_array().to_vec();
    let run = py.detach(|| simulate(&p, state, &times, &settings.0)).map_err(|e| failed(&e))?;
    SimulatedMotion::of(py, &run)
}

type Many<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<bool>>);

/// Many motions on all cores: `states` (K, 4), one model for all or one each. Returns states (K*T, 4), energies
/// (K*T,) and which came to rest (K,).
#[pyfunction]
pub fn simulate_ensemble<'py>(
    py: Python<'py>,
    models: Vec<HashMap<String, f64>>,
    states: PyReadonlyArray2<'py, f64>,
    times_s: PyReadonlyArray1<'py, f64>,
    settings: &IntegratorSettings,
) -> PyResult<Many<'py>> {
    let pendulums = models.iter().map(parameters).collect::<PyResult<Vec<_>>>()?;
    let given = states.as_array();
    if given.shape()[1] != 4 || (pendulums.len() != 1 && pendulums.len() != given.shape()[0]) {
        return Err(PyValueError::new_err("states: give (K, 4), and one model or K"));
    }
    let cases: Vec<Case> = given
        .outer_iter()
        .enumerate()
        .map(|(i, r)| Case {
            parameters: pendulums[if pendulums.len() == 1 { 0 } else { i }],
            state: std::array::from_fn(|k| r[k]),
        })
        .collect();
    let times = times_s.as_array().to_vec();
    let runs = py.detach(|| ensemble(&cases, &times, &settings.0));
    let (mut x, mut energy, mut rest) = (Vec::<[f64; 4]>::new(), Vec::new(), Vec::new());
    for (i, run) in runs.iter().enumerate() {
        let run = run.as_ref().map_err(|e| PyValueError::new_err(format!("run {i}: {e}")))?;
        x.extend(run.samples.iter().map(|s| s.x));
        energy.extend(run.samples.iter().map(|s| s.energy));
        rest.push(run.ending == Ending::AtRest);
    }
    Ok((rows(py, &x)?, energy.to_pyarray(py), rest.to_pyarray(py)))
}

/// Passages of a link through an angle: rows of time and state, (K, 5).
#[pyfunction]
#[pyo3(signature = (model, state, duration_s, settings, *, link, angle_rad, direction))]
pub fn poincare_section<'py>(
    py: Python<'py>,
    model: HashMap<String, f64>,
    state: [f64; 4],
    duration_s: f64,
    settings: &IntegratorSettings,
    link: usize,
    angle_rad: f64,
    direction: f64,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    if link > 1 {
        return Err(PyValueError::new_err(format!("link {link}: there are 0 and 1")));
    }
    let p = parameters(&model)?;
    let section = Section { link, angle_rad, direction };
    let found =
        py.detach(|| poincare(&p, state, duration_s, section, &settings.0)).map_err(|e| failed(&e))?;
    let passages: Vec<[f64; 5]> = found.iter().map(|(t, x)| [*t, x[0], x[1], x[2], x[3]]).collect();
    rows(py, &passages)
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
