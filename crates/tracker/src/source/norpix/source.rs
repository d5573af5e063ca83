//! Reads the frames of a NorPix sequence: uncompressed pictures as they lie in the file, or JPEG pictures, each with the time
//! at which it was taken.
//!
//! Owns: [`NorpixSource`].

use std::collections::VecDeque;
use std::fs::File;
use std::io::Read;
use std::os::unix::fs::FileExt;

use rayon::prelude::*;

use super::header::{Form, HEADER_BYTES, Header};
use super::times;
use crate::error::{Error, Fault, FaultKind, Place, Result};
use crate::frame::{Bytes, Ending, Frame, FrameSource, PixelFormat, RateClaims, RateOrigin, SourceInfo};
use crate::message::Message;
use crate::pixel_aspect::PixelAspect;
use crate::pixel_damage::{self, PixelDamage};
use crate::source::images::picture_file;
use crate::source::raw::{RawFrames, Stored};
use crate::source::{OpenOptions, clock};

/// JPEG pictures decoded side by side at most.
const AHEAD: usize = 16;
/// Bytes between a JPEG picture's end and the length of the next: its time, and in some files as many zeros.
const GAPS: [u64; 2] = [8, 16];

/// Place of a picture in the file, and time at which it was taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Recorded {
    at: u64,
    length: usize,
    /// Microseconds since 1970.
    taken_us: u64,
}

/// A sequence.
pub struct NorpixSource {
    info: SourceInfo,
    form: Form,
    file: RawFrames,
    /// All whole pictures, in the order in which they were taken.
    pictures: Vec<Recorded>,
    /// Their times; `None` if these are their numbers.
    ticks: Option<Vec<i64>>,
    next: usize,
    ready: VecDeque<Frame>,
    /// How it ends when all is read.
    last: Ending,
    ending: Ending,
}

impl NorpixSource {
    /// Opens a sequence.
    ///
    /// # Errors
    /// [`Error::Source`] for a header that does not explain the pictures, or not one whole picture.
    pub fn open(name: &str, options: &OpenOptions) -> Result<Self> {
        let unreadable = |e: std::io::Error| {
            Error::Source(
                Fault::new(name, format!("the file cannot be read ({e})"))
                    .caused_by(&e)
                    .advice("Check its permissions"),
            )
        };
        let file = File::open(crate::name::path(name)).map_err(unreadable)?;
        let size = file.metadata().map_err(unreadable)?.len();
        let mut bytes = Vec::new();
        (&file).take(HEADER_BYTES as u64).read_to_end(&mut bytes).map_err(unreadable)?;
        let header = Header::parse(&bytes, name)?;
        let mut pictures = match header.form {
            Form::Raw { .. } => uncompressed(&file, &header, size),
            Form::Jpeg => compressed(&file, &header, size),
        }
        .map_err(unreadable)?;
        if pictures.is_empty() {
            let problem = format!(
                "not one whole picture: the file has {size} bytes, and pictures begin at {}",
                header.start
            );
            return Err(Error::Source(
                Fault::new(name, problem)
                    .of_kind(FaultKind::Damaged)
                    .at(Place::Byte(header.start))
                    .advice("Copy the recording again"),
            ));
        }
        let mut warnings = Vec::new();
        let times = timed(&header, &mut pictures, options, &mut warnings)?;
        if header.mosaic {
            warnings.push("the sensor has a colour mosaic; its samples are taken as brightness".into());
        }
        let last = ending(&header, &pictures, size, &mut warnings);
        let stored = match header.form {
            Form::Raw { stored, .. } => stored,
            Form::Jpeg => Stored::Plain,
        };
        let (pixel_aspect, pixel_aspect_origin) = options.aspect(PixelAspect::SQUARE);
        let file = RawFrames::new(file, name, stored);
        let (format, depth_bits, converted_from) = match header.form {
            Form::Raw { format, depth_bits, .. } => {
                let coloured = matches!(stored, Stored::Colour { .. });
                (format, depth_bits, coloured.then(|| "colours of 8 bit".to_owned()))
            }
            Form::Jpeg => (PixelFormat::Gray8, 8, converted_from(&file, &pictures)),
        };
        let info = SourceInfo {
            name: name.to_owned(),
            container: "NorPix sequence".into(),
            codec: codec(&header),
            width: header.width,
            height: header.height,
            pixel_aspect,
            pixel_aspect_origin,
            format,
            depth_bits,
            pixel_damage: pixel_damage_of(&header.form),
            declared_frames: (header.declared > 0).then_some(header.declared),
            time_base: times.time_base,
            rate_hz: times.rate_hz,
            rate_origin: times.rate_origin,
            claims: RateClaims::default(),
            converted_from,
            size_bytes: Some(size),
            details: details(&header),
            warnings,
        };
        Ok(Self {
            info,
            form: header.form,
            file,
            pictures,
            ticks: times.ticks,
            next: 0,
            ready: VecDeque::new(),
            last,
            ending: Ending::Complete,
        })
    }

    fn frame(&self, index: usize, stride: usize, plane: Option<Box<dyn Bytes>>) -> Frame {
        let ticks = self.ticks.as_ref().map_or(index as i64, |t| t[index]);
        Frame { stride, plane, ..self.info.frame(index as u64, ticks) }
    }

    /// The picture at `index`, read and decoded.
    fn decoded(&self, index: usize) -> Result<Frame> {
        let Recorded { at, length, .. } = self.pictures[index];
        let bytes = self.file.copy(index as u64, at, length)?;
        if let Form::Raw { stride, .. } = self.form {
            return Ok(self.frame(index, stride, Some(bytes)));
        }
        let size = (self.info.width, self.info.height, 8);
        let picture =
            picture_file::decode(bytes.bytes()).ok().filter(|p| (p.width, p.height, p.depth_bits) == size);
        Ok(self.frame(index, self.info.width as usize, picture.map(|p| Box::new(p.samples) as _)))
    }
}

/// The times of the pictures, which are put into the order in which they were taken.
fn timed(
    header: &Header,
    pictures: &mut [Recorded],
    options: &OpenOptions,
    warnings: &mut Vec<Message>,
) -> Result<times::Times> {
    let taken = |pictures: &[Recorded]| pictures.iter().map(|p| p.taken_us).collect::<Vec<u64>>();
    let oldest = times::oldest(&taken(pictures));
    if oldest > 0 {
        pictures.rotate_left(oldest);
        warnings.push(format!("recorded in a ring: by the time stamps picture {oldest} of the file is the oldest; pictures are read from there on").into());
    }
    let tick_us = if header.has_microseconds { 1 } else { 1000 };
    let mut times = match options.fps {
        Some(fps) => times::Times {
            time_base: clock::time_base(fps)?,
            rate_hz: Some(fps),
            rate_origin: RateOrigin::User,
            ticks: None,
            warnings: Vec::new(),
        },
        None => times::times(&taken(pictures), tick_us, header.rate_hz)?,
    };
    warnings.append(&mut times.warnings);
    Ok(times)
}

/// The form of JPEG pictures before they were made brightness: the first that can be decoded says whether there are colours.
fn converted_from(file: &RawFrames, pictures: &[Recorded]) -> Option<String> {
    let first = pictures.iter().take(AHEAD).find_map(|p| {
        let bytes = file.copy(0, p.at, p.length).ok()?;
        picture_file::decode(bytes.bytes()).ok()
    });
    first?.converted_from
}

/// Pictures of equal size, with their times behind them.
fn uncompressed(file: &File, header: &Header, size: u64) -> std::io::Result<Vec<Recorded>> {
    let whole = header.image_bytes + header.stamp_bytes();
    let there = size.checked_sub(header.start + whole).map_or(0, |rest| rest / header.step_bytes + 1);
    let count = if header.declared > 0 { there.min(header.declared) } else { there };
    let place = |i: u64| {
        let at = header.start + i * header.step_bytes;
        let taken_us = taken_us(file, header, at + header.image_bytes)?;
        Ok(Recorded { at, length: header.image_bytes as usize, taken_us })
    };
    (0..count).map(place).collect()
}

/// JPEG pictures, each behind its length, which counts itself.
fn compressed(file: &File, header: &Header, size: u64) -> std::io::Result<Vec<Recorded>> {
    let mut pictures = Vec::new();
    let mut next = Some(header.start);
    while let Some(at) = next {
        let Some(length) = jpeg_at(file, at, size)? else { break };
        let end = at + length;
        if end + header.stamp_bytes() > size
            || header.declared > 0 && pictures.len() as u64 == header.declared
        {
            break;
        }
        let taken_us = taken_us(file, header, end)?;
        pictures.push(Recorded { at: at + 4, length: (length - 4) as usize, taken_us });
        next = None;
        for gap in GAPS {
            if next.is_none() && jpeg_at(file, end + gap, size)?.is_some() {
                next = Some(end + gap);
            }
        }
    }
    Ok(pictures)
}

/// The length of a JPEG picture and of the number before it, if there is one at `at` that ends inside the file.
fn jpeg_at(file: &File, at: u64, size: u64) -> std::io::Result<Option<u64>> {
    if at + 6 > size {
        return Ok(None);
    }
    let mut head = [0; 6];
    file.read_exact_at(&mut head, at)?;
    let [a, b, c, d, 0xff, 0xd8] = head else { return Ok(None) };
    let length = u64::from(u32::from_le_bytes([a, b, c, d]));
    Ok((length > 6 && at + length <= size).then_some(length))
}

fn taken_us(file: &File, header: &Header, at: u64) -> std::io::Result<u64> {
    let mut stamp = [0; 8];
    file.read_exact_at(&mut stamp[..header.stamp_bytes() as usize], at)?;
    Ok(header.stamp_us(stamp))
}

/// The end of the sequence, held against its header.
fn ending(header: &Header, pictures: &[Recorded], size: u64, warnings: &mut Vec<Message>) -> Ending {
    let there = pictures.len() as u64;
    if header.declared == 0 {
        warnings
            .push("the header does not say how many frames there are: the recording was not closed".into());
    }
    if header.declared <= there {
        return Ending::Complete;
    }
    warnings.push(
        format!("the header declares {} frames, the file holds {there} ({size} bytes)", header.declared)
            .into(),
    );
    Ending::Early {
        frames: there,
        byte: Some(pictures.last().map_or(header.start, |p| p.at + p.length as u64)),
        reason: format!(
            "the file holds {there} whole frames of {} that its header declares",
            header.declared
        ),
    }
}

fn pixel_damage_of(form: &Form) -> PixelDamage {
    PixelDamage::of(if matches!(form, Form::Jpeg) { "jpeg" } else { pixel_damage::SAMPLES })
}

fn codec(header: &Header) -> String {
    match header.form {
        Form::Jpeg => "JPEG".into(),
        Form::Raw { stored: Stored::Colour { bytes, .. }, .. } => format!("colours in {bytes} bytes"),
        Form::Raw { format: PixelFormat::Gray16, .. } => "16 bit".into(),
        Form::Raw { .. } => "8 bit".into(),
    }
}

fn details(header: &Header) -> Vec<(String, String)> {
    let mut details = vec![("header version".to_owned(), header.version.to_string())];
    details.extend(header.rate_hz.map(|r| ("record rate".to_owned(), format!("{r} Hz"))));
    details.extend(header.description.clone().map(|d| ("description".to_owned(), d)));
    details
}

impl FrameSource for NorpixSource {
    fn info(&self) -> &SourceInfo {
        &self.info
    }

    fn next_frame(&mut self) -> Result<Option<Frame>> {
        if let Some(frame) = self.ready.pop_front() {
            return Ok(Some(frame));
        }
        if self.next == self.pictures.len() {
            self.ending = self.last.clone();
            return Ok(None);
        }
        if let Form::Raw { stride, .. } = self.form {
            let (index, Recorded { at, length, .. }) = (self.next, self.pictures[self.next]);
            self.next += 1;
            let plane = self.file.lend(index as u64, at, length);
            return Ok(Some(self.frame(index, stride, Some(plane))));
        }
        let range = self.next..(self.next + AHEAD).min(self.pictures.len());
        self.next = range.end;
        self.ready = range.into_par_iter().map(|i| self.decoded(i)).collect::<Result<_>>()?;
        Ok(self.ready.pop_front())
    }

    fn ending(&self) -> Ending {
        self.ending.clone()
    }

    fn stamps(&mut self) -> Result<Option<(Vec<i64>, bool)>> {
        Ok(self.ticks.clone().map(|ticks| (ticks, true)))
    }

    fn sample(&mut self, count: usize) -> Result<Vec<Frame>> {
        let all = self.pictures.len();
        let n = count.min(all);
        let spread: Vec<usize> = (0..n).map(|k| (2 * k + 1) * all / (2 * n)).collect();
        let frames: Vec<Frame> = spread.into_par_iter().map(|i| self.decoded(i)).collect::<Result<_>>()?;
        Ok(frames.into_iter().filter(|f| f.plane.is_some()).collect())
    }
}
