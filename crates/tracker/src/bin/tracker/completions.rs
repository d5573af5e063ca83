//! `tracker completions`: what a shell needs to complete the command line.

use std::io::Write;
use std::process::ExitCode;

use clap::CommandFactory;

use crate::args::Cli;

/// Print completions for a shell on standard output
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The shell
    shell: clap_complete::Shell,
}

/// Prints them.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    // Into memory first: written straight to a pipe whose reader has gone, clap_complete would panic.
    let mut text = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "tracker", &mut text);
    std::io::stdout().write_all(&text)?;
    Ok(ExitCode::SUCCESS)
}
