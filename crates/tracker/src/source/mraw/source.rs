//! Reads the frames of a Photron recording.
//!
//! Owns: [`MrawSource`]. Must not: unpack pixels; frames are handed out as they lie in the file.
//! The one exception is 16-bit with the significant bits on top, which is moved down.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::fields::{Header, Packing};
use super::pair::{Pair, pair};
use crate::error::{Error, Fault, FaultKind, Result};
use crate::frame::{
    Bytes, Ending, Frame, FrameSource, PixelFormat, RateClaims, RateOrigin, SourceInfo, TimeBase,
};
use crate::message::Setting;
use crate::pixel_aspect::PixelAspect;
use crate::pixel_damage::{self, PixelDamage};
use crate::source::raw::{RawFrames, Stored};
use crate::source::{OpenOptions, clock};

/// Longest header that is read; real ones have some kB.
const HEADER_BYTES: u64 = 16 << 20;

/// A Photron recording.
pub struct MrawSource {
    info: SourceInfo,
    pixels: RawFrames,
    packing: Packing,
    /// Whole frames in the file, up to those declared.
    frames: u64,
    next: u64,
    ending: Ending,
}

fn unreadable(path: &Path, error: &std::io::Error) -> Error {
    Error::Source(
        Fault::new(path.display(), format!("the file cannot be read ({error})"))
            .caused_by(error)
            .advice("Check its permissions"),
    )
}

impl MrawSource {
    /// Opens a pair by either of its files.
    ///
    /// # Errors
    /// [`Error::Source`] for a missing partner, a header that does not explain the pixels, or not one whole frame.
    pub fn open(name: &str, options: &OpenOptions) -> Result<Self> {
        let Pair { header: header_path, pixels: pixels_path } = pair(name)?;
        let mut bytes = Vec::new();
        File::open(&header_path)
            .and_then(|f| f.take(HEADER_BYTES).read_to_end(&mut bytes))
            .map_err(|e| unreadable(&header_path, &e))?;
        let header_name = header_path.display().to_string();
        let header = Header::parse(&bytes, &header_name)?;
        let packing = header.packing(&header_name)?;

        let file = File::open(&pixels_path).map_err(|e| unreadable(&pixels_path, &e))?;
        let size = file.metadata().map_err(|e| unreadable(&pixels_path, &e))?.len();
        let there = size / packing.frame_bytes;
        let frames = header.total_frames.map_or(there, |n| n.min(there));
        if frames == 0 {
            return Err(Error::Source(
                Fault::new(
                    pixels_path.display(),
                    format!("not one whole frame: {size} bytes, and one takes {}", packing.frame_bytes),
                )
                .of_kind(FaultKind::Damaged)
                .advice("Copy the recording again, or check that the header is the right one"),
            ));
        }
        let mut info = info(name, &header, &packing, options)?;
        info.size_bytes = Some(size);
        match header.total_frames {
            Some(n) if n > there => info.warnings.push(
                format!(
                    "the header declares {n} frames ({} bytes), the file holds {there} ({size} bytes)",
                    u128::from(n) * u128::from(packing.frame_bytes)
                )
                .into(),
            ),
            Some(_) if size > frames * packing.frame_bytes => info.warnings.push(
                format!(
                    "the file has {} bytes more than the frames that its header declares; they are not read",
                    size - frames * packing.frame_bytes
                )
                .into(),
            ),
            None => info.warnings.push("the header does not say how many frames there are".into()),
            Some(_) => {}
        }
        let stored = match packing.shift {
            0 => Stored::Plain,
            shift => Stored::Words { big_endian: false, shift, inverted: false },
        };
        let pixels = RawFrames::new(file, &pixels_path.display().to_string(), stored);
        Ok(Self { info, pixels, packing, frames, next: 0, ending: Ending::Complete })
    }

    /// The place at which the frame at `index` begins in the file, and the number of its bytes.
    fn place(&self, index: u64) -> (u64, usize) {
        (index * self.packing.frame_bytes, self.packing.frame_bytes as usize)
    }

    fn frame(&self, index: u64, plane: Box<dyn Bytes>) -> Frame {
        Frame { plane: Some(plane), ..self.info.frame(index, index as i64) }
    }
}

fn info(name: &str, header: &Header, packing: &Packing, options: &OpenOptions) -> Result<SourceInfo> {
    let mut warnings = header.warnings.clone();
    let (time_base, rate_origin) = match (options.fps, header.time_base()) {
        (Some(fps), _) => (clock::time_base(fps)?, RateOrigin::User),
        (None, Some(base)) => (base, RateOrigin::CameraHeader),
        (None, None) => {
            warnings.push("the header gives no rate; give it with " + Setting::Fps);
            (TimeBase { numerator: 1, denominator: 1 }, RateOrigin::Unknown)
        }
    };
    if header.color_type.as_deref().is_some_and(|c| c.eq_ignore_ascii_case("bayer")) {
        warnings.push("the sensor has a colour mosaic; its samples are taken as brightness".into());
    }
    let mut details: Vec<(String, String)> = Vec::new();
    let mut say = |word: &str, value: Option<String>| details.extend(value.map(|v| (word.to_owned(), v)));
    say("camera", header.camera.clone());
    say("recorded", header.recorded.clone());
    say("record rate", header.record_rate_hz.map(|r| format!("{r} Hz")));
    say("save step", Some(header.save_step.to_string()));
    say("exposure", header.exposure_s.map(|s| format!("{s:e} s")));
    say("trigger frame", header.trigger_index().map(|i| i.to_string()));
    say("colour type", header.color_type.clone());
    let sensor = header.effective_depth.map(|d| format!("{d} bit, side {:?}", header.side));
    say("sensor depth", sensor);
    say("comment", header.comment.clone());
    let known = rate_origin != RateOrigin::Unknown;
    let (pixel_aspect, pixel_aspect_origin) = options.aspect(PixelAspect::SQUARE);
    Ok(SourceInfo {
        name: name.to_owned(),
        container: "Photron MRAW".into(),
        codec: match packing.format {
            PixelFormat::Gray8 => "8 bit".into(),
            PixelFormat::Gray16 => "16 bit".into(),
            PixelFormat::Packed10 => "packed 10 bit".into(),
            PixelFormat::Packed12 => "packed 12 bit".into(),
        },
        width: header.width,
        height: header.height,
        pixel_aspect,
        pixel_aspect_origin,
        format: packing.format,
        depth_bits: packing.depth_bits,
        pixel_damage: PixelDamage::of(pixel_damage::SAMPLES),
        declared_frames: header.total_frames,
        time_base,
        rate_hz: options
            .fps
            .or_else(|| known.then(|| time_base.denominator as f64 / time_base.numerator as f64)),
        rate_origin,
        claims: RateClaims::default(),
        converted_from: (packing.shift > 0).then(|| "16 bit, significant bits on top".to_owned()),
        size_bytes: None,
        details,
        warnings,
    })
}

impl FrameSource for MrawSource {
    fn info(&self) -> &SourceInfo {
        &self.info
    }

    fn next_frame(&mut self) -> Result<Option<Frame>> {
        if self.next < self.frames {
            let (at, length) = self.place(self.next);
            let plane = self.pixels.lend(self.next, at, length);
            self.next += 1;
            return Ok(Some(self.frame(self.next - 1, plane)));
        }
        let size = self.info.size_bytes.unwrap_or(0);
        if let Some(declared) = self.info.declared_frames.filter(|n| *n > self.frames) {
            let rest = size - self.frames * self.packing.frame_bytes;
            self.ending = Ending::Early {
                frames: self.frames,
                byte: Some(size),
                reason: format!(
                    "the file ends {rest} bytes into frame {} of {declared} that its header declares",
                    self.frames
                ),
            };
        }
        Ok(None)
    }

    fn ending(&self) -> Ending {
        self.ending.clone()
    }

    fn sample(&mut self, count: usize) -> Result<Vec<Frame>> {
        let n = self.frames.min(count as u64);
        (0..n)
            .map(|k| {
                let index = ((u128::from(2 * k + 1) * u128::from(self.frames)) / u128::from(2 * n)) as u64;
                let (at, length) = self.place(index);
                // Read at once: a learner may look at them long after.
                Ok(self.frame(index, self.pixels.copy(index, at, length)?))
            })
            .collect()
    }
}
