//! The program `tracker`: a film in, a node table out.
//!
//! Exit status: 0 done; 1 done, but the recording ended early or nodes stayed lost; 2 an error; 130 interrupted.

mod args;
mod check;
mod completions;
mod film;
mod info;
mod overlay;
mod print;
mod reading;
mod refusal;
mod score;
mod setup;
mod track;
mod unclear;
mod watch;
mod words;

use std::process::ExitCode;

use tracker::error::Error;

fn main() -> ExitCode {
    let cli = match args::Cli::read() {
        Ok(cli) => cli,
        Err(error) => {
            let Some(line) = refusal::line(&error) else { error.exit() };
            print::say(line);
            return ExitCode::from(2);
        }
    };
    let front = cli.front();
    match watch::listen().and_then(|()| cli.run(&front)) {
        Ok(status) => status,
        // Whoever reads our output may stop reading it.
        Err(error) if error.downcast_ref().is_some_and(is_closed) => ExitCode::SUCCESS,
        Err(error) => {
            let known: Option<&Error> = error.downcast_ref();
            print::say(known.map_or_else(|| format!("{error:#}"), |known| front.say(&known.message())));
            let interrupted = matches!(known, Some(Error::Interrupted));
            ExitCode::from(if interrupted { watch::INTERRUPTED } else { 2 })
        }
    }
}

fn is_closed(error: &std::io::Error) -> bool {
    error.kind() == std::io::ErrorKind::BrokenPipe
}
