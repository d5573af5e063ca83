//! Packets of codecs whose pictures stand for themselves or are watched by their decoder's words, damaged one at a time: how much of it is told.
//!
//! `DAMAGED=12 cargo test --release --workspace --locked --test source -- codecs --nocapture` damages that many of each film, in
//! three ways, and prints the table of docs/reference/recordings.md.

use std::path::{Path, PathBuf};

use tracker::source::{OpenOptions, open};

use crate::coded_damage::{noise, packets};
use crate::film::{encode, have_ffmpeg, read_all, samples};

const COUNT: usize = 40;

/// Films with texture, four times as large as drawn.
const LARGER: &str = "scale=392:232:flags=neighbor,noise=alls=12:all_seed=1";

/// How a packet is damaged: its last two thirds become noise, or zeros, or one bit in its middle is turned over.
pub const WAYS: [&str; 3] = ["noise", "zeros", "one bit"];

/// A film's name in the table, its file, its codec's options, and in which ways each damage to it must be told.
type Film = (&'static str, &'static str, &'static [&'static str], [bool; 3]);

const ALL: [bool; 3] = [true; 3];
const MUCH: [bool; 3] = [true, true, false];

const FILMS: [Film; 8] = [
    ("MJPEG, usual codes", "usual.avi", &["-c:v", "mjpeg", "-huffman", "default", "-q:v", "2"], MUCH),
    ("MJPEG, own codes", "own.mov", &["-c:v", "mjpeg", "-huffman", "optimal", "-q:v", "3"], MUCH),
    ("JPEG files", "jpeg/f%03d.jpg", &["-huffman", "default", "-q:v", "2"], MUCH),
    ("PNG files", "png/f%03d.png", &[], ALL),
    ("PNG", "png.mov", &["-c:v", "png"], ALL),
    ("JPEG 2000", "j2k.mov", &["-c:v", "jpeg2000"], MUCH),
    ("JPEG-LS", "ls.avi", &["-c:v", "jpegls"], MUCH),
    ("MPEG-4 part 2", "mpeg4.avi", &["-c:v", "mpeg4", "-g", "12", "-q:v", "3"], MUCH),
];

/// A part of a film or folder that can be damaged: the file, and place and length of a picture's data in it.
pub fn places(path: &Path) -> Vec<(PathBuf, usize, usize)> {
    if !path.to_str().unwrap().contains('%') {
        return packets(path).into_iter().map(|(at, size)| (path.to_owned(), at, size)).collect();
    }
    let mut files: Vec<PathBuf> =
        path.parent().unwrap().read_dir().unwrap().map(|e| e.unwrap().path()).collect();
    files.sort();
    let length = |f: &PathBuf| std::fs::metadata(f).unwrap().len() as usize;
    files.iter().map(|f| (f.clone(), 0, length(f))).collect()
}

pub fn damage(bytes: &mut [u8], at: usize, size: usize, way: &str, seed: u32) {
    match way {
        "noise" => noise(&mut bytes[at + size / 3..at + size], seed),
        "zeros" => bytes[at + size / 3..at + size].fill(0),
        _ => bytes[at + size / 2] ^= 1 << (seed % 8),
    }
}

/// All pictures, `None` for each that is left out, and whether the recording counts as whole.
fn film(path: &Path) -> (Vec<Option<Vec<u32>>>, bool) {
    let options = OpenOptions { fps: Some(500.0), ..OpenOptions::default() };
    let Ok(mut source) = open(path.to_str().unwrap(), &options) else { return (Vec::new(), false) };
    let pictures: Vec<_> = read_all(&mut *source).iter().map(samples).collect();
    let is_whole = pictures.iter().all(Option::is_some)
        && pictures.len() == COUNT
        && source.ending() == tracker::frame::Ending::Complete
        && !source.gaps().is_damage();
    (pictures, is_whole)
}

#[test]
fn how_much_of_the_damage_to_single_packets_is_told() {
    if !have_ffmpeg() {
        return;
    }
    let each: usize = std::env::var("DAMAGED").ok().and_then(|n| n.parse().ok()).unwrap_or(2);
    println!("| codec | {} |\n|---|---|---|---|", WAYS.join(" | "));
    for (name, file, options, must) in FILMS {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir_all(folder.path().join(file).parent().unwrap()).unwrap();
        let path = encode(folder.path(), file, COUNT, &[&["-vf", LARGER], options].concat());
        let (truth, is_whole) = film(&path);
        assert!(is_whole, "{name}: {} pictures", truth.len());
        let places = places(&path);
        let mut cells = Vec::new();
        for (way, must) in WAYS.into_iter().zip(must) {
            let mut told = 0;
            for k in 0..each {
                // Packets spread over the film, without the first: a film must be opened to be told as damaged.
                let (damaged, at, size) = &places[1 + k * (places.len() - 2) / each];
                let whole = std::fs::read(damaged).unwrap();
                let mut bytes = whole.clone();
                damage(&mut bytes, *at, *size, way, k as u32);
                std::fs::write(damaged, &bytes).unwrap();
                let (pictures, is_whole) = film(&path);
                std::fs::write(damaged, &whole).unwrap();
                // Damage to what is not looked at, as sound in DV, harms nothing.
                told += usize::from(!is_whole || pictures == truth);
            }
            assert!(!must || told == each, "{name}, {way}: {told} of {each} told");
            cells.push(format!("{told} of {each}"));
        }
        println!("| {name} | {} |", cells.join(" | "));
    }
}
