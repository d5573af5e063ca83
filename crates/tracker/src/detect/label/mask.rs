//! Turns the region of interest into spans of rows.
//!
//! Owns: [`Spans`]. Must not: read a pixel.

use crate::error::{Error, Fault, Result};
use crate::rig::Region;

/// For each row the columns to look at, `start..end`, in order and apart.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Spans {
    spans: Vec<(u32, u32)>,
    first: Vec<u32>,
}

impl Spans {
    /// The spans of a region in an image; a pixel is inside if its centre is.
    ///
    /// # Errors
    /// [`Error::Detect`] for a region that is no area or holds no pixel.
    pub fn new(region: Option<&Region>, width: usize, height: usize) -> Result<Self> {
        let mut this = Self { spans: Vec::new(), first: vec![0] };
        let fault = |problem: String| {
            Error::Detect(
                Fault::new("region", problem)
                    .advice(format!("Give it in px inside the image of {width} x {height} px")),
            )
        };
        let mut crossings: Vec<f64> = Vec::new();
        for y in 0..height {
            let yf = y as f64;
            match region {
                None => this.spans.push((0, width as u32)),
                Some(Region::Rectangle([x0, y0, x1, y1])) => {
                    if !(x0 <= x1 && y0 <= y1) {
                        return Err(fault(format!("the rectangle [{x0}, {y0}, {x1}, {y1}] holds no area")));
                    }
                    if yf >= *y0 && yf <= *y1 {
                        this.push(*x0, *x1, width);
                    }
                }
                Some(Region::Polygon(corners)) => {
                    if corners.len() < 3 || corners.iter().flatten().any(|c| !c.is_finite()) {
                        return Err(fault(format!("the polygon has {} usable corners", corners.len())));
                    }
                    crossings.clear();
                    for (i, a) in corners.iter().enumerate() {
                        let b = &corners[(i + 1) % corners.len()];
                        // Half open, so that a corner on the row counts once.
                        if (a[1] <= yf) != (b[1] <= yf) {
                            crossings.push(a[0] + (yf - a[1]) / (b[1] - a[1]) * (b[0] - a[0]));
                        }
                    }
                    crossings.sort_unstable_by(f64::total_cmp);
                    for pair in crossings.chunks_exact(2) {
                        this.push(pair[0], pair[1], width);
                    }
                }
            }
            this.first.push(this.spans.len() as u32);
        }
        if this.spans.is_empty() {
            return Err(fault("no pixel lies inside it".into()));
        }
        Ok(this)
    }

    fn push(&mut self, x0: f64, x1: f64, width: usize) {
        let start = x0.ceil().max(0.0) as u32;
        let end = ((x1.floor() + 1.0).max(0.0) as u32).min(width as u32);
        if start < end {
            self.spans.push((start, end));
        }
    }

    /// The spans of row `y`.
    #[inline]
    pub fn row(&self, y: usize) -> &[(u32, u32)] {
        &self.spans[self.first[y] as usize..self.first[y + 1] as usize]
    }

    /// Whether pixel (x, y) is inside.
    pub fn holds(&self, x: usize, y: usize) -> bool {
        y + 1 < self.first.len() && self.row(y).iter().any(|&(a, b)| (a as usize..b as usize).contains(&x))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rectangle_holds_its_first_and_last_pixel() {
        let spans = Spans::new(Some(&Region::Rectangle([1.0, 2.0, 3.0, 3.0])), 6, 5).unwrap();
        let held: Vec<(usize, usize)> =
            (0..5).flat_map(|y| (0..6).map(move |x| (x, y))).filter(|&(x, y)| spans.holds(x, y)).collect();
        assert_eq!(held, [(1, 2), (2, 2), (3, 2), (1, 3), (2, 3), (3, 3)]);
    }

    #[test]
    fn a_polygon_with_a_notch_has_two_spans_in_a_row() {
        let corners = vec![[0.0, 0.0], [8.0, 0.0], [8.0, 8.0], [4.0, 2.5], [0.0, 8.0]];
        let spans = Spans::new(Some(&Region::Polygon(corners)), 9, 9).unwrap();
        assert_eq!(spans.row(1), [(0, 9)]);
        assert_eq!(spans.row(5).len(), 2);
        assert!(!spans.holds(4, 5) && spans.holds(0, 5) && spans.holds(8, 5));
    }

    #[test]
    fn a_region_outside_the_image_is_refused() {
        let text =
            Spans::new(Some(&Region::Rectangle([20.0, 2.0, 30.0, 3.0])), 6, 5).err().unwrap().to_string();
        assert!(text.contains("no pixel"), "{text}");
    }
}
