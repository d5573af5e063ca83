//! When frames were taken: coarse ticks, variable rates, gaps, edit lists, slow motion, by files of the real `ffmpeg`.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde_json::Value;
use tracker::frame::RateOrigin;
use tracker::source::{OpenOptions, open};
use tracker::table::{NodeTable, read_table};
use tracker::timing::{Clock, Doubt, Steps, Timing, TimingKind, decide};

use crate::film::{have_ffmpeg, read_all};
use crate::info::info;

/// Runs `ffmpeg`.
fn ffmpeg(arguments: &[&str]) {
    assert!(Command::new("ffmpeg").args(["-v", "error", "-y"]).args(arguments).status().unwrap().success());
}

/// A film of `count` small pictures at `rate` frames per second.
fn made(folder: &Path, name: &str, rate: &str, count: u32, more: &[&str]) -> PathBuf {
    let path = folder.join(name);
    let source = format!("testsrc=size=64x48:rate={rate}");
    let count = count.to_string();
    let mut arguments = vec!["-f", "lavfi", "-i", &source, "-frames:v", &count];
    arguments.extend(more);
    arguments.push(path.to_str().unwrap());
    ffmpeg(&arguments);
    path
}

fn again(folder: &Path, name: &str, from: &Path, more: &[&str]) -> PathBuf {
    let path = folder.join(name);
    let mut arguments = vec!["-i", from.to_str().unwrap()];
    arguments.extend(more);
    arguments.push(path.to_str().unwrap());
    ffmpeg(&arguments);
    path
}

/// Origin of a recording's times and the times themselves, by reading it through.
fn timed(path: &Path) -> (Timing, Vec<f64>) {
    let mut source = open(path.to_str().unwrap(), &OpenOptions::default()).unwrap();
    let ticks: Vec<i64> = read_all(&mut *source).iter().map(|f| f.ticks).collect();
    let mut steps = Steps::default();
    for &t in &ticks {
        steps.push(t);
    }
    let info = source.info();
    let (timing, clock): (Timing, Clock) =
        decide(&steps, info.time_base, info.rate_origin, &info.claims, info.rate_hz).unwrap();
    let times = ticks.iter().zip(0..).map(|(&t, i)| clock.seconds(i, t)).collect();
    (timing, times)
}

/// Root mean square of times minus the truth, less a common offset.
fn rms_s(times: &[f64], truth: impl Fn(usize) -> f64) -> f64 {
    let off: Vec<f64> = times.iter().enumerate().map(|(k, t)| t - truth(k)).collect();
    let mean = off.iter().sum::<f64>() / off.len() as f64;
    (off.iter().map(|o| (o - mean).powi(2)).sum::<f64>() / off.len() as f64).sqrt()
}

#[test]
fn coarse_ticks_give_the_true_times() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let x264 = ["-c:v", "libx264", "-pix_fmt", "yuv420p"];
    for (name, rate, more) in [
        ("a.mkv", "600", &[][..]),
        ("b.mkv", "1500", &[]),
        ("c.webm", "240", &["-c:v", "libvpx", "-deadline", "realtime"]),
        ("d.mov", "240", &["-video_track_timescale", "600"]),
        ("e.mp4", "480", &["-video_track_timescale", "1000"]),
        ("f.mp4", "960", &["-video_track_timescale", "1000"]),
        ("g.flv", "600", &[]),
        ("h.mkv", "30000/1001", &[]),
        ("i.mkv", "2400", &["-c:v", "ffv1"]),
        ("j.mkv", "600", &["-output_ts_offset", "12.3456"]),
        ("k.ts", "240", &[]),
    ] {
        let arguments = [&x264[..], more].concat();
        let path = made(folder.path(), name, rate, 600, &arguments);
        let (timing, times) = timed(&path);
        let (n, d) = rate.split_once('/').unwrap_or((rate, "1"));
        let rate: f64 = n.parse::<f64>().unwrap() / d.parse::<f64>().unwrap();
        assert_eq!(times.len(), 600);
        let rms = rms_s(&times, |k| k as f64 / rate);
        // A millionth of a second is a thousandth of Matroska's tick.
        assert!(rms < 1e-6, "{name}: {rms} s, {timing:?}");
        assert_ne!(timing.kind, TimingKind::Variable, "{name}");
        assert!((timing.rate_hz.unwrap() / rate - 1.0).abs() < 1e-5, "{name}: {timing:?}");
        let (status, out, _) = info(&[path.to_str().unwrap(), "--json"], Stdio::null());
        let value: Value = serde_json::from_str(&out).unwrap();
        assert_eq!((status, &value["frames"]), (0, &Value::from(600)), "{name}");
        assert!((value["rate_hz"].as_f64().unwrap() / rate - 1.0).abs() < 1e-5, "{name}: {out}");
    }
}

#[test]
fn the_last_frame_s_length_changes_no_rate() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    for (name, rate) in [("a.mov", 1000.0), ("b.mp4", 990.0)] {
        let stamps = format!("settb=1/1000000,setpts=N*1000000/{rate}");
        let more =
            ["-vf", &stamps, "-fps_mode", "passthrough", "-enc_time_base", "1/1000000", "-c:v", "mjpeg"];
        let more = [&more[..], &["-video_track_timescale", "1000"]].concat();
        let (timing, _) = timed(&made(folder.path(), name, "100", 400, &more));
        // Every rate that the stamps allow is as likely: up to sqrt(3) standard uncertainties from the middle.
        let most = timing.rate_sigma_hz.map_or(1e-9 * rate, |s| s * 3.1f64.sqrt());
        assert!((timing.rate_hz.unwrap() - rate).abs() <= most, "{name}: {timing:?}");
    }
}

#[test]
fn a_coded_stream_without_a_rate_has_none() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    for (name, rate, more) in [
        ("a.h264", Some(25.0), &["-c:v", "libx264"][..]),
        ("b.hevc", Some(25.0), &["-c:v", "libx265", "-x265-params", "log-level=none"]),
        ("d.mjpeg", None, &["-c:v", "mjpeg", "-pix_fmt", "yuvj420p"]),
        ("e.m2v", Some(25.0), &["-c:v", "mpeg2video"]),
        ("f.hevc", None, &["-c:v", "libx265", "-x265-params", "log-level=none:vui-timing-info=0"]),
        ("g.obu", None, &["-c:v", "libaom-av1", "-cpu-used", "8", "-f", "obu"]),
    ] {
        let path = made(folder.path(), name, "25", 20, more);
        let mut source = open(path.to_str().unwrap(), &OpenOptions::default()).unwrap();
        let ticks: Vec<i64> = read_all(&mut *source).iter().map(|f| f.ticks).collect();
        let info = source.info();
        let origin = if rate.is_some() { RateOrigin::Container } else { RateOrigin::Unknown };
        assert_eq!((info.rate_hz, info.rate_origin), (rate, origin), "{path:?}");
        assert_eq!(ticks.len(), 20);
        if rate.is_none() {
            assert_eq!(ticks, (0..20).collect::<Vec<i64>>());
        }
    }
}

#[test]
fn a_frame_of_about_a_tick_is_no_gap_and_a_gap_is_one() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let select = |left_out: &str| format!("select='not({left_out})'");
    let (one, more) = ("eq(n,200)", "between(n,150,151)+eq(n,60)+between(n,300,306)");
    // H.264's numbers prove that the frames were never in the film; other film in FLV has none.
    let h264 = ["-c:v", "libx264", "-bf", "0", "-preset", "ultrafast"];
    let (jpeg, flash) = (["-c:v", "mjpeg", "-pix_fmt", "yuvj420p"], ["-c:v", "flashsv", "-pix_fmt", "bgr24"]);
    let ms = ["-video_track_timescale", "1000"];
    let (jpeg_ms, ffv1) = ([&jpeg[..], &ms].concat(), ["-c:v", "ffv1"]);
    for (name, rate, left_out, dropped, codec) in [
        ("a.mkv", "834", "0", 0, &ffv1[..]),
        ("b.mkv", "990", "0", 0, &ffv1),
        ("c.flv", "960", "0", 0, &flash),
        ("d.mov", "850", "0", 0, &jpeg_ms),
        ("e.mov", "990", "0", 0, &jpeg_ms),
        ("f.mkv", "1000", one, 1, &ffv1),
        ("g.mkv", "990", one, 1, &ffv1),
        ("h.mkv", "990", more, 10, &ffv1),
        ("i.flv", "900", more, 10, &h264),
        ("j.mkv", "2000", "between(n,100,106)", 7, &ffv1),
        ("k.avi", "990", more, 10, &jpeg),
    ] {
        let select = select(left_out);
        let arguments = [&["-vf", &select, "-fps_mode", "passthrough"][..], codec].concat();
        let path = made(folder.path(), name, rate, 400, &arguments);
        let (timing, _) = timed(&path);
        assert_eq!(timing.lacking, dropped, "{name}: {timing:?}");
        let off = (timing.rate_hz.unwrap() - rate.parse::<f64>().unwrap()).abs();
        assert!(off <= timing.rate_sigma_hz.map_or(1e-9, |s| 1.8 * s), "{name}: {timing:?}");
        let (status, out, _) = info(&[path.to_str().unwrap(), "--count"], Stdio::null());
        assert_eq!(status, 0, "{out}");
        assert_eq!(out.contains("dropped by the recorder"), dropped > 0, "{name}: {out}");
        let words = format!("{dropped} frame{} dropped", if dropped == 1 { " was" } else { "s were" });
        assert!(dropped == 0 || out.contains(&words), "{name}: {out}");
    }
    // Of a short film whose codec has no rate, libavformat gives one frame per tick.
    for count in [20, 60, 119] {
        let (timing, _) = timed(&made(folder.path(), "short.mov", "960", count, &jpeg_ms));
        assert!(timing.rate_from_stamps, "{count}: {timing:?}");
        let off = (timing.rate_hz.unwrap() - 960.0).abs();
        assert!(off <= timing.rate_sigma_hz.map_or(1e-9, |s| 1.8 * s), "{count}: {timing:?}");
    }
}

#[test]
fn short_films_take_the_rate_that_the_container_gives() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    for count in [1, 2, 3, 5] {
        let path = made(folder.path(), &format!("{count}.mkv"), "600", count, &["-c:v", "ffv1"]);
        let (timing, times) = timed(&path);
        assert_eq!(times.len(), count as usize);
        assert!(rms_s(&times, |k| k as f64 / 600.0) < 1e-9, "{times:?}");
        assert_eq!(timing.rate_hz, Some(600.0));
    }
}

#[test]
fn dropped_frames_are_counted_and_keep_their_places() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let drop = "select='not(between(n,50,52)+eq(n,200)+between(n,300,309))'";
    let there = |n: &usize| !((50..=52).contains(n) || *n == 200 || (300..=309).contains(n));
    for (name, rate, more) in [
        ("a.mp4", 60.0, &["-c:v", "libx264"][..]),
        ("b.mkv", 60.0, &["-c:v", "libx264"]),
        ("c.mkv", 600.0, &["-c:v", "ffv1"]),
        ("d.mov", 240.0, &["-c:v", "mjpeg", "-video_track_timescale", "600"]),
    ] {
        let arguments = [&["-vf", drop, "-fps_mode", "vfr"][..], more].concat();
        let path = made(folder.path(), name, &rate.to_string(), 400, &arguments);
        let (timing, times) = timed(&path);
        assert_eq!((timing.gaps, timing.lacking), (3, 14), "{name}: {timing:?}");
        let truth: Vec<usize> = (0..414).filter(there).collect();
        assert!(rms_s(&times, |k| truth[k] as f64 / rate) < 1e-6, "{name}");
        let (_, out, _) = info(&[path.to_str().unwrap()], Stdio::null());
        assert!(out.contains("3 gaps, where 14 frames lack"), "{out}");
    }
}

#[test]
fn a_variable_rate_is_said_with_its_range() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    // 30 frames a second, then slower down to 22.
    let slower = "settb=1/90000,setpts='90000*(N/30+if(gt(N,100),(N-100)*(N-100)*0.00006,0))'";
    for name in ["a.mp4", "b.mkv", "c.mov"] {
        let more =
            ["-vf", slower, "-fps_mode", "passthrough", "-enc_time_base", "1/90000", "-c:v", "libx264"];
        let path = made(folder.path(), name, "30", 200, &more);
        let (timing, times) = timed(&path);
        assert_eq!(timing.kind, TimingKind::Variable, "{name}: {timing:?}");
        let truth = |k: usize| {
            let late = k.saturating_sub(100) as f64;
            k as f64 / 30.0 + late * late * 0.00006
        };
        // What is rounded to whole ticks is spread over one: a standard deviation of a tick over sqrt(12).
        let rms = rms_s(&times, truth);
        assert!(rms < 1.5 * timing.sigma_s, "{name}: {rms}, {timing:?}");
        assert!((timing.sigma_s * 12f64.sqrt() / timing.tick_s - 1.0).abs() < 1e-12);
        let (_, out, _) = info(&[path.to_str().unwrap()], Stdio::null());
        assert!(out.contains("variable frame rate, 2") && out.contains(" to 30"), "{out}");
    }
}

#[test]
fn an_edit_list_leaves_the_frames_that_are_read() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let long = made(
        folder.path(),
        "long.mp4",
        "60",
        240,
        &["-c:v", "libx264", "-g", "60", "-bf", "0", "-pix_fmt", "yuv420p"],
    );
    let name = folder.path().join("cut.mov");
    ffmpeg(&["-ss", "1.5", "-i", long.to_str().unwrap(), "-t", "1", "-c", "copy", name.to_str().unwrap()]);
    let (status, out, _) = info(&[name.to_str().unwrap(), "--json"], Stdio::null());
    let value: Value = serde_json::from_str(&out).unwrap();
    let (timing, times) = timed(&name);
    assert_eq!((status, &value["frames"]), (0, &Value::from(times.len())), "{out}");
    assert_eq!(value["declared_frames"], Value::from(times.len()));
    assert!(value["details"]["edit list"].as_str().unwrap().contains("of the"), "{out}");
    assert_eq!(timing.rate_hz, Some(60.0));
    assert!(rms_s(&times, |k| k as f64 / 60.0) < 1e-6);

    // Played at half and at an eighth of the speed, as slow motion is exported: all frames, at the camera's times.
    for speed in [0x8000u32, 0x2000] {
        let mut bytes = std::fs::read(&long).unwrap();
        let at = bytes.windows(4).position(|w| w == b"elst").unwrap() + 20;
        assert_eq!(bytes[at..at + 4], [0, 1, 0, 0]);
        bytes[at..at + 4].copy_from_slice(&speed.to_be_bytes());
        // The piece is played for longer.
        let duration = u32::from_be_bytes(bytes[at - 8..at - 4].try_into().unwrap());
        let longer = (u64::from(duration) * 0x1_0000 / u64::from(speed)) as u32;
        bytes[at - 8..at - 4].copy_from_slice(&longer.to_be_bytes());
        let name = folder.path().join("slow.mov");
        std::fs::write(&name, bytes).unwrap();
        let (timing, times) = timed(&name);
        assert_eq!((times.len(), timing.rate_hz), (240, Some(60.0)));
        assert!(rms_s(&times, |k| k as f64 / 60.0) < 1e-6);
        let (_, out, _) = info(&[name.to_str().unwrap()], Stdio::null());
        assert!(out.contains("an edit list plays pieces"), "{out}");
    }
}

#[test]
fn a_capture_tag_gives_the_rate_or_is_said_not_to() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let film = made(folder.path(), "plain.mp4", "30", 60, &["-c:v", "libx264", "-pix_fmt", "yuv420p"]);
    for (tag, rate, said) in [
        (
            "240",
            240.0,
            "240 frames per s by the camera's own tag com.android.capture.fps; the file plays at 30",
        ),
        ("120.000000", 120.0, "120 frames per s by the camera's own tag"),
        ("30", 30.0, ""),
        ("24", 30.0, "says 24 frames per s, the time stamps 30: the tag is not used"),
        ("0", 30.0, "is \"0\", which is no rate; it is not used"),
        ("-240", 30.0, "is \"-240\", which is no rate"),
        ("NaN", 30.0, "is \"NaN\", which is no rate"),
        ("inf", 30.0, "is \"inf\", which is no rate"),
        ("fast", 30.0, "is \"fast\", which is no rate"),
    ] {
        let tagged = format!("com.android.capture.fps={tag}");
        let more = ["-c", "copy", "-movflags", "use_metadata_tags", "-metadata", &tagged];
        let path = again(folder.path(), "tagged.mp4", &film, &more);
        let (timing, times) = timed(&path);
        assert!(rms_s(&times, |k| k as f64 / rate) < 1e-12, "{tag}: {timing:?}");
        let (_, out, _) = info(&[path.to_str().unwrap()], Stdio::null());
        assert!(out.contains(said) && out.contains(&format!("{rate} frames per second")), "{tag}: {out}");
        // The user's word is the last.
        let (_, out, _) = info(&[path.to_str().unwrap(), "--fps", "1000", "--json"], Stdio::null());
        let value: Value = serde_json::from_str(&out).unwrap();
        assert_eq!((&value["rate_hz"], &value["rate_origin"]), (&Value::from(1000.0), &Value::from("user")));
    }
    let (timing, _) = timed(&film);
    assert_eq!(timing.doubt, Some(Doubt::Player));
}

#[test]
fn android_s_number_and_sony_s_xml_are_read_from_their_boxes() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let film =
        made(folder.path(), "plain.mp4", "30000/1001", 60, &["-c:v", "libx264", "-pix_fmt", "yuv420p"]);
    // Phones write the tag as a 32-bit float, of type 23; ffmpeg writes four characters of type 1.
    let more = ["-c", "copy", "-movflags", "use_metadata_tags", "-metadata", "com.android.capture.fps=QQQQ"];
    let path = again(folder.path(), "float.mp4", &film, &more);
    let mut bytes = std::fs::read(&path).unwrap();
    let at = bytes.windows(4).position(|w| w == b"QQQQ").unwrap();
    bytes[at - 8..at - 4].copy_from_slice(&23u32.to_be_bytes());
    bytes[at..at + 4].copy_from_slice(&239.76f32.to_be_bytes());
    std::fs::write(&path, bytes).unwrap();
    let (timing, times) = timed(&path);
    assert_eq!(timing.rate_origin, RateOrigin::CaptureTag, "{timing:?}");
    assert!(rms_s(&times, |k| k as f64 * 1001.0 / 240_000.0) < 1e-6);

    let xml = br#"<?xml version="1.0"?><NonRealTimeMeta><VideoFormat><VideoFrame videoCodec="AVC_1920_1080_HP@L42" captureFps="119.88p" formatFps="29.97p"/></VideoFormat></NonRealTimeMeta>"#;
    let boxed = |name: &[u8], body: &[u8]| [&(body.len() as u32 + 8).to_be_bytes()[..], name, body].concat();
    let handler = boxed(b"hdlr", b"\0\0\0\0\0\0\0\0nrtm\0\0\0\0\0\0\0\0\0\0\0\0\0");
    let meta = [&[0; 4][..], &handler, &boxed(b"xml ", &[&[0; 4][..], xml].concat())].concat();
    let sony = [std::fs::read(&film).unwrap(), boxed(b"meta", &meta)].concat();
    let path = folder.path().join("sony.mp4");
    std::fs::write(&path, sony).unwrap();
    let (timing, times) = timed(&path);
    assert_eq!(timing.capture.as_ref().map(|c| (c.tag.as_str(), c.rate_hz)), Some(("captureFps", 119.88)));
    assert!(rms_s(&times, |k| k as f64 * 1001.0 / 120_000.0) < 1e-12, "{timing:?}");
}

#[test]
fn a_table_of_coarse_ticks_is_that_of_fine_ones() {
    if !have_ffmpeg() {
        return;
    }
    // A marker that is hidden at the end gives status 1.
    let tracker = |arguments: &[&str], allowed: &[i32]| {
        let done = Command::new(env!("CARGO_BIN_EXE_tracker")).args(arguments).output().unwrap();
        let error = String::from_utf8_lossy(&done.stderr).into_owned();
        assert!(allowed.contains(&done.status.code().unwrap()), "{arguments:?}: {error}");
        error
    };
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let word = |name: &str| at(name).to_str().unwrap().to_owned();
    let film = |name: &str, fps: &str, status: i32| {
        let (to, rig) = (word(name), word("rig.toml"));
        tracker(
            &[
                "film",
                "--preset",
                "clean",
                "--frame-count",
                "40",
                "--fps",
                fps,
                "-q",
                "--rig",
                &rig,
                "-o",
                &to,
                "--force",
            ],
            &[status],
        )
    };
    // Above 1000 frames a second FFmpeg's Matroska says nothing of the rate.
    let error = film("fast.mkv", "1500", 2);
    assert!(error.contains("too coarse for 1500 frames per s. Name it .mp4 or .mov,"), "{error}");
    assert!(!at("fast.mkv").exists());
    film("fine.mp4", "600", 0);
    let fine = at("fine.mp4");
    again(folder.path(), "coarse.mkv", &fine, &["-c", "copy"]);
    let tags = ["-movflags", "use_metadata_tags", "-metadata", "com.android.capture.fps=600"];
    let slow = ["-bsf:v", "setts=pts=20*PTS:dts=20*DTS"];
    again(folder.path(), "slow.mp4", &fine, &[&["-c", "copy"][..], &slow, &tags].concat());
    let mut tables = Vec::new();
    for (name, notes) in
        [("fine.mp4", &[][..]), ("coarse.mkv", &["rounded to 1 ms"]), ("slow.mp4", &["plays at 30"])]
    {
        let (from, to, rig) = (word(name), word("nodes.parquet"), word("rig.toml"));
        let error = tracker(&["track", &from, "--rig", &rig, "-o", &to, "--force"], &[0, 1]);
        for note in notes {
            assert!(error.contains(note), "{name}: {error}");
        }
        tables.push(read_table(&at("nodes.parquet")).unwrap());
    }
    let kinds: Vec<_> = tables.iter().map(|t| t.meta.time.as_ref().unwrap().kind).collect();
    assert_eq!(kinds, [TimingKind::Even, TimingKind::Grid, TimingKind::Even]);
    for table in &tables {
        assert_eq!(table.meta.source.rate_hz, Some(600.0));
        assert!(rms_s(&table.rows.time_s, |k| k as f64 / 600.0) < 1e-9);
        // Bit for bit, and so NaN too.
        let bits = |t: &NodeTable| t.rows.xy_px.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(table), bits(&tables[0]));
    }

    // Without the tag it is doubted.
    again(folder.path(), "plain.mp4", &fine, &[&["-c", "copy"][..], &slow].concat());
    let (from, to, rig) = (word("plain.mp4"), word("plain.parquet"), word("rig.toml"));
    let error = tracker(&["track", &from, "--rig", &rig, "-o", &to], &[0, 1]);
    assert!(error.contains("every rate is 8 times too small") && error.contains("with --fps"), "{error}");

    // A finished table is gone on with, and the camera's rate by the user replaces all.
    let (from, to, rig) = (word("slow.mp4"), word("nodes.parquet"), word("rig.toml"));
    let error = tracker(&["track", &from, "--rig", &rig, "-o", &to, "--resume"], &[0, 1]);
    assert!(error.contains("was complete already"), "{error}");
    tracker(&["track", &from, "--rig", &rig, "-o", &to, "--force", "--fps", "1200"], &[0, 1]);
    let table = read_table(&at("nodes.parquet")).unwrap();
    assert!(rms_s(&table.rows.time_s, |k| k as f64 / 1200.0) < 1e-12);
}
