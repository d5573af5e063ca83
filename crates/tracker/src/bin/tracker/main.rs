//! The program `tracker`: a film in, a node table out.
//!
//! Exit status: 0 done; 1 done, but the recording ended early or nodes stayed lost; 2 an error; 130 interrupted.

mod args;
mod check;
mod completions;
mod film;
mod info;
mod overlay;
mod score;
mod setup;
mod track;
mod watch;

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    match args::Cli::parse().run() {
        Ok(status) => status,
        // Whoever reads our output may stop reading it.
        Err(error) if error.downcast_ref().is_some_and(is_closed) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("tracker: {error:#}");
            let interrupted = matches!(error.downcast_ref(), Some(tracker::error::Error::Interrupted));
            ExitCode::from(if interrupted { 130 } else { 2 })
        }
    }
}

fn is_closed(error: &std::io::Error) -> bool {
    error.kind() == std::io::ErrorKind::BrokenPipe
}
