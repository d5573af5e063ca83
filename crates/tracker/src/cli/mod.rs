//! The command line: the subcommands of the programs `tracker` and `pydpend`, from their words to the exit status.
//!
//! One file for each subcommand, with its `Args` and its `run`; `run` is the whole, `args` the line as it is read.

mod args;
mod check;
mod completions;
mod described;
mod film;
mod info;
mod overlay;
mod print;
mod reading;
mod refusal;
mod run;
mod score;
mod setup;
mod track;
mod unclear;
mod watch;
mod words;

pub use described::described;
pub use run::run;
