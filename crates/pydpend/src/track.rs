//! Passes the work on whole recordings to Python: `track`, `setup`, `overlay`, `info`.

use std::path::{Path, PathBuf};

use numpy::{IntoPyArray, PyArray1, PyArray3, PyArrayMethods};
use pyo3::prelude::*;
use serde_json::json;
use tracker::edits::Edits;
use tracker::error::Error;
use tracker::message::Message;
use tracker::name::text;
use tracker::output;
use tracker::overlay::{self, FilmSettings};
use tracker::pipeline::{self, RunSettings};
use tracker::setting_words;
use tracker::source;
use tracker::table::{Fingerprint, SourceFacts};

use crate::errors::{argument, raise, to_python};
use crate::rig::rig_json;
use crate::settings::{OutputSettings, OverlaySettings, PyDetectSettings, PyOpenOptions, PyWanted, rig};
use crate::tables::{Columns, Held, columns, table_of};
use crate::watch::Watch;

/// Frames from the first up to but not with the last; `None` is to the end.
type Frames = Option<(u64, Option<u64>)>;

fn settings(
    input: PathBuf,
    frames: Frames,
    detect: &PyDetectSettings,
    open: &PyOpenOptions,
    wanted: &PyWanted,
) -> RunSettings {
    RunSettings {
        input: text(&input),
        frames: frames.map(|(start, end)| start..end.unwrap_or(u64::MAX)),
        detect: detect.0.clone(),
        wanted: wanted.0.clone(),
        threads: open.0.threads,
        open: open.0.clone(),
        ..RunSettings::default()
    }
}

/// The frames of `A..B`, of which B may be left out.
#[pyfunction]
pub fn frame_range(py: Python<'_>, text: &str) -> PyResult<(u64, Option<u64>)> {
    let frames = setting_words::frame_range(text)
        .map_err(|problem| argument(py, "frames", format!("{text:?} cannot be"), &problem))?;
    Ok((frames.start, (frames.end < u64::MAX).then_some(frames.end)))
}

/// Warnings as messages of `pydpend.errors`.
type Messages<'py> = Vec<Bound<'py, PyAny>>;

fn messages<'py>(py: Python<'py>, warnings: &[Message]) -> PyResult<Messages<'py>> {
    warnings.iter().map(|w| to_python(py, w)).collect()
}

/// Follows the markers of a recording. Columns, warnings, and the exception that stopped it, if one did.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "the options of one call of Python's")]
pub fn track<'py>(
    py: Python<'py>,
    input: PathBuf,
    rig: Option<&str>,
    frames: Frames,
    detect: &PyDetectSettings,
    open: &PyOpenOptions,
    wanted: &PyWanted,
    edits: Option<PathBuf>,
    output: &OutputSettings,
    progress: Option<Py<PyAny>>,
) -> PyResult<(Columns<'py>, Messages<'py>, Option<PyErr>)> {
    let settings = RunSettings {
        rig: self::rig(py, rig)?,
        edits: edits.map(|file| Edits::read(&file)).transpose().map_err(|e| raise(py, e))?,
        output: output.path.clone(),
        existing: output.existing,
        collect: true,
        cells: output.cells,
        reads: output.reads.clone(),
        ..settings(input, frames, detect, open, wanted)
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

/// A rig as JSON, warnings, and the reference picture with the rig drawn, (H, W, 3).
type Found<'py> = (String, Messages<'py>, Bound<'py, PyArray3<u8>>);

/// Lines, samples red, green, blue, width and height.
type Unclear = (Vec<String>, Vec<u8>, [usize; 2]);

/// The candidates where it is not clear which are meant: a line for each, and the picture, which is also written if a file is
/// given. Nothing where nothing was found or the picture cannot be drawn: the reason for it is the error that is raised.
fn drawn(settings: &RunSettings, file: Option<&Path>, watch: &mut Watch) -> Option<Unclear> {
    let found = watch.candidates.take().filter(|c| !c.all.is_empty())?;
    let picture = tracker::setup::picture_of(settings, &found, watch).ok()?;
    if let Some(path) = file {
        picture.save(path).ok()?;
    }
    let lines = found.all.iter().map(|c| c.line()).collect();
    Some((lines, picture.rgb().ok()?, picture.size_px()))
}

/// Finds the rig of a recording; rig and picture are also written if files are given.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "the options of one call of Python's")]
pub fn setup<'py>(
    py: Python<'py>,
    input: PathBuf,
    frames: Frames,
    detect: &PyDetectSettings,
    open: &PyOpenOptions,
    wanted: &PyWanted,
    output: &OutputSettings,
    picture: Option<PathBuf>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Found<'py>> {
    let settings = settings(input, frames, detect, open, wanted);
    let mut watch = Watch::new(progress);
    let mut unclear = None;
    let outcome = py.detach(|| {
        let outputs: Vec<PathBuf> = output.path.iter().chain(&picture).cloned().collect();
        output::check(&outputs, &source::files(&settings.input)?, output.replaces()).map_err(Error::Rig)?;
        let found = tracker::setup::find(&settings, &mut watch);
        if let Err(Error::Detect(_) | Error::Rig(_)) = &found {
            unclear = drawn(&settings, picture.as_deref(), &mut watch);
        }
        let found = found?;
        if let Some(path) = &picture {
            found.picture.save(path)?;
        }
        if let Some(path) = &output.path {
            found.rig.write(path)?;
        }
        Ok((rig_json(&found.rig)?, found.warnings, found.picture.rgb()?, found.picture.size_px()))
    });
    let outcome = watch.done(py, outcome);
    if let (Err(error), Some((lines, samples, [w, h]))) = (&outcome, unclear) {
        let exception = error.value(py);
        exception.setattr("candidates", lines)?;
        exception.setattr("picture", samples.into_pyarray(py).reshape([h, w, 3])?)?;
    }
    let (rig, warnings, samples, [w, h]) = outcome?;
    let picture = samples.into_pyarray(py).reshape([h, w, 3])?;
    Ok((rig, messages(py, &warnings)?, picture))
}

/// Frames and times in s, (K,).
type Filmed<'py> = (Bound<'py, PyArray1<i64>>, Bound<'py, PyArray1<f64>>);

/// Draws nodes into their recording: of each picture of the film the frame and the time in s, (K,).
#[pyfunction]
pub fn overlay_film<'py>(
    py: Python<'py>,
    input: PathBuf,
    held: Held<'_>,
    meta: &str,
    open: &PyOpenOptions,
    film: &OverlaySettings,
    output: &OutputSettings,
    progress: Option<Py<PyAny>>,
) -> PyResult<Filmed<'py>> {
    let table = table_of(py, &held, meta)?;
    let settings = FilmSettings { replace: output.replaces(), ..film.0 };
    let path = output.named(py)?.to_owned();
    let mut watch = Watch::new(progress);
    let outcome = py.detach(|| {
        table.check("nodes")?;
        output::check(std::slice::from_ref(&path), &output.reads, settings.replace).map_err(Error::Film)?;
        overlay::film(&text(&input), &open.0, &table, &path, &settings, &mut watch)
    });
    let filmed = watch.done(py, outcome)?;
    Ok((filmed.frame.into_pyarray(py), filmed.time_s.into_pyarray(py)))
}

/// The facts of a recording before it is read through, as JSON.
#[pyfunction]
pub fn info(py: Python<'_>, input: PathBuf, open: &PyOpenOptions) -> PyResult<String> {
    let mut watch = Watch::new(None);
    let known = py.detach(|| {
        let input = text(&input);
        let files = source::files(&input)?;
        let mut source = pipeline::open(&input, &open.0, &mut watch)?;
        let surveyed = pipeline::survey(&mut *source)?;
        let info = source.info();
        let (steps, is_whole) = surveyed.unwrap_or_default();
        let (timing, _) = pipeline::times(info, &steps, 0)?;
        let mut value = json!(SourceFacts {
            rate_hz: timing.rate_hz,
            rate_origin: timing.rate_origin,
            ..SourceFacts::of(info, &files)?
        });
        value["time"] = json!(timing);
        value["frames"] = json!(is_whole.then(|| steps.len()));
        value["pixel_aspect"] = json!(info.pixel_aspect);
        value["pixel_aspect_origin"] = json!(info.pixel_aspect_origin);
        value["details"] = json!(info.details.iter().cloned().collect::<std::collections::BTreeMap<_, _>>());
        Ok(value.to_string())
    });
    watch.done(py, known)
}

/// The files that a recording is read from; none for what is read once only.
#[pyfunction]
pub fn recording_files(py: Python<'_>, input: PathBuf) -> PyResult<Vec<PathBuf>> {
    source::files(&text(&input)).map_err(|e| raise(py, e))
}

/// The fingerprint of some files' contents, made without reading all of them, in hexadecimal.
#[pyfunction]
pub fn fingerprint(py: Python<'_>, files: Vec<PathBuf>) -> PyResult<String> {
    py.detach(|| Fingerprint::of(&files)).map(|f| f.sha256).map_err(|e| raise(py, e))
}

/// Refuses outputs that would replace an input, one another or, unless `replace`, anything that is there already.
#[pyfunction]
pub fn check_outputs(
    py: Python<'_>,
    outputs: Vec<PathBuf>,
    inputs: Vec<PathBuf>,
    replace: bool,
) -> PyResult<()> {
    output::check(&outputs, &inputs, replace).map_err(|fault| raise(py, Error::Argument(fault)))
}
