//! The truth itself is without fault; each kind of fault is counted.

use super::*;
use crate::synth::{Film, Truth, preset};

/// The truth of a short film and a table that says just that where a marker is half visible.
fn perfect(name: &str) -> (Truth, Tracked) {
    let mut scene = preset(name, 1).unwrap();
    scene.frames = 300;
    let truth = Truth::of(&Film::new(&scene).unwrap());
    let tracked = Tracked {
        nodes: truth.nodes.iter().map(|(n, _)| format!("my {n}")).collect(),
        frames: truth.frames.iter().map(|f| f.frame).collect(),
        xy_px: truth
            .frames
            .iter()
            .flat_map(|f| {
                f.nodes.iter().map(|n| if n.visible >= HALF { [n.x_px, n.y_px] } else { [f64::NAN; 2] })
            })
            .collect(),
        sigma_px: Vec::new(),
    };
    (truth, tracked)
}

#[test]
fn the_truth_itself_is_without_fault() {
    for name in ["clean", "late", "dropout", "occluded"] {
        let (truth, tracked) = perfect(name);
        let s = score(&tracked, &truth, LIMIT_PX).unwrap();
        assert_eq!((s.wrong, s.switches, s.false_positives), (0, 0, 0), "{name}");
        assert_eq!(s.coverage, 1.0);
        assert_eq!(s.reacquisition.at_once, s.reacquisition.cases);
        assert_eq!(s.rms_x_px, 0.0);
        assert!(s.angles.iter().all(|a| a.rms_deg < 1e-10));
        assert_eq!(s.matches[3].truth.as_deref(), Some("n3"));
    }
    assert!(score(&perfect("late").1, &perfect("late").0, LIMIT_PX).unwrap().reacquisition.cases >= 5);
}

#[test]
fn swapped_names_are_wrong_from_then_on() {
    let (truth, mut tracked) = perfect("clean");
    for row in 200..300 {
        tracked.xy_px.swap(row * 9, row * 9 + 1);
    }
    let s = score(&tracked, &truth, LIMIT_PX).unwrap();
    // Both are fully visible throughout: markers of the link in front.
    assert_eq!((s.wrong, s.switches), (200, 2));
    assert_eq!(s.first_wrong[0], (200, "my n0".into(), "n1".into()));
    assert!(s.coverage < 1.0);
}

#[test]
fn places_of_nothing_are_false_positives() {
    let (truth, mut tracked) = perfect("clean");
    for row in 0..7 {
        tracked.xy_px[row * 9 + 4] = [5.0, 5.0];
    }
    let s = score(&tracked, &truth, LIMIT_PX).unwrap();
    assert_eq!((s.false_positives, s.wrong), (7, 0));
}

#[test]
fn late_reacquisition_is_counted_in_frames() {
    let (truth, mut tracked) = perfect("clean");
    let hide = |truth: &mut Truth, frames: std::ops::Range<usize>| {
        frames.for_each(|f| truth.frames[f].nodes[0].visible = 0.0);
    };
    let mut truth = truth;
    hide(&mut truth, 50..60);
    hide(&mut truth, 100..110);
    for row in (50..62).chain(100..110) {
        tracked.xy_px[row * 9] = [f64::NAN; 2];
    }
    let s = score(&tracked, &truth, LIMIT_PX).unwrap();
    let mine = |r: &Reacquisition| (r.cases, r.at_once, r.longest);
    let (_, untouched) = perfect("clean");
    let rest = score(&untouched, &perfect("clean").0, LIMIT_PX).unwrap().reacquisition;
    assert_eq!(mine(&s.reacquisition), (rest.cases + 2, rest.at_once + 1, 2));
}

#[test]
fn errors_and_angles_are_measured() {
    let (truth, mut tracked) = perfect("clean");
    tracked.xy_px.iter_mut().for_each(|p| p[0] += 0.25);
    tracked.sigma_px = vec![0.25; tracked.xy_px.len()];
    let s = score(&tracked, &truth, LIMIT_PX).unwrap();
    assert!((s.rms_x_px - 0.25).abs() < 1e-9 && s.rms_y_px < 1e-9 && (s.bias_px[0] - 0.25).abs() < 1e-9);
    assert!((s.error_over_sigma.unwrap() - 0.5f64.sqrt()).abs() < 1e-9);
    assert!(s.angles[0].rms_deg < 1e-9);
    // Turn everything by a tenth of a degree about the pivot.
    let (sin, cos) = 0.1f64.to_radians().sin_cos();
    for p in &mut tracked.xy_px {
        let (x, y) = (p[0] - 360.25, p[1] - 360.0);
        *p = [360.25 + cos * x - sin * y, 360.0 + sin * x + cos * y];
    }
    let s = score(&tracked, &truth, LIMIT_PX).unwrap();
    assert!((s.angles[1].rms_deg - 0.1).abs() < 1e-9, "{:?}", s.angles);
}
