//! TIFF files of other programs: one page with many pictures behind it, samples of every kind, small copies between.

use std::fs::File;
use std::path::Path;

use tiff::encoder::{Compression, DeflateLevel, TiffEncoder, colortype};
use tracker::frame::{Ending, PixelFormat};
use tracker::peak_level::peak_level;
use tracker::source::{OpenOptions, open};

use crate::film::{encode, gray_jpeg, have_ffmpeg, read_all, samples};

/// Size of the pictures, px: a row of 12 or of 1 bit ends inside a byte.
pub const W: usize = 21;
/// See [`W`].
pub const H: usize = 6;

/// Values of a tag.
pub enum Values {
    Short(Vec<u16>),
    Long(Vec<u32>),
    Text(String),
}
use Values::{Long, Short, Text};

/// A TIFF file in the making: each page's directory, what belongs to it, and then its samples.
pub struct Tiff {
    big_endian: bool,
    pub bytes: Vec<u8>,
    /// Where the place of the next directory is written.
    link: usize,
}

impl Tiff {
    pub fn new(big_endian: bool) -> Self {
        let mut tiff = Self { big_endian, bytes: Vec::new(), link: 4 };
        tiff.bytes.extend(if big_endian { b"MM" } else { b"II" });
        tiff.short(42);
        tiff.long(0);
        tiff
    }

    fn short(&mut self, v: u16) {
        self.bytes.extend(if self.big_endian { v.to_be_bytes() } else { v.to_le_bytes() });
    }

    fn long(&mut self, v: u32) {
        self.bytes.extend(if self.big_endian { v.to_be_bytes() } else { v.to_le_bytes() });
    }

    fn patch(&mut self, at: usize, v: usize) {
        let v = v as u32;
        let word = if self.big_endian { v.to_be_bytes() } else { v.to_le_bytes() };
        self.bytes[at..at + 4].copy_from_slice(&word);
    }

    /// A page whose strip takes `strip` bytes of `data`; what is left of them lies behind it.
    pub fn page(self, tags: Vec<(u16, Values)>, data: &[u8], strip: usize) -> Self {
        self.strips(tags, data, &[strip])
    }

    /// A page with strips of these lengths.
    fn strips(mut self, mut tags: Vec<(u16, Values)>, data: &[u8], lengths: &[usize]) -> Self {
        tags.push((273, Long(vec![0; lengths.len()])));
        tags.push((279, Long(lengths.iter().map(|n| *n as u32).collect())));
        tags.sort_by_key(|t| t.0);
        if self.bytes.len() % 2 == 1 {
            self.bytes.push(0);
        }
        self.patch(self.link, self.bytes.len());
        self.short(tags.len() as u16);
        let mut outside = Vec::new();
        let mut strip_at = 0;
        for (tag, values) in &tags {
            self.short(*tag);
            let (kind, count, size) = match values {
                Short(v) => (3, v.len(), 2),
                Long(v) => (4, v.len(), 4),
                Text(t) => (2, t.len() + 1, 1),
            };
            self.short(kind);
            self.long(count as u32);
            if *tag == 273 && count == 1 {
                strip_at = self.bytes.len();
            }
            if count * size > 4 {
                outside.push((self.bytes.len(), values, *tag));
                self.long(0);
            } else {
                let end = self.bytes.len() + 4;
                self.put(values);
                self.bytes.resize(end, 0);
            }
        }
        self.link = self.bytes.len();
        self.long(0);
        for (at, values, tag) in outside {
            self.patch(at, self.bytes.len());
            if tag == 273 {
                strip_at = self.bytes.len();
            }
            self.put(values);
        }
        let mut next = self.bytes.len();
        for (k, length) in lengths.iter().enumerate() {
            self.patch(strip_at + 4 * k, next);
            next += length;
        }
        self.bytes.extend(data);
        self
    }

    fn put(&mut self, values: &Values) {
        match values {
            Short(v) => v.iter().for_each(|v| self.short(*v)),
            Long(v) => v.iter().for_each(|v| self.long(*v)),
            Text(t) => self.bytes.extend(t.bytes().chain([0])),
        }
    }
}

/// The tags that every page has.
pub fn tags(bits: u16, photometric: u16, samples: u16) -> Vec<(u16, Values)> {
    vec![
        (256, Short(vec![W as u16])),
        (257, Short(vec![H as u16])),
        (258, Short(vec![bits; samples as usize])),
        (259, Short(vec![1])),
        (262, Short(vec![photometric])),
        (277, Short(vec![samples])),
        (278, Short(vec![H as u16])),
    ]
}

pub fn with(mut tags: Vec<(u16, Values)>, more: Vec<(u16, Values)>) -> Vec<(u16, Values)> {
    tags.retain(|t| more.iter().all(|m| m.0 != t.0));
    tags.extend(more);
    tags
}

/// Sample `i` of picture `k`, of so many bits.
fn value(k: usize, i: usize, bits: u32) -> u32 {
    ((k * 7919 + i * 104_729 + 13) as u32).wrapping_mul(2_654_435_761) >> (32 - bits)
}

pub fn values(k: usize, bits: u32) -> Vec<u32> {
    (0..W * H).map(|i| value(k, i, bits)).collect()
}

/// Samples as TIFF packs them: rows from whole bytes on, the most significant bit first; 16 bits in the file's order.
pub fn packed(values: &[u32], bits: usize, big_endian: bool) -> Vec<u8> {
    let pair = |v: u32| if big_endian { (v as u16).to_be_bytes() } else { (v as u16).to_le_bytes() };
    if bits == 16 {
        return values.iter().flat_map(|v| pair(*v)).collect();
    }
    let row = |row: &[u32]| {
        let run: Vec<u8> =
            row.iter().flat_map(|v| (0..bits).rev().map(move |k| (v >> k & 1) as u8)).collect();
        run.chunks(8)
            .map(|c| c.iter().enumerate().fold(0, |b, (k, bit)| b | bit << (7 - k)))
            .collect::<Vec<u8>>()
    };
    values.chunks(W).flat_map(row).collect()
}

fn problem(path: &Path) -> String {
    open(path.to_str().unwrap(), &OpenOptions::default())
        .err()
        .map_or_else(|| "it was opened".into(), |e| e.to_string())
}

/// Depth and samples of all frames, how it ended, and what was said of the file.
pub fn read(path: &Path) -> (u32, Vec<Vec<u32>>, Ending, Vec<String>) {
    let options = OpenOptions { fps: Some(100.0), ..OpenOptions::default() };
    let mut source = open(path.to_str().unwrap(), &options).unwrap();
    let frames = read_all(&mut *source);
    let all = frames.iter().map(|f| samples(f).unwrap()).collect();
    let info = source.info();
    assert!(frames.iter().enumerate().all(|(i, f)| (f.index, f.ticks) == (i as u64, i as i64)));
    assert_eq!(info.format, if info.depth_bits > 8 { PixelFormat::Gray16 } else { PixelFormat::Gray8 });
    (info.depth_bits, all, source.ending(), info.warnings.iter().map(ToString::to_string).collect())
}

#[test]
fn pictures_behind_the_only_page_are_frames() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    let imagej = || (270, Text("ImageJ=1.54f\nimages=7\nframes=7\nloop=false\nmin=0.0\n".into()));
    let metamorph = || (33629, Long(vec![0; 7]));
    let tifffile = || (270, Text(format!("{{\"shape\": [7, {H}, {W}], \"truncated\": true}}")));
    for big_endian in [true, false] {
        for bits in [8, 16] {
            for (k, who) in [imagej(), metamorph(), tifffile()].into_iter().enumerate() {
                let data: Vec<u8> =
                    (0..7).flat_map(|k| packed(&values(k, bits as u32), bits, big_endian)).collect();
                let tiff = Tiff::new(big_endian).page(
                    with(tags(bits as u16, 1, 1), vec![who]),
                    &data,
                    data.len() / 7,
                );
                std::fs::write(&path, &tiff.bytes).unwrap();
                let (depth, frames, ending, warnings) = read(&path);
                assert_eq!(
                    (depth, frames.len(), ending),
                    (bits as u32, 7, Ending::Complete),
                    "{big_endian} {bits} {k}"
                );
                assert!(warnings.is_empty(), "{warnings:?}");
                for (k, frame) in frames.iter().enumerate() {
                    assert_eq!(*frame, values(k, bits as u32), "{big_endian} {bits} bit, frame {k}");
                }
                // Cut in the sixth: five are whole.
                let cut = tiff.bytes.len() - data.len() / 7 - 5;
                std::fs::write(&path, &tiff.bytes[..cut]).unwrap();
                let (_, frames, ending, _) = read(&path);
                let Ending::Early { frames: n, reason, .. } = ending else { panic!("not early") };
                assert_eq!((frames.len(), n), (5, 5));
                assert!(reason.contains("5 of 7 pictures that its description declares"), "{reason}");
            }
        }
    }
}

#[test]
fn pictures_behind_a_page_that_is_to_be_turned_are_turned() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    for bits in [8, 16] {
        for (number, size) in [(3, (W, H)), (6, (H, W)), (8, (H, W))] {
            let data: Vec<u8> = (0..3).flat_map(|k| packed(&values(k, bits), bits as usize, false)).collect();
            let more =
                vec![(270, Text("ImageJ=1.54f\nimages=3\nframes=3\n".into())), (274, Short(vec![number]))];
            let page = with(tags(bits as u16, 1, 1), more);
            std::fs::write(&path, Tiff::new(false).page(page, &data, data.len() / 3).bytes).unwrap();
            let mut source = open(path.to_str().unwrap(), &OpenOptions::default()).unwrap();
            for frame in source.sample(3).unwrap().into_iter().chain(read_all(&mut *source)) {
                assert_eq!((frame.width as usize, frame.height as usize), size, "{bits} bit, {number}");
                let (shown, stored) = (samples(&frame).unwrap(), values(frame.index as usize, bits));
                for (at, value) in shown.iter().enumerate() {
                    let (x, y) = (at % size.0, at / size.0);
                    let from = match number {
                        3 => (H - 1 - y) * W + W - 1 - x,
                        6 => (H - 1 - x) * W + y,
                        _ => x * W + W - 1 - y,
                    };
                    assert_eq!(*value, stored[from], "{bits} bit, {number}, ({x}, {y})");
                }
            }
        }
    }
}

#[test]
fn channels_colours_and_white_zeros_behind_one_page() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    let imagej = |more: &str| (270, Text(format!("ImageJ=1.54f\nimages=6\n{more}")));
    let data: Vec<u8> = (0..6).flat_map(|k| packed(&values(k, 8), 8, true)).collect();
    let page = with(tags(8, 1, 1), vec![imagej("channels=2\nframes=3\nhyperstack=true\n")]);
    std::fs::write(&path, Tiff::new(true).page(page, &data, W * H).bytes).unwrap();
    let (_, frames, _, warnings) = read(&path);
    assert_eq!(frames.len(), 6);
    assert!(
        warnings
            .iter()
            .any(|w| w.to_string().starts_with("2 channels, 1 slices and 3 frames: all 6 pictures")),
        "{warnings:?}"
    );
    // An inverted table of brightness.
    std::fs::write(&path, Tiff::new(true).page(with(tags(8, 0, 1), vec![imagej("")]), &data, W * H).bytes)
        .unwrap();
    assert_eq!(read(&path).1[5], values(5, 8).iter().map(|v| 255 - v).collect::<Vec<_>>());
    // Red, green and blue side by side; gray ones keep their value.
    let colours: Vec<u8> = data.iter().flat_map(|v| [*v; 3]).collect();
    std::fs::write(
        &path,
        Tiff::new(true).page(with(tags(8, 2, 3), vec![imagej("")]), &colours, 3 * W * H).bytes,
    )
    .unwrap();
    assert_eq!(read(&path).1[4], values(4, 8));
    // Floating point has no scale, and what is compressed no places.
    let page = with(tags(32, 1, 1), vec![imagej(""), (339, Short(vec![3]))]);
    std::fs::write(&path, Tiff::new(true).page(page, &[0; 6 * 4 * W * H], 4 * W * H).bytes).unwrap();
    assert!(
        problem(&path).contains("floating-point numbers of 32 bits, which have no fixed scale"),
        "{}",
        problem(&path)
    );
    let page = with(tags(8, 1, 1), vec![imagej(""), (259, Short(vec![5]))]);
    std::fs::write(&path, Tiff::new(true).page(page, &[0; 100], 100).bytes).unwrap();
    let told = problem(&path);
    assert!(
        told.contains("ImageJ's description says that it holds 6 pictures, but there is one page"),
        "{told}"
    );
}

#[test]
fn a_stack_above_4_gb_is_read_to_its_end() {
    const SIDE: u64 = 4096;
    const COUNT: u64 = 160;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("long.tif");
    let plane = 2 * SIDE * SIDE;
    let page = with(
        tags(16, 1, 1),
        vec![
            (256, Long(vec![SIDE as u32])),
            (257, Long(vec![SIDE as u32])),
            (278, Long(vec![SIDE as u32])),
            (270, Text(format!("ImageJ=1.54f\nimages={COUNT}\nslices={COUNT}\n"))),
        ],
    );
    let tiff = Tiff::new(true).page(page, &[], plane as usize);
    let start = tiff.bytes.len() as u64;
    std::fs::write(&path, &tiff.bytes).unwrap();
    // 5.4 GB of zeros that take no room, and one bright sample in the last picture.
    let file = File::options().write(true).open(&path).unwrap();
    file.set_len(start + COUNT * plane).unwrap();
    std::os::unix::fs::FileExt::write_all_at(&file, &[0x12, 0x34], start + (COUNT - 1) * plane + 777 * 2)
        .unwrap();
    let mut source = open(path.to_str().unwrap(), &OpenOptions::default()).unwrap();
    assert_eq!(
        (source.info().declared_frames, source.info().size_bytes),
        (Some(COUNT), Some(start + COUNT * plane))
    );
    let frames = read_all(&mut *source);
    assert_eq!((frames.len() as u64, source.ending()), (COUNT, Ending::Complete));
    assert_eq!(peak_level(&frames[0]).unwrap(), Some(0));
    assert_eq!(peak_level(&frames[COUNT as usize - 1]).unwrap(), Some(0x1234));
}

#[test]
fn samples_of_every_kind_are_read_or_refused_in_true_words() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    for big_endian in [true, false] {
        for bits in [1usize, 2, 4, 8, 10, 12, 14, 16] {
            for photometric in [0u16, 1] {
                let (top, stored) = ((1u32 << bits) - 1, values(0, bits as u32));
                let data = packed(&stored, bits, big_endian);
                std::fs::write(
                    &path,
                    Tiff::new(big_endian).page(tags(bits as u16, photometric, 1), &data, data.len()).bytes,
                )
                .unwrap();
                let (depth, frames, _, _) = read(&path);
                let seen = |v: u32| if photometric == 0 { top - v } else { v };
                // Fewer bits than 8 are spread over 8.
                let spread = |v: u32| if bits < 8 { v * 255 / top } else { v };
                let expected: Vec<u32> = stored.iter().map(|v| spread(seen(*v))).collect();
                assert_eq!((depth, &frames[0]), (bits.max(8) as u32, &expected), "{bits} bit, {photometric}");
            }
        }
    }
    // 12 bits in words of 16.
    let data = packed(&values(0, 12), 16, false);
    std::fs::write(&path, Tiff::new(false).page(tags(12, 1, 1), &data, data.len()).bytes).unwrap();
    assert_eq!(read(&path).1[0], values(0, 12));
    // A palette: number v is the gray of 255 - v.
    let ramp: Vec<u16> = (0..256u32).map(|v| ((255 - v) * 257) as u16).collect();
    let page = with(tags(8, 3, 1), vec![(320, Short([&ramp[..], &ramp, &ramp].concat()))]);
    std::fs::write(&path, Tiff::new(false).page(page, &packed(&values(0, 8), 8, false), W * H).bytes)
        .unwrap();
    assert_eq!(read(&path).1[0], values(0, 8).iter().map(|v| 255 - v).collect::<Vec<_>>());

    for (page, expected) in [
        (
            with(tags(32, 1, 1), vec![(339, Short(vec![3]))]),
            "floating-point numbers of 32 bits, which have no fixed scale",
        ),
        (with(tags(64, 1, 1), vec![(339, Short(vec![3]))]), "floating-point numbers of 64 bits"),
        (
            with(tags(16, 1, 1), vec![(339, Short(vec![2]))]),
            "signed numbers of 16 bits, whose zero is not black",
        ),
        (tags(32, 1, 1), "its samples have 32 bits"),
        (with(tags(8, 1, 1), vec![(259, Short(vec![50000]))]), "compressed by Zstandard, which is not read"),
        (with(tags(8, 1, 1), vec![(259, Short(vec![34712]))]), "compressed by JPEG 2000, which is not read"),
        (with(tags(8, 6, 3), vec![(259, Short(vec![6]))]), "compressed by JPEG of the old style"),
        (with(tags(12, 1, 1), vec![(259, Short(vec![5]))]), "its samples of 12 bits are compressed by LZW"),
        (tags(8, 5, 4), "stand for the inks of CMYK, not for brightness"),
        (tags(8, 8, 3), "a colour of L*a*b*"),
        (tags(8, 1, 5), "a pixel has 5 samples of which it does not say what they are"),
    ] {
        std::fs::write(&path, Tiff::new(false).page(page, &[0; 8 * 5 * W * H], 8 * 5 * W * H).bytes).unwrap();
        let told = problem(&path);
        assert!(
            told.contains("the first page cannot be read") && told.contains(expected),
            "{expected}: {told}"
        );
    }
}

#[test]
fn planes_of_colour_and_opacity_are_taken_as_brightness() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    let gray = values(0, 8);
    // All reds, then all greens, then all blues.
    for (bits, big_endian) in [(8, false), (16, false), (16, true)] {
        let one = packed(&values(0, bits), bits as usize, big_endian);
        let data = [&one[..], &one, &one].concat();
        let page = with(tags(bits as u16, 2, 3), vec![(284, Short(vec![2]))]);
        let tiff = Tiff::new(big_endian).strips(page, &data, &[one.len(); 3]);
        std::fs::write(&path, &tiff.bytes).unwrap();
        assert_eq!(read(&path).1[0], values(0, bits), "{bits} {big_endian}");
    }
    let data: Vec<u8> = gray.iter().flat_map(|v| [*v as u8, 255]).collect();
    let page = with(tags(8, 1, 2), vec![(338, Short(vec![2]))]);
    std::fs::write(&path, Tiff::new(false).page(page, &data, data.len()).bytes).unwrap();
    assert_eq!(read(&path).1[0], gray);
}

#[test]
fn compressed_pages_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    for how in [Compression::Lzw, Compression::Packbits, Compression::Deflate(DeflateLevel::Fast)] {
        let mut encoder = TiffEncoder::new(File::create(&path).unwrap()).unwrap().with_compression(how);
        for k in 0..3 {
            let deep: Vec<u16> = values(k, 16).iter().map(|v| *v as u16).collect();
            encoder.write_image::<colortype::Gray16>(W as u32, H as u32, &deep).unwrap();
        }
        drop(encoder);
        let (_, frames, ending, _) = read(&path);
        assert_eq!((frames.len(), ending), (3, Ending::Complete));
        assert!(frames.iter().enumerate().all(|(k, f)| *f == values(k, 16)));
    }
    // A JPEG picture as the strip of a page: gray, and brightness with colours.
    for (photometric, count) in [(1, 1), (6, 3)] {
        if count == 3 && !have_ffmpeg() {
            continue;
        }
        let data = if count == 3 {
            let jpeg = encode(folder.path(), "a.jpg", 1, &["-pix_fmt", "yuvj444p", "-q:v", "2"]);
            std::fs::read(jpeg).unwrap()
        } else {
            gray_jpeg(0)
        };
        let size = [crate::film::WIDTH, crate::film::HEIGHT].map(|n| Short(vec![n as u16]));
        let [w, h] = size;
        let page = with(
            tags(8, photometric, count),
            vec![
                (256, w),
                (257, h),
                (278, Short(vec![crate::film::HEIGHT as u16])),
                (259, Short(vec![7])),
                (530, Short(vec![1, 1])),
            ],
        );
        std::fs::write(&path, Tiff::new(false).page(page, &data, data.len()).bytes).unwrap();
        let (_, frames, _, _) = read(&path);
        let worst = frames[0].iter().zip(crate::film::picture(0)).map(|(a, b)| a.abs_diff(b.into())).max();
        // Quality 2 is off by some units beside the disc's edge.
        assert!(worst.unwrap() < 40, "{count} samples: {worst:?}");
    }
}

#[test]
fn small_copies_between_pages_are_no_frames() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    let small = || {
        with(
            tags(8, 1, 1),
            vec![(254, Long(vec![1])), (256, Short(vec![4])), (257, Short(vec![2])), (278, Short(vec![2]))],
        )
    };
    let whole = |k: usize| packed(&values(k, 8), 8, false);
    // First, and after each.
    let mut tiff = Tiff::new(false).page(small(), &[9; 8], 8);
    for k in 0..3 {
        tiff = tiff.page(tags(8, 1, 1), &whole(k), W * H).page(small(), &[9; 8], 8);
    }
    std::fs::write(&path, &tiff.bytes).unwrap();
    let (_, frames, ending, _) = read(&path);
    assert_eq!((frames.len(), ending), (3, Ending::Complete));
    assert!(frames.iter().enumerate().all(|(k, f)| *f == values(k, 8)));
    let mut source = open(path.to_str().unwrap(), &OpenOptions::default()).unwrap();
    assert_eq!(source.sample(9).unwrap().len(), 3);
    // ImageJ's pages, some of which are gone.
    let imagej = with(tags(8, 1, 1), vec![(270, Text("ImageJ=1.54f\nimages=5\nframes=5\n".into()))]);
    let tiff = Tiff::new(false).page(imagej, &whole(0), W * H).page(tags(8, 1, 1), &whole(1), W * H);
    std::fs::write(&path, &tiff.bytes).unwrap();
    let (_, frames, ending, _) = read(&path);
    assert!(frames.len() == 2 && matches!(ending, Ending::Early { frames: 2, .. }), "{ending:?}");
}
