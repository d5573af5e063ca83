//! Reads a Photron header, whose form its bytes tell.
//!
//! Owns: [`Header::parse`], which recordings are refused by their header. Must not: open files.

use super::fields::Header;
use super::{cih, cihx};
use crate::error::{Error, Fault, FaultKind, Place, Result};

impl Header {
    /// Reads a header of either form; `name` is for messages.
    ///
    /// # Errors
    /// [`Error::Source`] naming the key at fault.
    pub fn parse(bytes: &[u8], name: &str) -> Result<Self> {
        let header = if cihx::is_cihx(bytes) { cihx::parse(bytes, name)? } else { cih::parse(bytes, name)? };
        header.check(name)?;
        Ok(header)
    }

    fn check(&self, name: &str) -> Result<()> {
        let fault = |kind: FaultKind, key: &str, problem: String, advice: &str| {
            let fault = Fault::new(name, problem).of_kind(kind).at(Place::Key(key.into()));
            Err(Error::Source(fault.advice(advice)))
        };
        if self.width == 0 || self.height == 0 {
            return fault(
                FaultKind::Damaged,
                "image size",
                format!("{} x {} px", self.width, self.height),
                "Export the recording again; the header is not complete",
            );
        }
        if let Some(kind) = &self.color_type
            && !["mono", "raw", "bayer"].contains(&kind.to_lowercase().as_str())
        {
            return fault(
                FaultKind::Unsupported,
                "color type",
                format!("{kind} is not read, only Mono, Raw and Bayer are"),
                "Export the recording as Raw or as AVI",
            );
        }
        if let Some(format) = &self.file_format
            && !format.to_lowercase().contains("mraw")
        {
            return fault(
                FaultKind::Unsupported,
                "file format",
                format!("the pixels were saved as {format}, not as MRaw"),
                "Give the file or folder that holds the pictures",
            );
        }
        Ok(())
    }
}
