//! Converts keyword arguments to the settings of a run.
//!
//! Owns: their words. Words are those of the command line.

use pyo3::prelude::*;
use tracker::csv_text::Cells;
use tracker::detect::{Centroid, DetectSettings, Polarity, Threshold};
use tracker::pixel_aspect::PixelAspect;
use tracker::rig::{Region, Rig};
use tracker::source::{Decoder, Interlaced, OpenOptions};
use tracker::wanted::Wanted;

use crate::errors::{argument, raise};

/// One of `words`, by its place; an error that names them all.
fn word<T: Copy>(py: Python<'_>, name: &str, given: &str, words: &[(&str, T)]) -> PyResult<T> {
    words.iter().find(|(w, _)| *w == given).map(|(_, value)| *value).ok_or_else(|| {
        let known: Vec<&str> = words.iter().map(|(w, _)| *w).collect();
        argument(py, name, format!("{given:?} is not known"), &format!("Give one of {}", known.join(", ")))
    })
}

/// How markers are detected: threshold in the recording's units or `None`, polarity, centroid.
pub type DetectArguments = (Option<f64>, String, String);

/// Detection settings of keyword arguments.
pub fn detect_settings(py: Python<'_>, given: &DetectArguments) -> PyResult<DetectSettings> {
    let (threshold, polarity, centroid) = given;
    if threshold.is_some_and(|t| !t.is_finite()) {
        return Err(argument(py, "threshold", "it is not finite", "Give a number in the recording's units"));
    }
    Ok(DetectSettings {
        threshold: threshold.map_or(Threshold::Auto, Threshold::Raw),
        polarity: word(
            py,
            "polarity",
            polarity,
            &[("auto", Polarity::Auto), ("bright", Polarity::Bright), ("dark", Polarity::Dark)],
        )?,
        centroid: word(
            py,
            "centroid",
            centroid,
            &[("weighted", Centroid::Weighted), ("contour", Centroid::Contour)],
        )?,
        ..DetectSettings::default()
    })
}

/// What is to be followed: places that were pointed at, how many markers there are, numbers of the picture, pairs of nodes that
/// are one, and the region in px.
pub type WantedArguments =
    (Vec<String>, Option<usize>, Vec<usize>, Vec<(String, String)>, Option<(f64, f64, f64, f64)>);

/// What is to be followed, and the region.
pub fn wanted(py: Python<'_>, given: &WantedArguments) -> PyResult<(Wanted, Option<Region>)> {
    let (marker, markers, also, same, region) = given.clone();
    let place = |text: String| {
        text.parse().map_err(|why: String| {
            argument(py, "marker", format!("{text:?} cannot be"), &format!("It is {why}"))
        })
    };
    if let Some((x0, y0, x1, y1)) = region
        && ![x0, y0, x1, y1].iter().all(|v| v.is_finite())
    {
        return Err(argument(py, "region", "it is not finite", "Give first and last column and row in px"));
    }
    let marker = marker.into_iter().map(place).collect::<PyResult<Vec<_>>>()?;
    let same = same.into_iter().map(|(a, b)| [a, b]).collect();
    let region = region.map(|(x0, y0, x1, y1)| Region::Rectangle([x0, y0, x1, y1]));
    Ok((Wanted { marker, markers, also, same }, region))
}

/// How a recording is read: rate or `None`, decoder, how interlaced film is read, whether addresses may be opened,
/// threads, pixel aspect or `None`.
pub type OpenArguments = (Option<f64>, String, String, bool, usize, Option<String>);

/// Of `W:H`.
pub fn pixel_aspect(py: Python<'_>, given: Option<&str>) -> PyResult<Option<PixelAspect>> {
    let wrong = |problem| argument(py, "pixel_aspect", problem, "Give for example 16:15");
    given.map(str::parse).transpose().map_err(wrong)
}

/// Reading options of keyword arguments.
pub fn open_options(py: Python<'_>, given: &OpenArguments) -> PyResult<OpenOptions> {
    let (fps, decoder, interlaced, allow_protocol, threads, aspect) = given;
    Ok(OpenOptions {
        fps: *fps,
        pixel_aspect: pixel_aspect(py, aspect.as_deref())?,
        decoder: word(
            py,
            "decoder",
            decoder,
            &[("auto", Decoder::Auto), ("ffmpeg", Decoder::Ffmpeg), ("opencv", Decoder::Opencv)],
        )?,
        interlaced: word(
            py,
            "interlaced",
            interlaced,
            &[("refuse", Interlaced::Refuse), ("as-frames", Interlaced::AsFrames)],
        )?,
        allow_protocol: *allow_protocol,
        threads: *threads,
        colour: false,
    })
}

/// How a CSV writes names.
pub fn cells(safe_csv: bool) -> Cells {
    if safe_csv { Cells::Safe } else { Cells::Plain }
}

/// A rig of its JSON, checked.
pub fn rig(py: Python<'_>, text: Option<&str>) -> PyResult<Option<Rig>> {
    text.map(crate::rig::rig_of_json).transpose().map_err(|e| raise(py, e))
}
