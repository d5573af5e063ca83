//! Files that are cut or damaged: every good frame, in its place and time, and then how it ended.

use std::io::Write;
use std::process::{Command, Stdio};

use tracker::frame::{Ending, Frame};
use tracker::source::{OpenOptions, open};

use crate::film::{HEIGHT, WIDTH, encode, have_ffmpeg, index_of, read_all, samples};

fn told(frame: &Frame) -> Option<usize> {
    samples(frame).map(|v| index_of(&v, (1 << frame.depth_bits) - 1).unwrap_or(usize::MAX))
}

const COUNT: usize = 100;

#[test]
fn a_cut_file_gives_its_good_frames_and_says_where_it_ended() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    for (name, arguments) in [
        ("a.mp4", &["-c:v", "libx264", "-g", "20", "-movflags", "faststart"][..]),
        ("a.avi", &["-c:v", "mjpeg", "-pix_fmt", "yuvj420p"]),
        ("raw.avi", &["-c:v", "rawvideo", "-pix_fmt", "gray"]),
        ("a.mkv", &["-c:v", "ffv1", "-g", "1"]),
        ("b.mkv", &["-c:v", "libx264", "-g", "20"]),
        ("a.y4m", &["-pix_fmt", "gray", "-strict", "-1"]),
    ] {
        let path = encode(folder.path(), name, COUNT, arguments);
        let whole = std::fs::read(&path).unwrap();
        for part in [0.45, 0.7, 0.93] {
            let keep = (whole.len() as f64 * part) as usize;
            std::fs::write(&path, &whole[..keep]).unwrap();
            let mut source = open(path.to_str().unwrap(), &OpenOptions::default()).unwrap();
            let frames = read_all(&mut *source);
            assert!(frames.len() > 10 && frames.len() < COUNT, "{name} {part}: {}", frames.len());
            for (i, frame) in frames.iter().enumerate() {
                assert_eq!(told(frame), Some(i), "{name} {part} frame {i}");
            }
            let Ending::Early { frames: n, byte, reason } = source.ending() else {
                panic!("{name} {part}: not early after {}", frames.len())
            };
            assert_eq!(n as usize, frames.len(), "{name} {reason}");
            assert!(byte.is_some_and(|b| b <= keep as u64), "{name}: {byte:?} of {keep}, {reason}");
        }
    }
}

#[test]
fn damage_in_the_middle_leaves_all_others_in_their_places() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    // HEVC with its pictures' checksums: without them a decoder cannot know all damage.
    for (name, arguments) in [
        ("a.mp4", &["-c:v", "libx264", "-g", "20", "-bf", "2", "-movflags", "faststart"][..]),
        (
            "b.mp4",
            &["-c:v", "libx265", "-x265-params", "log-level=none:keyint=20:hash=1", "-movflags", "faststart"],
        ),
        ("a.mov", &["-c:v", "png", "-movflags", "faststart"]),
    ] {
        let path = encode(folder.path(), name, COUNT, arguments);
        let mut bytes = std::fs::read(&path).unwrap();
        let middle = bytes.len() / 2;
        for b in &mut bytes[middle..middle + 60] {
            *b = b.wrapping_mul(31).wrapping_add(17);
        }
        std::fs::write(&path, &bytes).unwrap();
        let mut source = open(path.to_str().unwrap(), &OpenOptions::default()).unwrap();
        let time_base = source.info().time_base;
        let frames = read_all(&mut *source);
        assert_eq!(frames.len(), COUNT, "{name}: {:?}", source.ending());
        let lost: Vec<usize> = (0..COUNT).filter(|i| frames[*i].plane.is_none()).collect();
        // Those of one group of pictures at most, and those that lead into the next.
        assert!(!lost.is_empty() && lost.len() <= 24, "{name}: {lost:?}");
        for (i, frame) in frames.iter().enumerate() {
            assert_eq!(frame.index, i as u64);
            let time = time_base.seconds(frame.ticks) - time_base.seconds(frames[0].ticks);
            assert!((time - i as f64 * 0.002).abs() < 0.000_501, "{name} frame {i}: {time} s");
            if frame.plane.is_some() {
                assert_eq!(told(frame), Some(i), "{name}: lost {lost:?}");
            }
        }
    }
}

#[test]
fn variable_rates_and_turns_are_kept() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = encode(
        folder.path(),
        "vfr.mkv",
        20,
        &["-vf", "setpts='(N+if(gte(N,10),N-9,0))*0.002/TB'", "-fps_mode", "vfr", "-c:v", "ffv1"],
    );
    let mut source = open(path.to_str().unwrap(), &OpenOptions::default()).unwrap();
    let time_base = source.info().time_base;
    let times: Vec<f64> = read_all(&mut *source).iter().map(|f| time_base.seconds(f.ticks)).collect();
    assert_eq!(times.len(), 20);
    for (i, time) in times.iter().enumerate() {
        let expected = 0.002 * (i + i.saturating_sub(9)) as f64;
        assert!((time - times[0] - expected).abs() < 0.000_501, "frame {i}: {time} s, not {expected}");
    }

    let path = encode(folder.path(), "plain.mp4", 10, &["-c:v", "libx264", "-qp", "0", "-pix_fmt", "gray"]);
    for (degrees, size) in [("90", (HEIGHT, WIDTH)), ("180", (WIDTH, HEIGHT)), ("270", (HEIGHT, WIDTH))] {
        let turned = folder.path().join(format!("turned{degrees}.mov"));
        let raw = folder.path().join("turned.raw");
        let rotate = format!("rotate={degrees}");
        let copy = ["-c", "copy", "-metadata:s:v", &rotate];
        // What the program makes of the same file is the truth.
        for (from, arguments, to) in
            [(&path, &copy[..], &turned), (&turned, &["-fps_mode", "passthrough", "-f", "rawvideo"], &raw)]
        {
            let mut command = Command::new("ffmpeg");
            command.args(["-v", "error", "-y", "-i"]).arg(from).args(arguments).arg(to);
            assert!(command.status().unwrap().success());
        }
        let truth = std::fs::read(&raw).unwrap();
        let mut source = open(turned.to_str().unwrap(), &OpenOptions::default()).unwrap();
        assert_eq!((source.info().width as usize, source.info().height as usize), size);
        assert!(source.info().warnings.iter().any(|w| w.to_string().starts_with("turned")));
        let frames = read_all(&mut *source);
        assert_eq!(frames.len(), 10);
        // Luma comes first in each of the program's pictures; what follows is no concern of ours.
        for (frame, picture) in frames.iter().zip(truth.chunks_exact(truth.len() / 10)) {
            let expected = &picture[..WIDTH * HEIGHT];
            let seen: Vec<u8> = samples(frame).unwrap().iter().map(|v| *v as u8).collect();
            assert!(seen == expected, "{degrees} degrees, frame {}", frame.index);
        }
    }
}

#[test]
fn a_named_pipe_is_read_once_and_its_samples_come_again() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let file = encode(folder.path(), "a.y4m", 30, &["-pix_fmt", "gray", "-strict", "-1"]);
    let pipe = folder.path().join("pipe");
    if !Command::new("mkfifo").arg(&pipe).stderr(Stdio::null()).status().is_ok_and(|s| s.success()) {
        eprintln!("skipped: no named pipes here");
        return;
    }
    let bytes = std::fs::read(file).unwrap();
    let end = pipe.clone();
    let writer = std::thread::spawn(move || {
        std::fs::OpenOptions::new().write(true).open(end).unwrap().write_all(&bytes).unwrap();
    });
    let mut source = open(pipe.to_str().unwrap(), &OpenOptions::default()).unwrap();
    assert_eq!(source.sample(8).unwrap().len(), 8);
    let frames = read_all(&mut *source);
    assert_eq!((frames.len(), source.ending()), (30, Ending::Complete));
    for (i, frame) in frames.iter().enumerate() {
        assert_eq!((frame.index, told(frame)), (i as u64, Some(i)));
    }
    writer.join().unwrap();
}

#[test]
fn damaged_slices_of_ffv1_are_seen_by_their_sums() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    for (name, arguments) in [
        ("a.mkv", &["-g", "1"][..]),
        ("b.mkv", &["-g", "10"]),
        ("c.mkv", &["-g", "10", "-slices", "9", "-coder", "1", "-context", "1"]),
        ("a.avi", &["-g", "10"]),
        ("a.nut", &["-g", "1"]),
        ("a.mov", &["-g", "10"]),
    ] {
        let arguments = [&["-c:v", "ffv1", "-level", "3"], arguments].concat();
        let path = encode(folder.path(), name, COUNT, &arguments);
        let whole = std::fs::read(&path).unwrap();
        let truth = read_all(&mut *open(path.to_str().unwrap(), &OpenOptions::default()).unwrap());
        assert!(truth.len() == COUNT && truth.iter().all(|f| f.plane.is_some()), "{name}");
        // Frames that are left where a group of pictures is lost at most; where the file's structure is hit, more are.
        let mut few_lost = 0;
        for part in 1..8 {
            let at = whole.len() * part / 8;
            for length in [1, 8, 60] {
                let mut bytes = whole.clone();
                bytes[at..at + length].iter_mut().for_each(|b| *b = b.wrapping_mul(31).wrapping_add(17));
                std::fs::write(&path, &bytes).unwrap();
                let Ok(mut source) = open(path.to_str().unwrap(), &OpenOptions::default()) else { continue };
                let frames = read_all(&mut *source);
                let mut whole_frames = 0;
                for frame in frames.iter().filter(|f| f.plane.is_some()) {
                    whole_frames += 1;
                    // A container's time stamps have no sums: only what is shown is looked at.
                    let i = told(frame).filter(|i| *i < COUNT);
                    let i = i.unwrap_or_else(|| panic!("{name} {at} {length}: frame {}", frame.index));
                    assert_eq!(samples(frame), samples(&truth[i]), "{name} {at} {length} picture {i}");
                }
                // Up to the next key frame.
                let is_told = frames.len() > whole_frames
                    || source.gaps().is_damage()
                    || source.ending() != Ending::Complete;
                // Where a time stamp was hit, every picture is there and good.
                assert!(is_told || whole_frames == COUNT, "{name} {at} {length}: {whole_frames}");
                few_lost += usize::from(whole_frames >= COUNT - 12);
            }
        }
        assert!(few_lost >= 15, "{name}: {few_lost} of 21");
    }
}

#[test]
fn what_goes_on_from_a_lost_picture_of_ffv1_is_not_believed() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    for name in ["a.mkv", "a.nut", "a.avi"] {
        let path = encode(folder.path(), name, COUNT, &["-c:v", "ffv1", "-level", "3", "-g", "10"]);
        let whole = std::fs::read(&path).unwrap();
        let truth = read_all(&mut *open(path.to_str().unwrap(), &OpenOptions::default()).unwrap());
        for part in 1..6 {
            let at = whole.len() * part / 6;
            for length in [1, 400, 6000] {
                std::fs::write(&path, [&whole[..at], &whole[at + length..]].concat()).unwrap();
                let Ok(mut source) = open(path.to_str().unwrap(), &OpenOptions::default()) else { continue };
                let frames = read_all(&mut *source);
                for frame in frames.iter().filter(|f| f.plane.is_some()) {
                    let i = told(frame).filter(|i| *i < COUNT);
                    let i = i.unwrap_or_else(|| panic!("{name} {at} {length}: frame {}", frame.index));
                    assert_eq!(samples(frame), samples(&truth[i]), "{name} {at} {length} picture {i}");
                }
                let is_told = frames.iter().any(|f| f.plane.is_none())
                    || source.gaps().is_damage()
                    || source.ending() != Ending::Complete;
                assert!(is_told, "{name} {at} {length}");
            }
        }
    }
}

#[test]
fn a_file_that_ends_inside_what_holds_pictures_ended_early() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let fragments = ["-g", "10", "-movflags", "frag_keyframe+empty_moov"];
    for (name, codec) in [("a.mp4", "libx264"), ("b.mp4", "libvpx-vp9"), ("a.mov", "libx264")] {
        let path = encode(folder.path(), name, 60, &[&["-c:v", codec], &fragments[..]].concat());
        let whole = std::fs::read(&path).unwrap();
        let mut boxes = Vec::new();
        let mut at = 0;
        while at + 8 <= whole.len() {
            boxes.push((at, whole[at + 4..at + 8].to_vec()));
            at += u32::from_be_bytes(whole[at..at + 4].try_into().unwrap()) as usize;
        }
        let headers: Vec<usize> =
            boxes.iter().filter(|(_, kind)| kind == b"moof").map(|(at, _)| *at).collect();
        let index = boxes.iter().find(|(_, kind)| kind == b"mfra").unwrap().0;
        assert_eq!(headers.len(), 6, "{name}");
        // Inside the fifth fragment's header, at its first bytes, and inside what it holds.
        for (keep, least) in [(headers[4] + 5, 38), (headers[4] + 60, 38), (headers[5] - 300, 38)] {
            std::fs::write(&path, &whole[..keep]).unwrap();
            let mut source = open(path.to_str().unwrap(), &OpenOptions::default()).unwrap();
            let frames = read_all(&mut *source);
            assert!((least..50).contains(&frames.len()), "{name} {keep}: {}", frames.len());
            assert!(matches!(source.ending(), Ending::Early { .. }), "{name} {keep}");
        }
        // The index behind the last fragment is needed by nobody.
        std::fs::write(&path, &whole[..index + 20]).unwrap();
        let mut source = open(path.to_str().unwrap(), &OpenOptions::default()).unwrap();
        assert_eq!((read_all(&mut *source).len(), source.ending()), (60, Ending::Complete), "{name}");
    }
    // In ticks longer than a frame the length does not tell that the last picture lacks.
    let path = encode(folder.path(), "a.mkv", 60, &["-vf", "setpts=N/1500/TB", "-r", "1500", "-c:v", "ffv1"]);
    let whole = std::fs::read(&path).unwrap();
    for percent in 90..100 {
        std::fs::write(&path, &whole[..whole.len() * percent / 100]).unwrap();
        let mut source = open(path.to_str().unwrap(), &OpenOptions::default()).unwrap();
        let frames = read_all(&mut *source);
        let is_told = source.ending() != Ending::Complete || frames.iter().any(|f| f.plane.is_none());
        assert!(is_told || frames.len() == 60, "{percent} %: {}", frames.len());
    }
}
