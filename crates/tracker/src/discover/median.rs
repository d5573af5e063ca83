//! Computes the median of points, coordinate by coordinate.
//!
//! Owns: [`middle`]. Must not: know what the points are.

use nalgebra::Vector2;

/// Coordinate-wise median.
pub fn middle(points: &[Vector2<f64>]) -> Vector2<f64> {
    let mut x: Vec<f64> = points.iter().map(|p| p.x).collect();
    let mut y: Vec<f64> = points.iter().map(|p| p.y).collect();
    x.sort_by(f64::total_cmp);
    y.sort_by(f64::total_cmp);
    Vector2::new(x[x.len() / 2], y[y.len() / 2])
}
