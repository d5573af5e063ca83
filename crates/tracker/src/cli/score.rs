//! The subcommand `score`: a node table against the truth of a film.

use std::fmt::Write;
use std::path::PathBuf;

use crate::score::{LIMIT_PX, Score, Tracked, score};
use crate::synth::Truth;
use crate::table::read_table;

use super::print;

/// Compare a node table with the truth that `pydpend film` wrote
///
/// Names need not agree: each tracked node stands for the marker at whose place it is most often.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The node table
    nodes: PathBuf,
    /// The truth, Parquet or CSV
    truth: PathBuf,
    /// Distance within which a place agrees with a marker, px
    #[arg(long, default_value_t = LIMIT_PX, value_name = "PX")]
    limit: f64,
    /// Print everything as JSON
    #[arg(long)]
    json: bool,
}

/// Prints the score. Exit status 1 if an identity was wrong.
pub fn run(args: Args) -> anyhow::Result<u8> {
    let table = read_table(&args.nodes)?;
    let truth = Truth::read(&args.truth)?;
    let s = score(&Tracked::from(&table), &truth, args.limit)?;
    if args.json {
        print::json(&serde_json::to_value(&s)?)?;
    } else {
        let mut out = String::new();
        text(&mut out, &s)?;
        print::lines(&out)?;
    }
    Ok(u8::from(s.wrong > 0 || s.switches > 0))
}

fn text(out: &mut String, s: &Score) -> std::fmt::Result {
    writeln!(out, "frames            {} ({} of the truth missing)", s.frames, s.frames_missing)?;
    writeln!(out, "coverage          {:.3} % of {} rows", 100.0 * s.coverage, s.visible_rows)?;
    writeln!(out, "wrong identities  {}", s.wrong)?;
    writeln!(out, "switches          {}", s.switches)?;
    writeln!(out, "false positives   {}", s.false_positives)?;
    let r = &s.reacquisition;
    writeln!(
        out,
        "reacquired        {} of {} at once, {} within 3 frames, {} never; longest wait {} frames",
        r.at_once, r.cases, r.within_3, r.never, r.longest
    )?;
    writeln!(out, "error x, y        {:.4} px, {:.4} px RMS", s.rms_x_px, s.rms_y_px)?;
    if let Some(ratio) = s.error_over_sigma {
        writeln!(out, "error / sigma     {ratio:.3}")?;
    }
    for a in &s.angles {
        writeln!(
            out,
            "angle {:<12}{:.4} deg RMS, {:.4} deg at most, {} frames",
            a.body, a.rms_deg, a.worst_deg, a.frames
        )?;
    }
    for m in &s.matches {
        let stands = m.truth.as_deref().unwrap_or("no marker");
        writeln!(out, "{:<6}is {stands:<8} coverage {:.3} %", m.node, 100.0 * m.coverage)?;
    }
    for node in &s.unmatched {
        writeln!(out, "{node} was not tracked")?;
    }
    for (frame, node, at) in &s.first_wrong {
        writeln!(out, "frame {frame}: {node} is at {at}")?;
    }
    Ok(())
}
