//! `tracker track` through the real binary: same bytes for any threads and after any death, and what it refuses.

#![allow(clippy::unwrap_used, clippy::panic)] // a test may fail by panicking

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::OnceLock;
use std::time::Duration;

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
            let make = |name: &str, more: &[&str]| {
                let path = folder.path().join(name);
                let rig = folder.path().join("rig.toml");
                let mut arguments = vec!["film", "--preset", "clean", "--frames", "240", "-q", "--rig"];
                arguments.extend([rig.to_str().unwrap(), "-o", path.to_str().unwrap()]);
                arguments.extend(more);
                let (status, _, error) = said(&arguments);
                assert_eq!(status, 0, "{error}");
            };
            make("film.mp4", &["--speed", "ultrafast"]);
            make("film.avi", &["--codec", "mjpeg"]);
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

#[test]
fn tables_are_the_same_for_any_number_of_threads_and_from_run_to_run() {
    let case = Case::new();
    for ending in ["parquet", "csv"] {
        let mut first = None;
        for (i, threads) in ["1", "2", "8", "2"].into_iter().enumerate() {
            let out = case.text(&format!("t{i}.{ending}"));
            let (status, _, error) =
                said(&["track", &film("film.mp4"), "-o", &out, "--threads", threads, "--quiet"]);
            assert_eq!(status, 0, "{error}");
            let bytes = fs::read(&out).unwrap();
            assert!(*first.get_or_insert_with(|| bytes.clone()) == bytes, "{threads} threads, {ending}");
        }
    }
    assert_eq!(fs::read(case.path("t0.csv.json")).unwrap(), fs::read(case.path("t2.csv.json")).unwrap());
    let table = read_table(&case.path("t0.parquet")).unwrap();
    assert_eq!((table.frames(), table.nodes()), (240, 9));
    assert!(read_table(&case.path("t0.csv")).unwrap().rows.same(&table.rows));
}

#[test]
fn a_killed_run_goes_on_to_the_same_bytes() {
    for name in ["film.mp4", "film.avi"] {
        let case = Case::new();
        let expected = whole(&case, &film(name), "whole.parquet");
        let out = case.text("killed.parquet");
        // Wherever the kill falls, before the state exists, in detection or in the table, the result is the same.
        for wait_ms in [5, 60, 150, 300] {
            let input = film(name);
            let mut child = start(&["track", &input, "-o", &out, "--resume", "--quiet"]);
            std::thread::sleep(Duration::from_millis(wait_ms));
            child.kill().unwrap();
            child.wait().unwrap();
            if !case.path("killed.parquet.partial").exists() {
                continue;
            }
            assert!(!case.path("killed.parquet").exists(), "a table was there before it was whole");
        }
        let (status, _, error) = said(&["track", &film(name), "-o", &out, "--resume", "--quiet"]);
        assert_eq!(status, 0, "{error}");
        assert!(fs::read(&out).unwrap() == expected, "{name}: other bytes after a kill");
        assert_eq!(case.files(), ["killed.parquet", "whole.parquet"], "something was left behind");
        let (status, _, _) = said(&["track", &film(name), "-o", &out, "--resume", "--quiet"]);
        assert_eq!(status, 0, "a finished run is not done again, and that is no error");
    }
}

#[test]
fn a_state_cut_anywhere_goes_on_to_the_same_bytes() {
    let case = Case::new();
    let expected = whole(&case, &film("film.mp4"), "whole.parquet");
    let out = case.text("cut.parquet");
    // A run whose disk is full while it writes the table leaves the state of a whole recording.
    let input = film("film.mp4");
    let limited = format!("trap '' XFSZ; ulimit -f 12; exec \"$0\" track '{input}' -o '{out}' --quiet");
    let full = Command::new("sh").args(["-c", &limited, env!("CARGO_BIN_EXE_tracker")]).output().unwrap();
    let error = String::from_utf8_lossy(&full.stderr).into_owned();
    assert_eq!(full.status.code(), Some(2), "{error}");
    assert!(error.contains("cut.parquet") && error.contains("cannot be written"), "{error}");
    let state = fs::read(case.path("cut.parquet.partial")).unwrap();
    assert!(!case.path("cut.parquet").exists());
    for part in [1.0, 0.7, 0.3] {
        let cut = (state.len() as f64 * part) as usize;
        fs::write(case.path("cut.parquet.partial"), &state[..cut]).unwrap();
        let (status, _, error) = said(&["track", &input, "-o", &out, "--resume", "--quiet"]);
        if status == 2 {
            // Cut within its header, it is refused and says what to do.
            assert!(error.contains("without --resume"), "{error}");
            assert!(cut < 4096, "{error}");
            continue;
        }
        assert_eq!(status, 0, "{error}");
        assert!(fs::read(&out).unwrap() == expected);
        fs::remove_file(&out).unwrap();
    }
}

#[test]
fn ctrl_c_closes_the_table_and_the_run_can_go_on() {
    let case = Case::new();
    let input = film("film.mp4");
    let expected = whole(&case, &input, "whole.csv");
    let out = case.text("stopped.csv");
    let rig = film("rig.toml");
    let mut stopped = None;
    for wait_ms in [400, 250, 150, 80, 600] {
        let child =
            start(&["track", &input, "-o", &out, "--rig", &rig, "--force", "--quiet", "--threads", "1"]);
        std::thread::sleep(Duration::from_millis(wait_ms));
        let interrupt = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
        let status = child.wait_with_output().unwrap().status.code();
        if interrupt.success() && status == Some(130) && case.path("stopped.csv").exists() {
            stopped = Some(wait_ms);
            break;
        }
    }
    let Some(_) = stopped else {
        // On a machine where no signal fell into detection there is nothing to see; the next runs may.
        return;
    };
    let table = read_table(&case.path("stopped.csv")).unwrap();
    assert_eq!(table.meta.ending, RunEnding::Interrupted);
    assert!(table.frames() > 0 && table.frames() <= 240);
    assert!(case.path("stopped.csv.partial").exists());
    let (status, _, error) = said(&["track", &input, "-o", &out, "--rig", &rig, "--quiet"]);
    assert_eq!(status, 2);
    assert!(error.contains("there already"), "{error}");
    let (status, _, error) = said(&["track", &input, "-o", &out, "--resume", "--quiet"]);
    assert_eq!(status, 0, "{error}");
    assert!(fs::read(&out).unwrap() == expected, "other bytes after ctrl-c");
}

#[test]
fn an_output_is_only_replaced_if_asked() {
    let case = Case::new();
    fs::write(case.path("t.parquet"), "mine").unwrap();
    let out = case.text("t.parquet");
    let (status, _, error) = said(&["track", &film("film.mp4"), "-o", &out, "--quiet"]);
    assert_eq!(status, 2);
    assert!(error.contains("it is there already") && error.contains("--force"), "{error}");
    assert_eq!(fs::read(&out).unwrap(), b"mine");
    let (status, _, _) = said(&["track", &film("film.mp4"), "-o", &out, "--quiet", "--force"]);
    assert_eq!(status, 0);
    assert!(read_table(&case.path("t.parquet")).is_ok());
}

#[test]
fn a_run_goes_on_only_with_what_it_began_with() {
    let case = Case::new();
    let input = film("film.mp4");
    let out = case.text("t.parquet");
    let limited = format!("trap '' XFSZ; ulimit -f 12; exec \"$0\" track '{input}' -o '{out}' --quiet");
    Command::new("sh").args(["-c", &limited, env!("CARGO_BIN_EXE_tracker")]).output().unwrap();
    assert!(case.path("t.parquet.partial").exists());
    let refused = |more: &[&str], expected: &str| {
        let mut arguments = vec!["track", &input, "-o", &out, "--quiet"];
        arguments.extend(more);
        let (status, _, error) = said(&arguments);
        assert!(status == 2 && error.contains(expected), "{more:?}: {error}");
    };
    refused(&[], "an earlier run was stopped and can go on");
    refused(&["--resume", "--fps", "77"], "another");
    refused(&["--resume", "--threshold", "90"], "another detection settings");
    refused(&["--resume", "--frames", "0..9"], "another --frames");
    let other = film("film.avi");
    let (status, _, error) = said(&["track", &other, "-o", &out, "--quiet", "--resume"]);
    assert!(status == 2 && error.contains("another recording"), "{error}");
    assert_eq!(said(&["track", &input, "-o", &out, "--quiet", "--resume"]).0, 0);
}

#[test]
fn a_recording_cut_off_gives_all_that_is_good_and_status_1() {
    let case = Case::new();
    let bytes = fs::read(film("film.avi")).unwrap();
    fs::write(case.path("cut.avi"), &bytes[..bytes.len() * 2 / 3]).unwrap();
    let out = case.text("cut.csv");
    let (status, text, error) =
        said(&["track", &case.text("cut.avi"), "-o", &out, "--rig", &film("rig.toml"), "--json"]);
    assert_eq!(status, 1, "{error}");
    assert!(error.contains("ended early"), "{error}");
    let said: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(said["status"], 1);
    assert_eq!(said["ending"]["kind"], "early");
    let table = read_table(&case.path("cut.csv")).unwrap();
    assert!(table.frames() > 100 && table.frames() < 240, "{}", table.frames());
    assert!(matches!(table.meta.ending, RunEnding::Early { .. }));
    assert!(!case.path("cut.csv.partial").exists());
}

#[test]
fn what_makes_no_sense_is_refused_with_what_to_do() {
    let case = Case::new();
    let input = film("film.mp4");
    let out = case.text("t.csv");
    fs::write(case.path("text.mp4"), "not a film at all\n".repeat(50)).unwrap();
    fs::write(case.path("bad.toml"), "schema = 1\nimage_px = [720, 720]\nnode = 3\n").unwrap();
    let rig = fs::read_to_string(films().join("rig.toml")).unwrap();
    let named = rig.replacen("body = \"upper\"", "body = \"third\"", 1);
    fs::write(case.path("unknown.toml"), named).unwrap();
    fs::write(case.path("small.toml"), "schema = 1\nimage_px = [64, 48]\n[[body]]\nname = \"b\"\n[[node]]\nname = \"n0\"\nbody = \"b\"\nx_px = 1.0\ny_px = 1.0\n").unwrap();
    let (none, text) = (case.text("none.mp4"), case.text("text.mp4"));
    let (bad, unknown, small) = (case.text("bad.toml"), case.text("unknown.toml"), case.text("small.toml"));
    let nowhere = case.text("nowhere/t.csv");
    for (arguments, expected) in [
        (vec![none.as_str(), "-o", &out], "no such file"),
        (vec![text.as_str(), "-o", &out], "text.mp4: not a recording"),
        (vec![&input, "-o", "t.xlsx"], "neither Parquet nor CSV"),
        (vec![&input, "-o", &nowhere], "nowhere/t.csv"),
        (vec![&input, "-o", &out, "--rig", &none], "none.mp4: the rig file cannot be read"),
        (vec![&input, "-o", &out, "--rig", &bad], "bad.toml, line"),
        (vec![&input, "-o", &out, "--rig", &unknown], "its body \"third\" is not in the rig"),
        (
            vec![&input, "-o", &out, "--rig", &small],
            "it is for images of 64 x 48 px, the recording has 720 x 720",
        ),
        (vec![&input, "-o", &out, "--frames", "9..3"], "9..3 holds no frame"),
        (vec![&input, "-o", &out, "--frames", "9000..9001"], "it ends before frame 9000"),
        (vec![&input, "-o", &out, "--frames", "x"], "expected A..B"),
        (vec![&input, "-o", &out, "--threshold", "dim"], "expected auto or a number"),
        (vec![&input, "-o", &out, "--fps=-3"], "fps"),
        (vec!["-", "-o", &out, "--resume"], "standard input cannot be read again"),
        (vec![&input], "--output"),
    ] {
        let mut all = vec!["track"];
        all.extend(arguments);
        let (status, stdout, error) = said(&all);
        assert_eq!(status, 2, "{all:?}: {error}");
        assert!(error.contains(expected), "{all:?}: {error}");
        assert!(stdout.is_empty() && !error.contains("panicked"), "{error}");
    }
    let (status, _, _) = said(&["track", &input, "-o", &out, "--frames", "3..40", "--quiet"]);
    assert!(status == 0 || status == 1);
    let table = read_table(&case.path("t.csv")).unwrap();
    assert_eq!((table.rows.frame[0], table.frames()), (3, 37));
}
