//! Says whether damage to a recording's pixels is noticed, which depends on how they are coded.
//!
//! Owns: [`PixelDamage`], [`CODECS`]. Must not: look for damage.

/// Whether damage to pixels is noticed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PixelDamage {
    /// Each picture has a checksum, which is compared.
    Noticed,
    /// There is no checksum; a decoder notices what is no code, and takes the rest for pixels.
    Partly,
    /// There is no checksum, and whatever is there is taken for pixels.
    Unnoticed,
    /// The codec was never tried with damage.
    Unknown,
}

use PixelDamage::{Noticed, Partly, Unnoticed};

/// FFV1 whose slices have sums.
pub const FFV1_WITH_SUMS: &str = "ffv1 with sums";
/// Samples one after another, whatever the file around them.
pub const SAMPLES: &str = "samples";

/// Codecs and kinds of picture files that were tried with damage, by FFmpeg's name or their ending: the table of
/// docs/validation/robustness.md.
pub const CODECS: [(&str, PixelDamage); 70] = [
    ("apng", Noticed),
    (FFV1_WITH_SUMS, Noticed),
    ("png", Noticed),
    ("zlib", Noticed),
    ("asv1", Partly),
    ("av1", Partly),
    ("cfhd", Partly),
    ("dirac", Partly),
    ("dnxhd", Partly),
    ("dvvideo", Partly),
    ("flashsv", Partly),
    ("flashsv2", Partly),
    ("flv1", Partly),
    ("gif", Partly),
    ("h263", Partly),
    ("h264", Partly),
    ("hap", Partly),
    ("hevc", Partly),
    ("jpeg", Partly),
    ("jpeg2000", Partly),
    ("jpegls", Partly),
    ("jpg", Partly),
    ("mjpeg", Partly),
    ("mpeg1video", Partly),
    ("mpeg2video", Partly),
    ("mpeg4", Partly),
    ("msmpeg4v2", Partly),
    ("msmpeg4v3", Partly),
    ("prores", Partly),
    ("rv10", Partly),
    ("rv20", Partly),
    ("sgi", Partly),
    ("smc", Partly),
    ("speedhq", Partly),
    ("svq1", Partly),
    ("targa", Partly),
    ("theora", Partly),
    ("utvideo", Partly),
    ("vp9", Partly),
    ("wmv1", Partly),
    ("wmv2", Partly),
    ("zmbv", Partly),
    ("asv2", Unnoticed),
    ("avui", Unnoticed),
    ("bmp", Unnoticed),
    ("cinepak", Unnoticed),
    ("cljr", Unnoticed),
    ("dpx", Unnoticed),
    ("ffv1", Unnoticed),
    ("ffvhuff", Unnoticed),
    ("h261", Unnoticed),
    ("huffyuv", Unnoticed),
    ("magicyuv", Unnoticed),
    ("msvideo1", Unnoticed),
    ("pgm", Unnoticed),
    ("qtrle", Unnoticed),
    ("r10k", Unnoticed),
    ("r210", Unnoticed),
    ("rawvideo", Unnoticed),
    (SAMPLES, Unnoticed),
    ("snow", Unnoticed),
    ("tif", Unnoticed),
    ("tiff", Unnoticed),
    ("v210", Unnoticed),
    ("v308", Unnoticed),
    ("v408", Unnoticed),
    ("v410", Unnoticed),
    ("vp8", Unnoticed),
    ("y41p", Unnoticed),
    ("yuv4", Unnoticed),
];

impl PixelDamage {
    /// Of a codec by its name in [`CODECS`].
    pub fn of(codec: &str) -> Self {
        CODECS.iter().find(|(name, _)| *name == codec).map_or(Self::Unknown, |(_, known)| *known)
    }

    /// In words, for people.
    pub fn words(self) -> &'static str {
        match self {
            Noticed => "noticed: each picture carries a checksum",
            Partly => "partly noticed: the codec carries no checksum, and only what is no code is noticed",
            Unnoticed => "cannot be noticed: the codec carries no checksum",
            Self::Unknown => "not known whether it is noticed: the codec was not tried with damage",
        }
    }
}
