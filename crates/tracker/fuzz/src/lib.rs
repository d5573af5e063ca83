//! The tracker's pure parsers, for fuzzing.

#![allow(dead_code, missing_docs, unused_imports)]

#[path = "../../src/error.rs"]
pub mod error;
#[path = "../../src/frame.rs"]
pub mod frame;
#[path = "../../src/gaps.rs"]
pub mod gaps;
#[path = "../../src/kind.rs"]
pub mod kind;
#[path = "../../src/message.rs"]
pub mod message;
#[path = "../../src/name.rs"]
pub mod name;
#[path = "../../src/output.rs"]
pub mod output;
#[path = "../../src/pixel_aspect.rs"]
pub mod pixel_aspect;
#[path = "../../src/pixel_damage.rs"]
pub mod pixel_damage;
#[path = "../../src/rig.rs"]
pub mod rig;
#[path = "../../src/setting_words.rs"]
pub mod setting_words;
#[path = "../../src/timing/mod.rs"]
pub mod timing;

pub mod source;
