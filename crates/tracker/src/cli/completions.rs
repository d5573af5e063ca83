//! The subcommand `completions`: what a shell needs to complete the command line.

use std::io::Write;

/// Print completions for a shell on standard output
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The shell
    shell: clap_complete::Shell,
}

/// Prints the completions of `command`.
pub fn run(args: Args, mut command: clap::Command) -> anyhow::Result<u8> {
    // Into memory first: written straight to a pipe whose reader has gone, clap_complete would panic.
    let mut text = Vec::new();
    clap_complete::generate(args.shell, &mut command, "tracker", &mut text);
    std::io::stdout().write_all(&text)?;
    Ok(0)
}
