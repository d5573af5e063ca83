//! Refuses compressed film in a program that was built without the feature `ffmpeg`.

use super::orientation::Orientation;
use super::{Input, OpenOptions};
use crate::error::{Error, Fault, Result};
use crate::frame::{Ending, Frame, FrameSource, SourceInfo};

/// A recording read through FFmpeg: there is none.
pub(crate) enum FfmpegSource {}

impl FfmpegSource {
    pub(crate) fn open(name: &str, _: &Input, _: &OpenOptions) -> Result<Self> {
        Err(Error::Source(Fault::without("ffmpeg", name, "it is film that FFmpeg reads")))
    }

    pub(crate) fn turn_as_tagged(&mut self) {
        match *self {}
    }

    pub(crate) fn is_finished(&self) -> bool {
        match *self {}
    }

    pub(crate) fn orientation(&self) -> Orientation {
        match *self {}
    }
}

impl FrameSource for FfmpegSource {
    fn info(&self) -> &SourceInfo {
        match *self {}
    }

    fn next_frame(&mut self) -> Result<Option<Frame>> {
        match *self {}
    }

    fn ending(&self) -> Ending {
        match *self {}
    }

    fn sample(&mut self, _: usize) -> Result<Vec<Frame>> {
        match *self {}
    }
}

pub(crate) mod formats {
    /// Whether a name begins with one of FFmpeg's protocols: there are none.
    pub(crate) fn is_protocol(_: &str) -> bool {
        false
    }
}
