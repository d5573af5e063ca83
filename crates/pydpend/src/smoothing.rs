//! Passes the smoother to Python: conversions only.

use dynamics::smoother::{Measured, Noise, Search, calibrate, learn, smooth};
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray1, ToPyArray};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// Angles of one link, owned: times in s, angles and their standard uncertainties in rad.
struct Angles {
    t_s: Vec<f64>,
    phi_rad: Vec<f64>,
    sigma_rad: Vec<f64>,
}

impl Angles {
    /// The angles of three arrays. Raises ValueError where these are not of one length.
    fn of(
        t_s: &PyReadonlyArray1<'_, f64>,
        phi_rad: &PyReadonlyArray1<'_, f64>,
        sigma_rad: &PyReadonlyArray1<'_, f64>,
    ) -> PyResult<Self> {
        let [t_s, phi_rad, sigma_rad] = [t_s, phi_rad, sigma_rad].map(|array| array.as_array().to_vec());
        let (t, phi, sigma) = (t_s.len(), phi_rad.len(), sigma_rad.len());
        if phi != t || sigma != t {
            return Err(PyValueError::new_err(format!("{t} times, {phi} angles and {sigma} uncertainties")));
        }
        Ok(Self { t_s, phi_rad, sigma_rad })
    }

    fn measured(&self) -> Measured<'_> {
        Measured { t_s: &self.t_s, phi_rad: &self.phi_rad, sigma_rad: &self.sigma_rad }
    }
}

type NoiseOut<'py> = (f64, Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>);

/// The likeliest noise of one link's angles: factor on the uncertainties, knots (s), logarithms of the intensity.
/// `order` is the number of components carried, 3 or 4.
#[pyfunction]
pub fn learn_noise<'py>(
    py: Python<'py>,
    t_s: PyReadonlyArray1<'py, f64>,
    phi_rad: PyReadonlyArray1<'py, f64>,
    sigma_rad: PyReadonlyArray1<'py, f64>,
    order: usize,
    scale: bool,
    stretch_s: f64,
) -> PyResult<NoiseOut<'py>> {
    let angles = Angles::of(&t_s, &phi_rad, &sigma_rad)?;
    let search = Search { scale, stretch_s };
    let noise = py.detach(|| {
        let data = angles.measured();
        if order == 4 { learn::<4>(data, &search) } else { learn::<3>(data, &search) }
    });
    Ok((noise.factor, noise.knots_s.to_pyarray(py), noise.log_q.to_pyarray(py)))
}

type StatesOut<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray3<f64>>, f64, [f64; 3]);

/// Smoothed angle, rate and acceleration of one link, (T, 3), their covariances, (T, 3, 3), the logarithm of the
/// likelihood, and the three factors of the calibration by `white` (T unit normals).
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "the noise's three numbers, kept apart")]
pub fn smooth_angles<'py>(
    py: Python<'py>,
    t_s: PyReadonlyArray1<'py, f64>,
    phi_rad: PyReadonlyArray1<'py, f64>,
    sigma_rad: PyReadonlyArray1<'py, f64>,
    order: usize,
    factor: f64,
    knots_s: PyReadonlyArray1<'py, f64>,
    log_q: PyReadonlyArray1<'py, f64>,
    white: PyReadonlyArray1<'py, f64>,
) -> PyResult<StatesOut<'py>> {
    let angles = Angles::of(&t_s, &phi_rad, &sigma_rad)?;
    let (white, t) = (white.as_array().to_vec(), angles.t_s.len());
    if white.len() != t {
        return Err(PyValueError::new_err(format!("{t} times and {} unit normals", white.len())));
    }
    let noise = Noise { factor, knots_s: knots_s.as_array().to_vec(), log_q: log_q.as_array().to_vec() };
    if noise.knots_s.is_empty() || noise.knots_s.len() != noise.log_q.len() {
        return Err(PyValueError::new_err("the intensity needs as many knots as values, at least one"));
    }
    let out = py.detach(|| {
        let data = angles.measured();
        if order == 4 { all::<4>(data, &noise, &white) } else { all::<3>(data, &noise, &white) }
    });
    Ok((
        out.states.to_pyarray(py).reshape([t, 3])?,
        out.covariances.to_pyarray(py).reshape([t, 3, 3])?,
        out.log_likelihood,
        out.factors,
    ))
}

struct Flat {
    states: Vec<f64>,
    covariances: Vec<f64>,
    log_likelihood: f64,
    factors: [f64; 3],
}

fn all<const N: usize>(data: Measured<'_>, noise: &Noise, white: &[f64]) -> Flat {
    let smoothed = smooth::<N>(data, noise);
    Flat {
        states: smoothed.state.iter().flat_map(|x| [x[0], x[1], x[2]]).collect(),
        covariances: smoothed
            .covariance
            .iter()
            .flat_map(|p| (0..9).map(move |k| p[(k / 3, k % 3)]))
            .collect(),
        log_likelihood: smoothed.log_likelihood,
        factors: calibrate(data, noise, &smoothed, white),
    }
}
