//! What the real binary writes, and where: names are names of files, nothing that is read or anybody's is replaced, a
//! run goes on with its own recording only, and nothing out of a file reaches a terminal.

#![allow(clippy::unwrap_used, clippy::panic)] // a test may fail by panicking

mod names;
mod replacing;
mod states;
mod stopping;
mod words;

use std::ffi::{OsStr, OsString};
use std::fs;
use std::io::Write;
use std::net::TcpListener;
use std::os::unix::ffi::OsStringExt;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use tracker::table::read_table;

struct Said {
    status: i32,
    out: String,
    error: String,
}

/// A run of the program in a folder.
fn run<A: AsRef<OsStr>>(folder: &Path, arguments: &[A]) -> Said {
    let out = Command::new(env!("CARGO_BIN_EXE_tracker"))
        .args(arguments)
        .current_dir(folder)
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    Said { status: out.status.code().unwrap_or(-1), out: text(&out.stdout), error: text(&out.stderr) }
}

fn refused<A: AsRef<OsStr> + std::fmt::Debug>(folder: &Path, arguments: &[A], expected: &str) {
    let said = run(folder, arguments);
    assert_eq!(said.status, 2, "{arguments:?}: {}", said.error);
    assert!(said.error.contains(expected), "{arguments:?}: {}", said.error);
    assert_eq!(said.error.trim_end().lines().count(), 1, "{}", said.error);
}

fn done<A: AsRef<OsStr> + std::fmt::Debug>(folder: &Path, arguments: &[A]) {
    let said = run(folder, arguments);
    assert_eq!(said.status, 0, "{arguments:?}: {}", said.error);
}

/// A folder with `film.mp4`, `film.mraw` of the same scene and a `rig.toml`, made once.
fn films() -> &'static Path {
    static FILMS: OnceLock<tempfile::TempDir> = OnceLock::new();
    FILMS
        .get_or_init(|| {
            let folder = tempfile::tempdir().unwrap();
            let scene = ["film", "--preset", "clean", "--frame-count", "20", "-q"];
            let more: [&[&str]; 2] = [
                &["-o", "film.mp4", "--x264-preset", "ultrafast", "--rig", "rig.toml"],
                &["-o", "film.mraw"],
            ];
            for more in more {
                done(folder.path(), &[&scene[..], more].concat());
            }
            folder
        })
        .path()
}

/// A folder with copies of some of them.
fn folder_with(names: &[&str]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for name in names {
        fs::copy(films().join(name), folder.path().join(name)).unwrap();
    }
    folder
}

fn names_in(folder: &Path) -> Vec<OsString> {
    let mut names: Vec<_> = fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name()).collect();
    names.sort();
    names
}
