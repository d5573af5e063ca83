//! Passes the film maker to Python: a scene's images, truth and files.

use std::path::PathBuf;

use numpy::{
    IntoPyArray, PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2,
    PyReadonlyArray3,
};
use pyo3::prelude::*;
use tracker::error::{Error, Fault};
use tracker::score::{Tracked, score};
use tracker::setting_words::Worded;
use tracker::synth::encode::Codec;
use tracker::synth::{self, Film, MotionTable, Scene, Truth, WriteOptions};

use crate::errors::raise;
use crate::settings::OutputSettings;

/// Times (T,) and angles (T, L) of a motion given from Python.
type Motion<'py> = Option<(PyReadonlyArray1<'py, f64>, PyReadonlyArray2<'py, f64>)>;

/// Time (T,), centres (T, N, 2), visible part (T, N), angles (T, L).
type TruthArrays<'py> = (
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray3<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
);

/// A scene ready to be filmed.
#[pyclass(frozen, name = "Film", module = "pydpend._native")]
pub struct PyFilm {
    film: Film,
}

fn table(motion: &Motion<'_>) -> Option<MotionTable> {
    motion.as_ref().map(|(time, phi)| {
        let phi = phi.as_array();
        MotionTable {
            name: "motion".into(),
            time_s: time.as_array().to_vec(),
            phi_rad: phi.columns().into_iter().map(|c| c.to_vec()).collect(),
            place_px: Vec::new(),
        }
    })
}

fn made(py: Python<'_>, scene: Result<Scene, Error>, motion: &Motion<'_>) -> PyResult<PyFilm> {
    let motion = table(motion);
    let film = py.detach(|| match &motion {
        Some(motion) => Film::with_motion(&scene?, motion),
        None => Film::new(&scene?),
    });
    Ok(PyFilm { film: film.map_err(|e| raise(py, e))? })
}

#[pymethods]
impl PyFilm {
    /// The film of a scene file.
    #[staticmethod]
    #[pyo3(signature = (path, motion=None))]
    fn read(py: Python<'_>, path: PathBuf, motion: Motion<'_>) -> PyResult<Self> {
        made(py, Scene::read(&path), &motion)
    }

    /// The film of a scene given as JSON.
    #[staticmethod]
    #[pyo3(signature = (scene, motion=None))]
    fn from_json(py: Python<'_>, scene: &str, motion: Motion<'_>) -> PyResult<Self> {
        let scene =
            serde_json::from_str::<Scene>(scene).map_err(|e| Error::Film(Fault::new("scene", e.to_string())));
        made(py, scene, &motion)
    }

    /// The film of one of the program's own scenes.
    #[staticmethod]
    #[pyo3(signature = (name, seed))]
    fn preset(py: Python<'_>, name: &str, seed: u64) -> PyResult<Self> {
        made(py, synth::preset(name, seed), &None)
    }

    /// The scene as JSON.
    fn scene(&self, py: Python<'_>) -> PyResult<String> {
        serde_json::to_string(self.film.scene())
            .map_err(|e| raise(py, Error::Film(Fault::new("scene", e.to_string()))))
    }

    /// The rig as it stands in a frame, TOML.
    fn rig_toml(&self, py: Python<'_>, frame: u64) -> PyResult<String> {
        self.film.rig(frame).to_toml().map_err(|e| raise(py, e))
    }

    /// The recorded levels of a frame, (H, W).
    fn image<'py>(&self, py: Python<'py>, frame: u64) -> PyResult<Bound<'py, PyAny>> {
        self.known(py, frame)?;
        let samples = py.detach(|| {
            let mut samples = Vec::new();
            self.film.render(frame, &mut samples);
            samples
        });
        let size = self.size();
        if self.film.bytes_per_pixel() == 2 {
            let wide: Vec<u16> = samples.chunks_exact(2).map(|b| u16::from_le_bytes([b[0], b[1]])).collect();
            return Ok(wide.into_pyarray(py).reshape(size)?.into_any());
        }
        Ok(samples.into_pyarray(py).reshape(size)?.into_any())
    }

    /// The expected levels of a frame, (H, W).
    fn expected<'py>(&self, py: Python<'py>, frame: u64) -> PyResult<Bound<'py, PyArray2<f32>>> {
        self.known(py, frame)?;
        let levels = py.detach(|| {
            let mut levels = Vec::new();
            self.film.expected(frame, &mut levels);
            levels
        });
        levels.into_pyarray(py).reshape(self.size())
    }

    /// The truth of all frames.
    fn truth<'py>(&self, py: Python<'py>) -> PyResult<TruthArrays<'py>> {
        let truth = py.detach(|| Truth::of(&self.film));
        let (t, n) = (truth.frames.len(), truth.nodes.len());
        let links = self.film.scene().links.len();
        let time: Vec<f64> = truth.frames.iter().map(|f| f.time_s).collect();
        let xy: Vec<f64> =
            truth.frames.iter().flat_map(|f| f.nodes.iter().flat_map(|n| [n.x_px, n.y_px])).collect();
        let visible: Vec<f64> = truth.frames.iter().flat_map(|f| f.nodes.iter().map(|n| n.visible)).collect();
        let phi: Vec<f64> = truth.frames.iter().flat_map(|f| f.phi_rad.iter().copied()).collect();
        Ok((
            time.into_pyarray(py),
            xy.into_pyarray(py).reshape([t, n, 2])?,
            visible.into_pyarray(py).reshape([t, n])?,
            phi.into_pyarray(py).reshape([t, links])?,
        ))
    }

    /// Writes the film and, if wanted, its truth.
    fn write(&self, py: Python<'_>, encoding: &EncodeSettings, output: &OutputSettings) -> PyResult<()> {
        let path = output.named(py)?.to_owned();
        let options = WriteOptions {
            cells: output.cells,
            replace: output.replaces(),
            reads: output.reads.clone(),
            ..encoding.0.clone()
        };
        let done = py.detach(|| {
            synth::write(&self.film, &path, &options, &mut |_| {
                Python::attach(|py| py.check_signals()).map_err(|_| Error::Interrupted)
            })
        });
        done.map_err(|e| raise(py, e))
    }
}

impl PyFilm {
    fn size(&self) -> [usize; 2] {
        let [w, h] = self.film.scene().image_px;
        [h as usize, w as usize]
    }

    fn known(&self, py: Python<'_>, frame: u64) -> PyResult<()> {
        if frame < self.film.frames() {
            return Ok(());
        }
        let fault = Fault::new("frame", format!("{frame} of a film of {} frames", self.film.frames()))
            .advice("Count from 0");
        Err(raise(py, Error::Film(fault)))
    }
}

/// Settings of encoding a film, and where its truth goes.
#[pyclass(frozen, module = "pydpend._native")]
pub struct EncodeSettings(WriteOptions);

#[pymethods]
impl EncodeSettings {
    /// `bits` are those of a sample.
    #[new]
    #[pyo3(signature = (*, truth, codec, quality, x264_preset, gray_only, bits))]
    fn new(
        py: Python<'_>,
        truth: Option<PathBuf>,
        codec: Option<&str>,
        quality: Option<u32>,
        x264_preset: Option<String>,
        gray_only: bool,
        bits: Option<u32>,
    ) -> PyResult<Self> {
        let codec = codec
            .map(|word| Codec::from_word(word).map_err(|fault| raise(py, Error::Film(fault))))
            .transpose()?;
        Ok(Self(WriteOptions {
            codec,
            quality,
            x264_preset,
            gray_only,
            bits,
            truth,
            ..WriteOptions::default()
        }))
    }
}

/// A table's places against the truth in a file or of a film, as JSON.
#[pyfunction]
#[pyo3(signature = (nodes, frame, xy_px, sigma_px, truth, limit_px))]
pub fn score_places(
    py: Python<'_>,
    nodes: Vec<String>,
    frame: PyReadonlyArray1<'_, i64>,
    xy_px: PyReadonlyArray3<'_, f64>,
    sigma_px: PyReadonlyArray2<'_, f32>,
    truth: Bound<'_, PyAny>,
    limit_px: f64,
) -> PyResult<String> {
    let frames = frame.as_array().iter().map(|&f| u64::try_from(f)).collect::<Result<Vec<_>, _>>();
    let Ok(frames) = frames else {
        let fault = Fault::new("frame", "a frame before the first").advice("Count from 0");
        return Err(raise(py, Error::Argument(fault)));
    };
    let flat: Vec<f64> = xy_px.as_array().iter().copied().collect();
    let tracked = Tracked {
        nodes,
        frames,
        xy_px: flat.chunks_exact(2).map(|p| [p[0], p[1]]).collect(),
        sigma_px: sigma_px.as_array().iter().copied().collect(),
    };
    let scored = if let Ok(film) = truth.cast::<PyFilm>() {
        let film = film.get();
        py.detach(|| score(&tracked, &Truth::of(&film.film), limit_px))
    } else {
        let path: PathBuf = truth.extract()?;
        py.detach(|| score(&tracked, &Truth::read(&path)?, limit_px))
    };
    let scored = scored.map_err(|e| raise(py, e))?;
    serde_json::to_string(&scored).map_err(|e| raise(py, Error::Film(Fault::new("score", e.to_string()))))
}
