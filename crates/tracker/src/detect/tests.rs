//! Detection on small images with known truth: what is found without settings.

use std::sync::Arc;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

use super::*;
use crate::frame::{Frame, PixelFormat};

mod accuracy;
mod real;
mod settings;
mod trust;

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
            colour: None,
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

pub(super) fn learn(frames: &[Frame], settings: &DetectSettings) -> Arc<Levels> {
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
        assert_eq!(levels.polarity, if height > 0.0 { Polarity::Bright } else { Polarity::Dark });
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

/// Four frames that teach, of discs on a flat ground.
pub(super) fn taught(scene: impl Fn(u64) -> Scene, bits: u32, settings: &DetectSettings) -> Arc<Levels> {
    learn(&(0..4).map(|i| scene(i).frame(i, bits)).collect::<Vec<_>>(), settings)
}

pub(super) fn plain(seed: u64) -> Scene {
    let discs = scattered(seed, 12, 6.0, 150.0);
    Scene { size: [168, 168], ground: 20.0, noise: 1.0, discs, top: 255.0 }
}

/// The detection within half a pixel of a disc.
pub(super) fn of_disc<'a>(found: &'a [Detection], disc: &[f64; 4]) -> Option<&'a Detection> {
    found.iter().find(|d| (d.x_px - disc[0]).hypot(d.y_px - disc[1]) < 0.5)
}

#[test]
fn one_link_twice_as_bright_as_the_other_is_found_with_it() {
    let scene = |seed: u64| {
        let mut s = plain(seed);
        s.discs.iter_mut().enumerate().for_each(|(i, d)| d[3] = if i % 2 == 0 { 90.0 } else { 180.0 });
        s
    };
    let settings = DetectSettings::default();
    let levels = taught(scene, 8, &settings);
    let mut squares = [Vec::new(), Vec::new()];
    for seed in 100..120 {
        let found = detect(&scene(seed).frame(seed, 8), &levels, &settings);
        assert_eq!(found.len(), 12);
        for (i, disc) in scene(seed).discs.iter().enumerate() {
            let d = of_disc(&found, disc).unwrap();
            assert!(!d.flags.has(Flags::PARTIAL | Flags::MERGED), "{d:?}");
            squares[i % 2].push(((d.x_px - disc[0]) / f64::from(d.sigma_px)).powi(2));
        }
    }
    for s in squares {
        // 120 errors: their RMS is known to 6.5 %; the limits are the with three times that.
        let z = (s.iter().sum::<f64>() / s.len() as f64).sqrt();
        assert!((0.65..1.4).contains(&z), "{z}");
    }
}

#[test]
fn hot_pixels_and_glints_change_neither_threshold_nor_centres() {
    let settings = DetectSettings::default();
    let clean = taught(plain, 8, &settings);
    let spoil = |frame: &mut Frame, seed: u64| {
        let mut bytes = frame.plane.as_ref().unwrap().bytes().to_vec();
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        // Single hot pixels and saturated spots two pixels wide, in the gaps between the markers.
        for k in 0..24 {
            let (x, y) = (rng.random_range(0..168usize), 43 + 40 * (k % 3));
            bytes[y * 168 + x] = 255;
            if k % 4 == 0 && x < 167 {
                bytes[y * 168 + x + 1] = 255;
            }
        }
        frame.plane = Some(Box::new(bytes));
    };
    let mut frames: Vec<Frame> = (0..4).map(|i| plain(i).frame(i, 8)).collect();
    frames.iter_mut().enumerate().for_each(|(i, f)| spoil(f, i as u64));
    let levels = learn(&frames, &settings);
    assert!((levels.height / clean.height - 1.0).abs() < 0.1, "{} {}", levels.height, clean.height);
    for (i, frame) in frames.iter().enumerate() {
        let found = detect(frame, &levels, &settings);
        for disc in &plain(i as u64).discs {
            assert!(of_disc(&found, disc).is_some(), "{disc:?}");
        }
        // Too small for a marker.
        assert_eq!(found.len(), 12, "{found:?}");
    }
}

#[test]
fn packed_rows_give_the_same_bits_as_unpacked_ones() {
    for (bits, format) in [(10, PixelFormat::Packed10), (12, PixelFormat::Packed12)] {
        let top = f64::from((1u32 << bits) - 1);
        // An odd width: rows end inside bytes.
        let scene = |seed: u64| Scene {
            size: [171, 168],
            ground: 0.1 * top,
            noise: 0.004 * top,
            discs: scattered(seed, 12, 6.0, 0.7 * top),
            top,
        };
        let settings = DetectSettings::default();
        let levels = taught(scene, 16, &settings);
        let wide = scene(9).frame(9, 16);
        let values: Vec<u16> = wide
            .plane
            .as_ref()
            .unwrap()
            .bytes()
            .as_chunks()
            .0
            .iter()
            .map(|b| u16::from_le_bytes(*b))
            .collect();
        let packed = Frame {
            stride: 0,
            format,
            depth_bits: bits as u32,
            plane: Some(Box::new(pack(&values, bits))),
            ..scene(9).frame(9, 16)
        };
        let found = detect(&packed, &levels, &settings);
        assert_eq!(found.len(), 12);
        assert_eq!(found, detect(&wide, &levels, &settings));
    }
}
