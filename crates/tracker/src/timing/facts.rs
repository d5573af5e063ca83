//! Holds what is known of the frames' times: [`Timing`].

use serde::{Deserialize, Serialize};

use crate::frame::RateOrigin;

/// Kind of the frames' times, as found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TimingKind {
    /// Frame numbers over the rate that the user gave.
    Given,
    /// Time stamps that are evenly spaced, perhaps with gaps; the times are those.
    Even,
    /// Time stamps rounded from an even grid, perhaps with gaps; the times are the grid's.
    Grid,
    /// Time stamps that are not on an even grid; the times are those.
    Variable,
}

/// The reason for which a rate may not be the camera's: every rate and every coefficient scales with it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Doubt {
    /// Nothing gives a rate; times count frames.
    Unknown,
    /// A rate at which films are played, with nothing that says it is the camera's too.
    Player,
}

/// Fate of a camera's tag of its capture rate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Captured {
    /// The tag's name.
    pub tag: String,
    /// The rate that it states, frames per second.
    pub rate_hz: f64,
    /// Whether it gives the times, or agrees with them. Else it contradicts the time stamps.
    pub used: bool,
}

/// The frames' times, and how well they are known.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Timing {
    /// Origin of the times.
    pub kind: TimingKind,
    /// Frames per second of recorded time; of a variable rate the mean; `None` if it is not known.
    pub rate_hz: Option<f64>,
    /// Where the rate comes from.
    pub rate_origin: RateOrigin,
    /// The rate is what the time stamps say; else whoever `rate_origin` names gave it.
    pub rate_from_stamps: bool,
    /// Standard uncertainty of the rate, where it was measured from rounded time stamps.
    pub rate_sigma_hz: Option<f64>,
    /// Slowest and fastest rate between two frames, where the rate is variable.
    pub range_hz: Option<[f64; 2]>,
    /// Seconds of recorded time in one tick of the time stamps.
    pub tick_s: f64,
    /// Standard uncertainty of each time in s: a tick over sqrt(12), the spread of what is rounded to it, where
    /// the times are stamps that are not even; else 0.
    pub sigma_s: f64,
    /// Frames that are there.
    pub frames: u64,
    /// Places where an even grid lacks frames.
    pub gaps: u64,
    /// Frames that it lacks there in all.
    pub lacking: u64,
    /// Time stamps at the ends that are not on the grid; they stay as they are.
    pub stray: u64,
    /// The rate at which the file plays, where the camera's own tag says that it took the frames faster.
    pub plays_at_hz: Option<f64>,
    /// The camera's tag of its capture rate, if there is one.
    pub capture: Option<Captured>,
    /// The camera, where the recording names it and the rate is in doubt.
    pub camera: Option<String>,
    /// Why the rate may be wrong.
    pub doubt: Option<Doubt>,
    /// Notes to the user about the times, a sentence each, with settings by their bare names.
    pub notes: Vec<String>,
}
