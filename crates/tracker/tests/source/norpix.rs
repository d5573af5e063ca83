//! NorPix sequences: every form that is read, times, rings, ends that do not match, headers that lie.

use std::path::Path;

use tracker::frame::{Ending, FrameSource, PixelFormat, RateOrigin};
use tracker::source::{OpenOptions, open};

use crate::film::{HEIGHT, WIDTH, encode, gray_jpeg, have_ffmpeg, index_of, read_all, samples};

const W: usize = 6;
const H: usize = 5;
/// 2023-11-14, s since 1970.
const BEGIN_S: u64 = 1_700_000_000;

/// Parts of a made sequence.
#[derive(Clone)]
struct Seq {
    version: u32,
    size: [usize; 2],
    bits: u32,
    real_bits: u32,
    format: u32,
    compression: u32,
    rate: f64,
    declared: u32,
    /// Bytes of a picture, where that is not what its samples take.
    image_bytes: Option<usize>,
    pictures: Vec<Vec<u8>>,
    /// When each was taken, us after the beginning.
    taken_us: Vec<u64>,
}

impl Seq {
    /// Four pictures of 8 bits at 500 frames per second.
    fn new(version: u32) -> Self {
        let pictures = (0..4).map(|k| (0..W * H).map(|i| (k * 31 + i * 7) as u8).collect()).collect();
        Self {
            version,
            size: [W, H],
            bits: 8,
            real_bits: 8,
            format: 100,
            compression: 0,
            rate: 500.0,
            declared: 4,
            image_bytes: None,
            pictures,
            taken_us: (0..4).map(|k| k * 2000).collect(),
        }
    }

    fn stamp(&self, us: u64) -> Vec<u8> {
        let mut stamp = ((BEGIN_S + us / 1_000_000) as u32).to_le_bytes().to_vec();
        stamp.extend(((us / 1000 % 1000) as u16).to_le_bytes());
        if self.version >= 5 {
            stamp.extend(((us % 1000) as u16).to_le_bytes());
        }
        stamp
    }

    fn bytes(&self) -> Vec<u8> {
        let image_bytes = self.image_bytes.unwrap_or(self.pictures[0].len());
        let aligned = self.version >= 5 && self.compression == 0;
        // As the recorder does: pictures begin at multiples of 8192 bytes.
        let step = if aligned { (image_bytes + 8).next_multiple_of(8192) } else { image_bytes + 16 };
        let mut bytes = vec![0; 1024];
        let mut put = |at: usize, what: &[u8]| bytes[at..at + what.len()].copy_from_slice(what);
        put(0, &0xfeedu32.to_le_bytes());
        let name: Vec<u8> = "Norpix seq".encode_utf16().flat_map(u16::to_le_bytes).collect();
        put(4, &name);
        let text: Vec<u8> = "a drop".encode_utf16().flat_map(u16::to_le_bytes).collect();
        put(36, &text);
        let words = [
            (28, self.version),
            (32, 1024),
            (548, self.size[0] as u32),
            (552, self.size[1] as u32),
            (556, self.bits),
            (560, self.real_bits),
            (564, image_bytes as u32),
            (568, self.format),
            (572, self.declared),
            (580, step as u32),
            (620, self.compression),
        ];
        for (at, word) in words {
            put(at, &word.to_le_bytes());
        }
        put(584, &self.rate.to_le_bytes());
        if aligned {
            bytes.resize(8192, 0);
        }
        for (picture, us) in self.pictures.iter().zip(&self.taken_us) {
            let start = bytes.len();
            if self.compression == 1 {
                bytes.extend((picture.len() as u32 + 4).to_le_bytes());
            }
            bytes.extend(picture);
            bytes.extend(self.stamp(*us));
            let end = if self.compression == 1 { start + 4 + picture.len() + 8 } else { start + step };
            bytes.resize(end, 0);
        }
        bytes
    }
}

fn opened(path: &Path, bytes: &[u8]) -> Box<dyn FrameSource> {
    std::fs::write(path, bytes).unwrap();
    open(path.to_str().unwrap(), &OpenOptions::default()).unwrap()
}

fn problem(path: &Path, bytes: &[u8]) -> String {
    std::fs::write(path, bytes).unwrap();
    open(path.to_str().unwrap(), &OpenOptions::default())
        .err()
        .map_or_else(|| "it was opened".into(), |e| e.to_string())
}

#[test]
fn every_raw_form_gives_every_value_and_time() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.seq");
    let words = |v: u16, big: bool| if big { v.to_be_bytes() } else { v.to_le_bytes() };
    for version in [3, 5] {
        // Bits in the file, bits of the sensor, image format, bits below the significant ones, upper byte first.
        for (bits, real, format, shift, big) in [
            (8, 8, 100, 0, false),
            (8, 8, 101, 0, false),
            (16, 10, 100, 0, false),
            (16, 12, 100, 0, false),
            (16, 16, 100, 0, false),
            (16, 12, 101, 0, false),
            (16, 12, 112, 4, false),
            (16, 10, 114, 6, true),
        ] {
            let mut seq = Seq { bits, real_bits: real, format, ..Seq::new(version) };
            let value = |k: usize, i: usize| {
                ((k * 7919 + i * 104_729) as u32).wrapping_mul(2_654_435_761) >> (32 - real)
            };
            let sample = |v: u32| match bits {
                8 => vec![v as u8],
                _ => words((v << shift) as u16, big).to_vec(),
            };
            seq.pictures = (0..4).map(|k| (0..W * H).flat_map(|i| sample(value(k, i))).collect()).collect();
            let mut source = opened(&path, &seq.bytes());
            let info = source.info().clone();
            assert_eq!(
                (info.container.as_str(), info.width, info.height),
                ("NorPix sequence", W as u32, H as u32)
            );
            assert_eq!((info.depth_bits, info.declared_frames), (if bits == 8 { 8 } else { real }, Some(4)));
            assert_eq!(info.format, if bits == 8 { PixelFormat::Gray8 } else { PixelFormat::Gray16 });
            assert_eq!((info.rate_hz, info.rate_origin), (Some(500.0), RateOrigin::TimeStamps));
            assert_eq!(info.warnings.iter().any(|w| w.to_string().contains("mosaic")), format == 101);
            assert!(
                info.details.contains(&("description".to_owned(), "a drop".to_owned())),
                "{:?}",
                info.details
            );
            assert_eq!(source.sample(3).unwrap().len(), 3);
            let frames = read_all(&mut *source);
            assert_eq!((frames.len(), source.ending()), (4, Ending::Complete));
            for (k, frame) in frames.iter().enumerate() {
                let expected: Vec<u32> = (0..W * H).map(|i| value(k, i)).collect();
                assert_eq!(
                    samples(frame).unwrap(),
                    expected,
                    "version {version}, format {format}, {real} bits"
                );
                assert!((info.time_base.seconds(frame.ticks) - k as f64 * 0.002).abs() < 1e-12);
            }
        }
    }
}

#[test]
fn colours_are_taken_as_brightness_and_long_rows_are_cut() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.seq");
    let gray = |k: usize, i: usize| (k * 31 + i * 7) as u8;
    for (bits, format, pixel) in [(24, 200, 3), (24, 400, 3), (32, 500, 4)] {
        let pixels = |k: usize| (0..W * H).flat_map(|i| vec![gray(k, i); pixel]).collect();
        let seq = Seq { bits, format, pictures: (0..4).map(pixels).collect(), ..Seq::new(5) };
        let frames = read_all(&mut *opened(&path, &seq.bytes()));
        assert!(samples(&frames[2]).unwrap().iter().enumerate().all(|(i, v)| *v == u32::from(gray(2, i))));
    }
    // Only red: 0.299 of it.
    let red = (0..W * H).flat_map(|_| [0, 0, 200]).collect();
    let seq =
        Seq { bits: 24, format: 200, declared: 1, pictures: vec![red], taken_us: vec![0], ..Seq::new(5) };
    assert_eq!(samples(&read_all(&mut *opened(&path, &seq.bytes()))[0]).unwrap()[0], 60);
    // Rows of 8 bytes for 6 pixels.
    let row = |k: usize, y: usize| (0..8).map(move |x| if x < W { gray(k, y * W + x) } else { 250 });
    let pictures = (0..4).map(|k| (0..H).flat_map(|y| row(k, y)).collect()).collect();
    let frames = read_all(&mut *opened(&path, &Seq { pictures, ..Seq::new(5) }.bytes()));
    assert!(samples(&frames[3]).unwrap().iter().enumerate().all(|(i, v)| *v == u32::from(gray(3, i))));
}

#[test]
fn times_are_the_stamps_where_these_make_sense() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.seq");
    let long = |version: u32, taken_us: Vec<u64>, rate: f64| {
        let one = Seq::new(version);
        let pictures = (0..taken_us.len()).map(|k| vec![k as u8; W * H]).collect();
        Seq { declared: taken_us.len() as u32, pictures, taken_us, rate, ..one }
    };
    // 800 Hz by milliseconds, against a header that says 30.
    let seq = long(3, (0..200).map(|k| k * 1250).collect(), 30.0);
    let mut source = opened(&path, &seq.bytes());
    assert!((source.info().rate_hz.unwrap() / 800.0 - 1.0).abs() < 0.005, "{:?}", source.info().rate_hz);
    assert!(
        source.info().warnings.iter().any(|w| w.to_string().contains("header says 30 frames")),
        "{:?}",
        source.info().warnings
    );
    assert!(read_all(&mut *source).windows(2).all(|w| w[0].ticks < w[1].ticks));
    // A frame that the recorder dropped.
    let seq = long(5, (0..60).filter(|k| *k != 20).map(|k| k * 2000 + k % 3).collect(), 500.0);
    let mut source = opened(&path, &seq.bytes());
    let base = source.info().time_base;
    let times: Vec<f64> = read_all(&mut *source).iter().map(|f| base.seconds(f.ticks)).collect();
    assert!((times[20] - times[19] - 0.004).abs() < 3e-6 && (times[21] - times[20] - 0.002).abs() < 3e-6);
    // Recorded in a ring: the oldest is the sixth of the file.
    let mut ring = long(5, (0..20).map(|k| k * 2000).collect(), 500.0);
    ring.pictures.rotate_right(5);
    ring.taken_us.rotate_right(5);
    let mut source = opened(&path, &ring.bytes());
    assert!(
        source.info().warnings.iter().any(|w| w.to_string().contains("picture 5 of the file is the oldest"))
    );
    let frames = read_all(&mut *source);
    assert!(
        frames.iter().enumerate().all(|(k, f)| samples(f).unwrap()[0] == k as u32 && f.ticks == k as i64)
    );
    // No stamps, and the user's word.
    let seq = long(5, vec![0; 20], 250.0);
    let source = opened(&path, &seq.bytes());
    assert_eq!((source.info().rate_hz, source.info().rate_origin), (Some(250.0), RateOrigin::CameraHeader));
    let source =
        open(path.to_str().unwrap(), &OpenOptions { fps: Some(1000.0), ..OpenOptions::default() }).unwrap();
    assert_eq!((source.info().rate_hz, source.info().rate_origin), (Some(1000.0), RateOrigin::User));
}

#[test]
fn a_cut_sequence_ends_early_and_an_open_one_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.seq");
    for version in [3, 5] {
        let bytes = Seq::new(version).bytes();
        let (start, step) = if version == 3 { (1024, W * H + 16) } else { (8192, 8192) };
        for (length, frames) in
            [(start + 3 * step + 7, 3), (start + 2 * step, 2), (start + step + W * H + 3, 1)]
        {
            let mut source = opened(&path, &bytes[..length]);
            assert_eq!(read_all(&mut *source).len(), frames, "{length}");
            let Ending::Early { frames: n, reason, .. } = source.ending() else { panic!("not early") };
            assert_eq!(n, frames as u64);
            assert!(
                reason.contains(&format!("{frames} whole frames of 4 that its header declares")),
                "{reason}"
            );
        }
        assert!(problem(&path, &bytes[..start + 5]).contains("not one whole picture"));
        assert!(problem(&path, &bytes[..700]).contains("the header is cut"));
        // A recorder that was stopped by force leaves 0.
        let mut source = opened(&path, &Seq { declared: 0, ..Seq::new(version) }.bytes());
        assert!(
            source.info().warnings.iter().any(|w| w.to_string().contains("the recording was not closed"))
        );
        assert_eq!((read_all(&mut *source).len(), source.ending()), (4, Ending::Complete));
    }
}

#[test]
fn headers_that_lie_and_forms_that_are_not_read_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.seq");
    let one = || Seq::new(5);
    for (seq, expected) in [
        (Seq { size: [1_000_000_000, 1_000_000_000], ..one() }, "1000000000 x 1000000000 px"),
        (Seq { size: [0, 5], ..one() }, "a picture of 0 x 5 px"),
        (Seq { size: [60, 50], ..one() }, "60 x 50 px of 8 bits need 3000 bytes, and a picture has 30"),
        (Seq { bits: 12, ..one() }, "pixels of 12 bits in image format 100 are not read"),
        (
            Seq { format: 131, bits: 12, ..one() },
            "pictures are packed samples (image format 131), which is not read",
        ),
        (Seq { format: 600, bits: 16, ..one() }, "pictures are YUV (image format 600)"),
        (Seq { format: 77, ..one() }, "pictures are an unknown format (image format 77)"),
        (Seq { compression: 8, ..one() }, "pictures are compressed by H.264, which is not read"),
    ] {
        let told = problem(&path, &seq.bytes());
        assert!(told.contains(expected), "{expected}: {told}");
    }
    // Pictures of 4 GB.
    let mut bytes = one().bytes();
    bytes[564..568].copy_from_slice(&4_000_000_000u32.to_le_bytes());
    bytes[580..584].copy_from_slice(&4_100_000_000u32.to_le_bytes());
    assert!(problem(&path, &bytes).contains("not one whole picture"));
    // From one picture to the next in fewer bytes than a picture takes.
    let mut bytes = one().bytes();
    bytes[580..584].copy_from_slice(&8u32.to_le_bytes());
    assert!(problem(&path, &bytes).contains("8 bytes from picture to picture do not hold 30 bytes"));
    // 2^32 frames are not waited for.
    let mut source = opened(&path, &Seq { declared: u32::MAX, ..one() }.bytes());
    assert_eq!(read_all(&mut *source).len(), 4);
    assert!(matches!(source.ending(), Ending::Early { frames: 4, .. }));
    // Every header byte in turn set to 255: an error or what is there.
    let good = one().bytes();
    for at in (28..36).chain(548..640) {
        let mut bytes = good.clone();
        bytes[at] = 255;
        std::fs::write(&path, &bytes).unwrap();
        if let Ok(mut source) = open(path.to_str().unwrap(), &OpenOptions::default()) {
            assert!(read_all(&mut *source).len() <= 4, "byte {at}");
        }
    }
}

#[test]
fn jpeg_pictures_are_decoded_and_a_broken_one_is_a_frame_without_pixels() {
    let folder = tempfile::tempdir().unwrap();
    for (in_colour, format) in [(false, 100), (true, 200), (false, 102)] {
        if in_colour && !have_ffmpeg() {
            continue;
        }
        let pictures: Vec<Vec<u8>> = if in_colour {
            encode(folder.path(), "%02d.jpg", 25, &["-pix_fmt", "yuvj420p", "-q:v", "2"]);
            (1..=25).map(|k| std::fs::read(folder.path().join(format!("{k:02}.jpg"))).unwrap()).collect()
        } else {
            (0..25).map(gray_jpeg).collect()
        };
        let seq = Seq {
            size: [WIDTH, HEIGHT],
            format,
            compression: 1,
            declared: 25,
            pictures,
            taken_us: (0..25).map(|k| k * 2000).collect(),
            ..Seq::new(5)
        };
        let path = folder.path().join("a.seq");
        let mut source = opened(&path, &seq.bytes());
        assert_eq!((source.info().codec.as_str(), source.info().rate_hz), ("JPEG", Some(500.0)));
        // In colour too, the brightness is the one that is stored.
        assert_eq!(source.info().converted_from, None);
        assert_eq!(source.sample(5).unwrap().len(), 5);
        let frames = read_all(&mut *source);
        assert_eq!((frames.len(), source.ending()), (25, Ending::Complete));
        assert!(frames.iter().enumerate().all(|(k, f)| index_of(&samples(f).unwrap(), 255) == Some(k)));

        let mut broken = seq.clone();
        let end = broken.pictures[7].len();
        broken.pictures[7][end - 80..].fill(0);
        let mut source = opened(&path, &broken.bytes());
        let frames = read_all(&mut *source);
        assert_eq!((frames.len(), source.ending()), (25, Ending::Complete));
        assert!(frames.iter().enumerate().all(|(k, f)| f.plane.is_none() == (k == 7)));

        let bytes = seq.bytes();
        let mut source = opened(&path, &bytes[..bytes.len() - 100]);
        assert_eq!(read_all(&mut *source).len(), 24);
        assert!(matches!(source.ending(), Ending::Early { frames: 24, .. }));
    }
}

#[test]
fn a_sequence_cut_while_it_is_read_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.seq");
    let mut source = opened(&path, &Seq::new(5).bytes());
    let frames = read_all(&mut *source);
    std::fs::File::options().write(true).open(&path).unwrap().set_len(8192 + 2 * 8192).unwrap();
    assert!(frames[1].bytes().is_ok());
    let error = frames[2].bytes().unwrap_err().to_string();
    assert!(error.contains("a.seq, frame 2: the file became shorter while it was read"), "{error}");
}
