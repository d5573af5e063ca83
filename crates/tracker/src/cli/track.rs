//! The subcommand `track`: a recording in, a node table out.
//!
//! Owns: its arguments, what is said of the result. Must not: do any of the work; `pipeline::run` does.

use std::ffi::OsString;
use std::path::PathBuf;

use crate::csv_text::Cells;
use crate::edits::Edits;
use crate::error::Error;
use crate::name::{shown, text};
use crate::pipeline::{Existing, RunSettings, RunSummary, partial_path, run as run_pipeline};
use crate::rig::Rig;
use crate::table::RunEnding;

use super::print;
use super::reading::ReadArgs;
use super::unclear;
use super::watch::{INTERRUPTED, Watch};
use super::words::CommandLine;

/// Follow the markers of a recording and write a node table
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The recording; `-` is standard input
    input: OsString,
    /// The table, Parquet or CSV by the ending
    #[arg(short, long, value_name = "OUT.{parquet,csv}")]
    output: PathBuf,
    /// Nodes, bodies and joints, as `pydpend setup` writes them; found in the recording if not given
    #[arg(long, value_name = "RIG.toml")]
    rig: Option<PathBuf>,
    /// Decisions of people, in the form of docs/reference/edits.md, made on the rows before they are written
    #[arg(long, value_name = "EDITS.toml")]
    edits: Option<PathBuf>,
    #[command(flatten)]
    read: ReadArgs,
    /// Go on where an earlier run stopped
    #[arg(long, conflicts_with = "force")]
    resume: bool,
    /// Replace files that are there already
    #[arg(long)]
    force: bool,
    /// In a CSV put a ' before names that a spreadsheet would take for a formula; readers of ours take it off again
    #[arg(long)]
    safe_csv: bool,
    /// Print a summary as JSON
    #[arg(long)]
    json: bool,
    /// Print neither progress nor summary
    #[arg(long, conflicts_with = "json")]
    quiet: bool,
}

impl Args {
    fn settings(&self) -> crate::error::Result<RunSettings> {
        Ok(RunSettings {
            output: Some(self.output.clone()),
            existing: match (self.resume, self.force) {
                (true, _) => Existing::Resume,
                (_, true) => Existing::Replace,
                _ => Existing::Refuse,
            },
            rig: self.rig.as_deref().map(Rig::read).transpose()?,
            edits: self.edits.as_deref().map(Edits::read).transpose()?,
            cells: if self.safe_csv { Cells::Safe } else { Cells::Plain },
            reads: self.rig.iter().chain(&self.edits).cloned().collect(),
            ..self.read.settings(text(&self.input))
        })
    }
}

/// Runs it.
pub fn run(args: Args, front: &CommandLine) -> anyhow::Result<u8> {
    let mut watch = Watch::new(args.quiet);
    let settings = args.settings()?;
    let outcome = run_pipeline(&settings, &mut watch);
    if let Err(Error::Detect(_) | Error::Rig(_)) = &outcome {
        let picture = unclear::picture_beside(&args.output);
        unclear::tell(&settings, &picture, args.force, &mut watch, front);
    }
    watch.finish();
    let state = partial_path(&args.output);
    if matches!(outcome, Err(Error::Interrupted)) && state.exists() {
        let state = text(&state);
        front.tell(format!("interrupted; {state} holds what was detected. Go on with --resume"));
        return Ok(INTERRUPTED);
    }
    let summary = outcome?;
    if !args.quiet {
        for warning in &summary.warnings {
            front.tell(format!("note: {}", front.say(warning)));
        }
    }
    let lost = summary.lost();
    if let Some(words) = summary.meta.damage.words() {
        front.tell(format!("{}: {words}. All other frames are in {}", text(&args.input), text(&args.output)));
    }
    let status = match &summary.meta.ending {
        RunEnding::Interrupted => {
            let go_on = if summary.resumable { ". Go on with --resume" } else { "" };
            let output = text(&args.output);
            front.tell(format!("interrupted after {} frames; {output} holds them{go_on}", summary.frames));
            INTERRUPTED
        }
        RunEnding::Early { frames, byte, reason } => {
            let at = byte.map(|b| format!(", byte {b}")).unwrap_or_default();
            front.tell(format!(
                "{}{at}: the recording ended early, after {frames} frames ({reason}). They are all in {}",
                text(&args.input),
                text(&args.output)
            ));
            1
        }
        RunEnding::Complete | RunEnding::Damaged if !lost.is_empty() => {
            front.tell(format!("not seen again up to the end: {}", lost.join(", ")));
            1
        }
        RunEnding::Complete if !summary.not_followed.is_empty() => {
            front.tell(format!("not followed, as the notes say: {}", summary.not_followed.join(", ")));
            1
        }
        RunEnding::Complete if !summary.doubtful.is_empty() => {
            front.tell(format!("doubtful, as the notes say: {}", summary.doubtful.join(", ")));
            1
        }
        RunEnding::Complete if !summary.open.is_empty() => {
            front.tell(format!("names stay open, as the notes say: {}", summary.open.join(", ")));
            1
        }
        RunEnding::Damaged => 1,
        RunEnding::Complete => 0,
    };
    if args.json {
        print_json(&args, &summary, status, front)?;
    } else if !args.quiet {
        print_text(&args, &summary)?;
    }
    Ok(status)
}

fn print_json(args: &Args, summary: &RunSummary, status: u8, front: &CommandLine) -> anyhow::Result<()> {
    let value = serde_json::json!({
        "output": shown(&text(&args.output)),
        "status": status,
        "ending": summary.meta.ending,
        "damage": summary.meta.damage,
        "frames": summary.frames,
        "resumed_frames": summary.resumed,
        "lost": summary.lost(),
        "not_followed": summary.not_followed,
        "open": summary.open,
        "nodes": summary.nodes,
        "warnings": summary.warnings.iter().map(|w| front.say(w)).collect::<Vec<_>>(),
        "source": summary.meta.source,
    });
    print::json(&value)
}

fn print_text(args: &Args, summary: &RunSummary) -> anyhow::Result<()> {
    let mut out = format!(
        "{}: {} frames, {} nodes\nnode      body            seen  missing  ambiguous  longest gap  sigma_px\n",
        text(&args.output),
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
    print::lines(&out)
}
