//! Reads Photron MRAW: a file of pixels without a header, and beside it a `.cih` or `.cihx` that explains it.
//!
//! Owns: [`MrawSource`]. Must not: unpack pixels; frames are handed out as they lie in the file.
//! The one exception is 16-bit with the significant bits on top, which is moved down.

pub mod cih;
pub mod cihx;
mod fields;
mod header;
mod pair;
mod source;

pub(crate) use pair::{is_photron, pair};
pub use source::MrawSource;
