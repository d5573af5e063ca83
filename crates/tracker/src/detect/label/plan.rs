//! Plans which cells of a frame are looked at, and with which threshold.
//!
//! Owns: [`Plan`], [`Segment`], [`Cell`]. Must not: read a pixel, or know where the threshold comes from.

use super::mask::Spans;
use crate::detect::levels::Levels;
use crate::detect::settings::Polarity;

/// Columns `start..end` of a row with the threshold to apply there, raw units.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Segment {
    pub start: u32,
    pub end: u32,
    /// A bright marker's pixel is at least this, a dark marker's at most this.
    pub threshold: u16,
    /// The region or the image ends at `start` / at `end`.
    pub edge: (bool, bool),
}

/// Columns `start..end` of [`CELL_ROWS`] rows, and the threshold that is the easiest to exceed in them. Nothing to
/// look at is an empty range.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Cell {
    pub start: u32,
    pub end: u32,
    pub threshold: u16,
}

/// Height of a cell, px.
const CELL_ROWS: usize = 16;
/// Width of a cell, px: whole blocks of vectors of 8 and 16 bits, whole bytes of packed samples.
pub(crate) const CELL_PX: u32 = 320;
/// Width of the stretches of a row that share one threshold where the background is not flat, px.
const STRETCH_PX: u32 = 64;

/// Segments, row by row, and the same more coarsely in cells.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Plan {
    segments: Vec<Segment>,
    /// Index of the first segment of each row, and one more at the end.
    first: Vec<u32>,
    /// First and last row with a segment.
    pub edge_rows: (usize, usize),
    cells: Vec<Cell>,
    /// Cells beside each other.
    pub columns: usize,
}

impl Plan {
    /// The plan for a recording's thresholds in a region.
    pub fn new(levels: &Levels, spans: &Spans, height: usize) -> Self {
        let (mut segments, mut first) = (Vec::<Segment>::new(), vec![0]);
        for y in 0..height {
            for &(start, end) in spans.row(y) {
                let mut from = start;
                while from < end {
                    let to = (from + STRETCH_PX).min(end);
                    let t = levels.threshold(f64::from(from + to - 1) / 2.0, y as f64);
                    let threshold = match levels.polarity {
                        Polarity::Bright => t.ceil().clamp(1.0, 65535.0),
                        Polarity::Dark => t.floor().clamp(0.0, 65534.0),
                    } as u16;
                    let edge = (from == start, to == end);
                    match segments.last_mut() {
                        Some(last) if !edge.0 && last.threshold == threshold && first.len() == y + 1 => {
                            last.end = to;
                            last.edge.1 = edge.1;
                        }
                        _ => segments.push(Segment { start: from, end: to, threshold, edge }),
                    }
                    from = to;
                }
            }
            first.push(segments.len() as u32);
        }
        Self::of_segments(segments, first, levels.polarity)
    }

    /// One threshold for a whole image.
    pub fn uniform(width: usize, height: usize, threshold: u16, polarity: Polarity) -> Self {
        let segment = Segment { start: 0, end: width as u32, threshold, edge: (true, true) };
        Self::of_segments(vec![segment; height], (0..=height as u32).collect(), polarity)
    }

    /// The plan of segments, row by row as `first` says.
    fn of_segments(segments: Vec<Segment>, first: Vec<u32>, polarity: Polarity) -> Self {
        let width = segments.iter().map(|s| s.end).max().unwrap_or(0);
        let rows = first.len() - 1;
        let mut this = Self { segments, first, ..Self::default() };
        let holds = |y: &usize| !this.row(*y).is_empty();
        this.edge_rows =
            ((0..rows).find(holds).unwrap_or(usize::MAX), (0..rows).rev().find(holds).unwrap_or(0));
        this.columns = width.div_ceil(CELL_PX) as usize;
        let harder = |a: u16, b: u16| match polarity {
            Polarity::Bright => a.min(b),
            Polarity::Dark => a.max(b),
        };
        let mut cells = Vec::new();
        for y in (0..rows).step_by(CELL_ROWS) {
            let block =
                &this.segments[this.first[y] as usize..this.first[(y + CELL_ROWS).min(rows)] as usize];
            for left in (0..width).step_by(CELL_PX as usize) {
                let right = (left + CELL_PX).min(width);
                let cell = block
                    .iter()
                    .filter(|s| s.start < right && s.end > left)
                    .map(|s| Cell { start: s.start.max(left), end: s.end.min(right), threshold: s.threshold })
                    .reduce(|a, b| Cell {
                        start: a.start.min(b.start),
                        end: a.end.max(b.end),
                        threshold: harder(a.threshold, b.threshold),
                    });
                cells.push(cell.unwrap_or(Cell { start: left, end: left, threshold: 0 }));
            }
        }
        this.cells = cells;
        this
    }

    /// The segments of a row.
    #[inline]
    pub fn row(&self, y: usize) -> &[Segment] {
        &self.segments[self.first[y] as usize..self.first[y + 1] as usize]
    }

    /// The cells of a row, as many as [`Plan::columns`].
    #[inline(always)]
    pub fn cells(&self, y: usize) -> &[Cell] {
        let first = y / CELL_ROWS * self.columns;
        &self.cells[first..first + self.columns]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::Region;

    #[test]
    fn cells_hold_every_segment_and_the_easiest_threshold() {
        let corners = vec![[100.0, 3.0], [900.0, 40.0], [350.0, 90.0]];
        let spans = Spans::new(Some(&Region::Polygon(corners)), 1000, 100).unwrap();
        for polarity in [Polarity::Bright, Polarity::Dark] {
            let (mut segments, mut first) = (Vec::new(), vec![0]);
            for y in 0..100 {
                for &(start, end) in spans.row(y) {
                    let threshold = (start + 7 * y as u32) as u16;
                    segments.push(Segment { start, end, threshold, edge: (true, true) });
                }
                first.push(segments.len() as u32);
            }
            let plan = Plan::of_segments(segments, first, polarity);
            assert_eq!(plan.edge_rows, (3, 89));
            for y in 0..100 {
                for s in plan.row(y) {
                    for x in [s.start, s.end - 1] {
                        let cell = plan.cells(y)[(x / CELL_PX) as usize];
                        assert!((cell.start..cell.end).contains(&x), "{s:?} {cell:?}");
                        assert!(match polarity {
                            Polarity::Bright => cell.threshold <= s.threshold,
                            Polarity::Dark => cell.threshold >= s.threshold,
                        });
                    }
                }
            }
        }
    }
}
