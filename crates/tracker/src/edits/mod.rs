//! Decisions of people about single rows of a table, kept in a file and replayed by every run.

mod decision;
mod file;
mod linked;
mod replay;

pub use decision::{Decision, What};
pub use file::{EDITS_SCHEMA, EditedFilm, Edits};
pub use linked::Seen;
pub use replay::{Decided, Replay, edited};
