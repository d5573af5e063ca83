//! Converts frames to OpenCV's pictures, and pictures to bytes and files.
//!
//! Owns: [`colour`], [`rgb`], [`size`], [`save`]. Must not: draw.

use std::path::Path;

use opencv::core::{Mat, Size, Vector};
use opencv::prelude::*;
use opencv::{imgcodecs, imgproc};

use crate::error::{Error, Fault, Result};
use crate::frame::{Frame, PixelFormat};
use crate::name::text;
use crate::output;

/// The frame's brightness as an 8-bit picture of three channels, `size` px; black where it could not be decoded. Deep
/// recordings are shown by their upper 8 bits.
pub(super) fn colour(frame: &Frame, size: [i32; 2]) -> Result<Mat> {
    let (w, h) = (frame.width as usize, frame.height as usize);
    let gray = gray8(frame)?;
    let mat = Mat::from_slice(&gray).map_err(failed)?;
    let mat = mat.reshape(1, h as i32).map_err(failed)?;
    debug_assert_eq!(mat.cols() as usize, w);
    let mut out = Mat::default();
    if size == [mat.cols(), mat.rows()] {
        imgproc::cvt_color_def(&mat, &mut out, imgproc::COLOR_GRAY2BGR).map_err(failed)?;
        return Ok(out);
    }
    let how = if size[0] < mat.cols() { imgproc::INTER_AREA } else { imgproc::INTER_LINEAR };
    let mut scaled = Mat::default();
    imgproc::resize(&mat, &mut scaled, Size::new(size[0], size[1]), 0.0, 0.0, how).map_err(failed)?;
    imgproc::cvt_color_def(&scaled, &mut out, imgproc::COLOR_GRAY2BGR).map_err(failed)?;
    Ok(out)
}

/// Samples of a frame by their upper 8 bits, row by row.
fn gray8(frame: &Frame) -> Result<Vec<u8>> {
    let (w, h) = (frame.width as usize, frame.height as usize);
    let Some(bytes) = frame.bytes()? else { return Ok(vec![0; w * h]) };
    let short = || {
        Error::Film(Fault::new(
            "overlay",
            format!("a frame of {} bytes is too short for {w} x {h}", bytes.len()),
        ))
    };
    let down = frame.depth_bits.saturating_sub(8);
    let shown = |v: u32| (v >> down).min(255) as u8;
    let mut out = Vec::with_capacity(w * h);
    match frame.format {
        PixelFormat::Gray8 => {
            for y in 0..h {
                out.extend_from_slice(bytes.get(y * frame.stride..y * frame.stride + w).ok_or_else(short)?);
            }
        }
        PixelFormat::Gray16 => {
            for y in 0..h {
                let row = bytes.get(y * frame.stride..y * frame.stride + 2 * w).ok_or_else(short)?;
                out.extend(row.chunks_exact(2).map(|b| shown(u32::from(u16::from_le_bytes([b[0], b[1]])))));
            }
        }
        PixelFormat::Packed10 | PixelFormat::Packed12 => {
            let bits = frame.format.bits_per_pixel() as usize;
            for y in 0..h {
                for x in 0..w {
                    let first =
                        if frame.stride == 0 { (y * w + x) * bits } else { y * frame.stride * 8 + x * bits };
                    let mut v = 0_u32;
                    // A sample touches two bytes at most for 10 and 12 bits.
                    for k in 0..2 {
                        v = v << 8 | u32::from(*bytes.get(first / 8 + k).ok_or_else(short)?);
                    }
                    out.push(shown(v >> (16 - first % 8 - bits) & ((1 << bits) - 1)));
                }
            }
        }
    }
    Ok(out)
}

/// Samples red, green, blue, pixel by pixel and row by row.
///
/// # Errors
/// [`Error::Film`] if OpenCV fails.
pub fn rgb(picture: &Mat) -> Result<Vec<u8>> {
    let mut out = Mat::default();
    imgproc::cvt_color_def(picture, &mut out, imgproc::COLOR_BGR2RGB).map_err(failed)?;
    Ok(out.data_bytes().map_err(failed)?.to_vec())
}

/// Rows and columns.
pub fn size(picture: &Mat) -> [usize; 2] {
    [picture.rows(), picture.cols()].map(|n| n.unsigned_abs() as usize)
}

/// Writes a picture; its kind is known by the ending of `path`.
///
/// # Errors
/// [`Error::Film`] if the ending is not known or the file cannot be written.
pub fn save(picture: &Mat, path: &Path) -> Result<()> {
    let name = text(path);
    let ending = path.extension().map_or_else(String::new, |e| format!(".{}", text(e)));
    let mut bytes: Vector<u8> = Vector::new();
    let done = imgcodecs::imencode_def(&ending, picture, &mut bytes).unwrap_or(false);
    if !done {
        return Err(Error::Film(
            Fault::new(&name, format!("pictures cannot be written as {ending:?}")).advice("Name it .png"),
        ));
    }
    output::write(path, bytes.as_slice())
        .map_err(|e| Error::Film(Fault::new(&name, format!("the picture cannot be written ({e})"))))
}

pub(super) fn failed(e: opencv::Error) -> Error {
    Error::Film(Fault::new("overlay", format!("drawing failed ({e})")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packed_samples_are_shown_by_their_upper_bits() {
        // 0xABC and 0x123 in three bytes.
        let f = Frame {
            index: 0,
            ticks: 0,
            width: 2,
            height: 1,
            stride: 0,
            format: PixelFormat::Packed12,
            depth_bits: 12,
            plane: Some(Box::new(vec![0xAB, 0xC1, 0x23])),
        };
        assert_eq!(gray8(&f).unwrap(), [0xAB, 0x12]);
    }
}
