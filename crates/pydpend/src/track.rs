//! Whole recordings: `track`, `setup`, `overlay`, `info`.

use std::path::PathBuf;

use numpy::{IntoPyArray, PyArray1, PyArray3, PyArrayMethods};
use pyo3::prelude::*;
use serde_json::json;
use tracker::error::Error;
use tracker::message::Message;
use tracker::overlay::{self, FilmSettings};
use tracker::pipeline::{self, Existing, RunSettings};
use tracker::table::SourceFacts;

use crate::errors::{argument, raise, to_python};
use crate::settings::{DetectArguments, OpenArguments, detect_settings, open_options, rig};
use crate::tables::{Columns, Held, columns, rig_json, table_of};
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

/// Warnings as messages of `pydpend.errors`.
type Messages<'py> = Vec<Bound<'py, PyAny>>;

fn messages<'py>(py: Python<'py>, warnings: &[Message]) -> PyResult<Messages<'py>> {
    warnings.iter().map(|w| to_python(py, w)).collect()
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
) -> PyResult<(Columns<'py>, Messages<'py>, Option<PyErr>)> {
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
            Some(table) => Ok((columns(py, table)?, messages(py, &summary.warnings)?, stopped)),
            None => Err(argument(py, "track", "the run gave no table", "Please report this")),
        },
        (Err(Error::Interrupted), Some(stopped)) => Err(stopped),
        (Err(error), _) => Err(raise(py, error)),
    }
}

/// A rig as JSON, warnings, and the reference frame with the rig drawn, (H, W, 3).
type Found<'py> = (String, Messages<'py>, Bound<'py, PyArray3<u8>>);

/// Finds the rig of a recording; the picture is also written if a file is given.
#[pyfunction]
pub fn setup<'py>(
    py: Python<'py>,
    input: String,
    frames: Frames,
    detect: DetectArguments,
    open: OpenArguments,
    picture: Option<PathBuf>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Found<'py>> {
    let settings = settings(py, input, None, frames, &detect, &open)?;
    let mut watch = Watch::new(progress);
    let outcome = py.detach(|| {
        let found = tracker::setup::find(&settings, &mut watch)?;
        if let Some(path) = &picture {
            overlay::save(&found.picture, path)?;
        }
        Ok((rig_json(&found.rig)?, found.warnings, overlay::rgb(&found.picture)?, found.rig.image_px))
    });
    let (rig, warnings, samples, [w, h]) = watch.done(py, outcome)?;
    let picture = samples.into_pyarray(py).reshape([h as usize, w as usize, 3])?;
    Ok((rig, messages(py, &warnings)?, picture))
}

/// Frames and times in s, (K,).
type Filmed<'py> = (Bound<'py, PyArray1<i64>>, Bound<'py, PyArray1<f64>>);

/// Draws nodes into their recording: of each picture of the film the frame and the time in s, (K,).
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "the options of one call of Python's")]
pub fn overlay_film<'py>(
    py: Python<'py>,
    input: String,
    held: Held<'_>,
    meta: &str,
    output: PathBuf,
    open: OpenArguments,
    every: usize,
    width: Option<u32>,
    play_fps: u32,
    quality: u32,
    replace: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<Filmed<'py>> {
    let table = table_of(py, &held, meta)?;
    let open = open_options(py, &open)?;
    let settings = FilmSettings { play_fps, quality, every, width, replace };
    let mut watch = Watch::new(progress);
    let outcome = py.detach(|| {
        table.check("nodes")?;
        overlay::film(&input, &open, &table, &output, &settings, &mut watch)
    });
    let filmed = watch.done(py, outcome)?;
    Ok((filmed.frame.into_pyarray(py), filmed.time_s.into_pyarray(py)))
}

/// What is known of a recording before it is read through, as JSON.
#[pyfunction]
pub fn info(py: Python<'_>, input: String, open: OpenArguments) -> PyResult<String> {
    let options = open_options(py, &open)?;
    let mut watch = Watch::new(None);
    let known = py.detach(|| {
        let mut source = pipeline::open(&input, &options, &mut watch)?;
        let surveyed = pipeline::survey(&mut *source)?;
        let info = source.info();
        let (steps, is_whole) = surveyed.unwrap_or_default();
        let (timing, _) = pipeline::times(info, &steps, 0)?;
        let mut value = json!(SourceFacts {
            rate_hz: timing.rate_hz,
            rate_origin: timing.rate_origin,
            ..SourceFacts::of(info)
        });
        value["time"] = json!(timing);
        value["frames"] = json!(is_whole.then(|| steps.len()));
        value["details"] = json!(info.details.iter().cloned().collect::<std::collections::BTreeMap<_, _>>());
        Ok(value.to_string())
    });
    watch.done(py, known)
}
