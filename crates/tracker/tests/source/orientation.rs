//! Pictures that say how they are to be turned: the tag Orientation in TIFF, JPEG and PNG. And what changes in mid-film.

use std::fs::File;
use std::path::{Path, PathBuf};

use opencv::core::{Mat, Vector};
use opencv::imgcodecs;
use opencv::prelude::{MatTraitConst, MatTraitConstManual};
use tiff::encoder::{Rational, TiffEncoder, colortype};
use tiff::tags::Tag;
use tracker::frame::FrameSource;
use tracker::source::{OpenOptions, open};

use crate::film::{HEIGHT, WIDTH, encode, have_ffmpeg, picture, read_all, samples};

fn source(path: &Path) -> Box<dyn FrameSource> {
    open(path.to_str().unwrap(), &OpenOptions::default()).unwrap()
}

/// Size and samples of the first frame, and all that is warned of.
fn first(path: &Path) -> ((u32, u32), Vec<u32>, String) {
    let mut source = source(path);
    let frame = source.next_frame().unwrap().unwrap();
    let warnings: Vec<String> = source.info().warnings.iter().map(ToString::to_string).collect();
    assert_eq!((frame.width, frame.height), (source.info().width, source.info().height));
    ((frame.width, frame.height), samples(&frame).unwrap(), warnings.join("; "))
}

/// The error that reading ends with.
fn refusal(path: &Path, options: &OpenOptions) -> String {
    let mut source = open(path.to_str().unwrap(), options).unwrap();
    loop {
        match source.next_frame() {
            Ok(Some(_)) => {}
            Ok(None) => return String::new(),
            Err(e) => return e.to_string(),
        }
    }
}

/// An EXIF block with nothing but the tag.
fn exif(number: u16, big_endian: bool) -> Vec<u8> {
    let short = |v: u16| if big_endian { v.to_be_bytes() } else { v.to_le_bytes() };
    let long = |v: u32| if big_endian { v.to_be_bytes() } else { v.to_le_bytes() };
    let mut block = if big_endian { b"MM\0*".to_vec() } else { b"II*\0".to_vec() };
    block.extend(long(8));
    block.extend([short(1), short(0x0112), short(3)].concat());
    block.extend(long(1));
    block.extend([short(number), short(0)].concat());
    block.extend(long(0));
    block
}

/// A JPEG or PNG picture, coded by OpenCV.
fn coded(ending: &str) -> Vec<u8> {
    let pixels = picture(3);
    let mat = Mat::from_slice(&pixels).unwrap();
    let mat = mat.reshape(1, HEIGHT as i32).unwrap();
    let mut bytes = Vector::<u8>::new();
    assert!(imgcodecs::imencode_def(ending, &mat, &mut bytes).unwrap());
    bytes.iter().collect()
}

fn jpeg(number: u16, big_endian: bool) -> Vec<u8> {
    let mut bytes = coded(".jpg");
    let block = [&b"Exif\0\0"[..], &exif(number, big_endian)].concat();
    let length = (block.len() as u16 + 2).to_be_bytes();
    bytes.splice(2..2, [&[0xff, 0xe1][..], &length, &block].concat());
    bytes
}

fn png(number: u16, behind: bool) -> Vec<u8> {
    let mut bytes = coded(".png");
    let data = [&b"eXIf"[..], &exif(number, behind)].concat();
    let length = (data.len() as u32 - 4).to_be_bytes();
    let chunk = [&length[..], &data, &crc32fast::hash(&data).to_be_bytes()].concat();
    // Behind the header, or before the end.
    let at = if behind { bytes.len() - 12 } else { 33 };
    bytes.splice(at..at, chunk);
    bytes
}

/// A TIFF file of gray pages, each with its tag and pixels for one length across.
fn tiff(path: &Path, pages: &[(u16, u32)]) {
    let mut file = TiffEncoder::new(File::create(path).unwrap()).unwrap();
    for (number, across) in pages {
        let mut image = file.new_image::<colortype::Gray8>(WIDTH as u32, HEIGHT as u32).unwrap();
        image.x_resolution(Rational { n: *across, d: 1 });
        image.y_resolution(Rational { n: 100, d: 1 });
        image.encoder().write_tag(Tag::Orientation, *number).unwrap();
        image.write_data(&picture(3)).unwrap();
    }
}

/// The picture as the standard shows it: where in the stored one the pixel at (x, y) of the shown one is.
fn seen(stored: &[u32], number: u16) -> ((u32, u32), Vec<u32>) {
    let (w, h) = (WIDTH, HEIGHT);
    let (across, down) = if (5..=8).contains(&number) { (h, w) } else { (w, h) };
    let from = |x: usize, y: usize| match number {
        2 => (w - 1 - x, y),
        3 => (w - 1 - x, h - 1 - y),
        4 => (x, h - 1 - y),
        5 => (y, x),
        6 => (y, h - 1 - x),
        7 => (w - 1 - y, h - 1 - x),
        8 => (w - 1 - y, x),
        _ => (x, y),
    };
    let pixel = |(x, y): (usize, usize)| stored[y * w + x];
    let shown = (0..down).flat_map(|y| (0..across).map(move |x| (x, y))).map(|(x, y)| pixel(from(x, y)));
    ((across as u32, down as u32), shown.collect())
}

#[test]
fn pictures_are_turned_as_viewers_turn_them() {
    let folder = tempfile::tempdir().unwrap();
    let stored: Vec<u32> = picture(3).iter().map(|v| u32::from(*v)).collect();
    // 0 and 9 are no orientations.
    for number in 0..=9u16 {
        let expected = seen(&stored, number);
        let is_turned = (2..=8).contains(&number);
        let words = if is_turned { "turned as the file says: " } else { "" };
        for behind in [false, true] {
            let path = folder.path().join("a.png");
            std::fs::write(&path, png(number, behind)).unwrap();
            let (size, pixels, warnings) = first(&path);
            assert!((size, pixels) == expected, "PNG {number}");
            assert!(
                warnings.contains(words) && warnings.contains("turned") == is_turned,
                "{number}: {warnings}"
            );
        }
        let path = folder.path().join("a.tif");
        tiff(&path, &[(number, 100); 2]);
        let mut stack = source(&path);
        assert_eq!(stack.sample(2).unwrap().len(), 2);
        for frame in read_all(&mut *stack) {
            let found = ((frame.width, frame.height), samples(&frame).unwrap());
            assert!(found == expected, "TIFF {number}");
        }
        for big_endian in [false, true] {
            let bytes = jpeg(number, big_endian);
            let (_kept, path) = folder_of(std::slice::from_ref(&bytes), "jpg");
            let (size, pixels, _) = first(&path);
            // Alone, without its folder.
            assert_eq!(first(&path.join("a_000.jpg")).0, size, "JPEG {number}");
            // OpenCV turns by the tag of a JPEG unless it is told not to.
            let shown =
                imgcodecs::imdecode(&Vector::<u8>::from_slice(&bytes), imgcodecs::IMREAD_GRAYSCALE).unwrap();
            let by_opencv: Vec<u32> = shown.data_bytes().unwrap().iter().map(|v| u32::from(*v)).collect();
            assert_eq!(size, (shown.cols() as u32, shown.rows() as u32), "JPEG {number}");
            // Each reader rounds the inverse transform to a level.
            let off = pixels.iter().zip(&by_opencv).map(|(a, b)| a.abs_diff(*b)).max();
            assert!(off <= Some(1), "JPEG {number}: {off:?} levels");
            assert_eq!(size, expected.0);
        }
    }
}

#[test]
fn a_tag_that_is_cut_or_wild_turns_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.jpg");
    let whole = jpeg(6, false);
    for at in 2..40 {
        let mut bytes = whole.clone();
        bytes[at] = 0xfe;
        std::fs::write(&path, &bytes).unwrap();
        // Refused, or read turned or not; no panic.
        if let Ok(mut source) = open(path.to_str().unwrap(), &OpenOptions::default()) {
            let frame = source.next_frame().unwrap().unwrap();
            assert_eq!(u64::from(frame.width) * u64::from(frame.height), (WIDTH * HEIGHT) as u64);
        }
    }
}

/// Pictures in a folder, by their bytes.
fn folder_of(pictures: &[Vec<u8>], ending: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    for (i, bytes) in pictures.iter().enumerate() {
        std::fs::write(folder.path().join(format!("a_{i:03}.{ending}")), bytes).unwrap();
    }
    let path = folder.path().to_owned();
    (folder, path)
}

#[test]
fn a_picture_to_be_turned_otherwise_than_the_others_is_refused_by_its_name() {
    for other in [1, 3, 8] {
        let mut pictures = vec![jpeg(6, false); 12];
        pictures[7] = jpeg(other, false);
        let (_folder, path) = folder_of(&pictures, "jpg");
        let said = refusal(&path, &OpenOptions::default());
        assert!(said.contains("a_007.jpg, frame 7: its tag Orientation says"), "{said}");
        assert!(said.contains("that of the others 90 degrees clockwise"), "{said}");
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    tiff(&path, &[(1, 100), (1, 100), (3, 100)]);
    let said = refusal(&path, &OpenOptions::default());
    assert!(
        said.contains("frame 2: its tag Orientation says 180 degrees, that of the others not turned"),
        "{said}"
    );
}

#[test]
fn pixels_of_another_shape_in_mid_film_are_refused_unless_one_shape_is_given() {
    let given = OpenOptions { pixel_aspect: Some("4:3".parse().unwrap()), ..OpenOptions::default() };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    tiff(&path, &[(1, 100), (1, 100), (1, 75)]);
    let said = refusal(&path, &OpenOptions::default());
    assert!(said.contains("frame 2: its pixels are 4:3 (width:height), those of the others 1:1"), "{said}");
    assert_eq!(refusal(&path, &given), "");
    // A turned picture's pixels are turned with it.
    tiff(&path, &[(6, 75), (6, 75)]);
    assert_eq!(source(&path).info().pixel_aspect.to_string(), "3:4");
    assert_eq!(refusal(&path, &OpenOptions::default()), "");
    if !have_ffmpeg() {
        return;
    }
    let h264 = |ratio: &str| {
        let filter = format!("setsar={ratio}");
        let arguments = ["-vf", &filter, "-c:v", "libx264", "-preset", "ultrafast", "-bf", "0"];
        std::fs::read(encode(folder.path(), "part.h264", 10, &arguments)).unwrap()
    };
    for (first, second, words) in
        [("1/1", "4/3", "4:3 (width:height) from here on, and 1:1 before"), ("16/15", "8/9", "8:9")]
    {
        let path = folder.path().join("whole.h264");
        std::fs::write(&path, [h264(first), h264(second)].concat()).unwrap();
        let said = refusal(&path, &OpenOptions::default());
        assert!(said.contains("frame 10: its pixels are ") && said.contains(words), "{said}");
        assert!(said.contains("frames") && said.contains("pixel_aspect"), "{said}");
        assert_eq!(refusal(&path, &given), "");
    }
}

/// A film of pictures as they are coded, one after another.
fn film_of(folder: &Path, ending: &str, to: &str, pictures: &[Vec<u8>]) -> PathBuf {
    let (from, path) = (folder.join(format!("coded.{ending}")), folder.join(to));
    std::fs::write(&from, pictures.concat()).unwrap();
    if from != path {
        let pipe = if ending == "png" { "png_pipe" } else { "mjpeg" };
        let status = std::process::Command::new("ffmpeg")
            .args(["-v", "error", "-y", "-framerate", "100", "-f", pipe, "-i"])
            .arg(&from)
            .args(["-c", "copy"])
            .arg(&path)
            .status();
        assert!(status.unwrap().success());
    }
    path
}

#[test]
fn pictures_inside_films_are_turned_as_they_say() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    for number in 1..=8u16 {
        // What the picture alone gives is held to the standard's figure above.
        let alone = folder.path().join("a.jpg");
        std::fs::write(&alone, jpeg(number, false)).unwrap();
        let (size, _, warned) = first(&alone);
        let stored: Vec<u32> = picture(3).iter().map(|v| u32::from(*v)).collect();
        for big_endian in [false, true] {
            let pictures = vec![jpeg(number, big_endian); 4];
            for to in ["a.mjpeg", "a.avi", "a.mov", "a.mkv"] {
                let path = film_of(folder.path(), "jpg", to, &pictures);
                let (own, pixels, own_warned) = first(&path);
                assert_eq!(own, size, "{to} {number}");
                let is_told = |words: &str| words.contains("turned as the file says");
                assert_eq!(is_told(&own_warned), is_told(&warned), "{to} {number}: {own_warned}");
                // JPEG loses some levels; its two decoders differ by some too.
                let truth = seen(&stored, number).1;
                let off = pixels.iter().zip(&truth).filter(|(a, b)| a.abs_diff(**b) > 40).count();
                assert!(off * 100 < truth.len(), "{to} {number}: {off} px");
                let all = read_all(&mut *source(&path));
                assert!(all.iter().all(|f| f.plane.is_some()), "{to} {number}");
            }
        }
        let path = film_of(folder.path(), "png", "p.mov", &vec![png(number, false); 3]);
        assert_eq!((first(&path).0, first(&path).1), seen(&stored, number), "PNG {number}");
    }
}

#[test]
fn a_film_s_picture_that_is_to_be_turned_otherwise_is_not_believed() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let untagged = coded(".jpg");
    let pictures = [jpeg(6, false), untagged, jpeg(8, false), jpeg(6, true)];
    let path = film_of(folder.path(), "jpg", "a.avi", &pictures);
    let mut film = source(&path);
    let frames = read_all(&mut *film);
    let whole: Vec<bool> = frames.iter().map(|f| f.plane.is_some()).collect();
    assert_eq!(whole, [true, true, false, true]);
    let reasons: Vec<(u64, String)> = film.reasons().into_iter().map(|r| (r.frame, r.words)).collect();
    let words = "it is to be turned otherwise than the first: 90 degrees counter-clockwise, that 90 degrees clockwise";
    assert_eq!(reasons, [(2, words.to_owned())]);
}

#[test]
fn pictures_through_a_pipe_are_turned_as_they_say() {
    let folder = tempfile::tempdir().unwrap();
    let stored: Vec<u32> = picture(3).iter().map(|v| u32::from(*v)).collect();
    for number in [3u16, 6, 8] {
        for pictures in [vec![png(number, true); 3], vec![jpeg(number, true); 3]] {
            let pipe = folder.path().join(format!("pipe{number}-{}", pictures[0].len()));
            assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
            let into = pipe.clone();
            let is_png = pictures[0].starts_with(b"\x89PNG");
            let writer = std::thread::spawn(move || std::fs::write(into, pictures.concat()));
            let (size, pixels, warnings) = first(&pipe);
            // The reader has left: what it did not take is not written.
            let _ = writer.join().unwrap();
            let truth = seen(&stored, number);
            assert_eq!(size, truth.0, "{number}");
            assert!(warnings.contains("turned as the file says"), "{number}: {warnings}");
            let most = if is_png { 0 } else { 40 };
            let off = pixels.iter().zip(&truth.1).filter(|(a, b)| a.abs_diff(**b) > most).count();
            assert!(off * 100 <= if is_png { 0 } else { truth.1.len() }, "{number}: {off} px");
        }
    }
}
