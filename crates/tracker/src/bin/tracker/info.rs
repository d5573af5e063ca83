//! `tracker info`: what a recording is, without tracking it.

use std::io::Write;
use std::process::ExitCode;

use rayon::prelude::*;
use serde_json::{Value, json};
use tracker::brightest::brightest;
use tracker::frame::{Ending, Frame, FrameSource, PixelFormat, RateOrigin, SourceInfo};
use tracker::pixel_aspect::AspectOrigin;
use tracker::source::{OpenOptions, open};

use crate::reading::DecodeArgs;
use crate::words::CommandLine;

/// Frames whose time stamps are shown.
const FIRST: usize = 5;
/// Most bytes of frames that are looked at side by side; at least one is.
const BATCH_BYTES: usize = 32 << 20;

/// Show container, size, bit depth, frames, rate and its origin, first time stamps, warnings
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A recording, a folder of pictures, a pattern such as "img_%05d.png", or - for standard input
    input: String,
    /// Write JSON
    #[arg(long)]
    json: bool,
    /// Decode all frames, count them and look for the brightest pixel
    #[arg(long)]
    count: bool,
    /// Frames a second of recorded time, instead of what the recording claims
    #[arg(long, value_name = "F")]
    fps: Option<f64>,
    #[command(flatten)]
    decode: DecodeArgs,
}

/// What reading some or all frames told.
struct Seen {
    times_s: Vec<f64>,
    counted: Option<(u64, u64)>,
    /// The greatest sample of all frames.
    brightest: Option<u16>,
    ending: Option<Ending>,
    last_s: Option<f64>,
}

/// Runs the subcommand.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let options = args.decode.options(args.fps, OpenOptions::default().threads);
    let mut source = open(&args.input, &options)?;
    let seen = look(&mut *source, args.count)?;
    let text = if args.json { format!("{:#}\n", as_json(&*source, &seen)) } else { as_text(&*source, &seen) };
    std::io::stdout().lock().write_all(text.as_bytes())?;
    let early = matches!(seen.ending, Some(Ending::Early { .. }));
    Ok(ExitCode::from(u8::from(early)))
}

fn look(source: &mut dyn FrameSource, count: bool) -> anyhow::Result<Seen> {
    let time_base = source.info().time_base;
    let mut seen = Seen { times_s: Vec::new(), counted: None, brightest: None, ending: None, last_s: None };
    let (mut frames, mut lost) = (0u64, 0u64);
    let mut batch: Vec<Frame> = Vec::new();
    let mut bytes = 0;
    while count || seen.times_s.len() < FIRST {
        let Some(frame) = source.next_frame()? else {
            seen.ending = Some(source.ending());
            break;
        };
        frames += 1;
        lost += u64::from(frame.plane.is_none());
        let time = time_base.seconds(frame.ticks);
        seen.last_s = Some(time);
        if seen.times_s.len() < FIRST {
            seen.times_s.push(time);
        }
        bytes += frame.plane.as_ref().map_or(0, |p| p.bytes().len());
        batch.push(frame);
        if bytes >= BATCH_BYTES {
            seen.brightest = seen.brightest.max(brightest_of(&mut batch));
            bytes = 0;
        }
    }
    if seen.ending.is_some() {
        seen.counted = Some((frames, lost));
        seen.brightest = seen.brightest.max(brightest_of(&mut batch));
    }
    Ok(seen)
}

/// The greatest sample of the frames, each looked at by whichever core is free; empties the vector.
fn brightest_of(batch: &mut Vec<Frame>) -> Option<u16> {
    batch.par_drain(..).filter_map(|frame| brightest(&frame)).max()
}

fn format_name(format: PixelFormat) -> &'static str {
    match format {
        PixelFormat::Gray8 => "gray 8",
        PixelFormat::Gray16 => "gray 16",
        PixelFormat::Packed10 => "packed 10",
        PixelFormat::Packed12 => "packed 12",
    }
}

fn origin_words(origin: RateOrigin) -> &'static str {
    match origin {
        RateOrigin::User => "as given with --fps",
        RateOrigin::TimeStamps => "from the frames' time stamps",
        RateOrigin::CameraHeader => "from the camera's header",
        RateOrigin::Container => "as the container says, which may be a player's speed and not the camera's",
        RateOrigin::Unknown => "unknown",
    }
}

fn aspect_words(info: &SourceInfo) -> String {
    match (info.pixel_aspect.is_square(), info.pixel_aspect_origin) {
        (true, AspectOrigin::Recording) => "1:1, square".to_owned(),
        (_, origin) => format!("{}, {}", info.pixel_aspect.words(), origin.words()),
    }
}

/// Length in s: of what was counted, else of what is declared.
fn duration_s(source: &dyn FrameSource, seen: &Seen) -> Option<f64> {
    let rate = source.info().rate_hz.filter(|r| *r > 0.0);
    if seen.counted.is_some() {
        let span = seen.last_s? - seen.times_s.first()?;
        return Some(span + rate.map_or(0.0, |r| 1.0 / r));
    }
    Some(source.info().declared_frames? as f64 / rate?)
}

fn ending_words(ending: &Ending) -> String {
    match ending {
        Ending::Complete => "complete".to_owned(),
        Ending::Early { frames, byte, reason } => {
            let place = byte.map_or(String::new(), |b| format!(", byte {b}"));
            format!("early, after frame {}{place}: {reason}", frames.saturating_sub(1))
        }
    }
}

fn as_text(source: &dyn FrameSource, seen: &Seen) -> String {
    let info = source.info();
    let mut rows: Vec<(String, String)> = Vec::new();
    let mut row = |word: &str, value: String| rows.push((word.to_owned(), value));
    row("recording", info.name.clone());
    row("container", info.container.clone());
    row("codec", info.codec.clone());
    row("size", format!("{} x {} px", info.width, info.height));
    row("pixel aspect", aspect_words(info));
    row("pixels", format!("{}, {} bit", format_name(info.format), info.depth_bits));
    if let Some(from) = &info.converted_from {
        row("converted", format!("from {from}, once for each frame"));
    }
    row("declared", info.declared_frames.map_or("not said".to_owned(), |n| format!("{n} frames")));
    if let Some((frames, lost)) = seen.counted {
        let lost = if lost > 0 { format!(", of these {lost} cannot be decoded") } else { String::new() };
        row("decoded", format!("{frames} frames{lost}"));
    }
    if let Some(brightest) = seen.brightest {
        row("brightest", format!("{brightest} of {}", (1u32 << info.depth_bits) - 1));
    }
    let rate = info.rate_hz.map_or(String::new(), |r| format!("{r} frames per second, "));
    row("rate", format!("{rate}{}", origin_words(info.rate_origin)));
    row("time base", format!("{}/{} s", info.time_base.numerator, info.time_base.denominator));
    if let Some(duration) = duration_s(source, seen) {
        row("duration", format!("{duration:.9} s"));
    }
    let stamps: Vec<String> = seen.times_s.iter().map(|t| format!("{t:.9}")).collect();
    row("first times", format!("{} s", stamps.join(", ")));
    if let Some(bytes) = info.size_bytes {
        row("bytes", bytes.to_string());
    }
    for (word, value) in &info.details {
        row(word, value.clone());
    }
    if let Some(ending) = &seen.ending {
        row("end", ending_words(ending));
    }
    for warning in &info.warnings {
        row("warning", CommandLine::of("info").say(warning));
    }
    rows.iter().map(|(word, value)| format!("{word:<14} {value}\n")).collect()
}

fn as_json(source: &dyn FrameSource, seen: &Seen) -> Value {
    let info = source.info();
    let details: serde_json::Map<String, Value> =
        info.details.iter().map(|(k, v)| (k.clone(), Value::from(v.clone()))).collect();
    let ending = seen.ending.as_ref().map(|e| match e {
        Ending::Complete => json!({"status": "complete"}),
        Ending::Early { frames, byte, reason } => {
            json!({"status": "early", "frames": frames, "byte": byte, "reason": reason})
        }
    });
    json!({
        "name": info.name,
        "container": info.container,
        "codec": info.codec,
        "width_px": info.width,
        "height_px": info.height,
        "pixel_aspect": info.pixel_aspect,
        "pixel_aspect_origin": info.pixel_aspect_origin,
        "pixel_format": format_name(info.format),
        "depth_bits": info.depth_bits,
        "converted_from": info.converted_from,
        "declared_frames": info.declared_frames,
        "decoded_frames": seen.counted.map(|(frames, lost)| frames - lost),
        "undecodable_frames": seen.counted.map(|(_, lost)| lost),
        "brightest": seen.brightest,
        "rate_hz": info.rate_hz,
        "rate_origin": info.rate_origin,
        "time_base": {"numerator": info.time_base.numerator, "denominator": info.time_base.denominator},
        "duration_s": duration_s(source, seen),
        "first_times_s": seen.times_s,
        "size_bytes": info.size_bytes,
        "details": details,
        "warnings": info.warnings.iter().map(|w| CommandLine::of("info").say(w)).collect::<Vec<_>>(),
        "ending": ending,
    })
}
