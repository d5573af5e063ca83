//! Pictures as recordings: folders, patterns, gaps, TIFF stacks, broken files.

use std::fs::File;
use std::path::Path;

use tiff::encoder::{TiffEncoder, colortype};
use tracker::frame::{Ending, FrameSource, PixelFormat, RateOrigin};
use tracker::source::{OpenOptions, open};

use crate::film::{HEIGHT, WIDTH, encode, have_ffmpeg, index_of, picture, read_all, samples};

fn with_fps(fps: f64) -> OpenOptions {
    OpenOptions { fps: Some(fps), ..OpenOptions::default() }
}

#[test]
fn a_folder_and_patterns_give_the_same_pictures_in_order() {
    if !have_ffmpeg() {
        return;
    }
    for (ending, arguments) in [
        ("png", &[][..]),
        ("bmp", &[]),
        ("tif", &["-pix_fmt", "gray"]),
        ("png", &["-pix_fmt", "gray16be"]),
        ("tiff", &["-pix_fmt", "gray16le"]),
        ("png", &["-pix_fmt", "rgb24"]),
    ] {
        let folder = tempfile::tempdir().unwrap();
        encode(folder.path(), &format!("img_%d.{ending}"), 24, arguments);
        for name in
            [".".to_owned(), format!("img_%d.{ending}"), format!("*.{ending}"), format!("img_*.{ending}")]
        {
            let path = folder.path().join(&name);
            let mut source = open(path.to_str().unwrap(), &with_fps(250.0)).unwrap();
            let deep = arguments.iter().any(|a| a.contains("16"));
            assert_eq!(source.info().depth_bits, if deep { 16 } else { 8 });
            assert_eq!(source.info().rate_hz, Some(250.0));
            let frames = read_all(&mut *source);
            assert_eq!((frames.len(), source.ending()), (24, Ending::Complete), "{name}");
            for (i, frame) in frames.iter().enumerate() {
                let values = samples(frame).unwrap();
                let eight: Vec<u32> = values.iter().map(|v| if deep { v >> 8 } else { *v }).collect();
                let truth: Vec<u32> = picture(i).iter().map(|v| u32::from(*v)).collect();
                assert_eq!(eight, truth, "{name} frame {i}");
            }
        }
    }
}

#[test]
fn gaps_keep_their_place_and_broken_pictures_are_frames_without_pixels() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    encode(folder.path(), "f%03d.png", 20, &[]);
    std::fs::remove_file(folder.path().join("f006.png")).unwrap();
    std::fs::remove_file(folder.path().join("f007.png")).unwrap();
    let bad = folder.path().join("f011.png");
    let bytes = std::fs::read(&bad).unwrap();
    std::fs::write(&bad, &bytes[..bytes.len() / 2]).unwrap();
    let mut source = open(folder.path().to_str().unwrap(), &with_fps(100.0)).unwrap();
    assert!(source.info().warnings.iter().any(|w| w.to_string().contains("2 pictures are missing")));
    assert!(source.sample(6).unwrap().iter().all(|f| f.plane.is_some()));
    let frames = read_all(&mut *source);
    assert_eq!(frames.len(), 20);
    for (i, frame) in frames.iter().enumerate() {
        assert_eq!((frame.index, frame.ticks), (i as u64, i as i64));
        let told = samples(frame).map(|v| index_of(&v, 255).unwrap());
        assert_eq!(told, if [5, 6, 10].contains(&i) { None } else { Some(i) }, "frame {i}");
    }
    let words = |source: &dyn FrameSource| -> Vec<(u64, String)> {
        source.reasons().into_iter().map(|r| (r.frame, r.words)).collect()
    };
    let lacks = "no picture has its number".to_owned();
    assert_eq!(words(&*source), [(5, lacks.clone()), (6, lacks), (10, "f011.png: it is cut".to_owned())]);
    // A broken last picture is an early end.
    std::fs::write(folder.path().join("f020.png"), &bytes[..40]).unwrap();
    let mut source = open(folder.path().to_str().unwrap(), &with_fps(100.0)).unwrap();
    assert_eq!(read_all(&mut *source).len(), 19);
    assert!(
        matches!(source.ending(), Ending::Early { frames: 19, reason, .. } if reason == "f020.png: it is cut")
    );
}

#[test]
fn a_picture_of_another_size_or_depth_is_an_empty_frame_that_says_so() {
    if !have_ffmpeg() {
        return;
    }
    for (odd, arguments, words) in [
        (4, &["-vf", "scale=64:48"][..], "f004.png is 64 x 48 px, the others are 196 x 116 px"),
        (1, &["-vf", "transpose=1"], "f001.png is 116 x 196 px, the others are 196 x 116 px"),
        (
            9,
            &["-pix_fmt", "gray16be"],
            "f009.png is 196 x 116 px of 16 bits, the others are 196 x 116 px of 8 bits",
        ),
        (12, &["-vf", "crop=196:115:0:0"], "f012.png is 196 x 115 px, the others are 196 x 116 px"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let other = tempfile::tempdir().unwrap();
        encode(folder.path(), "f%03d.png", 12, &[]);
        encode(other.path(), "f%03d.png", 12, arguments);
        let name = format!("f{odd:03}.png");
        std::fs::copy(other.path().join(&name), folder.path().join(&name)).unwrap();
        let mut source = open(folder.path().to_str().unwrap(), &with_fps(100.0)).unwrap();
        let warned = source.info().warnings.iter().any(|w| w.to_string().contains(words));
        // Those among the nine that are looked at before.
        assert!(warned || ![1, 12].contains(&odd), "{odd}: {:?}", source.info().warnings);
        let frames = read_all(&mut *source);
        if odd == 12 {
            assert!(matches!(source.ending(), Ending::Early { frames: 11, reason, .. } if reason == words));
            continue;
        }
        let empty: Vec<u64> = frames.iter().filter(|f| f.plane.is_none()).map(|f| f.index).collect();
        assert_eq!(empty, [odd - 1]);
        let told: Vec<(u64, String)> = source.reasons().into_iter().map(|r| (r.frame, r.words)).collect();
        assert_eq!(told, [(odd - 1, words.to_owned())]);
    }
}

#[test]
fn pictures_without_a_rate_say_so() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a1.pgm"), b"P5 3 2 255\nabcdef").unwrap();
    let source = open(folder.path().to_str().unwrap(), &OpenOptions::default()).unwrap();
    assert_eq!((source.info().rate_hz, source.info().rate_origin), (None, RateOrigin::Unknown));
    assert!(source.info().warnings.iter().any(|w| w.to_string().contains("with fps")));
    let empty = tempfile::tempdir().unwrap();
    let error = open(empty.path().to_str().unwrap(), &OpenOptions::default()).err().unwrap().to_string();
    assert!(error.contains("no pictures"), "{error}");
}

#[test]
fn a_picture_that_lies_about_its_size_is_refused_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    let mut png = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR".to_vec();
    png.extend(1_000_000_000u32.to_be_bytes());
    png.extend(1_000_000_000u32.to_be_bytes());
    png.extend([16, 0, 0, 0, 0, 1, 2, 3, 4]);
    std::fs::write(&path, &png).unwrap();
    let error = open(folder.path().to_str().unwrap(), &OpenOptions::default()).err().unwrap().to_string();
    assert!(error.contains("1000000000 x 1000000000"), "{error}");
}

fn write_stack(path: &Path, count: usize) {
    let mut encoder = TiffEncoder::new(File::create(path).unwrap()).unwrap();
    for i in 0..count {
        let deep: Vec<u16> = picture(i).iter().map(|v| u16::from(*v) << 4 | 3).collect();
        encoder.write_image::<colortype::Gray16>(WIDTH as u32, HEIGHT as u32, &deep).unwrap();
    }
}

#[test]
fn the_pages_of_a_tiff_are_frames_and_a_cut_one_ends_early() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("stack.tif");
    write_stack(&path, 12);
    let mut source = open(path.to_str().unwrap(), &with_fps(1000.0)).unwrap();
    assert_eq!((source.info().format, source.info().depth_bits), (PixelFormat::Gray16, 16));
    assert_eq!(source.sample(5).unwrap().len(), 5);
    let frames = read_all(&mut *source);
    assert_eq!((frames.len(), source.ending()), (12, Ending::Complete));
    for (i, frame) in frames.iter().enumerate() {
        let truth: Vec<u32> = picture(i).iter().map(|v| u32::from(*v) << 4 | 3).collect();
        assert_eq!(samples(frame).unwrap(), truth);
    }
    let whole = std::fs::read(&path).unwrap();
    std::fs::write(&path, &whole[..whole.len() * 2 / 3]).unwrap();
    let mut source = open(path.to_str().unwrap(), &with_fps(1000.0)).unwrap();
    let frames = read_all(&mut *source);
    assert!((6..9).contains(&frames.len()), "{}", frames.len());
    let Ending::Early { frames: n, .. } = source.ending() else { panic!("not early") };
    assert_eq!(n as usize, frames.len());
}

/// A gray PGM picture with one value in all samples.
fn pgm(path: &Path, width: usize, height: usize, value: u8) {
    let mut bytes = format!("P5 {width} {height} 255\n").into_bytes();
    bytes.resize(bytes.len() + width * height, value);
    std::fs::write(path, bytes).unwrap();
}

#[test]
fn company_in_a_folder_is_left_out_and_named() {
    for company in [
        &["cover.pgm"][..],
        &["AAA_preview.pgm", "zzz.pgm"],
        &["._img_001.pgm", ".hidden.pgm", "Thumbs.db", ".DS_Store", "notes.txt", "desktop.ini"],
    ] {
        let folder = tempfile::tempdir().unwrap();
        for i in 0..30 {
            pgm(&folder.path().join(format!("img_{:03}.pgm", i + 1)), 8, 6, 100 + i);
        }
        for name in company {
            pgm(&folder.path().join(name), 3, 2, 7);
        }
        let named: Vec<&&str> =
            company.iter().filter(|n| n.ends_with(".pgm") && !n.starts_with('.')).collect();
        for name in
            [folder.path().to_owned(), folder.path().join("img*.pgm"), folder.path().join("img_%03d.pgm")]
        {
            let mut source = open(name.to_str().unwrap(), &with_fps(100.0)).unwrap();
            assert_eq!((source.info().width, source.info().height), (8, 6));
            let warnings =
                source.info().warnings.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n");
            let frames = read_all(&mut *source);
            assert_eq!((frames.len(), source.ending()), (30, Ending::Complete), "{}", name.display());
            assert!((0..30).all(|i| samples(&frames[i]).unwrap()[0] == 100 + i as u32));
            let told = name.is_dir() && !named.is_empty();
            assert_eq!(warnings.contains("left out"), told, "{warnings}");
            assert!(!told || named.iter().all(|n| warnings.contains(**n)), "{warnings}");
        }
    }
    // A pattern of all pictures leaves out no more than what is hidden.
    let folder = tempfile::tempdir().unwrap();
    (1..4).for_each(|i| pgm(&folder.path().join(format!("{i}.pgm")), 8, 6, i));
    pgm(&folder.path().join("._1.pgm"), 8, 6, 9);
    let all = folder.path().join("*.pgm");
    assert_eq!(read_all(&mut *open(all.to_str().unwrap(), &with_fps(1.0)).unwrap()).len(), 3);
}

#[test]
fn a_first_picture_of_another_size_is_the_odd_one() {
    for odd in [1, 7, 20] {
        let folder = tempfile::tempdir().unwrap();
        for i in 1..=20 {
            let (width, height) = if i == odd { (3, 2) } else { (8, 6) };
            pgm(&folder.path().join(format!("img_{i:03}.pgm")), width, height, i as u8);
        }
        let mut source = open(folder.path().to_str().unwrap(), &with_fps(100.0)).unwrap();
        assert_eq!((source.info().width, source.info().height), (8, 6));
        if odd != 7 {
            let expected = format!("frame {}: img_{odd:03}.pgm is 3 x 2 px", odd - 1);
            assert!(
                source.info().warnings.iter().any(|w| w.to_string().contains(&expected)),
                "{:?}",
                source.info().warnings
            );
        }
        let frames = read_all(&mut *source);
        let empty: Vec<usize> = (0..frames.len()).filter(|i| frames[*i].plane.is_none()).collect();
        if odd == 20 {
            assert_eq!((frames.len(), empty.len()), (19, 0));
            assert!(matches!(source.ending(), Ending::Early { frames: 19, .. }));
        } else {
            assert_eq!((frames.len(), empty), (20, vec![odd - 1]));
        }
    }
}

#[test]
fn several_sequences_in_a_folder_or_several_pictures_in_a_file_are_refused() {
    let problem = |path: &Path| open(path.to_str().unwrap(), &with_fps(100.0)).err().unwrap().to_string();
    let folder = tempfile::tempdir().unwrap();
    for i in 0..6 {
        pgm(&folder.path().join(format!("left_{i}.pgm")), 8, 6, i);
        pgm(&folder.path().join(format!("right_{i}.pgm")), 8, 6, i);
    }
    let told = problem(folder.path());
    assert!(told.contains("several sequences of pictures (6 left_#.pgm, 6 right_#.pgm)"), "{told}");
    let one = folder.path().join("left_*.pgm");
    assert_eq!(read_all(&mut *open(one.to_str().unwrap(), &with_fps(100.0)).unwrap()).len(), 6);

    let folder = tempfile::tempdir().unwrap();
    (0..3).for_each(|i| write_stack(&folder.path().join(format!("part_{i}.tif")), 4));
    let told = problem(folder.path());
    assert!(told.contains("it holds several pictures, and in a folder each file is one"), "{told}");
    // A file whose name looks like a pattern is itself.
    let path = folder.path().join("img_%03d.pgm");
    pgm(&path, 8, 6, 77);
    let frames = read_all(&mut *open(path.to_str().unwrap(), &with_fps(100.0)).unwrap());
    assert_eq!((frames.len(), samples(&frames[0]).unwrap()[0]), (1, 77));
}

#[test]
fn pictures_of_which_no_size_is_that_of_most_are_refused_by_name() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    encode(folder.path(), "f%03d.png", 4, &["-start_number", "0"]);
    encode(folder.path(), "f%03d.png", 4, &["-start_number", "4", "-vf", "scale=64:48"]);
    let refused = open(folder.path().to_str().unwrap(), &with_fps(250.0)).err().unwrap().to_string();
    let words = "its pictures are of several sizes, none of which most have: 196 x 116 px as f000.png, f001.png, ...; \
                 64 x 48 px as f004.png, f005.png, ...";
    assert!(refused.contains(words) && refused.contains("as a pattern"), "{refused}");
    // One more, and it is the size of most.
    encode(folder.path(), "f%03d.png", 1, &["-start_number", "8"]);
    assert_eq!(read_all(&mut *open(folder.path().to_str().unwrap(), &with_fps(250.0)).unwrap()).len(), 9);
}

#[test]
fn jpeg_pictures_of_every_kind_are_read_and_damage_to_their_data_is_told() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let mut files: Vec<Vec<u8>> = Vec::new();
    for format in ["yuvj420p", "yuvj422p", "yuvj440p", "yuvj444p", "gray"] {
        for codes in ["default", "optimal"] {
            let options = ["-pix_fmt", format, "-huffman", codes, "-frames:v", "1", "-q:v", "2"];
            files.push(std::fs::read(encode(folder.path(), "one.jpg", 1, &options)).unwrap());
        }
    }
    let pixels = picture(0);
    let mat = opencv::core::Mat::from_slice(&pixels).unwrap();
    let mat = opencv::prelude::MatTraitConst::reshape(&mat, 1, HEIGHT as i32).unwrap();
    // Parts of 7 blocks, optimal codes, several scans.
    for (option, value) in [(opencv::imgcodecs::IMWRITE_JPEG_RST_INTERVAL, 7), (3, 1), (2, 1)] {
        let mut bytes = opencv::core::Vector::<u8>::new();
        let options = opencv::core::Vector::<i32>::from_slice(&[option, value]);
        assert!(opencv::imgcodecs::imencode(".jpg", &mat, &mut bytes, &options).unwrap());
        files.push(bytes.iter().collect());
    }
    let path = folder.path().join("seen/f000.jpg");
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    let is_read = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        let mut source = open(path.parent().unwrap().to_str().unwrap(), &with_fps(250.0));
        source.as_mut().is_ok_and(|s| read_all(&mut **s).iter().all(|f| f.plane.is_some()))
    };
    for (i, whole) in files.iter().enumerate() {
        assert!(is_read(whole), "file {i}");
        let is_progressive = i + 1 == files.len();
        for (from, to) in [(2, 3), (1, 2), (1, 3)] {
            let n = whole.len();
            let mut bytes = whole.clone();
            // Up to the end, and inside, with the marker of the end kept.
            bytes[n * from / 4..(n * to / 4).min(n - 2)].fill(0);
            assert!(is_progressive || !is_read(&bytes), "file {i}: zeros from {from} to {to} quarters");
        }
        // The same picture, filled up with ones as far as a camera may.
        let mut bytes = whole.clone();
        bytes.splice(whole.len() - 2..whole.len() - 2, [0xff; 5]);
        assert!(is_read(&bytes), "file {i}: fill bytes");
        // One more mark of a part behind the last one.
        let mut bytes = whole.clone();
        bytes.splice(whole.len() - 2..whole.len() - 2, [0xff, 0xd0]);
        assert!(is_read(&bytes), "file {i}: a mark of a part at the end");
    }
}
