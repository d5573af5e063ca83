//! Follows the markers of a recording: `cargo run --release --example track_file -- FILM OUT.csv`. Prints progress, and what
//! became of each marker. What went wrong is decided on by its kind.

use std::path::PathBuf;
use std::process::ExitCode;

use tracker::error::{Error, FaultKind};
use tracker::pipeline::{Existing, Observer, RunSettings, RunSummary, Stage, run};

/// Says which stage begins.
struct Stages;

impl Observer for Stages {
    fn stage(&mut self, stage: Stage, frames: Option<u64>) {
        match frames {
            Some(frames) => eprintln!("{}, {frames} frames", stage.as_str()),
            None => eprintln!("{}", stage.as_str()),
        }
    }
}

fn track(film: String, table: PathBuf) -> Result<RunSummary, Error> {
    let settings = RunSettings {
        input: film,
        output: Some(table),
        existing: Existing::Replace,
        ..RunSettings::default()
    };
    run(&settings, &mut Stages)
}

fn main() -> ExitCode {
    let mut arguments = std::env::args().skip(1);
    let (Some(film), Some(table)) = (arguments.next(), arguments.next()) else {
        eprintln!("give a film and the table to write, FILM OUT.csv");
        return ExitCode::from(2);
    };
    match track(film, table.into()) {
        Ok(summary) => {
            for node in &summary.nodes {
                println!(
                    "{} of {}: seen in {} of {} frames",
                    node.node, node.body, node.seen, summary.frames
                );
            }
            ExitCode::SUCCESS
        }
        Err(error) => {
            let hint = match error.kind() {
                FaultKind::NothingFound => " (is there a marker in the picture?)",
                FaultKind::Damaged => " (is the copy whole?)",
                _ => "",
            };
            eprintln!("{error}{hint}");
            ExitCode::from(2)
        }
    }
}
