//! Where frames come from: one file per container, told apart by their first bytes.
//!
//! Owns: [`open`], [`OpenOptions`], [`Decoder`]. Must not: look at what is in a picture.

pub mod cine;
pub mod clock;
pub mod ffmpeg;
pub mod images;
mod input;
pub mod mraw;
pub mod norpix;
mod open;
pub mod opencv;
mod options;
mod raw;

pub use crate::frame::{Ending, FrameSource, SourceInfo};
pub(crate) use input::{Input, is_read_once};
pub use open::{files, open};
pub use options::{Decoder, Interlaced, OpenOptions};
pub(crate) use options::{cores, threads_note};
