//! Refuses OpenCV's decoder in a program that was built without the feature `opencv` or `ffmpeg`.

use super::ffmpeg::FfmpegSource;
use super::{Input, OpenOptions};
use crate::error::{Error, Fault, Result};

/// OpenCV's decoder, which is not there.
pub(crate) struct OpencvSource;

impl OpencvSource {
    /// Refuses; what it would give stands for any source.
    pub(crate) fn open(name: &str, _: &Input, _: &FfmpegSource, _: &OpenOptions) -> Result<FfmpegSource> {
        Err(Error::Source(Fault::without("opencv", name, "OpenCV's decoder is not there")))
    }
}
