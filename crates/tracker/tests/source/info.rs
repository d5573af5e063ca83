//! `tracker info` as a program: human and JSON output, standard input, exit status.

use std::fs::File;
use std::process::{Command, Stdio};

use serde_json::Value;

use crate::film::{encode, have_ffmpeg};

/// Exit status, standard output and standard error of `tracker info`.
pub fn info(arguments: &[&str], input: Stdio) -> (i32, String, String) {
    let done = Command::new(env!("CARGO_BIN_EXE_tracker"))
        .arg("info")
        .args(arguments)
        .stdin(input)
        .output()
        .unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (done.status.code().unwrap(), text(done.stdout), text(done.stderr))
}

#[test]
fn a_film_is_described_from_a_file_and_from_standard_input() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = encode(folder.path(), "a.y4m", 30, &["-pix_fmt", "gray", "-strict", "-1"]);
    let name = path.to_str().unwrap();
    for (argument, input) in [(name, Stdio::null()), ("-", Stdio::from(File::open(&path).unwrap()))] {
        let (status, out, err) = info(&[argument, "--json", "--count"], input);
        assert_eq!((status, err.as_str()), (0, ""), "{out}");
        let value: Value = serde_json::from_str(&out).unwrap();
        assert_eq!(value["decoded_frames"], 30);
        assert_eq!((&value["width_px"], &value["depth_bits"]), (&Value::from(196), &Value::from(8)));
        assert_eq!(value["ending"]["status"], "complete");
        assert!((value["duration_s"].as_f64().unwrap() - 0.06).abs() < 1e-9, "{}", value["duration_s"]);
        assert_eq!(value["first_times_s"].as_array().unwrap().len(), 5);
    }
    let (status, out, _) = info(&[name, "--fps", "10000"], Stdio::null());
    assert_eq!(status, 0);
    assert!(out.contains("10000 frames per second, as given with --fps"), "{out}");
}

#[test]
fn ends_and_errors_show_in_the_exit_status() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = encode(folder.path(), "a.avi", 30, &["-c:v", "mjpeg", "-pix_fmt", "yuvj420p"]);
    let bytes = std::fs::read(&path).unwrap();
    std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    let (status, out, _) = info(&[path.to_str().unwrap(), "--count"], Stdio::null());
    assert_eq!(status, 1, "{out}");
    assert!(out.contains("early, after frame"), "{out}");
    let (status, out, err) = info(&["no such file.mp4"], Stdio::null());
    assert_eq!((status, out.as_str()), (2, ""));
    assert!(err.contains("no such file.mp4: no such file"), "{err}");
}
