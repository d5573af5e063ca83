//! Reads a folder of pictures, or those that a pattern fits, as frames.
//!
//! Owns: [`SequenceSource`].

use std::collections::VecDeque;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::picture::{Alike, Picture, format, frame, other_kind, other_size, rate};
use super::{names, picture_file, pixel_size};
use crate::error::{Error, Fault, FaultKind, Result};
use crate::frame::{Ending, Frame, FrameSource, RateClaims, SourceInfo};
use crate::gaps::{Reason, keep_reason};
use crate::message::Message;
use crate::name::text;
use crate::pixel_damage::PixelDamage;
use crate::source::OpenOptions;

/// Bytes of pictures decoded ahead at most.
const AHEAD_BYTES: usize = 48 << 20;
/// Number of pictures, spread over the sequence, of which most must agree on a size.
const LOOKED_AT: usize = 9;
/// Number of pictures that are tried, from the first on, if none of those can be read.
const LOOKED_FOR: usize = 16;

/// Picture files in the order of their numbers.
pub struct SequenceSource {
    info: SourceInfo,
    alike: Alike,
    files: Vec<Option<PathBuf>>,
    next_file: usize,
    batch: usize,
    ready: VecDeque<Frame>,
    /// Why frames are empty.
    empty: Vec<Reason>,
    /// Why the last of them is.
    last_empty: String,
    ending: Ending,
}

/// Width and height in px, and depth in bits.
fn kind(picture: &Picture) -> (u32, u32, u32) {
    (picture.width, picture.height, picture.depth_bits)
}

/// Of pictures that were looked at no kind is that of most: which kinds there are, and which files are of each.
fn several_sizes(folder: &str, pictures: &[(usize, &PathBuf, Picture)]) -> Error {
    let mut kinds: Vec<((u32, u32, u32), Vec<String>)> = Vec::new();
    for (_, path, picture) in pictures {
        match kinds.iter_mut().find(|(known, _)| *known == kind(picture)) {
            Some((_, names)) => names.push(file_name(path)),
            None => kinds.push((kind(picture), vec![file_name(path)])),
        }
    }
    let depths = kinds.iter().any(|(k, _)| k.2 != kinds[0].0.2);
    let words = kinds.iter().map(|((width, height, bits), names)| {
        let depth = if depths { format!(" of {bits} bits") } else { String::new() };
        let more = if names.len() > 2 { ", ..." } else { "" };
        format!("{width} x {height} px{depth} as {}{more}", names[..names.len().min(2)].join(", "))
    });
    let words: Vec<String> = words.collect();
    Error::Source(
        Fault::new(folder, format!("its pictures are of several sizes, none of which most have: {}", words.join("; ")))
            .advice("Give those of one size as a pattern, such as 'frames/img_%05d.png', or move them to a folder of their own"),
    )
}

/// A picture of the size and depth that most pictures have, and its file. The first one may be a small copy, which is said.
fn size_of_most<'a>(
    name: &str,
    there: &[(usize, &'a PathBuf)],
    warnings: &mut Vec<Message>,
) -> Result<(Picture, &'a PathBuf)> {
    let n = there.len().min(LOOKED_AT);
    // The first and the last are among them.
    let spread = (0..n).map(|k| there[k * (there.len() - 1) / (n - 1).max(1)]);
    let mut problem = None;
    let mut readable = |(index, path): (usize, &'a PathBuf)| match picture_file::read(path) {
        Ok(picture) => Some((index, path, picture)),
        Err(e) => {
            problem.get_or_insert((path, e));
            None
        }
    };
    let mut pictures: Vec<_> = spread.filter_map(&mut readable).collect();
    if pictures.is_empty() {
        pictures.extend(there.iter().copied().take(LOOKED_FOR).find_map(readable));
    }
    let like = |p: &Picture| pictures.iter().filter(|(.., other)| kind(other) == kind(p)).count();
    // Of several as many, the first.
    let Some(best) = (0..pictures.len()).rev().max_by_key(|i| like(&pictures[*i].2)) else {
        let (path, problem) = problem.map_or_else(Default::default, |(p, e)| (p.display().to_string(), e));
        return Err(Error::Source(Fault::new(path, problem).of_kind(FaultKind::Damaged).advice(
            "Check that the pictures were copied whole, or save them as gray of 8 or 16 bit; a file with several pictures is given by \
             itself, without its folder",
        )));
    };
    let usual = &pictures[best].2;
    if 2 * like(usual) <= pictures.len() {
        return Err(several_sizes(name, &pictures));
    }
    for (index, path, odd) in pictures.iter().filter(|(.., p)| kind(p) != kind(usual)) {
        let size = other_size(&file_name(path), kind(odd), kind(usual));
        warnings.push(format!("frame {index}: {size}: such a frame stays empty").into());
    }
    let (_, path, picture) = pictures.swap_remove(best);
    Ok((picture, path))
}

/// The last part of a path, as text.
pub(super) fn file_name(path: &Path) -> String {
    text(path.file_name().unwrap_or_default())
}

/// A file and the picture in it, or what is wrong; `None` where the numbering leaves one out.
fn read(file: &Option<PathBuf>) -> Option<(&PathBuf, std::result::Result<Picture, String>)> {
    file.as_ref().map(|path| (path, picture_file::read(path)))
}

impl SequenceSource {
    /// Opens a folder or a pattern.
    ///
    /// # Errors
    /// [`Error::Source`] if there are no pictures or none can be read.
    pub fn open(name: &str, options: &OpenOptions) -> Result<Self> {
        Self::over(name, names::list(name)?, options)
    }

    fn over(name: &str, numbered: names::Numbered, options: &OpenOptions) -> Result<Self> {
        let mut warnings = numbered.warnings;
        let files = numbered.files;
        let there: Vec<(usize, &PathBuf)> =
            files.iter().enumerate().filter_map(|(i, f)| f.as_ref().map(|p| (i, p))).collect();
        let (first, path) = size_of_most(name, &there, &mut warnings)?;
        let (time_base, rate_hz, rate_origin) = rate(options, &mut warnings)?;
        let ending = path.extension().map_or(String::new(), |e| e.to_string_lossy().to_lowercase());
        let size_bytes = files.iter().flatten().map(|f| std::fs::metadata(f).map_or(0, |m| m.len())).sum();
        let (pixel_aspect, pixel_aspect_origin) =
            options.aspect(pixel_size::aspect(first.pixel_size, &mut warnings));
        warnings.extend(first.orientation.warning());
        let alike = Alike {
            orientation: first.orientation,
            aspect: Some(pixel_aspect).filter(|_| pixel_aspect_origin.is_recording()),
        };
        let info = SourceInfo {
            name: name.to_owned(),
            container: "pictures".into(),
            codec: ending.clone(),
            width: first.width,
            height: first.height,
            pixel_aspect,
            pixel_aspect_origin,
            format: format(first.depth_bits),
            depth_bits: first.depth_bits,
            pixel_damage: PixelDamage::of(&ending),
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
            alike,
            files,
            next_file: 0,
            batch,
            ready: VecDeque::new(),
            empty: Vec::new(),
            last_empty: String::new(),
            ending: Ending::Complete,
        })
    }

    /// A picture file alone.
    ///
    /// # Errors
    /// As for [`SequenceSource::open`].
    pub fn open_one(name: &str, options: &OpenOptions) -> Result<Self> {
        Self::over(
            name,
            names::Numbered { files: vec![Some(PathBuf::from(name))], warnings: Vec::new() },
            options,
        )
    }

    /// Decodes the next few pictures side by side.
    ///
    /// # Errors
    /// [`Error::Source`] if one is to be looked at otherwise than the others.
    fn read_batch(&mut self) -> Result<()> {
        let end = (self.next_file + self.batch).min(self.files.len());
        let range = self.next_file..end;
        let files = &self.files[range.clone()];
        let pictures: Vec<_> = threads::install(|| files.par_iter().map(read).collect());
        for (index, picture) in range.zip(pictures) {
            let (picture, problem) = match picture {
                Some((path, Ok(picture))) => {
                    if self.is_one_of_them(&picture) {
                        self.alike.check(&text(path), index as u64, &picture)?;
                    }
                    let problem = other_kind(&file_name(path), &picture, &self.info);
                    (Some(picture), problem)
                }
                Some((path, Err(e))) => (None, format!("{}: {e}", file_name(path))),
                None => (None, "no picture has its number".to_owned()),
            };
            let frame = frame(&self.info, index as u64, picture);
            if frame.plane.is_none() {
                self.last_empty.clone_from(&problem);
                keep_reason(&mut self.empty, frame.index, problem);
            }
            self.ready.push_back(frame);
        }
        self.next_file = end;
        Ok(())
    }

    /// Whether a picture has the size of the others as it is stored; else its frame stays empty.
    fn is_one_of_them(&self, picture: &Picture) -> bool {
        let [own, others] = [(picture.width, picture.height), (self.info.width, self.info.height)];
        own == others
            || picture.orientation.transposed != self.alike.orientation.transposed
                && own == (others.1, others.0)
    }

    /// At the end: if the last pictures cannot be read, the recording ended before them.
    fn trim(&mut self) {
        let whole = self.files.len();
        let lost = self.ready.iter().rev().take_while(|f| f.plane.is_none()).count();
        if self.next_file == whole && lost > 0 {
            self.ready.truncate(self.ready.len() - lost);
            let frames = (whole - lost) as u64;
            self.empty.retain(|reason| reason.frame < frames);
            self.ending = Ending::Early { frames, byte: None, reason: std::mem::take(&mut self.last_empty) };
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
            self.read_batch()?;
            if self.next_file == self.files.len() {
                self.trim();
            }
        }
        Ok(self.ready.pop_front())
    }

    fn ending(&self) -> Ending {
        self.ending.clone()
    }

    fn reasons(&self) -> Vec<Reason> {
        self.empty.clone()
    }

    fn sample(&mut self, count: usize) -> Result<Vec<Frame>> {
        let there: Vec<&PathBuf> = self.files.iter().flatten().collect();
        let n = count.min(there.len());
        let spread: Vec<&PathBuf> = (0..n).map(|k| there[(2 * k + 1) * there.len() / (2 * n)]).collect();
        let pictures: Vec<_> =
            threads::install(|| spread.par_iter().map(|p| picture_file::read(p).ok()).collect());
        let frames = pictures.into_iter().enumerate().map(|(i, p)| frame(&self.info, i as u64, p));
        Ok(frames.filter(|f| f.plane.is_some()).collect())
    }
}
