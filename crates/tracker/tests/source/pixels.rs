//! Pixel layouts without a luma plane, ranges of values, cropped pictures.

use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

use tracker::frame::SourceInfo;
use tracker::source::{OpenOptions, open};

use crate::film::{HEIGHT, WIDTH, encode, have_ffmpeg, picture, read_all, samples};

const COUNT: usize = 12;

/// Description of a recording, and the samples of all its frames.
fn read(path: &Path) -> (SourceInfo, Vec<Vec<u32>>) {
    let mut source = open(path.to_str().unwrap(), &OpenOptions::default()).unwrap();
    let info = source.info().clone();
    (info, read_all(&mut *source).iter().map(|f| samples(f).unwrap()).collect())
}

fn said(info: &SourceInfo, word: &str) -> String {
    info.details.iter().find(|(w, _)| w == word).map(|(_, v)| v.clone()).unwrap_or_default()
}

#[test]
fn a_colour_mosaic_is_made_brightness_and_says_so() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.nut");
    let mut child = Command::new("ffmpeg")
        .args(["-v", "error", "-f", "rawvideo", "-pix_fmt", "bayer_rggb8", "-framerate", "500"])
        .args(["-video_size", &format!("{WIDTH}x{HEIGHT}"), "-i", "-", "-c:v", "copy"])
        .arg(&path)
        .stdin(Stdio::piped())
        .spawn()
        .unwrap();
    let mut pipe = child.stdin.take().unwrap();
    (0..COUNT).for_each(|i| pipe.write_all(&picture(i)).unwrap());
    drop(pipe);
    assert!(child.wait().unwrap().success());
    let (info, frames) = read(&path);
    assert_eq!(info.converted_from.as_deref(), Some("bayer_rggb8"));
    assert_eq!(frames.len(), COUNT);
    for (i, frame) in frames.iter().enumerate() {
        // A gray scene makes all colours alike. Where all neighbours within 2 px are alike too, so is the result,
        // but for the rounding of three weights.
        let truth = picture(i);
        let mut compared = 0;
        for y in 2..HEIGHT - 2 {
            for x in 2..WIDTH - 2 {
                let value = truth[y * WIDTH + x];
                let flat = (y - 2..=y + 2).all(|v| (x - 2..=x + 2).all(|u| truth[v * WIDTH + u] == value));
                if flat {
                    compared += 1;
                    assert!(frame[y * WIDTH + x].abs_diff(value.into()) <= 1, "frame {i} ({x}, {y})");
                }
            }
        }
        assert!(compared > WIDTH * HEIGHT / 8, "{compared}");
    }
}

#[test]
fn a_palette_is_looked_up() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let lookup = "split[a][b];[a]palettegen=stats_mode=full[p];[b][p]paletteuse=dither=none";
    let path = encode(folder.path(), "a.mkv", COUNT, &["-filter_complex", lookup, "-c:v", "png"]);
    let (info, frames) = read(&path);
    assert_eq!(info.converted_from.as_deref(), Some("pal8"));
    assert_eq!(frames.len(), COUNT);
    for (i, frame) in frames.iter().enumerate() {
        // The film has fewer than 256 levels, so that each has its own entry.
        let worst = frame.iter().zip(picture(i)).map(|(v, t)| v.abs_diff(t.into())).max();
        assert!(worst <= Some(1), "frame {i}: {worst:?}");
    }
}

#[test]
fn both_ranges_are_lent_as_they_are_stored_and_named() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    for (range, tag, name) in [("limited", "tv", "a.mkv"), ("full", "pc", "b.mkv")] {
        let filter = format!("scale=out_range={range},format=yuv420p");
        let arguments = ["-vf", &filter, "-c:v", "ffv1", "-color_range", tag];
        let (info, frames) = read(&encode(folder.path(), name, COUNT, &arguments));
        assert_eq!((said(&info, "range").as_str(), &info.converted_from), (range, &None));
        for (i, frame) in frames.iter().enumerate() {
            for (value, truth) in frame.iter().zip(picture(i)) {
                let stored = match range {
                    "limited" => 16.0 + f64::from(truth) * 219.0 / 255.0,
                    _ => f64::from(truth),
                };
                // The program rounds to the nearest, or one below.
                assert!(
                    (f64::from(*value) - stored).abs() <= 1.0,
                    "{range} frame {i}: {value}, not {stored}"
                );
            }
        }
    }
}

#[test]
fn a_cropped_stream_gives_what_is_left() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let lossless = ["-c:v", "libx264", "-pix_fmt", "gray", "-qp", "0", "-color_range", "pc"];
    let whole = encode(folder.path(), "a.mp4", COUNT, &lossless);
    let cropped = folder.path().join("b.mp4");
    let mut command = Command::new("ffmpeg");
    command.args(["-v", "error", "-i"]).arg(&whole);
    command.args(["-c", "copy", "-bsf:v", "h264_metadata=crop_left=6:crop_top=4"]).arg(&cropped);
    assert!(command.status().unwrap().success());
    let (info, frames) = read(&cropped);
    let (w, h) = (WIDTH - 6, HEIGHT - 4);
    assert_eq!((info.width as usize, info.height as usize, frames.len()), (w, h, COUNT));
    for (i, frame) in frames.iter().enumerate() {
        let truth = picture(i);
        for (at, value) in frame.iter().enumerate() {
            let (x, y) = (at % w + 6, at / w + 4);
            assert_eq!(*value, u32::from(truth[y * WIDTH + x]), "frame {i} ({x}, {y})");
        }
    }
}
