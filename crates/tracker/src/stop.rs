//! Carries the user's wish to stop to long work, which does not know who the user is.
//!
//! Owns: [`Stop`]. Must not: know of signals or of observers.

use std::sync::atomic::{AtomicBool, Ordering};

use crate::error::{Error, Result};

/// Asked for by one thread, heard by others.
#[derive(Debug, Default)]
pub struct Stop(AtomicBool);

impl Stop {
    /// Asks whoever hears it to stop.
    pub fn ask(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether it was asked for. Costs nothing.
    pub fn asked(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// Goes on, or not.
    ///
    /// # Errors
    /// [`Error::Interrupted`] once it was asked for.
    pub fn heed(&self) -> Result<()> {
        if self.asked() { Err(Error::Interrupted) } else { Ok(()) }
    }
}
