//! Opens a recording and looks at its first frames, which may wait for a pipe that nobody feeds.
//!
//! Owns: [`open`]. Must not: read a recording through.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use crossbeam_channel::{RecvTimeoutError, bounded};
use rayon::ThreadPoolBuilder;

use super::observer::Observer;
use crate::detect::{DetectSettings, Levels};
use crate::error::{Error, Fault, Result};
use crate::frame::{Frame, FrameSource};
use crate::message::Setting;
use crate::source::{self, OpenOptions, cores};
use crate::stop::Stop;

/// Longest wait before it is asked whether the user wants to stop.
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
pub(crate) fn sample(
    mut source: Box<dyn FrameSource>,
    count: usize,
    observer: &mut dyn Observer,
) -> Result<(Box<dyn FrameSource>, Vec<Frame>)> {
    watched(observer, move || source.sample(count).map(|frames| (source, frames)))
}

/// Learns from samples, as [`Levels::learn`] does.
pub(crate) fn learn(
    samples: Vec<Frame>,
    detect: &DetectSettings,
    threads: usize,
    observer: &mut dyn Observer,
) -> Result<Levels> {
    learn_and(samples, detect, threads, observer, |_, _| Ok(())).map(|(levels, ())| levels)
}

/// Learns from samples, and looks at them once more with what was learned.
pub(super) fn learn_and<T: Send + 'static>(
    samples: Vec<Frame>,
    detect: &DetectSettings,
    threads: usize,
    observer: &mut dyn Observer,
    look: impl FnOnce(&[Frame], &Levels) -> Result<T> + Send + 'static,
) -> Result<(Levels, T)> {
    let detect = detect.clone();
    watched(observer, move || {
        on_threads(threads, || {
            let levels = Levels::learn(&samples, &detect)?;
            let seen = look(&samples, &levels)?;
            Ok((levels, seen))
        })
    })
}

/// Work done on a thread of its own, so that this one hears the user.
#[derive(Debug, Default)]
pub(super) struct Attended {
    /// The work stops soon after it is asked to.
    pub stop: Stop,
    /// Steps that the work has done.
    pub done: AtomicU64,
}

impl Attended {
    /// Does the work. It is asked to stop once `leave` says so; what it then gives is what comes back.
    pub(super) fn run<T: Send>(
        &self,
        observer: &mut dyn Observer,
        leave: impl Fn(&mut dyn Observer) -> bool,
        work: impl FnOnce(&Self) -> Result<T> + Send,
    ) -> Result<T> {
        std::thread::scope(|scope| {
            let (sender, receiver) = bounded(1);
            let begun = std::thread::Builder::new().name("work".into()).spawn_scoped(scope, move || {
                // Where the work panics nothing is sent, and the receiver is told that nobody will.
                let outcome = work(self);
                let _ = sender.send(());
                outcome
            });
            let worker = begun.map_err(|e| {
                Error::Argument(
                    Fault::new("threads", format!("no thread could be started ({e})")).caused_by(&e),
                )
            })?;
            while let Err(RecvTimeoutError::Timeout) = receiver.recv_timeout(PATIENCE) {
                observer.progress(self.done.load(Ordering::Relaxed));
                if leave(observer) {
                    self.stop.ask();
                }
            }
            worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        })
    }
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
        .map_err(|e| {
            Error::Source(Fault::new("source", format!("no thread could be started ({e})")).caused_by(&e))
        })?;
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
