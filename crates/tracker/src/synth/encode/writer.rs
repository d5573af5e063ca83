//! Encodes gray frames into a video file through FFmpeg's libraries.
//!
//! Owns: [`VideoWriter`], [`encode_image`]. Must not: know of scenes; whoever has gray frames may use it.

use std::path::Path;

use ffmpeg_next as ffmpeg;

use ffmpeg::codec::{Context, Id, encoder};
use ffmpeg::format::Pixel;
use ffmpeg::format::context::StreamIo;
use ffmpeg::{Dictionary, Packet, Rational, color, format, frame};

use super::settings::{Codec, ImageKind, VideoSettings, cannot_write, fault};
use crate::error::{Error, Fault, FaultKind, Place, Result};
use crate::frame::TimeBase;
use crate::name::text;
use crate::output::NewFile;

/// A video file being written.
pub struct VideoWriter {
    name: String,
    new: NewFile,
    output: format::context::Output,
    encoder: encoder::Video,
    time_base: Rational,
    stream_time_base: Rational,
    pixel: Pixel,
    width: u32,
    height: u32,
    bytes_per_pixel: usize,
    next: i64,
    /// Packets in the file.
    packets: u64,
}

/// An error of FFmpeg's as ours.
fn failed<'a>(name: &'a str, what: &'a str) -> impl Fn(ffmpeg::Error) -> Error + 'a {
    move |e| Error::Film(Fault::new(name, format!("{what} failed ({e})")))
}

impl VideoWriter {
    /// Begins a file; its container is known by its ending. Whatever its name looks like, an address, a pattern or a
    /// list, it is the name of one file.
    ///
    /// # Errors
    /// [`Error::Film`] if the codec cannot hold such frames or the file cannot be made.
    pub fn create(path: &Path, settings: &VideoSettings) -> Result<Self> {
        ffmpeg::init().map_err(failed("FFmpeg", "its start"))?;
        ffmpeg::log::set_level(ffmpeg::log::Level::Error);
        let name = text(path);
        let (codec_name, pixel) = pixel_format(&name, settings)?;
        let TimeBase { numerator, denominator } = settings.time_base;
        let (Ok(numerator), Ok(denominator)) = (i32::try_from(numerator), i32::try_from(denominator)) else {
            return Err(fault(&name, "the frame rate is too fine a fraction".into(), "Give a rounder rate"));
        };
        let time_base = Rational(numerator, denominator);
        let rate = f64::from(denominator) / f64::from(numerator);
        if let Some(why) = up_to_1000_hz(path).filter(|_| rate > 1000.0) {
            let problem = format!("it {why}, too coarse for {rate} frames per s");
            return Err(fault(&name, problem, "Name it .mp4 or .mov, which keep every rate"));
        }
        let new = NewFile::create(path).map_err(|e| cannot_write(&name, &e))?;
        let mut output = muxer(&name, path, &new)?;
        let codec = encoder::find_by_name(codec_name).ok_or_else(|| {
            fault(&name, format!("this FFmpeg has no encoder {codec_name}"), "Install FFmpeg with it")
        })?;
        let mut context =
            Context::new_with_codec(codec).encoder().video().map_err(failed(&name, "the encoder"))?;
        context.set_width(settings.width);
        context.set_height(settings.height);
        context.set_format(pixel);
        context.set_time_base(time_base);
        context.set_frame_rate(Some(time_base.invert()));
        let aspect = sample_aspect(&name, path, settings)?;
        context.set_aspect_ratio(aspect);
        // Levels are what the camera recorded, from 0 to the top.
        context.set_color_range(color::Range::JPEG);
        if output.format().flags().contains(format::Flags::GLOBAL_HEADER) {
            context.set_flags(ffmpeg::codec::Flags::GLOBAL_HEADER);
        }
        let mut options = Dictionary::new();
        match settings.codec {
            Codec::H264 => {
                options.set("crf", &settings.quality.unwrap_or(12).to_string());
                options.set("preset", settings.x264_preset.as_deref().unwrap_or("medium"));
                // x264's output depends on its number of threads; a fixed one makes files repeatable.
                options.set("threads", "2");
            }
            Codec::Mjpeg => {
                let scale = settings.quality.unwrap_or(2).clamp(1, 31).to_string();
                // The same quantiser for every frame.
                options.set("qmin", &scale);
                options.set("qmax", &scale);
                options.set("threads", "1");
            }
            Codec::Ffv1 => {
                options.set("level", "3");
                options.set("slicecrc", "1");
            }
            Codec::Raw => {}
        }
        let opened = context.open_as_with(codec, options).map_err(failed(&name, "opening the encoder"))?;
        let mut stream = output.add_stream(codec).map_err(failed(&name, "adding the stream"))?;
        stream.set_parameters(&opened);
        stream.set_time_base(time_base);
        stream.set_avg_frame_rate(time_base.invert());
        stream.set_rate(time_base.invert());
        // SAFETY: the stream belongs to the output, which lives and of which nothing is written yet.
        unsafe { (*stream.as_mut_ptr()).sample_aspect_ratio = aspect.into() };
        // No random identifiers and no version: the same film makes the same bytes.
        let mut exact = Dictionary::new();
        exact.set("fflags", "+bitexact");
        output.write_header_with(exact).map_err(failed(&name, "writing the header"))?;
        let stream_time_base = output.stream(0).map_or(time_base, |s| s.time_base());
        Ok(Self {
            name,
            new,
            output,
            encoder: opened,
            time_base,
            stream_time_base,
            pixel,
            width: settings.width,
            height: settings.height,
            bytes_per_pixel: if settings.depth_bits > 8 { 2 } else { 1 },
            next: 0,
            packets: 0,
        })
    }

    /// Adds a frame: samples row by row without padding.
    ///
    /// # Errors
    /// [`Error::Film`] if encoding or writing fails, or the frame has another size.
    pub fn write(&mut self, samples: &[u8]) -> Result<()> {
        let mut picture =
            picture(&self.name, self.pixel, self.width, self.height, self.bytes_per_pixel, samples)?;
        picture.set_pts(Some(self.next));
        self.next += 1;
        self.encoder.send_frame(&picture).map_err(failed(&self.name, "encoding"))?;
        self.drain()
    }

    /// Adds a frame in colour: a plane of brightness, then two of colour at half the size, without padding (I420),
    /// full range. Only for H.264 that is not gray only.
    ///
    /// # Errors
    /// [`Error::Film`] if encoding or writing fails, or the frame has another size or the file no colour.
    pub fn write_i420(&mut self, planes: &[u8]) -> Result<()> {
        let (w, h) = (self.width as usize, self.height as usize);
        if self.pixel != Pixel::YUV420P || planes.len() != w * h * 3 / 2 {
            return Err(fault(&self.name, format!("{} bytes are no colour frame of it", planes.len()), ""));
        }
        let mut picture = frame::Video::new(self.pixel, self.width, self.height);
        picture.set_color_range(color::Range::JPEG);
        let (luma, chroma) = planes.split_at(w * h);
        let (blue, red) = chroma.split_at(w * h / 4);
        for (k, (from, row)) in [(luma, w), (blue, w / 2), (red, w / 2)].into_iter().enumerate() {
            let stride = picture.stride(k);
            for (to, from) in picture.data_mut(k).chunks_mut(stride).zip(from.chunks(row)) {
                to[..row].copy_from_slice(from);
            }
        }
        picture.set_pts(Some(self.next));
        self.next += 1;
        self.encoder.send_frame(&picture).map_err(failed(&self.name, "encoding"))?;
        self.drain()
    }

    fn drain(&mut self) -> Result<()> {
        let mut packet = Packet::empty();
        loop {
            match self.encoder.receive_packet(&mut packet) {
                Ok(()) => {
                    packet.set_stream(0);
                    // The last frame lasts as long as the others.
                    packet.set_duration(1);
                    packet.rescale_ts(self.time_base, self.stream_time_base);
                    packet.write_interleaved(&mut self.output).map_err(failed(&self.name, "writing"))?;
                    self.packets += 1;
                }
                Err(ffmpeg::Error::Eof) => return Ok(()),
                Err(ffmpeg::Error::Other { errno }) if errno == ffmpeg::error::EAGAIN => return Ok(()),
                Err(e) => return Err(failed(&self.name, "encoding")(e)),
            }
        }
    }

    /// Ends the file.
    ///
    /// # Errors
    /// [`Error::Film`] if the last frames cannot be written.
    pub fn finish(mut self) -> Result<()> {
        self.encoder.send_eof().map_err(failed(&self.name, "encoding"))?;
        self.drain()?;
        self.end()
    }

    /// Ends the file at once with the frames that are encoded, without those that the encoder still holds; without any there is no
    /// file.
    ///
    /// # Errors
    /// [`Error::Film`] if the file's end cannot be written.
    pub fn cut(self) -> Result<()> {
        if self.packets == 0 {
            self.abandon();
            return Ok(());
        }
        self.end()
    }

    /// Leaves no file.
    pub fn abandon(self) {
        release(self.encoder);
    }

    fn end(mut self) -> Result<()> {
        release(self.encoder);
        self.output.write_trailer().map_err(failed(&self.name, "writing the end"))?;
        // Closed first: what FFmpeg still holds goes into the file.
        drop(self.output);
        self.new.publish(true).map_err(|e| cannot_write(&self.name, &e))
    }
}

/// Closes an encoder beside the caller's work: x264 first ends the pictures that it has begun, which takes it seconds where they are
/// large.
fn release(encoder: encoder::Video) {
    // Without a thread to be had the closure is dropped here, and the encoder with it.
    let _ = std::thread::Builder::new().name("encoder".into()).spawn(move || drop(encoder));
}

/// The reason for which a file of this ending holds at most 1000 frames per second, as FFmpeg writes it; `None` if it holds more.
/// Matroska has the exact time from frame to frame beside its time stamps only where that is longer than a tick.
fn up_to_1000_hz(path: &Path) -> Option<&'static str> {
    match ending(path).as_str() {
        "mkv" | "mk3d" | "webm" => Some("keeps time stamps in milliseconds"),
        "avi" => Some("is written with frames 1 ms or more apart"),
        _ => None,
    }
}

/// Width to height of a pixel as FFmpeg has it: 0 for square ones, of which nothing is said.
///
/// Matroska has the width at which pictures are shown in its place, a whole number of pixels: where that is another ratio by more
/// than 10^-4, which would turn angles by 0.003 deg, it is refused.
fn sample_aspect(name: &str, path: &Path, settings: &VideoSettings) -> Result<Rational> {
    let aspect = settings.pixel_aspect;
    if aspect.is_square() {
        return Ok(Rational(0, 1));
    }
    let shown = f64::from(settings.width) * aspect.ratio();
    let is_rounded = ["mkv", "mk3d", "webm"].contains(&ending(path).as_str());
    if is_rounded && (shown.round() / shown - 1.0).abs() > 1e-4 {
        let problem = format!(
            "Matroska keeps the width at which pictures are shown in whole pixels, and {} px of {} are {shown:.2}",
            settings.width,
            aspect.words()
        );
        return Err(fault(name, problem, "Name it .mp4, .mov or .avi, which keep the ratio"));
    }
    let [width, height] = aspect.parts().map(i32::try_from);
    match (width, height) {
        (Ok(width), Ok(height)) => Ok(Rational(width, height)),
        _ => Err(fault(name, format!("{} are no ratio that it holds", aspect.words()), "")),
    }
}

/// The ending of a name in lower case.
fn ending(path: &Path) -> String {
    path.extension().map(text).unwrap_or_default().to_ascii_lowercase()
}

/// The container that the ending of `path` names, writing into `new` and nowhere else.
fn muxer(name: &str, path: &Path, new: &NewFile) -> Result<format::context::Output> {
    let ending = ending(path);
    let file = new.file().try_clone().map_err(|e| cannot_write(name, &e))?;
    let stream = match new.is_stream() {
        true => StreamIo::from_write(file),
        false => StreamIo::from_write_seek(file),
    };
    // FFmpeg is told the ending and not the name, in which it would look for addresses and patterns. A container that
    // opens files of its own, for pictures or for parts of a film, is refused by the call.
    // It would print what is said below.
    ffmpeg::log::set_level(ffmpeg::log::Level::Quiet);
    let made = stream.and_then(|s| format::output_to_stream(s, Some(&format!("film.{ending}")), None));
    ffmpeg::log::set_level(ffmpeg::log::Level::Error);
    made.map_err(|_| {
        fault(
            name,
            format!("no film is written to a file that ends in {ending:?}"),
            "Choose .mp4, .mov, .mkv or .avi",
        )
    })
}

/// The encoder's name and what it takes.
fn pixel_format(name: &str, s: &VideoSettings) -> Result<(&'static str, Pixel)> {
    let deep = s.depth_bits > 8;
    match s.codec {
        Codec::H264 | Codec::Mjpeg if deep => Err(Error::Film(
            Fault::new(name, format!("{} bits do not fit into 8-bit video", s.depth_bits))
                .of_kind(FaultKind::Unsupported)
                .at(Place::Key("codec".into()))
                .advice("Choose ffv1 or raw, or film with 8 bits"),
        )),
        Codec::H264 if s.gray_only => Ok(("libx264", Pixel::GRAY8)),
        Codec::H264 if s.width % 2 == 1 || s.height % 2 == 1 => Err(Error::Film(
            Fault::new(name, format!("{} x {} px have no half for colour planes", s.width, s.height))
                .of_kind(FaultKind::Unsupported)
                .at(Place::Key("image_px".into()))
                .advice("Give an even width and height or ask for gray only"),
        )),
        Codec::H264 => Ok(("libx264", Pixel::YUV420P)),
        Codec::Mjpeg => Ok(("mjpeg", Pixel::YUVJ420P)),
        Codec::Ffv1 => Ok((
            "ffv1",
            match s.depth_bits {
                8 => Pixel::GRAY8,
                9 | 10 => Pixel::GRAY10LE,
                11 | 12 => Pixel::GRAY12LE,
                _ => Pixel::GRAY16LE,
            },
        )),
        Codec::Raw if deep => Err(Error::Film(
            Fault::new(name, format!("no video container holds {} bits uncompressed", s.depth_bits))
                .of_kind(FaultKind::Unsupported)
                .at(Place::Key("codec".into()))
                .advice("Choose ffv1 in .mkv, or .mraw or images"),
        )),
        Codec::Raw => Ok(("rawvideo", Pixel::GRAY8)),
    }
}

/// A picture of FFmpeg's with `samples` as its brightness and no colour.
fn picture(
    name: &str,
    pixel: Pixel,
    width: u32,
    height: u32,
    bytes_per_pixel: usize,
    samples: &[u8],
) -> Result<frame::Video> {
    let row = width as usize * bytes_per_pixel;
    if row == 0 || samples.len() != row * height as usize {
        return Err(fault(name, format!("a frame of {} bytes is not {width} x {height}", samples.len()), ""));
    }
    let mut picture = frame::Video::new(pixel, width, height);
    picture.set_color_range(color::Range::JPEG);
    let stride = picture.stride(0);
    for (to, from) in picture.data_mut(0).chunks_mut(stride).zip(samples.chunks(row)) {
        if pixel == Pixel::GRAY16BE {
            for (t, f) in to.chunks_exact_mut(2).zip(from.chunks_exact(2)) {
                t.copy_from_slice(&[f[1], f[0]]);
            }
        } else {
            to[..row].copy_from_slice(from);
        }
    }
    for plane in 1..picture.planes() {
        picture.data_mut(plane).fill(128);
    }
    Ok(picture)
}

/// One gray frame as the bytes of a PNG, TIFF or BMP file; 16-bit samples keep their values.
///
/// # Errors
/// [`Error::Film`] for a kind that cannot hold the depth or if encoding fails.
pub fn encode_image(
    name: &str,
    kind: ImageKind,
    width: u32,
    height: u32,
    depth_bits: u32,
    samples: &[u8],
) -> Result<Vec<u8>> {
    let deep = depth_bits > 8;
    let (id, pixel) = match kind {
        ImageKind::Png => (Id::PNG, if deep { Pixel::GRAY16BE } else { Pixel::GRAY8 }),
        ImageKind::Tiff => (Id::TIFF, if deep { Pixel::GRAY16LE } else { Pixel::GRAY8 }),
        ImageKind::Bmp if deep => {
            return Err(fault(name, format!("BMP does not hold {depth_bits} bits"), "Write PNG or TIFF"));
        }
        ImageKind::Bmp => (Id::BMP, Pixel::GRAY8),
    };
    let codec = encoder::find(id)
        .ok_or_else(|| fault(name, format!("this FFmpeg cannot write {id:?}"), "Install FFmpeg with it"))?;
    let mut context =
        Context::new_with_codec(codec).encoder().video().map_err(failed(name, "the encoder"))?;
    context.set_width(width);
    context.set_height(height);
    context.set_format(pixel);
    context.set_time_base(Rational(1, 25));
    let mut opened = context.open_as(codec).map_err(failed(name, "opening the encoder"))?;
    let mut picture = picture(name, pixel, width, height, if deep { 2 } else { 1 }, samples)?;
    picture.set_pts(Some(0));
    opened.send_frame(&picture).map_err(failed(name, "encoding"))?;
    opened.send_eof().map_err(failed(name, "encoding"))?;
    let mut packet = Packet::empty();
    opened.receive_packet(&mut packet).map_err(failed(name, "encoding"))?;
    Ok(packet.data().unwrap_or_default().to_vec())
}
