//! The work pictures of a recording: every frame at the size at which moving markers are sought, in a temporary file.
//!
//! Owns: [`WorkFilm`]. Must not: find anything.

use std::fs::File;
use std::io::Write;
use std::ops::Range;
use std::os::unix::fs::FileExt;

use super::picture::{Film, Picture};
use crate::error::{Error, Fault, FaultKind, Result};
use crate::frame::{Ending, Frame, FrameSource};
use crate::gaps::Damage;
use crate::gray::gray8;
use crate::stop::Stop;
use crate::store::FrameStamp;

/// Longer side of a work picture, px: a marker of a pixel of it is too small to be told from noise.
const WORK_SIDE_PX: usize = 800;
/// Work pictures of a recording, bytes at most: a temporary file of that size still fits most disks.
const MOST_BYTES: u64 = 4 << 30;
/// A frame that differs less from the one before it than this part of what nine of ten do is a copy of it: screen recorders
/// and some converters repeat frames, and a motion model cannot work on a clock that stutters.
const COPY_PART: f64 = 0.02;
const COPY_QUANTILE: f64 = 0.9;
/// Distance of the pixels that are compared for that.
const COPY_STRIDE: usize = 7;
/// A colour difference farther than this from grey is colour, and not the rounding of a grey film's encoder.
const COLOUR_FROM: u8 = 4;

/// The work pictures of a recording; copies of the frame before are left out.
pub struct WorkFilm<'a> {
    file: File,
    width: usize,
    height: usize,
    /// Pixels of the recording along one pixel of a work picture.
    shrink: usize,
    has_colour: bool,
    /// Stamps of all frames.
    stamps: Vec<FrameStamp>,
    /// For each decoded frame its place among the stamps.
    decoded: Vec<usize>,
    /// For each picture its place among the decoded frames.
    kept: Vec<usize>,
    ending: Ending,
    damage: Damage,
    stop: &'a Stop,
}

impl<'a> WorkFilm<'a> {
    /// Reads the given frames of a recording; `progress` is told the index of each.
    ///
    /// # Errors
    /// Those of the source; [`Error::Source`] where the recording is too long to be kept or the temporary file cannot be
    /// written; [`Error::Interrupted`] once `stop` was asked for.
    pub fn read(
        source: &mut dyn FrameSource,
        frames: Range<u64>,
        stop: &'a Stop,
        progress: &mut dyn FnMut(u64),
    ) -> Result<Self> {
        let (w, h) = (source.info().width as usize, source.info().height as usize);
        let mut shrink = 1;
        while w.max(h) / shrink > WORK_SIDE_PX {
            shrink *= 2;
        }
        let file = tempfile::tempfile().map_err(|e| unusable(&e))?;
        let mut film = Self {
            file,
            width: w / shrink,
            height: h / shrink,
            shrink,
            has_colour: false,
            stamps: Vec::new(),
            decoded: Vec::new(),
            kept: Vec::new(),
            ending: Ending::Complete,
            damage: Damage::default(),
            stop,
        };
        let mut differences = Vec::new();
        let mut before: Vec<u8> = Vec::new();
        loop {
            stop.heed()?;
            let Some(frame) = source.next_frame()? else {
                film.ending = source.ending();
                break;
            };
            if frame.index >= frames.end {
                break;
            }
            if frame.index < frames.start {
                continue;
            }
            progress(frame.index);
            let decoded = frame.plane.is_some();
            film.stamps.push(FrameStamp { index: frame.index, ticks: frame.ticks, decoded });
            if decoded {
                let luma = shrunk(&gray8(&frame)?, w, h, shrink);
                film.push(&frame, &luma)?;
                differences.push(mean_difference(&before, &luma));
                before = luma;
            }
        }
        film.damage.gaps = source.gaps().within(&frames);
        film.damage.reasons = source.reasons();
        film.damage.reasons.retain(|r| frames.contains(&r.frame));
        film.stamps.iter().filter(|s| !s.decoded).for_each(|s| film.damage.undecoded.push(s.index));
        film.kept = without_copies(&differences);
        Ok(film)
    }

    /// Adds a decoded frame, the last one of the stamps.
    fn push(&mut self, frame: &Frame, luma: &[u8]) -> Result<()> {
        if (self.decoded.len() as u64 + 1) * self.picture_bytes() as u64 > MOST_BYTES {
            return Err(Error::Source(
                Fault::new(
                    "recording",
                    format!(
                        "its first {} frames fill the {} GiB for work pictures",
                        self.decoded.len(),
                        MOST_BYTES >> 30
                    ),
                )
                .of_kind(FaultKind::Unsupported)
                .advice("Give a part of it"),
            ));
        }
        let mut bytes = luma.to_vec();
        match &frame.colour {
            Some(planes) => {
                let (w, h) = (frame.width as usize, frame.height as usize);
                for plane in planes {
                    self.has_colour |=
                        plane.iter().step_by(COPY_STRIDE).any(|c| c.abs_diff(128) > COLOUR_FROM);
                    bytes.extend(shrunk(plane, w, h, 2 * self.shrink));
                }
            }
            None => bytes.resize(self.picture_bytes(), 128),
        }
        self.file.write_all(&bytes).map_err(|e| unusable(&e))?;
        self.decoded.push(self.stamps.len() - 1);
        Ok(())
    }

    /// Bytes of brightness at work size and two colour differences at half of it.
    fn picture_bytes(&self) -> usize {
        self.width * self.height + 2 * self.colour_size()
    }

    fn colour_size(&self) -> usize {
        (self.width / 2) * (self.height / 2)
    }

    /// Rows of a plane that begins at a byte of the file.
    fn rows(&self, start: u64, width: usize, rows: Range<usize>) -> Result<Vec<u8>> {
        let mut bytes = vec![0; rows.len() * width];
        let start = start + (rows.start * width) as u64;
        self.file.read_exact_at(&mut bytes, start).map_err(|e| unusable(&e))?;
        Ok(bytes)
    }

    /// A part of a plane of half the size, at full size: each of its pixels twice along both sides.
    fn colour(&self, start: u64, x: &Range<usize>, y: &Range<usize>) -> Result<Vec<u8>> {
        let (w, h) = (self.width / 2, self.height / 2);
        let last = |n: usize| n.saturating_sub(1);
        let half = |r: &Range<usize>, n: usize| (r.start / 2).min(last(n))..(r.end.div_ceil(2)).min(n);
        let (columns, rows) = (half(x, w), half(y, h));
        let plane = self.rows(start, w, rows.clone())?;
        let part: Vec<u8> = plane.chunks(w.max(1)).flat_map(|r| r[columns.clone()].iter().copied()).collect();
        Ok(doubled(&part, (columns.start, columns.len()), (rows.start, rows.len()), x, y))
    }

    /// Stamps of all frames read.
    pub fn stamps(&self) -> &[FrameStamp] {
        &self.stamps
    }

    /// The end of the recording.
    pub fn ending(&self) -> &Ending {
        &self.ending
    }

    /// Frames that are not there between those that were read.
    pub fn damage(&self) -> &Damage {
        &self.damage
    }

    /// A place in a work picture as a place in the recording, px: pixel centres are at integers in both.
    pub fn recorded_px(&self, px: f64) -> f64 {
        (px + 0.5) * self.shrink as f64 - 0.5
    }

    /// Pixels of the recording along one pixel of a work picture.
    pub fn shrink(&self) -> usize {
        self.shrink
    }

    /// Places among the stamps of the frames that a picture stands for: its own and the copies that follow it.
    pub fn frames(&self, picture: usize) -> &[usize] {
        let end = self.kept.get(picture + 1).copied().unwrap_or(self.decoded.len());
        &self.decoded[self.kept[picture]..end]
    }

    /// The picture that shows a frame of the recording; `None` where it was not read or not decoded.
    pub fn picture_of(&self, frame: u64) -> Option<usize> {
        let stamp = self.stamps.iter().position(|s| s.index == frame)?;
        let decoded = self.decoded.binary_search(&stamp).ok()?;
        self.kept.partition_point(|&k| k <= decoded).checked_sub(1)
    }

    /// A place in the recording as a place in a work picture, px.
    pub fn work_px(&self, recorded_px: f64) -> f64 {
        (recorded_px + 0.5) / self.shrink as f64 - 0.5
    }

    /// Number of pictures.
    pub fn pictures(&self) -> usize {
        self.kept.len()
    }

    /// The frame of the recording that a picture shows.
    pub fn frame_of(&self, picture: usize) -> u64 {
        self.kept.get(picture).map_or(0, |&k| self.stamps[self.decoded[k]].index)
    }

    /// Frames that are copies of the one before them.
    pub fn copies(&self) -> usize {
        self.decoded.len() - self.kept.len()
    }

    /// Frames that were decoded.
    pub fn decoded(&self) -> usize {
        self.decoded.len()
    }
}

impl Film for WorkFilm<'_> {
    fn count(&self) -> usize {
        self.kept.len()
    }

    fn read(&self, index: usize) -> Result<Picture> {
        self.read_part(index, 0..self.width, 0..self.height)
    }

    fn read_part(&self, index: usize, x: Range<usize>, y: Range<usize>) -> Result<Picture> {
        let x = x.start.min(self.width)..x.end.min(self.width);
        let y = y.start.min(self.height)..y.end.min(self.height);
        let (width, height) = (x.len(), y.len());
        let start = self.kept[index] as u64 * self.picture_bytes() as u64;
        let luma = self.rows(start, self.width, y.clone())?;
        let luma = if width == self.width {
            luma
        } else {
            luma.chunks(self.width.max(1)).flat_map(|row| row[x.clone()].iter().copied()).collect()
        };
        let chroma = if self.has_colour {
            let start = start + (self.width * self.height) as u64;
            Some([self.colour(start, &x, &y)?, self.colour(start + self.colour_size() as u64, &x, &y)?])
        } else {
            None
        };
        Ok(Picture { width, height, luma, chroma })
    }

    fn heed(&self) -> Result<()> {
        self.stop.heed()
    }
}

fn unusable(error: &std::io::Error) -> Error {
    Error::Source(
        Fault::new("work pictures", format!("the temporary file cannot be used ({error})"))
            .caused_by(error)
            .advice("Make room on the disk of temporary files"),
    )
}

/// A plane of `w` x `h` pixels, each pixel the mean of `by` x `by`.
fn shrunk(plane: &[u8], width: usize, height: usize, by: usize) -> Vec<u8> {
    if by == 1 {
        return plane.to_vec();
    }
    let (w, h) = (width / by, height / by);
    let area = (by * by) as u32;
    let mut out = Vec::with_capacity(w * h);
    for y in 0..h {
        for x in 0..w {
            let rows = (y * by..(y + 1) * by).map(|r| &plane[r * width + x * by..][..by]);
            let sum: u32 = rows.flatten().map(|&v| u32::from(v)).sum();
            out.push(((sum + area / 2) / area) as u8);
        }
    }
    out
}

/// The part `x`, `y` at full size of a plane of half the size, of which the columns and rows from one on are given, so many. Each pixel
/// is there twice along both sides; an odd last one is the last pixel once more.
fn doubled(
    part: &[u8],
    (first_column, w): (usize, usize),
    (first_row, h): (usize, usize),
    x: &Range<usize>,
    y: &Range<usize>,
) -> Vec<u8> {
    let at = |k: usize, first: usize, n: usize| (k / 2).saturating_sub(first).min(n.saturating_sub(1));
    let mut out = Vec::with_capacity(x.len() * y.len());
    for row in y.clone() {
        let row = &part[at(row, first_row, h) * w..][..w];
        out.extend(x.clone().map(|x| row[at(x, first_column, w)]));
    }
    out
}

fn mean_difference(before: &[u8], now: &[u8]) -> f64 {
    if before.is_empty() {
        return f64::INFINITY;
    }
    let pairs = before.iter().zip(now).step_by(COPY_STRIDE);
    let (sum, count) = pairs.fold((0u64, 0u64), |(s, n), (a, b)| (s + u64::from(a.abs_diff(*b)), n + 1));
    sum as f64 / count.max(1) as f64
}

/// Places of the frames that are not copies, from the mean difference of each from the one before.
fn without_copies(differences: &[f64]) -> Vec<usize> {
    let mut sorted: Vec<f64> = differences.iter().copied().filter(|d| d.is_finite()).collect();
    sorted.sort_unstable_by(f64::total_cmp);
    let top = sorted.get((sorted.len() as f64 * COPY_QUANTILE) as usize).copied().unwrap_or(0.0);
    (0..differences.len()).filter(|&k| differences[k] >= COPY_PART * top).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn copies_are_told_from_frames_that_differ() {
        let d = [f64::INFINITY, 5.0, 0.0, 0.02, 6.0, 0.0, 4.0];
        assert_eq!(without_copies(&d), [0, 1, 4, 6]);
        // Where nothing moves nothing is a copy: all frames are alike.
        assert_eq!(without_copies(&[f64::INFINITY, 0.0, 0.0]), [0, 1, 2]);
    }

    #[test]
    fn colour_at_half_the_size_comes_back_at_its_place() {
        // Columns of two pixels, an odd width.
        let plane = [10, 10, 20, 20, 30, 10, 10, 20, 20, 30];
        let half = shrunk(&plane, 5, 2, 2);
        assert_eq!(half, [10, 20]);
        let whole = doubled(&half, (0, 2), (0, 1), &(0..5), &(0..2));
        assert_eq!(whole, [10, 10, 20, 20, 20, 10, 10, 20, 20, 20]);
        // The second of the two columns alone, and the odd last place.
        assert_eq!(doubled(&[20], (1, 1), (0, 1), &(3..5), &(1..2)), [20, 20]);
    }
}
