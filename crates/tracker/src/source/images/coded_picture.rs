//! Decodes a PNG, BMP, JPEG or PGM picture in memory.

use std::io::Cursor;

use image::codecs::bmp::BmpDecoder;
use image::{DynamicImage, ImageFormat};
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use super::picture::Picture;
use crate::source::orientation::Orientation;

/// Most pixels of a JPEG picture in each direction, which is what its header can say.
const MOST_PX: usize = u16::MAX as usize;
/// Weights of red, green and blue in brightness, of [`WEIGHTS_SUM`]: ITU-R BT.601 as OpenCV rounds it, so that pictures keep the
/// brightness that they had when OpenCV read them.
const WEIGHTS: [u32; 3] = [9798, 19235, 3735];
/// Sum of the weights.
const WEIGHTS_SUM: u32 = 1 << 15;

/// Decodes a picture, not turned as its tag says; an error is a clause without a full stop.
pub(super) fn decode(bytes: &[u8]) -> Result<Picture, String> {
    if bytes.starts_with(b"\xff\xd8") { jpeg(bytes) } else { plain(bytes) }
}

/// A picture that is stored without loss.
fn plain(bytes: &[u8]) -> Result<Picture, String> {
    let unknown = "it is not a picture that can be read, or it is cut";
    let format = image::guess_format(bytes).map_err(|_| unknown.to_owned())?;
    let unstretched = if format == ImageFormat::Pnm { unstretched(bytes) } else { None };
    let decoded = image::load_from_memory_with_format(unstretched.as_deref().unwrap_or(bytes), format)
        .map_err(|e| short(&e))?;
    let is_gray_bmp = || {
        let decoder = BmpDecoder::new(Cursor::new(bytes)).ok();
        let gray = |palette: &[[u8; 3]]| palette.iter().all(|[r, g, b]| r == g && g == b);
        decoder.is_some_and(|d| d.get_palette().is_some_and(gray))
    };
    let is_gray = format == ImageFormat::Bmp && is_gray_bmp();
    let (width, height) = (decoded.width(), decoded.height());
    let channels = decoded.color().channel_count();
    let (depth_bits, samples) = match decoded {
        DynamicImage::ImageLuma8(p) => (8, p.into_raw()),
        DynamicImage::ImageLumaA8(p) => (8, p.pixels().map(|p| p.0[0]).collect()),
        DynamicImage::ImageRgb8(p) => (8, brightness_8(p.as_raw(), 3)),
        DynamicImage::ImageRgba8(p) => (8, brightness_8(p.as_raw(), 4)),
        DynamicImage::ImageLuma16(p) => (16, little_endian(p.into_raw())),
        DynamicImage::ImageLumaA16(p) => (16, little_endian(p.pixels().map(|p| p.0[0]))),
        DynamicImage::ImageRgb16(p) => (16, little_endian(brightness_16(p.as_raw(), 3))),
        DynamicImage::ImageRgba16(p) => (16, little_endian(brightness_16(p.as_raw(), 4))),
        _ => return Err("its samples are not of 8 or 16 bit".to_owned()),
    };
    let converted_from = (channels > 1 && !is_gray).then(|| format!("{channels} channels"));
    Ok(picture(width, height, depth_bits, samples, converted_from))
}

/// A JPEG picture: its own brightness where it is stored as brightness and colour differences, as nearly all are.
fn jpeg(bytes: &[u8]) -> Result<Picture, String> {
    let options = DecoderOptions::default().set_max_width(MOST_PX).set_max_height(MOST_PX);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    decoder.decode_headers().map_err(|e| short(&e))?;
    let is_gray = matches!(decoder.input_colorspace(), Some(ColorSpace::Luma | ColorSpace::YCbCr));
    let wanted = if is_gray { ColorSpace::Luma } else { ColorSpace::RGB };
    // Of pictures that are coded block by block `jpeg_scan` has told damage by now; of others the decoder must.
    let is_strict = decoder.info().is_some_and(|info| info.sof.is_progressive());
    decoder.set_options(options.jpeg_set_out_colorspace(wanted).set_strict_mode(is_strict));
    let samples = decoder.decode().map_err(|e| short(&e))?;
    let (width, height) = decoder.dimensions().ok_or("it has no size")?;
    let (samples, converted_from) =
        if is_gray { (samples, None) } else { (brightness_8(&samples, 3), Some("3 channels".to_owned())) };
    Ok(picture(width as u32, height as u32, 8, samples, converted_from))
}

/// A PGM or PPM picture that says that its samples go up to all that their bytes can hold; `None` where it says so itself or is of
/// another kind. Samples that go up to less are stretched by `image`, and 12 bits would become others.
fn unstretched(bytes: &[u8]) -> Option<Vec<u8>> {
    if !matches!(bytes, [b'P', b'2' | b'3' | b'5' | b'6', ..]) {
        return None;
    }
    // Width, height and the greatest sample, parted by white space and comments.
    let (mut from, mut to) = (0, 2);
    for _ in 0..3 {
        from = to;
        while let Some(byte) = bytes.get(from) {
            match byte {
                b'#' => from += bytes[from..].iter().position(|b| *b == b'\n')?,
                b if b.is_ascii_whitespace() => from += 1,
                _ => break,
            }
        }
        to = from + bytes[from..].iter().position(|b| !b.is_ascii_digit())?;
    }
    let greatest: u32 = std::str::from_utf8(&bytes[from..to]).ok()?.parse().ok()?;
    let held = if greatest > 255 { 65535 } else { 255 };
    let changed = [&bytes[..from], held.to_string().as_bytes(), &bytes[to..]].concat();
    (1..held).contains(&greatest).then_some(changed)
}

fn picture(
    width: u32,
    height: u32,
    depth_bits: u32,
    samples: Vec<u8>,
    converted_from: Option<String>,
) -> Picture {
    let orientation = Orientation::default();
    Picture { width, height, depth_bits, samples, converted_from, orientation, pixel_size: None }
}

/// Brightness of pixels of some channels, the first three red, green and blue.
fn brightness_8(samples: &[u8], channels: usize) -> Vec<u8> {
    let pixels = samples.chunks_exact(channels);
    pixels.map(|p| weighted([p[0], p[1], p[2]].map(u32::from)) as u8).collect()
}

/// Brightness of pixels of some channels of 16 bits.
fn brightness_16(samples: &[u16], channels: usize) -> impl Iterator<Item = u16> {
    let pixels = samples.chunks_exact(channels);
    pixels.map(|p| weighted([p[0], p[1], p[2]].map(u32::from)) as u16)
}

fn weighted(pixel: [u32; 3]) -> u32 {
    let sum: u32 = pixel.iter().zip(WEIGHTS).map(|(v, w)| v * w).sum();
    (sum + WEIGHTS_SUM / 2) / WEIGHTS_SUM
}

fn little_endian(samples: impl IntoIterator<Item = u16>) -> Vec<u8> {
    samples.into_iter().flat_map(u16::to_le_bytes).collect()
}

fn short(error: &impl ToString) -> String {
    error.to_string().lines().next().unwrap_or("it cannot be decoded").trim().to_owned()
}
