//! Reading speed against what the machine can do, in one run:
//! `cargo bench --workspace --locked --bench source`, with `-- h264` or `-- mraw` behind it for one half.
//!
//! H.264: ours, the `ffmpeg` program (`-i FILE -f null -`) and OpenCV's `VideoCapture`, each as a process of its
//! own, in turns on a film that takes seconds; wall and processor time. MRAW: the maximum of every frame through a
//! source against a plain parallel byte-maximum over a memory map of the same file. Ratios of medians count; times
//! are the machine's. `README.md` beside this file has the figures of one run.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use std::fs::{self, File};
use std::hint::black_box;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use criterion::{Criterion, Throughput};
use rayon::prelude::*;
use tracker::frame::Frame;
use tracker::peak_level::peak_level;
use tracker::source::{Decoder, OpenOptions, open};

const WIDTH: usize = 1280;
const HEIGHT: usize = 1024;
const ROUNDS: usize = 5;
/// Frames of the short film, and how often the long one repeats it.
const FRAMES: usize = 400;
const REPEATS: usize = 6;

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    if let Some(at) = arguments.iter().position(|a| a == "--read") {
        read(&arguments[at + 1], &arguments[at + 2]);
        return;
    }
    let wanted = |half: &str| {
        let filters: Vec<&String> = arguments[1..].iter().filter(|a| !a.starts_with('-')).collect();
        filters.is_empty() || filters.iter().any(|f| f.starts_with(half))
    };
    let folder = tempfile::tempdir().unwrap();
    let mut criterion = Criterion::default().sample_size(10).configure_from_args();
    if wanted("h264") {
        let film = h264(folder.path());
        let mut group = criterion.benchmark_group(format!("h264 1280x1024, {FRAMES} frames"));
        for kind in ["ours", "ffmpeg program", "opencv"] {
            group.bench_function(kind, |b| b.iter(|| run(kind, &film)));
        }
        group.finish();
        turns(&repeated(&film));
    }
    for bits in [8, 10, 12, 16].into_iter().filter(|_| wanted("mraw")) {
        let path = photron(folder.path(), bits, 512 << 20);
        let bytes = fs::metadata(path.with_extension("mraw")).unwrap().len();
        let mut group = criterion.benchmark_group(format!("mraw {bits} bit"));
        group.throughput(Throughput::Bytes(bytes));
        group.bench_function("ours", |b| b.iter(|| black_box(maxima(&path))));
        group.bench_function("plain map", |b| b.iter(|| black_box(plain(&path))));
        group.finish();
        mraw_turns(&path, bits, bytes);
        fs::remove_file(path.with_extension("mraw")).unwrap();
    }
}

/// One of the readers as a process of its own.
fn run(kind: &str, film: &Path) {
    let mut command = if kind == "ffmpeg program" {
        let mut c = Command::new("ffmpeg");
        c.args(["-v", "error", "-nostdin", "-i"]).arg(film).args(["-f", "null", "-"]);
        c
    } else {
        let mut c = Command::new(std::env::current_exe().unwrap());
        c.arg("--read").arg(kind).arg(film);
        c
    };
    assert!(command.stdout(Stdio::null()).status().unwrap().success(), "{kind}");
}

/// Reads every plane: one byte of each row is looked at.
fn read(kind: &str, film: &str) {
    tracker::source::use_opencv_decoder();
    let decoder = if kind == "opencv" { Decoder::Opencv } else { Decoder::Ffmpeg };
    let mut source = open(film, &OpenOptions { decoder, ..OpenOptions::default() }).unwrap();
    let mut sum = 0u64;
    while let Some(frame) = source.next_frame().unwrap() {
        let bytes = frame.plane.as_ref().unwrap().bytes();
        sum += (0..HEIGHT).map(|y| u64::from(bytes[y * frame.stride + y])).sum::<u64>();
    }
    println!("{sum}");
}

/// Processor time of all ended children, s.
fn children_s() -> f64 {
    let stat = fs::read_to_string("/proc/self/stat").unwrap();
    let fields: Vec<&str> = stat.rsplit(')').next().unwrap().split_whitespace().collect();
    // After the name, fields 14 and 15 are the children's user and system time in hundredths of a second.
    (fields[13].parse::<f64>().unwrap() + fields[14].parse::<f64>().unwrap()) / 100.0
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn turns(film: &Path) {
    let kinds = ["ours", "ffmpeg program", "opencv"];
    let mut wall = vec![Vec::new(); 3];
    let mut processor = vec![Vec::new(); 3];
    for _ in 0..ROUNDS {
        for (i, kind) in kinds.iter().enumerate() {
            let (start, before) = (Instant::now(), children_s());
            run(kind, film);
            wall[i].push(start.elapsed().as_secs_f64());
            processor[i].push(children_s() - before);
        }
    }
    let wall: Vec<f64> = wall.into_iter().map(median).collect();
    let processor: Vec<f64> = processor.into_iter().map(median).collect();
    let megabytes = fs::metadata(film).unwrap().len() as f64 / 1e6;
    println!("\nh264 1280x1024, {} frames, {megabytes:.1} MB, medians of {ROUNDS} turns", FRAMES * REPEATS);
    for (i, kind) in kinds.iter().enumerate() {
        println!("  {kind:<16} wall {:7.3} s   processor {:7.3} s", wall[i], processor[i]);
    }
    println!(
        "  ours / ffmpeg program: wall {:.3}, processor {:.3}",
        wall[0] / wall[1],
        processor[0] / processor[1]
    );
    println!(
        "  ours / opencv: wall {:.3}, processor {:.3}\n",
        wall[0] / wall[2],
        processor[0] / processor[2]
    );
}

fn mraw_turns(path: &Path, bits: u32, bytes: u64) {
    let (mut ours, mut theirs) = (Vec::new(), Vec::new());
    for _ in 0..ROUNDS {
        let start = Instant::now();
        black_box(maxima(path));
        ours.push(start.elapsed().as_secs_f64());
        let start = Instant::now();
        black_box(plain(path));
        theirs.push(start.elapsed().as_secs_f64());
    }
    let rate = |t: f64| bytes as f64 / t / 1e9;
    let (a, b) = (median(ours), median(theirs));
    println!(
        "mraw {bits} bit, medians of {ROUNDS} turns: ours {:.2} GB/s, plain map {:.2} GB/s, ratio of rates {:.3}\n",
        rate(a),
        rate(b),
        b / a
    );
}

/// A film of moving discs with a sensor's noise, 3 levels of standard deviation, most of which the quality keeps.
fn h264(folder: &Path) -> PathBuf {
    let path = folder.join("film.mp4");
    let mut child = Command::new("ffmpeg")
        .args(["-v", "error", "-y", "-f", "rawvideo", "-pix_fmt", "gray", "-framerate", "500"])
        .args(["-video_size", &format!("{WIDTH}x{HEIGHT}"), "-i", "-"])
        .args(["-c:v", "libx264", "-preset", "veryfast", "-crf", "16", "-pix_fmt", "yuv420p"])
        .arg(&path)
        .stdin(Stdio::piped())
        .spawn()
        .unwrap();
    let mut pipe = child.stdin.take().unwrap();
    let mut state = 1u64;
    let mut picture = vec![0u8; WIDTH * HEIGHT];
    for index in 0..FRAMES {
        for p in &mut picture {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            // Of 36 random bits 18 are set, with a standard deviation of 3.
            *p = 7 + (state >> 28).count_ones() as u8;
        }
        for k in 0..5 {
            let angle = index as f64 * 0.02 * (k + 1) as f64;
            let (cx, cy) =
                (640.0 + 80.0 * (k + 1) as f64 * angle.cos(), 512.0 + 80.0 * (k + 1) as f64 * angle.sin());
            for y in (cy as usize - 8)..(cy as usize + 9) {
                for x in (cx as usize - 8)..(cx as usize + 9) {
                    if (x as f64 - cx).hypot(y as f64 - cy) < 7.0 {
                        picture[y * WIDTH + x] = 220;
                    }
                }
            }
        }
        pipe.write_all(&picture).unwrap();
    }
    drop(pipe);
    assert!(child.wait().unwrap().success());
    path
}

/// The film again and again in one file, as it is coded.
fn repeated(film: &Path) -> PathBuf {
    let (list, path) = (film.with_extension("txt"), film.with_file_name("long.mp4"));
    fs::write(&list, format!("file '{}'\n", film.display()).repeat(REPEATS)).unwrap();
    let mut command = Command::new("ffmpeg");
    command
        .args(["-v", "error", "-f", "concat", "-safe", "0", "-i"])
        .arg(list)
        .args(["-c", "copy"])
        .arg(&path);
    assert!(command.status().unwrap().success());
    path
}

/// A Photron pair of about `bytes` bytes; returns its header's path.
fn photron(folder: &Path, bits: u32, bytes: usize) -> PathBuf {
    let frame = WIDTH * HEIGHT * bits as usize / 8;
    let count = bytes / frame;
    let path = folder.join(format!("film{bits}.cih"));
    fs::write(
        &path,
        format!(
            "#Camera Information Header\nRecord Rate(fps) : 1000\nTotal Frame : {count}\nImage Width : {WIDTH}\n\
             Image Height : {HEIGHT}\nColor Bit : {bits}\nColor Type : Mono\nFile Format : MRaw\n"
        ),
    )
    .unwrap();
    let mut file = File::create(path.with_extension("mraw")).unwrap();
    let picture: Vec<u8> = (0..frame).map(|i| (i * 7 % 251) as u8).collect();
    for _ in 0..count {
        file.write_all(&picture).unwrap();
    }
    path
}

/// The sum of all frames' maxima, each frame on whichever core is free.
fn maxima(path: &Path) -> u64 {
    let mut source = open(path.to_str().unwrap(), &OpenOptions::default()).unwrap();
    let mut sum = 0;
    loop {
        let batch: Vec<Frame> = (0..16).map_while(|_| source.next_frame().unwrap()).collect();
        if batch.is_empty() {
            return sum;
        }
        sum += batch.into_par_iter().map(|f| u64::from(peak_level(&f).unwrap().unwrap())).sum::<u64>();
    }
}

fn byte_maximum(bytes: &[u8]) -> u8 {
    bytes.iter().copied().fold(0, u8::max)
}

fn plain(path: &Path) -> u64 {
    let file = File::open(path.with_extension("mraw")).unwrap();
    // SAFETY: the file is this program's own and nobody changes it.
    let map = unsafe { memmap2::Mmap::map(&file) }.unwrap();
    map.par_chunks(WIDTH * HEIGHT).map(|c| u64::from(byte_maximum(c))).sum()
}
