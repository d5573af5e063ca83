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
//!
//! A film of a known scene is written and its markers are followed, without any setting:
//!
//! ```
//! use tracker::pipeline::{RunSettings, Silent, run};
//! use tracker::synth::{Film, WriteOptions, preset, write};
//!
//! # let folder = tempfile::tempdir().unwrap();
//! # let path = folder.path().join("drop.mraw");
//! let mut scene = preset("clean", 1)?;
//! scene.frames = 100;
//! write(&Film::new(&scene)?, &path, &WriteOptions::default(), &mut |_| Ok(()))?;
//!
//! let settings = RunSettings { input: path.display().to_string(), collect: true, ..RunSettings::default() };
//! let summary = run(&settings, &mut Silent)?;
//! let rig = &summary.meta.rig;
//! assert_eq!((summary.frames, rig.nodes.len(), rig.bodies.len()), (100, 9, 2));
//! # Ok::<(), tracker::error::Error>(())
//! ```
//!
//! Features: `ffmpeg` reads and writes compressed film, `opencv` corrects lenses and draws, `opencv-decoder` checks the first
//! decoder of film with OpenCV's, `cli` is the
//! command line; all are on by default. Without the first two, cameras' own files (Photron, NorPix) and TIFF stacks are read.

#![cfg_attr(
    not(feature = "opencv-decoder"),
    allow(dead_code, unused_imports, reason = "what only the left-out parts use")
)]

pub(crate) mod calibrate;
pub mod camera;
#[cfg(feature = "cli")]
pub mod cli;
pub mod csv_text;
pub mod detect;
pub mod discover;
pub mod edits;
pub mod error;
pub mod frame;
pub mod gaps;
pub mod gray;
pub mod kind;
pub(crate) mod link;
pub mod message;
pub mod moving;
pub mod name;
pub mod observation;
pub mod output;
#[cfg(feature = "opencv")]
pub mod overlay;
mod packed;
pub mod peak_level;
pub mod pipeline;
pub mod pixel_aspect;
pub mod pixel_damage;
pub mod residual;
pub mod rig;
pub(crate) mod rigid;
pub mod score;
pub mod setting_words;
#[cfg(feature = "opencv")]
pub mod setup;
pub mod source;
pub mod stop;
pub mod store;
pub mod synth;
pub mod table;
pub mod timing;
pub mod track;
pub mod wanted;
