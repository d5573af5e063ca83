//! Takes recorded pixels to the plane in which bodies are rigid, and back.
//!
//! Owns: [`Plane`]. Must not: know where its camera comes from.

use nalgebra::Vector2;

use super::model::Camera;
use crate::pixel_aspect::PixelAspect;

/// The plane of the mechanism as a camera with such pixels shows it. Without a camera it is the picture in square pixels.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Plane {
    /// Width to height of a recorded pixel.
    pub pixel_aspect: PixelAspect,
    /// The camera; `None` faces the plane squarely.
    pub camera: Option<Camera>,
}

impl Plane {
    /// The plane that a camera faces squarely.
    pub fn square(pixel_aspect: PixelAspect) -> Self {
        Self { pixel_aspect, camera: None }
    }

    /// A recorded place in the plane, px.
    pub fn to_plane(&self, recorded: Vector2<f64>) -> Vector2<f64> {
        let square = self.pixel_aspect.to_square(recorded);
        self.camera.map_or(square, |c| c.to_plane(square))
    }

    /// A recorded place in the plane, px, and how much longer lengths about it are there than in square pixels, in the
    /// direction in which they are longest.
    pub fn flatten(&self, recorded: [f64; 2]) -> ([f64; 2], f64) {
        let square = self.pixel_aspect.to_square(recorded.into());
        let (place, stretch) = self.camera.map_or((square, 1.0), |c| c.flatten(square));
        (place.into(), stretch)
    }

    /// A place of the plane in recorded pixels.
    pub fn recorded(&self, plane: [f64; 2]) -> [f64; 2] {
        self.to_recorded(plane.into()).into()
    }

    /// A place of the plane in recorded pixels.
    pub fn to_recorded(&self, plane: Vector2<f64>) -> Vector2<f64> {
        self.pixel_aspect.to_recorded(self.camera.map_or(plane, |c| c.to_picture(plane)))
    }
}
