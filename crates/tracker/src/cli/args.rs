//! Defines the command line as a whole: lists the subcommands, each of which has a file with its `Args` and its `run`.
//!
//! Must not: touch the disk.

use std::ffi::OsString;
use std::iter::once;

use clap::builder::{Resettable, StyledStr};
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};

use super::words::CommandLine;
use super::{check, completions, film, info, overlay, score, setup, track};

/// A film of markers on rigid links in; where each marker is in each frame out.
#[derive(Debug, Parser)]
#[command(version, arg_required_else_help = true, max_term_width = 100)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    #[command(after_help = "Examples:\n  pydpend info drop.mp4\n  pydpend info drop.mraw --json")]
    Info(info::Args),
    #[command(after_help = "Examples:\n  pydpend setup drop.mp4 -o rig.toml --picture rig.png")]
    Setup(setup::Args),
    #[command(
        after_help = "Examples:\n  pydpend track drop.mp4 -o drop.parquet\n  pydpend track drop.mraw --rig rig.toml --frames 0..5000 -o drop.csv\n  pydpend track drop.mp4 --fps 1000 --resume -o drop.parquet"
    )]
    Track(track::Args),
    #[command(
        after_help = "Examples:\n  pydpend overlay drop.mp4 drop.parquet -o seen.mp4\n  pydpend overlay drop.mp4 drop.parquet --every 20 --width 640 -o small.mp4"
    )]
    Overlay(overlay::Args),
    #[command(after_help = "Examples:\n  pydpend check drop.parquet")]
    Check(check::Args),
    #[command(
        after_help = "Examples:\n  pydpend film --preset clean --print-scene > scene.toml\n  pydpend film scene.toml --frame-count 500 -o try.mp4 --truth truth.parquet"
    )]
    Film(film::Args),
    #[command(after_help = "Examples:\n  pydpend score try.parquet truth.parquet")]
    Score(score::Args),
    #[command(
        after_help = "Examples:\n  pydpend completions bash > ~/.local/share/bash-completion/completions/tracker"
    )]
    Completions(completions::Args),
}

/// The command line of the program with this name. A number below zero behind an option is its value, to be judged as such.
pub fn command(program: &'static str) -> clap::Command {
    let takes_number = |a: &clap::Arg| a.get_action().takes_values() && !a.is_positional();
    let signed = |a: clap::Arg| if takes_number(&a) { a.allow_negative_numbers(true) } else { a };
    // Helps are written for the whole program.
    let named = |text: Option<&StyledStr>| {
        let text = text.map(|t| t.to_string().replace("pydpend ", &format!("{program} ")));
        Resettable::from(text.map(StyledStr::from))
    };
    let argument = |a: clap::Arg| {
        let (short, long) = (named(a.get_help()), named(a.get_long_help()));
        signed(a).help(short).long_help(long)
    };
    let subcommand = |c: clap::Command| {
        let (about, long) = (named(c.get_about()), named(c.get_long_about()));
        let examples = named(c.get_after_help());
        c.about(about).long_about(long).after_help(examples).mut_args(argument)
    };
    Cli::command().name(program).bin_name(program).mut_subcommands(subcommand)
}

impl Cli {
    /// The command line as it was typed behind the program's name.
    pub fn read(arguments: &[OsString], program: &'static str) -> Result<Self, clap::Error> {
        let line = once(program.into()).chain(arguments.iter().cloned());
        Self::from_arg_matches(&command(program).try_get_matches_from(line)?)
    }

    /// The subcommand's way of writing settings and steps.
    pub fn front(&self, program: &'static str) -> CommandLine {
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
        CommandLine::new(program, command(program), subcommand)
    }

    /// Runs the subcommand.
    pub fn run(self, front: &CommandLine) -> anyhow::Result<u8> {
        match self.command {
            Command::Info(args) => info::run(args, front),
            Command::Setup(args) => setup::run(args, front),
            Command::Track(args) => track::run(args, front),
            Command::Overlay(args) => overlay::run(args),
            Command::Check(args) => check::run(args),
            Command::Film(args) => film::run(args),
            Command::Score(args) => score::run(args),
            Command::Completions(args) => completions::run(args, command("tracker")),
        }
    }
}
