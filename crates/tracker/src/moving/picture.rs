//! The work picture of a frame: brightness and colour at the size at which moving markers are sought.
//!
//! Owns: [`Picture`], [`Film`]. Must not: decode.

use std::ops::Range;

use crate::error::Result;

/// A frame at work size. Colour differences are stored about 128, as in YCbCr with full range.
#[derive(Debug, Clone, Default)]
pub struct Picture {
    /// Width, px.
    pub width: usize,
    /// Height, px.
    pub height: usize,
    /// Luma, row by row.
    pub luma: Vec<u8>,
    /// Blue and red colour difference, row by row; `None` in a grey recording.
    pub chroma: Option<[Vec<u8>; 2]>,
}

/// Work pictures of a whole recording, read in any order.
pub trait Film: Sync {
    /// Number of pictures.
    fn count(&self) -> usize;
    /// Reads one of them.
    ///
    /// # Errors
    /// That of the medium.
    fn read(&self, index: usize) -> Result<Picture>;
    /// Reads a part of one of them: its columns `x` and rows `y`, as far as they are there.
    ///
    /// # Errors
    /// That of the medium.
    fn read_part(&self, index: usize, x: Range<usize>, y: Range<usize>) -> Result<Picture> {
        let whole = self.read(index)?;
        let within = |r: Range<usize>, n: usize| (r.start.min(n), r.end.min(n));
        Ok(whole.part(within(x, whole.width), within(y, whole.height)))
    }
    /// Goes on, or not; asked at every picture.
    ///
    /// # Errors
    /// [`crate::error::Error::Interrupted`] once the work is to stop.
    fn heed(&self) -> Result<()>;
}

impl Picture {
    /// The part from column `x0` to before `x1` and from row `y0` to before `y1`.
    pub fn part(&self, (x0, x1): (usize, usize), (y0, y1): (usize, usize)) -> Self {
        let take = |plane: &[u8]| -> Vec<u8> {
            (y0..y1).flat_map(|y| plane[y * self.width + x0..y * self.width + x1].iter().copied()).collect()
        };
        Self {
            width: x1.saturating_sub(x0),
            height: y1.saturating_sub(y0),
            luma: take(&self.luma),
            chroma: self.chroma.as_ref().map(|[b, r]| [take(b), take(r)]),
        }
    }
}
