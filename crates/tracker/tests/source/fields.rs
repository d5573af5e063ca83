//! Interlaced film: two fields are one picture, and no picture is taken for one moment without a word.

use std::path::Path;
use std::process::Command;

use tracker::frame::Ending;
use tracker::gaps::Gaps;
use tracker::source::{Interlaced, OpenOptions, open};

use crate::film::{WIDTH, encode, have_ffmpeg, picture, read_all};

const COUNT: usize = 13;
/// Macroblocks of 16 px in a frame: wide, high.
const BLOCKS: (usize, usize) = (13, 8);

/// Bits, the most significant first.
#[derive(Default)]
struct Bits(Vec<bool>);

impl Bits {
    fn put(&mut self, count: u32, value: u32) -> &mut Self {
        self.0.extend((0..count).rev().map(|i| value >> i & 1 == 1));
        self
    }

    /// A number as Exp-Golomb code.
    fn code(&mut self, value: u32) -> &mut Self {
        let bits = 32 - (value + 1).leading_zeros();
        self.put(bits - 1, 0).put(bits, value + 1)
    }

    fn bytes(&self) -> Vec<u8> {
        self.0
            .chunks(8)
            .map(|c| c.iter().enumerate().fold(0, |b, (i, on)| b | u8::from(*on) << (7 - i)))
            .collect()
    }
}

/// A unit of the stream, with the bytes that keep its start code unique.
fn unit(header: u8, content: &[u8]) -> Vec<u8> {
    let mut out = vec![0, 0, 0, 1, header];
    let mut zeros = 0;
    for &byte in content {
        if zeros >= 2 && byte <= 3 {
            out.push(3);
            zeros = 0;
        }
        out.push(byte);
        zeros = if byte == 0 { zeros + 1 } else { 0 };
    }
    out
}

/// H.264 of which each picture is two coded fields (as AVCHD cameras write it), its samples as they are. No encoder at
/// hand writes it, so it is written here, by ITU-T H.264, 7.3.
fn field_coded(count: usize, top_first: bool) -> Vec<u8> {
    let mut sequence = Bits::default();
    sequence.put(8, 77).put(8, 0).put(8, 30).code(0).code(0).code(0).code(4).code(1).put(1, 0);
    sequence.code(BLOCKS.0 as u32 - 1).code(BLOCKS.1 as u32 / 2 - 1);
    // Fields, no mixture of fields and frames in one picture; no cropping; 25 pictures per second; no reordering.
    sequence.put(1, 0).put(1, 0).put(1, 1).put(1, 0).put(1, 1).put(4, 0);
    sequence.put(1, 1).put(32, 1).put(32, 50).put(1, 1).put(3, 0);
    sequence.put(1, 1).put(1, 1).code(0).code(0).code(10).code(10).code(0).code(1).put(1, 1);
    let mut picture_set = Bits::default();
    picture_set.code(0).code(0).put(2, 0).code(0).code(0).code(0).put(3, 0);
    picture_set.code(0).code(0).code(0).put(3, 0b100).put(1, 1);
    let mut stream = Vec::new();
    for k in 0..count {
        stream.extend(unit(0x67, &sequence.bytes()));
        stream.extend(unit(0x68, &picture_set.bytes()));
        for second in [false, true] {
            let bottom = second == top_first;
            let moment = picture(2 * k + usize::from(second));
            let mut slice = Bits::default();
            slice.code(0).code(7).code(0).put(4, 0).put(1, 1).put(1, u32::from(bottom));
            if !second {
                slice.code(k as u32 % 2);
            }
            slice.put(8, u32::from(second)).put(if second { 1 } else { 2 }, 0).code(0).code(1);
            let mut bytes = Vec::new();
            for block in 0..BLOCKS.0 * BLOCKS.1 / 2 {
                // A block of samples as they are, each from a whole byte on.
                slice.code(25);
                bytes.extend(std::mem::take(&mut slice).bytes());
                let (bx, by) = (block % BLOCKS.0 * 16, block / BLOCKS.0 * 16);
                for y in by..by + 16 {
                    let row = (2 * y + usize::from(bottom)) * WIDTH;
                    bytes
                        .extend((bx..bx + 16).map(|x| {
                            if x < WIDTH { moment.get(row + x).copied().unwrap_or(30) } else { 30 }
                        }));
                }
                bytes.extend([128; 128]);
            }
            bytes.push(0x80);
            stream.extend(unit(if second { 0x61 } else { 0x65 }, &bytes));
        }
    }
    stream
}

fn as_frames() -> OpenOptions {
    OpenOptions { interlaced: Interlaced::AsFrames, ..OpenOptions::default() }
}

/// Refused with the command that helps; read as it is where that is asked for, each picture once.
fn check(path: &Path, order: &str, count: usize, step_s: Option<f64>) {
    let name = path.to_str().unwrap();
    let Err(error) = open(name, &OpenOptions::default()).map(|mut s| s.sample(4).map(|_| ())).and_then(|r| r)
    else {
        panic!("{name} is not refused")
    };
    let said = error.to_string();
    assert!(
        said.contains(order) && said.contains("-vf bwdif=mode=send_field") && said.contains("as-frames"),
        "{said}"
    );
    let mut source = open(name, &as_frames()).unwrap();
    assert!(source.info().warnings.iter().any(|w| w.to_string().starts_with("interlaced, ")), "{name}");
    assert!(
        source.info().details.iter().any(|(word, said)| word == "fields" && said.contains(order)),
        "{name}"
    );
    if let Some(declared) = source.info().declared_frames {
        assert_eq!(declared, count as u64, "{name}");
    }
    let base = source.info().time_base;
    let frames = read_all(&mut *source);
    assert_eq!(
        (frames.len(), source.ending(), source.gaps()),
        (count, Ending::Complete, Gaps::default()),
        "{name}"
    );
    assert!(frames.iter().all(|f| f.plane.is_some()), "{name}");
    for (i, frame) in frames.iter().enumerate().filter(|_| step_s.is_some()) {
        let time = base.seconds(frame.ticks) - base.seconds(frames[0].ticks);
        // Matroska's ticks are 1 ms.
        assert!((time - i as f64 * step_s.unwrap()).abs() < 0.001_01, "{name} frame {i}: {time} s");
    }
}

#[test]
fn two_fields_are_one_picture() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    for (order, top_first) in [("top field first", true), ("bottom field first", false)] {
        let raw = folder.path().join("a.h264");
        std::fs::write(&raw, field_coded(COUNT, top_first)).unwrap();
        check(&raw, order, COUNT, None);
        for file in ["a.mts", "a.mkv", "a.mp4"] {
            // A field every 20 ms: so fields are a packet each, as a transport stream has them.
            let path = folder.path().join(file);
            let mut command = Command::new("ffmpeg");
            command.args(["-v", "error", "-y", "-r", "50", "-i"]).arg(&raw).args(["-c", "copy"]).arg(&path);
            assert!(command.status().unwrap().success());
            check(&path, order, COUNT, Some(0.04));
        }
    }
}

#[test]
fn interlaced_film_of_any_codec_is_refused_or_read_with_a_word() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let top: &[&str] = &["-vf", "setfield=tff", "-flags", "+ilme+ildct"];
    let dv: &[&str] = &["-vf", "fps=25,scale=720:576,setfield=bff", "-pix_fmt", "yuv420p"];
    for (file, order, common, own) in [
        ("x.mp4", "top", top, &["-c:v", "libx264", "-x264opts", "tff=1"][..]),
        ("x.mkv", "top", top, &["-c:v", "libx264", "-x264opts", "tff=1"]),
        ("m.ts", "top", top, &["-c:v", "mpeg2video", "-r", "50"]),
        ("m.avi", "top", top, &["-c:v", "mpeg4"]),
        ("p.mov", "top", top, &["-c:v", "prores_ks"]),
        ("d.avi", "bottom", dv, &["-c:v", "dvvideo"]),
        ("d.dv", "bottom", dv, &["-c:v", "dvvideo"]),
    ] {
        let arguments: Vec<&str> = common.iter().chain(own).copied().collect();
        let path = encode(folder.path(), file, 40, &arguments);
        let count = match file {
            "m.ts" => 5,
            _ if file.starts_with('d') => 2,
            _ => 40,
        };
        check(&path, order, count, None);
    }
    // Film of whole pictures is read as ever.
    for (file, arguments) in
        [("w.mp4", &["-c:v", "libx264"][..]), ("w.avi", &["-c:v", "mjpeg", "-pix_fmt", "yuvj420p"])]
    {
        let path = encode(folder.path(), file, 20, arguments);
        let mut source = open(path.to_str().unwrap(), &OpenOptions::default()).unwrap();
        assert!(source.info().warnings.is_empty());
        assert_eq!(read_all(&mut *source).len(), 20);
    }
}
