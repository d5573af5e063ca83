//! Converts keyword arguments to the settings of a run; their words are parsed by the library.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use pyo3::prelude::*;
use tracker::csv_text::Cells;
use tracker::detect::{Centroid, DetectSettings, PolaritySetting, Threshold};
use tracker::error::{Error, Fault};
use tracker::overlay::FilmSettings;
use tracker::pipeline::Existing;
use tracker::pixel_aspect::PixelAspect;
use tracker::rig::{Region, Rig};
use tracker::setting_words::Worded;
use tracker::source::{Decoder, Interlaced, OpenOptions};
use tracker::synth::encode::Codec;
use tracker::wanted::Wanted;

use crate::errors::{argument, raise};

/// The value of a word.
pub fn word<T: Worded>(py: Python<'_>, text: &str) -> PyResult<T> {
    T::from_word(text).map_err(|fault: Fault| raise(py, Error::Argument(fault)))
}

/// Settings of detection.
#[pyclass(frozen, name = "DetectSettings", module = "pydpend._native")]
pub struct PyDetectSettings(pub DetectSettings);

#[pymethods]
impl PyDetectSettings {
    /// `threshold` and areas are learned where they are None; `region` is `X0,Y0,X1,Y1`.
    #[new]
    #[pyo3(signature = (*, threshold=None, polarity="auto", centroid="disc", region=None, min_area_px=None, max_area_px=None))]
    fn new(
        py: Python<'_>,
        threshold: Option<f64>,
        polarity: &str,
        centroid: &str,
        region: Option<&str>,
        min_area_px: Option<f64>,
        max_area_px: Option<f64>,
    ) -> PyResult<Self> {
        if threshold.is_some_and(|t| !t.is_finite()) {
            return Err(argument(
                py,
                "threshold",
                "it is not finite",
                "Give a number in the recording's units",
            ));
        }
        for (name, area) in [("min_area_px", min_area_px), ("max_area_px", max_area_px)] {
            if area.is_some_and(|a| !(a.is_finite() && a >= 0.0)) {
                return Err(argument(py, name, "it is not an area", "Give px, 0 or more"));
            }
        }
        let region: Option<Region> = region
            .map(str::parse)
            .transpose()
            .map_err(|problem| argument(py, "region", problem, "The first pixel is 0,0"))?;
        Ok(Self(DetectSettings {
            threshold: threshold.map_or(Threshold::Auto, Threshold::Raw),
            polarity: word::<PolaritySetting>(py, polarity)?,
            centroid: word::<Centroid>(py, centroid)?,
            region,
            min_area_px,
            max_area_px,
            ..DetectSettings::default()
        }))
    }
}

/// The markers that are to be followed, as the user names them.
#[pyclass(frozen, name = "Wanted", module = "pydpend._native")]
pub struct PyWanted(pub Wanted);

#[pymethods]
impl PyWanted {
    /// `marker` are places `X,Y[@FRAME]`, `also` numbers of the picture, `same` pairs of nodes that are one marker.
    #[new]
    #[pyo3(signature = (*, marker=Vec::new(), markers=None, also=Vec::new(), same=Vec::new()))]
    fn new(
        py: Python<'_>,
        marker: Vec<String>,
        markers: Option<usize>,
        also: Vec<usize>,
        same: Vec<[String; 2]>,
    ) -> PyResult<Self> {
        let place = |text: String| {
            text.parse().map_err(|why: String| {
                argument(py, "marker", format!("{text:?} cannot be"), &format!("It is {why}"))
            })
        };
        let marker = marker.into_iter().map(place).collect::<PyResult<Vec<_>>>()?;
        Ok(Self(Wanted { marker, markers, also, same }))
    }
}

/// Options of opening a recording.
#[pyclass(frozen, name = "OpenOptions", module = "pydpend._native")]
pub struct PyOpenOptions(pub OpenOptions);

#[pymethods]
impl PyOpenOptions {
    /// `threads` is 0 for one each core, `pixel_aspect` is `W:H`.
    #[new]
    #[pyo3(signature = (*, fps=None, decoder="auto", interlaced="refuse", allow_protocol=false, threads=0, pixel_aspect=None))]
    fn new(
        py: Python<'_>,
        fps: Option<f64>,
        decoder: &str,
        interlaced: &str,
        allow_protocol: bool,
        threads: usize,
        pixel_aspect: Option<&str>,
    ) -> PyResult<Self> {
        Ok(Self(OpenOptions {
            fps,
            pixel_aspect: self::pixel_aspect(py, pixel_aspect)?,
            decoder: word::<Decoder>(py, decoder)?,
            interlaced: word::<Interlaced>(py, interlaced)?,
            allow_protocol,
            threads,
            colour: false,
        }))
    }
}

/// Settings of the output of a run.
#[pyclass(frozen, module = "pydpend._native")]
pub struct OutputSettings {
    /// The file; `None` writes none.
    pub path: Option<PathBuf>,
    /// Treatment of an output that is there already.
    pub existing: Existing,
    /// Form of the names in a CSV.
    pub cells: Cells,
    /// Files that are read, which no output replaces.
    pub reads: Vec<PathBuf>,
}

#[pymethods]
impl OutputSettings {
    /// `existing` is `refuse`, `replace` or `resume`.
    #[new]
    #[pyo3(signature = (path, *, existing="refuse", safe_csv=false, reads=Vec::new()))]
    fn new(
        py: Python<'_>,
        path: Option<PathBuf>,
        existing: &str,
        safe_csv: bool,
        reads: Vec<PathBuf>,
    ) -> PyResult<Self> {
        let existing = match existing {
            "refuse" => Existing::Refuse,
            "replace" => Existing::Replace,
            "resume" => Existing::Resume,
            other => return Err(argument(py, "existing", format!("{other:?} is not known"), "Give refuse")),
        };
        Ok(Self { path, existing, cells: cells(safe_csv), reads })
    }
}

impl OutputSettings {
    /// Whether a file that is there already is replaced.
    pub fn replaces(&self) -> bool {
        self.existing == Existing::Replace
    }

    /// The file of a step that always writes one.
    pub fn named(&self, py: Python<'_>) -> PyResult<&Path> {
        self.path.as_deref().ok_or_else(|| argument(py, "output", "it is not named", "Give a file"))
    }
}

/// Settings of a film into which nodes are drawn.
#[pyclass(frozen, module = "pydpend._native")]
pub struct OverlaySettings(pub FilmSettings);

#[pymethods]
impl OverlaySettings {
    /// `width` is in px, None is the recording's.
    #[new]
    #[pyo3(signature = (*, every, width, play_fps, quality))]
    fn new(every: usize, width: Option<u32>, play_fps: u32, quality: u32) -> Self {
        Self(FilmSettings { play_fps, quality, every, width, replace: false })
    }
}

/// The form of names in a CSV.
pub fn cells(safe_csv: bool) -> Cells {
    if safe_csv { Cells::Safe } else { Cells::Plain }
}

/// The words of each setting that has words, the default first.
#[pyfunction]
pub fn setting_words() -> HashMap<&'static str, Vec<&'static str>> {
    fn words<T: Worded>() -> (&'static str, Vec<&'static str>) {
        (T::SETTING.name(), T::WORDS.iter().map(|(word, _)| *word).collect())
    }
    HashMap::from([
        words::<PolaritySetting>(),
        words::<Centroid>(),
        words::<Decoder>(),
        words::<Interlaced>(),
        words::<Codec>(),
    ])
}

/// The pixel aspect of `W:H`.
pub fn pixel_aspect(py: Python<'_>, given: Option<&str>) -> PyResult<Option<PixelAspect>> {
    let wrong = |problem| argument(py, "pixel_aspect", problem, "Give for example 16:15");
    given.map(str::parse).transpose().map_err(wrong)
}

/// A rig of its JSON, checked.
pub fn rig(py: Python<'_>, text: Option<&str>) -> PyResult<Option<Rig>> {
    text.map(crate::rig::rig_of_json).transpose().map_err(|e| raise(py, e))
}
