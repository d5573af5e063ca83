//! Mechanisms that hang on no point of the picture, and bodies whose shapes tell nothing: markers without pixels.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

use crate::detect::Detection;
use crate::discover::discover;
use crate::rig::Rig;
use crate::stop::Stop;
use crate::store::{DetectionStore, FrameStamp};
use crate::track::track_recording;

const FRAMES: usize = 600;
const RATE_HZ: f64 = 500.0;
const NOISE_PX: f64 = 0.02;

/// Places of a body's markers, px, at `origin` and turned by `angle`.
fn body(origin: [f64; 2], angle: f64, markers: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let (s, c) = angle.sin_cos();
    markers.iter().map(|[u, v]| [origin[0] + u * c - v * s, origin[1] + u * s + v * c]).collect()
}

/// Markers in each frame, always in one order.
fn filmed(seed: u64, places: impl Fn(f64) -> Vec<[f64; 2]>) -> DetectionStore {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let noise = Normal::new(0.0, NOISE_PX).unwrap();
    let mut store = DetectionStore::new();
    for k in 0..FRAMES {
        let seen: Vec<Detection> = places(k as f64 / RATE_HZ)
            .into_iter()
            .map(|[x, y]| Detection {
                x_px: x + noise.sample(&mut rng),
                y_px: y + noise.sample(&mut rng),
                sigma_px: NOISE_PX as f32,
                area_px: 113.0,
                peak: 200.0,
                elongation: 1.0,
                ..Detection::default()
            })
            .collect();
        store.push(FrameStamp { index: k as u64, ticks: k as i64, decoded: true }, &seen).unwrap();
    }
    store
}

/// Part of the rows in which a node is given; none may be another marker's than the node's first.
fn named(store: &DetectionStore, rig: &Rig) -> f64 {
    let mut own: Vec<Option<usize>> = vec![None; rig.nodes.len()];
    let (mut given, mut rows, mut seen) = (0, 0, Vec::new());
    track_recording(store, rig, &Stop::default(), &mut |stamp, row| {
        store.read(stamp.index as usize, &mut seen);
        for (node, o) in row.iter().enumerate() {
            rows += 1;
            if !o.status.is_seen() {
                continue;
            }
            given += 1;
            let marker = seen.iter().position(|d| (d.x_px - o.x_px).hypot(d.y_px - o.y_px) < 1.0).unwrap();
            assert_eq!(*own[node].get_or_insert(marker), marker, "frame {} node {node}", stamp.index);
        }
        Ok(())
    })
    .unwrap();
    let mut all: Vec<usize> = own.into_iter().flatten().collect();
    all.sort_unstable();
    all.dedup();
    assert_eq!(all.len(), rig.nodes.len(), "each node is a marker of its own");
    f64::from(given) / f64::from(rows)
}

fn sizes(rig: &Rig) -> Vec<usize> {
    let of = |name: &str| rig.nodes.iter().filter(|n| n.body == name).count();
    let mut sizes: Vec<usize> = rig.bodies.iter().map(|b| of(&b.name)).collect();
    sizes.sort_unstable();
    sizes
}

/// A cart of two markers that slides, and a pole of two that swings on it.
fn cart_and_pole(seed: u64) -> DetectionStore {
    let phase = seed as f64;
    filmed(seed, |t| {
        let x = 400.0 + 150.0 * (5.0 * t + phase).sin();
        let mut seen = body([x, 256.0], 0.0, &[[40.0, 0.0], [-40.0, 0.0]]);
        seen.extend(body(
            [x, 256.0],
            1.6 * (6.0 * t + 2.0 * phase).cos() + 1.57,
            &[[80.0, 0.0], [200.0, 0.0]],
        ));
        seen
    })
}

#[test]
fn a_cart_and_its_pole_of_two_markers_each_are_followed() {
    for seed in 1..5 {
        let store = cart_and_pole(seed);
        let rig = discover(&store, [800, 640], &Stop::default()).unwrap().rig;
        assert_eq!((sizes(&rig), rig.joints.len()), (vec![2, 2], 1), "{seed} {:?}", rig.joints);
        assert!(named(&store, &rig) > 0.99, "{seed}");
    }
}

#[test]
fn bodies_that_move_as_one_are_one() {
    let rectangle = [[40.0, 20.0], [40.0, -20.0], [140.0, 20.0], [140.0, -20.0]];
    let rhombus = [[40.0, 0.0], [80.0, 20.0], [80.0, -20.0], [120.0, 0.0]];
    for seed in 1..4 {
        let phase = seed as f64;
        let store = filmed(seed, |t| {
            let (upper, lower) = (2.0 * (5.0 * t + phase).sin() + 1.57, 2.5 * (8.0 * t).cos() + phase);
            let elbow = [400.0 + 180.0 * upper.cos(), 270.0 + 180.0 * upper.sin()];
            let mut seen = body([400.0, 270.0], upper, &rectangle);
            seen.extend(body(elbow, lower, &rhombus));
            seen
        });
        let rig = discover(&store, [800, 640], &Stop::default()).unwrap().rig;
        assert_eq!((sizes(&rig), rig.joints.len()), (vec![4, 4], 2), "{seed}");
        assert!(named(&store, &rig) > 0.99, "{seed}");
    }
}
