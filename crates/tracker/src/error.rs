//! The one error type of the tracker. Every error says what was wrong, where, what was expected and what to do.
//!
//! Owns: [`Error`], [`Fault`], [`Place`]. Must not: print, decide an exit status, or know of any file format.

use std::fmt;
use std::path::Path;

use crate::message::{FrontEnd, Message, Setting};
use crate::name::text;

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
/// Reads as `drop.mraw, byte 4096: 12 of 24 bytes of a frame are missing. Copy the file again.` Settings that it
/// names are data ([`Message`]): a front end writes them with [`Fault::render`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fault {
    /// The file, setting or array at fault.
    pub subject: Message,
    /// Where in it.
    pub place: Place,
    /// What was expected and what was found, a clause without a full stop.
    pub problem: Message,
    /// What the user can do, a sentence without its full stop; empty if there is nothing.
    pub advice: Message,
}

impl Fault {
    /// A fault of `subject` as a whole.
    pub fn new(subject: impl fmt::Display, problem: impl Into<Message>) -> Self {
        Self {
            subject: subject.to_string().into(),
            place: Place::Whole,
            problem: problem.into(),
            advice: Message::default(),
        }
    }

    /// A fault of a setting.
    pub fn of(setting: Setting, problem: impl Into<Message>) -> Self {
        Self { subject: setting.into(), ..Self::new("", problem) }
    }

    /// A file that is there already and was not to be replaced.
    pub fn exists(path: &Path) -> Self {
        Self::new(text(path), "it is there already")
            .advice("Choose another name, or replace it with " + Setting::Force)
    }

    /// The same fault at a place.
    #[must_use]
    pub fn at(mut self, place: Place) -> Self {
        self.place = place;
        self
    }

    /// The same fault with what to do about it.
    #[must_use]
    pub fn advice(mut self, advice: impl Into<Message>) -> Self {
        self.advice = advice.into();
        self
    }

    /// The whole of it as one message.
    pub fn message(&self) -> Message {
        let problem = self.subject.clone() + format!("{}: ", self.place) + self.problem.clone();
        if self.advice.is_empty() { problem } else { problem + ". " + self.advice.clone() }
    }

    /// The whole of it as a front end says it.
    pub fn render(&self, front: &dyn FrontEnd) -> String {
        self.message().render(front)
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.message().fmt(f)
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

impl Error {
    /// The same error with more of what was wrong, and with what to do about that, if there is something.
    #[must_use]
    pub fn and_also(mut self, more: &str, advice: Message) -> Self {
        if let Self::Source(f)
        | Self::Detect(f)
        | Self::Rig(f)
        | Self::Table(f)
        | Self::Film(f)
        | Self::Argument(f) = &mut self
        {
            f.problem = f.problem.clone() + format!("; {more}");
            if !advice.is_empty() {
                f.advice = advice;
            }
        }
        self
    }

    /// What it says, with the settings it names as data.
    pub fn message(&self) -> Message {
        match self {
            Self::Source(f)
            | Self::Detect(f)
            | Self::Rig(f)
            | Self::Table(f)
            | Self::Film(f)
            | Self::Argument(f) => f.message(),
            Self::Interrupted => self.to_string().into(),
        }
    }
}

/// The result of everything in the tracker that can fail.
pub type Result<T, E = Error> = std::result::Result<T, E>;
