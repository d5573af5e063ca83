//! Photron pairs: every packing, both headers, ends that do not match, headers that lie.

use std::path::{Path, PathBuf};

use tracker::frame::{Ending, FrameSource, PixelFormat, RateOrigin};
use tracker::source::{OpenOptions, open};

use crate::film::{checksums, read_all, real, samples};

const WIDTH: usize = 6;
const HEIGHT: usize = 5;

/// A `.cih` with changes: a key with an empty value is left out.
fn cih(changes: &[(&str, &str)], end: &str) -> String {
    let mut keys = vec![
        ("Record Rate(fps)", "15000"),
        ("Shutter Speed(s)", "1/15371"),
        ("Total Frame", "4"),
        ("Start Frame", "-20"),
        ("Correct Trigger Frame", "0"),
        ("Save Step", "5"),
        ("Image Width", "6"),
        ("Image Height", "5"),
        ("Color Type", "Mono"),
        ("Color Bit", "8"),
        ("File Format", "MRaw"),
        ("EffectiveBit Depth", "12"),
        ("EffectiveBit Side", "Lower"),
    ];
    for (key, value) in changes {
        keys.retain(|(k, _)| k != key);
        if !value.is_empty() {
            keys.push((key, value));
        }
    }
    let lines = keys.iter().map(|(k, v)| format!("{k} : {v}{end}")).collect::<String>();
    format!("#Camera Information Header{end}Comment Text : a : b{end}Partition Number: 1{end}{lines}")
}

/// A `.cihx` as the viewer writes it: envelope, XML, something after it.
fn cihx(bits: u32, side: &str) -> Vec<u8> {
    let xml = format!(
        "<cih>\r\n<imageFileInfo><fileFormat>Mraw</fileFormat><resolution><width>99</width><height>98</height>\
         </resolution></imageFileInfo><imageDataInfo><resolution><width>6</width><height>5</height></resolution>\
         <colorInfo><type>Raw</type><bit>{bits}</bit></colorInfo><effectiveBit><depth>12</depth><side>{side}</side>\
         </effectiveBit></imageDataInfo><frameInfo><totalFrame>4</totalFrame><startFrame>52</startFrame>\
         <skipFrame>2500</skipFrame></frameInfo><recordInfo><recordRate>50000</recordRate>\
         <shutterSpeed>50000</shutterSpeed></recordInfo></cih>\r\n"
    );
    let mut bytes = b"!!! This file can not be edited. !!!".to_vec();
    bytes.resize(256, 0xcd);
    bytes.extend(b"CIHX\x01\0\0\0\x02\0\0\0");
    bytes.resize(316, 0);
    bytes.extend(xml.as_bytes());
    bytes.extend([0xff, 0xd8, 0, 1, 2]);
    bytes
}

/// Value of pixel `i` of frame `frame`, spread over `bits` bits.
fn value(frame: usize, i: usize, bits: u32) -> u32 {
    ((frame * 7919 + i * 104_729) as u32).wrapping_mul(2_654_435_761) >> (32 - bits)
}

/// Frames as the camera packs them: most significant bit first, or pairs of bytes, low one first.
fn pixels(count: usize, bits: u32, shift: u32) -> Vec<u8> {
    let mut bytes = Vec::new();
    for frame in 0..count {
        let values = (0..WIDTH * HEIGHT).map(|i| value(frame, i, bits - shift) << shift);
        match bits {
            16 => bytes.extend(values.flat_map(|v| (v as u16).to_le_bytes())),
            _ => {
                let run: Vec<u8> =
                    values.flat_map(|v| (0..bits).rev().map(move |k| (v >> k & 1) as u8)).collect();
                bytes.extend(
                    run.chunks(8).map(|c| c.iter().enumerate().fold(0, |b, (k, bit)| b | bit << (7 - k))),
                );
            }
        }
    }
    bytes
}

fn pair(folder: &Path, header: &[u8], ending: &str, pixels: &[u8]) -> (PathBuf, PathBuf) {
    let paths = (folder.join(format!("a.{ending}")), folder.join("a.mraw"));
    std::fs::write(&paths.0, header).unwrap();
    std::fs::write(&paths.1, pixels).unwrap();
    paths
}

fn open_path(path: &Path) -> tracker::error::Result<Box<dyn FrameSource>> {
    open(path.to_str().unwrap(), &OpenOptions::default())
}

#[test]
fn every_packing_gives_every_value_from_either_file() {
    for bits in [8, 10, 12, 16] {
        for (side, shift) in [("Lower", 0), ("Higher", if bits == 16 { 4 } else { 0 })] {
            for form in ["cih", "cihx"] {
                let folder = tempfile::tempdir().unwrap();
                let end = if side == "Lower" { "\n" } else { "\r\n" };
                let text = cih(&[("Color Bit", &bits.to_string()), ("EffectiveBit Side", side)], end);
                let header = if form == "cih" { text.into_bytes() } else { cihx(bits, side) };
                // 16 bit hold 12 significant ones, at the bottom or at the top.
                let stored = if bits == 16 && shift == 0 { 12 } else { bits };
                let data = if stored == bits {
                    pixels(4, bits, shift)
                } else {
                    let values =
                        (0..4).flat_map(|f| (0..WIDTH * HEIGHT).map(move |i| value(f, i, 12) as u16));
                    values.flat_map(u16::to_le_bytes).collect()
                };
                let (a, b) = pair(folder.path(), &header, form, &data);
                for path in [a, b] {
                    let mut source = open_path(&path).unwrap();
                    let depth = if bits == 16 { 12 } else { bits };
                    assert_eq!(source.info().depth_bits, depth);
                    let rate = if form == "cih" { 3000.0 } else { 20.0 };
                    assert_eq!(source.info().rate_hz, Some(rate), "{form}");
                    assert_eq!(source.info().rate_origin, RateOrigin::CameraHeader);
                    let time_base = source.info().time_base;
                    let frames = read_all(&mut *source);
                    assert_eq!(frames.len(), 4);
                    assert_eq!(source.ending(), Ending::Complete);
                    for (f, frame) in frames.iter().enumerate() {
                        let expected: Vec<u32> = (0..WIDTH * HEIGHT).map(|i| value(f, i, depth)).collect();
                        assert_eq!(
                            samples(frame).unwrap(),
                            expected,
                            "{bits} bit, {side}, {form}, frame {f}"
                        );
                        assert!((time_base.seconds(frame.ticks) - f as f64 / rate).abs() < 1e-15);
                    }
                }
            }
        }
    }
}

#[test]
fn the_trigger_and_the_exposure_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let (path, _) = pair(folder.path(), cih(&[], "\n").as_bytes(), "cih", &pixels(4, 8, 0));
    let details = open_path(&path).unwrap().info().details.clone();
    let get = |key: &str| details.iter().find(|(k, _)| k == key).map(|(_, v)| v.clone());
    // Numbers -20, -15, -10, -5 were saved: the trigger, 0, is the one after these.
    assert_eq!(get("trigger frame").as_deref(), Some("4"));
    assert_eq!(get("comment").as_deref(), Some("a : b"));
    let exposure: f64 = get("exposure").unwrap().trim_end_matches(" s").parse().unwrap();
    assert!((exposure - 1.0 / 15371.0).abs() < 1e-15);
}

#[test]
fn a_file_cut_inside_a_frame_gives_those_before_it() {
    let folder = tempfile::tempdir().unwrap();
    let frame = WIDTH * HEIGHT * 12 / 8;
    for cut in [1, frame - 1, frame, frame + 7, 3 * frame] {
        let data = pixels(4, 12, 0);
        let keep = data.len() - cut;
        let (path, _) =
            pair(folder.path(), cih(&[("Color Bit", "12")], "\n").as_bytes(), "cih", &data[..keep]);
        let mut source = open_path(&path).unwrap();
        let frames = read_all(&mut *source);
        assert_eq!(frames.len(), keep / frame);
        let Ending::Early { frames: n, byte, reason } = source.ending() else { panic!("cut by {cut}") };
        assert_eq!((n, byte), ((keep / frame) as u64, Some(keep as u64)));
        assert!(reason.contains("of 4"), "{reason}");
        assert!(source.next_frame().unwrap().is_none());
    }
}

#[test]
fn more_bytes_than_declared_are_told_and_not_read() {
    let folder = tempfile::tempdir().unwrap();
    let (path, _) = pair(folder.path(), cih(&[], "\n").as_bytes(), "cih", &pixels(6, 8, 0));
    let mut source = open_path(&path).unwrap();
    assert!(
        source.info().warnings.iter().any(|w| w.to_string().contains("60 bytes more")),
        "{:?}",
        source.info().warnings
    );
    assert_eq!(read_all(&mut *source).len(), 4);
    assert_eq!(source.ending(), Ending::Complete);
}

#[test]
fn keys_that_lie_or_are_missing_are_clear_errors_or_warnings() {
    let folder = tempfile::tempdir().unwrap();
    let data = pixels(4, 8, 0);
    for (changes, expected) in [
        (vec![("Image Width", "1000000000"), ("Image Height", "1000000000")], "not one whole frame"),
        (
            vec![("Image Width", "4294967295"), ("Image Height", "4294967295"), ("Color Bit", "16")],
            "image size",
        ),
        (vec![("Image Width", "-6")], "Image Width"),
        (vec![("Image Width", "")], "Image Width"),
        (vec![("Image Height", "five")], "Image Height"),
        (vec![("Color Bit", "24")], "24 bits per pixel"),
        (vec![("Color Type", "Color")], "Color is not read"),
        (vec![("File Format", "Tiff")], "saved as Tiff"),
    ] {
        let (path, _) = pair(folder.path(), cih(&changes, "\n").as_bytes(), "cih", &data);
        let error = open_path(&path).err().unwrap().to_string();
        assert!(error.contains(expected), "{error}");
    }
    // 2^40 frames: what is there is read, and the end says what is not.
    let (path, _) =
        pair(folder.path(), cih(&[("Total Frame", "1099511627776")], "\n").as_bytes(), "cih", &data);
    let mut source = open_path(&path).unwrap();
    assert_eq!(read_all(&mut *source).len(), 4);
    assert!(matches!(source.ending(), Ending::Early { frames: 4, .. }));
    for (changes, rate) in [
        (vec![("Save Step", "")], Some(15000.0)),
        (vec![("Save Step", "0")], Some(15000.0)),
        (vec![("Record Rate(fps)", "10000.0")], Some(2000.0)),
        (vec![("Record Rate(fps)", "")], None),
        (vec![("Record Rate(fps)", "fast")], None),
        (vec![("Save Step", "9223372036854775807"), ("Record Rate(fps)", "1e-9")], None),
    ] {
        let (path, _) = pair(folder.path(), cih(&changes, "\r\n").as_bytes(), "cih", &data);
        let source = open_path(&path).unwrap();
        if changes[0].1 != "9223372036854775807" {
            assert_eq!(source.info().rate_hz, rate, "{changes:?}");
        }
        if rate.is_none() && changes.len() == 1 {
            assert_eq!(source.info().rate_origin, RateOrigin::Unknown);
            assert!(source.info().warnings.iter().any(|w| w.to_string().contains("with fps")));
        }
    }
}

#[test]
fn a_missing_partner_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let (header, data) = pair(folder.path(), cih(&[], "\n").as_bytes(), "cih", &pixels(4, 8, 0));
    std::fs::remove_file(&header).unwrap();
    assert!(open_path(&data).err().unwrap().to_string().contains(".cihx or .cih"));
    std::fs::write(&header, cih(&[], "\n")).unwrap();
    std::fs::remove_file(&data).unwrap();
    assert!(open_path(&header).err().unwrap().to_string().contains(".mraw"));
}

#[test]
fn the_real_showcase_is_150_hz() {
    let Some(path) = real("photron/data_showcase.cih") else { return };
    let mut source = open_path(&path).unwrap();
    let info = source.info().clone();
    assert_eq!((info.width, info.height, info.format, info.depth_bits), (640, 40, PixelFormat::Gray8, 8));
    assert_eq!(info.rate_hz, Some(150.0));
    let frames = read_all(&mut *source);
    assert_eq!((frames.len(), source.ending()), (75, Ending::Complete));
    assert!((info.time_base.seconds(frames[74].ticks) - 74.0 / 150.0).abs() < 1e-15);
}

#[test]
fn the_real_ball_falls_in_a_straight_line_and_a_cut_copy_ends_early() {
    let Some(path) = real("photron/ball_12bit.mraw") else { return };
    let mut source = open_path(&path).unwrap();
    assert_eq!((source.info().format, source.info().depth_bits), (PixelFormat::Packed12, 12));
    assert_eq!(source.info().rate_hz, Some(30000.0));
    let frames = read_all(&mut *source);
    assert_eq!(frames.len(), 15);
    // Centre of what is darker than half the mean above the dark floor, which begins at row 330.
    let centres: Vec<(f64, f64)> = frames
        .iter()
        .map(|frame| {
            let values = samples(frame).unwrap();
            let mean = values.iter().map(|v| f64::from(*v)).sum::<f64>() / values.len() as f64;
            let (mut n, mut x, mut y) = (0.0, 0.0, 0.0);
            for (i, v) in values.iter().enumerate() {
                let weight = mean * 0.5 - f64::from(*v);
                if weight > 0.0 && i / 384 < 300 {
                    n += weight;
                    x += weight * (i % 384) as f64;
                    y += weight * (i / 384) as f64;
                }
            }
            (x / n, y / n)
        })
        .collect();
    let speed = (centres[14].1 - centres[0].1) / 14.0;
    // 2.647 px per frame with a residual of 0.02 px; this centre is coarser.
    assert!((speed - 2.647).abs() < 0.05, "{speed} px per frame, {centres:?}");

    let folder = tempfile::tempdir().unwrap();
    let whole = std::fs::read(&path).unwrap();
    std::fs::write(folder.path().join("cut.mraw"), &whole[..221_184 * 9 + 1000]).unwrap();
    std::fs::copy(path.with_extension("cihx"), folder.path().join("cut.cihx")).unwrap();
    let mut source = open_path(&folder.path().join("cut.mraw")).unwrap();
    assert_eq!(read_all(&mut *source).len(), 9);
    let Ending::Early { frames: 9, byte: Some(1_991_656), .. } = source.ending() else {
        panic!("{:?}", source.ending())
    };
}

#[test]
fn another_reader_sees_the_same_pixels() {
    // From pyMRAW 0.33.0 (PyPI) on numpy 2.4.6: `a = pyMRAW.load_video(header)[0].astype("u8").reshape(count, -1)`,
    // `(a * numpy.arange(1, a.shape[1] + 1, dtype="u8")).sum(1)`.
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/formats");
    let files = [
        (
            Some(fixtures.join("photron_12bit.cih")),
            [8_166_494_695, 8_161_594_849, 8_123_736_791, 97_833_768_667],
        ),
        (Some(fixtures.join("photron_8bit.cih")), [511_082_307, 510_929_113, 508_685_926, 6_124_082_518]),
        (
            real("photron/ball_12bit.cihx"),
            [36_072_393_126_146, 35_767_363_734_340, 35_470_149_569_596, 536_649_161_285_568],
        ),
        (
            real("photron/data_showcase.cih"),
            [32_986_669_912, 33_229_407_964, 33_223_918_442, 2_489_926_019_848],
        ),
    ];
    for (path, expected) in files {
        let Some(path) = path else { continue };
        let frames = read_all(&mut *open_path(&path).unwrap());
        assert_eq!(checksums(&frames), expected, "{}", path.display());
    }
}
