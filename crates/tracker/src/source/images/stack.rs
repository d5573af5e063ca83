//! Reads the pages of one TIFF file as frames; or, where it has one page and says that there are more pictures, those behind it.

use std::fs::File;
use std::io::BufReader;

use tiff::decoder::Decoder;

use super::ome::Ome;
use super::picture::{Alike, Picture, format, frame, other_kind, other_size, rate};
use super::planes::{self, Declared, Planes};
use super::sequence::file_name;
use super::tiff_layout::{Layout, is_reduced};
use super::{orientation_tag, pixel_size, tiff_page};
use crate::error::{Error, Fault, FaultKind, Result};
use crate::frame::{Ending, Frame, FrameSource, RateClaims, SourceInfo};
use crate::gaps::{Reason, keep_reason};
use crate::message::Message;
use crate::name::path;
use crate::pixel_damage::PixelDamage;
use crate::source::OpenOptions;
use crate::source::orientation::Orientation;
use crate::source::raw::RawFrames;

/// A multi-page TIFF.
pub struct StackSource {
    info: SourceInfo,
    alike: Alike,
    pictures: Pictures,
    next: u64,
    /// Why frames are empty.
    empty: Vec<Reason>,
    /// Where the description says that pictures are which the file lacks, a clause to add.
    elsewhere: String,
    ending: Ending,
}

/// Places of the pictures of a file.
enum Pictures {
    /// Each in a page of its own; `None` once they have ended.
    Pages(Option<Box<Pages>>),
    /// One after another without pages.
    Planes(RawFrames, Planes),
}

/// The pages of a file in their order, without those that are smaller copies of others.
struct Pages {
    decoder: Decoder<BufReader<File>>,
    whole_only: bool,
}

impl Pages {
    /// At the first page.
    fn open(name: &str) -> Result<Self> {
        let mut pages = Self { decoder: decoder(name)?, whole_only: true };
        // A file of nothing but small copies is one of small pictures.
        if is_reduced(&mut pages.decoder) && pages.turn() != Ok(true) {
            pages = Self { decoder: decoder(name)?, whole_only: false };
        }
        Ok(pages)
    }

    /// The pages at their second and its layout, if that and the third are of one size and the first, laid out so, is of another: that is
    /// a small copy which is not marked as one.
    fn unlike_first(name: &str, first: &Layout) -> Result<Option<(Self, Layout)>> {
        let mut pages = Self::open(name)?;
        let mut turned = || if pages.turn() == Ok(true) { Layout::of(&mut pages.decoder).ok() } else { None };
        match turned().zip(turned()) {
            Some((second, third)) if kind(&second) == kind(&third) && kind(&second) != kind(first) => {
                let mut pages = Self::open(name)?;
                Ok((pages.turn() == Ok(true)).then_some((pages, second)))
            }
            _ => Ok(None),
        }
    }

    /// Goes to the next page; `false` at the end, with what was wrong if that is not a clean one.
    fn turn(&mut self) -> std::result::Result<bool, String> {
        loop {
            if !self.decoder.more_images() {
                return Ok(false);
            }
            self.decoder.next_image().map_err(|e| e.to_string())?;
            if !(self.whole_only && is_reduced(&mut self.decoder)) {
                return Ok(true);
            }
        }
    }
}

/// Width and height in px, and depth in bits.
fn kind(layout: &Layout) -> (u32, u32, u32) {
    (layout.width, layout.height, layout.bits)
}

/// The error for a file of one page whose other pictures cannot be found, for the `problem`.
fn no_pages(name: &str, declared: &Declared, problem: &str) -> Error {
    let (by, pictures) = (declared.by, declared.pictures);
    Error::Source(
        Fault::new(
            name,
            format!("{by} says that it holds {pictures} pictures, but there is one page and {problem}"),
        )
        .of_kind(FaultKind::Damaged)
        .advice("Save it with a page for each picture"),
    )
}

impl StackSource {
    /// Opens a TIFF file.
    ///
    /// # Errors
    /// [`Error::Source`] if its first page cannot be read.
    pub fn open(name: &str, options: &OpenOptions) -> Result<Self> {
        let unreadable = |e: String| {
            Error::Source(Fault::new(name, format!("the first page cannot be read: {e}")).of_kind(FaultKind::Unsupported).advice(
                "Save it as gray of 8 or 16 bit, without compression or with LZW, Deflate or PackBits",
            ))
        };
        let mut pages = Pages::open(name)?;
        let mut layout = Layout::of(&mut pages.decoder).map_err(unreadable)?;
        let declared = planes::declared(&mut pages.decoder, &layout);
        let ome = Ome::of(&mut pages.decoder, &layout);
        let mut warnings = Vec::new();
        warnings.extend(declared.as_ref().and_then(|d| d.order()).map(Message::from));
        warnings.extend(ome.iter().flat_map(|o| o.warnings.clone()).map(Message::from));
        if let Some((second, of_second)) = Pages::unlike_first(name, &layout)? {
            let size = other_size("the page", kind(&layout), kind(&of_second));
            warnings.push(format!("frame 0: {size}: such a frame stays empty").into());
            (pages, layout) = (second, of_second);
        }
        layout.judge().map_err(unreadable)?;
        let elsewhere = ome.as_ref().map_or_else(String::new, |o| o.elsewhere(&file_name(&path(name))));
        let size_bytes = std::fs::metadata(path(name)).ok().map(|m| m.len());
        let (time_base, rate_hz, rate_origin) = rate(options, &mut warnings)?;
        let orientation = orientation_tag::of_tiff(&mut pages.decoder);
        warnings.extend(orientation.warning());
        let said = pixel_size::of_tiff(&mut pages.decoder);
        let said = said.map(|size| if orientation.transposed { size.turned() } else { size });
        let (pixel_aspect, pixel_aspect_origin) = options.aspect(pixel_size::aspect(said, &mut warnings));
        let aspect = Some(pixel_aspect).filter(|_| pixel_aspect_origin.is_recording());
        let alike = Alike { orientation, aspect };
        let (width, height) = orientation.size(layout.width, layout.height);
        let whole = |info, pictures| Self {
            info,
            alike,
            pictures,
            next: 0,
            empty: Vec::new(),
            elsewhere,
            ending: Ending::Complete,
        };
        let by = declared.as_ref().map(|d| d.by).or(ome.as_ref().map(|_| "OME-XML"));
        let mut info = SourceInfo {
            name: name.to_owned(),
            container: "TIFF".into(),
            codec: format!("{} bit pages", layout.bits),
            width,
            height,
            pixel_aspect,
            pixel_aspect_origin,
            format: format(layout.bits),
            depth_bits: layout.bits.max(8),
            pixel_damage: PixelDamage::of("tiff"),
            declared_frames: declared
                .as_ref()
                .map(|d| d.pictures)
                .or_else(|| ome.as_ref()?.pictures.filter(|n| *n > 1)),
            time_base,
            rate_hz,
            rate_origin,
            claims: RateClaims::default(),
            converted_from: None,
            size_bytes,
            details: by.map(|by| ("described by".to_owned(), by.to_owned())).into_iter().collect(),
            warnings,
        };
        let more = declared.filter(|_| !pages.decoder.more_images());
        if let Some(declared) = more {
            let planes = Planes::new(&layout, declared.pictures, size_bytes.unwrap_or(0))
                .map_err(|e| no_pages(name, &declared, &e))?;
            info.codec = format!("{} bit pictures behind one page", layout.bits);
            info.converted_from = planes.converted_from();
            (info.depth_bits, info.format) = (planes.depth_bits, format(planes.depth_bits));
            let file = File::open(path(name)).map_err(|e| unreadable(e.to_string()))?;
            let raw = RawFrames::new(file, name, planes.stored);
            return Ok(whole(info, Pictures::Planes(raw, planes)));
        }
        let first = tiff_page::read(&mut pages.decoder).map_err(unreadable)?;
        (info.depth_bits, info.format) = (first.depth_bits, format(first.depth_bits));
        info.converted_from = first.converted_from;
        Ok(whole(info, Pictures::Pages(Some(Box::new(Pages::open(name)?)))))
    }

    fn read_page(pages: &mut Pages, next: u64) -> std::result::Result<Option<Picture>, String> {
        if next > 0 && !pages.turn()? {
            return Ok(None);
        }
        page(pages).map(Some)
    }

    /// The end that comes before all that the description declares.
    fn short(&self) -> Option<Ending> {
        let declared = self.info.declared_frames.filter(|n| *n > self.next)?;
        Some(Ending::Early {
            frames: self.next,
            byte: self.info.size_bytes,
            reason: format!(
                "the file ends after {} of {declared} pictures that its description declares{}",
                self.next, self.elsewhere
            ),
        })
    }

    fn plane(&self, raw: &RawFrames, planes: &Planes, index: u64, copy: bool) -> Result<Frame> {
        let at = planes.place(index);
        let orientation = self.alike.orientation;
        if orientation != Orientation::default() {
            let stored = raw.copy(index, at, planes.bytes)?;
            let (width, height) = orientation.size(self.info.width, self.info.height);
            let sample_bytes = if planes.depth_bits > 8 { 2 } else { 1 };
            let (turned, _) =
                orientation.apply(stored.bytes().to_vec(), width as usize, height as usize, sample_bytes);
            return Ok(Frame { plane: Some(Box::new(turned)), ..frame(&self.info, index, None) });
        }
        let plane = if copy { raw.copy(index, at, planes.bytes)? } else { raw.lend(index, at, planes.bytes) };
        Ok(Frame { plane: Some(plane), ..frame(&self.info, index, None) })
    }
}

/// The page at which a file stands, turned as it says.
fn page(pages: &mut Pages) -> std::result::Result<Picture, String> {
    let decoder = &mut pages.decoder;
    let (orientation, size) = (orientation_tag::of_tiff(decoder), pixel_size::of_tiff(decoder));
    Ok(tiff_page::read(decoder)?.shown(orientation, size))
}

fn decoder(name: &str) -> Result<Decoder<BufReader<File>>> {
    const ADVICE: &str = "Check that the file was copied whole";
    let fault = |problem: String| Fault::new(name, problem).advice(ADVICE);
    let file = File::open(path(name))
        .map_err(|e| Error::Source(fault(format!("the file cannot be read ({e})")).caused_by(&e)))?;
    Decoder::new(BufReader::new(file)).map_err(|e| {
        let problem = format!("not a TIFF file that can be read ({e})");
        Error::Source(fault(problem).of_kind(FaultKind::Damaged))
    })
}

impl FrameSource for StackSource {
    fn info(&self) -> &SourceInfo {
        &self.info
    }

    fn next_frame(&mut self) -> Result<Option<Frame>> {
        let read = match &mut self.pictures {
            Pictures::Planes(raw, planes) if self.next < planes.whole => {
                let (raw, planes) = (raw.clone(), *planes);
                self.next += 1;
                return self.plane(&raw, &planes, self.next - 1, false).map(Some);
            }
            Pictures::Planes(..) | Pictures::Pages(None) => Ok(None),
            Pictures::Pages(Some(pages)) => Self::read_page(pages, self.next),
        };
        match read {
            Ok(Some(picture)) => {
                if (picture.width, picture.height) == (self.info.width, self.info.height)
                    || picture.orientation != self.alike.orientation
                {
                    self.alike.check(&self.info.name, self.next, &picture)?;
                }
                self.next += 1;
                let (index, problem) = (self.next - 1, other_kind("the page", &picture, &self.info));
                let frame = frame(&self.info, index, Some(picture));
                if frame.plane.is_none() {
                    keep_reason(&mut self.empty, index, problem);
                }
                return Ok(Some(frame));
            }
            Ok(None) => self.ending = self.short().unwrap_or_else(|| self.ending.clone()),
            // Pages are a chain: what follows a broken one is not found.
            Err(reason) => {
                self.ending = Ending::Early {
                    frames: self.next,
                    byte: self.info.size_bytes,
                    reason: format!("page {} cannot be read: {reason}", self.next),
                };
            }
        }
        if let Pictures::Pages(pages) = &mut self.pictures {
            *pages = None;
        }
        Ok(None)
    }

    fn ending(&self) -> Ending {
        self.ending.clone()
    }

    fn reasons(&self) -> Vec<Reason> {
        self.empty.clone()
    }

    fn sample(&mut self, count: usize) -> Result<Vec<Frame>> {
        let spread = |all: u64| {
            let n = (count as u64).min(all);
            (0..n).map(move |k| (2 * k + 1) * all / (2 * n))
        };
        if let Pictures::Planes(raw, planes) = &self.pictures {
            return spread(planes.whole).map(|at| self.plane(raw, planes, at, true)).collect();
        }
        // Pages are counted without reading their pixels.
        let mut counter = Pages::open(&self.info.name)?;
        let mut pages = 1u64;
        while counter.turn() == Ok(true) {
            pages += 1;
        }
        let mut wanted = spread(pages).peekable();
        let mut reader = Pages::open(&self.info.name)?;
        let mut frames = Vec::new();
        for at in 0..pages {
            if at > 0 && reader.turn() != Ok(true) {
                break;
            }
            if wanted.next_if_eq(&at).is_some() {
                let picture = page(&mut reader).ok();
                frames.extend(Some(frame(&self.info, at, picture)).filter(|f| f.plane.is_some()));
            }
        }
        Ok(frames)
    }
}
