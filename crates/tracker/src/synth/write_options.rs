//! Defines the options of writing a film, and refuses one that does nothing for its form.

use std::path::{Path, PathBuf};

use super::encode::Codec;
use crate::csv_text::Cells;
use crate::error::{Error, Fault, Result};
use crate::message::Setting;
use crate::name::text;

/// Options of writing a film. The default follows the name's ending.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct WriteOptions {
    /// Codec of a video file.
    pub codec: Option<Codec>,
    /// H.264: constant rate factor 0 to 51; MJPEG: 1 to 31; smaller is better and larger.
    pub quality: Option<u32>,
    /// H.264: x264's preset, e.g. `fast`.
    pub x264_preset: Option<String>,
    /// H.264: no colour planes.
    pub gray_only: bool,
    /// Bits per pixel of a Photron recording: 8, 10, 12 or 16.
    pub bits: Option<u32>,
    /// Where the truth goes, Parquet or CSV by the ending.
    pub truth: Option<PathBuf>,
    /// How a CSV of the truth writes names.
    pub cells: Cells,
    /// Whether files that are there already are replaced.
    pub replace: bool,
    /// Files that the film is made from, which are never replaced.
    pub reads: Vec<PathBuf>,
}

/// Presets of x264, the fastest first.
pub const X264_PRESETS: [&str; 10] = [
    "ultrafast",
    "superfast",
    "veryfast",
    "faster",
    "fast",
    "medium",
    "slow",
    "slower",
    "veryslow",
    "placebo",
];

/// Form of the file or files of a film.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Form {
    Video(Codec),
    Photron,
    Other,
}

/// The codec of a video file: the one given, or the usual one of its ending; `None` if it is no video.
pub(super) fn codec_of(path: &Path, given: Option<Codec>) -> Option<Codec> {
    let usual = match ending(path).as_str() {
        "mp4" | "mov" => Codec::H264,
        "mkv" => Codec::Ffv1,
        "avi" => Codec::Raw,
        _ => return None,
    };
    Some(given.unwrap_or(usual))
}

/// The ending of a name in lower case.
pub(super) fn ending(path: &Path) -> String {
    path.extension().map(text).unwrap_or_default().to_ascii_lowercase()
}

impl WriteOptions {
    /// # Errors
    /// [`Error::Film`] for an option that the form of `path` has not, or a value that is none.
    pub(super) fn check(&self, path: &Path) -> Result<()> {
        let form = match codec_of(path, self.codec) {
            Some(codec) => Form::Video(codec),
            None if ["mraw", "cih"].contains(&ending(path).as_str()) => Form::Photron,
            None => Form::Other,
        };
        let h264 = form == Form::Video(Codec::H264);
        let wrong = [
            (Setting::Codec, self.codec.is_some() && !matches!(form, Form::Video(_)), "video files"),
            (
                Setting::Quality,
                self.quality.is_some() && !h264 && form != Form::Video(Codec::Mjpeg),
                "H.264 and MJPEG films",
            ),
            (Setting::X264Preset, self.x264_preset.is_some() && !h264, "H.264 films"),
            (Setting::GrayOnly, self.gray_only && !h264, "H.264 films"),
            (Setting::Bits, self.bits.is_some() && form != Form::Photron, "Photron's .mraw"),
        ];
        if let Some((setting, _, of)) = wrong.into_iter().find(|(_, wrong, _)| *wrong) {
            return Err(Error::Film(
                Fault::of(setting, format!("it is of {of}, and {} is none", text(path)))
                    .advice("Leave it out, or choose another ending or codec"),
            ));
        }
        match &self.x264_preset {
            Some(name) if !X264_PRESETS.contains(&name.as_str()) => Err(Error::Film(
                Fault::of(Setting::X264Preset, format!("{name:?} is not known"))
                    .advice(format!("Give one of {}", X264_PRESETS.join(", "))),
            )),
            _ => Ok(()),
        }
    }
}
