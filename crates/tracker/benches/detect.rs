//! Detection's speed against what the machine can do, in one run: `cargo bench --workspace --locked --bench detect`,
//! with `-- frame`, `-- criterion`, `-- mraw` or `-- h264` behind it for one part, and numbers
//! of markers or bits for some of them.
//!
//! Frame: sixteen frames of 1280 x 1024 8-bit pixels in turn with 9, 100 and 1000 markers, against a plain maximum
//! over the same bytes and OpenCV's threshold, `findContours` and `moments`, one thread each. MRAW: a recording in
//! the page cache through the pipeline on all cores against a parallel byte maximum over its map. H.264: the program
//! against `ffmpeg -i FILE -f null -`. Ratios of medians count; times are the machine's. `README.md` beside this file
//! has the figures of one run.
#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stdout, missing_docs)]

use std::fs::{self, File};
use std::hint::black_box;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

use criterion::{Criterion, Throughput};
use opencv::core::{Mat, Point, Vector};
use opencv::imgproc::{self, CHAIN_APPROX_NONE, RETR_EXTERNAL, THRESH_BINARY};
use opencv::prelude::*;
use rayon::prelude::*;
use tracker::detect::{DetectSettings, Detection, Detector, Levels};
use tracker::frame::Frame;
use tracker::pipeline::{Observer, RunSettings, Stage, run};
use tracker::synth::scene::{Link, Marker};
use tracker::synth::{Film, Scene, WriteOptions, preset, write};

const SIZE: [u32; 2] = [1280, 1024];
const FRAMES: u64 = 16;
/// Turns of which the median counts.
const TURNS: usize = 41;

/// Frames of the whole recordings.
const MRAW_FRAMES: u64 = 400;
const H264_FRAMES: u64 = 1500;
/// How often they come in a film: what a run does once, loading and learning, is a third of a second.
const H264_TIMES: u64 = 4;

fn main() {
    opencv::core::set_num_threads(1).unwrap();
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    let (numbers, parts): (Vec<String>, Vec<String>) =
        arguments.into_iter().partition(|a| a.parse::<u32>().is_ok());
    let wanted = |part: &str| parts.is_empty() || parts.iter().any(|a| a == part);
    let listed = |n: &usize| numbers.is_empty() || numbers.contains(&n.to_string());
    if wanted("frame") {
        println!(
            "| markers | in | plain maximum us | ours us | OpenCV us | ours / maximum | OpenCV / ours |"
        );
        println!("|---|---|---|---|---|---|---|");
        [9, 100, 1000].into_iter().filter(listed).for_each(frames);
    }
    if wanted("criterion") {
        [9, 100, 1000].into_iter().filter(listed).for_each(by_criterion);
    }
    let folder = tempfile::tempdir().unwrap();
    if wanted("mraw") {
        println!(
            "\n| MRAW | ours GB/s | plain maximum GB/s | ratio of rates | learning s |\n|---|---|---|---|---|"
        );
        [8, 10, 12, 16].into_iter().filter(listed).for_each(|bits| mraw(folder.path(), bits as u32));
    }
    if wanted("h264") {
        println!(
            "\n| H.264, {} frames | tracker s | ffmpeg s | ratio |\n|---|---|---|---|",
            H264_FRAMES * H264_TIMES
        );
        h264(folder.path());
    }
}

/// Work of a thread on one frame.
const WAYS: usize = 3;

/// Frames, and the three ways.
struct Frames {
    frames: Vec<Frame>,
    ours: Ours,
    threshold: f64,
    mask: Mat,
    count: usize,
}

impl Frames {
    fn new(count: usize) -> Self {
        let film = Film::new(&scene(count)).unwrap();
        let frames: Vec<Frame> = (0..FRAMES).map(|i| film.frame(i)).collect();
        let ours = Ours::new(&frames);
        let threshold = ours.detector.levels().threshold(640.0, 512.0);
        Self { frames, ours, threshold, mask: Mat::default(), count }
    }

    /// Every frame in one of the ways: plain maximum, ours, OpenCV's.
    fn all(&mut self, way: usize) {
        for frame in &self.frames {
            match way {
                0 => {
                    black_box(maximum(frame));
                }
                1 => assert_eq!(self.ours.count(frame), self.count),
                _ => assert_eq!(contours(frame, self.threshold, &mut self.mask), self.count),
            }
        }
    }

    /// Median over turns of the time for a frame in each way, us. Each way `again` times before the next.
    fn times(&mut self, again: usize) -> [f64; WAYS] {
        let mut times: [Vec<f64>; WAYS] = Default::default();
        for _ in 0..TURNS {
            for (way, times) in times.iter_mut().enumerate() {
                let mut last = 0.0;
                for _ in 0..again {
                    let start = Instant::now();
                    self.all(way);
                    last = start.elapsed().as_secs_f64() * 1e6 / FRAMES as f64;
                }
                times.push(last);
            }
        }
        times.map(median)
    }
}

/// One thread on single frames: the three ways in turn, so that each finds in the caches what another has left there,
/// and each of them three times, so that it finds what it left itself.
fn frames(count: usize) {
    let mut frames = Frames::new(count);
    for (name, again) in [("turn", 1), ("a row", 3)] {
        let [plain, we, theirs] = frames.times(again);
        println!(
            "| {count} | {name} | {plain:.1} | {we:.1} | {theirs:.1} | {:.2} | {:.1} |",
            we / plain,
            theirs / we
        );
    }
}

/// Times of the same parts by criterion.
fn by_criterion(count: usize) {
    let mut criterion = Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_secs(1));
    let mut frames = Frames::new(count);
    let mut group = criterion.benchmark_group(format!("16 frames of {count} markers"));
    group.throughput(Throughput::Bytes(FRAMES * u64::from(SIZE[0] * SIZE[1])));
    for (way, name) in ["plain maximum", "ours", "opencv"].into_iter().enumerate() {
        group.bench_function(name, |b| b.iter(|| frames.all(way)));
    }
    group.finish();
}

/// Markers of radius 6 px on a grid, each flying on its own.
fn scene(count: usize) -> Scene {
    let mut scene = preset("clean", 1).unwrap();
    scene.image_px = SIZE;
    scene.frames = FRAMES;
    scene.camera.exposure_s = 0.0;
    scene.links.clear();
    scene.markers.clear();
    let columns = ((count as f64 * 1.25).sqrt().ceil() as usize).max(1);
    let rows = count.div_ceil(columns);
    for i in 0..count {
        let name = format!("b{i}");
        let x = (i % columns) as f64 + 0.5 + 0.01 * (i % 7) as f64;
        let y = (i / columns) as f64 + 0.5 + 0.01 * (i % 5) as f64;
        scene.links.push(Link {
            name: name.clone(),
            parent: None,
            joint_px: [x * 1270.0 / columns as f64, y * 1014.0 / rows as f64],
            velocity_px_s: Some([170.0, 90.0]),
            along_px: [0.0; 2],
            width_px: 0.0,
            level: 0.0,
            light: 1.0,
            motion: None,
        });
        let name_of = format!("n{i}");
        scene.markers.push(Marker {
            name: name_of,
            link: name,
            at_px: [0.0; 2],
            radius_px: 6.0,
            level: 200.0,
        });
    }
    scene
}

struct Ours {
    detector: Detector,
    found: Vec<Detection>,
}

impl Ours {
    fn new(frames: &[Frame]) -> Self {
        let settings = DetectSettings::default();
        let levels = Arc::new(Levels::learn(frames, &settings).unwrap());
        Self { detector: Detector::new(levels, &settings).unwrap(), found: Vec::new() }
    }

    fn count(&mut self, frame: &Frame) -> usize {
        self.detector.detect(frame, &mut self.found).unwrap();
        black_box(&self.found).len()
    }
}

fn maximum(frame: &Frame) -> u8 {
    frame.plane.as_ref().unwrap().bytes().iter().copied().fold(0, u8::max)
}

/// OpenCV's way as its users write it; the number of centres.
fn contours(frame: &Frame, threshold: f64, mask: &mut Mat) -> usize {
    let flat = Mat::from_slice(frame.plane.as_ref().unwrap().bytes()).unwrap();
    let image = flat.reshape(1, SIZE[1] as i32).unwrap();
    imgproc::threshold(&image, mask, threshold - 1.0, 255.0, THRESH_BINARY).unwrap();
    let mut found: Vector<Vector<Point>> = Vector::new();
    imgproc::find_contours(mask, &mut found, RETR_EXTERNAL, CHAIN_APPROX_NONE, Point::new(0, 0)).unwrap();
    let centres: Vec<[f64; 2]> = found
        .iter()
        .map(|c| imgproc::moments(&c, false).unwrap())
        .filter(|m| m.m00 > 0.0)
        .map(|m| [m.m10 / m.m00, m.m01 / m.m00])
        .collect();
    black_box(&centres).len()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// The paper's layout, in the middle of the image.
fn long_scene(frames: u64) -> Scene {
    let mut scene = preset("clean", 1).unwrap();
    scene.image_px = SIZE;
    scene.links[0].joint_px = [640.0, 512.0];
    scene.frames = frames;
    scene
}

/// When a run began to detect and when it was done with it.
#[derive(Default)]
struct Watch {
    stages: Vec<(Stage, Instant)>,
}

impl Observer for Watch {
    fn stage(&mut self, stage: Stage, _: Option<u64>) {
        self.stages.push((stage, Instant::now()));
    }
}

/// A Photron recording in the page cache through the pipeline, all cores, against a parallel maximum over its map.
fn mraw(folder: &Path, bits: u32) {
    let path = folder.join(format!("film{bits}.cih"));
    let mut scene = long_scene(MRAW_FRAMES);
    if bits > 8 {
        let gain = f64::from(1u32 << (bits.min(12) - 8));
        scene.camera.depth_bits = bits.min(12);
        scene.camera.read_noise *= gain;
        scene.light.background *= gain;
        scene.links.iter_mut().for_each(|l| l.level *= gain);
        scene.markers.iter_mut().for_each(|m| m.level *= gain);
    }
    let options = WriteOptions { bits: Some(bits), ..WriteOptions::default() };
    write(&Film::new(&scene).unwrap(), &path, &options, &mut |_| Ok(())).unwrap();
    let bytes = fs::metadata(path.with_extension("mraw")).unwrap().len() as f64;
    let settings = RunSettings { input: path.to_str().unwrap().into(), ..RunSettings::default() };
    let (mut detecting, mut learning, mut plain) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..9 {
        let mut watch = Watch::default();
        run(&settings, &mut watch).unwrap();
        let took = |stage: Stage| {
            let at = watch.stages.iter().position(|s| s.0 == stage).unwrap();
            (watch.stages[at + 1].1 - watch.stages[at].1).as_secs_f64()
        };
        detecting.push(took(Stage::Detect));
        learning.push(took(Stage::Learn));
        let start = Instant::now();
        black_box(mapped(&path));
        plain.push(start.elapsed().as_secs_f64());
    }
    let (a, b, l) = (median(detecting), median(plain), median(learning));
    println!("| {bits} bit | {:.2} | {:.2} | {:.2} | {l:.2} |", bytes / a / 1e9, bytes / b / 1e9, b / a);
    fs::remove_file(path.with_extension("mraw")).unwrap();
}

fn mapped(path: &Path) -> u64 {
    let file = File::open(path.with_extension("mraw")).unwrap();
    // SAFETY: the file is this program's own and nobody changes it.
    let map = unsafe { memmap2::Mmap::map(&file) }.unwrap();
    map.par_chunks((SIZE[0] * SIZE[1]) as usize).map(|c| u64::from(c.iter().copied().fold(0, u8::max))).sum()
}

/// The program `tracker track` against `ffmpeg -i FILE -f null -`, all cores each, wall time.
fn h264(folder: &Path) {
    for (name, quality) in [("hard to decode", 10), ("easy to decode", 18)] {
        let (part, path) = (folder.join("part.mp4"), folder.join("film.mp4"));
        let options = WriteOptions {
            quality: Some(quality),
            x264_preset: Some("veryfast".into()),
            ..WriteOptions::default()
        };
        write(&Film::new(&long_scene(H264_FRAMES)).unwrap(), &part, &options, &mut |_| Ok(())).unwrap();
        let mut repeat = Command::new("ffmpeg");
        repeat.args(["-v", "error", "-nostdin", "-y", "-stream_loop"]).arg((H264_TIMES - 1).to_string());
        repeat.arg("-i").arg(&part).args(["-c", "copy"]).arg(&path);
        assert!(repeat.status().unwrap().success());
        let megabytes = fs::metadata(&path).unwrap().len() as f64 / 1e6;
        let mut times = [Vec::new(), Vec::new()];
        for _ in 0..3 {
            for (which, all) in times.iter_mut().enumerate() {
                let mut command = if which == 0 {
                    let mut c = Command::new(env!("CARGO_BIN_EXE_tracker"));
                    c.arg("track")
                        .arg(&path)
                        .args(["--quiet", "--force", "-o"])
                        .arg(folder.join("out.parquet"));
                    c
                } else {
                    let mut c = Command::new("ffmpeg");
                    c.args(["-v", "error", "-nostdin", "-i"]).arg(&path).args(["-f", "null", "-"]);
                    c
                };
                let start = Instant::now();
                assert!(command.stdout(Stdio::null()).status().unwrap().success());
                all.push(start.elapsed().as_secs_f64());
            }
        }
        let [ours, theirs] = times.map(median);
        println!("| {name}, {megabytes:.0} MB | {ours:.2} | {theirs:.2} | {:.3} |", ours / theirs);
    }
}
