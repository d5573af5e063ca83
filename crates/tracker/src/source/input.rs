//! Tells what the name of a recording stands for: a file, a pipe, an address.
//!
//! Owns: [`Input`], [`is_read_once`]. Must not: open a recording.

use std::fs;

use super::OpenOptions;
use super::ffmpeg::formats::is_protocol;
use crate::error::{Error, Fault, FaultKind, Result};
use crate::message::Setting;
use crate::name::path;

/// Kinds of things that a name stands for.
pub(crate) enum Input {
    /// A file that can be read again.
    File(String),
    /// Bytes that come once: standard input or a named pipe.
    Pipe(String),
    /// A network address or a device.
    Address(String),
}

impl Input {
    pub(super) fn of(name: &str, options: &OpenOptions) -> Result<Self> {
        if name == "-" {
            return Ok(Input::Pipe("pipe:0".into()));
        }
        if name.is_empty() {
            let fault = Fault::new("''", "the name is empty").of_kind(FaultKind::Missing);
            return Err(Error::Source(fault.advice("Give the name of a file")));
        }
        let Ok(facts) = fs::metadata(path(name)) else {
            return Self::address(name, options);
        };
        let kind = facts.file_type();
        if facts.is_file() {
            // With its protocol, a name is never taken for a pattern or an address.
            return Ok(Input::File(format!("file:{name}")));
        }
        #[cfg(unix)]
        if std::os::unix::fs::FileTypeExt::is_fifo(&kind) {
            return Ok(Input::Pipe(format!("file:{name}")));
        }
        if options.allow_protocol && !kind.is_dir() {
            return Ok(Input::Address(name.into()));
        }
        Err(Error::Source(
            Fault::new(name, "not a file but a folder or a device").of_kind(FaultKind::Unsupported).advice(
                "Give a recording; for a device add "
                    + Setting::AllowProtocol
                    + ", for pictures a folder with PNG, TIFF or BMP files",
            ),
        ))
    }

    fn address(name: &str, options: &OpenOptions) -> Result<Self> {
        if !is_address(name) {
            return Err(Error::Source(
                Fault::new(name, "no such file")
                    .of_kind(FaultKind::Missing)
                    .advice("Check the name and the folder you are in"),
            ));
        }
        let scheme = name.split([':', ',']).next().unwrap_or(name);
        if !options.allow_protocol {
            return Err(Error::Source(
                Fault::new(name, format!("an address ({scheme}:), and these are not opened unasked"))
                    .of_kind(FaultKind::Setting)
                    .advice("Add " + Setting::AllowProtocol + " if you trust it"),
            ));
        }
        Ok(Input::Address(name.into()))
    }
}

/// Whether what a name stands for gives its bytes once: a pipe, a device, an address.
pub(crate) fn is_read_once(name: &str) -> bool {
    match fs::metadata(path(name)) {
        Ok(facts) => !facts.is_file() && !facts.is_dir(),
        Err(_) => name == "-" || is_address(name),
    }
}

/// Whether a name begins with one of FFmpeg's protocols, other than that for files, or looks as addresses do.
fn is_address(name: &str) -> bool {
    let is_scheme = |s: &str| !s.is_empty() && s.chars().all(|c| c.is_ascii_alphanumeric());
    name.split_once("://").is_some_and(|(scheme, _)| is_scheme(scheme)) || is_protocol(name)
}
