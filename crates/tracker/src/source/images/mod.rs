//! Reads pictures as a recording: a folder, a pattern, or the pages of a TIFF file.
//!
//! Owns: [`SequenceSource`], [`StackSource`].

mod coded_picture;
mod jpeg_bits;
mod jpeg_scan;
pub mod names;
mod ome;
mod orientation_tag;
mod picture;
pub mod picture_file;
mod pixel_size;
mod planes;
mod png_sums;
mod sequence;
mod stack;
mod tiff_layout;
mod tiff_page;

pub(crate) use jpeg_scan::check as check_jpeg;
pub(crate) use orientation_tag::{is_turned, told as orientation_told};
pub use sequence::SequenceSource;
pub use stack::StackSource;
