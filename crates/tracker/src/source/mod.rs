//! Opens recordings and reads their frames: one folder or file per container, told apart by their first bytes.
//!
//! Owns: [`open`], [`OpenOptions`], [`Decoder`]. Must not: look at what is in a picture.

mod cine;
mod clock;
#[cfg(feature = "ffmpeg")]
mod ffmpeg;
#[cfg(not(feature = "ffmpeg"))]
#[path = "without_ffmpeg.rs"]
mod ffmpeg;
mod images;
mod input;
mod mraw;
mod norpix;
mod open;
#[cfg(feature = "opencv-decoder")]
mod opencv;
mod options;
mod orientation;
mod raw;
mod second;

pub use crate::frame::{Ending, FrameSource, SourceInfo};
pub(crate) use input::{Input, is_read_once};
pub use open::{files, open};
pub use options::{Decoder, Interlaced, OpenOptions};
pub(crate) use options::{cores, threads_note};
#[cfg(feature = "opencv-decoder")]
pub use second::use_opencv_decoder;
