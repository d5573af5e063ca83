//! Computes a fingerprint that tells one recording from another without reading all of it.
//!
//! Owns: [`Fingerprint`], [`changed`].

use std::fs::{File, Metadata};
use std::io::{self, Read, Seek, SeekFrom};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

use crate::error::{Error, Fault, Result};
use crate::name::text;

/// Bytes of each end of a file that are read.
const END_BYTES: u64 = 1 << 20;
/// Files of which both ends are read; of more, pictures, those of the first and the last.
const FILES_READ: usize = 2;

/// A recording's contents as far as they are told by the lengths of its files and by their first and last MiB, and when
/// its files were changed. A copy has the same contents and other times.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fingerprint {
    /// Of the lengths and the ends of its files, in their order; of the pictures of a folder also of their names.
    /// In hexadecimal.
    pub sha256: String,
    /// Of the times of change of all files, in hexadecimal.
    pub changes: String,
    /// The last of these times, s since 1970.
    pub newest_s: String,
}

fn hex(hash: Sha256) -> String {
    hash.finalize().iter().map(|b| format!("{b:02x}")).collect()
}

fn unreadable(path: &Path, e: &io::Error) -> Error {
    Error::Source(
        Fault::new(text(path), format!("the file cannot be read ({e})"))
            .caused_by(e)
            .advice("Check its permissions"),
    )
}

fn facts(path: &Path) -> Result<Metadata> {
    path.metadata().map_err(|e| unreadable(path, &e))
}

/// The time at which a file's bytes were last written, ns since 1970.
fn written_ns(m: &Metadata) -> i128 {
    i128::from(m.mtime()) * 1_000_000_000 + i128::from(m.mtime_nsec())
}

impl Fingerprint {
    /// Fingerprint of the recording that is read from `files`.
    ///
    /// # Errors
    /// [`Error::Source`] if one of them cannot be read.
    pub fn of(files: &[PathBuf]) -> Result<Self> {
        let (mut contents, mut changes) = (Sha256::new(), Sha256::new());
        let mut newest_ns = 0;
        for (i, path) in files.iter().enumerate() {
            let m = facts(path)?;
            contents.update(m.len().to_le_bytes());
            if files.len() > FILES_READ {
                let name = path.file_name().unwrap_or_default().as_encoded_bytes();
                contents.update((name.len() as u64).to_le_bytes());
                contents.update(name);
            }
            if files.len() <= FILES_READ || i == 0 || i + 1 == files.len() {
                for (start, bytes) in ends(path, m.len()).map_err(|e| unreadable(path, &e))? {
                    contents.update(start.to_le_bytes());
                    contents.update((bytes.len() as u64).to_le_bytes());
                    contents.update(bytes);
                }
            }
            let ns = written_ns(&m);
            changes.update(ns.to_le_bytes());
            newest_ns = newest_ns.max(ns);
        }
        let newest_s =
            format!("{}.{:09}", newest_ns.div_euclid(1_000_000_000), newest_ns.rem_euclid(1_000_000_000));
        Ok(Self { sha256: hex(contents), changes: hex(changes), newest_s })
    }
}

/// The first and the last MiB of a file, with where they begin.
fn ends(path: &Path, length: u64) -> io::Result<[(u64, Vec<u8>); 2]> {
    let mut file = File::open(path)?;
    let mut part = |start: u64| -> io::Result<(u64, Vec<u8>)> {
        let mut bytes = Vec::new();
        file.seek(SeekFrom::Start(start))?;
        (&mut file).take(END_BYTES).read_to_end(&mut bytes)?;
        Ok((start, bytes))
    };
    Ok([part(0)?, part(length.saturating_sub(END_BYTES))?])
}

/// The first of `files` that was written, replaced or renamed after `table` was written.
///
/// # Errors
/// [`Error::Source`] if one of them cannot be read.
pub fn changed<'a>(files: &'a [PathBuf], table: &Path) -> Result<Option<&'a Path>> {
    let made_ns = written_ns(&facts(table)?);
    for path in files {
        let m = facts(path)?;
        // The time at which the file's entry changed: unlike the time of writing it comes with no copy or renaming.
        let entry_ns = i128::from(m.ctime()) * 1_000_000_000 + i128::from(m.ctime_nsec());
        if written_ns(&m).max(entry_ns) > made_ns {
            return Ok(Some(path));
        }
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::time::{Duration, SystemTime};

    use super::*;

    #[test]
    fn what_differs_is_told() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        let long = vec![7_u8; 3 << 20];
        fs::write(at("a"), &long).unwrap();
        let when = SystemTime::UNIX_EPOCH + Duration::from_millis(1_700_000_000_250);
        let touch =
            |name: &str| File::options().write(true).open(at(name)).unwrap().set_modified(when).unwrap();
        touch("a");
        let first = Fingerprint::of(&[at("a")]).unwrap();
        assert_eq!(first.newest_s, "1700000000.250000000");
        fs::copy(at("a"), at("copy")).unwrap();
        let copy = Fingerprint::of(&[at("copy")]).unwrap();
        assert_eq!(copy.sha256, first.sha256);
        assert_ne!(copy.changes, first.changes);
        touch("copy");
        assert_eq!(Fingerprint::of(&[at("copy")]).unwrap(), first);
        for (place, told) in [(0, true), (1 << 20, false), ((3 << 20) - 1, true)] {
            let mut other = long.clone();
            other[place] = 8;
            fs::write(at("b"), &other).unwrap();
            let b = Fingerprint::of(&[at("b")]).unwrap();
            assert_eq!(b.sha256 != first.sha256, told, "byte {place}");
            assert_ne!(b.changes, first.changes);
        }
        fs::write(at("b"), &long[1..]).unwrap();
        assert_ne!(Fingerprint::of(&[at("b")]).unwrap().sha256, first.sha256);
        // The partner counts, and its place.
        let pair = Fingerprint::of(&[at("a"), at("b")]).unwrap();
        assert_ne!(pair.sha256, Fingerprint::of(&[at("b"), at("a")]).unwrap().sha256);
        assert_ne!(pair.sha256, first.sha256);
        // Of many pictures a name counts, and that one in the middle was written again.
        let names: Vec<PathBuf> = (0..5).map(|i| at(&format!("p{i}"))).collect();
        for (i, name) in names.iter().enumerate() {
            fs::write(name, [i as u8; 100]).unwrap();
        }
        let before = Fingerprint::of(&names).unwrap();
        fs::write(&names[2], [9; 100]).unwrap();
        let after = Fingerprint::of(&names).unwrap();
        assert_eq!(after.sha256, before.sha256);
        assert_ne!(after.changes, before.changes);
        fs::rename(&names[2], at("p2b")).unwrap();
        let renamed = [&names[..2], &[at("p2b")], &names[3..]].concat();
        assert_ne!(Fingerprint::of(&renamed).unwrap().sha256, before.sha256);
    }

    #[test]
    fn a_recording_newer_than_its_table_is_told() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        for name in ["older", "film", "table"] {
            fs::write(at(name), b"x").unwrap();
        }
        let files = [at("film")];
        assert_eq!(changed(&files, &at("table")).unwrap(), None);
        // Put in place of it: written before the table, but not there then.
        fs::rename(at("older"), at("film")).unwrap();
        std::thread::sleep(Duration::from_millis(20));
        fs::rename(at("film"), at("other")).unwrap();
        fs::rename(at("other"), at("film")).unwrap();
        assert_eq!(changed(&files, &at("table")).unwrap(), Some(at("film").as_path()));
    }
}
