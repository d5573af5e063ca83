//! Cameras that stand off square or bend lines, and links whose shapes alone tell nothing: followed without settings.

use super::bed::{Bed, QUIET};
use crate::camera::Camera;
use crate::rig::Rig;
use crate::synth::{View, preset};

const SQUARE: View = View { tilt_deg: 0.0, towards_deg: 30.0, focal_widths: 2.0, k1: 0.0, pixel_height: 1.0 };
const BENT: View = View { tilt_deg: 12.0, towards_deg: 50.0, k1: -0.08, ..SQUARE };

/// The rig found in a film of 500 frames, which names at least a part of what is seen and nothing wrongly.
fn found(name: &str, seed: u64, view: View, least: f64) -> (Bed, Rig) {
    let mut scene = preset(name, seed).unwrap();
    scene.frames = 500;
    scene.camera.view = (view != SQUARE).then_some(view);
    let bed = Bed::new(&scene, QUIET);
    let rig = bed.discover().rig;
    let got = bed.follow(&rig);
    let s = &got.score;
    assert_eq!((s.wrong, s.switches, s.false_positives), (0, 0, 0), "{name} {seed} {:?}", s.first_wrong);
    assert!(s.unmatched.is_empty(), "{name} {seed} {:?}", s.unmatched);
    assert!(s.coverage >= least, "{name} {seed} {}{}", s.coverage, got.runs());
    assert_eq!(rig.bodies.len(), scene.links.len(), "{name} {seed}");
    assert_eq!(rig.joints.len(), scene.links.len(), "{name} {seed} {:?}", rig.joints);
    (bed, rig)
}

#[test]
fn tilt_lens_and_high_pixels_are_found_and_corrected() {
    let views = [
        View { tilt_deg: 10.0, ..SQUARE },
        View { k1: -0.2, ..SQUARE },
        View { pixel_height: 1.05, ..SQUARE },
        BENT,
    ];
    for (view, seed) in views.into_iter().zip(2010..) {
        let (bed, rig) = found("clean", seed, view, 0.995);
        let camera = rig.camera.unwrap();
        // The bed says nothing of its pixels, as a camera does that takes them for square.
        let [w, h] = bed.film.scene().image_px.map(f64::from);
        let (tilt, towards) = (view.tilt_deg.to_radians(), view.towards_deg.to_radians());
        let truth = Camera::tilted(tilt, towards, view.focal_widths * w, view.k1, view.pixel_height, [w, h])
            .numbers();
        let covariance = camera.covariance.unwrap();
        for (i, (a, b)) in camera.numbers().into_iter().zip(truth).enumerate() {
            // Numbers left at 0 are off by less than chance may make them; the others by four standard errors at most.
            let sigma = covariance[i][i].sqrt().max(1e-3);
            assert!((a - b).abs() < 4.0 * sigma, "{view:?} {i}: {a} {b} {sigma}");
        }
    }
}

#[test]
fn two_markers_a_link_three_links_and_rows_of_markers_are_followed() {
    for (name, least) in [("pairs", 0.98), ("triple", 0.97), ("symmetric", 0.98)] {
        for view in [SQUARE, BENT] {
            let (_, rig) = found(name, 2020, view, least);
            assert_eq!(rig.camera.is_some(), view != SQUARE, "{name}");
        }
    }
}

#[test]
fn a_camera_that_stands_square_is_left_alone() {
    for seed in 2030..2033 {
        assert_eq!(found("clean", seed, SQUARE, 0.99).1.camera, None);
    }
}
