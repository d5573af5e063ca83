//! Films written to files and read back: without loss where the codec has none, close where it has some.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a failure here is a failed test")]

use std::path::Path;
use std::process::Command;

use tracker::error::FaultKind;
use tracker::frame::TimeBase;
use tracker::overlay::{self, FilmSettings};
use tracker::pipeline::{Observer, RunSettings, Silent, Stage, run};
use tracker::score::{LIMIT_PX, Tracked, score};
use tracker::setup::{Setup, find};
use tracker::source::{Ending, OpenOptions, open};
use tracker::synth::encode::Codec;
use tracker::synth::scene::{LinkMotion, Marker};
use tracker::synth::{Film, Scene, Truth, View, WriteOptions, preset, write};
use tracker::table::NodeTable;

/// The paper's layout in a small image, 12 frames.
fn scene(depth_bits: u32) -> Scene {
    let mut s = preset("noisy", 7).unwrap();
    s.image_px = [176, 144];
    s.frames = 12;
    s.rate_hz = 1000.0;
    s.links[0].joint_px = [60.0, 20.0];
    s.camera.depth_bits = depth_bits;
    if depth_bits > 8 {
        let gain = f64::from(1u32 << (depth_bits - 8));
        s.camera.read_noise *= gain;
        s.camera.shot_gain *= gain;
        s.camera.black *= gain;
        s.light.background *= gain;
        s.links.iter_mut().for_each(|l| l.level *= gain);
        s.markers.iter_mut().for_each(|m| m.level *= gain);
    }
    s
}

/// Writes, reads back, and gives the largest and the root mean square difference in levels.
fn round_trip(film: &Film, path: &Path, options: &WriteOptions) -> (u32, f64) {
    let mut told = 0;
    write(film, path, options, &mut |done| {
        told = done;
        Ok(())
    })
    .unwrap();
    assert_eq!(told, film.frames());
    let mut source = open(path.to_str().unwrap(), &OpenOptions::default()).unwrap();
    let [w, h] = film.scene().image_px.map(|v| v as usize);
    let deep = film.bytes_per_pixel() == 2;
    let (mut worst, mut squares, mut expected) = (0, 0.0, Vec::new());
    let mut count = 0;
    while let Some(frame) = source.next_frame().unwrap() {
        film.render(count, &mut expected);
        assert_eq!((frame.index, frame.width as usize, frame.height as usize), (count, w, h));
        let seconds = source.info().time_base.seconds(frame.ticks);
        assert!((seconds - film.time_s(count)).abs() < 1e-12, "frame {count} at {seconds} s");
        let plane = frame.plane.as_ref().unwrap().bytes();
        assert_eq!(frame.format, film.format());
        let bytes = w * film.bytes_per_pixel();
        for y in 0..h {
            let (got, want) = (&plane[y * frame.stride..][..bytes], &expected[y * bytes..][..bytes]);
            for k in (0..bytes).step_by(if deep { 2 } else { 1 }) {
                let value = |row: &[u8]| {
                    if deep { u32::from(u16::from_le_bytes([row[k], row[k + 1]])) } else { u32::from(row[k]) }
                };
                let difference = value(got).abs_diff(value(want));
                worst = worst.max(difference);
                squares += f64::from(difference * difference);
            }
        }
        count += 1;
    }
    assert_eq!(source.ending(), Ending::Complete);
    assert_eq!(count, film.frames());
    (worst, (squares / (w * h) as f64 / count as f64).sqrt())
}

#[test]
fn lossless_codecs_give_back_every_bit() {
    let folder = tempfile::tempdir().unwrap();
    let eight = Film::new(&scene(8)).unwrap();
    let twelve = Film::new(&scene(12)).unwrap();
    let sixteen = Film::new(&scene(16)).unwrap();
    for (film, name, codec) in [
        (&eight, "a.mkv", Codec::Ffv1),
        (&eight, "b.avi", Codec::Raw),
        (&eight, "c.avi", Codec::Ffv1),
        (&twelve, "d.mkv", Codec::Ffv1),
        (&sixteen, "e.mkv", Codec::Ffv1),
    ] {
        let options = WriteOptions { codec: Some(codec), ..WriteOptions::default() };
        assert_eq!(round_trip(film, &folder.path().join(name), &options), (0, 0.0), "{name}");
    }
}

#[test]
fn h264_without_loss_is_without_loss() {
    let folder = tempfile::tempdir().unwrap();
    let film = Film::new(&scene(8)).unwrap();
    let options = WriteOptions { quality: Some(0), gray_only: true, ..WriteOptions::default() };
    assert_eq!(round_trip(&film, &folder.path().join("a.mp4"), &options), (0, 0.0));
}

#[test]
fn lossy_codecs_stay_close_and_closer_with_quality() {
    let folder = tempfile::tempdir().unwrap();
    let film = Film::new(&scene(8)).unwrap();
    let noise = film.variance(26.0).sqrt();
    for (name, codec, fine, coarse) in
        [("h.mp4", Codec::H264, 8, 30), ("h.mov", Codec::H264, 8, 30), ("m.avi", Codec::Mjpeg, 1, 20)]
    {
        let rms = |q| {
            let options = WriteOptions { codec: Some(codec), quality: Some(q), ..WriteOptions::default() };
            round_trip(&film, &folder.path().join(format!("{q}{name}")), &options).1
        };
        let (fine, coarse) = (rms(fine), rms(coarse));
        // A fine quantiser keeps most of the noise, a coarse one takes it out: the difference is then the noise.
        assert!(
            fine < 0.5 * noise && fine < coarse && coarse < 2.0 * noise,
            "{name}: {fine} {coarse} {noise}"
        );
    }
}

#[test]
fn truth_tables_say_the_same_in_both_forms() {
    let folder = tempfile::tempdir().unwrap();
    let film = Film::new(&scene(8)).unwrap();
    let truth = Truth::of(&film);
    for name in ["t.parquet", "t.csv"] {
        let path = folder.path().join(name);
        let options = WriteOptions { truth: Some(path.clone()), ..WriteOptions::default() };
        write(&film, &folder.path().join(format!("{name}.avi")), &options, &mut |_| Ok(())).unwrap();
        let read = Truth::read(&path).unwrap();
        assert_eq!(read.nodes, truth.nodes);
        for (a, b) in read.frames.iter().zip(&truth.frames) {
            assert_eq!((a.frame, a.time_s, &a.phi_rad), (b.frame, b.time_s, &b.phi_rad));
            for (p, q) in a.nodes.iter().zip(&b.nodes) {
                assert_eq!((p.x_px, p.y_px, p.visible), (q.x_px, q.y_px, q.visible), "{name}");
            }
        }
        assert_eq!(read.frames.len(), 12);
    }
}

#[test]
fn rates_that_are_no_whole_number_are_kept() {
    let folder = tempfile::tempdir().unwrap();
    let mut s = scene(8);
    s.rate_hz = 30000.0 / 1001.0;
    let film = Film::new(&s).unwrap();
    assert_eq!(film.time_base(), TimeBase { numerator: 1001, denominator: 30000 });
    let options = WriteOptions { quality: Some(0), ..WriteOptions::default() };
    assert_eq!(round_trip(&film, &folder.path().join("a.mp4"), &options).0, 0);
}

/// A scene filmed with pixels of a height in widths.
fn with_pixels_of(height: f64, mut scene: Scene) -> Film {
    scene.camera.view = Some(View { pixel_height: height, ..View::default() });
    Film::new(&scene).unwrap()
}

#[test]
fn films_say_the_shape_of_their_pixels_or_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    // 176 px are shown as 160 and as 220, which Matroska can say.
    for (height, aspect) in [(1.1, "10:11"), (0.8, "5:4"), (1.009, "1:1")] {
        let film = with_pixels_of(height, scene(8));
        for (name, codec) in [
            ("a.mp4", Some(Codec::H264)),
            ("b.mov", Some(Codec::Mjpeg)),
            ("c.mkv", Some(Codec::Ffv1)),
            ("d.avi", Some(Codec::Raw)),
            ("e.avi", Some(Codec::Mjpeg)),
            ("f.mkv", Some(Codec::H264)),
            ("g.y4m", None),
        ] {
            let path = folder.path().join(name);
            let options = WriteOptions { codec, replace: true, ..WriteOptions::default() };
            write(&film, &path, &options, &mut |_| Ok(())).unwrap();
            let said = Command::new(env!("CARGO_BIN_EXE_tracker"))
                .args(["info", "--json"])
                .arg(&path)
                .output()
                .unwrap();
            let facts: serde_json::Value = serde_json::from_slice(&said.stdout).unwrap();
            assert_eq!(facts["pixel_aspect"], aspect, "{name} {height}: {facts}");
            assert_eq!(facts["warnings"], serde_json::json!([]), "{name} {height}");
        }
    }
    let film = with_pixels_of(1.1, scene(8));
    let message = |film: &Film, name: &str| {
        write(film, &folder.path().join(name), &WriteOptions::default(), &mut |_| Ok(()))
            .unwrap_err()
            .to_string()
    };
    for name in ["a.mraw", "a.cih", "a.tif", "%d.tif", "%d.png", "%d.bmp"] {
        let said = message(&film, name);
        assert!(said.contains("cannot say that its pixels 0.9091 wide (10:11)"), "{said}");
    }
    let said = message(&with_pixels_of(1.25, scene(8)), "h.mkv");
    assert!(said.contains("whole pixels, and 176 px of pixels 0.8000 wide (4:5) are 140.80"), "{said}");
}

#[test]
fn markers_and_angles_of_pixels_that_are_not_square_are_those_of_the_scene() {
    let folder = tempfile::tempdir().unwrap();
    for (height, aspect) in [(1.2, "5:6"), (0.75, "4:3")] {
        let mut scene = preset("clean", 52_400).unwrap();
        scene.frames = 240;
        let film = with_pixels_of(height, scene);
        let path = folder.path().join("film.mkv");
        let options = WriteOptions { replace: true, ..WriteOptions::default() };
        write(&film, &path, &options, &mut |_| Ok(())).unwrap();
        for rig in [None, Some(film.rig(0))] {
            let settings = RunSettings {
                input: path.to_str().unwrap().into(),
                rig,
                collect: true,
                ..RunSettings::default()
            };
            let table = run(&settings, &mut Silent).unwrap().table.unwrap();
            let rig = &table.meta.rig;
            assert_eq!((rig.pixel_aspect.to_string().as_str(), rig.nodes.len()), (aspect, 9));
            let s = score(&Tracked::from(&table), &Truth::of(&film), LIMIT_PX).unwrap();
            assert_eq!((s.wrong, s.switches, s.false_positives), (0, 0, 0), "{aspect}");
            // Sigmas are in square pixels, which are as high as the recorded ones; errors across are of recorded widths.
            let ratio = s.error_over_sigma.unwrap();
            assert!((0.7..=1.4).contains(&ratio), "{aspect}: {ratio}");
        }
    }
}

#[test]
fn what_cannot_be_written_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let film = Film::new(&scene(12)).unwrap();
    let message = |name: &str, options: &WriteOptions| {
        write(&film, &folder.path().join(name), options, &mut |_| Ok(())).unwrap_err().to_string()
    };
    let default = WriteOptions::default();
    assert!(message("a.mp4", &default).contains("12 bits do not fit into 8-bit video"));
    assert!(message("a.gif", &default).contains("no film is written to a file that ends in \"gif\""));
    assert!(message("a.png", &default).contains("Number them"));
    assert!(message("a.avi", &default).contains("no video container holds 12 bits uncompressed"));
    assert!(message("%d.bmp", &default).contains("BMP does not hold 12 bits"));
    assert!(message("no/folder/a.mkv", &default).contains("a.mkv"));
    let eight = WriteOptions { bits: Some(8), ..WriteOptions::default() };
    assert!(message("a.mraw", &eight).contains("8 bits per pixel cannot hold a film of 12 bits"));
    let text = WriteOptions { truth: Some(folder.path().join("t.txt")), ..WriteOptions::default() };
    assert!(message("a.mkv", &text).contains(".parquet or .csv"));
    // Options that the form has not, and values that are none.
    let preset = |word: &str| WriteOptions { x264_preset: Some(word.into()), ..WriteOptions::default() };
    let quality = WriteOptions { quality: Some(3), ..WriteOptions::default() };
    let gray = WriteOptions { gray_only: true, ..WriteOptions::default() };
    let codec = WriteOptions { codec: Some(Codec::Raw), ..WriteOptions::default() };
    assert!(message("a.mkv", &preset("fast")).starts_with("x264_preset: it is of H.264 films"));
    assert!(message("a.mp4", &preset("fastest")).contains("Give one of ultrafast, superfast"));
    assert!(message("a.mraw", &quality).starts_with("quality: it is of H.264 and MJPEG films"));
    assert!(message("a.avi", &gray).starts_with("gray_only: it is of H.264 films"));
    assert!(message("a.tif", &codec).starts_with("codec: it is of video files"));
    assert!(message("a.mkv", &eight).starts_with("bits: it is of Photron's .mraw"));
}

/// An encoder moves whole markers by what it spares, which their pixels do not show: their bodies do.
///
/// Prints the table of `docs/validation/detection.md`:
/// `cargo test --release --workspace --test film_files -- codec --nocapture`.
#[test]
fn stated_uncertainties_hold_through_every_codec() {
    let folder = tempfile::tempdir().unwrap();
    println!("| codec, quality | kB | RMS x, y px | error / sigma |");
    println!("|---|---|---|---|");
    let mut wrong = Vec::new();
    for (name, codec, quality, seed) in [
        ("a.mkv", Codec::Ffv1, None, 52_300),
        ("b.mp4", Codec::H264, Some(12), 52_301),
        ("c.mp4", Codec::H264, Some(18), 52_302),
        ("d.mp4", Codec::H264, Some(23), 52_303),
        ("e.mp4", Codec::H264, Some(28), 52_304),
        ("f.avi", Codec::Mjpeg, Some(2), 52_305),
        ("g.avi", Codec::Mjpeg, Some(8), 52_306),
    ] {
        let mut scene = preset("clean", seed).unwrap();
        scene.frames = 240;
        let film = Film::new(&scene).unwrap();
        let path = folder.path().join(name);
        let options = WriteOptions { codec: Some(codec), quality, ..WriteOptions::default() };
        write(&film, &path, &options, &mut |_| Ok(())).unwrap();
        let settings = RunSettings {
            input: path.to_str().unwrap().into(),
            rig: Some(film.rig(0)),
            collect: true,
            ..RunSettings::default()
        };
        let table = run(&settings, &mut Silent).unwrap().table.unwrap();
        let s = score(&Tracked::from(&table), &Truth::of(&film), LIMIT_PX).unwrap();
        let ratio = s.error_over_sigma.unwrap();
        let kb = std::fs::metadata(&path).unwrap().len() / 1000;
        let quality = quality.map_or("lossless".into(), |q| q.to_string());
        println!("| {codec:?}, {quality} | {kb} | {:.4}, {:.4} | {ratio:.2} |", s.rms_x_px, s.rms_y_px);
        if !(0.8..=1.2).contains(&ratio) {
            wrong.push(name);
        }
    }
    assert!(wrong.is_empty(), "{wrong:?}");
}

/// Asks to stop once drawing begins.
#[derive(Default)]
struct StopsDrawing(bool);

impl Observer for StopsDrawing {
    fn stage(&mut self, stage: Stage, _total: Option<u64>) {
        self.0 = stage == Stage::Draw;
    }

    fn interrupted(&mut self) -> bool {
        self.0
    }
}

#[test]
fn an_overlay_without_a_picture_leaves_no_film() {
    let folder = tempfile::tempdir().unwrap();
    let [filmed, drawn] = ["film.mp4", "drawn.mp4"].map(|name| folder.path().join(name));
    let film = Film::new(&scene(8)).unwrap();
    write(&film, &filmed, &WriteOptions::default(), &mut |_| Ok(())).unwrap();
    let input = filmed.display().to_string();
    let settings =
        RunSettings { input: input.clone(), rig: Some(film.rig(0)), collect: true, ..RunSettings::default() };
    let mut table = run(&settings, &mut Silent).unwrap().table.unwrap();
    let draw = |table: &NodeTable, observer: &mut dyn Observer| {
        let (open, settings) = (OpenOptions::default(), FilmSettings::default());
        let outcome = overlay::film(&input, &open, table, &drawn, &settings, observer);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "only the recording is there");
        outcome.unwrap_err().kind()
    };
    assert_eq!(draw(&table, &mut StopsDrawing::default()), FaultKind::Interrupted);
    table.rows.frame.iter_mut().for_each(|frame| *frame += 1000);
    assert_eq!(draw(&table, &mut Silent), FaultKind::Invalid);
}

/// Output of `tracker setup` on a film of `scene`.
fn setup(scene: &Scene) -> Setup {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("film.mp4");
    let options =
        WriteOptions { x264_preset: Some("ultrafast".into()), quality: Some(10), ..WriteOptions::default() };
    write(&Film::new(scene).unwrap(), &path, &options, &mut |_| Ok(())).unwrap();
    let settings = RunSettings { input: path.display().to_string(), ..Default::default() };
    find(&settings, &mut Silent).unwrap()
}

#[test]
fn setup_draws_the_rig_and_tells_what_to_change() {
    let mut scene = preset("clean", 2000).unwrap();
    scene.frames = 300;
    // Every marker is brighter than the camera can tell, and no bar hides what crosses.
    scene.markers.iter_mut().for_each(|m| m.level = 400.0);
    scene.links.iter_mut().for_each(|l| l.width_px = 0.0);
    let found = setup(&scene);
    assert_eq!((found.rig.nodes.len(), found.rig.bodies.len(), found.rig.joints.len()), (9, 2, 2));
    let told = |said: &str| {
        assert!(found.warnings.iter().any(|w| w.to_string().contains(said)), "{:?}", found.warnings)
    };
    told("markers are saturated");
    told("is not at rest");
    told("merge in the picture when their bodies cross");
    assert_eq!(found.picture.size_px(), [720, 720]);

    // One link, too fast for its camera, with two markers as far from the others.
    let mut scene = preset("clean", 2000).unwrap();
    scene.rate_hz = 100.0;
    scene.frames = 120;
    scene.links.truncate(1);
    scene.links[0].motion = Some(LinkMotion::Tumble { phi_rad: 0.0, rate_rad_s: 80.0, frequency_hz: 1.0 });
    scene.markers.truncate(4);
    let layout = [[10.0, 0.0], [110.0, 0.0], [50.0, 20.0], [50.0, -20.0]];
    for (marker, at_px) in scene.markers.iter_mut().zip(layout) {
        *marker = Marker { at_px, link: scene.links[0].name.clone(), ..marker.clone() };
    }
    let found = setup(&scene);
    assert_eq!(found.rig.nodes.len(), 4);
    let told = |said: &str| {
        assert!(found.warnings.iter().any(|w| w.to_string().contains(said)), "{:?}", found.warnings)
    };
    told("have the same distances to its other nodes");
    told("frames a second would do without");
    assert!(
        !found
            .warnings
            .iter()
            .any(|w| w.to_string().contains("saturated") || w.to_string().contains("merge")),
        "{:?}",
        found.warnings
    );
}
