//! Lets Python watch a run: a progress callback, Ctrl-C.
//!
//! Owns: [`Watch`]. The interpreter is asked for ten times a second at most, so a run costs nothing for it.

use std::time::{Duration, Instant};

use pyo3::prelude::*;
use tracker::error::Error;
use tracker::pipeline::{Candidates, Observer, Stage};

use crate::errors::raise;

/// Least time between two calls into Python.
const EVERY: Duration = Duration::from_millis(100);
/// Time after which a stopped run leaves its table too; the detections are kept beside the output.
const PATIENCE: Duration = Duration::from_millis(600);

/// Calls `callback(stage, done, total)` and looks for signals.
pub struct Watch {
    callback: Option<Py<PyAny>>,
    stage: Stage,
    total: Option<u64>,
    done: u64,
    called: Instant,
    /// When and by what the run was stopped.
    stopped: Option<(Instant, PyErr)>,
    /// Candidates among what moves, if they were looked for.
    pub candidates: Option<Candidates>,
}

impl Watch {
    pub fn new(callback: Option<Py<PyAny>>) -> Self {
        let (stage, called) = (Stage::Open, Instant::now());
        Self { callback, stage, total: None, done: 0, called, stopped: None, candidates: None }
    }

    /// The exception that stopped the run, if one did.
    pub fn into_error(self) -> Option<PyErr> {
        self.stopped.map(|(_, error)| error)
    }

    /// The result of work that is all or nothing, after the last count was told, so that a bar comes to its end; the exception that
    /// stopped the work comes before any other.
    pub fn done<T>(mut self, py: Python<'_>, outcome: Result<T, Error>) -> PyResult<T> {
        if outcome.is_ok() && self.done > 0 {
            self.call();
        }
        match (outcome, self.into_error()) {
            (Ok(value), None) => Ok(value),
            (Ok(_) | Err(Error::Interrupted), Some(stopped)) => Err(stopped),
            (Err(error), _) => Err(raise(py, error)),
        }
    }

    /// Calls into Python and remembers the first exception that comes back.
    fn call(&mut self) {
        self.called = Instant::now();
        if self.stopped.is_some() {
            return;
        }
        let outcome = Python::attach(|py| {
            py.check_signals()?;
            if let Some(callback) = &self.callback {
                callback.call1(py, (self.stage.as_str(), self.done, self.total))?;
            }
            Ok(())
        });
        if let Err(error) = outcome {
            self.stopped = Some((Instant::now(), error));
        }
    }
}

impl Observer for Watch {
    fn stage(&mut self, stage: Stage, total: Option<u64>) {
        // The last count of the stage before, so that a bar comes to its end.
        if self.done > 0 {
            self.call();
        }
        (self.stage, self.total, self.done) = (stage, total, 0);
    }

    fn candidates(&mut self, found: Candidates) {
        self.candidates = Some(found);
    }

    fn progress(&mut self, done: u64) {
        self.done = done;
    }

    fn interrupted(&mut self) -> bool {
        if self.called.elapsed() >= EVERY {
            self.call();
        }
        self.stopped.is_some()
    }

    fn abandoned(&mut self) -> bool {
        self.stopped.as_ref().is_some_and(|(when, _)| when.elapsed() >= PATIENCE)
    }
}
