//! Converts names of files to text: without loss on the way in, harmless on the way to a terminal.
//!
//! Owns: [`text`], [`path`], [`shown`], [`shown_json`], [`shell_word`], [`python_word`]. A name on a disk is bytes. One that is not UTF-8 is carried as
//! text whose undecodable bytes are private characters, as Python carries them as surrogates.

use std::ffi::{OsStr, OsString};
use std::fmt::Write;
use std::os::unix::ffi::{OsStrExt, OsStringExt};
use std::path::PathBuf;

/// The private characters that stand for single bytes: this and the 255 after it.
const FIRST: u32 = 0x0010_FF00;

/// The byte that a private character stands for.
fn byte_of(c: char) -> Option<u8> {
    u32::from(c).checked_sub(FIRST).and_then(|b| u8::try_from(b).ok())
}

/// A name as text. [`path()`] gives it back whatever its bytes are.
pub fn text(name: impl AsRef<OsStr>) -> String {
    let mut out = String::new();
    let escape = |out: &mut String, bytes: &[u8]| {
        out.extend(bytes.iter().filter_map(|b| char::from_u32(FIRST + u32::from(*b))));
    };
    for chunk in name.as_ref().as_bytes().utf8_chunks() {
        for c in chunk.valid().chars() {
            // A private character of the name's own is carried byte by byte, so that none is mistaken.
            match byte_of(c) {
                None => out.push(c),
                Some(_) => escape(&mut out, c.encode_utf8(&mut [0; 4]).as_bytes()),
            }
        }
        escape(&mut out, chunk.invalid());
    }
    out
}

/// The name that [`text`] was made of.
pub fn path(text: &str) -> PathBuf {
    let mut bytes = Vec::with_capacity(text.len());
    for c in text.chars() {
        match byte_of(c) {
            Some(byte) => bytes.push(byte),
            None => bytes.extend_from_slice(c.encode_utf8(&mut [0; 4]).as_bytes()),
        }
    }
    PathBuf::from(OsString::from_vec(bytes))
}

/// A name as a word for a shell, which no program takes for an option. What is no character to be seen is written out,
/// `$'dr\xf6p.mp4'`, as bash, zsh and ksh read it.
pub fn shell_word(name: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_./+,:@%=".contains(c);
    let before = if name.starts_with('-') { "./" } else { "" };
    if !name.is_empty() && name.chars().all(|c| plain(c) && byte_of(c).is_none()) {
        format!("{before}{name}")
    } else if name.chars().any(|c| is_control(c) || byte_of(c).is_some()) {
        let written = |c: char| match byte_of(c) {
            Some(byte) => format!("\\x{byte:02x}"),
            None if is_control(c) => {
                c.encode_utf8(&mut [0; 4]).bytes().map(|b| format!("\\x{b:02x}")).collect()
            }
            None if ['\\', '\''].contains(&c) => format!("\\{c}"),
            None => c.to_string(),
        };
        format!("$'{before}{}'", name.chars().map(written).collect::<String>())
    } else {
        format!("'{before}{}'", name.replace('\'', "'\\''"))
    }
}

/// A name as Python writes it: the same text, with nothing in it that a terminal would obey.
pub fn python_word(name: &str) -> String {
    let written = |c: char| match (c, byte_of(c)) {
        (_, Some(byte)) => format!("\\udc{byte:02x}"),
        ('\\' | '"', _) => format!("\\{c}"),
        ('\n' | '\r' | '\t', _) => c.escape_default().to_string(),
        _ if is_control(c) && u32::from(c) < 0x100 => format!("\\x{:02x}", u32::from(c)),
        _ if is_control(c) => format!("\\u{:04x}", u32::from(c)),
        _ => c.to_string(),
    };
    format!("\"{}\"", name.chars().map(written).collect::<String>())
}

/// Whether a terminal would do something else than show the character: controls (escape sequences begin with one),
/// and marks that turn the direction of writing or end a line.
fn is_control(c: char) -> bool {
    c.is_control() || matches!(c, '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// Text of a file's name or of what is in a file, for a terminal: what is not a character to be seen is written out,
/// as `\x1b`, `\n` or `\u{202e}`.
pub fn shown(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        // Writing to a string does not fail.
        let _ = match (c, byte_of(c)) {
            (_, Some(byte)) => write!(out, "\\x{byte:02x}"),
            ('\n' | '\r' | '\t', _) => write!(out, "{}", c.escape_default()),
            _ if is_control(c) && u32::from(c) < 0x80 => write!(out, "\\x{:02x}", u32::from(c)),
            _ if is_control(c) => write!(out, "\\u{{{:x}}}", u32::from(c)),
            _ => {
                out.push(c);
                Ok(())
            }
        };
    }
    out
}

/// Text of several lines as a terminal may show it: line ends stay.
pub fn shown_lines(text: &str) -> String {
    text.split('\n').map(shown).collect::<Vec<_>>().join("\n")
}

/// JSON text for a terminal or another program: the same value, with what [`shown`] writes out as JSON's `\u001b`.
pub fn shown_json(json: &str) -> String {
    let mut out = String::with_capacity(json.len());
    for c in json.chars() {
        // Outside strings JSON has no other control than line ends.
        if is_control(c) && c != '\n' {
            let _ = write!(out, "\\u{:04x}", u32::from(c));
        } else {
            out.push(c);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn every_name_comes_back(bytes in proptest::collection::vec(any::<u8>(), 0..40)) {
            let name = OsString::from_vec(bytes);
            prop_assert_eq!(path(&text(&name)).into_os_string(), name);
        }

        #[test]
        fn every_text_comes_back_and_shows_no_control(name in "\\PC*|[\\x00-\\x20\u{80}-\u{9f}\u{202e}\u{10ff41}]{0,9}") {
            let carried = text(OsStr::new(&name));
            prop_assert_eq!(path(&carried), PathBuf::from(&name));
            prop_assert!(!shown(&carried).chars().any(is_control));
        }
    }

    #[test]
    fn a_shell_and_python_read_the_name_that_was_meant() {
        let names: [&[u8]; 6] = [
            b"dr\xf6p.mp4",
            b"a\x1b[31mb.gz",
            b"it's \\ \n",
            "\u{202e}\u{85}\u{e9}".as_bytes(),
            b"-\x07",
            b"\"plain\"",
        ];
        for name in names {
            let carried = text(OsStr::from_bytes(name));
            let (word, python) = (shell_word(&carried), python_word(&carried));
            assert_eq!([shown(&word), shown(&python)], [word.clone(), python.clone()]);
            let told = std::process::Command::new("bash")
                .args(["-c", &format!("printf %s {word}")])
                .output()
                .unwrap();
            assert_eq!(told.stdout.strip_prefix(b"./").unwrap_or(&told.stdout), name, "{word}");
            let write = format!("import os, sys; sys.stdout.buffer.write(os.fsencode({python}))");
            let told =
                std::process::Command::new("python3").args(["-X", "utf8", "-c", &write]).output().unwrap();
            assert_eq!(told.stdout, name, "{python}");
        }
    }

    #[test]
    fn what_a_terminal_would_obey_is_written_out() {
        assert_eq!(shown("a\x1b[31mb\n\t\u{9b}2J\u{202e}ü 😀"), "a\\x1b[31mb\\n\\t\\u{9b}2J\\u{202e}ü 😀");
        assert_eq!(shown(&text(OsStr::from_bytes(b"dr\xf6p.mp4"))), "dr\\xf6p.mp4");
        let json = serde_json::json!({"name": "\u{9b}2J\x1b\u{202e}"});
        let plain = shown_json(&serde_json::to_string_pretty(&json).unwrap());
        assert!(!plain.chars().any(|c| is_control(c) && c != '\n'), "{plain}");
        assert_eq!(serde_json::from_str::<serde_json::Value>(&plain).unwrap(), json);
    }
}
