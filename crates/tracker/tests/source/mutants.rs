//! Damaged copies of small films in every container: whatever is lost must be told, and every picture that is handed
//! out must have its own time.
//!
//! `MUTANTS=300 cargo test --release --test source -- mutants --nocapture` tries that many of each film and counts what
//! came out; the suite tries a few with the same seed.

use std::collections::BTreeMap;
use std::path::Path;

use tracker::frame::{Ending, Frame};
use tracker::source::{OpenOptions, open};

use crate::film::{encode, have_ffmpeg, samples};

const COUNT: usize = 24;

/// Film name and encoder arguments.
const FILMS: [(&str, &[&str]); 20] = [
    ("h264.mp4", &["-c:v", "libx264", "-g", "8", "-bf", "2"]),
    ("fast.mp4", &["-c:v", "libx264", "-g", "8", "-movflags", "faststart"]),
    ("frag.mp4", &["-c:v", "libx264", "-g", "4", "-movflags", "frag_keyframe+empty_moov"]),
    ("png.mov", &["-c:v", "png"]),
    ("jpeg.mov", &["-c:v", "mjpeg", "-pix_fmt", "yuvj420p"]),
    ("h264.mkv", &["-c:v", "libx264", "-g", "8"]),
    ("long.mkv", &["-c:v", "libx264", "-g", "250", "-cluster_time_limit", "8"]),
    ("ffv1.mkv", &["-c:v", "ffv1", "-cluster_time_limit", "8"]),
    ("vp9.webm", &["-c:v", "libvpx-vp9", "-g", "8", "-cluster_time_limit", "8", "-deadline", "realtime"]),
    ("jpeg.avi", &["-c:v", "mjpeg", "-pix_fmt", "yuvj420p"]),
    ("raw.avi", &["-c:v", "rawvideo", "-pix_fmt", "gray"]),
    ("a.gif", &["-vf", "setpts=N/50/TB", "-r", "50"]),
    ("h264.ts", &["-c:v", "libx264", "-g", "8"]),
    ("h264.flv", &["-c:v", "libx264", "-g", "8", "-bf", "2"]),
    ("sorenson.flv", &["-c:v", "flv", "-g", "8", "-q:v", "3"]),
    ("a.asf", &["-c:v", "msmpeg4", "-g", "8", "-q:v", "3"]),
    ("theora.ogv", &["-c:v", "libtheora", "-g", "8", "-q:v", "9", "-page_duration", "8000"]),
    ("a.nut", &["-c:v", "mpeg4", "-g", "8", "-q:v", "3"]),
    ("mpeg2.mpg", &["-vf", "setpts=N/25/TB", "-r", "25", "-c:v", "mpeg2video", "-g", "8", "-q:v", "3"]),
    ("a.y4m", &["-pix_fmt", "gray", "-strict", "-1"]),
];

/// Numbers without a pattern (SplitMix64).
struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % n as u64) as usize
    }

    fn fill(&mut self, bytes: &mut [u8]) {
        bytes.iter_mut().for_each(|b| *b = self.below(256) as u8);
    }
}

/// A damaged copy, and what was done to it.
fn mutate(whole: &[u8], random: &mut Random) -> (String, Vec<u8>) {
    let mut bytes = whole.to_vec();
    let at = random.below(whole.len());
    let length = [1, 4, 60, 700, 4000][random.below(5)].min(whole.len() - at);
    let what = match random.below(6) {
        0 => {
            bytes[at] ^= 1 << random.below(8);
            format!("bit at {at}")
        }
        1 => {
            bytes[at..at + length].fill(0);
            format!("{length} zeros at {at}")
        }
        2 => {
            random.fill(&mut bytes[at..at + length]);
            format!("{length} noise at {at}")
        }
        3 => {
            bytes.drain(at..at + length);
            format!("{length} cut out at {at}")
        }
        4 => {
            let mut more = vec![0; length];
            random.fill(&mut more[..]);
            bytes.splice(at..at, more);
            format!("{length} put in at {at}")
        }
        _ => {
            bytes.truncate(at);
            format!("cut at {at}")
        }
    };
    (what, bytes)
}

/// Which of the whole film's pictures a frame shows; `None` if none, which is damage to pixels.
fn which(pictures: &[Vec<u32>], frame: &Frame) -> Option<usize> {
    let seen = samples(frame)?;
    pictures.iter().position(|p| *p == seen)
}

/// Outcome of reading a damaged copy.
fn outcome(path: &Path, pictures: &[Vec<u32>], times: &[f64]) -> &'static str {
    let Ok(mut source) = open(path.to_str().unwrap(), &OpenOptions::default()) else { return "refused" };
    let base = source.info().time_base;
    let mut frames = Vec::new();
    loop {
        match source.next_frame() {
            Ok(Some(frame)) => frames.push(frame),
            Ok(None) => break,
            Err(_) => return "refused",
        }
    }
    let told = source.ending() != Ending::Complete
        || source.gaps().is_damage()
        || frames.iter().any(|f| f.plane.is_none());
    if frames.iter().enumerate().any(|(i, f)| f.index != i as u64) {
        return "WRONG INDEX";
    }
    if frames.windows(2).any(|w| w[0].ticks >= w[1].ticks) {
        return if told { "times stand still, told" } else { "times stand still" };
    }
    if frames.iter().any(|f| (f.width, f.height) != (196, 116)) {
        return "another size";
    }
    let shown: Vec<Option<usize>> = frames.iter().map(|f| which(pictures, f)).collect();
    let step = (times[COUNT - 1] - times[0]) / (COUNT - 1) as f64;
    let wrong = frames
        .iter()
        .zip(&shown)
        .any(|(f, s)| s.is_some_and(|s| (base.seconds(f.ticks) - times[s]).abs() > 0.51 * step));
    let foreign = frames.iter().zip(&shown).any(|(f, s)| f.plane.is_some() && s.is_none());
    match (told, wrong, foreign) {
        (true, true, _) => "told, another time's picture",
        (true, false, true) => "told, pixels damaged",
        (true, false, false) => "told",
        (false, true, _) => "SILENT WRONG TIMES",
        (false, false, _) if frames.len() != COUNT => "SILENT LOSS",
        (false, false, true) => "silent, pixels damaged",
        (false, false, false) => "whole",
    }
}

#[test]
fn mutants_are_told_or_whole() {
    if !have_ffmpeg() {
        return;
    }
    let each: usize = std::env::var("MUTANTS").ok().and_then(|n| n.parse().ok()).unwrap_or(12);
    let only = std::env::var("MUTANTS_OF").unwrap_or_default();
    let folder = tempfile::tempdir().unwrap();
    let mut bad = Vec::new();
    for (name, arguments) in FILMS.iter().filter(|(n, _)| n.contains(&only)) {
        let path = encode(folder.path(), name, COUNT, arguments);
        let whole = std::fs::read(&path).unwrap();
        let mut source = open(path.to_str().unwrap(), &OpenOptions::default()).unwrap();
        let base = source.info().time_base;
        let frames = crate::film::read_all(&mut *source);
        assert_eq!(frames.len(), COUNT, "{name}");
        let pictures: Vec<_> = frames.iter().map(|f| samples(f).unwrap()).collect();
        let times: Vec<f64> = frames.iter().map(|f| base.seconds(f.ticks)).collect();
        drop(frames);
        let mut random = Random(16);
        let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
        let copy = folder.path().join(format!("mutant-{name}"));
        for k in 0..each {
            let (what, bytes) = mutate(&whole, &mut random);
            std::fs::write(&copy, &bytes).unwrap();
            let outcome = outcome(&copy, &pictures, &times);
            *counts.entry(outcome).or_default() += 1;
            if outcome.chars().next().is_some_and(char::is_uppercase) {
                bad.push(format!("{name} {k}: {outcome}: {what} of {}", whole.len()));
                if let Ok(keep) = std::env::var("MUTANTS_KEEP") {
                    std::fs::write(Path::new(&keep).join(format!("{k}-{name}")), &bytes).unwrap();
                }
            }
        }
        println!("{name}: {counts:?}");
    }
    assert!(bad.is_empty(), "{}\n{} of them", bad.join("\n"), bad.len());
}
