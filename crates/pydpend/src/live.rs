//! Passes detection in one image, and a tracker that is fed image by image, to Python.

use std::sync::Arc;

use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use tracker::detect::{DetectSettings, Detection, Detector, Levels};
use tracker::error::{Error, Fault};
use tracker::frame::Frame;
use tracker::rig::Rig;
use tracker::store::FrameStamp;
use tracker::track::Tracker;

use crate::errors::{argument, raise};
use crate::images::frame_of;
use crate::settings::{PyDetectSettings, pixel_aspect, rig};

/// x, y in px, sigma in px, area in px, peak, elongation, flags: one entry per detection.
type Found<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f32>>, Bound<'py, PyArray1<u8>>);

fn found<'py>(py: Python<'py>, detections: &[Detection]) -> PyResult<Found<'py>> {
    let n = detections.len();
    let xy: Vec<f64> = detections.iter().flat_map(|d| [d.x_px, d.y_px]).collect();
    let rest: Vec<f32> =
        detections.iter().flat_map(|d| [d.sigma_px, d.area_px, d.peak, d.elongation]).collect();
    let flags: Vec<u8> = detections.iter().map(|d| d.flags.0).collect();
    Ok((xy.into_pyarray(py).reshape([n, 2])?, rest.into_pyarray(py).reshape([n, 4])?, flags.into_pyarray(py)))
}

/// Detects the markers of one image, which is all that is known of its recording.
#[pyfunction]
pub fn detect<'py>(
    py: Python<'py>,
    image: &Bound<'py, PyAny>,
    settings: &PyDetectSettings,
    depth_bits: Option<u32>,
    aspect: Option<&str>,
) -> PyResult<Found<'py>> {
    let pixel_aspect = pixel_aspect(py, aspect)?.unwrap_or_default();
    let settings = DetectSettings { pixel_aspect, ..settings.0.clone() };
    let frame = frame_of(image, "image", 0, 0, depth_bits)?;
    let detections = py.detach(|| {
        let frames = [frame];
        let mut detector = Detector::new(Arc::new(Levels::learn(&frames, &settings)?), &settings)?;
        let mut out = Vec::new();
        detector.detect(&frames[0], &mut out).map(|()| out)
    });
    found(py, &detections.map_err(|e| raise(py, e))?)
}

/// (N, 2) places in px, (N,) sigma in px, (N,) area in px, (N,) status.
type Row<'py> = (
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray1<f32>>,
    Bound<'py, PyArray1<f32>>,
    Bound<'py, PyArray1<u8>>,
);

/// Follows the markers of a rig, image by image.
#[pyclass(module = "pydpend._native")]
pub struct LiveTracker {
    rig: Rig,
    settings: DetectSettings,
    depth_bits: Option<u32>,
    detector: Option<Detector>,
    tracker: Tracker,
    detections: Vec<Detection>,
}

impl LiveTracker {
    fn check_size(&self, py: Python<'_>, frame: &Frame, name: &str) -> PyResult<()> {
        let [w, h] = self.rig.image_px;
        if [frame.width, frame.height] == [w, h] {
            return Ok(());
        }
        let problem = format!("it is {} x {} px, the rig is for {w} x {h}", frame.width, frame.height);
        Err(argument(py, name, problem, "Give images of one size, as (height, width)"))
    }
}

#[pymethods]
impl LiveTracker {
    #[new]
    fn new(
        py: Python<'_>,
        rig_text: &str,
        settings: &PyDetectSettings,
        depth_bits: Option<u32>,
    ) -> PyResult<Self> {
        let Some(rig) = rig(py, Some(rig_text))? else {
            return Err(argument(py, "rig", "there is none", "Give the rig that is filmed"));
        };
        let mut settings = settings.0.clone();
        settings.region = settings.region.or_else(|| rig.region.clone());
        settings.lens = rig.lens.clone();
        settings.pixel_aspect = rig.pixel_aspect;
        let tracker = Tracker::new(&rig).map_err(|e| raise(py, e))?;
        Ok(Self { rig, settings, depth_bits, detector: None, tracker, detections: Vec::new() })
    }

    /// Learns thresholds and noise from images of the scene.
    fn learn(&mut self, py: Python<'_>, images: Vec<Bound<'_, PyAny>>) -> PyResult<()> {
        let mut frames = Vec::with_capacity(images.len());
        for (i, image) in images.iter().enumerate() {
            let frame = frame_of(image, &format!("images[{i}]"), i as u64, i as i64, self.depth_bits)?;
            self.check_size(py, &frame, &format!("images[{i}]"))?;
            frames.push(frame);
        }
        if frames.is_empty() {
            return Err(argument(py, "images", "there are none", "Give some images of the scene"));
        }
        let settings = &self.settings;
        let detector = py.detach(|| Detector::new(Arc::new(Levels::learn(&frames, settings)?), settings));
        self.detector = Some(detector.map_err(|e| raise(py, e))?);
        Ok(())
    }

    /// The nodes in the next image, in the rig's order; learns from it first if nothing was learned yet.
    fn step<'py>(&mut self, py: Python<'py>, image: &Bound<'py, PyAny>, index: u64) -> PyResult<Row<'py>> {
        if index > i64::MAX as u64 {
            return Err(argument(py, "frame", format!("{index} is too large"), "Count frames from 0"));
        }
        let frame = frame_of(image, "image", index, index as i64, self.depth_bits)?;
        self.check_size(py, &frame, "image")?;
        let row = py.detach(|| {
            let frames = [frame];
            let detector = match &mut self.detector {
                Some(detector) => detector,
                none => none.insert(Detector::new(
                    Arc::new(Levels::learn(&frames, &self.settings)?),
                    &self.settings,
                )?),
            };
            detector.detect(&frames[0], &mut self.detections)?;
            self.tracker.step(&FrameStamp { index, ticks: index as i64, decoded: true }, &self.detections)
        });
        let row = row.map_err(|e| match e {
            // The Rust name of the call means nothing here.
            Error::Argument(f) => raise(py, Error::Argument(Fault { subject: "frame".into(), ..f })),
            other => raise(py, other),
        })?;
        let n = row.len();
        let xy: Vec<f64> = row.iter().flat_map(|o| [o.x_px, o.y_px]).collect();
        Ok((
            xy.into_pyarray(py).reshape([n, 2])?,
            row.iter().map(|o| o.sigma_px).collect::<Vec<_>>().into_pyarray(py),
            row.iter().map(|o| o.area_px).collect::<Vec<_>>().into_pyarray(py),
            row.iter().map(|o| o.status as u8).collect::<Vec<_>>().into_pyarray(py),
        ))
    }

    /// The detections of the last image.
    fn detections<'py>(&self, py: Python<'py>) -> PyResult<Found<'py>> {
        found(py, &self.detections)
    }
}
