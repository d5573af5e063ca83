//! Holds a detection: the centre of one blob that may be a marker, with what makes it less trustworthy.
//!
//! Owns: [`Detection`], [`Flags`]. Must not: know how a centre is found.

use nalgebra::Vector2;

use crate::camera::Plane;
use crate::pixel_aspect::PixelAspect;

/// Facts about a detection that make its centre less trustworthy, as bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Flags(pub u8);

impl Flags {
    /// Pixels at the top (or bottom) of the recording's range.
    pub const SATURATED: u8 = 1;
    /// The blob touches the image's border or the region's.
    pub const BORDER: u8 = 2;
    /// The blob holds more than one marker.
    pub const MERGED: u8 = 4;
    /// The blob is not the whole marker: its centre is biased.
    pub const PARTIAL: u8 = 8;

    /// Whether any of `bits` is set.
    pub fn has(self, bits: u8) -> bool {
        self.0 & bits != 0
    }
}

/// One blob that may be a marker.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Detection {
    /// Centre, px; x right.
    pub x_px: f64,
    /// Centre, px; y down.
    pub y_px: f64,
    /// Standard uncertainty of each coordinate in square pixels as high as the recorded ones, px: the greater of the two.
    pub sigma_px: f32,
    /// Area beyond the threshold, px.
    pub area_px: f32,
    /// Largest difference from the background, raw units of the recording, above 0 for either polarity.
    pub peak: f32,
    /// Longer over shorter principal axis in the world, at least 1.
    pub elongation: f32,
    /// Reasons to trust it less.
    pub flags: Flags,
}

impl Detection {
    /// A detection known in recorded pixels, in square ones.
    pub(crate) fn to_square(mut self, aspect: PixelAspect) -> Self {
        if !aspect.is_square() {
            [self.x_px, self.y_px] = aspect.to_square(Vector2::new(self.x_px, self.y_px)).into();
            self.area_px = (f64::from(self.area_px) * aspect.ratio()) as f32;
        }
        self
    }

    /// A detection known in square pixels, in the plane. The uncertainty grows by the most that the surroundings are stretched in
    /// any direction.
    pub(crate) fn to_plane(mut self, plane: &Plane) -> Self {
        if let Some(camera) = &plane.camera {
            let (place, stretch) = camera.flatten(Vector2::new(self.x_px, self.y_px));
            [self.x_px, self.y_px] = place.into();
            self.sigma_px *= stretch as f32;
        }
        self
    }
}
