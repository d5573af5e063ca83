//! Holds a disc in the image: centre and radius.
//!
//! Owns: [`Disc`].

/// A disc in the image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Disc {
    /// Centre, recorded px.
    pub x_px: f64,
    pub y_px: f64,
    /// Radius, in units of sqrt(area of a pixel).
    pub radius_px: f64,
}

impl Disc {
    /// The disc of an area about a centre.
    pub fn of_area([x_px, y_px]: [f64; 2], area_px: f64) -> Self {
        Self { x_px, y_px, radius_px: (area_px / std::f64::consts::PI).sqrt() }
    }
}
