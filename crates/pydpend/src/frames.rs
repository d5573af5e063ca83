//! Passes single frames of a recording to Python, by their index.
//!
//! Owns: [`FrameReader`] and which frames it keeps. Recordings are read forward only: going back beyond what is kept begins anew.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

use numpy::{IntoPyArray, PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use tracker::error::{Error, Fault, Result};
use tracker::frame::{Frame, FrameSource};
use tracker::gray::samples;
use tracker::name::text;
use tracker::pipeline;
use tracker::source::OpenOptions;

use crate::errors::raise;
use crate::settings::PyOpenOptions;
use crate::watch::Watch;

/// Memory for frames that are kept, bytes: ten seconds of a small film, a hundred frames of a large one.
const KEPT_BYTES: usize = 256 << 20;

/// A frame's samples; none where it could not be decoded.
#[derive(Clone)]
struct Kept {
    size: [usize; 2],
    depth_bits: u32,
    luma: Option<Vec<u16>>,
    colour: Option<[Vec<u8>; 2]>,
}

impl Kept {
    fn of(frame: &Frame) -> Result<Self> {
        Ok(Self {
            size: [frame.height as usize, frame.width as usize],
            depth_bits: frame.depth_bits,
            luma: samples(frame)?,
            colour: frame.colour.clone(),
        })
    }

    fn bytes(&self) -> usize {
        let colour = self.colour.as_ref().map_or(0, |[a, b]| a.len() + b.len());
        2 * self.luma.as_ref().map_or(0, Vec::len) + colour
    }
}

struct Reading {
    source: Box<dyn FrameSource>,
    next: u64,
    kept: BTreeMap<u64, Kept>,
    bytes: usize,
}

/// Luma (H, W) as uint16, bits of a sample, and blue and red differences as flat uint8, where there is colour.
type Shown<'py> =
    (Option<Bound<'py, PyAny>>, u32, Option<(Bound<'py, PyArray1<u8>>, Bound<'py, PyArray1<u8>>)>);

/// Frames of a recording by their index.
#[pyclass(frozen, module = "pydpend._native")]
pub struct FrameReader {
    input: String,
    options: OpenOptions,
    reading: Mutex<Reading>,
}

#[pymethods]
impl FrameReader {
    #[new]
    fn new(py: Python<'_>, input: PathBuf, open: &PyOpenOptions) -> PyResult<Self> {
        let options = OpenOptions { colour: true, ..open.0.clone() };
        let input = text(&input);
        let source = py.detach(|| pipeline::open(&input, &options, &mut Watch::new(None)));
        let source = source.map_err(|e| raise(py, e))?;
        let reading = Mutex::new(Reading { source, next: 0, kept: BTreeMap::new(), bytes: 0 });
        Ok(Self { input, options, reading })
    }

    /// A frame as it was recorded.
    fn frame<'py>(&self, py: Python<'py>, index: u64) -> PyResult<Shown<'py>> {
        let kept = py.detach(|| self.find(index)).map_err(|e| raise(py, e))?;
        let luma = match kept.luma {
            Some(samples) => Some(samples.into_pyarray(py).reshape(kept.size)?.into_any()),
            None => None,
        };
        let colour = kept.colour.map(|[blue, red]| (blue.into_pyarray(py), red.into_pyarray(py)));
        Ok((luma, kept.depth_bits, colour))
    }
}

impl FrameReader {
    fn open(&self) -> Result<Box<dyn FrameSource>> {
        pipeline::open(&self.input, &self.options, &mut Watch::new(None))
    }

    fn find(&self, index: u64) -> Result<Kept> {
        // What a thread that panicked left is only a frame less.
        let reading = &mut *self.reading.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(kept) = reading.kept.get(&index) {
            return Ok(kept.clone());
        }
        if reading.next > index {
            reading.source = self.open()?;
            reading.next = 0;
        }
        while let Some(frame) = reading.source.next_frame()? {
            reading.next = frame.index + 1;
            // What is far before the frame that is wanted would be forgotten before it is asked for.
            let each = (4 * frame.width as usize * frame.height as usize).max(1);
            if index.saturating_sub(frame.index) as usize > KEPT_BYTES / each / 2 {
                continue;
            }
            let kept = Kept::of(&frame)?;
            let found = (frame.index == index).then(|| kept.clone());
            reading.keep(frame.index, kept, index);
            match found {
                Some(found) => return Ok(found),
                None if frame.index > index => break,
                None => {}
            }
        }
        let problem =
            format!("there is no frame {index}: frames 0 to {} were read", reading.next.saturating_sub(1));
        Err(Error::Argument(Fault::new(&self.input, problem).advice("Give a frame that is there")))
    }
}

impl Reading {
    /// Keeps a frame, and forgets those that are farthest from the one that is `wanted`.
    fn keep(&mut self, index: u64, kept: Kept, wanted: u64) {
        self.bytes += kept.bytes();
        if let Some(before) = self.kept.insert(index, kept) {
            self.bytes -= before.bytes();
        }
        while self.bytes > KEPT_BYTES && self.kept.len() > 1 {
            let ends = [self.kept.keys().next(), self.kept.keys().next_back()];
            let far = ends.into_iter().flatten().copied().max_by_key(|k| k.abs_diff(wanted));
            match far.and_then(|far| self.kept.remove(&far)) {
                Some(gone) => self.bytes -= gone.bytes(),
                None => break,
            }
        }
    }
}
