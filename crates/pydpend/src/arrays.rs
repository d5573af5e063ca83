//! Tables of numbers as NumPy arrays.

use numpy::{Element, PyArray2, PyArrayMethods, ToPyArray};
use pyo3::prelude::*;

/// Rows of N numbers as an array, (K, N).
pub fn rows<'py, T: Element + Copy, const N: usize>(
    py: Python<'py>,
    rows: &[[T; N]],
) -> PyResult<Bound<'py, PyArray2<T>>> {
    rows.as_flattened().to_pyarray(py).reshape([rows.len(), N])
}
