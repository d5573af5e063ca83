//! The arguments of every subcommand that reads a recording, so that one option has one name and one meaning.

use std::ops::Range;

use tracker::detect::{DetectSettings, Polarity, Threshold};
use tracker::pixel_aspect::PixelAspect;
use tracker::source::{Decoder, Interlaced, OpenOptions};

/// How a recording is opened.
#[derive(Debug, Clone, clap::Args)]
pub struct DecodeArgs {
    /// What reads compressed film
    #[arg(long, default_value = "auto", value_enum)]
    decoder: DecoderArg,
    /// Width to height of a pixel, for example 16:15, instead of what the recording says
    #[arg(long, value_name = "W:H")]
    pixel_aspect: Option<PixelAspect>,
    /// Open network addresses and devices too
    #[arg(long)]
    allow_protocol: bool,
}

impl DecodeArgs {
    pub fn options(&self, fps: Option<f64>, threads: usize, interlaced: Interlaced) -> OpenOptions {
        OpenOptions {
            fps,
            pixel_aspect: self.pixel_aspect,
            decoder: match self.decoder {
                DecoderArg::Auto => Decoder::Auto,
                DecoderArg::Ffmpeg => Decoder::Ffmpeg,
                DecoderArg::Opencv => Decoder::Opencv,
            },
            interlaced,
            allow_protocol: self.allow_protocol,
            threads,
            colour: false,
        }
    }
}

/// What is done with film whose pictures hold two fields.
#[derive(Debug, Clone, Copy, clap::Args)]
pub struct InterlacedArgs {
    /// How interlaced film is read, whose pictures hold two fields: not at all, or each picture as one
    #[arg(long, default_value = "refuse", value_enum)]
    interlaced: InterlacedArg,
}

impl InterlacedArgs {
    pub fn setting(self) -> Interlaced {
        match self.interlaced {
            InterlacedArg::Refuse => Interlaced::Refuse,
            InterlacedArg::AsFrames => Interlaced::AsFrames,
        }
    }
}

/// Which frames are followed, and what in them is a marker.
#[derive(Debug, Clone, clap::Args)]
pub struct FollowArgs {
    /// Frames a second of recorded time, instead of what the recording claims
    #[arg(long, value_name = "F")]
    pub fps: Option<f64>,
    /// Frames to follow, from A up to but not B; either may be left out
    #[arg(long, value_name = "A..B", value_parser = frames)]
    pub frames: Option<Range<u64>>,
    /// Threshold in the recording's units, or `auto`
    #[arg(long, default_value = "auto", value_name = "auto|N", value_parser = threshold, allow_hyphen_values = true)]
    threshold: Threshold,
    /// Whether markers are brighter or darker than what is around them
    #[arg(long, default_value = "auto", value_enum)]
    polarity: PolarityArg,
    /// Threads; 0 is one for each core. The result is the same for any number
    #[arg(long, default_value_t = 0, value_name = "N")]
    pub threads: usize,
    #[command(flatten)]
    decode: DecodeArgs,
    #[command(flatten)]
    interlaced: InterlacedArgs,
}

impl FollowArgs {
    pub fn open(&self) -> OpenOptions {
        self.decode.options(self.fps, self.threads, self.interlaced.setting())
    }

    pub fn detect(&self) -> DetectSettings {
        DetectSettings {
            threshold: self.threshold,
            polarity: match self.polarity {
                PolarityArg::Auto => Polarity::Auto,
                PolarityArg::Bright => Polarity::Bright,
                PolarityArg::Dark => Polarity::Dark,
            },
            ..DetectSettings::default()
        }
    }
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum PolarityArg {
    Auto,
    Bright,
    Dark,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum DecoderArg {
    Auto,
    Ffmpeg,
    Opencv,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum InterlacedArg {
    Refuse,
    AsFrames,
}

/// `A..B`, `A..` or `..B`.
fn frames(text: &str) -> Result<Range<u64>, String> {
    let form = "expected A..B, for example 0..1000";
    let (start, end) = text.split_once("..").ok_or(form)?;
    let number = |t: &str, none: u64| {
        if t.is_empty() { Ok(none) } else { t.parse().map_err(|_| format!("{t:?} is not a frame; {form}")) }
    };
    Ok(number(start, 0)?..number(end, u64::MAX)?)
}

fn threshold(text: &str) -> Result<Threshold, String> {
    if text == "auto" {
        return Ok(Threshold::Auto);
    }
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(Threshold::Raw(value)),
        _ => Err("expected auto or a number in the recording's units".into()),
    }
}
