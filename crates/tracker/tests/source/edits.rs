//! Edit lists of MP4, written into a whole film: empty edits, pieces that begin and end inside the film, and both.

use std::path::Path;
use std::process::Stdio;

use serde_json::Value;

use crate::film::{encode, have_ffmpeg};
use crate::info::info;

/// Frames of the film, and its frames per second.
const COUNT: usize = 240;
const RATE: usize = 60;

fn word(bytes: &[u8], at: usize) -> usize {
    u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap()) as usize
}

/// Place and length of the box at a path of names.
fn place(bytes: &[u8], path: &[&[u8; 4]]) -> (usize, usize) {
    let (mut from, mut length) = (0, bytes.len() + 8);
    for name in path {
        let (mut at, end) = (if from == 0 { 0 } else { from + 8 }, from + length.min(bytes.len()));
        while &bytes[at + 4..at + 8] != *name {
            at += word(bytes, at);
            assert!(at < end, "no {name:?}");
        }
        (from, length) = (at, word(bytes, at));
    }
    (from, length)
}

/// The film with other edits: seconds shown, and seconds into the film at which that begins; `None` shows nothing.
fn with_edits(film: &[u8], edits: &[(f64, Option<f64>)]) -> Vec<u8> {
    let scale = |path: &[&[u8; 4]]| word(film, place(film, path).0 + 20) as f64;
    let movie = scale(&[b"moov", b"mvhd"]);
    let media = scale(&[b"moov", b"trak", b"mdia", b"mdhd"]);
    let mut list = vec![0, 0, 0, 0, 0, 0, 0, edits.len() as u8];
    for (shown, from) in edits {
        list.extend(((shown * movie).round() as u32).to_be_bytes());
        list.extend(from.map_or(-1, |s| (s * media).round() as i32).to_be_bytes());
        list.extend(0x1_0000u32.to_be_bytes());
    }
    let (at, old) = place(film, &[b"moov", b"trak", b"edts", b"elst"]);
    let new = [&((list.len() + 8) as u32).to_be_bytes(), &b"elst"[..], &list].concat();
    let mut out = [&film[..at], &new, &film[at + old..]].concat();
    for path in [&[b"moov"][..], &[b"moov", b"trak"], &[b"moov", b"trak", b"edts"]] {
        let (at, length) = place(film, path);
        out[at..at + 4].copy_from_slice(&((length + new.len() - old) as u32).to_be_bytes());
    }
    out
}

fn facts(path: &Path) -> (i32, Value) {
    let (status, out, err) = info(&[path.to_str().unwrap(), "--json", "--count"], Stdio::null());
    (status, serde_json::from_str(&out).unwrap_or_else(|_| panic!("{out}{err}")))
}

#[test]
fn what_edit_lists_show_is_whole_and_in_its_time() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let options = |more: &[&'static str]| {
        [&["-vf", "setpts=N/60/TB", "-r", "60", "-c:v", "libx264", "-g", "60"], more].concat()
    };
    for b_frames in ["0", "2"] {
        let path =
            encode(folder.path(), "film.mp4", COUNT, &options(&["-bf", b_frames, "-pix_fmt", "yuv420p"]));
        let film = std::fs::read(&path).unwrap();
        // Where pictures are kept in another order, the film begins with its second one's time.
        let begin = if b_frames == "0" { 0.0 } else { 2.0 / RATE as f64 };
        for (edits, frames, first_s) in [
            (&[(4.0, Some(0.0))][..], 240, 0.0),
            (&[(0.5, None), (4.0, Some(0.0))], 240, 0.5),
            (&[(0.5, None), (2.0, Some(2.0))], 120, 0.5),
            (&[(0.25, None), (1.0, Some(1.5))], 60, 0.25),
            (&[(1.0, Some(1.0))], 60, 0.0),
            (&[(2.0, Some(0.0))], 120, 0.0),
        ] {
            let shifted: Vec<_> =
                edits.iter().map(|(shown, from)| (*shown, from.map(|s| s + begin))).collect();
            std::fs::write(&path, with_edits(&film, &shifted)).unwrap();
            let (status, facts) = facts(&path);
            assert_eq!(status, 0, "{b_frames} {edits:?}: {}", facts["ending"]);
            assert_eq!(facts["decoded_frames"], frames, "{b_frames} {edits:?}");
            assert_eq!(facts["rate_hz"], RATE as f64, "{b_frames} {edits:?}");
            let first = facts["first_times_s"][0].as_f64().unwrap();
            assert!((first - first_s).abs() < 1e-6, "{b_frames} {edits:?}: {first}");
        }
    }
    // The last half of a film that is cut: pictures that the list shows are not there.
    let path = encode(folder.path(), "film.mp4", COUNT, &options(&["-bf", "0", "-movflags", "faststart"]));
    let film = with_edits(&std::fs::read(&path).unwrap(), &[(2.0, Some(2.0))]);
    std::fs::write(&path, &film[..film.len() * 3 / 4]).unwrap();
    let (status, facts) = facts(&path);
    assert_eq!((status, &facts["ending"]["status"]), (1, &Value::from("early")), "{facts}");
}
