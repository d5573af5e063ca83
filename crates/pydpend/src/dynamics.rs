//! Passes the equations and the trajectory fit to Python: converts, releases the GIL, maps errors; no algorithm.
//!
//! Parameters cross as dictionaries of the names of `dynamics::Field`; arrays as NumPy float64.

use std::collections::HashMap;

use dynamics::shooting::{
    self, Fit, Point, Progress, Recording, Segment, Settings, ShootingError, Slack, Span, Status, follow,
    local_state,
};
use dynamics::{Field, Fixed, Parameters, TERMS};
use numpy::{PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, ToPyArray};
use pyo3::exceptions::{PyKeyError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

fn field(name: &str) -> PyResult<Field> {
    Field::named(name).ok_or_else(|| PyKeyError::new_err(format!("no parameter is called {name}")))
}

/// A model's numbers by their names. Raises KeyError for one that is missing or not known.
pub(crate) fn parameters(values: &HashMap<String, f64>) -> PyResult<Parameters<f64>> {
    let fixed = |name: &str| {
        values.get(name).copied().ok_or_else(|| PyKeyError::new_err(format!("the model lacks {name}")))
    };
    const FIXED: [&str; 6] = ["m1", "m2", "l1", "g", "lower_inner", "lower_outer"];
    let mut out = Parameters::zero(Fixed {
        m1_kg: fixed(FIXED[0])?,
        m2_kg: fixed(FIXED[1])?,
        l1_m: fixed(FIXED[2])?,
        g_m_s2: fixed(FIXED[3])?,
        lower_inner_m: fixed(FIXED[4])?,
        lower_outer_m: fixed(FIXED[5])?,
    });
    for (name, value) in values {
        if !FIXED.contains(&name.as_str()) {
            out.set(field(name)?, *value);
        }
    }
    Ok(out)
}

/// Angles of one recording, owned, columns apart.
struct Angles {
    t_s: Vec<f64>,
    phi: [Vec<f64>; 2],
    sigma: [Vec<f64>; 2],
    links: usize,
}

type AnglesIn<'py> = (PyReadonlyArray1<'py, f64>, PyReadonlyArray2<'py, f64>, PyReadonlyArray2<'py, f64>);

fn angles(given: &AnglesIn<'_>) -> PyResult<Angles> {
    let (t, phi, sigma) = (given.0.as_array(), given.1.as_array(), given.2.as_array());
    let links = if phi.shape() == [t.len(), 1] { 1 } else { 2 };
    if phi.shape() != [t.len(), links] || sigma.shape() != [t.len(), links] {
        return Err(PyValueError::new_err(
            "angles and sigmas must have the shape (T, 2), or (T, 1) of one link",
        ));
    }
    let column = |a: &numpy::ndarray::ArrayView2<'_, f64>, j: usize| {
        if j < links { a.column(j).to_vec() } else { vec![f64::NAN; t.len()] }
    };
    Ok(Angles {
        links,
        t_s: t.to_vec(),
        phi: [column(&phi, 0), column(&phi, 1)],
        sigma: [column(&sigma, 0), column(&sigma, 1)],
    })
}

impl Angles {
    fn view(&self) -> Recording<'_> {
        Recording {
            t_s: &self.t_s,
            phi_rad: [&self.phi[0], &self.phi[1]],
            sigma_rad: [&self.sigma[0], &self.sigma[1]],
            links: self.links,
        }
    }
}

fn rows<'py, const N: usize>(py: Python<'py>, rows: &[[f64; N]]) -> PyResult<Bound<'py, PyArray2<f64>>> {
    rows.as_flattened().to_pyarray(py).reshape([rows.len(), N])
}

fn matrix<'py>(py: Python<'py>, m: &[f64], n: usize) -> PyResult<Bound<'py, PyArray2<f64>>> {
    m.to_pyarray(py).reshape([n, n])
}

/// Whole numbers and two tables of numbers with the same rows.
type Tables<'py> = (Bound<'py, PyArray2<i64>>, Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>);

/// Segments of about `length_s` over the spans of each recording, and a first guess of the state at each start.
/// Returns integer rows `[recording, first, last, chained]`, times `[start_s, end_s]` and states.
#[pyfunction]
#[pyo3(signature = (recordings, spans, length_s, chained))]
pub fn shooting_segments<'py>(
    py: Python<'py>,
    recordings: Vec<AnglesIn<'py>>,
    spans: Vec<[f64; 2]>,
    length_s: f64,
    chained: bool,
) -> PyResult<Tables<'py>> {
    let owned = recordings.iter().map(angles).collect::<PyResult<Vec<_>>>()?;
    let (mut whole, mut times, mut states) = (Vec::new(), Vec::new(), Vec::new());
    for (r, (a, span)) in owned.iter().zip(&spans).enumerate() {
        let view = a.view();
        for s in shooting::cut(&view, r, *span, length_s, chained) {
            whole.push([s.recording as i64, s.first as i64, s.last as i64, i64::from(s.chained)]);
            times.push([s.start_s, s.end_s]);
            states.push(local_state(&view, s.start_s).unwrap_or([f64::NAN; 4]));
        }
    }
    let n = whole.len();
    Ok((whole.as_flattened().to_pyarray(py).reshape([n, 4])?, rows(py, &times)?, rows(py, &states)?))
}

fn segments(whole: &PyReadonlyArray2<'_, i64>, times: &PyReadonlyArray2<'_, f64>) -> Vec<Segment> {
    whole
        .as_array()
        .outer_iter()
        .zip(times.as_array().outer_iter())
        .map(|(w, t)| Segment {
            recording: w[0] as usize,
            first: w[1] as usize,
            last: w[2] as usize,
            start_s: t[0],
            end_s: t[1],
            chained: w[3] != 0,
        })
        .collect()
}

fn states(given: &PyReadonlyArray2<'_, f64>) -> Vec<[f64; 4]> {
    given.as_array().outer_iter().map(|r| std::array::from_fn(|i| r[i])).collect()
}

/// The multiple-shooting fit. See `pydpend.damping.shooting` for the shapes and the meaning of each argument.
#[pyfunction]
#[pyo3(signature = (recordings, segment_rows, segment_times, segment_states, model, zeros, *, free, bounded, clock,
                    free_zeros, slack, learned, huber, max_iterations, clock_scale=1.0, progress=None))]
#[expect(clippy::too_many_arguments, reason = "one keyword each in Python")]
pub fn shooting_fit<'py>(
    py: Python<'py>,
    recordings: Vec<AnglesIn<'py>>,
    segment_rows: PyReadonlyArray2<'py, i64>,
    segment_times: PyReadonlyArray2<'py, f64>,
    segment_states: PyReadonlyArray2<'py, f64>,
    model: HashMap<String, f64>,
    zeros: Vec<[f64; 2]>,
    free: Vec<String>,
    bounded: Vec<String>,
    clock: bool,
    free_zeros: bool,
    slack: Vec<f64>,
    learned: bool,
    huber: f64,
    max_iterations: usize,
    clock_scale: f64,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let owned = recordings.iter().map(angles).collect::<PyResult<Vec<_>>>()?;
    let slack = match slack[..] {
        [f] if learned => Slack::Learned(f),
        [f] => Slack::Relative(f),
        [a, b, c, d] => Slack::Fixed([a, b, c, d]),
        _ => return Err(PyValueError::new_err("slack is one relative number or four absolute ones")),
    };
    let settings = Settings {
        free: free.iter().map(|n| field(n)).collect::<PyResult<_>>()?,
        bounded: bounded.iter().map(|n| field(n)).collect::<PyResult<_>>()?,
        clock,
        zeros: free_zeros,
        slack,
        huber,
        max_iterations,
    };
    let list = segments(&segment_rows, &segment_times);
    if list
        .iter()
        .any(|s| s.recording >= owned.len() || s.last > owned[s.recording].t_s.len() || s.first > s.last)
        || zeros.len() != owned.len()
    {
        return Err(PyValueError::new_err("segments do not lie in the recordings"));
    }
    let start = Point {
        parameters: parameters(&model)?,
        clock_scale,
        zeros_rad: zeros,
        states: states(&segment_states),
    };
    let mut raised = None;
    let outcome = py.detach(|| {
        let views: Vec<Recording<'_>> = owned.iter().map(Angles::view).collect();
        let mut report = |p: &Progress| {
            Python::attach(|py| {
                let answer = py.check_signals().and_then(|()| match &progress {
                    Some(call) => call.call1(py, (p.iteration, p.max_iterations, p.chi2)).map(|_| ()),
                    None => Ok(()),
                });
                answer.map_err(|e| raised = Some(e)).is_ok()
            })
        };
        shooting::fit(&views, &list, start, &settings, &mut report)
    });
    if let Some(error) = raised {
        return Err(error);
    }
    fit_columns(py, &outcome.map_err(|e: ShootingError| PyValueError::new_err(e.to_string()))?)
}

/// A fit as a dictionary of numbers and arrays.
fn fit_columns<'py>(py: Python<'py>, fit: &Fit) -> PyResult<Bound<'py, PyDict>> {
    let out = PyDict::new(py);
    let values: HashMap<&str, f64> =
        Field::ALL.iter().map(|f| (f.name(), fit.point.parameters.get(*f))).collect();
    out.set_item("parameters", values)?;
    out.set_item("clock_scale", fit.point.clock_scale)?;
    out.set_item("zeros_rad", rows(py, &fit.point.zeros_rad)?)?;
    out.set_item("states", rows(py, &fit.point.states)?)?;
    let n = fit.gradient.len();
    out.set_item("information", matrix(py, fit.information.as_slice(), n)?)?;
    out.set_item("angle_information", matrix(py, fit.angle_information.as_slice(), n)?)?;
    out.set_item("jump_information", matrix(py, fit.jump_information.as_slice(), n)?)?;
    out.set_item("jumps_shown", fit.jumps_shown)?;
    out.set_item("gradient", fit.gradient.as_slice().to_pyarray(py))?;
    let (k, g) = fit.scores.shape();
    // nalgebra stores columns; the transpose's storage is the rows of the matrix.
    out.set_item("scores", fit.scores.transpose().as_slice().to_pyarray(py).reshape([k, g])?)?;
    out.set_item("slack", fit.slack)?;
    out.set_item("own_sigma", fit.own_sigma)?;
    out.set_item("jump_chi2", fit.jump_chi2)?;
    out.set_item("log_evidence", fit.log_evidence)?;
    out.set_item("cost", fit.cost)?;
    out.set_item("squares", fit.squares)?;
    out.set_item("counts", fit.counts)?;
    out.set_item("state_freedom", fit.state_freedom)?;
    out.set_item("stuck", fit.stuck)?;
    let spread: Vec<f64> = fit.state_covariance.iter().flat_map(|m| m.iter().copied()).collect();
    out.set_item("state_covariance", spread.to_pyarray(py).reshape([fit.state_covariance.len(), 4, 4])?)?;
    let transfer: Vec<f64> =
        fit.transfer.iter().flat_map(|m| m.transpose().iter().copied().collect::<Vec<_>>()).collect();
    out.set_item("transfer", transfer.to_pyarray(py).reshape([fit.transfer.len(), 4, 4])?)?;
    out.set_item("iterations", fit.iterations)?;
    let status = match fit.status {
        Status::Converged => "converged",
        Status::IterationLimit => "iteration_limit",
        Status::Stalled => "stalled",
        Status::Stopped => "stopped",
    };
    out.set_item("status", status)?;
    Ok(out)
}

/// The motion of every segment at its samples: integer rows `[recording, sample, segment]`, states, and the power of
/// each term (in the order of `term_names`) for a coefficient of one.
#[pyfunction]
pub fn shooting_trace<'py>(
    py: Python<'py>,
    recordings: Vec<AnglesIn<'py>>,
    segment_rows: PyReadonlyArray2<'py, i64>,
    segment_times: PyReadonlyArray2<'py, f64>,
    segment_states: PyReadonlyArray2<'py, f64>,
    model: HashMap<String, f64>,
    clock_scale: f64,
) -> PyResult<Tables<'py>> {
    let owned = recordings.iter().map(angles).collect::<PyResult<Vec<_>>>()?;
    let list = segments(&segment_rows, &segment_times);
    if list.iter().any(|s| s.recording >= owned.len() || s.last > owned[s.recording].t_s.len()) {
        return Err(PyValueError::new_err("segments do not lie in the recordings"));
    }
    let point = Point {
        parameters: parameters(&model)?,
        clock_scale,
        zeros_rad: Vec::new(),
        states: states(&segment_states),
    };
    let trace = py.detach(|| {
        let views: Vec<Recording<'_>> = owned.iter().map(Angles::view).collect();
        shooting::trace(&views, &list, &point)
    });
    let index: Vec<[i64; 3]> = trace
        .recording
        .iter()
        .zip(&trace.sample)
        .zip(&trace.segment)
        .map(|((r, i), k)| [*r as i64, *i as i64, *k as i64])
        .collect();
    let n = index.len();
    Ok((
        index.as_flattened().to_pyarray(py).reshape([n, 3])?,
        rows(py, &trace.state)?,
        rows(py, &trace.unit_power)?,
    ))
}

/// States at `times_s` (ascending) from `state` at `start_s`.
#[pyfunction]
pub fn follow_motion<'py>(
    py: Python<'py>,
    model: HashMap<String, f64>,
    state: [f64; 4],
    start_s: f64,
    times_s: PyReadonlyArray1<'py, f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let p = parameters(&model)?;
    let times = times_s.as_array().to_vec();
    let out = py.detach(|| {
        let mut out = vec![[f64::NAN; 4]; times.len()];
        if let Some(&end_s) = times.last() {
            let span = Span { start_s, end_s, times_s: &times };
            follow(&p, state, &span, 1.0, true, |i, x| out[i] = *x);
        }
        out
    });
    rows(py, &out)
}

/// Names and units of the terms' coefficients, in the order of the powers.
#[pyfunction]
pub fn term_names() -> Vec<(&'static str, &'static str)> {
    TERMS.iter().map(|t| (t.field.name(), t.field.unit())).collect()
}

/// Powers of the terms for a coefficient of one along measured states: `state` (T, 4), `accelerations` (T, 2).
#[pyfunction]
pub fn unit_powers<'py>(
    py: Python<'py>,
    model: HashMap<String, f64>,
    state: PyReadonlyArray2<'py, f64>,
    accelerations: PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let p = parameters(&model)?;
    let (x, a) = (state.as_array(), accelerations.as_array());
    if x.shape() != [a.shape()[0], 4] || a.shape()[1] != 2 {
        return Err(PyValueError::new_err("states must have the shape (T, 4), accelerations (T, 2)"));
    }
    let out: Vec<[f64; TERMS.len()]> = x
        .outer_iter()
        .zip(a.outer_iter())
        .map(|(x, a)| shooting::unit_powers(&p, &std::array::from_fn(|i| x[i]), [a[0], a[1]]))
        .collect();
    rows(py, &out)
}
