//! Writes files whole under their names or not at all, and never over what is read.
//!
//! Owns: [`NewFile`], [`check`], [`discard`]. Must not: know what is in a file.

use std::fs::{self, File};
use std::io::{self, Write};
use std::os::unix::fs::{FileTypeExt, MetadataExt};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use tempfile::TempPath;

use crate::error::{Fault, FaultKind};
use crate::name::text;

/// The folder that a file lies in.
fn folder(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Whether what is written there goes to somebody at once: a named pipe, a device, a process's end of a pipe.
fn is_stream(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|m| {
        let kind = m.file_type();
        kind.is_fifo() || kind.is_char_device() || kind.is_socket()
    })
}

/// A file that takes its name, and the place of what had it before, when it is whole; otherwise nothing is left of it.
///
/// Until then it lies in the same folder under a new name that nothing else has, so no link is followed and no file
/// is replaced. A pipe or a device is written to at once.
#[derive(Debug)]
pub struct NewFile {
    target: PathBuf,
    file: File,
    aside: Option<TempPath>,
}

impl NewFile {
    /// Begins a file that is to be `target`.
    ///
    /// # Errors
    /// The file system's own error.
    pub fn create(target: &Path) -> io::Result<Self> {
        if is_stream(target) {
            let file = File::options().write(true).open(target)?;
            return Ok(Self { target: target.to_owned(), file, aside: None });
        }
        if target.is_dir() {
            return Err(io::Error::from(io::ErrorKind::IsADirectory));
        }
        let name = target.file_name().ok_or_else(|| io::Error::from(io::ErrorKind::InvalidFilename))?;
        // Its own name may be as long as names can be, so the new one is not made of it. That the name itself is
        // possible is asked now, and not when all the work is done.
        if name.len() > LONGEST_NAME {
            return Err(io::Error::from(io::ErrorKind::InvalidFilename));
        }
        let mut begun = unfinished();
        loop {
            let (process, number) = (std::process::id(), MADE.fetch_add(1, Ordering::Relaxed));
            let aside = target.with_file_name(format!(".pydpend-{process}-{number}.writing"));
            match File::options().read(true).write(true).create_new(true).open(&aside) {
                Err(e) if e.kind() == io::ErrorKind::AlreadyExists => continue,
                made => {
                    let (target, file) = (target.to_owned(), made?);
                    begun.push(aside.clone());
                    return Ok(Self { target, file, aside: Some(TempPath::try_from_path(aside)?) });
                }
            }
        }
    }

    /// Whether it is a pipe or a device, in which nothing can be sought.
    pub fn is_stream(&self) -> bool {
        self.aside.is_none()
    }

    /// The file itself.
    pub fn file(&self) -> &File {
        &self.file
    }

    /// Gives it its name. `lasting`: not before all of it is on the disk, so that it outlives a power cut.
    ///
    /// # Errors
    /// The file system's own error.
    pub fn publish(self, lasting: bool) -> io::Result<()> {
        let Some(aside) = self.aside else { return Ok(()) };
        if lasting {
            self.file.sync_all()?;
        }
        let mut unfinished = unfinished();
        let begun_as = aside.to_path_buf();
        aside.persist(&self.target).map_err(|e| e.error)?;
        unfinished.retain(|path| *path != begun_as);
        drop(unfinished);
        // The new name itself is on disk once the folder is; a file system that cannot do that has no more.
        if lasting && let Ok(folder) = File::open(folder(&self.target)) {
            let _ = folder.sync_all();
        }
        Ok(())
    }
}

/// Writes a file at once.
///
/// # Errors
/// The file system's own error.
pub fn write(target: &Path, bytes: &[u8]) -> io::Result<()> {
    let new = NewFile::create(target)?;
    new.file().write_all(bytes)?;
    new.publish(false)
}

/// Files that have not got their names; some of them may be gone.
static UNFINISHED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

fn unfinished() -> MutexGuard<'static, Vec<PathBuf>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Takes away all files that have not got their names, for a process that ends at once: no file is begun or gets its name any more.
pub fn discard() {
    let unfinished = unfinished();
    for path in &*unfinished {
        // It may be gone.
        let _ = fs::remove_file(path);
    }
    // Whoever begins or ends a file waits for the end of the process.
    std::mem::forget(unfinished);
}

/// Files begun by this process, so that each has a name of its own.
static MADE: AtomicU64 = AtomicU64::new(0);

/// Bytes of a file's name that the file systems in use take at most.
pub const LONGEST_NAME: usize = 255;

/// Name that stands for standard output where a command writes there.
const STANDARD_OUTPUT: &str = "-";

/// The device and number of a file, which tell it from any other; links of either kind are followed.
fn identity(path: &Path) -> Option<(u64, u64)> {
    fs::metadata(path).ok().map(|m| (m.dev(), m.ino()))
}

/// The path at which a file would be made: its folder, links resolved, and its name.
fn place(path: &Path) -> Option<PathBuf> {
    Some(fs::canonicalize(folder(path)).ok()?.join(path.file_name()?))
}

/// Refuses `outputs` that are no files, that would replace one of the `inputs` or one another, and, unless `replace`, any
/// that is there already. Names are compared by the files that they stand for, so that no link hides one.
///
/// # Errors
/// The fault of the first such output.
pub fn check(outputs: &[PathBuf], inputs: &[PathBuf], replace: bool) -> Result<(), Fault> {
    let read: Vec<_> = inputs.iter().filter_map(|p| Some((p, identity(p)?))).collect();
    for (i, output) in outputs.iter().enumerate() {
        let name = text(output);
        if name == STANDARD_OUTPUT {
            return Err(Fault::new(name, "standard output is not possible: the output is a file")
                .advice("Give the name of a file"));
        }
        if is_stream(output) {
            continue;
        }
        let bytes = output.file_name().map_or(0, |n| n.len());
        if bytes > LONGEST_NAME {
            let problem = format!("its name has {bytes} bytes, and {LONGEST_NAME} are possible");
            return Err(Fault::new(name, problem).advice("Choose a shorter name"));
        }
        if let Some(there) = identity(output)
            && let Some((input, _)) = read.iter().find(|(_, known)| *known == there)
        {
            let problem = match *input == output {
                true => "it is read, and writing it would destroy it".to_owned(),
                false => {
                    format!("it is the same file as {}, which is read and would be destroyed", text(input))
                }
            };
            return Err(Fault::new(name, problem).advice("Choose another name"));
        }
        let same = |other: &&PathBuf| place(other).is_some_and(|p| Some(p) == place(output));
        if outputs[..i].iter().any(|other| same(&other)) {
            return Err(Fault::new(name, "two outputs have this name")
                .of_kind(FaultKind::Setting)
                .advice("Give each a name of its own"));
        }
        // A link that leads nowhere is there too.
        if !replace && output.symlink_metadata().is_ok() {
            return Err(Fault::exists(output));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    #[test]
    fn a_file_is_there_whole_or_not_at_all() {
        let dir = tempfile::tempdir().unwrap();
        let names = |d: &Path| fs::read_dir(d).unwrap().map(|e| e.unwrap().file_name()).collect::<Vec<_>>();
        for name in ["a b", "a:b", "#?%d", "-x", "e😀", "new\nline", &"n".repeat(255)] {
            let target = dir.path().join(name);
            let new = NewFile::create(&target).unwrap();
            new.file().write_all(b"half").unwrap();
            drop(new);
            assert!(names(dir.path()).is_empty(), "{name}");
            write(&target, b"whole").unwrap();
            assert_eq!(fs::read(&target).unwrap(), b"whole", "{name}");
            assert_eq!(names(dir.path()), [name], "{name}");
            fs::remove_file(&target).unwrap();
        }
        assert!(NewFile::create(&dir.path().join("n".repeat(256))).is_err());
        assert!(NewFile::create(dir.path()).is_err() && NewFile::create(&dir.path().join("no/x")).is_err());
    }

    #[test]
    fn standard_output_is_no_file() {
        let refused = check(&["a.toml".into(), "-".into()], &[], true).unwrap_err().to_string();
        assert!(refused.starts_with("-: standard output is not possible"), "{refused}");
        let dir = tempfile::tempdir().unwrap();
        check(&[dir.path().join("-"), dir.path().join("-x")], &[], false).unwrap();
    }

    #[test]
    fn no_link_is_written_through() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        fs::write(at("precious"), b"precious").unwrap();
        symlink(at("precious"), at("link")).unwrap();
        symlink(at("nowhere"), at("broken")).unwrap();
        for name in ["link", "broken"] {
            write(&at(name), b"new").unwrap();
            assert_eq!(fs::read(at(name)).unwrap(), b"new");
        }
        assert_eq!(fs::read(at("precious")).unwrap(), b"precious");
        assert!(!at("nowhere").exists());
    }

    #[test]
    fn what_is_read_or_there_is_not_replaced() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        fs::write(at("film"), b"film").unwrap();
        fs::write(at("other"), b"other").unwrap();
        fs::hard_link(at("film"), at("hard")).unwrap();
        symlink(at("film"), at("soft")).unwrap();
        symlink(dir.path(), at("folder")).unwrap();
        symlink(at("nowhere"), at("broken")).unwrap();
        let said = |outputs: &[&str], replace: bool| {
            let outputs: Vec<PathBuf> = outputs.iter().map(|o| at(o)).collect();
            check(&outputs, &[at("film")], replace).err().map(|f| f.problem.to_string())
        };
        for name in ["film", "hard", "soft", "folder/film", "./film"] {
            let said = said(&["new", name], true).unwrap();
            assert!(said.contains("destroy"), "{name}: {said}");
        }
        assert_eq!(said(&["other", "new"], true), None);
        for name in ["other", "broken"] {
            assert_eq!(said(&[name], false).unwrap(), "it is there already", "{name}");
        }
        for pair in [["new", "new"], ["new", "folder/new"], ["other", "./other"]] {
            assert_eq!(said(&pair, true).unwrap(), "two outputs have this name", "{pair:?}");
        }
    }
}
