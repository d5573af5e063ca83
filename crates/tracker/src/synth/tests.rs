//! Tests of whole films: light adds up, blur is where it should be, seeds decide everything.

use super::scene::*;
use super::*;
use crate::frame::TimeBase;
use rayon::prelude::*;

/// The first four lines of every scene here.
const HEAD: &str = "schema = 1\nimage_px = [64, 48]\nframes = 10\nrate_hz = 1000.0\n";

fn scene(text: &str) -> Scene {
    Scene::parse(&format!("{HEAD}{text}"), "test").unwrap()
}

const ONE_DISC: &str = r#"
[light]
background = 0.0
[[link]]
name = "a"
joint_px = [30.3, 20.6]
[[marker]]
name = "n0"
link = "a"
at_px = [0.0, 0.0]
radius_px = 5.0
level = 200.0
"#;

fn moments(film: &Film, index: u64) -> [f64; 3] {
    let mut image = Vec::new();
    film.expected(index, &mut image);
    let w = film.scene().image_px[0] as usize;
    let (mut s, mut sx, mut sy) = (0.0, 0.0, 0.0);
    for (i, &v) in image.iter().enumerate() {
        let v = f64::from(v);
        s += v;
        sx += v * (i % w) as f64;
        sy += v * (i / w) as f64;
    }
    [s, sx / s, sy / s]
}

#[test]
fn a_still_disc_has_its_light_and_its_centre() {
    let film = Film::new(&scene(ONE_DISC)).unwrap();
    let [sum, x, y] = moments(&film, 0);
    // 100 pixels, each rounded to f32: 100 x 200 x 6e-8 at most.
    assert!((sum - 200.0 * std::f64::consts::PI * 25.0).abs() < 2e-3, "{sum}");
    // A pixel stands for its centre, so edge pixels displace the centroid by their covered part's offset. About 30 of
    // 78 pixels do so by 0.2 px at random: 0.2 x sqrt(30) / 78 = 0.014 px at most, in fact some 0.002 px.
    assert!((x - 30.3).abs() < 5e-3 && (y - 20.6).abs() < 5e-3, "{x} {y}");
    let t = film.truth(0);
    assert_eq!((t.nodes[0].x_px, t.nodes[0].y_px), (30.3, 20.6));
    assert!((t.nodes[0].visible - 1.0).abs() < 1e-12);
}

#[test]
fn centroid_error_averages_to_nothing_over_the_phase() {
    let mut s = scene(ONE_DISC);
    let mut mean = 0.0;
    let n = 40;
    for k in 0..n {
        s.links[0].joint_px = [30.0 + f64::from(k) / f64::from(n), 20.0 + 0.618 * f64::from(k % 7)];
        mean += (moments(&Film::new(&s).unwrap(), 0)[1] - s.links[0].joint_px[0]) / f64::from(n);
    }
    // The bias is periodic in the phase and odd about its middle; what is left is f32 rounding.
    assert!(mean.abs() < 2e-4, "{mean}");
}

#[test]
fn blur_keeps_light_and_centre_and_makes_it_longer() {
    let mut s = scene(ONE_DISC);
    s.links[0].velocity_px_s = Some([6000.0, 1500.0]);
    s.links[0].joint_px = [20.3, 15.6];
    s.camera.exposure_s = 0.0005;
    let film = Film::new(&s).unwrap();
    let [sum, x, y] = moments(&film, 2);
    assert!((sum - 200.0 * std::f64::consts::PI * 25.0).abs() < 5e-3, "{sum}");
    assert!((x - 32.3).abs() < 2e-3 && (y - 18.6).abs() < 2e-3, "{x} {y}");
    let mut image = Vec::new();
    film.expected(2, &mut image);
    let second: f64 =
        image.iter().enumerate().map(|(i, &v)| f64::from(v) * ((i % 64) as f64 - x).powi(2)).sum::<f64>()
            / sum;
    // Variance of a disc r2/4, of the way L2/12, of the pixel 1/12; the way is 3 px.
    assert!((second - (25.0 / 4.0 + 9.0 / 12.0 + 1.0 / 12.0)).abs() < 0.01, "{second}");
}

#[test]
fn a_link_in_front_hides_and_the_truth_knows_it() {
    let text = r#"
[light]
background = 0.0
[[link]]
name = "front"
joint_px = [30.0, -20.0]
along_px = [0.0, 100.0]
width_px = 12.0
level = 20.0
[[link]]
name = "back"
joint_px = [36.0, 20.0]
[[marker]]
name = "n0"
link = "back"
at_px = [0.0, 0.0]
radius_px = 5.0
level = 200.0
"#;
    let film = Film::new(&scene(text)).unwrap();
    assert!((film.truth(0).nodes[0].visible - 0.5).abs() < 1e-12);
    let mut image = Vec::new();
    film.expected(0, &mut image);
    // The bar's right edge is in the middle of pixel 36: left of it only the bar, right of it the marker.
    assert!((image[20 * 64 + 34] - 20.0).abs() < 1e-4 && (image[20 * 64 + 38] - 200.0).abs() < 1e-4);
    assert!((image[20 * 64 + 36] - 110.0).abs() < 1e-4, "{}", image[20 * 64 + 36]);
}

#[test]
fn uneven_light_brightens_one_side() {
    let mut s =
        scene("[light]\nbackground = 100.0\nuneven = [0.4, 0.0]\nbackground_gradient = [0.0, 10.0]\n");
    s.camera.black = 5.0;
    let mut image = Vec::new();
    Film::new(&s).unwrap().expected(0, &mut image);
    let mean = |x: usize| (0..48).map(|y| f64::from(image[y * 64 + x])).sum::<f64>() / 48.0 - 5.0;
    assert!((mean(0) - 100.0 * (1.0 - 0.4 * 31.5 / 64.0)).abs() < 1e-3, "{}", mean(0));
    assert!((mean(63) - 100.0 * (1.0 + 0.4 * 31.5 / 64.0)).abs() < 1e-3);
    assert!((f64::from(image[47 * 64 + 32] - image[32]) - 10.0 * 47.0 / 48.0).abs() < 0.05);
}

#[test]
fn recorded_noise_has_the_stated_variance_and_clips() {
    let mut s = scene("[light]\nbackground = 400.0\n");
    s.image_px = [300, 300];
    s.camera = Camera { depth_bits: 12, read_noise: 6.0, shot_gain: 0.5, black: 50.0, ..Camera::default() };
    let film = Film::new(&s).unwrap();
    let mut bytes = Vec::new();
    film.render(3, &mut bytes);
    let levels: Vec<f64> = bytes.chunks(2).map(|b| f64::from(u16::from_le_bytes([b[0], b[1]]))).collect();
    let n = levels.len() as f64;
    let mean = levels.iter().sum::<f64>() / n;
    let variance = levels.iter().map(|l| (l - mean).powi(2)).sum::<f64>() / n;
    let stated = film.variance(450.0);
    // Five standard errors of 90000 samples.
    assert!((mean - 450.0).abs() < 5.0 * (stated / n).sqrt(), "{mean}");
    assert!((variance / stated - 1.0).abs() < 5.0 * (2.0 / n).sqrt(), "{variance} {stated}");
    s.camera.saturation = Some(440.0);
    Film::new(&s).unwrap().render(3, &mut bytes);
    assert!(bytes.chunks(2).all(|b| u16::from_le_bytes([b[0], b[1]]) <= 440));
}

#[test]
fn any_order_and_any_threads_make_the_same_film() {
    let film = Film::new(&preset("glints", 3).unwrap()).unwrap();
    let all: Vec<u64> = vec![0, 7, 300, 999];
    let make = |i: &u64| {
        let mut out = Vec::new();
        film.render(*i, &mut out);
        out
    };
    let one: Vec<_> = all.iter().map(make).collect();
    let many: Vec<_> = all.par_iter().rev().map(make).collect();
    assert!(one.iter().eq(many.iter().rev()));
    let other = Film::new(&preset("glints", 4).unwrap()).unwrap();
    let mut out = Vec::new();
    other.render(7, &mut out);
    assert_ne!(out, one[1]);
}

#[test]
fn mishaps_happen_when_they_are_said_to() {
    let mut s = scene(ONE_DISC);
    s.links[0].joint_px = [20.0, 20.0];
    s.dropouts.push(Span { first: 2, count: 2 });
    s.hidden.push(Hidden { first: 5, count: 1, links: vec!["a".into()], markers: vec![] });
    s.hidden.push(Hidden { first: 7, count: 1, links: vec![], markers: vec!["n0".into()] });
    s.glint_list.push(Glint { first: 8, count: 1, at_px: [50.0, 40.0], radius_px: 2.0, level: 90.0 });
    let film = Film::new(&s).unwrap();
    let visible: Vec<f64> = (0..10).map(|i| film.truth(i).nodes[0].visible.round()).collect();
    assert_eq!(visible, [1.0, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 1.0]);
    let mut image = Vec::new();
    for i in 0..10u64 {
        film.expected(i, &mut image);
        assert_eq!(image[20 * 64 + 20] > 100.0, visible[i as usize] > 0.5, "frame {i}");
        assert_eq!(image[40 * 64 + 50] > 50.0, i == 8, "frame {i}");
    }
}

#[test]
fn angles_turn_counter_clockwise_and_links_hang_on_links() {
    let text = r#"
[[link]]
name = "upper"
joint_px = [30.0, 20.0]
motion = { kind = "rest", phi_rad = 1.5707963267948966 }
[[link]]
name = "lower"
parent = "upper"
joint_px = [10.0, 0.0]
[[marker]]
name = "tip"
link = "lower"
at_px = [8.0, 3.0]
radius_px = 2.0
level = 200.0
"#;
    let film = Film::new(&scene(text)).unwrap();
    let t = film.truth(0);
    // The upper link points right; the lower one hangs from (40, 20), its right side to the right.
    assert!((t.nodes[0].x_px - 43.0).abs() < 1e-12 && (t.nodes[0].y_px - 28.0).abs() < 1e-12, "{t:?}");
    let rig = film.rig(0);
    assert_eq!(rig.joints[1].bodies, ["upper", "lower"]);
    assert!((rig.joints[1].x_px - 40.0).abs() < 1e-12);
    rig.check("rig").unwrap_err(); // The upper link has no marker here, so no body carries the pivot.
}

#[test]
fn a_table_moves_links_and_must_be_long_enough() {
    let mut s = scene(ONE_DISC);
    s.markers[0].at_px = [10.0, 0.0];
    let time_s: Vec<f64> = (0..20).map(|i| f64::from(i) * 0.001).collect();
    let mut table = MotionTable {
        name: "drop.csv".into(),
        phi_rad: vec![time_s.iter().map(|t| 40.0 * t).collect()],
        time_s,
        place_px: vec![],
    };
    let film = Film::with_motion(&s, &table).unwrap();
    let t = film.truth(5);
    assert!((t.phi_rad[0] - 0.2).abs() < 1e-12);
    assert!((t.nodes[0].x_px - (30.3 + 10.0 * 0.2f64.sin())).abs() < 1e-12);
    s.motion = Some(MotionFile { file: "drop.csv".into(), start_s: Some(0.012) });
    let message = Film::with_motion(&s, &table).unwrap_err().to_string();
    assert!(message.contains("0.021000 s") && message.contains("drop.csv"), "{message}");
    table.time_s[3] = 0.0;
    assert!(Film::with_motion(&s, &table).unwrap_err().to_string().contains("row 3"));
}

#[test]
fn rates_are_exact_fractions() {
    let base = |rate_hz| Scene { rate_hz, ..scene("") }.time_base().unwrap();
    assert_eq!(base(1000.0), TimeBase { numerator: 1, denominator: 1000 });
    assert_eq!(base(30000.0 / 1001.0), TimeBase { numerator: 1001, denominator: 30000 });
    assert_eq!(base(29.97), TimeBase { numerator: 100, denominator: 2997 });
}

#[test]
fn faults_in_scenes_are_named() {
    let message = |text: &str| Scene::parse(&format!("{HEAD}{text}"), "s.toml").unwrap_err().to_string();
    assert!(
        message("colour = 3\n").starts_with("s.toml, line 5: unknown field `colour`"),
        "{}",
        message("colour = 3\n")
    );
    let negative = ONE_DISC.replace("radius_px = 5.0", "radius_px = -5.0");
    assert!(message(&negative).contains("marker n0, radius_px: a radius of -5 px makes no disc"));
    assert!(message("[camera]\nexposure_s = 0.1\n").contains("longer than the 0.001 s between frames"));
    assert!(message("[camera]\ndepth_bits = 7\n").contains("7 bits"));
    assert!(message(&ONE_DISC.replace("link = \"a\"", "link = \"b\"")).contains("no link \"b\""));
    assert!(
        message("[[hidden]]\nfirst = 1\ncount = 2\nmarkers = [\"n9\"]\n")
            .contains("\"n9\" is no link or marker")
    );
    assert!(
        message("[[link]]\nname = \"a\"\nparent = \"b\"\njoint_px = [0, 0]\n")
            .contains("no link \"b\" is given before it")
    );
}
