//! Times what is done with a recording, stage after stage, on one thread: `cargo run --release --example time_stages -- FILM`.
//! Prints the time of each stage in ms per frame.

use std::sync::Arc;
use std::time::Instant;

use tracker::detect::{DetectSettings, Detector, Levels};
use tracker::frame::Frame;
use tracker::pipeline::{RunSettings, Silent, run};
use tracker::source::{OpenOptions, open};

/// Frames that are kept for detection to be timed by itself.
const MOST_FRAMES: usize = 200;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let Some(film) = std::env::args().nth(1) else { return Err("give a film".into()) };
    let mut source = open(&film, &OpenOptions { threads: 1, ..OpenOptions::default() })?;
    let settings = DetectSettings { pixel_aspect: source.info().pixel_aspect, ..DetectSettings::default() };

    let begun = Instant::now();
    let levels = Levels::learn(&source.sample(24)?, &settings)?;
    println!("learning       {:>8.1} ms in all", 1e3 * begun.elapsed().as_secs_f64());

    let begun = Instant::now();
    let mut frames: Vec<Frame> = Vec::new();
    while frames.len() < MOST_FRAMES
        && let Some(frame) = source.next_frame()?
    {
        frames.push(frame);
    }
    let per_frame_ms =
        |begun: Instant, frames: usize| 1e3 * begun.elapsed().as_secs_f64() / frames.max(1) as f64;
    println!("reading        {:>8.3} ms per frame", per_frame_ms(begun, frames.len()));

    let mut detector = Detector::new(Arc::new(levels), &settings)?;
    let (begun, mut markers, mut count) = (Instant::now(), Vec::new(), 0);
    for frame in &frames {
        detector.detect(frame, &mut markers)?;
        count += markers.len();
    }
    println!("detecting      {:>8.3} ms per frame, {count} markers", per_frame_ms(begun, frames.len()));

    let begun = Instant::now();
    let settings = RunSettings { input: film, threads: 1, collect: true, ..RunSettings::default() };
    let summary = run(&settings, &mut Silent)?;
    println!("all, tracked   {:>8.3} ms per frame", per_frame_ms(begun, summary.frames as usize));
    Ok(())
}
