//! Finds the two files of a Photron recording: the header and the pixels.
//!
//! Owns: [`Pair`], [`pair`], [`is_photron`]. Must not: read pixels.

use std::fs;
use std::path::{Path, PathBuf};

use super::cihx;
use crate::error::{Error, Fault, FaultKind, Result};
use crate::name::{path, text};

/// Whether a file is one of a Photron pair, by what it starts with or, for pixels, by its ending.
pub(crate) fn is_photron(name: &str, first_bytes: &[u8]) -> bool {
    has_ending(&path(name), &["mraw"]) || is_header(name, first_bytes)
}

fn is_header(name: &str, first_bytes: &[u8]) -> bool {
    let text = first_bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(first_bytes);
    text.starts_with(b"#Camera Information Header")
        || cihx::is_cihx(first_bytes)
        || has_ending(&path(name), &["cih", "cihx"])
}

fn has_ending(path: &Path, endings: &[&str]) -> bool {
    path.extension().and_then(|e| e.to_str()).is_some_and(|e| endings.contains(&e.to_lowercase().as_str()))
}

/// The file beside `path` with the same stem and the first of `endings` that there is.
fn partner(path: &Path, endings: &[&str]) -> Result<PathBuf> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let stem = path.file_stem().map(|s| text(s).to_lowercase());
    let entries: Vec<PathBuf> =
        fs::read_dir(folder).map(|d| d.flatten().map(|e| e.path()).collect()).unwrap_or_default();
    endings
        .iter()
        .find_map(|ending| {
            entries
                .iter()
                .find(|p| has_ending(p, &[ending]) && p.file_stem().map(|s| text(s).to_lowercase()) == stem)
        })
        .cloned()
        .ok_or_else(|| {
            let wanted = endings.iter().map(|e| format!(".{e}")).collect::<Vec<_>>().join(" or ");
            Error::Source(
                Fault::new(
                    path.display(),
                    format!("its partner ({wanted} of the same name) is not beside it"),
                )
                .of_kind(FaultKind::Missing)
                .advice("Copy both files of the recording into one folder"),
            )
        })
}

/// Both files of a recording.
pub(crate) struct Pair {
    pub header: PathBuf,
    pub pixels: PathBuf,
}

/// Both files of the recording of which `name` is one.
pub(crate) fn pair(name: &str) -> Result<Pair> {
    let given = path(name);
    Ok(if has_ending(&given, &["mraw"]) {
        Pair { header: partner(&given, &["cihx", "cih"])?, pixels: given }
    } else {
        Pair { pixels: partner(&given, &["mraw"])?, header: given }
    })
}
