//! `tracker track` through the real binary: same bytes for any threads and after any death, and what it refuses.

#![allow(clippy::unwrap_used, clippy::panic)] // a test may fail by panicking

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
                    vec!["film", "--preset", "clean", "--frames", frames, "-q", "--force", "--rig"];
                arguments.extend([rig.to_str().unwrap(), "-o", path.to_str().unwrap()]);
                arguments.extend(more);
                let (status, _, error) = said(&arguments);
                assert_eq!(status, 0, "{error}");
            };
            make("film.mp4", "240", &["--speed", "ultrafast"]);
            make("film.avi", "240", &["--codec", "mjpeg"]);
            // Some blocks of detections long, so that a run can be met between two of them.
            make("long.mp4", "800", &["--speed", "ultrafast"]);
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

fn signal(child: &Child, name: &str) {
    assert!(Command::new("kill").args([name, &child.id().to_string()]).status().unwrap().success());
}

/// Waits until something is so; fails if it never is.
fn until(what: &str, mut so: impl FnMut() -> bool) {
    let begin = Instant::now();
    while !so() {
        assert!(begin.elapsed() < Duration::from_secs(120), "waited in vain for {what}");
        std::thread::sleep(Duration::from_millis(1));
    }
}

#[test]
fn ctrl_c_closes_the_table_and_the_run_can_go_on() {
    let case = Case::new();
    let input = film("long.mp4");
    let expected = whole(&case, &input, "whole.csv");
    let out = case.text("stopped.csv");
    let rig = film("rig.toml");
    let state = case.path("stopped.csv.partial");
    // The signal is sent while the run stands still with some of its detections on disk. Only where it had come to
    // the table by then is there no more to stop, and another run shows it.
    let met = (0..20).any(|_| {
        let arguments = ["--rig", &rig, "--force", "--quiet", "--threads", "1"];
        let mut child = start(&[&["track", &input, "-o", &out], &arguments[..]].concat());
        until("the first detections", || {
            fs::metadata(&state).is_ok_and(|m| m.len() > 20_000) || child.try_wait().unwrap().is_some()
        });
        for name in ["-STOP", "-INT", "-CONT"] {
            signal(&child, name);
        }
        let status = child.wait().unwrap().code();
        assert!(matches!(status, Some(0 | 130)), "{status:?}");
        status == Some(130)
    });
    assert!(met, "no signal was heard in 20 runs");
    let table = read_table(&case.path("stopped.csv")).unwrap();
    assert_eq!(table.meta.ending, RunEnding::Interrupted);
    assert!(table.frames() > 0 && table.frames() < 800, "{}", table.frames());
    assert!(state.exists());
    let (status, _, error) = said(&["track", &input, "-o", &out, "--rig", &rig, "--quiet"]);
    assert_eq!(status, 2);
    assert!(error.contains("there already"), "{error}");
    let (status, _, error) = said(&["track", &input, "-o", &out, "--resume", "--quiet"]);
    assert_eq!(status, 0, "{error}");
    assert!(fs::read(&out).unwrap() == expected, "other bytes after ctrl-c");
}

#[test]
fn ctrl_c_is_heard_while_a_pipe_gives_nothing() {
    let case = Case::new();
    let pipe = case.path("pipe.y4m");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let head = b"YUV4MPEG2 W64 H48 F500:1 Ip A1:1 Cmono\n".to_vec();
    let frame = [&b"FRAME\n"[..], &[20; 64 * 48]].concat();
    // Nobody opens the other end; nobody writes; a head and no frame; two frames and no more.
    let given = [None, Some(vec![]), Some(head.clone()), Some([&head[..], &frame, &frame].concat())];
    for (k, bytes) in given.into_iter().enumerate() {
        let mut child = start(&["track", &case.text("pipe.y4m"), "-o", &case.text("t.csv"), "--quiet"]);
        // Opening a pipe to write waits for a reader, so the child has it open by then.
        let held = bytes.map(|bytes| {
            let mut end = fs::OpenOptions::new().write(true).open(&pipe).unwrap();
            end.write_all(&bytes).unwrap();
            end
        });
        // Bit 1 of the signals that it catches is ctrl-c.
        let status = format!("/proc/{}/status", child.id());
        until("the handler", || {
            let text = fs::read_to_string(&status).unwrap();
            let mask = text.lines().find_map(|l| l.strip_prefix("SigCgt:")).unwrap().trim();
            u64::from_str_radix(mask, 16).unwrap() & 2 != 0
        });
        signal(&child, "-INT");
        let mut code = None;
        until("the end after ctrl-c", || {
            code = child.try_wait().unwrap();
            code.is_some()
        });
        assert_eq!(code.unwrap().code(), Some(130), "case {k}");
        drop(held);
        assert_eq!(case.files(), ["pipe.y4m"], "case {k}");
    }
}

#[test]
fn check_tells_what_became_of_each_node() {
    let case = Case::new();
    let csv = case.path("t.csv");
    said(&["track", &film("film.mp4"), "-o", &case.text("t.csv"), "--frames", "0..60", "--quiet"]);
    let nodes = |csv: &Path| -> Vec<serde_json::Value> {
        let (status, stdout, error) = said(&["check", "--json", csv.to_str().unwrap()]);
        assert_eq!(status, 0, "{error}");
        let told: serde_json::Value = serde_json::from_str(&stdout).unwrap();
        assert_eq!(told["frames"], 60);
        told["nodes"].as_array().unwrap().clone()
    };
    let good = nodes(&csv);
    let whole = good.iter().position(|n| n["summary"]["seen"] == 60 && n["motion"]["gaps"] == 0).unwrap();
    let name = good[whole]["summary"]["node"].as_str().unwrap().to_owned();
    let motion = |told: &[serde_json::Value], key: &str| told[whole]["motion"][key].as_f64().unwrap();
    let [residual_px, fastest_px] = ["residual_px", "fastest_px"].map(|key| motion(&good, key));
    assert!(residual_px < 0.1 && fastest_px < 10.0, "{:?}", good[whole]);
    // Lost in frames 10 to 16 and in 30, and 30 px off its place in frame 45.
    let spoiled: Vec<String> = fs::read_to_string(&csv)
        .unwrap()
        .lines()
        .map(|line| {
            let mut fields: Vec<String> = line.split(',').map(String::from).collect();
            if fields[2] == name {
                match fields[0].parse::<u64>().unwrap() {
                    10..17 | 30 => {
                        fields[4..8].iter_mut().for_each(String::clear);
                        fields[8] = "missing".into();
                    }
                    45 => fields[4] = format!("{}", fields[4].parse::<f64>().unwrap() + 30.0),
                    _ => {}
                }
            }
            fields.join(",")
        })
        .collect();
    fs::write(&csv, spoiled.join("\n") + "\n").unwrap();
    let told = nodes(&csv);
    let count = |of: &str, key: &str| told[whole][of][key].as_u64().unwrap();
    assert_eq!(
        (count("summary", "seen"), count("summary", "longest_gap"), count("motion", "gaps")),
        (52, 7, 2)
    );
    assert!(motion(&told, "fastest_px") > 20.0, "{:?}", told[whole]);
    assert!(motion(&told, "residual_px") > 10.0 * residual_px, "{:?}", told[whole]);
    // The others are as they were.
    assert!((0..good.len()).filter(|&k| k != whole).all(|k| told[k]["summary"] == good[k]["summary"]));
}

#[test]
fn tables_that_are_not_whole_or_not_right_are_refused_by_check() {
    let case = Case::new();
    let (parquet, csv) = (case.path("t.parquet"), case.path("t.csv"));
    for name in ["t.parquet", "t.csv"] {
        let arguments = ["track", &film("film.mp4"), "-o", &case.text(name), "--frames", "0..40", "--quiet"];
        assert!(said(&arguments).0 <= 1);
    }
    let refused = |path: &Path, expected: &[&str]| {
        let (status, stdout, error) = said(&["check", path.to_str().unwrap()]);
        assert_eq!(status, 2, "{error}");
        assert!(stdout.is_empty() && !error.contains("panicked"), "{error}");
        let name = path.file_name().unwrap().to_str().unwrap();
        for word in [name].iter().chain(expected) {
            assert!(error.contains(word), "{word:?} is not in {error:?}");
        }
    };
    let bytes = fs::read(&parquet).unwrap();
    fs::write(&parquet, &bytes[..bytes.len() / 2]).unwrap();
    refused(&parquet, &["not a whole Parquet file", "copy it again"]);
    let text = fs::read_to_string(&csv).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    let field = |line: usize, at: usize, with: &str| {
        let mut fields: Vec<&str> = lines[line].split(',').collect();
        fields[at] = with;
        let mut out = lines.clone();
        let changed = fields.join(",");
        out[line] = &changed;
        out.join("\n") + "\n"
    };
    let frame_again = lines[..19].iter().chain(&lines[10..]).copied().collect::<Vec<_>>().join("\n") + "\n";
    for (changed, expected) in [
        (field(0, 5, "y"), &["line 1", "there is no column y_px"][..]),
        (field(4, 4, "far"), &["line 5", "column x_px", "\"far\" is not a number"]),
        (field(4, 5, "NaN"), &["line 5", "column y_px", "NaN is not a finite number"]),
        (frame_again, &["frame 1 comes after frame 1"]),
        (field(7, 2, "n99"), &["line 8", "node \"n99\"", "expected"]),
        (text[..text.len() - 30].to_owned(), &["line"]),
    ] {
        fs::write(&csv, changed).unwrap();
        refused(&csv, expected);
    }
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
    let another_film = || {
        let (status, _, error) = said(&["track", &other, "-o", &out, "--quiet", "--resume"]);
        assert!(status == 2 && error.contains("another recording"), "{error}");
    };
    another_film();
    assert_eq!(said(&["track", &input, "-o", &out, "--quiet", "--resume"]).0, 0);
    // The same of a table that is whole.
    let bytes = fs::read(&out).unwrap();
    assert_eq!(said(&["track", &input, "-o", &out, "--quiet", "--resume"]).0, 0);
    refused(&["--resume", "--fps", "77"], "another");
    refused(&["--resume", "--threshold", "90"], "complete and had another detection settings");
    refused(&["--resume", "--frames", "0..9"], "complete and had another --frames");
    let rig = case.text("rig.toml");
    fs::write(&rig, read_table(&case.path("t.parquet")).unwrap().meta.rig.to_toml().unwrap()).unwrap();
    refused(&["--resume", "--rig", &rig], "complete and had another rig");
    another_film();
    assert!(fs::read(&out).unwrap() == bytes);
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
fn frames_that_cannot_be_decoded_are_named_and_have_a_status_of_their_own() {
    let case = Case::new();
    let mut bytes = fs::read(film("film.mp4")).unwrap();
    // In the middle of the coded pictures: some cannot be decoded, and those that are predicted from them.
    let middle = bytes.len() / 2;
    bytes[middle..middle + 500].fill(0);
    let input = case.text("damaged.mp4");
    fs::write(&input, &bytes).unwrap();
    for name in ["o.parquet", "o.csv"] {
        let out = case.text(name);
        let (status, text, error) = said(&["track", &input, "-o", &out]);
        assert_eq!(status, 1, "{text}{error}");
        let line = error.lines().find(|l| l.contains(": damaged: frame")).unwrap();
        assert!(line.contains(" cannot be decoded") && line.contains(name), "{line}");
        let table = read_table(Path::new(&out)).unwrap();
        assert_eq!((table.frames(), &table.meta.ending), (240, &RunEnding::Damaged));
        let lost = &table.meta.damage.undecoded;
        assert!(lost.frames > 0 && lost.frames < 200, "{lost:?}");
        let within = |t: u64| lost.stretches.iter().any(|[a, b]| (*a..=*b).contains(&t));
        for (t, row) in table.rows.status.chunks_exact(table.nodes()).enumerate() {
            let undecoded = row.iter().filter(|s| **s == Status::Undecoded as u8).count();
            assert_eq!(undecoded, if within(t as u64) { table.nodes() } else { 0 }, "frame {t}");
        }
        assert!(table.summary().iter().all(|n| n.undecoded == lost.frames));
        let (status, checked, error) = said(&["check", &out]);
        assert_eq!(status, 0, "{error}");
        assert!(checked.contains(&format!("damaged: {} cannot be decoded", lost.words())), "{checked}");
        // It is complete, and still damaged.
        let (status, _, error) = said(&["track", &input, "-o", &out, "--resume"]);
        assert!(status == 1 && error.contains("was complete already"), "{error}");
    }
    let (status, text, _) = said(&["info", "--count", &input]);
    assert!(status == 1 && text.contains("damaged: frame"), "{text}");
    // The rig of what can be read is written, and the status is that of the film.
    let rig = case.text("damaged.toml");
    let (status, text, error) = said(&["setup", &input, "-o", &rig]);
    assert!(status == 1 && error.contains("damaged: frame") && Path::new(&rig).exists(), "{text}{error}");
    let cut = case.text("early.avi");
    let whole = fs::read(film("film.avi")).unwrap();
    fs::write(&cut, &whole[..whole.len() * 8 / 10]).unwrap();
    let (status, text, error) = said(&["setup", &cut, "-o", &rig, "--force", "--quiet"]);
    assert!(status == 1 && error.contains("the recording ended early"), "{text}{error}");
    let (status, _, error) = said(&["setup", &film("film.mp4"), "-o", &rig, "--force"]);
    assert_eq!(status, 0, "{error}");
    let (status, json, _) = said(&["info", "--count", "--json", &input]);
    let value: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!((status, &value["ending"]["status"]), (1, &serde_json::json!("damaged")));
    assert_eq!(value["declared_frames"], 240);
    let counted = value["decoded_frames"].as_u64().unwrap() + value["undecodable_frames"].as_u64().unwrap();
    assert_eq!(counted, 240);
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
    // No file can be made in /proc, not even by root.
    let closed = "/proc/t.csv".to_owned();
    for (arguments, expected) in [
        (vec![none.as_str(), "-o", &out], "no such file"),
        (vec![text.as_str(), "-o", &out], "text.mp4: text, not a recording"),
        (vec![&input, "-o", "t.xlsx"], "unknown extension, expected .parquet or .csv"),
        (vec![&input, "-o", &nowhere], "nowhere/t.csv"),
        (vec![&input, "-o", &closed], "/proc/t.csv"),
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
