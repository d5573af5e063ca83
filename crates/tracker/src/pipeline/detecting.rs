//! Detects in the frames of a recording on several threads, with results in the order of the recording.
//!
//! Owns: [`Detectors`], [`detect_all`]. Must not: know how a marker is detected.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, bounded};

use super::ahead::{Ahead, Batch, End};
use super::observer::Observer;
use crate::detect::{DetectSettings, Detection, Detector, Levels};
use crate::error::{Error, Fault, Place, Result};
use crate::frame::FrameSource;
use crate::message::Setting;
use crate::source::cores;
use crate::store::{DetectionStore, FrameStamp};
use crate::table::SourceFacts;

/// Longest wait for frames before it is asked whether the user wants to stop.
const PATIENCE: Duration = Duration::from_millis(50);

/// A detector for each thread. Each keeps its scratch memory; none remembers a frame.
pub struct Detectors {
    each: Vec<Detector>,
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
        let each = (0..cores(threads))
            .map(|_| Detector::new(Arc::clone(levels), settings))
            .collect::<Result<_>>()?;
        Ok(Self { each, recording: facts.name.clone() })
    }
}

/// Detections of a batch.
#[derive(Default)]
struct Found {
    first: usize,
    stamps: Vec<FrameStamp>,
    /// For each frame; there may be more from an earlier use.
    detections: Vec<Vec<Detection>>,
    /// The frames before it are good.
    error: Option<Error>,
}

/// Detects in batches until there are no more, or nobody wants them. Frames before `known` are only looked at.
struct Worker<'a> {
    detector: &'a mut Detector,
    known: usize,
    batches: Receiver<Batch>,
    found: Sender<Found>,
    /// Buffers that are free again.
    spare: Receiver<Found>,
    stop: &'a AtomicBool,
}

impl Worker<'_> {
    fn run(self) {
        while !self.stop.load(Ordering::Relaxed) {
            let batch = match self.batches.recv_timeout(PATIENCE) {
                Ok(batch) => batch,
                Err(RecvTimeoutError::Timeout) => continue,
                Err(RecvTimeoutError::Disconnected) => return,
            };
            let mut found = self.spare.try_recv().unwrap_or_default();
            Self::detect(self.detector, self.known, batch, &mut found);
            if self.found.send(found).is_err() {
                return;
            }
        }
    }

    fn detect(detector: &mut Detector, known: usize, batch: Batch, found: &mut Found) {
        found.first = batch.first;
        found.error = None;
        found.stamps.clear();
        found.detections.resize_with(batch.frames.len().max(found.detections.len()), Vec::new);
        // Each frame is given back to the source as soon as it has been looked at.
        for (i, frame) in batch.frames.into_iter().enumerate() {
            found.stamps.push(FrameStamp {
                index: frame.index,
                ticks: frame.ticks,
                decoded: frame.plane.is_some(),
            });
            found.detections[i].clear();
            if frame.plane.is_some()
                && batch.first + i >= known
                && let Err(error) = detector.detect(&frame, &mut found.detections[i])
            {
                found.error = Some(error);
                found.stamps.pop();
                return;
            }
        }
    }
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
    detectors: &mut Detectors,
    store: &mut DetectionStore,
    observer: &mut dyn Observer,
) -> Result<Option<End>> {
    let ahead = Ahead::start(source, frames)?;
    let known = store.len();
    let stop = AtomicBool::new(false);
    let (sender, receiver) = bounded(4 * detectors.each.len());
    let (give_back, spare) = bounded(4 * detectors.each.len());
    let mut inbox = Inbox { known, done: 0, newest: None, recording: &detectors.recording, store };
    let complete = std::thread::scope(|scope| {
        for (i, detector) in detectors.each.iter_mut().enumerate() {
            let worker = Worker {
                detector,
                known,
                batches: ahead.batches().clone(),
                found: sender.clone(),
                spare: spare.clone(),
                stop: &stop,
            };
            let started =
                std::thread::Builder::new().name(format!("detect-{i}")).spawn_scoped(scope, || worker.run());
            if let Err(e) = started {
                stop.store(true, Ordering::Relaxed);
                return Err(Error::Argument(
                    Fault::of(Setting::Threads, format!("thread {i} could not be started ({e})"))
                        .caused_by(&e)
                        .advice("Ask for fewer"),
                ));
            }
        }
        drop(sender);
        let complete = inbox.fill(receiver, &give_back, observer);
        stop.store(true, Ordering::Relaxed);
        complete
    });
    match complete {
        Ok(true) => ahead.end().map(Some),
        Ok(false) => {
            ahead.leave();
            Ok(None)
        }
        Err(error) => {
            ahead.leave();
            Err(error)
        }
    }
}

/// Puts what the threads found into the store, in order.
struct Inbox<'a> {
    known: usize,
    done: usize,
    newest: Option<(u64, i64)>,
    recording: &'a str,
    store: &'a mut DetectionStore,
}

impl Inbox<'_> {
    /// Takes all there is. Whether the recording was read through; else the observer asked to stop.
    fn fill(
        &mut self,
        receiver: Receiver<Found>,
        give_back: &Sender<Found>,
        observer: &mut dyn Observer,
    ) -> Result<bool> {
        let mut early: BTreeMap<usize, Found> = BTreeMap::new();
        loop {
            if observer.interrupted() {
                return Ok(false);
            }
            match receiver.recv_timeout(PATIENCE) {
                Ok(found) => drop(early.insert(found.first, found)),
                Err(RecvTimeoutError::Timeout) => continue,
                Err(RecvTimeoutError::Disconnected) => return Ok(true),
            }
            early.extend(receiver.try_iter().map(|found| (found.first, found)));
            while let Some(found) = early.remove(&self.done) {
                self.take(found).map(|found| drop(give_back.try_send(found)))?;
            }
            observer.progress(self.done as u64);
        }
    }

    fn take(&mut self, mut found: Found) -> Result<Found> {
        for (stamp, detections) in found.stamps.iter().zip(&found.detections) {
            forward(stamp, &mut self.newest, self.recording)?;
            if self.done >= self.known {
                self.store.push(*stamp, detections)?;
            } else if self.store.stamp(self.done) != *stamp {
                return Err(Error::Source(
                    Fault::new(self.recording, "the recording is not the one that the earlier run read")
                        .at(Place::Frame(stamp.index))
                        .advice(super::state::anew()),
                ));
            }
            self.done += 1;
        }
        self.store.check()?;
        found.error.take().map_or(Ok(found), Err)
    }
}

/// Index must grow, and time must not go back. Equal stamps may be those of an even grid, rounded.
fn forward(stamp: &FrameStamp, newest: &mut Option<(u64, i64)>, recording: &str) -> Result<()> {
    if let Some((index, ticks)) = *newest
        && (stamp.index <= index || stamp.ticks < ticks)
    {
        return Err(Error::Source(
            Fault::new(recording, format!("tick {} comes after tick {ticks} of frame {index}", stamp.ticks))
                .at(Place::Frame(stamp.index))
                .advice("Give the rate with " + Setting::Fps + ", which replaces the time stamps"),
        ));
    }
    *newest = Some((stamp.index, stamp.ticks));
    Ok(())
}
