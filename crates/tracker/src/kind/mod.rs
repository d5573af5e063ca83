//! Tells what a file or folder is by what is in it: for a user who gave it to the wrong command.
//!
//! Knows the names of the columns and keys in every file of both programs, and nothing of what they mean. Owns:
//! [`Kind`], [`kind_of`], [`misplaced`], [`expect`]. Must not: read more than a beginning (or a Parquet file's end), or refuse what
//! it does not know.

mod contents;
mod kinds;
mod misplaced;
mod next_step;
#[cfg(test)]
mod tests;

pub use contents::kind_of;
pub use kinds::Kind;
pub use misplaced::{expect, misplaced};
