//! Pixels that are not square, as containers, codecs and pictures say it.

use std::path::{Path, PathBuf};
use std::process::Command;

use tracker::pixel_aspect::{AspectOrigin, PixelAspect};
use tracker::source::{OpenOptions, SourceInfo, open};

use crate::film::{HEIGHT, WIDTH, encode, have_ffmpeg};

fn info(path: &Path) -> SourceInfo {
    open(path.to_str().unwrap(), &OpenOptions::default()).unwrap().info().clone()
}

fn said(path: &Path) -> String {
    info(path).pixel_aspect.to_string()
}

/// Pictures that the `ffmpeg` program makes of a film.
fn made(from: &Path, arguments: &[&str], to: &str) -> PathBuf {
    let to = from.with_file_name(to);
    let mut command = Command::new("ffmpeg");
    command.args(["-v", "error", "-y", "-i"]).arg(from).args(arguments).arg(&to);
    assert!(command.status().unwrap().success(), "{arguments:?}");
    to
}

#[test]
fn every_container_and_codec_is_believed() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let h264 = ["-c:v", "libx264", "-preset", "ultrafast", "-pix_fmt", "yuv420p"];
    for (name, ratio, codec) in [
        ("a.mp4", "16/15", &h264[..]),
        ("a.mov", "12/11", &["-c:v", "mjpeg", "-pix_fmt", "yuvj420p"]),
        // Matroska has the width at which it is shown in whole pixels, 224 for 196.
        ("a.mkv", "8/7", &["-c:v", "ffv1"]),
        ("a.avi", "10/11", &["-c:v", "mpeg4"]),
        ("a.ts", "4/3", &h264),
        // Raw H.264: nothing but the stream.
        ("a.h264", "32/27", &h264),
        ("a.y4m", "8/9", &["-pix_fmt", "yuv420p"]),
        ("b.mp4", "1/2", &h264),
    ] {
        let filter = format!("setsar={ratio}");
        let path = encode(folder.path(), name, 4, &[&["-vf", &filter][..], codec].concat());
        let seen = info(&path);
        assert_eq!(seen.pixel_aspect.to_string(), ratio.replace('/', ":"), "{name}");
        assert_eq!(seen.pixel_aspect_origin, AspectOrigin::Recording);
        assert_eq!((seen.width as usize, seen.height as usize), (WIDTH, HEIGHT), "recorded pixels");
    }
    // MPEG-2 has the shape of the picture, 4:3, not that of a pixel.
    let mpeg2 = ["-r", "25", "-c:v", "mpeg2video", "-aspect", "4:3"];
    let path = encode(folder.path(), "a.mpg", 60, &mpeg2);
    let expected = 4.0 / 3.0 * HEIGHT as f64 / WIDTH as f64;
    assert!((info(&path).pixel_aspect.ratio() / expected - 1.0).abs() < 1e-6);

    // Nothing said, or said to be unknown, is square; a ratio of a pixel in a thousand is rounding.
    for ratio in ["0/1", "1/1", "1000/1001"] {
        let filter = format!("setsar={ratio}:max=10000");
        let path = encode(folder.path(), "c.mp4", 2, &[&["-vf", &filter][..], &h264].concat());
        assert_eq!(said(&path), "1:1", "{ratio}");
        assert!(info(&path).warnings.is_empty());
    }
}

#[test]
fn a_turn_swaps_the_ratio_and_the_container_is_before_the_codec() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let arguments = ["-vf", "setsar=4/3", "-c:v", "libx264", "-pix_fmt", "yuv420p"];
    let path = encode(folder.path(), "a.mov", 4, &arguments);
    for (degrees, ratio) in [("90", "3:4"), ("180", "4:3"), ("270", "3:4")] {
        let rotate = format!("rotate={degrees}");
        let turned = made(&path, &["-c", "copy", "-metadata:s:v", &rotate], "turned.mov");
        assert_eq!(said(&turned), ratio, "{degrees} degrees");
    }
    // The box says one thing, the stream another.
    let shape = format!("{}:{}", 16 * WIDTH, 15 * HEIGHT);
    let other = made(&path, &["-c", "copy", "-aspect", &shape], "other.mp4");
    // FFmpeg keeps the shape of the picture in numbers of some ten thousand at most.
    let aspect = info(&other).pixel_aspect;
    assert!((aspect.ratio() * 15.0 / 16.0 - 1.0).abs() < 1e-3, "{aspect}");
    let warnings: Vec<String> = info(&other).warnings.iter().map(ToString::to_string).collect();
    assert!(
        warnings.iter().any(|w| w.contains(&aspect.to_string()) && w.contains("the coded film 4:3")),
        "{warnings:?}"
    );
}

#[test]
fn what_cannot_be_is_said_and_what_is_given_comes_first() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let arguments = ["-vf", "setsar=4/3", "-c:v", "mjpeg", "-pix_fmt", "yuvj420p"];
    let path = encode(folder.path(), "a.mov", 2, &arguments);
    for [width, height] in [[1000, 1], [1, 1000], [9, 2]] {
        // FFmpeg's encoders write no such thing, but a container may hold anything.
        let mut bytes = std::fs::read(&path).unwrap();
        let at = bytes.windows(4).position(|w| w == b"pasp").unwrap() + 4;
        bytes[at..at + 4].copy_from_slice(&u32::to_be_bytes(width));
        bytes[at + 4..at + 8].copy_from_slice(&u32::to_be_bytes(height));
        std::fs::write(&path, bytes).unwrap();
        let seen = info(&path);
        assert_eq!(seen.pixel_aspect, PixelAspect::SQUARE, "{width}:{height}");
        let expected = format!("its pixels are {width} wide and {height} high");
        assert!(
            seen.warnings.iter().any(|w| w.to_string().contains(&expected)),
            "{width}:{height}: {:?}",
            seen.warnings
        );
        let given: PixelAspect = "16:15".parse().unwrap();
        let options = OpenOptions { pixel_aspect: Some(given), ..OpenOptions::default() };
        let source = open(path.to_str().unwrap(), &options).unwrap();
        assert_eq!(source.info().pixel_aspect, given);
        assert_eq!(source.info().pixel_aspect_origin, AspectOrigin::User);
    }
}

/// Checksum of a PNG file's chunk, its type and its content (ISO 3309).
fn checksum(bytes: &[u8]) -> u32 {
    let step = |crc: u32, _| if crc & 1 == 1 { 0xedb8_8320 ^ (crc >> 1) } else { crc >> 1 };
    !bytes.iter().fold(u32::MAX, |crc, b| (0..8).fold(crc ^ u32::from(*b), step))
}

#[test]
fn pictures_say_it_by_their_resolutions() {
    if !have_ffmpeg() {
        return;
    }
    for (ratio, ending) in [("16/15", "tif"), ("1/2", "tif"), ("1/1", "tif"), ("1/1", "png")] {
        let folder = tempfile::tempdir().unwrap();
        let filter = format!("setsar={ratio}");
        let name = format!("a_%03d.{ending}");
        encode(folder.path(), &name, 3, &["-vf", &filter, "-pix_fmt", "gray"]);
        assert_eq!(said(folder.path()), ratio.replace('/', ":"), "{ending}");
        if ending == "tif" {
            let page = folder.path().join("a_001.tif");
            assert_eq!(said(&page), ratio.replace('/', ":"), "a TIFF file by itself");
        }
    }
    let folder = tempfile::tempdir().unwrap();
    encode(folder.path(), "a_%03d.png", 3, &["-vf", "setsar=4/3", "-pix_fmt", "gray"]);
    // FFmpeg's order is not that of the PNG specification, so that its ratio may be either.
    assert_eq!(said(folder.path()), "1:1");
    let warnings: Vec<String> = info(folder.path()).warnings.iter().map(ToString::to_string).collect();
    assert!(warnings.iter().any(|w| w.contains("3:4 (width:height)") && w.contains("(4:3)")), "{warnings:?}");
    // Pixels for a metre, as cameras and image programs write them: 3000 across, 4000 down.
    for picture in std::fs::read_dir(folder.path()).unwrap() {
        let path = picture.unwrap().path();
        let mut bytes = std::fs::read(&path).unwrap();
        let at = bytes.windows(4).position(|w| w == b"pHYs").unwrap();
        bytes[at + 4..at + 8].copy_from_slice(&3000_u32.to_be_bytes());
        bytes[at + 8..at + 12].copy_from_slice(&4000_u32.to_be_bytes());
        bytes[at + 12] = 1;
        let sum = checksum(&bytes[at..at + 13]);
        bytes[at + 13..at + 17].copy_from_slice(&sum.to_be_bytes());
        std::fs::write(&path, bytes).unwrap();
    }
    assert_eq!(said(folder.path()), "4:3");
}
