//! Refuses to encode films and images in a program that was built without the feature `ffmpeg`.

use std::path::Path;

use super::settings::{ImageKind, VideoSettings};
use crate::error::{Error, Fault, Result};
use crate::name::text;

/// A video file being written: there is none.
pub enum VideoWriter {}

impl VideoWriter {
    /// An error.
    ///
    /// # Errors
    /// [`Error::Film`], always.
    pub fn create(path: &Path, _: &VideoSettings) -> Result<Self> {
        Err(Error::Film(Fault::without("ffmpeg", text(path), "no film is encoded")))
    }

    /// Adds a frame.
    ///
    /// # Errors
    /// None: there is no writer.
    pub fn write(&mut self, _: &[u8]) -> Result<()> {
        match *self {}
    }

    /// Leaves no file.
    pub fn abandon(self) {
        match self {}
    }

    /// Ends the file.
    ///
    /// # Errors
    /// None: there is no writer.
    pub fn finish(self) -> Result<()> {
        match self {}
    }
}

/// An error.
///
/// # Errors
/// [`Error::Film`], always.
pub fn encode_image(name: &str, _: ImageKind, _: u32, _: u32, _: u32, _: &[u8]) -> Result<Vec<u8>> {
    Err(Error::Film(Fault::without("ffmpeg", name, "no image is encoded")))
}
