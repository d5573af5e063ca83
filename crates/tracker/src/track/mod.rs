//! From detections to named nodes: nearest neighbours, signatures, rigid bodies.
//!
//! Owns: [`Status`], [`Observation`], [`Tracker`], [`track_recording`]. Must not: know of pixels, pendulums or metres.

pub mod beside;
pub mod chance;
pub mod constellation;
pub mod engine;
mod finding;
pub mod habits;
pub mod joints;
pub mod learn;
pub mod mechanism;
pub mod nearest;
pub mod partly;
pub mod predict;
pub mod recording;
pub mod rigid;
pub mod rows;
pub mod signature;
pub mod tracker;
mod undecided;

#[cfg(test)]
mod swing;
#[cfg(test)]
pub(crate) mod tests;

pub use recording::{TrackSummary, track_recording};
pub use tracker::Tracker;

/// What is known of a node in a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(u8)]
pub enum Status {
    /// Not seen, or what was seen at its place was not accepted.
    #[default]
    Missing = 0,
    /// Seen, and its name is certain.
    Seen = 1,
    /// The first frame in which it is seen again.
    Reacquired = 2,
    /// Something is seen that may be it, but another name is possible too; its place is not given.
    Ambiguous = 3,
}

impl Status {
    /// The word in the table.
    pub fn as_str(self) -> &'static str {
        match self {
            Status::Missing => "missing",
            Status::Seen => "seen",
            Status::Reacquired => "reacquired",
            Status::Ambiguous => "ambiguous",
        }
    }

    /// Whether the place is given.
    pub fn is_seen(self) -> bool {
        matches!(self, Status::Seen | Status::Reacquired)
    }

    /// The status of a number, `None` if there is none.
    pub fn from_number(number: u8) -> Option<Self> {
        [Status::Missing, Status::Seen, Status::Reacquired, Status::Ambiguous]
            .get(usize::from(number))
            .copied()
    }
}

/// One node in one frame. The place is NaN unless its status is seen or reacquired.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observation {
    /// Centre, px; x right.
    pub x_px: f64,
    /// Centre, px; y down.
    pub y_px: f64,
    /// Standard uncertainty of each coordinate, px.
    pub sigma_px: f32,
    /// Blob area, px.
    pub area_px: f32,
    /// What is known.
    pub status: Status,
}

impl Observation {
    /// A node not seen.
    pub const MISSING: Self = Self {
        x_px: f64::NAN,
        y_px: f64::NAN,
        sigma_px: f32::NAN,
        area_px: f32::NAN,
        status: Status::Missing,
    };
}
