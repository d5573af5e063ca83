//! Encodes gray frames as films and images, by FFmpeg.

mod settings;
#[cfg(feature = "ffmpeg")]
mod writer;
#[cfg(not(feature = "ffmpeg"))]
#[path = "without_writer.rs"]
mod writer;

pub(super) use settings::cannot_write;
pub use settings::{Codec, ImageKind, VideoSettings};
pub use writer::{VideoWriter, encode_image};
