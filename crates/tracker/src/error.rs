//! The one error type of the tracker. Every error says what was wrong, where, what was expected and what to do.
//!
//! Owns: [`Error`], [`Fault`], [`Place`]. Must not: print, decide an exit status, or know of any file format.

use std::fmt;

/// Where in the input a fault lies.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Place {
    /// The input as a whole.
    Whole,
    /// A frame, counted from 0 in display order.
    Frame(u64),
    /// A byte offset from the start of the file.
    Byte(u64),
    /// A line of a text file, counted from 1.
    Line(u64),
    /// A row of a table, counted from 0.
    Row(u64),
    /// A column of a table or a key of a header or settings file.
    Key(String),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Place::Whole => Ok(()),
            Place::Frame(n) => write!(f, ", frame {n}"),
            Place::Byte(n) => write!(f, ", byte {n}"),
            Place::Line(n) => write!(f, ", line {n}"),
            Place::Row(n) => write!(f, ", row {n}"),
            Place::Key(k) => write!(f, ", {k}"),
        }
    }
}

/// What was wrong, where, and what to do about it.
///
/// Reads as `drop.mraw, byte 4096: 12 of 24 bytes of a frame are missing. Copy the file again.`
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fault {
    /// The file, argument or array at fault.
    pub subject: String,
    /// Where in it.
    pub place: Place,
    /// What was expected and what was found, a clause without a full stop.
    pub problem: String,
    /// What the user can do, a sentence without its full stop; empty if there is nothing.
    pub advice: String,
}

impl Fault {
    /// A fault of `subject` as a whole.
    pub fn new(subject: impl fmt::Display, problem: impl Into<String>) -> Self {
        Self {
            subject: subject.to_string(),
            place: Place::Whole,
            problem: problem.into(),
            advice: String::new(),
        }
    }

    /// The same fault at a place.
    #[must_use]
    pub fn at(mut self, place: Place) -> Self {
        self.place = place;
        self
    }

    /// The same fault with what to do about it.
    #[must_use]
    pub fn advice(mut self, advice: impl Into<String>) -> Self {
        self.advice = advice.into();
        self
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}: {}", self.subject, self.place, self.problem)?;
        if !self.advice.is_empty() {
            write!(f, ". {}", self.advice)?;
        }
        Ok(())
    }
}

/// Everything that can go wrong in the tracker, by the part that noticed it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A recording that cannot be opened or read.
    #[error("{0}")]
    Source(Fault),
    /// Detection that cannot be done: no markers, a threshold out of range.
    #[error("{0}")]
    Detect(Fault),
    /// A rig that is wrong in itself or does not fit the recording.
    #[error("{0}")]
    Rig(Fault),
    /// A node table that cannot be written, read or is not valid.
    #[error("{0}")]
    Table(Fault),
    /// A film that cannot be made or an overlay that cannot be drawn.
    #[error("{0}")]
    Film(Fault),
    /// An argument that makes no sense.
    #[error("{0}")]
    Argument(Fault),
    /// The user asked to stop; what was done is kept.
    #[error("interrupted")]
    Interrupted,
}

/// The result of everything in the tracker that can fail.
pub type Result<T, E = Error> = std::result::Result<T, E>;
