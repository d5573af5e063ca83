//! The pages of one TIFF file as frames.

use std::fs::File;
use std::io::BufReader;

use tiff::decoder::Decoder;

use super::picture::{self, Picture};
use super::{format, frame, rate};
use crate::error::{Error, Fault, Result};
use crate::frame::{Ending, Frame, FrameSource, RateClaims, SourceInfo};
use crate::source::OpenOptions;

/// A multi-page TIFF.
pub struct StackSource {
    info: SourceInfo,
    /// `None` once it has ended.
    decoder: Option<Decoder<BufReader<File>>>,
    next: u64,
    ending: Ending,
}

impl StackSource {
    /// Opens a TIFF file.
    ///
    /// # Errors
    /// [`Error::Source`] if its first page cannot be read.
    pub fn open(name: &str, options: &OpenOptions) -> Result<Self> {
        let first = picture::page(&mut decoder(name)?).map_err(|e| {
            Error::Source(Fault::new(name, format!("the first page cannot be read: {e}")).advice(
                "Save it as gray of 8 or 16 bit, without compression or with LZW, Deflate or PackBits",
            ))
        })?;
        let mut warnings = Vec::new();
        let (time_base, rate_hz, rate_origin) = rate(options, &mut warnings)?;
        let info = SourceInfo {
            name: name.to_owned(),
            container: "TIFF".into(),
            codec: format!("{} bit pages", first.depth_bits),
            width: first.width,
            height: first.height,
            format: format(first.depth_bits),
            depth_bits: first.depth_bits,
            declared_frames: None,
            time_base,
            rate_hz,
            rate_origin,
            claims: RateClaims::default(),
            converted_from: first.converted_from,
            size_bytes: std::fs::metadata(name).ok().map(|m| m.len()),
            details: Vec::new(),
            warnings,
        };
        Ok(Self { info, decoder: Some(decoder(name)?), next: 0, ending: Ending::Complete })
    }

    /// Goes to the next page; `false` at the end, with what was wrong if that is not a clean one.
    fn turn(decoder: &mut Decoder<BufReader<File>>) -> std::result::Result<bool, String> {
        if !decoder.more_images() {
            return Ok(false);
        }
        decoder.next_image().map_err(|e| e.to_string())?;
        Ok(true)
    }

    fn read(&mut self) -> std::result::Result<Option<Picture>, String> {
        let Some(decoder) = &mut self.decoder else { return Ok(None) };
        if self.next > 0 && !Self::turn(decoder)? {
            return Ok(None);
        }
        picture::page(decoder).map(Some)
    }
}

fn decoder(name: &str) -> Result<Decoder<BufReader<File>>> {
    let fault = |problem: String| {
        Error::Source(Fault::new(name, problem).advice("Check that the file was copied whole"))
    };
    let file = File::open(name).map_err(|e| fault(format!("the file cannot be read ({e})")))?;
    Decoder::new(BufReader::new(file)).map_err(|e| fault(format!("not a TIFF file that can be read ({e})")))
}

impl FrameSource for StackSource {
    fn info(&self) -> &SourceInfo {
        &self.info
    }

    fn next_frame(&mut self) -> Result<Option<Frame>> {
        match self.read() {
            Ok(Some(picture)) => {
                self.next += 1;
                Ok(Some(frame(&self.info, self.next - 1, Some(picture))))
            }
            Ok(None) => {
                self.decoder = None;
                Ok(None)
            }
            Err(reason) => {
                // Pages are a chain: what follows a broken one is not found.
                self.decoder = None;
                self.ending = Ending::Early {
                    frames: self.next,
                    byte: self.info.size_bytes,
                    reason: format!("page {} cannot be read: {reason}", self.next),
                };
                Ok(None)
            }
        }
    }

    fn ending(&self) -> Ending {
        self.ending.clone()
    }

    fn sample(&mut self, count: usize) -> Result<Vec<Frame>> {
        // Pages are counted without reading their pixels.
        let mut counter = decoder(&self.info.name)?;
        let mut pages = 1u64;
        while Self::turn(&mut counter) == Ok(true) {
            pages += 1;
        }
        let n = (count as u64).min(pages);
        let mut wanted = (0..n).map(|k| (2 * k + 1) * pages / (2 * n)).peekable();
        let mut reader = decoder(&self.info.name)?;
        let mut frames = Vec::new();
        for at in 0..pages {
            if at > 0 && Self::turn(&mut reader) != Ok(true) {
                break;
            }
            if wanted.next_if_eq(&at).is_some() {
                let picture = picture::page(&mut reader).ok();
                frames.extend(Some(frame(&self.info, at, picture)).filter(|f| f.plane.is_some()));
            }
        }
        Ok(frames)
    }
}
