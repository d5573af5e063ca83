//! Passes the trajectory fit to Python: its segments, settings and solution; no algorithm.

use std::collections::HashMap;

use dynamics::Field;
use dynamics::shooting::{
    self, CAMERA_NUMBERS, CameraPart, Fit, Point, Progress, Recording, Segment, Settings, ShootingError,
    Slack, Status, local_state,
};
use numpy::{
    PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3,
    ToPyArray,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays::rows;
use crate::dynamics::{field, parameters};

/// Angles of one recording, owned, columns apart.
struct Angles {
    t_s: Vec<f64>,
    phi: [Vec<f64>; 2],
    sigma: [Vec<f64>; 2],
    links: usize,
    camera: Option<(Vec<[[f64; CAMERA_NUMBERS]; 2]>, usize)>,
}

/// The derivatives of the angles by a camera's numbers, (T, L, 5), and the camera's index.
type CameraIn<'py> = (PyReadonlyArray3<'py, f64>, usize);

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
        camera: None,
    })
}

/// Adds what the cameras do to each recording's angles.
fn with_cameras(owned: &mut [Angles], given: &[Option<CameraIn<'_>>], count: usize) -> PyResult<()> {
    if given.len() != owned.len() {
        return Err(PyValueError::new_err("cameras are not those of the recordings"));
    }
    for (angles, camera) in owned.iter_mut().zip(given) {
        let Some((slopes, which)) = camera else { continue };
        let slopes = slopes.as_array();
        if slopes.shape() != [angles.t_s.len(), angles.links, CAMERA_NUMBERS] || *which >= count {
            return Err(PyValueError::new_err(
                "a camera's slopes must have the shape (T, links, 5) of its angles",
            ));
        }
        // Where an angle was not seen nothing is known of its slopes either, and nothing needed.
        let number = |i: usize, j: usize, c: usize| {
            let value = if j < angles.links { slopes[[i, j, c]] } else { 0.0 };
            if value.is_finite() { value } else { 0.0 }
        };
        let rows = (0..angles.t_s.len())
            .map(|i| std::array::from_fn(|j| std::array::from_fn(|c| number(i, j, c))))
            .collect();
        angles.camera = Some((rows, *which));
    }
    Ok(())
}

impl Angles {
    fn view(&self) -> Recording<'_> {
        Recording {
            t_s: &self.t_s,
            phi_rad: [&self.phi[0], &self.phi[1]],
            sigma_rad: [&self.sigma[0], &self.sigma[1]],
            links: self.links,
            camera: self
                .camera
                .as_ref()
                .map(|(rows, camera)| CameraPart { slopes_rad: rows, camera: *camera }),
        }
    }
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
    Ok((rows(py, &whole)?, rows(py, &times)?, rows(py, &states)?))
}

/// Segments of recordings: the attributes of `pydpend.damping.shooting.Segments`.
#[derive(FromPyObject)]
pub struct Segments<'py> {
    rows: PyReadonlyArray2<'py, i64>,
    times_s: PyReadonlyArray2<'py, f64>,
    states: PyReadonlyArray2<'py, f64>,
}

impl Segments<'_> {
    /// The segments of these recordings. Raises ValueError where one does not lie in them.
    fn of(&self, recordings: &[Angles]) -> PyResult<Vec<Segment>> {
        let (whole, times) = (self.rows.as_array(), self.times_s.as_array());
        let list: Vec<Segment> = whole
            .outer_iter()
            .zip(times.outer_iter())
            .map(|(w, t)| Segment {
                recording: w[0] as usize,
                first: w[1] as usize,
                last: w[2] as usize,
                start_s: t[0],
                end_s: t[1],
                chained: w[3] != 0,
            })
            .collect();
        let lies_in = |s: &Segment| {
            s.first <= s.last && recordings.get(s.recording).is_some_and(|r| s.last <= r.t_s.len())
        };
        if list.iter().all(lies_in) {
            return Ok(list);
        }
        Err(PyValueError::new_err("segments do not lie in the recordings"))
    }

    fn states(&self) -> Vec<[f64; 4]> {
        self.states.as_array().outer_iter().map(|r| std::array::from_fn(|i| r[i])).collect()
    }
}

/// Settings of a fit. See `pydpend.damping.shooting.solve` for each.
#[pyclass(frozen, module = "pydpend._native")]
pub struct ShootingSettings(Settings);

#[pymethods]
impl ShootingSettings {
    #[new]
    #[pyo3(signature = (*, free, bounded, clock, zeros, slack, learned, huber, max_iterations))]
    fn new(
        free: Vec<String>,
        bounded: Vec<String>,
        clock: bool,
        zeros: bool,
        slack: Vec<f64>,
        learned: bool,
        huber: f64,
        max_iterations: usize,
    ) -> PyResult<Self> {
        let slack = match slack[..] {
            [f] if learned => Slack::Learned(f),
            [f] => Slack::Relative(f),
            [a, b, c, d] => Slack::Fixed([a, b, c, d]),
            _ => return Err(PyValueError::new_err("slack is one relative number or four absolute ones")),
        };
        Ok(Self(Settings {
            free: free.iter().map(|n| field(n)).collect::<PyResult<_>>()?,
            bounded: bounded.iter().map(|n| field(n)).collect::<PyResult<_>>()?,
            clock,
            zeros,
            slack,
            huber,
            max_iterations,
        }))
    }
}

/// A fit: K segments, R recordings, G shared parameters. See `dynamics::shooting::Fit` for each.
#[pyclass(frozen, get_all, module = "pydpend._native")]
pub struct ShootingFit {
    parameters: HashMap<&'static str, f64>,
    clock_scale: f64,
    zeros_rad: Py<PyArray2<f64>>,
    camera_numbers: Py<PyArray2<f64>>,
    states: Py<PyArray2<f64>>,
    information: Py<PyArray2<f64>>,
    angle_information: Py<PyArray2<f64>>,
    jump_information: Py<PyArray2<f64>>,
    jumps_shown: Py<PyArray1<f64>>,
    gradient: Py<PyArray1<f64>>,
    scores: Py<PyArray2<f64>>,
    slack: Py<PyArray1<f64>>,
    own_sigma: Py<PyArray1<f64>>,
    jump_chi2: Py<PyArray1<f64>>,
    log_evidence: f64,
    cost: f64,
    squares: Py<PyArray1<f64>>,
    counts: Py<PyArray1<i64>>,
    state_freedom: f64,
    state_covariance: Py<PyArray3<f64>>,
    transfer: Py<PyArray3<f64>>,
    stuck: usize,
    iterations: usize,
    status: &'static str,
}

impl ShootingFit {
    fn of(py: Python<'_>, fit: &Fit) -> PyResult<Self> {
        let n = fit.gradient.len();
        let (k, g) = fit.scores.shape();
        let table = |m: &[f64], shape: [usize; 2]| -> PyResult<Py<PyArray2<f64>>> {
            Ok(m.to_pyarray(py).reshape(shape)?.unbind())
        };
        let square = |m: &[f64]| table(m, [n, n]);
        let list = |v: &[f64]| v.to_pyarray(py).unbind();
        let cube = |flat: &[f64], count: usize| -> PyResult<Py<PyArray3<f64>>> {
            Ok(flat.to_pyarray(py).reshape([count, 4, 4])?.unbind())
        };
        // nalgebra stores columns; the transpose's storage is the rows of the matrix.
        let spread: Vec<f64> = fit.state_covariance.iter().flat_map(|m| m.iter().copied()).collect();
        let transfer: Vec<f64> =
            fit.transfer.iter().flat_map(|m| m.transpose().iter().copied().collect::<Vec<_>>()).collect();
        Ok(Self {
            parameters: Field::ALL.iter().map(|f| (f.name(), fit.point.parameters.get(*f))).collect(),
            clock_scale: fit.point.clock_scale,
            zeros_rad: rows(py, &fit.point.zeros_rad)?.unbind(),
            camera_numbers: rows(py, &fit.point.cameras)?.unbind(),
            states: rows(py, &fit.point.states)?.unbind(),
            information: square(fit.information.as_slice())?,
            angle_information: square(fit.angle_information.as_slice())?,
            jump_information: square(fit.jump_information.as_slice())?,
            jumps_shown: list(&fit.jumps_shown),
            gradient: list(fit.gradient.as_slice()),
            scores: table(fit.scores.transpose().as_slice(), [k, g])?,
            slack: list(&fit.slack),
            own_sigma: list(&fit.own_sigma),
            jump_chi2: list(&fit.jump_chi2),
            log_evidence: fit.log_evidence,
            cost: fit.cost,
            squares: list(&fit.squares),
            counts: fit.counts.map(|c| c as i64).to_pyarray(py).unbind(),
            state_freedom: fit.state_freedom,
            state_covariance: cube(&spread, fit.state_covariance.len())?,
            transfer: cube(&transfer, fit.transfer.len())?,
            stuck: fit.stuck,
            iterations: fit.iterations,
            status: match fit.status {
                Status::Converged => "converged",
                Status::IterationLimit => "iteration_limit",
                Status::Stalled => "stalled",
                Status::Stopped => "stopped",
            },
        })
    }
}

/// The start of a fit besides the model and the segments: the attributes of `pydpend.damping.shooting.Start`.
#[derive(FromPyObject)]
pub struct Start {
    zeros_rad: Vec<[f64; 2]>,
    camera_numbers: Vec<[f64; CAMERA_NUMBERS]>,
    clock_scale: f64,
}

/// The multiple-shooting fit, from `model`, `start` and the segments' states. `cameras` has a recording's camera or `None`.
/// `progress` is called with the step, the most there will be, and chi-square.
#[pyfunction]
#[pyo3(signature = (recordings, segments, model, start, settings, *, cameras, progress))]
pub fn shooting_fit<'py>(
    py: Python<'py>,
    recordings: Vec<AnglesIn<'py>>,
    segments: Segments<'py>,
    model: HashMap<String, f64>,
    start: Start,
    settings: &ShootingSettings,
    cameras: Vec<Option<CameraIn<'py>>>,
    progress: Option<Py<PyAny>>,
) -> PyResult<ShootingFit> {
    let mut owned = recordings.iter().map(angles).collect::<PyResult<Vec<_>>>()?;
    let list = segments.of(&owned)?;
    if start.zeros_rad.len() != owned.len() {
        return Err(PyValueError::new_err("zeros are not those of the recordings"));
    }
    with_cameras(&mut owned, &cameras, start.camera_numbers.len())?;
    let start = Point {
        parameters: parameters(&model)?,
        clock_scale: start.clock_scale,
        zeros_rad: start.zeros_rad,
        cameras: start.camera_numbers,
        states: segments.states(),
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
        shooting::fit(&views, &list, start, &settings.0, &mut report)
    });
    if let Some(error) = raised {
        return Err(error);
    }
    ShootingFit::of(py, &outcome.map_err(|e: ShootingError| PyValueError::new_err(e.to_string()))?)
}

/// The motion of every segment at its samples: integer rows `[recording, sample, segment]`, states, and the power of
/// each term (in the order of `laws`) for a coefficient of one.
#[pyfunction]
pub fn shooting_trace<'py>(
    py: Python<'py>,
    recordings: Vec<AnglesIn<'py>>,
    segments: Segments<'py>,
    model: HashMap<String, f64>,
    clock_scale: f64,
) -> PyResult<Tables<'py>> {
    let owned = recordings.iter().map(angles).collect::<PyResult<Vec<_>>>()?;
    let list = segments.of(&owned)?;
    let point = Point {
        parameters: parameters(&model)?,
        clock_scale,
        zeros_rad: Vec::new(),
        cameras: Vec::new(),
        states: segments.states(),
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
    Ok((rows(py, &index)?, rows(py, &trace.state)?, rows(py, &trace.unit_power)?))
}
