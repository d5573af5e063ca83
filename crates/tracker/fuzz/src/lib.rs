//! The tracker's pure parsers, for fuzzing.

#![allow(dead_code, missing_docs)]

#[path = "../../src/error.rs"]
pub mod error;
#[path = "../../src/frame.rs"]
pub mod frame;
#[path = "../../src/message.rs"]
pub mod message;
#[path = "../../src/rig.rs"]
pub mod rig;

pub mod source;
