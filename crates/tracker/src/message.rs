//! Defines a text that names settings as data, so that each front end can name them as its user writes them.
//!
//! The library says `"Go on with " + Setting::Resume`; the program `tracker` prints `Go on with --resume`, Python
//! raises `Go on with resume=True`:
//!
//! ```
//! use tracker::message::{FrontEnd, Setting};
//!
//! struct Flags;
//! impl FrontEnd for Flags {
//!     fn setting(&self, setting: Setting, _: Option<&str>) -> String {
//!         format!("--{}", setting.name().replace('_', "-"))
//!     }
//!     fn step(&self, command: &str, _: &str) -> String {
//!         command.to_owned()
//!     }
//! }
//! let message = "Leave out " + Setting::AllowProtocol;
//! assert_eq!(message.render(&Flags), "Leave out --allow-protocol");
//! ```
//!
//! Owns: [`Setting`], [`Step`], [`Piece`], [`Message`],
//! [`FrontEnd`]. Must not: know how a front
//! end writes a setting.

use std::borrow::Cow;
use std::fmt;
use std::ops::Add;

/// Settings that a caller has, under the name of the keyword in Python; the flag is that name with hyphens.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Setting {
    /// Network addresses and devices are opened too; a switch.
    AllowProtocol,
    /// Numbers of the picture that are followed too.
    Also,
    /// Bits per pixel of a film that is made.
    Bits,
    /// How the centre of a marker is taken.
    Centroid,
    /// Codec of a film that is made.
    Codec,
    /// The library that decodes compressed film.
    Decoder,
    /// Decisions of people about single rows.
    Edits,
    /// Only each n-th frame is drawn.
    Every,
    /// Replacing of files that are there already; a switch.
    Force,
    /// Frames a second of recorded time.
    Fps,
    /// Which frames.
    Frames,
    /// A film that is made has no colour planes; a switch.
    GrayOnly,
    /// How interlaced film is read.
    Interlaced,
    /// A place of a marker.
    Marker,
    /// How many markers there are.
    Markers,
    /// The largest area of a marker.
    MaxAreaPx,
    /// The smallest area of a marker.
    MinAreaPx,
    /// Where the result goes.
    Output,
    /// Where the annotated picture goes.
    Picture,
    /// Width to height of a pixel.
    PixelAspect,
    /// Frames a second at which a drawn film plays.
    PlayFps,
    /// Whether markers are brighter or darker than what is around them.
    Polarity,
    /// Quality of a film that is written.
    Quality,
    /// The part of the picture in which markers are looked for.
    Region,
    /// An earlier run is gone on with; a switch.
    Resume,
    /// Nodes, bodies and joints.
    Rig,
    /// Two nodes that are one marker.
    Same,
    /// How many threads.
    Threads,
    /// Level from which on a pixel is bright enough to be a marker's.
    Threshold,
    /// Width of a drawn film.
    Width,
    /// How much time H.264 takes.
    X264Preset,
}

impl Setting {
    /// All of them.
    pub const ALL: [Self; 31] = [
        Self::AllowProtocol,
        Self::Also,
        Self::Bits,
        Self::Centroid,
        Self::Codec,
        Self::Decoder,
        Self::Edits,
        Self::Every,
        Self::Force,
        Self::Fps,
        Self::Frames,
        Self::GrayOnly,
        Self::Interlaced,
        Self::Marker,
        Self::Markers,
        Self::MaxAreaPx,
        Self::MinAreaPx,
        Self::Output,
        Self::Picture,
        Self::PixelAspect,
        Self::PlayFps,
        Self::Polarity,
        Self::Quality,
        Self::Region,
        Self::Resume,
        Self::Rig,
        Self::Same,
        Self::Threads,
        Self::Threshold,
        Self::Width,
        Self::X264Preset,
    ];

    /// Name of the setting, in lower case with underscores.
    pub fn name(self) -> &'static str {
        match self {
            Self::AllowProtocol => "allow_protocol",
            Self::Also => "also",
            Self::Bits => "bits",
            Self::Centroid => "centroid",
            Self::Codec => "codec",
            Self::Decoder => "decoder",
            Self::Edits => "edits",
            Self::Every => "every",
            Self::Force => "force",
            Self::Fps => "fps",
            Self::Frames => "frames",
            Self::GrayOnly => "gray_only",
            Self::Interlaced => "interlaced",
            Self::Marker => "marker",
            Self::Markers => "markers",
            Self::MaxAreaPx => "max_area_px",
            Self::MinAreaPx => "min_area_px",
            Self::Output => "output",
            Self::Picture => "picture",
            Self::PixelAspect => "pixel_aspect",
            Self::PlayFps => "play_fps",
            Self::Polarity => "polarity",
            Self::Quality => "quality",
            Self::Region => "region",
            Self::Resume => "resume",
            Self::Rig => "rig",
            Self::Same => "same",
            Self::Threads => "threads",
            Self::Threshold => "threshold",
            Self::Width => "width",
            Self::X264Preset => "x264_preset",
        }
    }

    /// Whether it is on or off and has no value of its own.
    pub fn is_switch(self) -> bool {
        matches!(self, Self::AllowProtocol | Self::Force | Self::GrayOnly | Self::Resume)
    }

    /// The setting with a value: `Setting::Decoder.set_to("opencv")`.
    pub fn set_to(self, value: impl Into<String>) -> Message {
        Message { pieces: vec![Piece::Setting { setting: self, value: Some(value.into()) }] }
    }
}

/// A part of a message.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Piece {
    /// Words.
    Text(String),
    /// A setting, with a value if one is meant.
    Setting {
        /// Which.
        setting: Setting,
        /// Its value.
        value: Option<String>,
    },
    /// Something to do with another part of the program: what to type, for example `pydpend setup`, and the
    /// function of the Python package, for example `dp.setup`.
    Step(Step),
}

/// A text that may name settings and steps. [`fmt::Display`] writes them bare, for logs and files; a front end
/// uses [`Message::render`].
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Message {
    pieces: Vec<Piece>,
}

/// A front end's way of writing what a message names.
pub trait FrontEnd {
    /// A setting: `--decoder opencv`, `decoder='opencv'`.
    fn setting(&self, setting: Setting, value: Option<&str>) -> String;
    /// A step: what to type, or what to call.
    fn step(&self, command: &str, call: &str) -> String;
}

/// Settings by their bare names.
struct Bare;

impl FrontEnd for Bare {
    fn setting(&self, setting: Setting, value: Option<&str>) -> String {
        value.map_or_else(|| setting.name().to_owned(), |v| format!("{} {v}", setting.name()))
    }

    fn step(&self, command: &str, _call: &str) -> String {
        format!("`{command}`")
    }
}

/// A step of the work: what to type, and what to call in Python.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Step {
    /// The command to type.
    pub command: Cow<'static, str>,
    /// The function of the Python package.
    pub call: Cow<'static, str>,
}

impl Step {
    const fn known(command: &'static str, call: &'static str) -> Self {
        Self { command: Cow::Borrowed(command), call: Cow::Borrowed(call) }
    }
}

/// Looks at a recording.
pub const INFO: Step = Step::known("pydpend info", "dp.info");
/// Finds the rig of a recording.
pub const SETUP: Step = Step::known("pydpend setup", "dp.setup");
/// Makes a node table.
pub const TRACK: Step = Step::known("pydpend track", "dp.track");
/// Shows a scene with all it may hold.
pub const PRINT_SCENE: Step =
    Step::known("pydpend film --preset clean --print-scene", "dp.Film('clean').scene");
/// Writes the truth of a film that is made.
pub const FILM_TRUTH: Step = Step::known("pydpend film --truth", "dp.film(truth=...)");

impl Message {
    /// The message's parts in order.
    pub fn pieces(&self) -> &[Piece] {
        &self.pieces
    }

    /// Whether it says nothing.
    pub fn is_empty(&self) -> bool {
        self.pieces.iter().all(|p| matches!(p, Piece::Text(t) if t.is_empty()))
    }

    /// The text as a front end says it.
    pub fn render(&self, front: &dyn FrontEnd) -> String {
        let piece = |piece: &Piece| match piece {
            Piece::Text(text) => text.clone(),
            Piece::Setting { setting, value } => front.setting(*setting, value.as_deref()),
            Piece::Step(step) => front.step(&step.command, &step.call),
        };
        self.pieces.iter().map(piece).collect()
    }

    /// The message with one text in place of another wherever it stands in the words.
    #[must_use]
    pub fn replace(&self, from: &str, to: &str) -> Self {
        let piece = |piece: &Piece| match piece {
            Piece::Text(text) => Piece::Text(text.replace(from, to)),
            other => other.clone(),
        };
        Self { pieces: self.pieces.iter().map(piece).collect() }
    }
}

impl fmt::Display for Message {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.render(&Bare))
    }
}

impl From<&str> for Message {
    fn from(text: &str) -> Self {
        Self::from(text.to_owned())
    }
}

impl From<String> for Message {
    fn from(text: String) -> Self {
        Self { pieces: vec![Piece::Text(text)] }
    }
}

impl From<Setting> for Message {
    fn from(setting: Setting) -> Self {
        Self { pieces: vec![Piece::Setting { setting, value: None }] }
    }
}

impl From<Step> for Message {
    fn from(step: Step) -> Self {
        Self { pieces: vec![Piece::Step(step)] }
    }
}

impl<T: Into<Message>> Add<T> for Message {
    type Output = Message;

    fn add(mut self, more: T) -> Message {
        self.pieces.append(&mut more.into().pieces);
        self
    }
}

impl<T: Into<Message>> Add<T> for Setting {
    type Output = Message;

    fn add(self, more: T) -> Message {
        Message::from(self) + more
    }
}

impl<T: Into<Message>> Add<T> for Step {
    type Output = Message;

    fn add(self, more: T) -> Message {
        Message::from(self) + more
    }
}

impl Add<Step> for &str {
    type Output = Message;

    fn add(self, step: Step) -> Message {
        Message::from(self) + step
    }
}

impl Add<Setting> for &str {
    type Output = Message;

    fn add(self, setting: Setting) -> Message {
        Message::from(self) + setting
    }
}

impl Add<Message> for &str {
    type Output = Message;

    fn add(self, more: Message) -> Message {
        Message::from(self) + more
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_bare_until_a_front_end_writes_them() {
        let message = "Go on with "
            + Setting::Resume
            + ", or use "
            + Setting::Decoder.set_to("ffmpeg")
            + ". See "
            + INFO;
        assert_eq!(message.to_string(), "Go on with resume, or use decoder ffmpeg. See `pydpend info`");
        assert!(!message.is_empty() && Message::default().is_empty() && Message::from("").is_empty());
    }

    #[test]
    fn every_setting_is_listed_once_under_its_own_name() {
        let mut names: Vec<&str> = Setting::ALL.iter().map(|s| s.name()).collect();
        assert!(names.is_sorted());
        names.dedup();
        assert_eq!(names.len(), Setting::ALL.len());
    }
}
