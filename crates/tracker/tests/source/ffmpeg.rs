//! Compressed film: every codec a lab uses, order, times, ends and damage.

use std::process::Stdio;

use serde_json::Value;
use tracker::frame::{Ending, PixelFormat, RateOrigin};
use tracker::source::{OpenOptions, open};

use crate::film::{HEIGHT, WIDTH, encode, have_ffmpeg, index_of, picture, read_all, real, samples};

/// Frames and values that a codec's file must give.
struct Case {
    file: &'static str,
    arguments: &'static [&'static str],
    format: PixelFormat,
    depth_bits: u32,
    /// Greatest root-mean-square difference from the picture, in 8-bit units; 0 is exact.
    rms: f64,
    converted: bool,
}

const fn case(file: &'static str, arguments: &'static [&'static str]) -> Case {
    Case { file, arguments, format: PixelFormat::Gray8, depth_bits: 8, rms: 0.0, converted: false }
}

const fn lossy(file: &'static str, arguments: &'static [&'static str]) -> Case {
    // Ringing around the disc's sharp edge at these qualities stays below 6 of 255.
    Case { rms: 6.0, ..case(file, arguments) }
}

const FULL: &str = "scale=out_range=full,format=yuvj420p";

/// Every codec, container and pixel layout; values are compared where the codec keeps them.
const CASES: &[Case] = &[
    lossy("b.mp4", &["-vf", FULL, "-c:v", "libx264", "-crf", "10", "-bf", "3", "-g", "20"]),
    lossy("b.avi", &["-vf", FULL, "-c:v", "libx264", "-crf", "10", "-bf", "3", "-g", "20"]),
    lossy("b.h264", &["-vf", FULL, "-c:v", "libx264", "-crf", "10", "-bf", "3", "-g", "20"]),
    lossy("b.ts", &["-vf", FULL, "-c:v", "libx264", "-crf", "10", "-bf", "3", "-g", "20"]),
    case("q0.mkv", &["-c:v", "libx264", "-pix_fmt", "gray", "-qp", "0", "-color_range", "pc"]),
    lossy("hevc.mov", &["-vf", FULL, "-c:v", "libx265", "-crf", "10", "-x265-params", "log-level=none"]),
    lossy("mjpeg.avi", &["-vf", FULL, "-c:v", "mjpeg", "-q:v", "2"]),
    case("ffv1.mkv", &["-c:v", "ffv1"]),
    case("ffv1.avi", &["-c:v", "ffv1"]),
    case("gray.avi", &["-c:v", "rawvideo", "-pix_fmt", "gray"]),
    case("gray.mkv", &["-c:v", "rawvideo", "-pix_fmt", "gray"]),
    case("gray.y4m", &["-pix_fmt", "gray", "-strict", "-1"]),
    case("png.mov", &["-c:v", "png"]),
    case("huff.avi", &["-c:v", "ffvhuff", "-pix_fmt", "gray"]),
    Case {
        format: PixelFormat::Gray16,
        depth_bits: 16,
        ..case("gray16.mkv", &["-c:v", "ffv1", "-pix_fmt", "gray16le"])
    },
    Case {
        format: PixelFormat::Gray16,
        depth_bits: 12,
        ..case("gray12.mkv", &["-c:v", "ffv1", "-pix_fmt", "gray12le"])
    },
    Case {
        format: PixelFormat::Gray16,
        depth_bits: 10,
        ..lossy("prores.mov", &["-vf", "scale=out_range=full", "-c:v", "prores_ks", "-profile:v", "3"])
    },
    Case {
        format: PixelFormat::Gray16,
        depth_bits: 16,
        converted: true,
        ..case("png16.mov", &["-c:v", "png", "-pix_fmt", "gray16be"])
    },
    Case { converted: true, ..case("rgb.mkv", &["-c:v", "ffv1", "-pix_fmt", "bgr0"]) },
    Case { converted: true, ..case("bgr.avi", &["-c:v", "rawvideo", "-pix_fmt", "bgr24"]) },
    Case { converted: true, ..case("gbr.mkv", &["-c:v", "libx264rgb", "-qp", "0"]) },
    Case {
        converted: true,
        ..case("yuyv.avi", &["-vf", "scale=out_range=full", "-c:v", "rawvideo", "-pix_fmt", "yuyv422"])
    },
];

/// A sample in 8-bit units. FFmpeg widens gray to d bits by shifting (planar YUV) or by repeating bits (gray16).
fn to_eight(value: u32, depth_bits: u32) -> f64 {
    f64::from(value >> (depth_bits - 8))
}

#[test]
fn every_codec_gives_every_frame_in_order_with_its_time() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    const COUNT: usize = 48;
    for case in CASES {
        let path = encode(folder.path(), case.file, COUNT, case.arguments);
        let mut source = open(path.to_str().unwrap(), &OpenOptions::default()).unwrap();
        let info = source.info().clone();
        assert_eq!((info.width, info.height), (WIDTH as u32, HEIGHT as u32), "{}", case.file);
        assert_eq!((info.format, info.depth_bits), (case.format, case.depth_bits), "{}", case.file);
        assert_eq!(info.converted_from.is_some(), case.converted, "{}: {:?}", case.file, info.converted_from);
        let frames = read_all(&mut *source);
        assert_eq!(frames.len(), COUNT, "{}", case.file);
        assert_eq!(source.ending(), Ending::Complete, "{}", case.file);
        let first = info.time_base.seconds(frames[0].ticks);
        for (i, frame) in frames.iter().enumerate() {
            assert_eq!(frame.index, i as u64, "{}", case.file);
            let pixels = samples(frame).unwrap_or_else(|| panic!("{} frame {i} has no plane", case.file));
            let peak = (1 << case.depth_bits) - 1;
            assert_eq!(index_of(&pixels, peak), Some(i), "{}", case.file);
            let truth = picture(i);
            let square: f64 = pixels
                .iter()
                .zip(&truth)
                .map(|(&v, &t)| (to_eight(v, case.depth_bits) - f64::from(t)).powi(2))
                .sum::<f64>()
                / truth.len() as f64;
            assert!(square.sqrt() <= case.rms, "{} frame {i}: rms {}", case.file, square.sqrt());
            let time = info.time_base.seconds(frame.ticks) - first;
            // Matroska's ticks are 1 ms, all others finer or exact.
            assert!((time - i as f64 * 0.002).abs() <= 0.000_501, "{} frame {i}: {time} s", case.file);
        }
        let (status, out, err) =
            crate::info::info(&[path.to_str().unwrap(), "--json", "--count"], Stdio::null());
        assert_eq!((status, err.as_str()), (0, ""), "{}: {out}", case.file);
        let told: Value = serde_json::from_str(&out).unwrap();
        assert_eq!(told["decoded_frames"], COUNT, "{}", case.file);
        let brightest = told["brightest"].as_u64().unwrap() as u32;
        assert!(
            (to_eight(brightest, case.depth_bits) - 220.0).abs() <= 4.0 * case.rms,
            "{}: {told}",
            case.file
        );
    }
}

#[test]
fn the_rate_of_the_user_replaces_all_stamps_exactly() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = encode(folder.path(), "a.mp4", 10, &["-c:v", "libx264"]);
    let options = OpenOptions { fps: Some(29.97), ..OpenOptions::default() };
    let mut source = open(path.to_str().unwrap(), &options).unwrap();
    let info = source.info().clone();
    assert_eq!(info.rate_origin, RateOrigin::User);
    for frame in read_all(&mut *source) {
        assert_eq!(frame.ticks, frame.index as i64);
        let expected = frame.index as f64 * 1001.0 / 30000.0;
        assert!((info.time_base.seconds(frame.ticks) - expected).abs() < 1e-15);
    }
}

#[test]
fn a_ball_toss_has_its_32_frames() {
    let Some(path) = real("balltoss/BallTossOut.mp4") else { return };
    let mut source = open(path.to_str().unwrap(), &OpenOptions::default()).unwrap();
    assert_eq!((source.info().width, source.info().height), (640, 480));
    assert_eq!(source.info().declared_frames, Some(32));
    let frames = read_all(&mut *source);
    assert_eq!(frames.len(), 32);
    assert!(frames.iter().all(|f| f.plane.is_some()));
}

#[test]
fn a_device_is_opened_only_if_asked() {
    let error = open("/dev/zero", &OpenOptions::default()).err().unwrap().to_string();
    assert!(error.contains("allow_protocol"), "{error}");
}
