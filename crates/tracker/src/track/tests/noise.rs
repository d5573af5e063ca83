//! Recordings in which much stands out and nothing is a body.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::detect::Detection;
use crate::discover::discover;
use crate::error::Error;
use crate::rigid::body::Mechanism;
use crate::rigid::index::DetectionIndex;
use crate::rigid::search::MOST_SEEDS;
use crate::rigid::work::{EACH_FRAME, MOST_OF_FRAME, MOST_SAVED};
use crate::stop::Stop;
use crate::store::{DetectionStore, FrameStamp};
use crate::synth::{Film, preset};
use crate::track::frame_tracker::FrameTracker;
use crate::track::motion_priors::MotionPriors;
use crate::track::track_recording;

/// Width and height of the picture, px.
const IMAGE_PX: [u32; 2] = [720, 720];

fn spot(x_px: f64, y_px: f64) -> Detection {
    Detection { x_px, y_px, sigma_px: 0.1, area_px: 60.0, peak: 200.0, elongation: 1.0, ..Default::default() }
}

fn stored(frames: &[Vec<Detection>]) -> DetectionStore {
    let mut store = DetectionStore::new();
    for (index, detections) in (0..).zip(frames) {
        store.push(FrameStamp { index, ticks: index as i64, decoded: true }, detections).unwrap();
    }
    store
}

/// Spots that are somewhere else in each frame.
fn noise(frames: usize, spots: usize) -> Vec<Vec<Detection>> {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut place = || spot(720.0 * rng.random::<f64>(), 720.0 * rng.random::<f64>());
    (0..frames).map(|_| (0..spots).map(|_| place()).collect()).collect()
}

#[test]
fn a_rig_in_noise_is_sought_in_bounded_work_and_that_is_said() {
    let rig = Film::new(&preset("clean", 1).unwrap()).unwrap().rig(0);
    for (spots, is_bounded) in [(60, false), (3 * MOST_SEEDS, true)] {
        let store = stored(&noise(2, spots));
        let summary = track_recording(&store, &rig, &Stop::default(), &mut |_, _| Ok(())).unwrap();
        assert_eq!(summary.bounded_frames, if is_bounded { 2 } else { 0 }, "{spots}");
        assert!(summary.seen.iter().all(|n| *n == 0), "{spots}: {:?}", summary.seen);
    }
}

#[test]
fn three_hundred_spots_a_frame_take_bounded_work_in_each_frame_and_in_all() {
    const FRAMES: u64 = 60;
    let rig = Film::new(&preset("clean", 1).unwrap()).unwrap().rig(0);
    let mechanism = Mechanism::new(&rig, 0.3);
    let priors = MotionPriors::unknown(&mechanism, 0.05);
    let mut tracker = FrameTracker::new(mechanism, priors);
    let mut total = 0;
    for (i, frame) in noise(FRAMES as usize, 300).iter().enumerate() {
        let before = (tracker.bodies.work.left() + EACH_FRAME).min(MOST_SAVED);
        tracker.step(i as f64, &DetectionIndex::new(frame), None, &Stop::default()).unwrap();
        let spent = before - tracker.bodies.work.left();
        // One search may have begun just before.
        assert!(spent < MOST_OF_FRAME + MOST_OF_FRAME / 10, "frame {i}: {spent}");
        total += spent;
    }
    assert!(total <= MOST_SAVED + FRAMES * EACH_FRAME, "{total}");
    assert!(tracker.bounded_frames > 0, "{total}");
}

#[test]
fn markers_that_are_too_many_are_left_out_and_that_is_said() {
    // Each goes its own way; the later ones are seen shorter.
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let ways: Vec<[f64; 5]> = (0..130)
        .map(|k| {
            let at = [50.0 * f64::from(k % 14) + 30.0, 70.0 * f64::from(k / 14) + 30.0];
            [
                at[0],
                at[1],
                rng.random::<f64>() - 0.5,
                rng.random::<f64>() - 0.5,
                0.3 + 0.2 * rng.random::<f64>(),
            ]
        })
        .collect();
    let frames: Vec<Vec<Detection>> = (0..40)
        .map(|i| {
            let here = |(k, [x, y, u, v, f]): (usize, &[f64; 5])| {
                let t = i as f64;
                let swing = 12.0 * (f * t).sin();
                (i < 40 - k / 10).then(|| spot(x + u * t + swing, y + v * t - swing * u))
            };
            ways.iter().enumerate().filter_map(here).collect()
        })
        .collect();
    let found = discover(&stored(&frames), IMAGE_PX, &Stop::default()).unwrap();
    assert_eq!(found.rig.nodes.len(), 100);
    let told: Vec<String> = found.warnings.iter().map(ToString::to_string).collect();
    assert!(
        told.iter().any(|w| w.contains("the 100 that are seen longest are followed, 30 more are not")),
        "{told:?}"
    );
}

#[test]
fn a_wish_to_stop_is_heard_between_bodies() {
    let rig = Film::new(&preset("clean", 1).unwrap()).unwrap().rig(0);
    let mechanism = Mechanism::new(&rig, 0.3);
    let priors = MotionPriors::unknown(&mechanism, 0.05);
    let mut tracker = FrameTracker::new(mechanism, priors);
    let stop = Stop::default();
    stop.ask();
    let frame = noise(1, 50).remove(0);
    let index = DetectionIndex::new(&frame);
    assert!(matches!(tracker.step(0.0, &index, None, &stop), Err(Error::Interrupted)));
}
