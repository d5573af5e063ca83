//! The subcommand `overlay`: a recording and its node table in, the film with nodes drawn out.
//!
//! Owns: its arguments. Must not: draw.

use std::ffi::OsString;
use std::path::PathBuf;

use crate::error::Error;
use crate::name::text;
use crate::output;
use crate::overlay::{self, FilmSettings};
use crate::source::Interlaced;
use crate::table::{read_table, table_files};

use super::reading::OpenArgs;
use super::watch::Watch;

/// Draw nodes, names, bodies, trails and gaps into the recording
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The recording
    input: OsString,
    /// Its node table
    nodes: PathBuf,
    /// The film, H.264
    #[arg(short, long, value_name = "OUT.mp4")]
    output: PathBuf,
    /// Frames a second at which it plays
    #[arg(long, default_value_t = 30, value_name = "F")]
    play_fps: u32,
    /// Quality as x264's constant rate factor; smaller is better and larger
    #[arg(long, default_value_t = 20, value_name = "CRF")]
    quality: u32,
    /// Draw each N-th frame only
    #[arg(long, default_value_t = 1, value_name = "N")]
    every: usize,
    /// Width of the film, even; the recording's if not given
    #[arg(long, value_name = "PX")]
    width: Option<u32>,
    #[command(flatten)]
    open: OpenArgs,
    /// Replace files that are there already
    #[arg(long)]
    force: bool,
    /// Print no progress
    #[arg(long)]
    quiet: bool,
}

/// Runs it.
pub fn run(args: Args) -> anyhow::Result<u8> {
    let nodes = table_files(&args.nodes)?;
    output::check(std::slice::from_ref(&args.output), &nodes, args.force).map_err(Error::Film)?;
    let table = read_table(&args.nodes)?;
    let mut watch = Watch::new(args.quiet);
    let settings = FilmSettings {
        play_fps: args.play_fps,
        quality: args.quality,
        every: args.every,
        width: args.width,
        replace: args.force,
    };
    overlay::film(
        &text(&args.input),
        &args.open.options(Interlaced::default()),
        &table,
        &args.output,
        &settings,
        &mut watch,
    )?;
    watch.finish();
    Ok(0)
}
