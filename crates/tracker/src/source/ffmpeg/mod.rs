//! Decodes compressed film through FFmpeg's libraries; the luma plane is lent to detection without a copy.
//!
//! Owns: [`FfmpegSource`]. Must not: print, change a pixel where the recording has a luma plane, or guess what
//! a frame that could not be decoded held: it comes without a plane, and so do frames predicted from it, up to
//! the next key frame.

mod boxes;
mod claims;
mod decode;
mod demux;
mod dependence;
mod describe;
mod ending;
mod feed;
mod fields;
pub(crate) mod formats;
mod frame_numbers;
mod inside;
mod layout;
mod lost;
mod order;
mod reach;
mod reasons;
mod sample;
mod slice_sums;
mod slots;
mod source;
mod stamps;
mod start;
mod structure;
mod tags;
mod turning;
mod units;
mod watch;
mod words;

pub use source::FfmpegSource;
use words::{codec_name, message};
