//! The tracker's subcommands, as they are typed.

use std::ffi::OsString;

use pyo3::prelude::*;
use tracker::cli;

/// Name of the program that has these subcommands among its own.
const PROGRAM: &str = "pydpend";

/// Runs a subcommand of the tracker with its arguments as the program `pydpend`, and gives the exit status. It prints what
/// it has to say, and Ctrl-C and termination signals are its own from here on.
#[pyfunction]
pub fn command(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    py.detach(|| cli::run(arguments, PROGRAM))
}

/// The subcommands and their arguments, as JSON.
#[pyfunction]
pub fn commands() -> String {
    cli::described(PROGRAM).to_string()
}
