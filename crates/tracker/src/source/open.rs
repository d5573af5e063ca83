//! Opens a recording with the reader that its first bytes ask for.
//!
//! Owns: [`open`], [`files`].

use std::fs::File;
use std::io::Read;
use std::path::PathBuf;

use super::input::Input;
use super::{Decoder, OpenOptions, cine, ffmpeg, images, mraw, norpix, second};
use crate::error::{Error, Fault, FaultKind, Result};
use crate::frame::FrameSource;
use crate::kind::{self, Kind};
use crate::message::Setting;
use crate::name::path;

/// Whether a name stands for pictures of a folder.
fn is_sequence(name: &str) -> bool {
    path(name).is_dir() || images::names::is_pattern(name) && !path(name).exists()
}

/// The files that a recording is read from: all pictures of a folder, both files of a Photron pair. None for what can
/// be read once only, a pipe or an address.
///
/// # Errors
/// [`Error::Source`] if a file of it is not there.
pub fn files(name: &str) -> Result<Vec<PathBuf>> {
    if is_sequence(name) {
        return Ok(images::names::list(name)?.files.into_iter().flatten().collect());
    }
    if !path(name).is_file() {
        return Ok(Vec::new());
    }
    if mraw::is_photron(name, &first_bytes(name).unwrap_or_default()) {
        return mraw::pair(name).map(|pair| vec![pair.header, pair.pixels]);
    }
    Ok(vec![path(name)])
}

/// Opens a recording by what its first bytes say it is, whatever its name; `-` is standard input. A name that is not
/// UTF-8 is given as [`crate::name::text`] makes it.
///
/// ```
/// # use tracker::synth::{Film, WriteOptions, preset, write};
/// use tracker::source::{OpenOptions, open};
///
/// # let folder = tempfile::tempdir().unwrap();
/// # let path = folder.path().join("drop.mraw");
/// # let scene = tracker::synth::Scene { frames: 5, ..preset("clean", 1)? };
/// # write(&Film::new(&scene)?, &path, &WriteOptions::default(), &mut |_| Ok(()))?;
/// # let name = path.display().to_string();
/// let mut recording = open(&name, &OpenOptions::default())?;
/// let time_base = recording.info().time_base;
/// let mut times_s = Vec::new();
/// while let Some(frame) = recording.next_frame()? {
///     times_s.push(time_base.seconds(frame.ticks));
/// }
/// assert_eq!(times_s, [0.0, 0.002, 0.004, 0.006, 0.008]);
/// # Ok::<(), tracker::error::Error>(())
/// ```
///
/// # Errors
/// [`Error::Source`] if there is no such file or nothing here reads it; [`Error::Argument`] for options that
/// make no sense.
pub fn open(name: &str, options: &OpenOptions) -> Result<Box<dyn FrameSource>> {
    kind::expect(&path(name), &[Kind::Film, Kind::Pictures], Error::Source)?;
    if is_sequence(name) {
        if options.decoder == Decoder::Opencv {
            return Err(Error::Source(
                Fault::new(name, "pictures are read without OpenCV's decoder")
                    .of_kind(FaultKind::Unsupported)
                    .advice("Leave out " + Setting::Decoder.set_to("opencv")),
            ));
        }
        return Ok(Box::new(images::SequenceSource::open(name, options)?));
    }
    let input = Input::of(name, options)?;
    // FFmpeg would take its name for a pattern of others, and does not turn a picture as its tag says.
    let is_ours = || images::names::is_pattern(name) || images::is_turned(&path(name));
    if matches!(input, Input::File(_)) && images::names::is_picture(name) && is_ours() {
        return Ok(Box::new(images::SequenceSource::open_one(name, options)?));
    }
    if let Input::File(_) = &input {
        let first = first_bytes(name)?;
        let by_camera: Option<Box<dyn FrameSource>> = match &first[..] {
            b if mraw::is_photron(name, b) => Some(Box::new(mraw::MrawSource::open(name, options)?)),
            [b'C', b'I', ..] if first.get(2..4) == Some(&[44, 0]) => {
                Some(Box::new(cine::CineSource::open(name, &input, options)?))
            }
            b if norpix::is_norpix(b) => Some(Box::new(norpix::NorpixSource::open(name, options)?)),
            [b'I', b'I', 42 | 43, 0, ..] | [b'M', b'M', 0, 42 | 43, ..] => {
                Some(Box::new(images::StackSource::open(name, options)?))
            }
            _ => None,
        };
        if let Some(source) = by_camera {
            return match options.decoder {
                Decoder::Opencv => Err(Error::Source(
                    Fault::new(name, format!("OpenCV does not read {}", source.info().container))
                        .of_kind(FaultKind::Unsupported)
                        .advice("Leave out " + Setting::Decoder.set_to("opencv")),
                )),
                _ => Ok(source),
            };
        }
    }
    let mut source = ffmpeg::FfmpegSource::open(name, &input, options)?;
    source.turn_as_tagged();
    if options.decoder != Decoder::Opencv {
        return Ok(Box::new(source));
    }
    match input {
        Input::File(_) => second::open(name, &input, &source, options),
        _ => Err(Error::Source(
            Fault::new(name, "OpenCV's decoder reads files only")
                .of_kind(FaultKind::Unsupported)
                .advice("Leave out " + Setting::Decoder.set_to("opencv")),
        )),
    }
}

/// The first bytes of a file, up to 4096.
fn first_bytes(name: &str) -> Result<Vec<u8>> {
    let unreadable = |e: std::io::Error| {
        Error::Source(
            Fault::new(name, format!("the file cannot be read ({e})"))
                .caused_by(&e)
                .advice("Check its permissions"),
        )
    };
    let mut bytes = Vec::new();
    File::open(path(name)).map_err(unreadable)?.take(4096).read_to_end(&mut bytes).map_err(unreadable)?;
    if bytes.is_empty() {
        return Err(Error::Source(
            Fault::new(name, "the file is empty")
                .of_kind(FaultKind::Damaged)
                .advice("Check that it was copied whole"),
        ));
    }
    Ok(bytes)
}
