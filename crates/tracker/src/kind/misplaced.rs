//! Faults for files that were given in the place of another kind.
//!
//! Owns: [`misplaced`], [`expect`]. Must not: tell kinds.

use std::path::Path;

use super::contents::kind_of;
use super::kinds::Kind;
use super::next_step::part_of;
use crate::error::{Error, Fault, FaultKind, Result};
use crate::name::text;

/// The fault of a file that is of none of the kinds that are wanted, a command where there are none; `None` if it is of one, or if
/// nobody can tell.
pub fn misplaced(path: &Path, wanted: &[Kind]) -> Option<Fault> {
    let kind = kind_of(path);
    if kind == Kind::Unknown || wanted.contains(&kind) {
        return None;
    }
    // Pictures are as good as a film, and need no mention.
    let nouns: Vec<&str> = wanted.iter().filter(|k| **k != Kind::Pictures).map(|k| k.noun()).collect();
    let expected = match &nouns[..] {
        [] => "a command".to_owned(),
        [only] => (*only).to_owned(),
        [before @ .., last] => format!("{} or {last}", before.join(", ")),
    };
    let fault = Fault::new(text(path), format!("it is {}, not {expected}", kind.noun()))
        .of_kind(FaultKind::Unsupported);
    let inside = if kind == Kind::RunFolder { wanted.iter().find_map(|w| part_of(path, *w)) } else { None };
    Some(match inside {
        Some((what, file)) => fault.advice(format!("Give its {what}, {}", text(file))),
        None => fault.advice(kind.towards(wanted, path).unwrap_or_else(|| kind.next(path))),
    })
}

/// Refuses what is none of what is wanted, as the error of the part that reads it.
///
/// # Errors
/// The error that `part` makes of it.
pub fn expect(path: &Path, wanted: &[Kind], part: fn(Fault) -> Error) -> Result<()> {
    misplaced(path, wanted).map_or(Ok(()), |fault| Err(part(fault)))
}
