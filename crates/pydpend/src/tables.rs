//! Converts node tables to and from NumPy and Arrow.
//!
//! Owns: how columns cross. Columns read here reach NumPy without a copy; what Python holds is copied once on its
//! way to a file or to Arrow, because it is Python's and may change.

use std::path::PathBuf;

use arrow::array::{RecordBatch, RecordBatchIterator};
use arrow::error::ArrowError;
use numpy::{
    IntoPyArray, PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2,
    PyReadonlyArray3, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use pyo3_arrow::PyRecordBatchReader;
use tracker::edits::{self, Edits};
use tracker::error::{Error, Fault};
use tracker::gaps::Damage;
use tracker::kind::{self, Kind};
use tracker::table::{self, NodeTable, Rows, TableMeta};

use crate::errors::{argument, raise, to_python};
use crate::rig::rig_of_json;
use crate::settings::cells;

/// Columns as NumPy arrays, and the metadata as JSON.
pub type Columns<'py> = (
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray3<f64>>,
    Bound<'py, PyArray2<f32>>,
    Bound<'py, PyArray2<f32>>,
    Bound<'py, PyArray2<u8>>,
    String,
);

/// Frames of an Arrow batch: some MB each.
const BATCH_FRAMES: usize = 1 << 14;

/// Hands a table's columns to NumPy, which then owns them.
pub fn columns<'py>(py: Python<'py>, table: NodeTable) -> PyResult<Columns<'py>> {
    let (frames, nodes) = (table.frames(), table.nodes());
    let meta = table.meta.to_json().map_err(|e| raise(py, e))?;
    let rows = table.rows;
    Ok((
        rows.frame.into_pyarray(py),
        rows.time_s.into_pyarray(py),
        rows.xy_px.into_pyarray(py).reshape([frames, nodes, 2])?,
        rows.sigma_px.into_pyarray(py).reshape([frames, nodes])?,
        rows.area_px.into_pyarray(py).reshape([frames, nodes])?,
        rows.status.into_pyarray(py).reshape([frames, nodes])?,
        meta,
    ))
}

/// Reads a node table; every value is checked.
#[pyfunction]
pub fn read_table(py: Python<'_>, path: PathBuf) -> PyResult<Columns<'_>> {
    let table = py.detach(|| table::read_table(&path)).map_err(|e| raise(py, e))?;
    columns(py, table)
}

/// Reads a node table's metadata as JSON.
#[pyfunction]
pub fn read_meta(py: Python<'_>, path: PathBuf) -> PyResult<String> {
    py.detach(|| table::read_meta(&path).and_then(|m| m.to_json())).map_err(|e| raise(py, e))
}

/// Columns that Python holds.
pub type Held<'py> = (
    PyReadonlyArray1<'py, i64>,
    PyReadonlyArray1<'py, f64>,
    PyReadonlyArray3<'py, f64>,
    PyReadonlyArray2<'py, f32>,
    PyReadonlyArray2<'py, f32>,
    PyReadonlyArray2<'py, u8>,
);

fn rows_of(py: Python<'_>, held: &Held<'_>, nodes: usize) -> PyResult<Rows> {
    let (frame, time_s, xy, sigma, area, status) = held;
    let frames = frame.len();
    let shapes = [
        ("t_s", time_s.shape() == [frames]),
        ("xy_px", xy.shape() == [frames, nodes, 2]),
        ("sigma_px", sigma.shape() == [frames, nodes]),
        ("area_px", area.shape() == [frames, nodes]),
        ("status", status.shape() == [frames, nodes]),
    ];
    if let Some((name, _)) = shapes.iter().find(|(_, right)| !right) {
        let problem = format!("its shape does not fit {frames} frames of {nodes} nodes");
        return Err(argument(py, name, problem, "Shapes are (T,), (T, N) and, for xy_px, (T, N, 2)"));
    }
    Ok(Rows {
        frame: frame.as_array().iter().copied().collect(),
        time_s: time_s.as_array().iter().copied().collect(),
        xy_px: xy.as_array().iter().copied().collect(),
        sigma_px: sigma.as_array().iter().copied().collect(),
        area_px: area.as_array().iter().copied().collect(),
        status: status.as_array().iter().copied().collect(),
    })
}

/// Columns and metadata as a table; shapes are checked, values are not.
pub fn table_of(py: Python<'_>, held: &Held<'_>, meta: &str) -> PyResult<NodeTable> {
    let meta = TableMeta::from_json(meta, "nodes.meta").map_err(|e| raise(py, e))?;
    let rows = rows_of(py, held, meta.rig.nodes.len())?;
    Ok(NodeTable { meta, rows })
}

/// Columns with the decisions of a text of edits made on them, by rows alone.
#[pyfunction]
pub fn edited_table<'py>(
    py: Python<'py>,
    held: Held<'_>,
    meta: &str,
    edits: &str,
    name: &str,
) -> PyResult<Columns<'py>> {
    let table = table_of(py, &held, meta)?;
    let done = py.detach(|| edits::edited(table, &Edits::parse(edits, name)?));
    columns(py, done.map_err(|e| raise(py, e))?)
}

/// The frames lost to damage by a table's `meta["damage"]`, in a sentence; `None` if none are.
#[pyfunction]
pub fn damage_words(py: Python<'_>, damage: &str) -> PyResult<Option<String>> {
    let damage: Damage = serde_json::from_str(damage).map_err(|e| {
        raise(py, Error::Table(Fault::new("meta", format!("its damage is not that of a node table ({e})"))))
    })?;
    Ok(damage.words())
}

/// Writes a node table, Parquet or CSV by the ending of `path`.
#[pyfunction]
pub fn write_table(
    py: Python<'_>,
    path: PathBuf,
    held: Held<'_>,
    meta: &str,
    safe_csv: bool,
) -> PyResult<()> {
    let table = table_of(py, &held, meta)?;
    py.detach(|| table.write(&path, cells(safe_csv))).map_err(|e| raise(py, e))
}

/// Checks the invariants of a node table.
#[pyfunction]
pub fn check_table(py: Python<'_>, held: Held<'_>, meta: &str) -> PyResult<()> {
    let table = table_of(py, &held, meta)?;
    py.detach(|| table.check("nodes")).map_err(|e| raise(py, e))
}

/// A node table as an Arrow stream, one row per frame and node, with the columns of the file.
#[pyfunction]
pub fn arrow_reader(py: Python<'_>, held: Held<'_>, rig: &str) -> PyResult<PyRecordBatchReader> {
    let rig = rig_of_json(rig).map_err(|e| raise(py, e))?;
    let rows = rows_of(py, &held, rig.nodes.len())?;
    let batches =
        (0..rows.frames()).step_by(BATCH_FRAMES).map(move |start| -> Result<RecordBatch, ArrowError> {
            let end = (start + BATCH_FRAMES).min(rows.frames());
            table::batch(&rows, start..end, &rig).map_err(|e| ArrowError::ExternalError(Box::new(e)))
        });
    let batches: Vec<_> = py.detach(|| batches.collect());
    Ok(PyRecordBatchReader::new(Box::new(RecordBatchIterator::new(batches, table::schema()))))
}

/// The kind of a file or folder: the name of a `tracker::kind::Kind`.
#[pyfunction]
pub fn kind_of(path: PathBuf) -> &'static str {
    kind::kind_of(&path).name()
}

/// The message for a file that is none of the kinds that are wanted.
#[pyfunction]
pub fn misplaced(py: Python<'_>, path: PathBuf, wanted: Vec<String>) -> PyResult<Option<Bound<'_, PyAny>>> {
    let known = |name: &String| Kind::ALL.into_iter().find(|k| k.name() == name);
    let wanted: Vec<Kind> = wanted.iter().filter_map(known).collect();
    kind::misplaced(&path, &wanted).map(|fault| to_python(py, &fault.message())).transpose()
}
