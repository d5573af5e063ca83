//! High-speed film of markers on rigid links in, one row per frame and node out.
//!
//! ```text
//! video ─source─▶ Frame ─detect─▶ Detections ─track─▶ Observation ─table─▶ NodeTable
//! ```
//!
//! Arrows go right only: `detect` knows nothing of `track`, and nothing here knows of pendulums or metres.
//! One function, [`pipeline`]'s `run`, calls the four in that order; every front end calls it.
//!
//! Image coordinates: x right, y down, pixel centres at integers, the first pixel is (0, 0). Times are integer
//! ticks with a time base until they are written.

pub mod csv_text;
pub mod detect;
pub mod discover;
pub mod error;
pub mod frame;
pub mod gaps;
mod gray;
pub mod kind;
pub mod message;
pub mod moving;
pub mod name;
pub mod observation;
pub mod output;
pub mod overlay;
mod packed;
pub mod peak_level;
pub mod pipeline;
pub mod pixel_aspect;
pub mod residual;
pub mod rig;
pub(crate) mod rigid;
pub mod score;
pub mod setup;
pub mod source;
pub mod stop;
pub mod store;
pub mod synth;
pub mod table;
pub mod timing;
pub mod track;
pub mod wanted;
