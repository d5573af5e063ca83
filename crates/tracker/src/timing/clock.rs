//! Converts frames to their times in s: [`Clock`].

use crate::frame::TimeBase;

/// From a frame's place and time stamp to its time.
#[derive(Debug, Clone)]
pub struct Clock {
    pub(super) time_base: TimeBase,
    /// Seconds of recorded time in a second of the stamps.
    pub(super) scale: f64,
    pub(super) grid: Option<Grid>,
}

/// Times of an even grid.
#[derive(Debug, Clone)]
pub(super) struct Grid {
    /// Time of the grid's first instant, s of recorded time.
    pub origin_s: f64,
    pub period: Seconds,
    /// Place of the first frame after each gap, and frames that lack up to there.
    pub gaps: Vec<(u64, u64)>,
    /// Places that are on it; others keep their stamps.
    pub first: u64,
    pub last: u64,
}

/// Seconds from frame to frame.
#[derive(Debug, Clone, Copy)]
pub(super) enum Seconds {
    /// A fraction.
    Exact {
        numerator: u64,
        denominator: u64,
    },
    Measured(f64),
}

impl Seconds {
    fn times(self, k: u64) -> f64 {
        match self {
            // The product is exact, so only the division rounds.
            Seconds::Exact { numerator, denominator } => {
                (u128::from(k) * u128::from(numerator)) as f64 / denominator as f64
            }
            Seconds::Measured(s) => k as f64 * s,
        }
    }
}

impl Clock {
    /// The time in s of the frame at `place`, counted from 0 among those that were read, with stamp `ticks`.
    pub fn seconds(&self, place: u64, ticks: i64) -> f64 {
        match &self.grid {
            Some(grid) if (grid.first..=grid.last).contains(&place) => {
                let before = grid.gaps.partition_point(|&(at, _)| at <= place);
                let lacking = before.checked_sub(1).map_or(0, |i| grid.gaps[i].1);
                grid.origin_s + grid.period.times(place - grid.first + lacking)
            }
            _ if self.scale == 1.0 => self.time_base.seconds(ticks),
            _ => self.time_base.seconds(ticks) * self.scale,
        }
    }
}
