//! The source on a thread of its own, some batches of frames ahead and no more.
//!
//! Owns: [`Ahead`], the size of a batch. Must not: look at pixels.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, bounded};

use crate::error::{Error, Fault, Result};
use crate::frame::{Ending, Frame, FrameSource};

/// Bytes of frames in a batch. Three batches exist at once: one filled, one waiting, one in detection.
const BATCH_BYTES: usize = 6 << 20;
/// Frames in a batch, where they are small.
const MOST_FRAMES: usize = 256;
/// How long to wait for frames before looking whether the user wants to stop.
const PATIENCE: Duration = Duration::from_millis(50);

/// What came of waiting for frames.
pub enum Next {
    /// Frames, in order.
    Batch(Vec<Frame>),
    /// None yet.
    Waiting,
    /// There are no more.
    End,
}

/// Frames of a source, read ahead.
pub struct Ahead {
    frames: Receiver<Vec<Frame>>,
    stop: Arc<AtomicBool>,
    reader: JoinHandle<Result<Ending>>,
}

impl Ahead {
    /// Begins to read. Frames before `frames` are read and dropped, since no source is sought by frame number.
    pub fn start(source: Box<dyn FrameSource>, frames: Range<u64>, threads: usize) -> Result<Self> {
        let (sender, receiver) = bounded(1);
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        let reader = std::thread::Builder::new()
            .name("source".into())
            .spawn(move || read(source, &frames, threads, &sender, &stopped))
            .map_err(|e| Error::Source(Fault::new("source", format!("no thread could be started ({e})"))))?;
        Ok(Self { frames: receiver, stop, reader })
    }

    /// The next frames, or the news that there are none yet.
    pub fn next(&self) -> Next {
        match self.frames.recv_timeout(PATIENCE) {
            Ok(batch) => Next::Batch(batch),
            Err(RecvTimeoutError::Timeout) => Next::Waiting,
            Err(RecvTimeoutError::Disconnected) => Next::End,
        }
    }

    /// How the recording ended, once [`Ahead::next`] said that it did.
    pub fn ending(self) -> Result<Ending> {
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
    threads: usize,
    sender: &Sender<Vec<Frame>>,
    stop: &AtomicBool,
) -> Result<Ending> {
    let mut batch = Vec::new();
    let mut size = 1;
    while !stop.load(Ordering::Relaxed) {
        let Some(frame) = source.next_frame()? else {
            // The receiver may be gone; then nobody asks for the ending either.
            let _ = sender.send(batch);
            return Ok(source.ending());
        };
        if frame.index < frames.start {
            continue;
        }
        if frame.index >= frames.end {
            break;
        }
        if batch.is_empty() {
            size = batch_size(&frame, threads);
            batch.reserve_exact(size);
        }
        batch.push(frame);
        if batch.len() == size && sender.send(std::mem::take(&mut batch)).is_err() {
            return Ok(Ending::Complete);
        }
    }
    let _ = sender.send(batch);
    Ok(Ending::Complete)
}

/// Frames in a batch: enough for every thread, not more memory than it takes.
fn batch_size(frame: &Frame, threads: usize) -> usize {
    let bytes = frame.width as usize * frame.height as usize * frame.format.bits_per_pixel() as usize / 8;
    (BATCH_BYTES / bytes.max(1)).clamp(threads.max(1), MOST_FRAMES.max(threads))
}
