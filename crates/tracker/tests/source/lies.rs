//! Headers that promise 10^9 x 10^9 pixels or 2^40 frames: an error or what is there, with little memory.

use std::path::Path;
use std::process::Command;

use crate::film::{encode, have_ffmpeg};

/// Runs `tracker info --count` with 4 GiB of address space, which is less than any lie here would take. Its libraries
/// alone map 1 GiB.
fn info(path: &Path) -> (i32, String) {
    let done = Command::new("sh")
        .args(["-c", "ulimit -v 4194304; exec \"$0\" info --count \"$1\""])
        .arg(env!("CARGO_BIN_EXE_tracker"))
        .arg(path)
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&[done.stdout, done.stderr].concat()).into_owned();
    assert!(!text.contains("panicked"), "{text}");
    (done.status.code().unwrap_or_else(|| panic!("{}: killed: {text}", path.display())), text)
}

const BIG: u32 = 1_000_000_000;

/// The place of the only occurrence, or the first, of some bytes.
fn find(bytes: &[u8], word: &[u8]) -> usize {
    bytes.windows(word.len()).position(|w| w == word).unwrap()
}

fn put(bytes: &mut [u8], at: usize, new: &[u8]) {
    bytes[at..at + new.len()].copy_from_slice(new);
}

#[test]
fn pictures_that_no_file_can_hold_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let le = BIG.to_le_bytes();
    let mut bmp = vec![0u8; 200];
    put(&mut bmp, 0, b"BM");
    put(&mut bmp, 10, &[54]);
    put(&mut bmp, 14, &[40]);
    put(&mut bmp, 18, &le);
    put(&mut bmp, 22, &le);
    put(&mut bmp, 26, &[1, 0, 8, 0]);
    // One strip, of 200 bytes.
    let mut tiff = b"II*\0\x08\0\0\0\x07\0".to_vec();
    let (long, short) = (4u16, 3u16);
    for (tag, kind, value) in [
        (256u16, long, BIG),
        (257, long, BIG),
        (258, short, 8),
        (262, short, 1),
        (273, long, 200),
        (278, long, BIG),
        (279, long, 200),
    ] {
        tiff.extend(tag.to_le_bytes());
        tiff.extend(kind.to_le_bytes());
        tiff.extend(1u32.to_le_bytes());
        tiff.extend(value.to_le_bytes());
    }
    tiff.resize(500, 0);
    let pgm = format!("P5 {BIG} {BIG} 255\n").into_bytes();
    let cih = format!(
        "#Camera Information Header\nRecord Rate(fps) : 1000\nTotal Frame : {}\nImage Width : {BIG}\n\
         Image Height : {BIG}\nColor Bit : 12\nColor Type : Mono\nFile Format : MRaw\n",
        1u64 << 40
    );
    let cihx = format!(
        "<cih><imageDataInfo><resolution><width>{BIG}</width><height>{BIG}</height></resolution><colorInfo>\
         <type>Mono</type><bit>16</bit></colorInfo></imageDataInfo><frameInfo><totalFrame>{}</totalFrame></frameInfo>\
         <recordInfo><recordRate>1000</recordRate></recordInfo></cih>",
        1u64 << 40
    );
    let y4m = format!("YUV4MPEG2 W{BIG} H{BIG} F500:1 Ip A1:1 Cmono\nFRAME\n{}", "a".repeat(500));
    // Its headers are at 44 and 84.
    let mut cine = vec![0u8; 8192];
    put(&mut cine, 0, b"CI\x2c\0\0\0\x01\0");
    put(&mut cine, 8, &[0xff; 16]);
    for (at, value) in [(24, 44u32), (28, 84), (32, 6000), (44, 40), (48, BIG), (52, BIG)] {
        put(&mut cine, at, &value.to_le_bytes());
    }
    put(&mut cine, 56, &[1, 0, 16, 0]);
    put(&mut cine, 84 + 142, &5000u16.to_le_bytes());
    put(&mut cine, 84 + 140, b"ST");
    std::fs::write(folder.path().join("a.mraw"), [0; 500]).unwrap();
    std::fs::write(folder.path().join("b.mraw"), [0; 500]).unwrap();
    let pictures = folder.path().join("pictures");
    std::fs::create_dir(&pictures).unwrap();
    for (name, bytes) in [
        ("pictures/a.bmp", bmp),
        ("a.tif", tiff),
        ("a.cih", cih.into_bytes()),
        ("b.cihx", cihx.into_bytes()),
        ("a.y4m", y4m.into_bytes()),
        ("a.cine", cine),
    ] {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        let given = if name.starts_with("pictures") { pictures.clone() } else { path };
        let (status, text) = info(&given);
        assert!(status == 2 && text.starts_with("tracker: "), "{name}: {status}, {text}");
    }
    std::fs::remove_file(pictures.join("a.bmp")).unwrap();
    std::fs::write(pictures.join("a.pgm"), pgm).unwrap();
    let (status, text) = info(&pictures);
    assert!(status == 2 && text.starts_with("tracker: "), "pgm: {status}, {text}");
}

#[test]
fn frames_that_no_file_can_hold_are_not_waited_for() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.cih");
    let header = format!(
        "#Camera Information Header\nRecord Rate(fps) : 1000\nTotal Frame : {}\nImage Width : 4\n\
         Image Height : 4\nColor Bit : 8\nColor Type : Mono\nFile Format : MRaw\n",
        1u64 << 40
    );
    std::fs::write(&path, header).unwrap();
    std::fs::write(folder.path().join("a.mraw"), [7; 40]).unwrap();
    let (status, text) = info(&path);
    assert!(status == 1 && text.contains("2 frames") && text.contains("ends 8 bytes into frame 2"), "{text}");
}

#[test]
fn containers_that_lie_are_errors_or_give_what_they_hold() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let raw = ["-c:v", "rawvideo", "-pix_fmt", "gray"];

    // AVI: the size of the picture, then the number of frames.
    let path = encode(folder.path(), "a.avi", 5, &raw);
    let good = std::fs::read(&path).unwrap();
    let mut bytes = good.clone();
    let format = find(&bytes, b"strf") + 8;
    put(&mut bytes, format + 4, &BIG.to_le_bytes());
    put(&mut bytes, format + 8, &BIG.to_le_bytes());
    std::fs::write(&path, &bytes).unwrap();
    let (status, text) = info(&path);
    assert!(status == 2 && text.starts_with("tracker: "), "avi size: {status}, {text}");
    let mut bytes = good;
    let stream = find(&bytes, b"strh") + 8;
    put(&mut bytes, stream + 32, &[0xff, 0xff, 0xff, 0x7f]);
    std::fs::write(&path, &bytes).unwrap();
    let (status, text) = info(&path);
    assert!(status < 2 && text.contains(" 5 frames"), "avi frames: {status}, {text}");

    // QuickTime: size in the description of the stream; number of samples in the table of their sizes.
    let path = encode(folder.path(), "a.mov", 5, &["-c:v", "png"]);
    let good = std::fs::read(&path).unwrap();
    let mut bytes = good.clone();
    let table = find(&bytes, b"stsz") + 12;
    put(&mut bytes, table, &[0x7f, 0xff, 0xff, 0xff]);
    std::fs::write(&path, &bytes).unwrap();
    let (status, text) = info(&path);
    assert!((0..=2).contains(&status), "mov samples: {status}, {text}");
    let mut bytes = good;
    // The PNG pictures' own size, with the check sum that goes with it left wrong.
    let head = find(&bytes, b"IHDR") + 4;
    put(&mut bytes, head, &[0x3b, 0x9a, 0xca, 0, 0x3b, 0x9a, 0xca, 0]);
    std::fs::write(&path, &bytes).unwrap();
    let (status, text) = info(&path);
    assert!((0..=2).contains(&status), "png size: {status}, {text}");
}
