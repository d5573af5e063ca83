//! Passes the equations of motion to Python: converts, releases the GIL, maps errors; no algorithm.
//!
//! Parameters cross as dictionaries of the names of `dynamics::Field`; arrays as NumPy float64.

use std::collections::HashMap;

use dynamics::shooting::{self, Span, follow};
use dynamics::{Field, Fixed, Parameters, TERMS};
use numpy::{PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::{PyKeyError, PyValueError};
use pyo3::prelude::*;

use crate::arrays::rows;

/// The parameter of a name. Raises KeyError for one that is not known.
pub(crate) fn field(name: &str) -> PyResult<Field> {
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
