//! Detection on small images with known truth, and on real recordings where they are present.

use std::sync::Arc;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

use super::*;
use crate::frame::{Frame, PixelFormat};

mod accuracy;

/// Discs on a flat ground with noise.
pub(super) struct Scene {
    pub size: [usize; 2],
    pub ground: f64,
    pub noise: f64,
    /// Centre, radius, height above the ground.
    pub discs: Vec<[f64; 4]>,
    pub top: f64,
}

/// Part of the pixel about (x, y) inside a disc: exact along x, 64 chords along y.
fn coverage(x: f64, y: f64, disc: &[f64; 4]) -> f64 {
    let mut sum = 0.0;
    for k in 0..64 {
        let dy = y - 0.5 + (f64::from(k) + 0.5) / 64.0 - disc[1];
        let half = disc[2] * disc[2] - dy * dy;
        if half > 0.0 {
            let half = half.sqrt();
            let (a, b) = ((disc[0] - half).max(x - 0.5), (disc[0] + half).min(x + 0.5));
            sum += (b - a).max(0.0);
        }
    }
    sum / 64.0
}

impl Scene {
    pub fn frame(&self, seed: u64, bits: u32) -> Frame {
        let [w, h] = self.size;
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let normal = Normal::new(0.0, self.noise).unwrap();
        let mut image = vec![self.ground; w * h];
        for d in &self.discs {
            let span = |c: f64, n: usize| {
                (c - d[2] - 1.0).floor().max(0.0) as usize..((c + d[2] + 2.0) as usize).min(n)
            };
            for y in span(d[1], h) {
                for x in span(d[0], w) {
                    image[y * w + x] += d[3] * coverage(x as f64, y as f64, d);
                }
            }
        }
        let values: Vec<u16> =
            image.iter().map(|v| (v + normal.sample(&mut rng)).round().clamp(0.0, self.top) as u16).collect();
        let (format, stride, bytes) = if bits == 8 {
            (PixelFormat::Gray8, w, values.iter().map(|&v| v as u8).collect())
        } else {
            (PixelFormat::Gray16, 2 * w, values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>())
        };
        Frame {
            index: seed,
            ticks: 0,
            width: w as u32,
            height: h as u32,
            stride,
            format,
            depth_bits: bits,
            plane: Some(Box::new(bytes)),
        }
    }
}

/// `count` discs apart from each other at random sub-pixel places.
pub(super) fn scattered(seed: u64, count: usize, radius: f64, height: f64) -> Vec<[f64; 4]> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..count)
        .map(|i| {
            let (column, row) = (i % 4, i / 4);
            let mut place = |k: usize| 24.0 + 40.0 * k as f64 + rng.random_range(-6.0..6.0);
            [place(column), place(row), radius, height]
        })
        .collect()
}

pub(super) fn detect(frame: &Frame, levels: &Arc<Levels>, settings: &DetectSettings) -> Vec<Detection> {
    let mut out = Vec::new();
    Detector::new(Arc::clone(levels), settings).unwrap().detect(frame, &mut out).unwrap();
    out
}

fn learn(frames: &[Frame], settings: &DetectSettings) -> Arc<Levels> {
    Arc::new(Levels::learn(frames, settings).unwrap())
}

#[test]
fn discs_bright_and_dark_in_8_and_16_bits_are_all_found_without_settings() {
    for (bits, ground, height, noise, top) in [
        (8, 20.0, 200.0, 1.0, 255.0),
        (8, 220.0, -180.0, 1.0, 255.0),
        (16, 900.0, 2500.0, 20.0, 4095.0),
        (8, 30.0, 50.0, 10.0, 255.0),
    ] {
        let frames: Vec<Frame> = (0..4)
            .map(|i| {
                let scene = Scene {
                    size: [168, 168],
                    ground,
                    noise,
                    discs: scattered(1000 + i, 12, 6.0, height),
                    top,
                };
                scene.frame(1000 + i, bits)
            })
            .collect();
        let settings = DetectSettings::default();
        let levels = learn(&frames, &settings);
        assert_eq!(levels.side, if height > 0.0 { Side::Bright } else { Side::Dark });
        for (i, frame) in frames.iter().enumerate() {
            let truth = scattered(1000 + i as u64, 12, 6.0, height);
            let found = detect(frame, &levels, &settings);
            assert_eq!(found.len(), truth.len(), "bits {bits} height {height}");
            for t in truth {
                // Five times the error of the dim ones, far below the spacing.
                assert!(found.iter().any(|d| (d.x_px - t[0]).hypot(d.y_px - t[1]) < 0.5), "{t:?} {found:?}");
            }
        }
    }
}

#[test]
fn a_frame_without_pixels_has_no_detections_and_another_size_is_refused() {
    let scene =
        Scene { size: [168, 168], ground: 20.0, noise: 1.0, discs: scattered(1, 12, 6.0, 200.0), top: 255.0 };
    let settings = DetectSettings::default();
    let levels = learn(&[scene.frame(1, 8)], &settings);
    let mut gone = scene.frame(2, 8);
    gone.plane = None;
    assert_eq!(detect(&gone, &levels, &settings), []);
    let other = Scene { size: [170, 168], ..scene }.frame(3, 8);
    let mut out = Vec::new();
    let error = Detector::new(levels, &settings).unwrap().detect(&other, &mut out).unwrap_err().to_string();
    assert!(
        error.contains("170 x 168") && error.contains("168 x 168") && error.contains("frame 3"),
        "{error}"
    );
}

#[test]
fn a_recording_of_nothing_says_so() {
    let scene = Scene { size: [168, 168], ground: 20.0, noise: 3.0, discs: vec![], top: 255.0 };
    let frames: Vec<Frame> = (0..4).map(|s| scene.frame(s, 8)).collect();
    let error = Levels::learn(&frames, &DetectSettings::default()).unwrap_err().to_string();
    assert!(error.contains("nothing like a marker"), "{error}");
}

#[test]
fn the_contour_method_finds_the_same_markers() {
    let scene =
        Scene { size: [168, 168], ground: 20.0, noise: 1.0, discs: scattered(5, 12, 6.0, 200.0), top: 255.0 };
    let settings = DetectSettings { centroid: Centroid::Contour, ..Default::default() };
    let frame = scene.frame(5, 8);
    let levels = learn(&[scene.frame(4, 8)], &settings);
    let found = detect(&frame, &levels, &settings);
    assert_eq!(found.len(), 12);
    for t in &scene.discs {
        // The paper's method is off by 0.07 px per axis; five times that.
        assert!(found.iter().any(|d| (d.x_px - t[0]).hypot(d.y_px - t[1]) < 0.35), "{t:?}");
    }
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let frames: Vec<Frame> = (0..24)
        .map(|i| {
            let discs = scattered(i, 12, 6.0, 150.0);
            Scene { size: [168, 168], ground: 20.0, noise: 6.0, discs, top: 255.0 }.frame(i, 8)
        })
        .collect();
    let settings = DetectSettings::default();
    let levels = learn(&frames[..6], &settings);
    let run = |threads: usize| -> Vec<Vec<Detection>> {
        let mut found = vec![Vec::new(); frames.len()];
        std::thread::scope(|scope| {
            for (frames, found) in
                frames.chunks(frames.len().div_ceil(threads)).zip(found.chunks_mut(24usize.div_ceil(threads)))
            {
                let (levels, settings) = (&levels, &settings);
                scope.spawn(move || {
                    let mut detector = Detector::new(Arc::clone(levels), settings).unwrap();
                    for (frame, out) in frames.iter().zip(found) {
                        detector.detect(frame, out).unwrap();
                    }
                });
            }
        });
        found
    };
    let one = run(1);
    assert!(one.iter().all(|f| f.len() == 12));
    // Equal to the bit: no tolerance.
    assert_eq!(one, run(2));
    assert_eq!(one, run(8));
}

#[test]
fn touching_markers_are_two_detections_and_half_a_marker_is_flagged() {
    let teach: Vec<Frame> = (0..4)
        .map(|i| {
            let discs = scattered(i, 12, 6.0, 200.0);
            Scene { size: [168, 168], ground: 20.0, noise: 1.0, discs, top: 255.0 }.frame(i, 8)
        })
        .collect();
    let settings = DetectSettings::default();
    let levels = learn(&teach, &settings);
    let pair = Scene {
        size: [168, 168],
        ground: 20.0,
        noise: 1.0,
        discs: vec![[60.3, 60.7, 6.0, 200.0], [71.9, 63.2, 6.0, 200.0], [120.0, 120.0, 6.0, 200.0]],
        top: 255.0,
    };
    let found = detect(&pair.frame(9, 8), &levels, &settings);
    assert_eq!(found.len(), 3, "{found:?}");
    for t in &pair.discs {
        // A tenth of a pixel: the edge where they touch is left out of both.
        let near = found.iter().find(|d| (d.x_px - t[0]).hypot(d.y_px - t[1]) < 0.1);
        assert!(near.is_some_and(|d| d.flags.has(Flags::MERGED) == (t[0] < 100.0)), "{t:?} {found:?}");
    }
    // A third of a marker hidden behind something dark.
    let mut frame = pair.frame(10, 8);
    let mut bytes = frame.plane.as_ref().unwrap().bytes().to_vec();
    for y in 112..130 {
        bytes[y * 168 + 122..y * 168 + 130].fill(20);
    }
    frame.plane = Some(Box::new(bytes));
    let found = detect(&frame, &levels, &settings);
    let hidden = found.iter().find(|d| d.y_px > 100.0).unwrap();
    assert!(hidden.flags.has(Flags::PARTIAL), "{hidden:?}");
}
