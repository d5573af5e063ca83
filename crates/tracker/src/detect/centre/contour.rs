//! Defines a contour's centre.

/// A contour's centre and area by `moments`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Contour {
    pub x_px: f64,
    pub y_px: f64,
    pub area_px: f64,
}
