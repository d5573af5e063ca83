//! Defines the command line as a whole: lists the subcommands, each of which has a file with its `Args` and its `run`.
//!
//! Must not: touch the disk.

use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};

use crate::words::CommandLine;
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
    #[command(after_help = "Examples:\n  tracker info drop.mp4\n  tracker info drop.mraw --json")]
    Info(info::Args),
    #[command(after_help = "Examples:\n  tracker setup drop.mp4 -o rig.toml --picture rig.png")]
    Setup(setup::Args),
    #[command(
        after_help = "Examples:\n  tracker track drop.mp4 -o drop.parquet\n  tracker track drop.mraw --rig rig.toml --frames 0..5000 -o drop.csv\n  tracker track drop.mp4 --fps 1000 --resume -o drop.parquet"
    )]
    Track(track::Args),
    #[command(
        after_help = "Examples:\n  tracker overlay drop.mp4 drop.parquet -o seen.mp4\n  tracker overlay drop.mp4 drop.parquet --every 20 --width 640 -o small.mp4"
    )]
    Overlay(overlay::Args),
    #[command(after_help = "Examples:\n  tracker check drop.parquet")]
    Check(check::Args),
    #[command(
        after_help = "Examples:\n  tracker film --preset clean --print-scene > scene.toml\n  tracker film scene.toml --frame-count 500 -o try.mp4 --truth truth.parquet"
    )]
    Film(film::Args),
    #[command(after_help = "Examples:\n  tracker score try.parquet truth.parquet")]
    Score(score::Args),
    #[command(
        after_help = "Examples:\n  tracker completions bash > ~/.local/share/bash-completion/completions/tracker"
    )]
    Completions(completions::Args),
}

impl Cli {
    /// The command line as it was typed. A number below zero behind an option is its value, to be judged as such.
    pub fn read() -> Result<Self, clap::Error> {
        let takes_number = |a: &clap::Arg| a.get_action().takes_values() && !a.is_positional();
        let signed = |a: clap::Arg| if takes_number(&a) { a.allow_negative_numbers(true) } else { a };
        let command = Self::command().mut_subcommands(|c| c.mut_args(signed));
        Self::from_arg_matches(&command.try_get_matches()?)
    }

    /// The subcommand's way of writing settings and steps.
    pub fn front(&self) -> CommandLine {
        let subcommand = match self.command {
            Command::Info(_) => "info",
            Command::Setup(_) => "setup",
            Command::Track(_) => "track",
            Command::Overlay(_) => "overlay",
            Command::Check(_) => "check",
            Command::Film(_) => "film",
            Command::Score(_) => "score",
            Command::Completions(_) => "completions",
        };
        CommandLine::new(Self::command(), subcommand)
    }

    /// Runs the subcommand.
    pub fn run(self, front: &CommandLine) -> anyhow::Result<ExitCode> {
        match self.command {
            Command::Info(args) => info::run(args, front),
            Command::Setup(args) => setup::run(args, front),
            Command::Track(args) => track::run(args, front),
            Command::Overlay(args) => overlay::run(args),
            Command::Check(args) => check::run(args),
            Command::Film(args) => film::run(args),
            Command::Score(args) => score::run(args),
            Command::Completions(args) => completions::run(args, Cli::command()),
        }
    }
}
