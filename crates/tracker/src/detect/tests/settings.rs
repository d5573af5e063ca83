//! Settings of detection that a user may give, and their results.

use std::sync::Arc;

use super::*;
use crate::rig::{Lens, Region};

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
            polarity: Some(Polarity::Bright),
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
        let dark = DetectSettings { polarity: Some(Polarity::Dark), ..Default::default() };
        if let Ok(levels) = Levels::learn(&[scene(1).frame(1, bits)], &dark) {
            let found = detect(&scene(2).frame(2, bits), &Arc::new(levels), &dark);
            assert!(scene(2).discs.iter().all(|d| of_disc(&found, d).is_none()), "{found:?}");
        }
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
fn an_intensity_weighted_centre_is_no_fit_of_a_disc() {
    let scene = |seed: u64| plain(seed);
    let centres = |centroid: Centroid| {
        let settings = DetectSettings { centroid, ..Default::default() };
        detect(&scene(9).frame(9, 8), &taught(scene, 8, &settings), &settings)
    };
    let (discs, weighted) = (centres(Centroid::Disc), centres(Centroid::Weighted));
    assert_eq!(discs.len(), weighted.len());
    // No disc is fitted, so none is missing: whole markers are told by their area.
    let whole = |found: &[Detection]| found.iter().all(|d| d.flags == Flags::default());
    assert!(whole(&discs) && whole(&weighted) && whole(&centres(Centroid::Contour)), "{weighted:?}");
    let mut farthest = 0.0f64;
    for (d, w) in discs.iter().zip(&weighted) {
        let apart = (d.x_px - w.x_px).hypot(d.y_px - w.y_px);
        // Both are centres of the same markers, each within four of its standard uncertainties.
        assert!(apart < 4.0 * f64::from(d.sigma_px.hypot(w.sigma_px)), "{d:?} {w:?}");
        assert!(w.sigma_px > d.sigma_px, "the mean takes in the noise of the whole marker: {d:?} {w:?}");
        farthest = farthest.max(apart);
    }
    assert!(farthest > 1e-4, "they are computed otherwise");
}
