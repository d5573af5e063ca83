//! A recording that another program cuts while it is read: an error that names the frame, and never a signal.

use std::fs::File;
use std::path::{Path, PathBuf};

use tracker::peak_level::peak_level;
use tracker::pipeline::{Observer, RunSettings, Stage, run};
use tracker::source::{OpenOptions, open};
use tracker::synth::{Film, WriteOptions, preset, write};

const COUNT: u64 = 60;
const WORDS: &str = "the file became shorter while it was read";

/// A recording of [`COUNT`] frames, and the bytes that each of them takes.
fn recording(folder: &Path, bits: u32) -> (PathBuf, u64) {
    let path = folder.join("drop.mraw");
    let mut scene = preset("clean", 1).unwrap();
    scene.frames = COUNT;
    let options = WriteOptions { bits: Some(bits), ..WriteOptions::default() };
    write(&Film::new(&scene).unwrap(), &path, &options, &mut |_| Ok(())).unwrap();
    let size = std::fs::metadata(&path).unwrap().len() / COUNT;
    (path, size)
}

fn cut(path: &Path, length: u64) {
    File::options().write(true).open(path).unwrap().set_len(length).unwrap();
}

/// Cuts the recording as soon as a stage begins.
struct Scissors<'a> {
    path: &'a Path,
    stage: Stage,
    length: u64,
}

impl Observer for Scissors<'_> {
    fn stage(&mut self, stage: Stage, _: Option<u64>) {
        if stage == self.stage {
            cut(self.path, self.length);
        }
    }
}

#[test]
fn a_run_ends_with_an_error_that_names_the_first_frame_that_is_gone() {
    // Inside a frame, at its end, and so that nothing is left.
    for (bits, frames, rest) in [(8, 41, 100), (12, 7, 0), (8, 0, 0)] {
        let folder = tempfile::tempdir().unwrap();
        let (path, size) = recording(folder.path(), bits);
        let settings = RunSettings { input: path.to_str().unwrap().into(), ..RunSettings::default() };
        let mut scissors = Scissors { path: &path, stage: Stage::Detect, length: frames * size + rest };
        let error = run(&settings, &mut scissors).unwrap_err().to_string();
        assert!(error.contains("drop.mraw") && error.contains(WORDS), "{error}");
        assert!(error.contains(&format!("frame {frames}:")), "{bits} bit: {error}");
    }
}

#[test]
fn a_frame_that_is_held_is_an_error_too_when_it_is_looked_at() {
    let folder = tempfile::tempdir().unwrap();
    let (path, size) = recording(folder.path(), 8);
    let mut source = open(path.to_str().unwrap(), &OpenOptions::default()).unwrap();
    let mut frames = Vec::new();
    while let Some(frame) = source.next_frame().unwrap() {
        frames.push(frame);
    }
    // The first is looked at before the cut and keeps what it has.
    assert!(peak_level(&frames[0]).unwrap().is_some());
    cut(&path, size / 2);
    assert!(peak_level(&frames[0]).unwrap().is_some());
    for frame in &frames[1..] {
        let error = peak_level(frame).unwrap_err().to_string();
        assert!(error.contains(WORDS) && error.contains(&format!("frame {}:", frame.index)), "{error}");
        assert!(frame.bytes().is_err());
    }
    let error = source.sample(4).unwrap_err().to_string();
    assert!(error.contains(WORDS), "{error}");
}
