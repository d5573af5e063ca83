//! Detection over batches of frames, in parallel, its results in the order of the recording.
//!
//! Owns: [`Detectors`], [`detect_all`]. Must not: know how a marker is detected.

use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};

use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use super::Observer;
use super::ahead::{Ahead, Next};
use crate::detect::{DetectSettings, Detection, Detector, Levels};
use crate::error::{Error, Fault, Place, Result};
use crate::frame::{Ending, Frame, FrameSource};
use crate::store::{DetectionStore, FrameStamp};
use crate::table::SourceFacts;

/// A detector for each thread. Each keeps its scratch memory; none remembers a frame.
pub struct Detectors {
    pool: ThreadPool,
    each: Vec<Mutex<Detector>>,
    recording: String,
}

impl Detectors {
    /// As many as `threads`; 0 is one for each core.
    pub fn new(
        threads: usize,
        levels: &Arc<Levels>,
        settings: &DetectSettings,
        facts: &SourceFacts,
    ) -> Result<Self> {
        let pool = ThreadPoolBuilder::new()
            .num_threads(threads)
            .thread_name(|i| format!("detect-{i}"))
            .build()
            .map_err(|e| Error::Argument(Fault::new("threads", e.to_string()).advice("Ask for fewer")))?;
        let each = (0..pool.current_num_threads())
            .map(|_| Detector::new(Arc::clone(levels), settings).map(Mutex::new))
            .collect::<Result<_>>()?;
        Ok(Self { pool, each, recording: facts.name.clone() })
    }

    /// Detects in each frame of a batch.
    fn run(&self, batch: &[Frame], found: &mut [Found]) {
        self.pool.install(|| {
            batch.par_iter().with_max_len(1).zip(found.par_iter_mut()).for_each(|(frame, found)| {
                let i = rayon::current_thread_index().unwrap_or(0);
                let mut detector = self.each[i].lock().unwrap_or_else(PoisonError::into_inner);
                found.outcome = match frame.plane {
                    Some(_) => detector.detect(frame, &mut found.detections),
                    None => {
                        found.detections.clear();
                        Ok(())
                    }
                };
            });
        });
    }
}

struct Found {
    detections: Vec<Detection>,
    outcome: Result<()>,
}

/// Reads a recording through and stores what is detected. Frames that the store holds already are compared with
/// those read and not detected again. `None` if the observer asked to stop.
///
/// # Errors
/// Those of the source, of detection and of the store; [`Error::Source`] if time does not go forward or the
/// recording is not the one that the store began with.
pub fn detect_all(
    source: Box<dyn FrameSource>,
    frames: Range<u64>,
    detectors: &Detectors,
    store: &mut DetectionStore,
    observer: &mut dyn Observer,
) -> Result<Option<Ending>> {
    let ahead = Ahead::start(source, frames, detectors.each.len())?;
    let mut found: Vec<Found> = Vec::new();
    let (mut done, mut newest) = (0usize, None);
    loop {
        if observer.interrupted() {
            ahead.leave();
            return Ok(None);
        }
        let batch = match ahead.next() {
            Next::Batch(batch) => batch,
            Next::Waiting => continue,
            Next::End => return ahead.ending().map(Some),
        };
        if let Err(error) = take(&batch, &mut done, &mut newest, &mut found, detectors, store) {
            ahead.leave();
            return Err(error);
        }
        observer.progress(done as u64);
    }
}

fn take(
    batch: &[Frame],
    done: &mut usize,
    newest: &mut Option<(u64, i64)>,
    found: &mut Vec<Found>,
    detectors: &Detectors,
    store: &mut DetectionStore,
) -> Result<()> {
    let known = store.len().saturating_sub(*done).min(batch.len());
    for frame in batch {
        forward(frame, newest, &detectors.recording)?;
    }
    for frame in &batch[..known] {
        if store.stamp(*done) != stamp(frame) {
            return Err(Error::Source(
                Fault::new(&detectors.recording, "the recording is not the one that the earlier run read")
                    .at(Place::Frame(frame.index))
                    .advice("Begin anew with --force"),
            ));
        }
        *done += 1;
    }
    store.check()?;
    let batch = &batch[known..];
    found.resize_with(batch.len().max(found.len()), || Found { detections: Vec::new(), outcome: Ok(()) });
    detectors.run(batch, &mut found[..batch.len()]);
    for (frame, found) in batch.iter().zip(found) {
        std::mem::replace(&mut found.outcome, Ok(()))?;
        store.push(stamp(frame), &found.detections)?;
        *done += 1;
    }
    Ok(())
}

fn stamp(frame: &Frame) -> FrameStamp {
    FrameStamp { index: frame.index, ticks: frame.ticks, decoded: frame.plane.is_some() }
}

/// Index and time must grow: a table whose time stands still is worth nothing.
fn forward(frame: &Frame, newest: &mut Option<(u64, i64)>, recording: &str) -> Result<()> {
    if let Some((index, ticks)) = *newest
        && (frame.index <= index || frame.ticks <= ticks)
    {
        return Err(Error::Source(
            Fault::new(recording, format!("tick {} comes after tick {ticks} of frame {index}", frame.ticks))
                .at(Place::Frame(frame.index))
                .advice("Give the rate with --fps, which replaces the time stamps"),
        ));
    }
    *newest = Some((frame.index, frame.ticks));
    Ok(())
}
