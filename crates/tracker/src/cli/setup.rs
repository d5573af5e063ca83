//! The subcommand `setup`: a recording in, its rig out, with an annotated picture and advice.
//!
//! Owns: its arguments, what is said of the result. Must not: find anything itself.

use std::ffi::OsString;
use std::fmt::Write;
use std::path::PathBuf;

use crate::error::Error;
use crate::name::text;
use crate::source;
use crate::table::RunEnding;
use crate::{output, setup};

use super::print;
use super::reading::ReadArgs;
use super::unclear;
use super::watch::Watch;
use super::words::CommandLine;

/// Find markers, bodies and joints of a recording and write them as a rig file to be edited
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The recording
    input: OsString,
    /// The rig file
    #[arg(short, long, value_name = "RIG.toml")]
    output: PathBuf,
    /// The reference picture with all that was found drawn into it; beside the rig file if not given
    #[arg(long, value_name = "PICTURE.png")]
    picture: Option<PathBuf>,
    #[command(flatten)]
    read: ReadArgs,
    /// Replace files that are there already
    #[arg(long)]
    force: bool,
    /// Print neither progress nor summary
    #[arg(long)]
    quiet: bool,
}

/// Runs it.
pub fn run(args: Args, front: &CommandLine) -> anyhow::Result<u8> {
    let picture = args.picture.clone().unwrap_or_else(|| args.output.with_extension("png"));
    let input = text(&args.input);
    let outputs = [args.output.clone(), picture.clone()];
    output::check(&outputs, &source::files(&input)?, args.force).map_err(Error::Rig)?;
    let settings = args.read.settings(input);
    let mut watch = Watch::new(args.quiet);
    let found = setup::find(&settings, &mut watch);
    if let Err(Error::Detect(_) | Error::Rig(_)) = &found {
        unclear::tell(&settings, &picture, args.force, &mut watch, front);
    }
    let found = found?;
    watch.finish();
    let rig = found.rig;
    found.picture.save(&picture)?;
    rig.write(&args.output)?;
    for warning in &found.warnings {
        front.tell(format!("note: {}", front.say(warning)));
    }
    if !args.quiet {
        let mut out = String::new();
        let index = rig.reference_frame.unwrap_or(0);
        writeln!(out, "{}: {} nodes, reference picture: frame {index}", text(&args.output), rig.nodes.len())?;
        for body in &rig.bodies {
            let nodes: Vec<&str> =
                rig.nodes.iter().filter(|n| n.body == body.name).map(|n| n.name.as_str()).collect();
            writeln!(out, "  {}: {}", body.name, nodes.join(" "))?;
        }
        for joint in &rig.joints {
            let on = joint.bodies.join(" and ");
            writeln!(out, "  {} of {on} at ({:.1}, {:.1}) px", joint.name, joint.x_px, joint.y_px)?;
        }
        writeln!(out, "{}: the picture", text(&picture))?;
        print::lines(&out)?;
    }
    // The rig is of what could be read.
    Ok(u8::from(found.ending != RunEnding::Complete))
}
