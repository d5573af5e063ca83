//! Reads Phantom CINE: pixels through FFmpeg's demuxer, times from the file's own stamps.
//!
//! Owns: [`CineSource`].

pub mod header;
mod source;

pub use source::CineSource;
