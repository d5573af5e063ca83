//! Recordings through the program as a user has them: from a pipe, cut, damaged, as a folder of pictures.

use std::io::Write;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use serde_json::Value;
use tracker::table::{NodeTable, read_table};

use crate::film::{encode, have_ffmpeg};

const COUNT: usize = 60;

fn tracker(arguments: &[&str], input: Stdio) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tracker")).args(arguments).stdin(input).output().unwrap()
}

/// A film in the form that its ending says, and its rig.
fn film(folder: &Path, name: &str, more: &[&str]) -> (PathBuf, String) {
    let (path, rig) = (folder.join(name), folder.join("rig.toml").display().to_string());
    let frames = COUNT.to_string();
    let mut arguments =
        vec!["film", "--preset", "clean", "--frame-count", &frames, "-q", "--force", "--rig", &rig, "-o"];
    arguments.push(path.to_str().unwrap());
    arguments.extend(more);
    let done = tracker(&arguments, Stdio::null());
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    (path, rig)
}

/// The table of a recording, and the exit status with which it was made.
fn track(input: &str, rig: &str, out: &Path, stdin: Stdio) -> (i32, NodeTable) {
    let out = out.to_str().unwrap();
    let done = tracker(&["track", input, "--rig", rig, "-o", out, "--quiet", "--force"], stdin);
    let error = String::from_utf8_lossy(&done.stderr);
    let status = done.status.code().unwrap();
    assert!(status < 2, "{input}: {error}");
    (status, read_table(Path::new(out)).unwrap())
}

fn convert(from: &Path, arguments: &[&str], to: &Path) {
    let mut command = Command::new("ffmpeg");
    command.args(["-v", "error", "-i"]).arg(from).args(arguments).arg(to);
    assert!(command.status().unwrap().success());
}

/// Largest distance between places of the same node in the same frame, px. Nearly all places are in both.
fn distance_px(a: &NodeTable, b: &NodeTable) -> f64 {
    assert_eq!((a.frames(), a.nodes()), (b.frames(), b.nodes()));
    let differences: Vec<f64> = a.rows.xy_px.iter().zip(&b.rows.xy_px).map(|(u, v)| (u - v).abs()).collect();
    let both = differences.iter().filter(|d| d.is_finite()).count();
    let either = a.rows.xy_px.iter().zip(&b.rows.xy_px).filter(|(u, v)| !u.is_nan() || !v.is_nan()).count();
    assert!(both * 50 > either * 49, "{both} of {either}");
    differences.into_iter().filter(|d| d.is_finite()).fold(0.0, f64::max)
}

#[test]
fn a_program_may_send_its_film_through_a_pipe() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let (path, rig) = film(folder.path(), "a.mp4", &["--x264-preset", "ultrafast"]);
    let (_, direct) = track(path.to_str().unwrap(), &rig, &folder.path().join("a.csv"), Stdio::null());
    let mut sender = Command::new("ffmpeg")
        .args(["-v", "error", "-i"])
        .arg(&path)
        .args(["-f", "yuv4mpegpipe", "-strict", "-1", "-"])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let pipe = Stdio::from(sender.stdout.take().unwrap());
    let (_, piped) = track("-", &rig, &folder.path().join("b.csv"), pipe);
    assert!(sender.wait().unwrap().success());
    assert_eq!(piped.frames(), COUNT);
    // The same pixels, but a pipe's levels are learned from its first frames: thresholds differ a little, and half
    // hidden markers with them.
    let distance = distance_px(&direct, &piped);
    assert!(distance < 0.2, "{distance} px");
    let times = direct.rows.time_s.iter().zip(&piped.rows.time_s).map(|(a, b)| (a - b).abs());
    assert!(times.fold(0.0, f64::max) < 1e-9);
}

#[test]
fn a_frame_damaged_in_the_middle_is_a_row_of_missing_with_its_time() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let (path, rig) = film(folder.path(), "a.mkv", &["--codec", "ffv1"]);
    let whole = folder.path().join("a.mov");
    convert(&path, &["-c:v", "png", "-movflags", "faststart"], &whole);
    let (status, good) = track(whole.to_str().unwrap(), &rig, &folder.path().join("a.csv"), Stdio::null());
    assert_eq!((status, good.frames()), (0, COUNT));
    let mut bytes = std::fs::read(&whole).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle..middle + 60].iter_mut().for_each(|b| *b = b.wrapping_mul(31).wrapping_add(17));
    std::fs::write(&whole, bytes).unwrap();
    let (_, table) = track(whole.to_str().unwrap(), &rig, &folder.path().join("b.csv"), Stdio::null());
    assert_eq!(table.rows.frame, good.rows.frame);
    assert_eq!(table.rows.time_s, good.rows.time_s);
    let nodes = table.nodes();
    let lost: Vec<usize> = (0..COUNT)
        .filter(|t| table.rows.xy_px[2 * nodes * t..2 * nodes * (t + 1)].iter().all(|v| v.is_nan()))
        .collect();
    // The bytes lie in one picture, or at the end of one and the start of the next.
    assert!(!lost.is_empty() && lost.len() <= 2 && lost[0].abs_diff(COUNT / 2) < 6, "{lost:?}");
    // All others are where they were: nothing moved up. Half hidden markers just after may wait for certainty.
    let mut both = 0;
    for t in (0..COUNT).filter(|t| !lost.contains(t)) {
        for at in 2 * nodes * t..2 * nodes * (t + 1) {
            let (a, b) = (good.rows.xy_px[at], table.rows.xy_px[at]);
            assert!(a.is_nan() || b.is_nan() || (a - b).abs() < 0.05, "frame {t}: {a} {b}");
            both += usize::from(!a.is_nan() && !b.is_nan());
        }
    }
    let whole = good.rows.xy_px.iter().filter(|v| !v.is_nan()).count();
    assert!(both * 20 > whole * 18, "{both} of {whole}");
}

#[test]
fn a_photron_file_cut_inside_a_frame_ends_early_with_status_1() {
    let folder = tempfile::tempdir().unwrap();
    let (path, rig) = film(folder.path(), "a.mraw", &["--bits", "12"]);
    let bytes = std::fs::read(&path).unwrap();
    let frame = bytes.len() / COUNT;
    std::fs::write(&path, &bytes[..frame * 41 + frame / 3]).unwrap();
    let name = path.to_str().unwrap();
    let done = tracker(&["info", name, "--count", "--json"], Stdio::null());
    assert_eq!(done.status.code(), Some(1));
    let value: Value = serde_json::from_slice(&done.stdout).unwrap();
    assert_eq!(value["decoded_frames"], 41);
    assert_eq!(value["declared_frames"], COUNT);
    assert_eq!(value["ending"]["byte"], frame * 41 + frame / 3);
    assert!(value["ending"]["reason"].as_str().unwrap().contains("into frame 41 of 60"), "{value}");
    let (status, table) = track(name, &rig, &folder.path().join("a.csv"), Stdio::null());
    assert_eq!((status, table.frames()), (1, 41));
}

#[test]
fn a_folder_of_pictures_tracks_as_the_film_does() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let (path, rig) = film(folder.path(), "a.mkv", &["--codec", "ffv1"]);
    let pictures = folder.path().join("pictures");
    std::fs::create_dir(&pictures).unwrap();
    convert(&path, &["-start_number", "8"], &pictures.join("img_%d.png"));
    let (_, film) = track(path.to_str().unwrap(), &rig, &folder.path().join("a.csv"), Stdio::null());
    let (status, table) =
        track(pictures.to_str().unwrap(), &rig, &folder.path().join("b.csv"), Stdio::null());
    // From 8 to 67: in the order of their numbers, not of their names. The same pixels; levels are learned from others
    // of them.
    assert_eq!((status, table.frames()), (0, COUNT));
    let distance = distance_px(&film, &table);
    assert!(distance < 0.2, "{distance} px");
}

#[test]
fn an_address_is_opened_only_if_asked() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let film = encode(folder.path(), "a.y4m", 30, &["-pix_fmt", "gray", "-strict", "-1"]);
    let server = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("tcp://{}", server.local_addr().unwrap());
    let refused = tracker(&["info", &address], Stdio::null());
    assert_eq!(refused.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&refused.stderr).contains("--allow-protocol"));
    let sender = std::thread::spawn(move || {
        server.accept().unwrap().0.write_all(&std::fs::read(film).unwrap()).unwrap();
    });
    let done = tracker(&["info", &address, "--count", "--json", "--allow-protocol"], Stdio::null());
    sender.join().unwrap();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let value: Value = serde_json::from_slice(&done.stdout).unwrap();
    assert_eq!(value["decoded_frames"], 30);
}
