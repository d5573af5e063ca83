//! `tracker track` through the real binary: same bytes for any threads and after any death, and what it refuses.

#![allow(clippy::unwrap_used, clippy::panic)] // a test may fail by panicking

mod checking;
mod damage;
mod outputs;
mod refusals;
mod same_bytes;
mod signals;

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use tracker::observation::Status;
use tracker::table::{RunEnding, read_table};

fn tracker() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tracker"));
    command.stdin(Stdio::null());
    command
}

fn run(arguments: &[&str]) -> Output {
    tracker().args(arguments).output().unwrap()
}

/// Exit status, standard output and standard error of a run.
fn said(arguments: &[&str]) -> (i32, String, String) {
    let out = run(arguments);
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (out.status.code().unwrap_or(-1), text(&out.stdout), text(&out.stderr))
}

/// Films, made once: all tests of this program read them.
fn films() -> &'static Path {
    static FILMS: OnceLock<tempfile::TempDir> = OnceLock::new();
    FILMS
        .get_or_init(|| {
            let folder = tempfile::tempdir().unwrap();
            let make = |name: &str, frames: &str, more: &[&str]| {
                let path = folder.path().join(name);
                let rig = folder.path().join("rig.toml");
                let mut arguments =
                    vec!["film", "--preset", "clean", "--frame-count", frames, "-q", "--force", "--rig"];
                arguments.extend([rig.to_str().unwrap(), "-o", path.to_str().unwrap()]);
                arguments.extend(more);
                let (status, _, error) = said(&arguments);
                assert_eq!(status, 0, "{error}");
            };
            make("film.mp4", "240", &["--x264-preset", "ultrafast"]);
            make("film.avi", "240", &["--codec", "mjpeg"]);
            // Some blocks of detections long, so that a run can be met between two of them.
            make("long.mp4", "800", &["--x264-preset", "ultrafast"]);
            folder
        })
        .path()
}

struct Case {
    folder: tempfile::TempDir,
}

impl Case {
    fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn text(&self, name: &str) -> String {
        self.path(name).display().to_string()
    }

    /// Names of all files in the folder.
    fn files(&self) -> Vec<String> {
        let mut names: Vec<_> = fs::read_dir(&self.folder)
            .unwrap()
            .map(|e| e.unwrap().file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }
}

fn film(name: &str) -> String {
    films().join(name).display().to_string()
}

/// The table of an uninterrupted run.
fn whole(case: &Case, film: &str, name: &str) -> Vec<u8> {
    let out = case.text(name);
    let (status, _, error) = said(&["track", film, "-o", &out, "--quiet"]);
    assert!(status == 0 || status == 1, "{error}");
    fs::read(case.path(name)).unwrap()
}

fn start(arguments: &[&str]) -> Child {
    tracker().args(arguments).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
}
