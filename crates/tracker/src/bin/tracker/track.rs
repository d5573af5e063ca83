//! `tracker track`: a recording in, a node table out.
//!
//! Owns: its arguments, what is said of the result. Must not: do any of the work; `pipeline::run` does.

use std::io::Write;
use std::ops::Range;
use std::path::PathBuf;
use std::process::ExitCode;

use tracker::detect::{Centroid, DetectSettings, Polarity, Threshold};
use tracker::pipeline::{Existing, RunSettings, RunSummary, run as run_pipeline};
use tracker::rig::Rig;
use tracker::source::{Decoder, OpenOptions};
use tracker::table::RunEnding;

use crate::watch::Watch;

/// Follow the markers of a recording and write a node table
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The recording; `-` is standard input
    input: String,
    /// The table, Parquet or CSV by the ending
    #[arg(short, long, value_name = "OUT.{parquet,csv}")]
    output: PathBuf,
    /// Nodes, bodies and joints, as `tracker setup` writes them; found in the recording if not given
    #[arg(long, value_name = "RIG.toml")]
    rig: Option<PathBuf>,
    /// Frames a second of recorded time, instead of what the recording claims
    #[arg(long, value_name = "F")]
    fps: Option<f64>,
    /// Frames to follow, from A up to but not B; either may be left out
    #[arg(long, value_name = "A..B", value_parser = frames)]
    frames: Option<Range<u64>>,
    /// Threshold in the recording's units, or `auto`
    #[arg(long, default_value = "auto", value_name = "auto|N", value_parser = threshold, allow_hyphen_values = true)]
    threshold: Threshold,
    /// Whether markers are brighter or darker than what is around them
    #[arg(long, default_value = "auto", value_enum)]
    polarity: PolarityArg,
    /// How a centre is taken: by intensity, or by OpenCV's contours as in the paper
    #[arg(long, default_value = "weighted", value_enum)]
    centroid: CentroidArg,
    /// What reads compressed film
    #[arg(long, default_value = "auto", value_enum)]
    decoder: DecoderArg,
    /// Open network addresses and devices too
    #[arg(long)]
    allow_protocol: bool,
    /// Threads; 0 is one for each core. The table is the same for any number
    #[arg(long, default_value_t = 0, value_name = "N")]
    threads: usize,
    /// Go on where an earlier run stopped
    #[arg(long, conflicts_with = "force")]
    resume: bool,
    /// Replace the table if it is there already
    #[arg(long)]
    force: bool,
    /// Print a summary as JSON
    #[arg(long)]
    json: bool,
    /// Print neither progress nor summary
    #[arg(long, conflicts_with = "json")]
    quiet: bool,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum PolarityArg {
    Auto,
    Bright,
    Dark,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum CentroidArg {
    Weighted,
    Contour,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum DecoderArg {
    Auto,
    Ffmpeg,
    Opencv,
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

impl Args {
    fn settings(&self) -> tracker::error::Result<RunSettings> {
        Ok(RunSettings {
            input: self.input.clone(),
            output: Some(self.output.clone()),
            existing: match (self.resume, self.force) {
                (true, _) => Existing::Resume,
                (_, true) => Existing::Replace,
                _ => Existing::Refuse,
            },
            collect: false,
            rig: self.rig.as_deref().map(Rig::read).transpose()?,
            open: OpenOptions {
                fps: self.fps,
                decoder: match self.decoder {
                    DecoderArg::Auto => Decoder::Auto,
                    DecoderArg::Ffmpeg => Decoder::Ffmpeg,
                    DecoderArg::Opencv => Decoder::Opencv,
                },
                allow_protocol: self.allow_protocol,
                threads: self.threads,
            },
            frames: self.frames.clone(),
            detect: DetectSettings {
                threshold: self.threshold,
                polarity: match self.polarity {
                    PolarityArg::Auto => Polarity::Auto,
                    PolarityArg::Bright => Polarity::Bright,
                    PolarityArg::Dark => Polarity::Dark,
                },
                centroid: match self.centroid {
                    CentroidArg::Weighted => Centroid::Weighted,
                    CentroidArg::Contour => Centroid::Contour,
                },
                ..DetectSettings::default()
            },
            threads: self.threads,
        })
    }
}

/// Runs it.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let mut watch = Watch::new(args.quiet)?;
    let summary = run_pipeline(&args.settings()?, &mut watch)?;
    watch.finish();
    if !args.quiet {
        for warning in &summary.warnings {
            eprintln!("tracker: note: {warning}");
        }
    }
    let lost = summary.lost();
    let status = match &summary.meta.ending {
        RunEnding::Interrupted => {
            eprintln!(
                "tracker: interrupted after {} frames; {} holds them. Go on with --resume",
                summary.frames,
                args.output.display()
            );
            130
        }
        RunEnding::Early { frames, byte, reason } => {
            let at = byte.map(|b| format!(", byte {b}")).unwrap_or_default();
            eprintln!(
                "tracker: {}{at}: the recording ended early, after {frames} frames ({reason}). They are all in {}",
                args.input,
                args.output.display()
            );
            1
        }
        RunEnding::Complete if !lost.is_empty() => {
            eprintln!("tracker: not seen again up to the end: {}", lost.join(", "));
            1
        }
        RunEnding::Complete => 0,
    };
    if args.json {
        print_json(&args, &summary, status)?;
    } else if !args.quiet {
        print_text(&args, &summary)?;
    }
    Ok(ExitCode::from(status))
}

fn print_json(args: &Args, summary: &RunSummary, status: u8) -> anyhow::Result<()> {
    let value = serde_json::json!({
        "output": args.output,
        "status": status,
        "ending": summary.meta.ending,
        "frames": summary.frames,
        "resumed_frames": summary.resumed,
        "lost": summary.lost(),
        "nodes": summary.nodes,
        "warnings": summary.warnings,
        "source": summary.meta.source,
    });
    ignore_closed(writeln!(std::io::stdout(), "{}", serde_json::to_string_pretty(&value)?))
}

fn print_text(args: &Args, summary: &RunSummary) -> anyhow::Result<()> {
    let mut out = format!(
        "{}: {} frames, {} nodes\nnode      body            seen  missing  ambiguous  longest gap  sigma_px\n",
        args.output.display(),
        summary.frames,
        summary.nodes.len()
    );
    for n in &summary.nodes {
        let sigma = n.sigma_px.map_or_else(|| "-".into(), |s| format!("{s:.4}"));
        out.push_str(&format!(
            "{:<9} {:<12} {:>7}  {:>7}  {:>9}  {:>11}  {:>8}\n",
            n.node, n.body, n.seen, n.missing, n.ambiguous, n.longest_gap, sigma
        ));
    }
    ignore_closed(write!(std::io::stdout(), "{out}"))
}

/// Whoever reads our output may stop reading it.
fn ignore_closed(written: std::io::Result<()>) -> anyhow::Result<()> {
    match written {
        Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        other => Ok(other?),
    }
}
