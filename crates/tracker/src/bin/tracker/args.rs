//! The command line as a whole. Each subcommand has its own file with its `Args` and its `run`; here they are listed.
//!
//! Must not: touch the disk.

use std::process::ExitCode;

use clap::{Parser, Subcommand};

use crate::{check, completions, film, info, overlay, score, setup, track};

/// A film of markers on rigid links in; where each marker is in each frame out.
#[derive(Debug, Parser)]
#[command(name = "tracker", version, arg_required_else_help = true, max_term_width = 100)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Info(info::Args),
    Setup(setup::Args),
    Track(track::Args),
    Overlay(overlay::Args),
    Check(check::Args),
    Film(film::Args),
    Score(score::Args),
    Completions(completions::Args),
}

impl Cli {
    /// Runs the subcommand.
    pub fn run(self) -> anyhow::Result<ExitCode> {
        match self.command {
            Command::Info(args) => info::run(args),
            Command::Setup(args) => setup::run(args),
            Command::Track(args) => track::run(args),
            Command::Overlay(args) => overlay::run(args),
            Command::Check(args) => check::run(args),
            Command::Film(args) => film::run(args),
            Command::Score(args) => score::run(args),
            Command::Completions(args) => completions::run(args),
        }
    }
}
