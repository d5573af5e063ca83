//! Finds a camera's tilt and lens from bodies that are rigid.
//!
//! Owns: [`calibrate`] from pairs of markers, [`refine`] from bodies, [`Calibration`]. Must not: find bodies.

mod bundle;
mod pairs;
mod words;

pub use bundle::{Calibration, RigidSet, refine};
pub use pairs::{Pair, PairPlace, calibrate};
pub use words::words;
