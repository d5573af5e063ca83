//! Keeps the second decoder, which only a program that asks for it has.
//!
//! OpenCV's reader of films brings a hundred libraries with it, which the linker leaves out where nobody asks for it.

use std::sync::OnceLock;

use super::ffmpeg::FfmpegSource;
#[cfg(feature = "opencv-decoder")]
use super::opencv::OpencvSource;
use super::{Input, OpenOptions};
use crate::error::{Error, Fault, FaultKind, Result};
use crate::frame::FrameSource;
use crate::message::Setting;

/// Opens a file; the first decoder tells what it knows of it.
type Open = fn(&str, &Input, &FfmpegSource, &OpenOptions) -> Result<Box<dyn FrameSource>>;

static SECOND: OnceLock<Open> = OnceLock::new();

/// Gives this program OpenCV's decoder of compressed film, [`Decoder::Opencv`](super::Decoder::Opencv), to check the first with.
#[cfg(feature = "opencv-decoder")]
pub fn use_opencv_decoder() {
    let _ = SECOND
        .set(|name, input, first, options| Ok(Box::new(OpencvSource::open(name, input, first, options)?)));
}

/// Opens a film with the second decoder.
///
/// # Errors
/// [`Error::Source`] if the program has none, or it does not open the film.
pub(super) fn open(
    name: &str,
    input: &Input,
    first: &FfmpegSource,
    options: &OpenOptions,
) -> Result<Box<dyn FrameSource>> {
    match SECOND.get() {
        Some(open) => open(name, input, first, options),
        None => Err(Error::Source(
            Fault::new(
                name,
                "OpenCV's decoder is not in this program, but only in those that check the first",
            )
            .of_kind(FaultKind::Unsupported)
            .advice("Leave out " + Setting::Decoder.set_to("opencv")),
        )),
    }
}
