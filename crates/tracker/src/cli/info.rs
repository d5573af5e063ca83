//! The subcommand `info`: what a recording is, without tracking it.

use std::ffi::OsString;

use crate::error::Error;
use crate::frame::{Ending, Frame, FrameSource, PixelFormat, SourceInfo};
use crate::gaps::Damage;
use crate::name::{shown, text};
use crate::peak_level::peak_level;
use crate::pipeline;
use crate::pixel_aspect::AspectOrigin;
use crate::source::{Interlaced, open};
use crate::timing::{Steps, Timing, notes, rate_words, times_words};
use rayon::prelude::*;
use serde_json::{Value, json};

use super::print;
use super::reading::OpenArgs;
use super::words::CommandLine;

/// Number of frames whose time stamps are shown.
const FIRST: usize = 5;
/// Most bytes of frames that are looked at side by side; at least one is.
const BATCH_BYTES: usize = 32 << 20;

/// Show container, size, bit depth, frames, rate and its origin, first time stamps, warnings
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A recording, a folder of pictures, a pattern such as "img_%05d.png", or - for standard input
    input: OsString,
    /// Write JSON
    #[arg(long)]
    json: bool,
    /// Decode all frames, count them and look for the brightest pixel
    #[arg(long)]
    count: bool,
    #[command(flatten)]
    open: OpenArgs,
}

/// Facts from reading some or all frames.
struct Seen {
    /// Time stamps of the first frames.
    first: Vec<i64>,
    /// Time stamps of all frames that were looked at, and whether these are all there are.
    steps: Steps,
    is_whole: bool,
    /// Frames of the whole recording, where all were read.
    counted: Option<u64>,
    damage: Damage,
    /// The greatest sample of all frames.
    brightest: Option<u16>,
    ending: Option<Ending>,
}

/// Times of the recording.
struct Times {
    timing: Timing,
    first_s: Vec<f64>,
    duration_s: Option<f64>,
}

/// Runs the subcommand.
pub fn run(args: Args, front: &CommandLine) -> anyhow::Result<u8> {
    // What film is can be told of interlaced film too.
    let options = args.open.options(Interlaced::AsFrames);
    let mut source = open(&text(&args.input), &options)?;
    let seen = look(&mut *source, args.count)?;
    let times = times(&*source, &seen)?;
    if args.json {
        print::json(&as_json(&*source, &seen, &times, front))?;
    } else {
        print::lines(&as_text(&*source, &seen, &times, front))?;
    }
    let early = matches!(seen.ending, Some(Ending::Early { .. }));
    Ok(u8::from(early || seen.damage.is_damaged()))
}

/// Decides what the times are by all stamps that were seen.
fn times(source: &dyn FrameSource, seen: &Seen) -> anyhow::Result<Times> {
    let info = source.info();
    let (timing, clock) = pipeline::times(info, &seen.steps, 0)?;
    let first_s: Vec<f64> = seen.first.iter().zip(0..).map(|(&t, i)| clock.seconds(i, t)).collect();
    let last = seen.steps.len().checked_sub(1).filter(|_| seen.is_whole);
    let span =
        last.zip(first_s.first()).map(|(place, first)| clock.seconds(place, seen.steps.last()) - first);
    let duration_s = match (span, timing.rate_hz) {
        (Some(span), rate) => Some(span + rate.map_or(0.0, |r| 1.0 / r)),
        (None, rate) => info.declared_frames.zip(rate).map(|(n, r)| n as f64 / r),
    };
    Ok(Times { timing, first_s, duration_s })
}

fn look(source: &mut dyn FrameSource, count: bool) -> anyhow::Result<Seen> {
    let mut seen = Seen {
        first: Vec::new(),
        steps: Steps::default(),
        is_whole: false,
        counted: None,
        damage: Damage::default(),
        brightest: None,
        ending: None,
    };
    let surveyed = if count { None } else { pipeline::survey(source)? };
    let stamped = surveyed.is_some();
    (seen.steps, seen.is_whole) = surveyed.unwrap_or_default();
    let mut frames = 0u64;
    let mut batch: Vec<Frame> = Vec::new();
    let mut bytes = 0;
    while count || seen.first.len() < FIRST {
        let Some(frame) = source.next_frame()? else {
            seen.ending = Some(source.ending());
            break;
        };
        frames += 1;
        if frame.plane.is_none() {
            seen.damage.undecoded.push(frame.index);
        }
        if !stamped {
            seen.steps.push(frame.ticks);
        }
        if seen.first.len() < FIRST {
            seen.first.push(frame.ticks);
        }
        bytes += frame.size_bytes();
        batch.push(frame);
        if bytes >= BATCH_BYTES {
            seen.brightest = seen.brightest.max(peak_of(&mut batch)?);
            bytes = 0;
        }
    }
    if seen.ending.is_some() {
        seen.counted = Some(frames);
        seen.is_whole = true;
        seen.damage.gaps = source.gaps();
        seen.damage.reasons = source.reasons();
        seen.brightest = seen.brightest.max(peak_of(&mut batch)?);
    }
    Ok(seen)
}

/// The greatest sample of the frames, each looked at by whichever core is free; empties the vector.
fn peak_of(batch: &mut Vec<Frame>) -> Result<Option<u16>, Error> {
    batch.par_drain(..).map(|frame| peak_level(&frame)).try_reduce(|| None, |a, b| Ok(a.max(b)))
}

fn format_name(format: PixelFormat) -> &'static str {
    match format {
        PixelFormat::Gray8 => "gray 8",
        PixelFormat::Gray16 => "gray 16",
        PixelFormat::Packed10 => "packed 10",
        PixelFormat::Packed12 => "packed 12",
    }
}

fn aspect_words(info: &SourceInfo) -> String {
    match (info.pixel_aspect.is_square(), info.pixel_aspect_origin) {
        (true, AspectOrigin::Recording) => "1:1, square".to_owned(),
        (_, origin) => format!("{}, {}", info.pixel_aspect.words(), origin.words()),
    }
}

fn ending_words(ending: &Ending, damage: &Damage) -> String {
    let damaged = damage.words();
    match ending {
        Ending::Complete => damaged.unwrap_or_else(|| "complete".to_owned()),
        Ending::Early { frames, byte, reason } => {
            let place = byte.map_or(String::new(), |b| format!(", byte {b}"));
            let damaged = damaged.map_or(String::new(), |d| format!("; {d}"));
            format!("early, after frame {}{place}: {reason}{damaged}", frames.saturating_sub(1))
        }
    }
}

fn as_text(source: &dyn FrameSource, seen: &Seen, times: &Times, front: &CommandLine) -> String {
    let info = source.info();
    let mut rows: Vec<(String, String)> = Vec::new();
    let mut row = |word: &str, value: String| rows.push((word.to_owned(), value));
    row("recording", info.name.clone());
    row("container", info.container.clone());
    row("codec", info.codec.clone());
    row("size", format!("{} x {} px", info.width, info.height));
    row("pixel aspect", aspect_words(info));
    row("pixels", format!("{}, {} bit", format_name(info.format), info.depth_bits));
    row("pixel damage", info.pixel_damage.words().to_owned());
    if let Some(from) = &info.converted_from {
        row("converted", format!("from {from}, once for each frame"));
    }
    row("declared", info.declared_frames.map_or("not said".to_owned(), |n| format!("{n} frames")));
    if let Some(frames) = packets(seen) {
        row("frames", format!("{frames}, by the packets in the file"));
    }
    if let Some(frames) = seen.counted {
        let lost = match seen.damage.undecoded.frames {
            0 => String::new(),
            lost if !seen.damage.reasons.is_empty() => format!("; {lost} cannot be used"),
            lost => format!("; {lost} cannot be decoded"),
        };
        row("decoded", format!("{} frames{lost}", frames - seen.damage.undecoded.frames));
    }
    if let Some(brightest) = seen.brightest {
        row("brightest", format!("{brightest} of {}", (1u32 << info.depth_bits) - 1));
    }
    let timing = &times.timing;
    row("rate", front.say(&rate_words(timing)));
    let of = if seen.is_whole {
        String::new()
    } else {
        format!("; by the first {} frames, --count looks at all", seen.steps.len())
    };
    row("times", format!("{}{of}", times_words(timing)));
    row("time base", format!("{}/{} s", info.time_base.numerator, info.time_base.denominator));
    if let Some(duration) = times.duration_s {
        row("duration", format!("{duration:.9} s"));
    }
    let stamps: Vec<String> = times.first_s.iter().map(|t| format!("{t:.9}")).collect();
    row("first times", format!("{} s", stamps.join(", ")));
    if let Some(bytes) = info.size_bytes {
        row("bytes", bytes.to_string());
    }
    for (word, value) in &info.details {
        row(word, value.clone());
    }
    if let Some(ending) = &seen.ending {
        row("end", ending_words(ending, &seen.damage));
    }
    if let Some(dropped) = seen.damage.gaps.dropped_words() {
        row("warning", dropped);
    }
    for note in &notes(timing) {
        row("note", front.say(note));
    }
    for warning in &info.warnings {
        row("warning", front.say(warning));
    }
    rows.iter().map(|(word, value)| format!("{word:<14} {}\n", shown(value))).collect()
}

/// Frames that there are without decoding them.
fn packets(seen: &Seen) -> Option<u64> {
    (seen.is_whole && seen.counted.is_none()).then(|| seen.steps.len())
}

fn as_json(source: &dyn FrameSource, seen: &Seen, times: &Times, front: &CommandLine) -> Value {
    let info = source.info();
    let details: serde_json::Map<String, Value> =
        info.details.iter().map(|(k, v)| (k.clone(), Value::from(v.clone()))).collect();
    let ending = seen.ending.as_ref().map(|e| match e {
        Ending::Complete if seen.damage.is_damaged() => json!({"status": "damaged"}),
        Ending::Complete => json!({"status": "complete"}),
        Ending::Early { frames, byte, reason } => {
            json!({"status": "early", "frames": frames, "byte": byte, "reason": reason})
        }
    });
    json!({
        "name": shown(&info.name),
        "container": info.container,
        "codec": info.codec,
        "width_px": info.width,
        "height_px": info.height,
        "pixel_aspect": info.pixel_aspect,
        "pixel_aspect_origin": info.pixel_aspect_origin,
        "pixel_format": format_name(info.format),
        "depth_bits": info.depth_bits,
        "pixel_damage": info.pixel_damage,
        "converted_from": info.converted_from,
        "declared_frames": info.declared_frames,
        "decoded_frames": seen.counted.map(|frames| frames - seen.damage.undecoded.frames),
        "undecodable_frames": seen.counted.map(|_| seen.damage.undecoded.frames),
        "damage": seen.counted.map(|_| &seen.damage),
        "brightest": seen.brightest,
        "frames": packets(seen).or(seen.counted),
        "rate_hz": times.timing.rate_hz,
        "rate_origin": times.timing.rate_origin,
        "time": times.timing,
        "time_base": {"numerator": info.time_base.numerator, "denominator": info.time_base.denominator},
        "duration_s": times.duration_s,
        "first_times_s": times.first_s,
        "size_bytes": info.size_bytes,
        "details": details,
        "warnings": info.warnings.iter().map(|w| front.say(w)).collect::<Vec<_>>(),
        "ending": ending,
    })
}
