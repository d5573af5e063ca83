//! The arguments of every subcommand that reads a recording, so that one option has one name and one meaning.

use std::ops::Range;

use tracker::detect::{DetectSettings, Polarity, Threshold};
use tracker::pixel_aspect::PixelAspect;
use tracker::rig::Region;
use tracker::source::{Decoder, Interlaced, OpenOptions};
use tracker::wanted::{Pointed, Wanted};

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
    /// Part of the picture in which markers are looked for: first and last column and row, in px
    #[arg(long, value_name = "X0,Y0,X1,Y1", value_parser = region, allow_hyphen_values = true)]
    region: Option<Rectangle>,
    #[command(flatten)]
    wanted: WantedArgs,
    #[command(flatten)]
    decode: DecodeArgs,
    #[command(flatten)]
    interlaced: InterlacedArgs,
}

/// What is to be followed.
#[derive(Debug, Clone, clap::Args)]
struct WantedArgs {
    /// Follow what is at this place of this frame (the first if none is given); once for each marker
    #[arg(long, value_name = "X,Y[@FRAME]", allow_hyphen_values = true)]
    marker: Vec<Pointed>,
    /// How many markers there are
    #[arg(long, value_name = "N")]
    markers: Option<usize>,
    /// Follow these numbers of the picture of `tracker setup` too
    #[arg(long, value_name = "N,...", value_delimiter = ',')]
    also: Vec<usize>,
    /// Two nodes are one marker, whose name is the first; once for each pair
    #[arg(long, value_name = "N1=N2", value_parser = pair)]
    same: Vec<Pair>,
}

type Pair = [String; 2];
type Rectangle = [f64; 4];

impl FollowArgs {
    pub fn wanted(&self) -> Wanted {
        let WantedArgs { marker, markers, also, same } = self.wanted.clone();
        Wanted { marker, markers, also, same }
    }

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
            region: self.region.map(Region::Rectangle),
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

fn pair(text: &str) -> Result<Pair, String> {
    let form = "expected two names of nodes, for example n1=n2";
    let (a, b) = text.split_once('=').ok_or(form)?;
    if a.is_empty() || b.is_empty() { Err(form.into()) } else { Ok([a.to_owned(), b.to_owned()]) }
}

fn region(text: &str) -> Result<Rectangle, String> {
    let form = "expected X0,Y0,X1,Y1, for example 100,50,400,300";
    let values: Vec<f64> = text.split(',').map_while(|t| t.trim().parse().ok()).collect();
    let values: Rectangle = values.try_into().map_err(|_| form)?;
    if values.iter().all(|v| v.is_finite()) && text.split(',').count() == 4 {
        Ok(values)
    } else {
        Err(form.into())
    }
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
