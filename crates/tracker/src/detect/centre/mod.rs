//! Finds the centre of a blob: the fit of a disc, the centroid by intensity, or the paper's contour.

mod contour;
#[cfg(feature = "opencv")]
pub(super) mod contours;
#[cfg(not(feature = "opencv"))]
#[path = "without_contours.rs"]
pub(super) mod contours;
pub(super) mod disc;
pub(super) mod disc_fit;
pub(super) mod edge_pixels;
pub(super) mod edge_table;
pub(super) mod normal_equations;
pub(super) mod shape;
pub(super) mod window;
