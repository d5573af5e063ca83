//! The program `tracker`: a film in, a node table out, without Python.

use std::env::args_os;
use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(tracker::cli::run(args_os().skip(1), "tracker"))
}
