//! Defines the one error type of the tracker. Every error says what was wrong, where, what was expected and what to do.
//!
//! Owns: [`Error`], [`Fault`], [`FaultKind`], [`Place`]. Must not: print, decide an exit status, or know of any file format.
//!
//! What is to be decided on is data, not words:
//!
//! ```
//! use tracker::error::FaultKind;
//! use tracker::source::{OpenOptions, open};
//!
//! let error = open("no such film.mp4", &OpenOptions::default()).err().unwrap();
//! assert_eq!(error.kind(), FaultKind::Missing);
//! assert_eq!(error.to_string(), "no such film.mp4: no such file. Check the name and the folder you are in");
//! ```

use std::fmt;
use std::io;
use std::path::Path;
use std::sync::Arc;

use crate::message::{FrontEnd, Message, Setting};
use crate::name::text;

/// Place of a fault in the input.
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

/// Kinds of faults, for those who decide by them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[non_exhaustive]
pub enum FaultKind {
    /// The input contradicts itself or what it is used with.
    #[default]
    Invalid,
    /// The input is damaged or cut.
    Damaged,
    /// The input is sound, and this program does not read or write such a thing.
    Unsupported,
    /// A setting makes no sense, or not here.
    Setting,
    /// A recording is sound, and no markers or links are found in it.
    NothingFound,
    /// A file is not there.
    Missing,
    /// A file is there already and was not to be replaced.
    Exists,
    /// The operating system refused: permissions, a full disk, no more threads.
    System,
    /// The user asked to stop.
    Interrupted,
}

impl FaultKind {
    /// The kind in lower case with underscores.
    pub fn name(self) -> &'static str {
        match self {
            FaultKind::Invalid => "invalid",
            FaultKind::Damaged => "damaged",
            FaultKind::Unsupported => "unsupported",
            FaultKind::Setting => "setting",
            FaultKind::NothingFound => "nothing_found",
            FaultKind::Missing => "missing",
            FaultKind::Exists => "exists",
            FaultKind::System => "system",
            FaultKind::Interrupted => "interrupted",
        }
    }
}

/// The error that a fault comes from. Causes are equal if they say the same.
#[derive(Debug, Clone)]
pub struct Cause(Arc<io::Error>);

impl PartialEq for Cause {
    fn eq(&self, other: &Self) -> bool {
        self.0.to_string() == other.0.to_string()
    }
}

impl Eq for Cause {}

/// A fault: what was wrong, where, and what to do about it.
///
/// Reads as `drop.mraw, byte 4096: 12 of 24 bytes of a frame are missing. Copy the file again.` Settings that it
/// names are data ([`Message`]): a front end writes them with [`Fault::render`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fault {
    /// The file, setting or array at fault.
    pub subject: Message,
    /// Where in it.
    pub place: Place,
    /// The value expected and the value found, a clause without a full stop.
    pub problem: Message,
    /// Advice to the user, a sentence without its full stop; empty if there is none.
    pub advice: Message,
    /// Its kind.
    pub kind: FaultKind,
    /// The error that it comes from, if there is one.
    pub cause: Option<Cause>,
}

impl Fault {
    /// A fault of `subject` as a whole, of the kind [`FaultKind::Invalid`].
    pub fn new(subject: impl fmt::Display, problem: impl Into<Message>) -> Self {
        Self {
            subject: subject.to_string().into(),
            place: Place::Whole,
            problem: problem.into(),
            advice: Message::default(),
            kind: FaultKind::default(),
            cause: None,
        }
    }

    /// A fault of a setting.
    pub fn of(setting: Setting, problem: impl Into<Message>) -> Self {
        Self { subject: setting.into(), kind: FaultKind::Setting, ..Self::new("", problem) }
    }

    /// A file that is there already and was not to be replaced.
    pub fn exists(path: &Path) -> Self {
        Self::new(text(path), "it is there already")
            .advice("Choose another name, or replace it with " + Setting::Force)
            .of_kind(FaultKind::Exists)
    }

    /// A fault of a program that was built without a feature of this crate.
    #[cfg(not(all(feature = "ffmpeg", feature = "opencv")))]
    pub(crate) fn without(feature: &str, subject: impl fmt::Display, problem: &str) -> Self {
        Self::new(subject, format!("{problem}: this program was built without {feature}"))
            .advice(format!("Build it with the feature `{feature}`"))
            .of_kind(FaultKind::Unsupported)
    }

    /// The fault with its kind.
    #[must_use]
    pub fn of_kind(mut self, kind: FaultKind) -> Self {
        self.kind = kind;
        self
    }

    /// The fault with the operating system's error that caused it, which is its kind.
    #[must_use]
    pub fn caused_by(mut self, error: &io::Error) -> Self {
        self.kind = match error.kind() {
            io::ErrorKind::NotFound => FaultKind::Missing,
            io::ErrorKind::AlreadyExists => FaultKind::Exists,
            io::ErrorKind::UnexpectedEof | io::ErrorKind::InvalidData => FaultKind::Damaged,
            _ => FaultKind::System,
        };
        // An error of the system's own is made again by its number: it cannot be copied.
        let again = match error.raw_os_error() {
            Some(number) => io::Error::from_raw_os_error(number),
            None => io::Error::new(error.kind(), error.to_string()),
        };
        self.cause = Some(Cause(Arc::new(again)));
        self
    }

    /// The fault with its place.
    #[must_use]
    pub fn at(mut self, place: Place) -> Self {
        self.place = place;
        self
    }

    /// The fault with advice.
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
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum Error {
    /// A recording that cannot be opened or read.
    Source(Fault),
    /// Detection that cannot be done: no markers, a threshold out of range.
    Detect(Fault),
    /// A rig that is wrong in itself or does not fit the recording.
    Rig(Fault),
    /// A node table that cannot be written, read or is not valid.
    Table(Fault),
    /// A film that cannot be made or an overlay that cannot be drawn.
    Film(Fault),
    /// An argument that makes no sense.
    Argument(Fault),
    /// The user asked to stop; what was done is kept.
    Interrupted,
}

impl Error {
    /// The fault; `None` if the user asked to stop.
    pub fn fault(&self) -> Option<&Fault> {
        match self {
            Self::Source(f)
            | Self::Detect(f)
            | Self::Rig(f)
            | Self::Table(f)
            | Self::Film(f)
            | Self::Argument(f) => Some(f),
            Self::Interrupted => None,
        }
    }

    /// The kind of its fault.
    pub fn kind(&self) -> FaultKind {
        self.fault().map_or(FaultKind::Interrupted, |fault| fault.kind)
    }

    /// The error with a further problem, and with advice about that, if there is any.
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

    /// The message, with the settings that it names as data.
    pub fn message(&self) -> Message {
        self.fault().map_or_else(|| "interrupted".into(), Fault::message)
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.message().fmt(f)
    }
}

impl std::error::Error for Error {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        let cause = self.fault()?.cause.as_ref()?;
        Some(cause.0.as_ref())
    }
}

/// The result of everything in the tracker that can fail.
pub type Result<T, E = Error> = std::result::Result<T, E>;

#[cfg(test)]
mod tests {
    use std::error::Error as _;

    use super::*;

    #[test]
    fn the_cause_is_kept_and_is_the_kind() {
        let missing = std::fs::File::open("/no such folder/film.mp4").unwrap_err();
        let full = io::Error::from(io::ErrorKind::StorageFull);
        let cut = io::Error::new(io::ErrorKind::UnexpectedEof, "cut");
        for (error, kind) in
            [(missing, FaultKind::Missing), (full, FaultKind::System), (cut, FaultKind::Damaged)]
        {
            let said = error.to_string();
            let whole = Error::Source(Fault::new("film.mp4", "it cannot be read").caused_by(&error));
            assert_eq!(whole.kind(), kind);
            let source = whole.source().unwrap().downcast_ref::<io::Error>().unwrap();
            assert_eq!((source.kind(), source.to_string()), (error.kind(), said));
        }
        assert!(Error::Interrupted.source().is_none());
        assert_eq!(Error::Interrupted.kind(), FaultKind::Interrupted);
    }

    #[test]
    fn a_fault_of_a_setting_is_of_its_kind() {
        assert_eq!(Fault::of(Setting::Fps, "-1 is not a rate").kind, FaultKind::Setting);
        assert_eq!(Fault::exists(Path::new("out.csv")).kind, FaultKind::Exists);
        assert_eq!(Fault::new("rig", "it has no nodes").kind, FaultKind::Invalid);
    }
}
