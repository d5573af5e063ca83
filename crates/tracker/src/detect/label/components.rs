//! Labels connected components in one pass: runs of pixels beyond the threshold, joined to the row above.
//!
//! Owns: [`Blob`], [`Labeller`]. Must not: know where the threshold comes from, or find a centre.
//!
//! Pixels are neighbours along sides and corners (8-connected).

use super::plan::{CELL_PX, Plan, Segment};
use super::prefilter::{MASK_BITS, Prefilter, Sample};
use crate::detect::pixels::Pixels;
use crate::detect::settings::Polarity;
use crate::frame::PixelFormat;

/// A connected set of pixels beyond the threshold, as one pass adds it up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Blob {
    /// Pixels.
    pub area: u64,
    /// First and last column.
    pub x0: u32,
    pub x1: u32,
    /// First and last row.
    pub y0: u32,
    pub y1: u32,
    /// Sums of x, y, x^2, x y, y^2 over its pixels, from the image's corner.
    pub sums: [u64; 5],
    /// Touches the border of the image or the region.
    pub border: bool,
}

impl Blob {
    fn absorb(&mut self, other: &Blob) {
        self.area += other.area;
        self.x0 = self.x0.min(other.x0);
        self.x1 = self.x1.max(other.x1);
        self.y0 = self.y0.min(other.y0);
        self.y1 = self.y1.max(other.y1);
        for (a, b) in self.sums.iter_mut().zip(other.sums) {
            *a += b;
        }
        self.border |= other.border;
    }

    fn of_run(y: u32, x0: u32, end: u32, border: bool) -> Self {
        let n = u64::from(end - x0);
        let (a, b) = (u64::from(x0), u64::from(end) - 1);
        let sx = (a + b) * n / 2;
        // Sum of squares up to b less that up to a - 1.
        let squares = |m: u64| m * (m + 1) * (2 * m + 1) / 6;
        let sxx = squares(b) - if a == 0 { 0 } else { squares(a - 1) };
        let yy = u64::from(y);
        Self { area: n, x0, x1: end - 1, y0: y, y1: y, sums: [sx, n * yy, sxx, sx * yy, n * yy * yy], border }
    }

    /// Mean x and y of its pixels.
    pub fn mean(&self) -> [f64; 2] {
        let n = self.area as f64;
        [self.sums[0] as f64 / n, self.sums[1] as f64 / n]
    }

    /// Variances of its pixels along x and y and their covariance, px^2; each pixel counts as an area of the given
    /// sides, not a point.
    fn spread(&self, [wide, high]: [f64; 2]) -> [f64; 3] {
        let n = self.area as f64;
        let [mx, my] = self.mean();
        let s = self.sums.map(|v| v as f64 / n);
        let [xx, xy, yy] = [s[2] - mx * mx + 1.0 / 12.0, s[3] - mx * my, s[4] - my * my + 1.0 / 12.0];
        [xx * (wide * wide), xy * (wide * high), yy * (high * high)]
    }

    /// Variances of its pixels, of the given sides, along the longer and the shorter principal axis, px^2.
    pub fn axes(&self, sides: [f64; 2]) -> [f64; 2] {
        let [xx, xy, yy] = self.spread(sides);
        let (half, diff) = ((xx + yy) / 2.0, (xx - yy) / 2.0);
        let root = (diff * diff + xy * xy).sqrt();
        [half + root, (half - root).max(1.0 / 12.0)]
    }

    /// Direction of the longer principal axis.
    pub fn direction(&self, sides: [f64; 2]) -> [f64; 2] {
        let [xx, xy, yy] = self.spread(sides);
        let angle = 0.5 * (2.0 * xy).atan2(xx - yy);
        [angle.cos(), angle.sin()]
    }

    /// Longer over shorter principal axis.
    pub fn elongation(&self, sides: [f64; 2]) -> f64 {
        let [a, b] = self.axes(sides);
        (a / b).sqrt()
    }

    /// Its area over that of the ellipse with its second moments: 1 for a full disc or ellipse, 0.95 for a
    /// rectangle, far below 1 for something branched or hollow.
    pub fn fill(&self, sides: [f64; 2]) -> f64 {
        let [a, b] = self.axes(sides);
        self.area as f64 / (4.0 * std::f64::consts::PI * (a * b).sqrt())
    }
}

#[derive(Debug, Clone, Copy)]
struct Run {
    x0: u32,
    end: u32,
    /// Touches the border of the image or the region.
    border: bool,
    /// Of its blob, once its row is at its end.
    label: u32,
}

/// Marked cells that are asked of memory before they are looked at: by then most are out of the fast caches.
const AHEAD: usize = 4;

/// Finds blobs; owns its scratch, so a frame allocates nothing once it has grown.
#[derive(Debug, Default)]
pub(crate) struct Labeller {
    /// Runs of the row above and of this one.
    above: Vec<Run>,
    here: Vec<Run>,
    /// The row that is at work.
    y: u32,
    parents: Vec<u32>,
    blobs: Vec<Blob>,
    row: Vec<u16>,
    prefilter: Prefilter,
}

impl Labeller {
    /// Appends the blobs of a frame to `out` (cleared first), in order of their first pixel.
    pub fn find(&mut self, pixels: &Pixels<'_>, plan: &Plan, polarity: Polarity, out: &mut Vec<Blob>) {
        out.clear();
        self.parents.clear();
        self.blobs.clear();
        self.above.clear();
        self.here.clear();
        let mut prefilter = std::mem::take(&mut self.prefilter);
        prefilter.find(pixels, plan, polarity);
        let mut row = None;
        let mut ahead = prefilter.marks().skip(AHEAD);
        for (y, column) in prefilter.marks() {
            if let Some((y, column)) = ahead.next() {
                pixels.fetch(y as usize, (column * CELL_PX) as usize, CELL_PX as usize);
            }
            if row != Some(y) {
                self.next_row(row.is_some_and(|r| r + 1 == y));
                self.y = y;
                row = Some(y);
            }
            let (left, right) = (column * CELL_PX, (column + 1) * CELL_PX);
            for s in plan.row(y as usize) {
                let (start, end) = (s.start.max(left), s.end.min(right));
                if start < end {
                    let edge = (s.edge.0 && start == s.start, s.edge.1 && end == s.end);
                    self.scan(
                        pixels,
                        y as usize,
                        Segment { start, end, edge, ..*s },
                        plan.edge_rows,
                        polarity,
                    );
                }
            }
        }
        drop(ahead);
        self.next_row(true);
        self.prefilter = prefilter;
        for i in 0..self.blobs.len() {
            if self.parents[i] as usize == i {
                out.push(self.blobs[i]);
            }
        }
    }

    /// Ends a row; the next one may lie right below it.
    fn next_row(&mut self, below: bool) {
        self.join();
        std::mem::swap(&mut self.above, &mut self.here);
        self.here.clear();
        if !below {
            self.above.clear();
        }
    }

    fn scan(
        &mut self,
        pixels: &Pixels<'_>,
        y: usize,
        s: Segment,
        edge_rows: (usize, usize),
        polarity: Polarity,
    ) {
        let edge_row = y == edge_rows.0 || y == edge_rows.1;
        let count = (s.end - s.start) as usize;
        if pixels.format == PixelFormat::Gray8 {
            let from = pixels.start(y, s.start as usize).0;
            self.runs(&pixels.bytes[from..from + count], s, edge_row, polarity);
        } else {
            let mut row = std::mem::take(&mut self.row);
            row.resize(count, 0);
            pixels.read(y, s.start as usize, &mut row);
            self.runs(&row, s, edge_row, polarity);
            self.row = row;
        }
    }

    /// The runs of a piece in which there may be some.
    fn runs<T: Sample>(&mut self, row: &[T], s: Segment, edge_row: bool, polarity: Polarity) {
        let Some(limit) = T::limit(s.threshold, polarity) else { return };
        let mut open: Option<u32> = None;
        let mut x = s.start;
        let (many, rest) = row.as_chunks::<MASK_BITS>();
        let mut last = [limit; MASK_BITS];
        last[..rest.len()].copy_from_slice(rest);
        for many in many.iter().chain((!rest.is_empty()).then_some(&last)) {
            let mask = T::beyond(many, limit, polarity);
            // What begins or ends: beyond here and not just before, or the other way round.
            let mut turns = mask ^ (mask << 1 | u64::from(open.is_some()));
            if x + MASK_BITS as u32 > s.end {
                turns &= (1 << (s.end - x)) - 1;
            }
            while turns != 0 {
                let at = x + turns.trailing_zeros();
                turns &= turns - 1;
                open = match open {
                    None => Some(at),
                    Some(x0) => {
                        self.run(x0, at, edge_row || (s.edge.0 && x0 == s.start));
                        None
                    }
                };
            }
            x += MASK_BITS as u32;
        }
        if let Some(x0) = open {
            self.run(x0, s.end, edge_row || (s.edge.0 && x0 == s.start) || s.edge.1);
        }
    }

    fn run(&mut self, x0: u32, end: u32, border: bool) {
        match self.here.last_mut() {
            // The same run went on across two segments.
            Some(last) if last.end == x0 => {
                last.end = end;
                last.border |= border;
            }
            _ => self.here.push(Run { x0, end, border, label: 0 }),
        }
    }

    fn root(parents: &mut [u32], mut i: u32) -> u32 {
        while parents[i as usize] != i {
            parents[i as usize] = parents[parents[i as usize] as usize];
            i = parents[i as usize];
        }
        i
    }

    /// Gives the runs of this row to the blobs in the row above that they touch, which become one; a run that touches
    /// none begins one.
    fn join(&mut self) {
        let mut first = 0;
        for run in &mut self.here {
            let mut blob = Blob::of_run(self.y, run.x0, run.end, run.border);
            let mut own = None;
            while first < self.above.len() && self.above[first].end < run.x0 {
                first += 1;
            }
            for up in self.above[first..].iter().take_while(|up| up.x0 <= run.end) {
                let root = Self::root(&mut self.parents, up.label);
                match own {
                    None => own = Some(root),
                    Some(own_root) if own_root != root => {
                        let (keep, gone) = (root.min(own_root), root.max(own_root));
                        self.parents[gone as usize] = keep;
                        blob.absorb(&self.blobs[gone as usize]);
                        own = Some(keep);
                    }
                    Some(_) => {}
                }
            }
            run.label = match own {
                Some(label) => {
                    self.blobs[label as usize].absorb(&blob);
                    label
                }
                None => {
                    self.parents.push(self.blobs.len() as u32);
                    self.blobs.push(blob);
                    self.blobs.len() as u32 - 1
                }
            };
        }
    }
}
