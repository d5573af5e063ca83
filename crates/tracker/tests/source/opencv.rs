//! The second decoder gives what the first gives.

use std::path::Path;
use std::sync::Arc;

use tracker::detect::{DetectSettings, Detection, Detector, Levels};
use tracker::error::Result;
use tracker::frame::{Ending, FrameSource};
use tracker::source::{self, Decoder, OpenOptions, use_opencv_decoder};

use crate::film::{WIDTH, encode, have_ffmpeg, index_of, read_all, real, samples};

/// Opens a film in a program that has the second decoder.
fn open(name: &str, options: &OpenOptions) -> Result<Box<dyn FrameSource>> {
    use_opencv_decoder();
    source::open(name, options)
}

/// Centre of what is brighter than the middle of the picture's range, weighted by how much brighter.
fn centre(values: &[u32]) -> (f64, f64) {
    let (low, high) = (values.iter().min().unwrap(), values.iter().max().unwrap());
    let middle = f64::from(low + high) / 2.0;
    let (mut n, mut x, mut y) = (0.0, 0.0, 0.0);
    for (i, v) in values.iter().enumerate() {
        let weight = f64::from(*v) - middle;
        if weight > 0.0 {
            n += weight;
            x += weight * (i % WIDTH) as f64;
            y += weight * (i / WIDTH) as f64;
        }
    }
    (x / n, y / n)
}

#[test]
fn both_decoders_give_the_same_frames_and_centres() {
    let mut files = Vec::new();
    let folder = tempfile::tempdir().unwrap();
    if have_ffmpeg() {
        for (name, arguments) in [
            ("a.mp4", &["-c:v", "libx264", "-bf", "3", "-g", "12"][..]),
            ("a.avi", &["-c:v", "rawvideo", "-pix_fmt", "gray"]),
            ("a.mkv", &["-c:v", "ffv1", "-pix_fmt", "gray"]),
            ("b.avi", &["-c:v", "mjpeg", "-q:v", "2", "-pix_fmt", "yuvj420p"]),
            ("a.mov", &["-c:v", "libx265", "-x265-params", "log-level=none"]),
        ] {
            files
                .push((encode(folder.path(), name, 30, arguments), name.ends_with("mkv") || name == "a.avi"));
        }
    }
    files.extend(real("balltoss/BallTossOut.mp4").map(|p| (p, false)));
    for (path, gray) in files {
        let name = path.to_str().unwrap();
        let mut first = open(name, &OpenOptions::default()).unwrap();
        let options = OpenOptions { decoder: Decoder::Opencv, ..OpenOptions::default() };
        let mut second = open(name, &options).unwrap();
        assert!(!second.sample(4).unwrap().is_empty());
        let (a, b) = (read_all(&mut *first), read_all(&mut *second));
        assert_eq!(a.len(), b.len(), "{name}");
        let zero = [first.info().time_base.seconds(a[0].ticks), second.info().time_base.seconds(b[0].ticks)];
        for (p, q) in a.iter().zip(&b) {
            let times = [first.info().time_base.seconds(p.ticks), second.info().time_base.seconds(q.ticks)];
            assert!((times[0] - zero[0] - times[1] + zero[1]).abs() < 1e-12, "{name} {} {times:?}", p.index);
            let (u, v) = (samples(p).unwrap(), samples(q).unwrap());
            if gray {
                // Gray to BGR and back rounds twice at most.
                assert!(u.iter().zip(&v).all(|(s, t)| s.abs_diff(*t) <= 2), "{name} frame {}", p.index);
            }
            if name.contains("Ball") {
                // A natural scene has no one disc; stretching its range clips and would move a centre of it all.
                continue;
            }
            let (c, d) = (centre(&u), centre(&v));
            // Stretching limited range to full and rounding moves each of some hundred weights by half a level
            // of about two hundred: 0.02 px is ten times what that can do to a centre.
            assert!((c.0 - d.0).hypot(c.1 - d.1) < 0.02, "{name} frame {}: {c:?} {d:?}", p.index);
        }
    }
}

/// Writes a display matrix, its first two columns row by row, into the one track header of a QuickTime file.
fn set_matrix(path: &Path, [a, b, c, d]: [i32; 4]) {
    let mut bytes = std::fs::read(path).unwrap();
    let header = bytes.windows(4).position(|w| w == b"tkhd").unwrap();
    // Behind the box's type come 40 bytes, then nine numbers of which the first two of a row have 16 bits of fraction.
    for (place, value) in [(0, a), (1, b), (3, c), (4, d)] {
        let at = header + 44 + 4 * place;
        bytes[at..at + 4].copy_from_slice(&(value << 16).to_be_bytes());
    }
    std::fs::write(path, bytes).unwrap();
}

#[test]
fn both_decoders_turn_and_mirror_alike() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    for ratio in ["1/1", "4/3"] {
        let filter = format!("setsar={ratio}");
        let path = encode(folder.path(), "a.mov", 4, &["-vf", &filter, "-c:v", "png", "-pix_fmt", "gray"]);
        let plain = read_all(&mut *open(path.to_str().unwrap(), &OpenOptions::default()).unwrap());
        // By 0, 90, 180 and 270 degrees, and mirrored left to right, top to bottom and at both diagonals.
        for matrix in [
            [1, 0, 0, 1],
            [0, 1, -1, 0],
            [-1, 0, 0, -1],
            [0, -1, 1, 0],
            [-1, 0, 0, 1],
            [1, 0, 0, -1],
            [0, 1, 1, 0],
            [0, -1, -1, 0],
        ] {
            set_matrix(&path, matrix);
            let name = path.to_str().unwrap();
            let mut first = open(name, &OpenOptions::default()).unwrap();
            let options = OpenOptions { decoder: Decoder::Opencv, ..OpenOptions::default() };
            let mut second = open(name, &options).unwrap();
            let (a, b) = (first.info().clone(), second.info().clone());
            assert_eq!((a.width, a.height, a.pixel_aspect), (b.width, b.height, b.pixel_aspect));
            let quarter = matrix[0] == 0;
            let expected = if quarter {
                ratio.split('/').rev().collect::<Vec<_>>().join(":")
            } else {
                ratio.replace('/', ":")
            };
            assert_eq!(a.pixel_aspect.to_string(), expected, "{matrix:?}");
            assert_eq!(
                a.warnings.iter().any(|w| w.to_string().starts_with("turned")),
                matrix != [1, 0, 0, 1]
            );
            assert_eq!(a.warnings, b.warnings);
            assert!(!second.sample(2).unwrap().is_empty());
            let (p, q) = (read_all(&mut *first), read_all(&mut *second));
            assert_eq!((p.len(), q.len()), (4, 4), "{matrix:?}");
            for ((p, q), plain) in p.iter().zip(&q).zip(&plain) {
                let (u, v) = (samples(p).unwrap(), samples(q).unwrap());
                // Gray to BGR and back rounds twice at most.
                assert!(u.iter().zip(&v).all(|(s, t)| s.abs_diff(*t) <= 2), "{matrix:?} frame {}", p.index);
                assert_eq!(u == samples(plain).unwrap(), matrix == [1, 0, 0, 1]);
            }
        }
    }
}

#[test]
fn deep_recordings_are_not_squeezed() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = encode(folder.path(), "a.mkv", 3, &["-c:v", "ffv1", "-pix_fmt", "gray16le"]);
    let options = OpenOptions { decoder: Decoder::Opencv, ..OpenOptions::default() };
    let error = open(path.to_str().unwrap(), &options).err().unwrap().to_string();
    assert!(error.contains("16 bits") && error.contains("decoder opencv"), "{error}");
}

#[test]
fn every_fixture_that_opencv_reads_has_the_same_markers() {
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures");
    let films =
        ["formats", "demo"].iter().flat_map(|f| std::fs::read_dir(fixtures.join(f)).unwrap().flatten());
    let films = films.map(|e| e.path()).filter(|p| {
        p.extension().is_some_and(|e| ["mp4", "avi", "mkv", "mov"].iter().any(|known| e == *known))
    });
    let (mut read, mut refused) = (0, 0);
    for path in films {
        let name = path.to_str().unwrap();
        let mut sources = Vec::new();
        for decoder in [Decoder::Ffmpeg, Decoder::Opencv] {
            sources.push(open(name, &OpenOptions { decoder, ..OpenOptions::default() }));
        }
        if let Err(e) = &sources[1] {
            assert!(e.to_string().contains("OpenCV's decoder keeps 8"), "{e}");
            refused += 1;
            continue;
        }
        read += 1;
        let settings = DetectSettings::default();
        let mut found: Vec<Vec<(i64, Vec<Detection>)>> = Vec::new();
        for source in sources {
            let mut source = source.unwrap();
            let levels = Levels::learn(&source.sample(32).unwrap(), &settings).unwrap();
            let mut detector = Detector::new(Arc::new(levels), &settings).unwrap();
            let mut frames = Vec::new();
            while let Some(frame) = source.next_frame().unwrap() {
                let mut detections = Vec::new();
                // All frames are counted; of a long film each hundredth is looked at.
                if frame.index < 12 || frame.index.is_multiple_of(100) {
                    detector.detect(&frame, &mut detections).unwrap();
                }
                frames.push((frame.ticks, detections));
            }
            assert_eq!(source.ending(), Ending::Complete, "{name}");
            found.push(frames);
        }
        assert_eq!(found[0].len(), found[1].len(), "{name}");
        let mut distances = Vec::new();
        for (i, (a, b)) in found[0].iter().zip(&found[1]).enumerate() {
            assert_eq!(a.0, b.0, "{name} frame {i}");
            assert_eq!(a.1.len(), b.1.len(), "{name} frame {i}: {:?} {:?}", a.1, b.1);
            for p in &a.1 {
                let to = b.1.iter().map(|q| (p.x_px - q.x_px).hypot(p.y_px - q.y_px));
                distances.push(to.fold(f64::INFINITY, f64::min));
            }
        }
        distances.sort_by(f64::total_cmp);
        let (median, worst) = (distances[distances.len() / 2], distances[distances.len() - 1]);
        // Rounding anew: of a disc's rim of some 30 px each moves by half a level of 150 at most, which is 0.01 px if
        // all pull one way. Where OpenCV also stretches limited range to full it cuts off what is above white, which
        // is not so of the median marker.
        assert!(median < 0.01, "{name}: {median} px");
        let stretched = name.ends_with("mp4");
        assert!(worst < if stretched { 0.25 } else { 0.01 }, "{name}: {worst} px");
    }
    assert_eq!((read, refused), (5, 1));
}

#[test]
fn a_name_that_is_not_utf_8_is_read() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let film = encode(folder.path(), "a.mp4", 6, &["-c:v", "libx264", "-pix_fmt", "yuv420p"]);
    // Latin-1, and a character that stands for a byte where names are carried as text.
    for name in [&b"fl\xe4che.mp4"[..], b"\xff", "a\u{10ffe4}.mp4".as_bytes()] {
        let path = folder.path().join(OsStr::from_bytes(name));
        std::fs::copy(&film, &path).unwrap();
        let options = OpenOptions { decoder: Decoder::Opencv, ..OpenOptions::default() };
        let mut source = open(&tracker::name::text(&path), &options).unwrap();
        assert_eq!(source.sample(3).unwrap().len(), 3, "{name:?}");
        assert_eq!(read_all(&mut *source).len(), 6, "{name:?}");
    }
}

#[test]
fn opencv_s_pictures_have_the_damage_and_the_times_that_the_first_decoder_tells() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    const COUNT: usize = 60;
    let open_with = |path: &Path, decoder| {
        open(path.to_str().unwrap(), &OpenOptions { decoder, ..OpenOptions::default() }).unwrap()
    };
    for (name, arguments) in [
        ("a.mp4", &["-c:v", "libx264", "-g", "20", "-bf", "2", "-movflags", "faststart"][..]),
        ("a.mkv", &["-c:v", "ffv1", "-level", "3", "-g", "1"]),
        ("a.mov", &["-c:v", "png", "-movflags", "faststart"]),
        ("a.avi", &["-c:v", "mjpeg", "-q:v", "2", "-pix_fmt", "yuvj420p"]),
        ("a.webm", &["-c:v", "libvpx-vp9", "-g", "20", "-deadline", "realtime"]),
        ("a.ts", &["-c:v", "libx264", "-g", "20", "-bf", "2"]),
        ("a.mpg", &["-vf", "setpts=N/50/TB", "-r", "50", "-c:v", "mpeg2video", "-q:v", "2"]),
    ] {
        let path = encode(folder.path(), name, COUNT, arguments);
        let whole = std::fs::read(&path).unwrap();
        let middle = whole.len() / 2;
        let mut noise = whole.clone();
        noise[middle..middle + 60].iter_mut().for_each(|b| *b = b.wrapping_mul(31).wrapping_add(17));
        let cut_out = [&whole[..middle], &whole[middle + 1500..]].concat();
        let cut_off = whole[..whole.len() * 83 / 100].to_vec();
        for (how, bytes) in
            [("whole", &whole), ("noise", &noise), ("cut out", &cut_out), ("cut off", &cut_off)]
        {
            std::fs::write(&path, bytes).unwrap();
            // A film whose index is cut out of it cannot be opened at all.
            let Ok(mut first) = open(path.to_str().unwrap(), &OpenOptions::default()) else { continue };
            let mut second = open_with(&path, Decoder::Opencv);
            let (a, b) = (read_all(&mut *first), read_all(&mut *second));
            let lost = |frames: &[tracker::frame::Frame]| frames.iter().filter(|f| f.plane.is_none()).count();
            if how == "whole" {
                assert_eq!((lost(&b), second.ending()), (0, Ending::Complete), "{name}");
            }
            assert_eq!(second.gaps(), first.gaps(), "{name} {how}");
            let is_damaged = lost(&a) > 0 || first.gaps().is_damage() || first.ending() != Ending::Complete;
            let is_told = lost(&b) > 0 || second.gaps().is_damage() || second.ending() != Ending::Complete;
            assert!(is_told || !is_damaged, "{name} {how}");
            for (p, q) in a.iter().zip(&b) {
                assert_eq!((p.index, p.ticks), (q.index, q.ticks), "{name} {how}");
                if let (Some(u), Some(v)) = (samples(p), samples(q)) {
                    let told = [u, v].map(|pixels| index_of(&pixels, 255));
                    assert_eq!(told[0], told[1], "{name} {how} frame {}", p.index);
                }
            }
        }
    }
}
