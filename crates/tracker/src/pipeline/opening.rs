//! Opening a recording and looking at its first frames, which may wait for a pipe that nobody feeds.
//!
//! Owns: [`open`]. Must not: read a recording through.

use std::time::Duration;

use crossbeam_channel::{RecvTimeoutError, bounded};
use rayon::ThreadPoolBuilder;

use super::Observer;
use crate::error::{Error, Fault, Result};
use crate::frame::{Frame, FrameSource};
use crate::message::Setting;
use crate::source::{self, OpenOptions, cores};

/// How long to wait before looking whether the user wants to stop.
const PATIENCE: Duration = Duration::from_millis(50);

/// Opens a recording as [`source::open`] does; the observer may give up waiting.
///
/// # Errors
/// Those of [`source::open`]; [`Error::Interrupted`] if the observer asks to stop.
pub fn open(input: &str, options: &OpenOptions, observer: &mut dyn Observer) -> Result<Box<dyn FrameSource>> {
    let (input, options) = (input.to_owned(), options.clone());
    watched(observer, move || source::open(&input, &options))
}

/// A source and some of its frames, as [`FrameSource::sample`] gives them.
pub(super) fn sample(
    mut source: Box<dyn FrameSource>,
    count: usize,
    observer: &mut dyn Observer,
) -> Result<(Box<dyn FrameSource>, Vec<Frame>)> {
    watched(observer, move || source.sample(count).map(|frames| (source, frames)))
}

/// Does what is shared out by rayon on `threads` threads; 0 is one for each core.
pub(super) fn on_threads<T: Send>(threads: usize, work: impl FnOnce() -> Result<T> + Send) -> Result<T> {
    let pool = ThreadPoolBuilder::new()
        .num_threads(cores(threads))
        .build()
        .map_err(|e| Error::Argument(Fault::of(Setting::Threads, e.to_string()).advice("Ask for fewer")))?;
    pool.install(work)
}

/// Does what may wait for bytes that never come on a thread of its own, which is then left to the end of the program.
fn watched<T: Send + 'static>(
    observer: &mut dyn Observer,
    work: impl FnOnce() -> Result<T> + Send + 'static,
) -> Result<T> {
    let (sender, receiver) = bounded(1);
    std::thread::Builder::new()
        .name("source".into())
        .spawn(move || {
            // The receiver is gone if the user did not wait.
            let _ = sender.send(work());
        })
        .map_err(|e| Error::Source(Fault::new("source", format!("no thread could be started ({e})"))))?;
    loop {
        match receiver.recv_timeout(PATIENCE) {
            Ok(outcome) => return outcome,
            Err(RecvTimeoutError::Timeout) if observer.interrupted() => return Err(Error::Interrupted),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => {
                return Err(Error::Source(Fault::new("source", "the decoder failed; please report this")));
            }
        }
    }
}
