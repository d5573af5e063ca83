//! Pictures in files have the brightness that OpenCV reads in them: an independent reader of PNG, BMP, PGM and JPEG.

use std::path::Path;

use opencv::core::{Mat, Vector};
use opencv::prelude::{MatTraitConst, MatTraitConstManual};
use opencv::{imgcodecs, imgproc};
use tracker::source::{OpenOptions, open};

use crate::film::{read_all, samples};

const ROWS: usize = 37;
const COLUMNS: usize = 53;

/// Samples of some channels: a slope in each, and noise in the lowest bits.
fn drawn(channels: usize, most: u32) -> Vec<u32> {
    let mut state = 12345u32;
    let mut noise = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        state >> 28
    };
    let slope = |row: usize, k: usize| (3 * row + 2 * k + 60 * (k % channels)) % 230;
    let all = (0..ROWS * COLUMNS * channels).map(|i| (i / (COLUMNS * channels), i % (COLUMNS * channels)));
    all.map(|(row, k)| slope(row, k) as u32 * (most / 255) + noise()).collect()
}

/// A picture of 8 or 16 bits as a file of the kind that an ending names.
fn coded(ending: &str, channels: usize, depth_bits: u32) -> Vec<u8> {
    let values = drawn(channels, (1 << depth_bits) - 1);
    if depth_bits == 8 {
        let samples: Vec<u8> = values.iter().map(|v| *v as u8).collect();
        file(ending, channels, &Mat::from_slice(&samples).unwrap())
    } else {
        let samples: Vec<u16> = values.iter().map(|v| *v as u16).collect();
        file(ending, channels, &Mat::from_slice(&samples).unwrap())
    }
}

/// Samples in one row as a picture in a file.
fn file(ending: &str, channels: usize, row: &impl MatTraitConst) -> Vec<u8> {
    let picture = row.reshape(channels as i32, ROWS as i32).unwrap();
    let mut bytes = Vector::<u8>::new();
    assert!(imgcodecs::imencode_def(ending, &picture, &mut bytes).unwrap());
    bytes.iter().collect()
}

/// Brightness as OpenCV reads it.
fn by_opencv(bytes: &[u8]) -> Vec<u32> {
    let read = imgcodecs::imdecode(&Vector::<u8>::from_slice(bytes), imgcodecs::IMREAD_UNCHANGED).unwrap();
    let mut gray = Mat::default();
    match read.channels() {
        1 => read.copy_to(&mut gray).unwrap(),
        3 => imgproc::cvt_color_def(&read, &mut gray, imgproc::COLOR_BGR2GRAY).unwrap(),
        _ => imgproc::cvt_color_def(&read, &mut gray, imgproc::COLOR_BGRA2GRAY).unwrap(),
    }
    if gray.depth() == opencv::core::CV_8U {
        gray.data_typed::<u8>().unwrap().iter().map(|v| u32::from(*v)).collect()
    } else {
        gray.data_typed::<u16>().unwrap().iter().map(|v| u32::from(*v)).collect()
    }
}

/// Brightness as we read it, and what it was made of.
fn read(folder: &Path, ending: &str, bytes: &[u8]) -> (Vec<u32>, Option<String>) {
    let path = folder.join(format!("f000{ending}"));
    std::fs::write(&path, bytes).unwrap();
    let mut source = open(folder.to_str().unwrap(), &OpenOptions::default()).unwrap();
    let frames = read_all(&mut *source);
    std::fs::remove_file(path).unwrap();
    (samples(&frames[0]).unwrap(), source.info().converted_from.clone())
}

#[test]
fn pictures_without_loss_have_the_same_bits() {
    let folder = tempfile::tempdir().unwrap();
    for (ending, channels, depth_bits) in [
        (".png", 1, 8),
        (".png", 3, 8),
        (".png", 4, 8),
        (".png", 1, 16),
        (".png", 3, 16),
        (".png", 4, 16),
        (".bmp", 1, 8),
        (".bmp", 3, 8),
    ] {
        let bytes = coded(ending, channels, depth_bits);
        let (ours, from) = read(folder.path(), ending, &bytes);
        assert!(ours == by_opencv(&bytes), "{ending} of {channels} channels of {depth_bits} bits");
        assert_eq!(from, (channels > 1).then(|| format!("{channels} channels")), "{ending}");
    }
}

#[test]
fn samples_that_do_not_fill_their_bits_stay_as_they_are() {
    let folder = tempfile::tempdir().unwrap();
    for most in [100u32, 255, 1023, 4095, 65535] {
        let values: Vec<u32> = (0..=49).map(|k| k * most / 49).collect();
        let wide = |v: &u32| if most > 255 { (*v as u16).to_be_bytes().to_vec() } else { vec![*v as u8] };
        let words: Vec<String> = values.iter().map(ToString::to_string).collect();
        for (head, data) in [
            (format!("P5\n# of a camera\n10 5\n{most}\n"), values.iter().flat_map(wide).collect()),
            (format!("P2 10 5\n#12\n{most}\n"), [words.join(" "), "\n".into()].concat().into_bytes()),
        ] {
            let bytes: Vec<u8> = [head.as_bytes(), &data[..]].concat();
            let (ours, from) = read(folder.path(), ".pgm", &bytes);
            assert!((ours, from) == (values.clone(), None), "{head}");
            // OpenCV stretches those that are written as words.
            assert!(head.starts_with("P2") || by_opencv(&bytes) == values, "{head}");
        }
    }
}

#[test]
fn jpeg_pictures_differ_by_what_rounding_does() {
    let folder = tempfile::tempdir().unwrap();
    for channels in [1, 3] {
        let bytes = coded(".jpg", channels, 8);
        let (ours, from) = read(folder.path(), ".jpg", &bytes);
        let theirs = by_opencv(&bytes);
        // The inverse transform is rounded to a level by each reader; OpenCV goes to red, green and blue and back besides, which
        // rounds three colours (0.5 each, weights of sum 1) and their sum.
        let most = if channels == 1 { 1 } else { 2 };
        let off = ours.iter().zip(&theirs).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
        assert!(off <= most, "{channels} channels: {off} levels");
        // Of colours the brightness is stored as it is.
        assert_eq!(from, None);
    }
}
