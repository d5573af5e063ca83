//! Holds a marker's way through consecutive frames.
//!
//! Owns: [`Tracklet`], [`Point`].

use nalgebra::Vector2;

use crate::detect::{Detection, Flags};

/// A marker in one frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// Centre, square px.
    pub place: Vector2<f64>,
    /// Blob area, px.
    pub area_px: f32,
    /// Whether it is the whole of one marker, as far as its picture tells: other centres are off.
    pub whole: bool,
}

impl Point {
    pub(super) fn of(d: &Detection) -> Self {
        Self {
            place: Vector2::new(d.x_px, d.y_px),
            area_px: d.area_px,
            whole: !d.flags.has(Flags::MERGED | Flags::PARTIAL | Flags::BORDER),
        }
    }
}

/// A marker's way through consecutive frames.
#[derive(Debug, Clone, PartialEq)]
pub struct Tracklet {
    /// Index of the first frame in the store.
    pub first: usize,
    /// One for each frame.
    pub points: Vec<Point>,
}

impl Tracklet {
    /// One past the last frame.
    pub fn end(&self) -> usize {
        self.first + self.points.len()
    }

    /// The tracklet's point in a frame.
    pub fn at(&self, frame: usize) -> Option<&Point> {
        self.points.get(frame.checked_sub(self.first)?)
    }

    /// Half of its points are larger, px.
    pub fn usual_area_px(&self) -> f32 {
        let mut areas: Vec<f32> = self.points.iter().map(|p| p.area_px).collect();
        let half = areas.len() / 2;
        *areas.select_nth_unstable_by(half, f32::total_cmp).1
    }

    /// The longer side of the upright box about it, px.
    pub fn extent_px(&self) -> f64 {
        let (mut low, mut high) = (self.points[0].place, self.points[0].place);
        for p in &self.points {
            low = low.inf(&p.place);
            high = high.sup(&p.place);
        }
        (high - low).amax()
    }
}
