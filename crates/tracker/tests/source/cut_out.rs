//! Frames cut out of containers that do not number their packets, or whose packets lie in pages; MPEG program streams.

use std::path::Path;

use tracker::frame::{Ending, Frame};
use tracker::gaps::{Cause, Gap, Gaps};
use tracker::source::{Interlaced, OpenOptions, open};

use crate::film::{encode, have_ffmpeg, read_all, samples};
use crate::gaps::{COUNT, read, told};

/// Film of other containers, and arguments that make it. Its key frames are 12 apart.
const OTHERS: [(&str, &[&str]); 7] = [
    ("h.flv", &["-c:v", "libx264", "-g", "12", "-bf", "2", "-sc_threshold", "0"]),
    ("s.flv", &["-c:v", "flv", "-g", "12", "-q:v", "3"]),
    ("a.asf", &["-c:v", "msmpeg4", "-g", "12", "-q:v", "3"]),
    ("w.wmv", &["-c:v", "wmv2", "-g", "12", "-q:v", "3"]),
    ("t.ogv", &["-c:v", "libtheora", "-g", "12", "-q:v", "9", "-page_duration", "8000"]),
    ("a.nut", &["-c:v", "mpeg4", "-g", "12", "-q:v", "3"]),
    ("m.mpg", &["-vf", "setpts=N/25/TB", "-r", "25", "-c:v", "mpeg2video", "-g", "12", "-q:v", "3"]),
];

#[test]
fn frames_cut_out_of_any_container_are_damage_and_no_picture_is_made_up() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    for (name, arguments) in OTHERS {
        let path = encode(folder.path(), name, COUNT, arguments);
        let whole = std::fs::read(&path).unwrap();
        let (frames, ending, gaps, base) = read(&path);
        assert_eq!((frames.len(), ending, gaps), (COUNT, Ending::Complete, Gaps::default()), "{name}");
        assert!(frames.iter().enumerate().all(|(i, f)| told(f) == Some(i)), "{name}");
        let times: Vec<f64> = frames.iter().map(|f| base.seconds(f.ticks)).collect();
        let step = (times[COUNT - 1] - times[0]) / (COUNT - 1) as f64;
        // Behind all headers: Theora's are 0.4 of its file.
        for (from, to) in [(0.5, 0.6), (0.65, 0.67), (0.75, 0.88)] {
            let place = |part: f64| (whole.len() as f64 * part) as usize;
            let mut bytes = whole.clone();
            bytes.drain(place(from)..place(to));
            std::fs::write(&path, &bytes).unwrap();
            let (frames, ending, gaps, base) = read(&path);
            let undecoded = frames.iter().filter(|f| f.plane.is_none()).count();
            let what = format!(
                "{name} {from}: {} frames, {undecoded} undecoded, {ending:?}, {gaps:?}",
                frames.len()
            );
            assert!(gaps.is_damage() || undecoded > 0 || ending != Ending::Complete, "{what}");
            assert_eq!(gaps.dropped_frames, 0, "{what}");
            assert!(frames.len() - undecoded > COUNT / 3, "{what}");
            for frame in &frames {
                let Some(i) = told(frame) else { continue };
                assert!(i < COUNT, "{what}: a made-up picture");
                let off = (base.seconds(frame.ticks) - times[i]).abs();
                assert!(off < 0.51 * step, "{what}: picture {i} is off by {off} s");
            }
        }
    }
}

#[test]
fn frames_that_the_recorder_left_out_are_no_damage_where_the_file_proves_it() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let select = "select='not(between(n,8,10)+eq(n,30))'";
    for (name, arguments) in OTHERS.iter().filter(|(name, _)| *name != "m.mpg") {
        let mut all = vec!["-vf", select, "-fps_mode", "passthrough"];
        all.extend(*arguments);
        let (frames, ending, gaps, _) = read(&encode(folder.path(), name, COUNT, &all));
        assert_eq!((frames.len(), ending), (COUNT - 4, Ending::Complete), "{name}: {gaps:?}");
        // Sorenson's film has no numbers, nor has FLV; NUT's elements are not followed.
        let cause = if ["s.flv", "a.nut"].contains(name) { Cause::Unknown } else { Cause::Recorder };
        // Ogg gives the time of a page's last packet only.
        let late = u64::from(*name == "t.ogv");
        let gap = |after, n| Gap { after: Some(after + late), frames: Some(n), cause };
        assert_eq!(gaps.places, [gap(7, 3), gap(26, 1)], "{name}");
        let undecoded = frames.iter().filter(|f| f.plane.is_none()).count();
        assert_eq!(undecoded > 0, cause == Cause::Unknown, "{name}: {undecoded}");
    }
}

/// Takes whole tags of the pictures `gone` out of an FLV file.
fn without_tags(bytes: &[u8], gone: std::ops::Range<usize>) -> Vec<u8> {
    let mut out = bytes[..13].to_vec();
    let (mut at, mut picture) = (13, 0);
    while at < bytes.len() {
        let size = u32::from_be_bytes([0, bytes[at + 1], bytes[at + 2], bytes[at + 3]]) as usize;
        let tag = &bytes[at..at + 15 + size];
        // The second byte of H.264's tag is 1 for pictures, 0 for the decoder's parameters.
        let is_picture = tag[0] == 9 && tag[12] == 1;
        if !(is_picture && gone.contains(&picture)) {
            out.extend(tag);
        }
        picture += usize::from(is_picture);
        at += tag.len();
    }
    out
}

#[test]
fn pictures_predicted_from_whole_tags_that_are_gone_are_not_believed() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = encode(
        folder.path(),
        "a.flv",
        COUNT,
        &["-c:v", "libx264", "-g", "12", "-bf", "0", "-sc_threshold", "0", "-profile:v", "high"],
    );
    let whole = std::fs::read(&path).unwrap();
    for (gone, cause, undecoded) in [(14..17, Cause::Damage, 17..24), (24..36, Cause::Unknown, 0..0)] {
        let count = gone.len();
        std::fs::write(&path, without_tags(&whole, gone.clone())).unwrap();
        let (frames, _, gaps, _) = read(&path);
        let gap = Gap { after: Some(gone.start as u64 - 1), frames: Some(count as u64), cause };
        assert_eq!((frames.len(), &gaps.places[..]), (COUNT - count, &[gap][..]), "{gone:?}");
        for (k, frame) in frames.iter().enumerate() {
            let i = if k < gone.start { k } else { k + count };
            assert_eq!(told(frame), (!undecoded.contains(&i)).then_some(i), "{gone:?}: picture {i}");
        }
    }
}

#[test]
fn a_film_without_its_end_is_cut() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    for (name, arguments) in OTHERS.iter().filter(|(name, _)| *name != "m.mpg") {
        let path = encode(folder.path(), name, COUNT, arguments);
        let whole = std::fs::read(&path).unwrap();
        // The end of ASF is an index of what is there.
        let nearly = match &name[2..] {
            "asf" | "wmv" => whole.len() * 9 / 10,
            // A tag of 20 bytes ends the film.
            "flv" => whole.len() - 25,
            _ => whole.len() - 1,
        };
        for keep in [whole.len() * 6 / 10, nearly] {
            std::fs::write(&path, &whole[..keep]).unwrap();
            let (_, ending, _, _) = read(&path);
            assert!(matches!(ending, Ending::Early { .. }), "{name}: {keep} of {} bytes", whole.len());
        }
    }
}

#[test]
fn damage_between_the_header_and_the_first_picture_is_told() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    // Byte at which the first picture is, and how many bytes are gone: that picture, and some after it.
    let films = OTHERS.iter().filter(|(name, _)| ["t.ogv", "a.nut"].contains(name));
    for (name, arguments) in films {
        let path = encode(folder.path(), name, COUNT, arguments);
        let whole = std::fs::read(&path).unwrap();
        let first = if *name == "t.ogv" {
            // The third page begins the film's pictures.
            whole.windows(5).enumerate().filter(|(_, w)| *w == b"OggS\0").nth(2).unwrap().0
        } else {
            whole.windows(8).position(|w| w == 0x4E4B_E4AD_EECA_4569_u64.to_be_bytes()).unwrap()
        };
        let mut bytes = whole.clone();
        bytes.drain(first + 2..first + whole.len() / 4);
        std::fs::write(&path, &bytes).unwrap();
        let (frames, _, gaps, _) = read(&path);
        assert!(frames.len() < COUNT && gaps.is_damage(), "{name}: {} frames, {gaps:?}", frames.len());
        assert!(gaps.places.iter().any(|g| g.after.is_none()), "{name}: {gaps:?}");
    }
}

/// Arguments that make MPEG program streams, in which packets lack display times.
const PROGRAM_STREAMS: [(&str, &[&str]); 9] = [
    ("2.mpg", &["-c:v", "mpeg2video", "-bf", "0"]),
    ("2b.mpg", &["-c:v", "mpeg2video", "-bf", "2"]),
    ("1b.mpg", &["-c:v", "mpeg1video", "-bf", "2"]),
    ("open.mpg", &["-c:v", "mpeg2video", "-bf", "2", "-b_strategy", "1", "-g", "15"]),
    ("a.vob", &["-c:v", "mpeg2video", "-bf", "2"]),
    ("d.mpg", &["-f", "dvd", "-c:v", "mpeg2video", "-bf", "2"]),
    ("s.mpg", &["-f", "svcd", "-c:v", "mpeg2video", "-bf", "2"]),
    ("h.mpg", &["-c:v", "libx264", "-qp", "20"]),
    ("h.vob", &["-c:v", "libx264", "-qp", "20", "-bf", "3"]),
];

#[test]
fn a_program_stream_has_each_picture_once_in_its_time() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    for ((name, arguments), rate) in PROGRAM_STREAMS.iter().zip(["25", "30", "50"].iter().cycle()) {
        let stamps = format!("setpts=N/{rate}/TB");
        let mut all = vec!["-vf", &*stamps, "-r", rate, "-q:v", "2"];
        all.extend(*arguments);
        let path = encode(folder.path(), name, 120, &all);
        let (frames, ending, gaps, base) = read(&path);
        assert_eq!((frames.len(), ending, gaps), (120, Ending::Complete, Gaps::default()), "{name}");
        let step = 1.0 / rate.parse::<f64>().unwrap();
        for (i, frame) in frames.iter().enumerate() {
            let time = base.seconds(frame.ticks) - base.seconds(frames[0].ticks);
            assert!((time - i as f64 * step).abs() < 0.000_1, "{name} frame {i}: {time} s");
            assert_eq!(told(frame), Some(i), "{name}");
        }
        // The survey of stamps says the same.
        let mut source = open(path.to_str().unwrap(), &OpenOptions::default()).unwrap();
        let times = source.stamps().unwrap().unwrap().0;
        assert_eq!(times, frames.iter().map(|f| f.ticks).collect::<Vec<_>>(), "{name}");
    }
}

/// Film in MXF, which gives packets no times: libavformat counts them. The last lies whole in one element.
const MXF: [(&str, &[&str]); 7] = [
    ("b.mxf", &["-c:v", "mpeg2video", "-bf", "2", "-g", "12"]),
    ("i.mxf", &["-c:v", "mpeg2video", "-g", "1"]),
    ("h.mxf", &["-c:v", "libx264", "-bf", "2", "-g", "12", "-sc_threshold", "0"]),
    ("j.mxf", &["-c:v", "jpeg2000"]),
    ("x.mxf", &["-s", "720x576", "-pix_fmt", "yuv422p", "-c:v", "dnxhd", "-profile:v", "dnxhr_sq"]),
    ("d.mxf", &["-s", "720x576", "-c:v", "dvvideo"]),
    (
        "o.mxf",
        &[
            "-s",
            "720x576",
            "-pix_fmt",
            "yuv422p",
            "-c:v",
            "dnxhd",
            "-profile:v",
            "dnxhr_sq",
            "-f",
            "mxf_opatom",
        ],
    ),
];

#[test]
fn bytes_cut_out_of_mxf_are_told_and_no_picture_is_out_of_its_time() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let options = OpenOptions { interlaced: Interlaced::AsFrames, ..OpenOptions::default() };
    let read = |path: &Path| {
        let mut source = open(path.to_str().unwrap(), &options).unwrap();
        let frames = read_all(&mut *source);
        assert_eq!(source.info().declared_frames, Some(COUNT as u64), "{path:?}");
        (frames, source.ending(), source.gaps())
    };
    for (name, arguments) in MXF {
        // Of noise, so that each packet is long.
        let mut all = vec!["-vf", "setpts=N/25/TB,noise=alls=8:all_seed=1", "-r", "25", "-q:v", "3"];
        all.extend(arguments);
        let path = encode(folder.path(), name, COUNT, &all);
        let whole = std::fs::read(&path).unwrap();
        let (frames, ending, gaps) = read(&path);
        assert_eq!((frames.len(), ending, gaps), (COUNT, Ending::Complete, Gaps::default()), "{name}");
        let truth: Vec<_> = frames.iter().map(|f| (f.ticks, samples(f).unwrap())).collect();
        assert!(truth.iter().zip(0..).all(|((ticks, _), i)| *ticks == i), "{name}");
        for (from, to) in [(0.5, 0.501), (0.5, 0.6), (0.3, 0.32), (0.75, 0.88), (0.85, 1.0)] {
            let place = |part: f64| (whole.len() as f64 * part) as usize;
            let mut bytes = whole.clone();
            bytes.drain(place(from)..place(to));
            std::fs::write(&path, &bytes).unwrap();
            let (frames, ending, gaps) = read(&path);
            let undecoded = frames.iter().filter(|f| f.plane.is_none()).count();
            let what = format!(
                "{name} {from}: {} frames, {undecoded} undecoded, {ending:?}, {gaps:?}",
                frames.len()
            );
            assert!(gaps.is_damage() || undecoded > 0 || ending != Ending::Complete, "{what}");
            // Of one element nothing tells where it is broken.
            let is_in_time = |f: &Frame| samples(f).is_none_or(|s| (f.ticks, s) == truth[f.index as usize]);
            assert!(name == "o.mxf" || frames.iter().all(is_in_time), "{what}");
            // The earliest break is at 0.3 of a file that begins with a header of a tenth, and up to 5 pictures wait for others.
            assert!(frames.len() - undecoded > COUNT / 8, "{what}");
        }
    }
}
