//! The part of the tracker's `source` that parses headers.

#[path = "../../src/source/cine/header.rs"]
pub mod cine_header;
#[path = "../../src/source/clock.rs"]
pub mod clock;
#[path = "../../src/source/mraw/mod.rs"]
pub mod mraw;
#[path = "../../src/source/options.rs"]
mod options;
#[path = "../../src/source/raw.rs"]
mod raw;

pub use options::OpenOptions;
