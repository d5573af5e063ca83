//! Holds the observation of a node: its place in one frame, and how certain its name is.
//!
//! Owns: [`Observation`], [`Status`], [`STATUSES`], [`PART_SIGMA_PX`]. Must not: know how it was made.

use nalgebra::Vector2;

use crate::camera::Plane;

/// State of a node in a frame.
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
    /// The frame could not be decoded, so nothing is known of any node in it.
    Undecoded = 4,
    /// A person said where it is, or what is it.
    Manual = 5,
}

/// All of them, by their numbers. `marker_status.py` has the same, and a test compares them.
pub const STATUSES: [Status; 6] =
    [Status::Missing, Status::Seen, Status::Reacquired, Status::Ambiguous, Status::Undecoded, Status::Manual];

/// Added uncertainty of the centre of what is not the whole of one marker, px: its outline is that of a part.
pub const PART_SIGMA_PX: f32 = 0.2;

impl Status {
    /// The word in the table.
    pub fn as_str(self) -> &'static str {
        match self {
            Status::Missing => "missing",
            Status::Seen => "seen",
            Status::Reacquired => "reacquired",
            Status::Ambiguous => "ambiguous",
            Status::Undecoded => "undecoded",
            Status::Manual => "manual",
        }
    }

    /// Whether the place is given.
    pub fn is_seen(self) -> bool {
        matches!(self, Status::Seen | Status::Reacquired | Status::Manual)
    }

    /// The status of a number, `None` if there is none.
    pub fn from_number(number: u8) -> Option<Self> {
        STATUSES.get(usize::from(number)).copied()
    }
}

/// One node in one frame. The place is NaN unless its status is seen, reacquired or manual.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observation {
    /// Centre, px; x right.
    pub x_px: f64,
    /// Centre, px; y down.
    pub y_px: f64,
    /// Standard uncertainty of each coordinate in square pixels as high as the recorded ones, px.
    pub sigma_px: f32,
    /// Blob area, px; NaN where a person placed it.
    pub area_px: f32,
    /// Whether the node was seen, and how.
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
    /// A node in a frame that could not be decoded.
    pub const UNDECODED: Self = Self { status: Status::Undecoded, ..Self::MISSING };

    /// An observation known in the plane, in recorded pixels.
    pub(crate) fn to_recorded(mut self, plane: &Plane) -> Self {
        let aspect = plane.pixel_aspect;
        if let Some(camera) = &plane.camera
            && self.x_px.is_finite()
        {
            let square = camera.to_picture(Vector2::new(self.x_px, self.y_px));
            self.sigma_px /= camera.flatten(square).1 as f32;
            [self.x_px, self.y_px] = square.into();
        }
        if !aspect.is_square() {
            [self.x_px, self.y_px] = aspect.to_recorded(Vector2::new(self.x_px, self.y_px)).into();
            self.area_px = (f64::from(self.area_px) / aspect.ratio()) as f32;
        }
        self
    }
}
