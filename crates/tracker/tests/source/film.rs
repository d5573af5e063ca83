//! Known pictures, and files made of them.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use tracker::frame::{Frame, PixelFormat};

/// Size of the test film, px: sides are no multiples of 16, so that coded pictures are cropped.
pub const WIDTH: usize = 196;
/// See [`WIDTH`].
pub const HEIGHT: usize = 116;

/// Picture `index`: a ramp with a bright disc of radius 9 px, whose centre tells the index.
pub fn picture(index: usize) -> Vec<u8> {
    let (cx, cy) = centre(index);
    let mut pixels = vec![0u8; WIDTH * HEIGHT];
    for y in 0..HEIGHT {
        for x in 0..WIDTH {
            let inside = (x as f64 - cx).powi(2) + (y as f64 - cy).powi(2) < 81.0;
            pixels[y * WIDTH + x] = if inside { 220 } else { 30 + (x / 8 + y / 8) as u8 };
        }
    }
    pixels
}

/// Where the disc of picture `index` is, px. All centres of 150 pictures differ by 2 px or more.
pub fn centre(index: usize) -> (f64, f64) {
    (12.0 + 12.0 * (index % 15) as f64, 12.0 + 9.0 * (index / 15 % 10) as f64)
}

/// The index that the disc in a picture of samples tells, if there is a disc.
pub fn index_of(pixels: &[u32], peak: u32) -> Option<usize> {
    let (mut n, mut sx, mut sy) = (0.0, 0.0, 0.0);
    for y in 0..HEIGHT {
        for x in 0..WIDTH {
            if pixels[y * WIDTH + x] > peak * 140 / 255 {
                n += 1.0;
                sx += x as f64;
                sy += y as f64;
            }
        }
    }
    // A disc of radius 9 has 253 px; less than half is none.
    (n > 126.0).then(|| {
        let column = ((sx / n - 12.0) / 12.0).round() as usize;
        let row = ((sy / n - 12.0) / 9.0).round() as usize;
        row * 15 + column
    })
}

/// All samples of a frame, row by row; `None` if it has no plane.
pub fn samples(frame: &Frame) -> Option<Vec<u32>> {
    let bytes = frame.plane.as_ref()?.bytes();
    let (w, h) = (frame.width as usize, frame.height as usize);
    let mut out = Vec::with_capacity(w * h);
    for y in 0..h {
        for x in 0..w {
            let i = y * w + x;
            out.push(match frame.format {
                PixelFormat::Gray8 => u32::from(bytes[y * frame.stride + x]),
                PixelFormat::Gray16 => {
                    let at = y * frame.stride + 2 * x;
                    u32::from(u16::from_le_bytes([bytes[at], bytes[at + 1]]))
                }
                // One run of bits, most significant first.
                PixelFormat::Packed10 | PixelFormat::Packed12 => {
                    let bits = frame.format.bits_per_pixel() as usize;
                    (0..bits).fold(0, |value, k| {
                        let bit = i * bits + k;
                        value << 1 | u32::from(bytes[bit / 8] >> (7 - bit % 8) & 1)
                    })
                }
            });
        }
    }
    Some(out)
}

/// Whether the `ffmpeg` program is there; says so if not, and fails where every test must run.
pub fn have_ffmpeg() -> bool {
    let found = Command::new("ffmpeg").arg("-version").stdout(Stdio::null()).stderr(Stdio::null()).status();
    if found.is_err() {
        assert!(std::env::var_os("CI").is_none(), "no `ffmpeg` program");
        eprintln!("skipped: no `ffmpeg` program");
    }
    found.is_ok()
}

/// Encodes the first `count` pictures at 500 frames per second with the `ffmpeg` program.
pub fn encode(folder: &Path, name: &str, count: usize, arguments: &[&str]) -> PathBuf {
    let path = folder.join(name);
    let mut child = Command::new("ffmpeg")
        .args(["-v", "error", "-y", "-f", "rawvideo", "-pix_fmt", "gray", "-framerate", "500"])
        .args(["-video_size", &format!("{WIDTH}x{HEIGHT}"), "-i", "-"])
        .args(arguments)
        .arg(&path)
        .stdin(Stdio::piped())
        .spawn()
        .unwrap();
    let mut pipe = child.stdin.take().unwrap();
    for index in 0..count {
        pipe.write_all(&picture(index)).unwrap();
    }
    drop(pipe);
    assert!(child.wait().unwrap().success(), "ffmpeg {arguments:?}");
    path
}

/// Picture `index` as a gray JPEG of good quality; `ffmpeg` makes colour ones only.
pub fn gray_jpeg(index: usize) -> Vec<u8> {
    let pixels = picture(index);
    let mat = opencv::core::Mat::from_slice(&pixels).unwrap();
    let mut bytes = opencv::core::Vector::<u8>::new();
    let mat = opencv::prelude::MatTraitConst::reshape(&mat, 1, HEIGHT as i32).unwrap();
    assert!(opencv::imgcodecs::imencode_def(".jpg", &mat, &mut bytes).unwrap());
    bytes.iter().collect()
}

/// A real recording from the shared folder, if it is there; says so if not.
pub fn real(name: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data").join(name);
    if !path.exists() {
        eprintln!("skipped: {} is not here", path.display());
        return None;
    }
    Some(path)
}

/// Reads a recording to its end.
pub fn read_all(source: &mut dyn tracker::frame::FrameSource) -> Vec<Frame> {
    let mut frames = Vec::new();
    while let Some(frame) = source.next_frame().unwrap() {
        frames.push(frame);
    }
    frames
}

/// The sum of all samples, each times its place from 1 on: of the first, the middle and the last frame, and of all.
pub fn checksums(frames: &[Frame]) -> [u64; 4] {
    let of = |f: &Frame| samples(f).unwrap().iter().zip(1u64..).map(|(v, place)| u64::from(*v) * place).sum();
    let each: Vec<u64> = frames.iter().map(of).collect();
    [each[0], each[each.len() / 2], each[each.len() - 1], each.iter().sum()]
}
