//! Whole recordings: `track`, `setup`, `info`.

use std::path::PathBuf;

use pyo3::prelude::*;
use serde_json::json;
use tracker::error::Error;
use tracker::pipeline::{self, Existing, RunSettings};
use tracker::source;
use tracker::table::SourceFacts;

use crate::errors::{argument, raise};
use crate::settings::{DetectArguments, OpenArguments, detect_settings, open_options, rig};
use crate::tables::{Columns, columns, rig_json};
use crate::watch::Watch;

/// Frames from the first up to but not with the last; `None` is to the end.
type Frames = Option<(u64, Option<u64>)>;

fn settings(
    py: Python<'_>,
    input: String,
    rig_text: Option<&str>,
    frames: Frames,
    detect: &DetectArguments,
    open: &OpenArguments,
) -> PyResult<RunSettings> {
    Ok(RunSettings {
        input,
        rig: rig(py, rig_text)?,
        frames: frames.map(|(start, end)| start..end.unwrap_or(u64::MAX)),
        detect: detect_settings(py, detect)?,
        threads: open.3,
        open: open_options(py, open)?,
        ..RunSettings::default()
    })
}

/// Follows the markers of a recording. Columns, warnings, and the exception that stopped it, if one did.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
pub fn track<'py>(
    py: Python<'py>,
    input: String,
    rig: Option<&str>,
    frames: Frames,
    detect: DetectArguments,
    open: OpenArguments,
    output: Option<PathBuf>,
    existing: &str,
    progress: Option<Py<PyAny>>,
) -> PyResult<(Columns<'py>, Vec<String>, Option<PyErr>)> {
    let mut settings = settings(py, input, rig, frames, &detect, &open)?;
    settings.output = output;
    settings.collect = true;
    settings.existing = match existing {
        "refuse" => Existing::Refuse,
        "replace" => Existing::Replace,
        "resume" => Existing::Resume,
        other => return Err(argument(py, "existing", format!("{other:?} is not known"), "Give refuse")),
    };
    let mut watch = Watch::new(progress);
    let outcome = py.detach(|| pipeline::run(&settings, &mut watch));
    match (outcome, watch.into_error()) {
        (Ok(summary), stopped) => match summary.table {
            Some(table) => Ok((columns(py, table)?, summary.warnings, stopped)),
            None => Err(argument(py, "track", "the run gave no table", "Please report this")),
        },
        (Err(Error::Interrupted), Some(stopped)) => Err(stopped),
        (Err(error), _) => Err(raise(py, error)),
    }
}

/// Finds the rig of a recording: its JSON, and warnings.
#[pyfunction]
pub fn setup(
    py: Python<'_>,
    input: String,
    frames: Frames,
    detect: DetectArguments,
    open: OpenArguments,
    progress: Option<Py<PyAny>>,
) -> PyResult<(String, Vec<String>)> {
    let settings = settings(py, input, None, frames, &detect, &open)?;
    let mut watch = Watch::new(progress);
    let outcome = py.detach(|| pipeline::find_rig(&settings, &mut watch));
    match (outcome, watch.into_error()) {
        (Ok(found), None) => Ok((rig_json(&found.rig).map_err(|e| raise(py, e))?, found.warnings)),
        (Ok(_) | Err(Error::Interrupted), Some(stopped)) => Err(stopped),
        (Err(error), _) => Err(raise(py, error)),
    }
}

/// What is known of a recording before it is read through, as JSON.
#[pyfunction]
pub fn info(py: Python<'_>, input: String, open: OpenArguments) -> PyResult<String> {
    let options = open_options(py, &open)?;
    let known = py.detach(|| {
        let source = source::open(&input, &options)?;
        let info = source.info();
        let mut value = json!(SourceFacts::of(info));
        value["details"] = json!(info.details.iter().cloned().collect::<std::collections::BTreeMap<_, _>>());
        Ok(value.to_string())
    });
    known.map_err(|e| raise(py, e))
}
