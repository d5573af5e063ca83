//! Prints results and messages: names and texts out of files never reach a terminal as they are.
//!
//! Must not: print anything unasked.

use std::io::{self, Write};

use crate::name::{shown, shown_json, shown_lines};

/// Results on standard output, some lines. Whoever reads them may stop reading.
pub fn lines(text: &str) -> anyhow::Result<()> {
    ignore_closed(io::stdout().write_all(shown_lines(text).as_bytes()))
}

/// Results on standard output as JSON.
pub fn json(value: &serde_json::Value) -> anyhow::Result<()> {
    let text = shown_json(&serde_json::to_string_pretty(value)?);
    ignore_closed(writeln!(io::stdout(), "{text}"))
}

/// A program's message on standard error.
pub fn say(program: &str, message: impl std::fmt::Display) {
    eprintln!("{program}: {}", shown(&message.to_string()));
}

fn ignore_closed(written: io::Result<()>) -> anyhow::Result<()> {
    match written {
        Err(e) if e.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        other => Ok(other?),
    }
}
