//! Synthesises films with known truth, of any planar mechanism of rigid links with markers on them.
//!
//! ```text
//! Scene (TOML) + MotionTable ─▶ Film ─▶ expected image ─noise─▶ recorded frame ─▶ file, SyntheticSource
//!                                  └──▶ truth: place, visible part, angles
//! ```
//!
//! Owns: [`Scene`], [`MotionTable`], [`Film`], the presets, writing films and truth. Must not: know of pendulums or
//! metres, or of detection and tracking, which it exists to judge.
//!
//! A frame's time is the middle of its exposure. Everything random comes from the scene's seed and the frame's
//! index, so frames may be made in any order and by any number of threads. The noise model is in [`noise`].
//!
//! ```
//! use tracker::synth::{Film, preset};
//!
//! let film = Film::new(&preset("noisy", 3)?)?;
//! let (mut samples, truth) = (Vec::new(), film.truth(10));
//! film.render(10, &mut samples);
//! assert_eq!((samples.len(), truth.nodes.len()), (720 * 720, 9));
//! # Ok::<(), tracker::error::Error>(())
//! ```

mod camera_raw;
mod canvas;
mod coverage;
pub mod encode;
mod film;
mod motion;
mod motion_file;
mod noise;
mod presets;
mod render;
pub mod scene;
mod scene_check;
mod sink;
mod source;
mod spline;
#[cfg(test)]
mod tests;
mod truth;
mod truth_table;
mod write;
mod write_options;

pub use film::Film;
pub use motion::MotionTable;
pub use presets::{MECHANISMS, PRESETS, paper_layout, preset};
pub use scene::{Scene, View};
pub use sink::files as film_files;
pub use source::SyntheticSource;
pub use truth::{FrameTruth, NodeTruth};
pub use truth_table::{Truth, TruthWriter};
pub use write::write;
pub use write_options::WriteOptions;
