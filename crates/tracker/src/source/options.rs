//! Defines the options of reading a recording.

use crate::message::{Message, Setting};
use crate::pixel_aspect::{AspectOrigin, PixelAspect};
use crate::setting_words::words;

/// The decoder that reads compressed film.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Decoder {
    /// The one that fits the file.
    #[default]
    Auto,
    /// FFmpeg's libraries.
    Ffmpeg,
    /// OpenCV's `VideoCapture`, a second and independent one.
    Opencv,
}

/// Treatment of interlaced film, whose pictures hold two fields filmed one after the other.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Interlaced {
    /// Not at all: a marker that moves would be in two places.
    #[default]
    Refuse,
    /// Each picture as one, for cameras that filmed whole pictures and only say that they are interlaced.
    AsFrames,
}

words!(Decoder, Setting::Decoder, [
    "auto" => Decoder::Auto,
    "ffmpeg" => Decoder::Ffmpeg,
    "opencv" => Decoder::Opencv,
]);

words!(Interlaced, Setting::Interlaced, [
    "refuse" => Interlaced::Refuse,
    "as-frames" => Interlaced::AsFrames,
]);

/// Options of reading a recording. The default says nothing.
#[derive(Debug, Clone, Default)]
pub struct OpenOptions {
    /// Frames per second of recorded time; replaces all time stamps of the recording.
    pub fps: Option<f64>,
    /// Width to height of a pixel as seen after turning; replaces what the recording says.
    pub pixel_aspect: Option<PixelAspect>,
    /// Decoder.
    pub decoder: Decoder,
    /// How interlaced film is read.
    pub interlaced: Interlaced,
    /// Whether network addresses and devices may be opened.
    pub allow_protocol: bool,
    /// Decoding threads; 0 is one for each core.
    pub threads: usize,
    /// Whether frames bring their colour, where the reader gives it (FFmpeg's does).
    pub colour: bool,
}

impl OpenOptions {
    /// The pixel aspect and its origin, by these options and by the recording's own word.
    pub(crate) fn aspect(&self, recorded: PixelAspect) -> (PixelAspect, AspectOrigin) {
        match self.pixel_aspect {
            Some(given) => (given, AspectOrigin::User),
            None => (recorded, AspectOrigin::Recording),
        }
    }
}

/// Maximum number of threads for each core. Threads that wait for the disk are worth having beside those that compute; with more
/// than four for each core nothing is faster, and each takes memory.
const THREADS_PER_CORE: usize = 4;

/// Number of threads that `threads` stands for: 0 is one for each core, and no more than a few for each are begun.
pub(crate) fn cores(threads: usize) -> usize {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    match threads {
        0 => cores,
        n => n.min(THREADS_PER_CORE * cores),
    }
}

/// The note for a user who asked for more threads than are begun.
pub(crate) fn threads_note(threads: usize) -> Option<Message> {
    let begun = cores(threads);
    (threads > begun).then(|| {
        format!("{threads} threads were asked for, {begun} are used: {THREADS_PER_CORE} for each core of this machine")
            .into()
    })
}
