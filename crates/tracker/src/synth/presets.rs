//! Makes the scenes that come with the program: the paper's layout and the eight scenes by which tracking is judged.
//!
//! The layout follows Fig. 5: three markers on the upper link, six on the lower, some of them beside the bar so that
//! most are seen when the lower link passes behind the upper.

use super::scene::{
    Camera, Hidden, Light, Link, LinkMotion, Marker, RandomGlints, SCENE_SCHEMA, Scene, Span,
};
use crate::error::{Error, Fault, Result};

/// Names of the scenes that [`preset`] makes, in the order in which tables list them.
pub const PRESETS: [&str; 8] = ["clean", "noisy", "dim", "glints", "late", "dropout", "occluded", "fast"];

/// Names of other mechanisms that [`preset`] makes, with the light and the motion of `clean`.
pub const MECHANISMS: [&str; 3] = ["triple", "pairs", "symmetric"];

/// Length of the upper link from pivot to elbow, px.
pub const UPPER_PX: f64 = 160.0;

/// The two links and nine markers of the paper's layout about a pivot, markers of `radius_px` and `level`; links
/// have no motion of their own.
pub fn paper_layout(
    pivot_px: [f64; 2],
    radius_px: f64,
    level: f64,
    bar_level: f64,
) -> (Vec<Link>, Vec<Marker>) {
    let link = |name: &str, parent: Option<&str>, joint_px, along_px, width_px| Link {
        name: name.into(),
        parent: parent.map(str::to_string),
        joint_px,
        velocity_px_s: None,
        along_px,
        width_px,
        level: bar_level,
        light: 1.0,
        motion: None,
    };
    let links = vec![
        link("upper", None, pivot_px, [-16.0, UPPER_PX + 14.0], 32.0),
        link("lower", Some("upper"), [UPPER_PX, 0.0], [-14.0, 158.0], 28.0),
    ];
    let at: [(&str, [f64; 2]); 9] = [
        ("upper", [32.0, -7.0]),
        ("upper", [84.0, 8.0]),
        ("upper", [130.0, -6.0]),
        ("lower", [27.0, 23.0]),
        ("lower", [52.0, -6.0]),
        ("lower", [78.0, 24.0]),
        ("lower", [99.0, -23.0]),
        ("lower", [122.0, 5.0]),
        ("lower", [147.0, -22.0]),
    ];
    let markers = at
        .into_iter()
        .enumerate()
        .map(|(i, (body, at_px))| Marker {
            name: format!("n{i}"),
            link: body.into(),
            at_px,
            radius_px,
            level,
        })
        .collect();
    (links, markers)
}

/// Links that hang on each other and their markers; each link has its length, px, and its markers' places along and across it.
fn chain(pivot_px: [f64; 2], parts: &[(&str, f64, &[[f64; 2]])]) -> (Vec<Link>, Vec<Marker>) {
    let (paper, shown) = paper_layout(pivot_px, 6.0, 200.0, 24.0);
    let mut links: Vec<Link> = Vec::new();
    let mut markers: Vec<Marker> = Vec::new();
    let mut joint_px = pivot_px;
    for &(name, length_px, places) in parts {
        let parent = links.last().map(|l: &Link| l.name.clone());
        let (name, along_px) = (name.to_string(), [-14.0, length_px + 14.0]);
        for &at_px in places {
            let node = format!("n{}", markers.len());
            markers.push(Marker { name: node, link: name.clone(), at_px, ..shown[0].clone() });
        }
        links.push(Link { name, parent, joint_px, along_px, ..paper[0].clone() });
        joint_px = [length_px, 0.0];
    }
    (links, markers)
}

/// The links and markers of a scene by its name.
fn layout(name: &str) -> (Vec<Link>, Vec<Marker>) {
    let pivot_px = [360.0, 360.0];
    match name {
        "triple" => chain(
            pivot_px,
            &[
                ("first", 112.0, &[[24.0, -6.0], [58.0, 8.0], [86.0, -7.0]]),
                ("second", 112.0, &[[27.0, 22.0], [55.0, -22.0], [91.0, 23.0]]),
                ("third", 90.0, &[[25.0, -24.0], [50.0, 23.0], [84.0, -22.0], [100.0, 22.0]]),
            ],
        ),
        "pairs" => chain(
            pivot_px,
            &[
                ("upper", UPPER_PX, &[[48.0, -7.0], [122.0, 6.0]]),
                ("lower", 144.0, &[[50.0, 23.0], [138.0, -22.0]]),
            ],
        ),
        "symmetric" => chain(
            pivot_px,
            &[
                ("upper", UPPER_PX, &[[40.0, 0.0], [80.0, 0.0], [120.0, 0.0]]),
                ("lower", 144.0, &[[40.0, 24.0], [80.0, 24.0], [120.0, 24.0]]),
            ],
        ),
        _ => paper_layout(pivot_px, 6.0, 200.0, 24.0),
    }
}

/// A scene by its name, 720 x 720 px: the paper's layout tumbling about the middle of the image.
///
/// | name | what is hard about it |
/// |---|---|
/// | `clean` | nothing: noise of one level, contrast 200 |
/// | `noisy` | noise so that the signal is about 10 times it in each pixel |
/// | `dim` | the signal is about 5 times the noise |
/// | `glints` | bright spots for one to six frames, and twelve hot pixels |
/// | `late` | five of nine markers hidden in the first frames |
/// | `dropout` | black frames, up to 60 in a row |
/// | `occluded` | the whole lower link hidden for 300 frames, three times |
/// | `fast` | 250 frames a second, up to 50 px per frame |
///
/// | `triple` | three links of three, three and four markers |
/// | `pairs` | two links of two markers |
/// | `symmetric` | two links of three markers in a row, equally far apart and alike |
///
/// All but `fast` have 500 frames a second; all have an exposure of 0.4 ms. The seed changes motion, noise and the
/// times of mishaps.
///
/// # Errors
/// [`Error::Argument`] for a name that is neither in [`PRESETS`] nor in [`MECHANISMS`].
pub fn preset(name: &str, seed: u64) -> Result<Scene> {
    if !PRESETS.contains(&name) && !MECHANISMS.contains(&name) {
        return Err(Error::Argument(Fault::new("preset", format!("{name:?} is not one")).advice(format!(
            "Choose one of {}, {}",
            PRESETS.join(", "),
            MECHANISMS.join(", ")
        ))));
    }
    let (mut links, markers) = layout(name);
    links[0].motion =
        Some(LinkMotion::Tumble { phi_rad: 6.0 * (part(seed, 1) - 0.5), rate_rad_s: 7.0, frequency_hz: 2.0 });
    links[1].motion = Some(LinkMotion::Tumble {
        phi_rad: 6.0 * (part(seed, 2) - 0.5),
        rate_rad_s: 14.0,
        frequency_hz: 3.0,
    });
    if let Some(third) = links.get_mut(2) {
        third.motion = Some(LinkMotion::Tumble {
            phi_rad: 6.0 * (part(seed, 5) - 0.5),
            rate_rad_s: 14.0,
            frequency_hz: 3.0,
        });
    }
    let mut s = Scene {
        schema: SCENE_SCHEMA,
        image_px: [720, 720],
        frames: 1000,
        rate_hz: 500.0,
        seed,
        camera: Camera { exposure_s: 0.0004, read_noise: 1.0, ..Camera::default() },
        light: Light { background: 10.0, ..Light::default() },
        motion: None,
        glints: None,
        links,
        markers,
        distractors: Vec::new(),
        screens: Vec::new(),
        glint_list: Vec::new(),
        hidden: Vec::new(),
        dropouts: Vec::new(),
    };
    harm(&mut s, name);
    s.check(name)?;
    Ok(s)
}

/// A number from 0 to 1 for purpose `k`: a little arithmetic on the seed spreads what differs between seeds; the rest is drawn
/// inside the film.
fn part(seed: u64, k: u64) -> f64 {
    let mut z = (seed ^ (k << 32)).wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(k);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

/// Adds to a clean scene what is hard about the scene `name`.
fn harm(s: &mut Scene, name: &str) {
    let seed = s.seed;
    let part = |k: u64| part(seed, k);
    let levels = |s: &mut Scene, marker: f64, bar: f64| {
        s.markers.iter_mut().for_each(|m| m.level = marker);
        s.links.iter_mut().for_each(|l| l.level = bar);
    };
    match name {
        "noisy" => {
            levels(s, 130.0, 24.0);
            s.camera.read_noise = 9.0;
            s.camera.shot_gain = 0.3;
            s.camera.black = 16.0;
            s.light.background_gradient = [8.0, -4.0];
        }
        "dim" => {
            levels(s, 34.0, 12.0);
            s.camera.read_noise = 5.0;
            s.camera.black = 16.0;
            s.light.background = 6.0;
        }
        "glints" => {
            s.camera.hot_pixels = 12;
            s.camera.hot_level = 180.0;
            s.glints = Some(RandomGlints {
                per_frame: 0.1,
                longest: 6,
                radius_px: [1.5, 7.0],
                level: [80.0, 240.0],
            });
            // One link twice as bright as the other, and light that falls off across the image.
            levels(s, 110.0, 16.0);
            s.links[1].light = 2.0;
            s.light.uneven = [0.3, -0.2];
        }
        "late" => {
            let count = 20 + (60.0 * part(3)) as u64;
            // Two of the upper link's markers and three of the lower's, or one and four, by the seed.
            let hidden: [&str; 5] = match (3.0 * part(4)) as u32 {
                0 => ["n1", "n2", "n4", "n6", "n8"],
                1 => ["n0", "n3", "n5", "n6", "n7"],
                _ => ["n2", "n3", "n4", "n7", "n8"],
            };
            for (k, marker) in hidden.into_iter().enumerate() {
                s.hidden.push(Hidden {
                    first: 0,
                    count: count + 7 * k as u64,
                    links: Vec::new(),
                    markers: vec![marker.into()],
                });
            }
        }
        "dropout" => {
            for (k, count) in [1, 5, 20, 60].into_iter().enumerate() {
                let first = 120 + 210 * k as u64 + (60.0 * part(10 + k as u64)) as u64;
                s.dropouts.push(Span { first, count });
            }
        }
        "occluded" => {
            s.frames = 1500;
            for k in 0..3 {
                let first = 80 + 460 * k + (60.0 * part(20 + k)) as u64;
                s.hidden.push(Hidden { first, count: 300, links: vec!["lower".into()], markers: Vec::new() });
            }
        }
        "fast" => s.rate_hz = 250.0,
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_preset_is_a_scene_and_survives_toml() {
        for name in PRESETS.into_iter().chain(MECHANISMS) {
            let scene = preset(name, 5).unwrap();
            assert_eq!(Scene::parse(&scene.to_toml().unwrap(), name).unwrap(), scene);
            assert_ne!(preset(name, 6).unwrap().links, scene.links);
        }
    }

    #[test]
    fn an_unknown_preset_names_those_that_exist() {
        let message = preset("clear", 0).unwrap_err().to_string();
        assert!(message.contains("clean, noisy"), "{message}");
    }
}
