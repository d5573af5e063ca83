//! Reads one picture file as brightness of 8 or 16 bits, whatever it was stored as.
//!
//! Owns: [`read`], [`decode`]. Must not: scale values; 16 bit stay 16 bit.

use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use tiff::decoder::Decoder;

use super::picture::Picture;
use super::planes::are_behind;
use super::tiff_layout::is_reduced;
use super::{coded_picture, jpeg_scan, orientation_tag, pixel_size, png_sums, tiff_page};

/// Reads a picture file; an error is a clause without a full stop.
pub fn read(path: &Path) -> Result<Picture, String> {
    let mut file = File::open(path).map_err(|e| format!("it cannot be read ({e})"))?;
    let mut head = [0u8; 32];
    let got = file.read(&mut head).map_err(|e| format!("it cannot be read ({e})"))?;
    let head = &head[..got];
    if head.is_empty() {
        return Err("it is empty".to_owned());
    }
    if head.starts_with(b"II") || head.starts_with(b"MM") {
        file.seek(SeekFrom::Start(0)).map_err(|e| e.to_string())?;
        let size = file.metadata().map_err(|e| e.to_string())?.len();
        let mut decoder = Decoder::new(BufReader::new(file)).map_err(|e| e.to_string())?;
        let (orientation, size_of_pixel) =
            (orientation_tag::of_tiff(&mut decoder), pixel_size::of_tiff(&mut decoder));
        let picture = tiff_page::read(&mut decoder)?.shown(orientation, size_of_pixel);
        let several = || "it holds several pictures, and in a folder each file is one".to_owned();
        if !decoder.more_images() && are_behind(&mut decoder, size) {
            return Err(several());
        }
        while decoder.more_images() {
            decoder.next_image().map_err(|e| e.to_string())?;
            if !is_reduced(&mut decoder) {
                return Err(several());
            }
        }
        return Ok(picture);
    }
    believable(head, &mut file)?;
    let bytes = std::fs::read(path).map_err(|e| format!("it cannot be read ({e})"))?;
    // Decoders fill up what is damaged.
    match bytes.starts_with(b"\xff\xd8") {
        true => jpeg_scan::check(&bytes)?,
        false => png_sums::check(&bytes)?,
    }
    let (orientation, size_of_pixel) = (orientation_tag::of_file(&bytes), pixel_size::of_png(&bytes));
    Ok(coded_picture::decode(&bytes)?.shown(orientation, size_of_pixel))
}

/// Decodes a JPEG picture that lies in memory; an error is a clause without a full stop.
pub fn decode(jpeg: &[u8]) -> Result<Picture, String> {
    if !jpeg.starts_with(b"\xff\xd8")
        || !jpeg[jpeg.len().saturating_sub(64)..].windows(2).any(|w| w == [0xff, 0xd9])
    {
        return Err("it is no whole JPEG picture".to_owned());
    }
    jpeg_scan::check(jpeg)?;
    coded_picture::decode(jpeg)
}

/// Refuses a header that promises more pixels than the file can hold, before anything is allocated.
fn believable(head: &[u8], file: &mut File) -> Result<(), String> {
    let number = |at: usize, big: bool| {
        let four: Option<[u8; 4]> = head.get(at..at + 4).and_then(|b| b.try_into().ok());
        four.map(|b| u64::from(if big { u32::from_be_bytes(b) } else { u32::from_le_bytes(b) }))
    };
    // Deflate's best is 1032 to 1, and a PNG pixel takes a bit or more; BMP's run lengths do 127 to 1.
    let (size, pixels_per_byte) = if head.starts_with(b"\x89PNG\r\n\x1a\n") {
        (number(16, true).zip(number(20, true)), 8 * 1032)
    } else if head.starts_with(b"BM") {
        (number(18, false).zip(number(22, false).map(|h| u64::from((h as u32 as i32).unsigned_abs()))), 128)
    } else {
        return match head.starts_with(b"\xff\xd8") {
            true => whole_jpeg(file),
            false => Ok(()),
        };
    };
    let length = file.metadata().map_err(|e| e.to_string())?.len();
    match size {
        Some((w, h)) if u128::from(w) * u128::from(h) <= u128::from(length) * pixels_per_byte => {
            match head.starts_with(b"\x89PNG") && !tail(file, 64)?.windows(4).any(|w| w == b"IEND") {
                true => Err("it is cut".to_owned()),
                false => Ok(()),
            }
        }
        Some((w, h)) => Err(format!("{w} x {h} px do not fit into its {length} bytes")),
        None => Err("it is cut".to_owned()),
    }
}

/// A JPEG that is cut would be filled up with gray.
fn whole_jpeg(file: &mut File) -> Result<(), String> {
    if tail(file, 1024)?.windows(2).any(|w| w == [0xff, 0xd9]) { Ok(()) } else { Err("it is cut".to_owned()) }
}

/// The last `count` bytes of a file.
fn tail(file: &mut File, count: u64) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::new();
    let length = file.metadata().map_err(|e| e.to_string())?.len();
    file.seek(SeekFrom::Start(length.saturating_sub(count)))
        .and_then(|_| file.read_to_end(&mut bytes))
        .map_err(|e| e.to_string())?;
    Ok(bytes)
}
