//! Defines the arguments of every subcommand that reads a recording, so that one option has one name and one meaning.

use std::ops::Range;

use crate::detect::{Centroid, DetectSettings, PolaritySetting, Threshold};
use crate::pipeline::RunSettings;
use crate::pixel_aspect::PixelAspect;
use crate::rig::Region;
use crate::setting_words::{Worded, frame_range};
use crate::source::{Decoder, Interlaced, OpenOptions};
use crate::wanted::{Pointed, Wanted};
use clap::builder::{PossibleValuesParser, TypedValueParser};

/// Arguments of opening a recording: of every subcommand that reads one.
#[derive(Debug, Clone, clap::Args)]
pub struct OpenArgs {
    /// Frames a second of recorded time, instead of what the recording claims
    #[arg(long, value_name = "F")]
    fps: Option<f64>,
    /// Library that decodes compressed film
    #[arg(long, default_value = "auto", value_parser = word::<Decoder>())]
    decoder: Decoder,
    /// How interlaced film is read, whose pictures hold two fields: not at all, or each picture as one
    #[arg(long, value_parser = word::<Interlaced>())]
    interlaced: Option<Interlaced>,
    /// Width to height of a pixel, for example 16:15, instead of what the recording says
    #[arg(long, value_name = "W:H")]
    pixel_aspect: Option<PixelAspect>,
    /// Open network addresses and devices too
    #[arg(long)]
    allow_protocol: bool,
    /// Threads; 0 is one for each core. The result is the same for any number
    #[arg(long, default_value_t = 0, value_name = "N")]
    threads: usize,
}

impl OpenArgs {
    /// The options. `interlaced` is how interlaced film is read where nothing was said.
    pub fn options(&self, interlaced: Interlaced) -> OpenOptions {
        OpenOptions {
            fps: self.fps,
            pixel_aspect: self.pixel_aspect,
            decoder: self.decoder,
            interlaced: self.interlaced.unwrap_or(interlaced),
            allow_protocol: self.allow_protocol,
            threads: self.threads,
            colour: false,
        }
    }
}

/// Arguments of detection: of every subcommand that looks for markers.
#[derive(Debug, Clone, clap::Args)]
pub struct DetectArgs {
    /// Frames to follow, from A up to but not B; either may be left out
    #[arg(long, value_name = "A..B", value_parser = frame_range)]
    frames: Option<Range<u64>>,
    /// Threshold in the recording's units, or `auto`
    #[arg(long, default_value = "auto", value_name = "auto|N", allow_hyphen_values = true)]
    threshold: Threshold,
    /// Whether markers are brighter or darker than what is around them
    #[arg(long, default_value = "auto", value_parser = word::<PolaritySetting>())]
    polarity: PolaritySetting,
    /// How a centre is taken: by the disc that fits, by intensity, or by OpenCV's contours as in the paper
    #[arg(long, default_value = "disc", value_parser = word::<Centroid>())]
    centroid: Centroid,
    /// Part of the image in which markers are looked for: first and last column and row
    #[arg(long, value_name = "X0,Y0,X1,Y1", allow_hyphen_values = true)]
    region: Option<Region>,
    /// Least area of a marker in px; learned if not given
    #[arg(long, value_name = "PX")]
    min_area_px: Option<f64>,
    /// Greatest area of a marker in px; learned if not given
    #[arg(long, value_name = "PX")]
    max_area_px: Option<f64>,
}

/// Arguments of what is to be followed.
#[derive(Debug, Clone, clap::Args)]
struct WantedArgs {
    /// Follow what is at this place of this frame (the first if none is given); once for each marker
    #[arg(long, value_name = "X,Y[@FRAME]", allow_hyphen_values = true)]
    marker: Vec<Pointed>,
    /// How many markers there are
    #[arg(long, value_name = "N")]
    markers: Option<usize>,
    /// Follow these numbers of the picture of `pydpend setup` too
    #[arg(long, value_name = "N,...", value_delimiter = ',')]
    also: Vec<usize>,
    /// Two nodes are one marker, whose name is the first; once for each pair
    #[arg(long, value_name = "N1=N2", value_parser = pair)]
    same: Vec<Pair>,
}

type Pair = [String; 2];

impl WantedArgs {
    fn wanted(&self) -> Wanted {
        let Self { marker, markers, also, same } = self.clone();
        Wanted { marker, markers, also, same }
    }
}

/// Arguments of opening and detection together.
#[derive(Debug, Clone, clap::Args)]
pub struct ReadArgs {
    #[command(flatten)]
    detect: DetectArgs,
    #[command(flatten)]
    wanted: WantedArgs,
    #[command(flatten)]
    open: OpenArgs,
}

impl ReadArgs {
    /// A run that reads `input` so.
    pub fn settings(&self, input: String) -> RunSettings {
        let open = self.open.options(Interlaced::default());
        RunSettings {
            input,
            frames: self.detect.frames.clone(),
            detect: DetectSettings {
                threshold: self.detect.threshold,
                polarity: self.detect.polarity,
                centroid: self.detect.centroid,
                region: self.detect.region.clone(),
                min_area_px: self.detect.min_area_px,
                max_area_px: self.detect.max_area_px,
                ..DetectSettings::default()
            },
            wanted: self.wanted.wanted(),
            threads: open.threads,
            open,
            ..RunSettings::default()
        }
    }
}

/// Reads a word of a setting.
pub fn word<T: Worded + Send + Sync>() -> impl TypedValueParser<Value = T> {
    let words = T::WORDS.iter().map(|(word, _)| *word);
    PossibleValuesParser::new(words).try_map(|word| T::from_word(&word).map_err(|fault| fault.to_string()))
}

/// Two names of nodes.
fn pair(text: &str) -> Result<Pair, String> {
    let form = "expected two names of nodes, for example n1=n2";
    let (a, b) = text.split_once('=').ok_or(form)?;
    if a.is_empty() || b.is_empty() { Err(form.into()) } else { Ok([a.to_owned(), b.to_owned()]) }
}

#[cfg(test)]
mod tests {
    use clap::{Args, Command};

    use super::super::args::command;
    use super::*;

    /// The flags of some arguments.
    fn flags<A: Args>() -> Vec<String> {
        flags_of(&A::augment_args(Command::new("all")))
    }

    fn flags_of(command: &Command) -> Vec<String> {
        command.get_arguments().filter_map(|a| a.get_long()).map(str::to_owned).collect()
    }

    #[test]
    fn every_command_takes_every_option_of_what_it_reads() {
        let whole = command("tracker");
        let (mut opens, mut detects) = (Vec::new(), Vec::new());
        for command in whole.get_subcommands() {
            let has = flags_of(command);
            let takes = |flags: Vec<String>| {
                let missing: Vec<String> = flags.iter().filter(|f| !has.contains(f)).cloned().collect();
                // A flag such as --fps may mean another thing where nothing is read.
                (missing.len() < flags.len() - 1).then_some(missing)
            };
            for (list, flags) in [
                (&mut opens, flags::<OpenArgs>()),
                (&mut detects, [flags::<DetectArgs>(), flags::<WantedArgs>()].concat()),
            ] {
                if let Some(missing) = takes(flags) {
                    assert!(missing.is_empty(), "{} lacks {missing:?}", command.get_name());
                    list.push(command.get_name().to_owned());
                }
            }
        }
        assert_eq!(opens, ["info", "setup", "track", "overlay"]);
        assert_eq!(detects, ["setup", "track"]);
    }
}
