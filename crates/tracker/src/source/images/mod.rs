//! Pictures as a recording: a folder, a pattern, or the pages of a TIFF file.
//!
//! Owns: [`SequenceSource`], [`StackSource`].

pub mod names;
pub mod picture;
mod stack;

use std::collections::VecDeque;
use std::path::PathBuf;

use rayon::prelude::*;

use super::{OpenOptions, clock};
use crate::error::{Error, Fault, Result};
use crate::frame::{Ending, Frame, FrameSource, PixelFormat, RateClaims, RateOrigin, SourceInfo, TimeBase};
use crate::message::{Message, Setting};
use picture::Picture;
pub use stack::StackSource;

/// Bytes of pictures decoded ahead at most.
const AHEAD_BYTES: usize = 48 << 20;

/// Picture files in the order of their numbers.
pub struct SequenceSource {
    info: SourceInfo,
    files: Vec<Option<PathBuf>>,
    next_file: usize,
    batch: usize,
    ready: VecDeque<Frame>,
    damaged: Vec<String>,
    ending: Ending,
}

/// Time base, rate and its origin for pictures, which have no times of their own.
fn rate(options: &OpenOptions, warnings: &mut Vec<Message>) -> Result<(TimeBase, Option<f64>, RateOrigin)> {
    match options.fps {
        Some(fps) => Ok((clock::time_base(fps)?, Some(fps), RateOrigin::User)),
        None => {
            warnings.push("pictures have no rate; times are frame numbers. Give it with " + Setting::Fps);
            Ok((TimeBase { numerator: 1, denominator: 1 }, None, RateOrigin::Unknown))
        }
    }
}

fn format(depth_bits: u32) -> PixelFormat {
    if depth_bits > 8 { PixelFormat::Gray16 } else { PixelFormat::Gray8 }
}

/// The frame of a picture, if its size and depth are the recording's.
fn frame(info: &SourceInfo, index: u64, picture: Option<Picture>) -> Frame {
    let bytes = if info.depth_bits > 8 { 2 } else { 1 };
    let fits = |p: &Picture| {
        (p.width, p.height, p.depth_bits) == (info.width, info.height, info.depth_bits)
            && p.samples.len() >= p.width as usize * p.height as usize * bytes
    };
    Frame {
        index,
        ticks: index as i64,
        width: info.width,
        height: info.height,
        stride: info.width as usize * bytes,
        format: info.format,
        depth_bits: info.depth_bits,
        plane: picture.filter(fits).map(|p| Box::new(p.samples) as _),
    }
}

impl SequenceSource {
    /// Opens a folder or a pattern.
    ///
    /// # Errors
    /// [`Error::Source`] if there are no pictures or none can be read.
    pub fn open(name: &str, options: &OpenOptions) -> Result<Self> {
        let numbered = names::list(name)?;
        let mut warnings = numbered.warnings;
        let files = numbered.files;
        let mut problem = None;
        // Its size is that of the first that can be read.
        let first = files.iter().flatten().take(16).find_map(|path| {
            picture::read(path)
                .map_err(|e| problem.get_or_insert_with(|| (path.clone(), e)).1.len())
                .ok()
                .map(|p| (path, p))
        });
        let Some((path, first)) = first else {
            let (path, problem) = problem.unwrap_or_default();
            return Err(Error::Source(
                Fault::new(path.display(), problem).advice("Check that the pictures were copied whole"),
            ));
        };
        let (time_base, rate_hz, rate_origin) = rate(options, &mut warnings)?;
        let ending = path.extension().map_or(String::new(), |e| e.to_string_lossy().to_lowercase());
        let size_bytes = files.iter().flatten().map(|f| std::fs::metadata(f).map_or(0, |m| m.len())).sum();
        let info = SourceInfo {
            name: name.to_owned(),
            container: "pictures".into(),
            codec: ending,
            width: first.width,
            height: first.height,
            format: format(first.depth_bits),
            depth_bits: first.depth_bits,
            declared_frames: Some(files.len() as u64),
            time_base,
            rate_hz,
            rate_origin,
            claims: RateClaims::default(),
            converted_from: first.converted_from,
            size_bytes: Some(size_bytes),
            details: Vec::new(),
            warnings,
        };
        let batch = (AHEAD_BYTES / first.samples.len().max(1)).clamp(1, 2 * threads::count());
        Ok(Self {
            info,
            files,
            next_file: 0,
            batch,
            ready: VecDeque::new(),
            damaged: Vec::new(),
            ending: Ending::Complete,
        })
    }

    /// Decodes the next few pictures side by side.
    fn read_batch(&mut self) {
        let end = (self.next_file + self.batch).min(self.files.len());
        let range = self.next_file..end;
        let read = |path: &Option<PathBuf>| path.as_ref().map(|p| picture::read(p));
        let files = &self.files[range.clone()];
        let pictures: Vec<_> = threads::install(|| files.par_iter().map(read).collect());
        for (index, picture) in range.zip(pictures) {
            let picture =
                picture.and_then(|p| p.map_err(|e| self.damaged.push(format!("picture {index}: {e}"))).ok());
            self.ready.push_back(frame(&self.info, index as u64, picture));
        }
        self.next_file = end;
    }

    /// At the end: if the last pictures cannot be read, the recording ended before them.
    fn trim(&mut self) {
        let whole = self.files.len();
        let lost = self.ready.iter().rev().take_while(|f| f.plane.is_none()).count();
        if self.next_file == whole && lost > 0 {
            self.ready.truncate(self.ready.len() - lost);
            let frames = (whole - lost) as u64;
            let reason =
                self.damaged.last().cloned().unwrap_or_else(|| "the last pictures do not fit".to_owned());
            self.ending = Ending::Early { frames, byte: None, reason };
        }
    }
}

impl FrameSource for SequenceSource {
    fn info(&self) -> &SourceInfo {
        &self.info
    }

    fn next_frame(&mut self) -> Result<Option<Frame>> {
        // A frame without pixels waits until it is known whether a good one follows.
        while self.next_file < self.files.len() && self.ready.iter().all(|f| f.plane.is_none()) {
            self.read_batch();
            if self.next_file == self.files.len() {
                self.trim();
            }
        }
        Ok(self.ready.pop_front())
    }

    fn ending(&self) -> Ending {
        self.ending.clone()
    }

    fn sample(&mut self, count: usize) -> Result<Vec<Frame>> {
        let there: Vec<&PathBuf> = self.files.iter().flatten().collect();
        let n = count.min(there.len());
        let spread: Vec<&PathBuf> = (0..n).map(|k| there[(2 * k + 1) * there.len() / (2 * n)]).collect();
        let pictures: Vec<_> =
            threads::install(|| spread.par_iter().map(|p| picture::read(p).ok()).collect());
        let frames = pictures.into_iter().enumerate().map(|(i, p)| frame(&self.info, i as u64, p));
        Ok(frames.filter(|f| f.plane.is_some()).collect())
    }
}
