//! What a user may say about reading a recording.

/// Which decoder reads compressed film.
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

/// What a user may say about reading a recording. The default says nothing.
#[derive(Debug, Clone, Default)]
pub struct OpenOptions {
    /// Frames per second of recorded time; replaces all time stamps of the recording.
    pub fps: Option<f64>,
    /// Decoder.
    pub decoder: Decoder,
    /// Whether network addresses and devices may be opened.
    pub allow_protocol: bool,
    /// Decoding threads; 0 is one for each core.
    pub threads: usize,
}

/// How many threads `threads` stands for: 0 is one for each core.
pub(crate) fn cores(threads: usize) -> usize {
    match threads {
        0 => std::thread::available_parallelism().map_or(1, usize::from),
        n => n,
    }
}
