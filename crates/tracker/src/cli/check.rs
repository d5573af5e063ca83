//! The subcommand `check`: whether a node table is valid, and what became of each node.
//!
//! Owns: its arguments, the summary as text. Must not: decide what is valid.

use std::fmt::Write;
use std::path::PathBuf;

use crate::name::{shown, text};
use crate::residual::residuals;
use crate::table::read_table;

use super::print;

/// Check a node table and sum it up
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The table
    nodes: PathBuf,
    /// Print as JSON
    #[arg(long)]
    json: bool,
}

/// Runs it.
pub fn run(args: Args) -> anyhow::Result<u8> {
    // Reading checks.
    let table = read_table(&args.nodes)?;
    let summary = table.summary();
    let fits = residuals(&table.meta.rig, &table.rows);
    if args.json {
        let nodes: Vec<serde_json::Value> =
            summary.iter().zip(&fits).map(|(s, f)| serde_json::json!({"summary": s, "motion": f})).collect();
        let value = serde_json::json!({
            "table": shown(&text(&args.nodes)),
            "frames": table.frames(),
            "nodes": nodes,
            "ending": table.meta.ending,
            "damage": table.meta.damage,
        });
        print::json(&value)?;
        return Ok(0);
    }
    let mut out = String::new();
    writeln!(out, "{}: valid, {} frames, {} nodes", text(&args.nodes), table.frames(), summary.len())?;
    for words in table.meta.damage.words().into_iter().chain(table.meta.damage.gaps.dropped_words()) {
        writeln!(out, "{words}")?;
    }
    writeln!(
        out,
        "node      body            seen  gaps  longest gap  ambiguous  sigma_px  residual_px  px per frame"
    )?;
    let number = |v: Option<f64>, d: usize| v.map_or_else(|| "-".into(), |v| format!("{v:.d$}"));
    for (s, f) in summary.iter().zip(&fits) {
        writeln!(
            out,
            "{:<9} {:<12} {:>7}  {:>4}  {:>11}  {:>9}  {:>8}  {:>11}  {:>12}",
            s.node,
            s.body,
            s.seen,
            f.gaps,
            s.longest_gap,
            s.ambiguous,
            number(s.sigma_px, 4),
            number(f.residual_px, 4),
            number(f.fastest_px, 2),
        )?;
    }
    print::lines(&out)?;
    Ok(0)
}
