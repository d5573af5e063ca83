//! Runs a command line: reads it, listens for ctrl-c, runs the subcommand and says what went wrong.
//!
//! Exit status: 0 done; 1 done, but the recording ended early or nodes stayed lost; 2 an error; 130 interrupted.

use std::ffi::OsString;
use std::io::{Error as IoError, ErrorKind, Write, stdout};

use super::args::Cli;
use super::{print, refusal, watch};
use crate::error::Error;

/// Runs a subcommand with its arguments, and gives the exit status. `program` is the name that the user typed, `tracker` or
/// `pydpend`: help, errors and advice name it.
///
/// Ctrl-C and termination signals are the command's from here on.
pub fn run(arguments: impl IntoIterator<Item = OsString>, program: &'static str) -> u8 {
    let status = status(&arguments.into_iter().collect::<Vec<_>>(), program);
    // A program of another language leaves without it. Whoever reads our output may stop reading it.
    let _ = stdout().flush();
    status
}

fn status(arguments: &[OsString], program: &'static str) -> u8 {
    let cli = match Cli::read(arguments, program) {
        Ok(cli) => cli,
        Err(error) => {
            let Some(line) = refusal::line(&error, program, arguments.first()) else {
                let _ = error.print();
                return u8::try_from(error.exit_code()).unwrap_or(2);
            };
            print::say(program, line);
            return 2;
        }
    };
    let front = cli.front(program);
    match watch::listen(program).and_then(|()| cli.run(&front)) {
        Ok(status) => status,
        Err(error) if error.downcast_ref().is_some_and(is_closed) => 0,
        Err(error) => {
            let known: Option<&Error> = error.downcast_ref();
            front.tell(known.map_or_else(|| format!("{error:#}"), |known| front.say(&known.message())));
            if matches!(known, Some(Error::Interrupted)) { watch::INTERRUPTED } else { 2 }
        }
    }
}

/// Whether whoever read our output has gone.
fn is_closed(error: &IoError) -> bool {
    error.kind() == ErrorKind::BrokenPipe
}
