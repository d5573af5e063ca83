//! Reads NorPix sequences (`.seq`, StreamPix): uncompressed pictures as they lie in the file, or JPEG pictures, each with the time
//! at which it was taken.
//!
//! Owns: [`NorpixSource`].

mod header;
mod source;
mod times;

pub(crate) use header::is_norpix;
pub use source::NorpixSource;
