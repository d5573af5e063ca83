//! Holds what the writers and readers of both forms of a table have in common.
//!
//! Owns: the length of a row group, the name of a CSV's metadata file, the errors of reading and of writing a table.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use crate::error::{Error, Fault};
use crate::message::{Setting, TRACK};
use crate::name::text;

/// Rows of a Parquet row group, and of what is held in memory before it is written, about 5 MB.
pub(super) const GROUP_ROWS: usize = 1 << 17;

/// The file with a CSV's metadata: `drop.csv` has `drop.csv.json`.
pub(super) fn json_beside(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".json");
    PathBuf::from(name)
}

pub(super) fn read_fault(path: &Path, e: &std::io::Error) -> Error {
    Error::Table(
        Fault::new(text(path), format!("it cannot be read ({e})"))
            .caused_by(e)
            .advice("Give a table written by " + TRACK),
    )
}

pub(super) fn write_fault(path: &Path, e: &std::io::Error) -> Error {
    let advice = match e.kind() {
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => {
            "Free some space and run again with " + Setting::Resume
        }
        ErrorKind::InvalidFilename => "Choose a shorter name".into(),
        _ => "Choose a folder that can be written".into(),
    };
    Error::Table(Fault::new(text(path), format!("it cannot be written ({e})")).caused_by(e).advice(advice))
}
