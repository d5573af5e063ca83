//! Reads a source on a thread of its own, some frames ahead and no more.
//!
//! Owns: [`Ahead`], [`Batch`], its size. Must not: look at pixels.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

use crossbeam_channel::{Receiver, Sender, bounded};

use crate::error::{Error, Fault, Result};
use crate::frame::{Ending, Frame, FrameSource};
use crate::gaps::{Gaps, Reason};

/// Bytes of frames in a batch: a large frame is handed on as soon as it is there, while caches hold it.
const BATCH_BYTES: usize = 1 << 20;
/// Frames in a batch, where they are small.
const MOST_FRAMES: usize = 64;
/// Maximum number of batches that wait for detection.
const WAITING: usize = 8;

/// Frames in order, of which the first is the `first`-th of all that are read, from 0.
pub struct Batch {
    pub first: usize,
    pub frames: Vec<Frame>,
}

/// Ending of the reading.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct End {
    /// How the recording ended.
    pub ending: Ending,
    /// Frames that are not there between those that were asked for.
    pub gaps: Gaps,
    /// Why frames have no plane, see [`FrameSource::reasons`].
    pub reasons: Vec<Reason>,
}

/// Frames of a source, read ahead.
pub struct Ahead {
    batches: Receiver<Batch>,
    stop: Arc<AtomicBool>,
    reader: JoinHandle<Result<End>>,
}

impl Ahead {
    /// Begins to read. Frames before `frames` are read and dropped, since no source is sought by frame number.
    pub fn start(source: Box<dyn FrameSource>, frames: Range<u64>) -> Result<Self> {
        let (sender, batches) = bounded(WAITING);
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        let reader = std::thread::Builder::new()
            .name("source".into())
            .spawn(move || read(source, &frames, &sender, &stopped))
            .map_err(|e| {
                Error::Source(Fault::new("source", format!("no thread could be started ({e})")).caused_by(&e))
            })?;
        Ok(Self { batches, stop, reader })
    }

    /// The channel from which batches come, for any number of threads; closed after the last.
    pub fn batches(&self) -> &Receiver<Batch> {
        &self.batches
    }

    /// The end of reading, once the last batch is out.
    pub fn end(self) -> Result<End> {
        self.reader.join().unwrap_or_else(|_| {
            Err(Error::Source(Fault::new("source", "the decoder failed; please report this")))
        })
    }

    /// Stops reading. A source that waits for bytes that may never come is left to the end of the program.
    pub fn leave(self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

fn read(
    mut source: Box<dyn FrameSource>,
    frames: &Range<u64>,
    sender: &Sender<Batch>,
    stop: &AtomicBool,
) -> Result<End> {
    let mut batch = Batch { first: 0, frames: Vec::new() };
    let mut size = 1;
    let mut ending = Ending::Complete;
    while !stop.load(Ordering::Relaxed) {
        let Some(frame) = source.next_frame()? else {
            ending = source.ending();
            break;
        };
        if frame.index < frames.start {
            continue;
        }
        if frame.index >= frames.end {
            break;
        }
        if batch.frames.is_empty() {
            size = batch_size(&frame);
            batch.frames.reserve_exact(size);
        }
        batch.frames.push(frame);
        if batch.frames.len() == size {
            let next = Batch { first: batch.first + size, frames: Vec::new() };
            if sender.send(std::mem::replace(&mut batch, next)).is_err() {
                return Ok(End { ending, gaps: Gaps::default(), reasons: Vec::new() });
            }
        }
    }
    if !batch.frames.is_empty() {
        // The receivers may be gone; then nobody asks for the ending either.
        let _ = sender.send(batch);
    }
    let mut reasons = source.reasons();
    reasons.retain(|r| frames.contains(&r.frame));
    Ok(End { ending, gaps: source.gaps().within(frames), reasons })
}

/// Frames in a batch: so many that handing them on costs nothing beside detecting in them.
fn batch_size(frame: &Frame) -> usize {
    (BATCH_BYTES / frame.size_bytes().max(1)).clamp(1, MOST_FRAMES)
}
