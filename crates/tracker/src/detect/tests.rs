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

/// Four frames that teach, of discs on a flat ground.
fn taught(scene: impl Fn(u64) -> Scene, bits: u32, settings: &DetectSettings) -> Arc<Levels> {
    learn(&(0..4).map(|i| scene(i).frame(i, bits)).collect::<Vec<_>>(), settings)
}

fn plain(seed: u64) -> Scene {
    let discs = scattered(seed, 12, 6.0, 150.0);
    Scene { size: [168, 168], ground: 20.0, noise: 1.0, discs, top: 255.0 }
}

/// The detection within half a pixel of a disc.
fn of_disc<'a>(found: &'a [Detection], disc: &[f64; 4]) -> Option<&'a Detection> {
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
fn threshold_and_polarity_by_hand_are_in_raw_units() {
    for (bits, scale) in [(8, 1.0), (16, 16.0)] {
        let scene = |seed: u64| {
            let mut s = plain(seed);
            s.ground *= scale;
            s.noise *= scale;
            s.top = 256.0 * scale - 1.0;
            s.discs.iter_mut().enumerate().for_each(|(i, d)| d[3] = scale * if i < 4 { 60.0 } else { 150.0 });
            s
        };
        let at = |level: f64| DetectSettings {
            threshold: Threshold::Raw(level * scale),
            polarity: Polarity::Bright,
            ..Default::default()
        };
        for (level, count) in [(50.0, 12), (110.0, 8)] {
            let settings = at(level);
            let levels = taught(scene, bits, &settings);
            assert_eq!(levels.threshold(10.0, 20.0), level * scale);
            assert_eq!(detect(&scene(9).frame(9, bits), &levels, &settings).len(), count, "{bits} {level}");
        }
        let beyond = Levels::learn(&[scene(1).frame(1, bits)], &at(1e6)).unwrap_err().to_string();
        assert!(beyond.contains("outside the recording's range"), "{beyond}");
        // Bright discs have nothing dark about them.
        let dark = DetectSettings { polarity: Polarity::Dark, ..Default::default() };
        if let Ok(levels) = Levels::learn(&[scene(1).frame(1, bits)], &dark) {
            let found = detect(&scene(2).frame(2, bits), &Arc::new(levels), &dark);
            assert!(scene(2).discs.iter().all(|d| of_disc(&found, d).is_none()), "{found:?}");
        }
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

#[test]
fn only_the_region_is_looked_at() {
    let levels = taught(plain, 8, &DetectSettings::default());
    let frame = plain(9).frame(9, 8);
    // Cells of 40 px: the two left columns; a triangle over the upper left.
    let half = Region::Rectangle([0.0, 0.0, 83.5, 167.0]);
    let triangle = Region::Polygon(vec![[0.0, 0.0], [167.0, 0.0], [0.0, 125.0]]);
    for region in [half, triangle] {
        let inside = |d: &[f64; 4], by: f64| match &region {
            Region::Rectangle([_, _, x1, _]) => x1 - d[0] > by,
            Region::Polygon(_) => (1.0 - d[0] / 167.0 - d[1] / 125.0) * 100.0 > by,
        };
        let settings = DetectSettings { region: Some(region.clone()), ..Default::default() };
        let found = detect(&frame, &levels, &settings);
        let mut whole = 0;
        for disc in plain(9).discs {
            let d = of_disc(&found, &disc);
            if inside(&disc, 9.0) {
                assert!(d.is_some_and(|d| !d.flags.has(Flags::BORDER)), "{disc:?} {found:?}");
                whole += 1;
            } else if !inside(&disc, -9.0) {
                assert!(d.is_none(), "{disc:?} {found:?}");
            }
        }
        assert!(whole >= 4);
        // What the region cuts is flagged.
        assert!(found.len() == whole || found.iter().any(|d| d.flags.has(Flags::BORDER)), "{found:?}");
    }
}

#[test]
fn area_limits_come_from_the_recording_and_can_be_given() {
    // Dust and a large lamp beside the markers.
    let scene = |seed: u64| {
        let mut s = plain(seed);
        s.size = [260, 168];
        s.discs.extend([[200.0, 30.0, 1.2, 180.0], [220.0, 110.0, 34.0, 200.0], [190.0, 60.0, 1.0, 200.0]]);
        s
    };
    let settings = DetectSettings::default();
    let levels = taught(scene, 8, &settings);
    assert_eq!(detect(&scene(9).frame(9, 8), &levels, &settings).len(), 12, "{:?}", levels.area_px);
    let all = DetectSettings { min_area_px: Some(1.0), max_area_px: Some(1e4), ..Default::default() };
    assert_eq!(detect(&scene(9).frame(9, 8), &taught(scene, 8, &all), &all).len(), 15);
    let wrong = DetectSettings { min_area_px: Some(50.0), max_area_px: Some(5.0), ..Default::default() };
    let text = Levels::learn(&[scene(1).frame(1, 8)], &wrong).unwrap_err().to_string();
    assert!(text.contains("least 50 px") && text.contains("greatest 5 px"), "{text}");
}

#[test]
fn a_lens_moves_centres_and_leaves_the_pixels() {
    let lens = Lens {
        camera_matrix: [[300.0, 0.0, 84.0], [0.0, 300.0, 84.0], [0.0, 0.0, 1.0]],
        distortion: vec![-0.3, 0.1, 0.0, 0.0],
    };
    let settings = DetectSettings { lens: Some(lens), ..Default::default() };
    let levels = taught(plain, 8, &settings);
    let frame = plain(9).frame(9, 8);
    let straight = detect(&frame, &levels, &settings);
    let seen = detect(&frame, &levels, &DetectSettings::default());
    assert_eq!(straight.len(), seen.len());
    for d in &seen {
        // Barrel distortion is undone outwards, the more the farther from the middle; sorted anew by y.
        let (x, y) = (d.x_px - 84.0, d.y_px - 84.0);
        let near = |s: &&Detection| (s.x_px - d.x_px).hypot(s.y_px - d.y_px) < 10.0;
        let s = straight.iter().find(near).unwrap();
        let stretch = (s.x_px - 84.0).hypot(s.y_px - 84.0) / x.hypot(y);
        assert!(stretch > 1.0 && (s.sigma_px > d.sigma_px), "{d:?} {s:?}");
        let r = ((s.x_px - 84.0) / 300.0).hypot((s.y_px - 84.0) / 300.0).powi(2);
        assert!((stretch * (1.0 - 0.3 * r + 0.1 * r * r) - 1.0).abs() < 1e-9);
    }
}

#[test]
fn opencv_has_no_threads_of_its_own_inside_workers() {
    let settings = DetectSettings { centroid: Centroid::Contour, ..Default::default() };
    let levels = taught(plain, 8, &settings);
    let frame = plain(9).frame(9, 8);
    let alone = detect(&frame, &levels, &settings);
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                assert_eq!(detect(&frame, &levels, &settings), alone);
                assert_eq!(opencv::core::get_num_threads().unwrap(), 1);
            });
        }
    });
}

#[test]
fn two_bars_that_touch_are_flagged_and_one_is_not() {
    // Bars 10 by 36 px on a dark ground, as on a ruler; the gap of the pair is blurred to 0.45 of their height.
    let frame = |index: u64, gap: f64| {
        let (w, h) = (200usize, 160usize);
        let mut bytes = vec![20u8; w * h];
        let mut bar = |x: usize, y: usize, height: usize| {
            (y..y + height).for_each(|y| bytes[y * w + x..y * w + x + 10].fill(220));
        };
        for k in 0..4 {
            bar(30 + 30 * k + index as usize, 20, 36);
        }
        bar(80, 80, 70);
        for y in 114..116 {
            bytes[y * w + 80..y * w + 90].fill((20.0 + 200.0 * gap) as u8);
        }
        Frame {
            index,
            ticks: index as i64,
            width: w as u32,
            height: h as u32,
            stride: w,
            format: PixelFormat::Gray8,
            depth_bits: 8,
            plane: Some(Box::new(bytes)),
        }
    };
    let settings = DetectSettings { threshold: Threshold::Raw(100.0), ..Default::default() };
    let levels = learn(&(0..4).map(|i| frame(i, 1.0)).collect::<Vec<_>>(), &settings);
    for (gap, merged) in [(0.45, true), (1.0, false)] {
        let found = detect(&frame(1, gap), &levels, &settings);
        assert_eq!(found.len(), 5, "{found:?}");
        assert_eq!(found[4].flags.has(Flags::MERGED), merged, "{gap}: {:?}", found[4]);
        assert!(found[..4].iter().all(|d| !d.flags.has(Flags::MERGED)), "{found:?}");
    }
}
