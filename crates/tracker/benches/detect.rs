//! Detection against a plain maximum over the same bytes and against OpenCV's threshold, `findContours` and
//! `moments`, one thread each: `cargo bench --workspace --locked --bench detect`.
//!
//! Sixteen frames of 1280 x 1024 8-bit pixels in turn, 9, 100 and 1000 markers; then a whole Photron recording in
//! the page cache against a plain parallel maximum over its map. Ratios of medians count; times are the machine's.
#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stdout, missing_docs)]

use std::fs::File;
use std::hint::black_box;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use criterion::{Criterion, Throughput};
use opencv::core::{Mat, Point, Vector};
use opencv::imgproc::{self, CHAIN_APPROX_NONE, RETR_EXTERNAL, THRESH_BINARY};
use opencv::prelude::*;
use rayon::prelude::*;
use tracker::detect::{DetectSettings, Detection, Detector, Levels};
use tracker::film::scene::{Link, Marker};
use tracker::film::{Film, Scene, WriteOptions, preset, write};
use tracker::frame::Frame;
use tracker::source::{OpenOptions, open};

const SIZE: [u32; 2] = [1280, 1024];
const FRAMES: u64 = 16;
/// Turns of which the median counts.
const TURNS: usize = 41;

fn main() {
    opencv::core::set_num_threads(1).unwrap();
    let mut criterion = Criterion::default().sample_size(20).configure_from_args();
    println!("| markers | plain maximum us | ours us | OpenCV us | ours / maximum | OpenCV / ours |");
    println!("|---|---|---|---|---|---|");
    for count in [9, 100, 1000] {
        let film = Film::new(&scene(count)).unwrap();
        let frames: Vec<Frame> = (0..FRAMES).map(|i| film.frame(i)).collect();
        let mut ours = Ours::new(&frames);
        let threshold = ours.detector.levels().threshold(640.0, 512.0);
        let mut mask = Mat::default();
        // All three see a frame before the next, so that each meets the same memory.
        let mut times = [Vec::new(), Vec::new(), Vec::new()];
        for _ in 0..TURNS {
            let mut turn = [0.0; 3];
            for (which, total) in turn.iter_mut().enumerate() {
                let start = Instant::now();
                for frame in &frames {
                    match which {
                        0 => {
                            black_box(maximum(frame));
                        }
                        1 => assert_eq!(ours.count(frame), count),
                        _ => assert_eq!(contours(frame, threshold, &mut mask), count),
                    }
                }
                *total = start.elapsed().as_secs_f64() * 1e6 / FRAMES as f64;
            }
            times.iter_mut().zip(turn).for_each(|(all, t)| all.push(t));
        }
        let [plain, we, theirs] = times.map(median);
        println!("| {count} | {plain:.1} | {we:.1} | {theirs:.1} | {:.2} | {:.1} |", we / plain, theirs / we);
        let mut group = criterion.benchmark_group(format!("16 frames of {} markers", count));
        group.throughput(Throughput::Bytes(FRAMES * u64::from(SIZE[0] * SIZE[1])));
        group.bench_function("plain maximum", |b| b.iter(|| frames.iter().map(maximum).max()));
        group.bench_function("ours", |b| b.iter(|| frames.iter().map(|f| ours.count(f)).sum::<usize>()));
        group.bench_function("opencv", |b| {
            b.iter(|| frames.iter().map(|f| contours(f, threshold, &mut mask)).sum::<usize>())
        });
        group.finish();
    }
    whole_run();
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

/// Detection of a whole recording on all cores, through the source and in batches as `pipeline` does.
fn whole_run() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("film.cih");
    let mut long = scene(9);
    long.frames = 400;
    let film = Film::new(&long).unwrap();
    write(&film, &path, &WriteOptions::default(), &mut |_| Ok(())).unwrap();
    let bytes = std::fs::metadata(path.with_extension("mraw")).unwrap().len() as f64;
    let settings = DetectSettings::default();
    let samples = open(path.to_str().unwrap(), &OpenOptions::default()).unwrap().sample(12).unwrap();
    let levels = Arc::new(Levels::learn(&samples, &settings).unwrap());
    let (mut ours, mut plain) = (Vec::new(), Vec::new());
    for _ in 0..9 {
        let start = Instant::now();
        black_box(detected(&path, &levels, &settings));
        ours.push(start.elapsed().as_secs_f64());
        let start = Instant::now();
        black_box(mapped(&path));
        plain.push(start.elapsed().as_secs_f64());
    }
    let (a, b) = (median(ours), median(plain));
    println!(
        "whole Photron recording of 400 frames in the page cache, all cores: ours {:.2} GB/s, plain maximum {:.2} \
         GB/s, ratio of rates {:.2}",
        bytes / a / 1e9,
        bytes / b / 1e9,
        b / a
    );
}

/// Number of detections.
fn detected(path: &Path, levels: &Arc<Levels>, settings: &DetectSettings) -> usize {
    let mut source = open(path.to_str().unwrap(), &OpenOptions::default()).unwrap();
    let mut sum = 0;
    loop {
        let batch: Vec<Frame> = (0..64).map_while(|_| source.next_frame().unwrap()).collect();
        if batch.is_empty() {
            return sum;
        }
        let start = || (Detector::new(Arc::clone(levels), settings).unwrap(), Vec::new());
        sum += batch
            .par_chunks(8)
            .map_init(start, |(detector, found), frames| {
                frames
                    .iter()
                    .map(|f| {
                        detector.detect(f, found).unwrap();
                        found.len()
                    })
                    .sum::<usize>()
            })
            .sum::<usize>();
    }
}

fn mapped(path: &Path) -> u64 {
    let file = File::open(path.with_extension("mraw")).unwrap();
    // SAFETY: the file is this program's own and nobody changes it.
    let map = unsafe { memmap2::Mmap::map(&file) }.unwrap();
    map.par_chunks((SIZE[0] * SIZE[1]) as usize).map(|c| u64::from(c.iter().copied().fold(0, u8::max))).sum()
}
