//! A way of looking for markers: [`Model`].

use super::response::Direction;

/// The look of a marker: colour direction, bright (1) or dark (-1), octave.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Model {
    /// Colour direction.
    pub direction: Direction,
    /// 1 for markers that are more than their surroundings along it, -1 for less.
    pub sign: f32,
    /// Octave.
    pub octave: usize,
}

impl Model {
    /// Radius of the disc that it answers most to, px.
    pub fn radius_px(&self) -> f64 {
        2.0 * (1usize << self.octave) as f64
    }

    /// The octave on which centres are taken.
    pub fn fine_octave(&self) -> usize {
        self.octave.saturating_sub(2)
    }
}
