//! Converts frames to pictures in colour, and pictures to bytes and files.
//!
//! Owns: [`Picture`], [`colour`]. Must not: draw.

use std::io::Cursor;
use std::path::Path;

use image::codecs::jpeg::JpegEncoder;
use image::{ExtendedColorType, ImageFormat};
use opencv::core::{Mat, Size};
use opencv::imgproc;
use opencv::prelude::*;

use crate::error::{Error, Fault, FaultKind, Result};
use crate::frame::Frame;
use crate::gray::gray8;
use crate::name::text;
use crate::output;

/// Quality of JPEG pictures, of 100: lines and letters stay sharp.
const JPEG_QUALITY: u8 = 95;

/// The frame as an 8-bit picture of three channels, `size` px: in its colours where it has them, else by its brightness; black
/// where it could not be decoded. Deep recordings are shown by their upper 8 bits.
pub(super) fn colour(frame: &Frame, size: [i32; 2]) -> Result<Mat> {
    let how = if size[0] < frame.width as i32 { imgproc::INTER_AREA } else { imgproc::INTER_LINEAR };
    if let Some(planes) = frame.colour.as_ref().filter(|_| frame.plane.is_some()) {
        let bytes = blue_green_red(&gray8(frame)?, planes, frame.width as usize);
        let mat = Mat::from_slice(&bytes).map_err(failed)?;
        let mat = mat.reshape(3, frame.height as i32).map_err(failed)?;
        let mut out = Mat::default();
        imgproc::resize(&mat, &mut out, Size::new(size[0], size[1]), 0.0, 0.0, how).map_err(failed)?;
        return Ok(out);
    }
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
    let mut scaled = Mat::default();
    imgproc::resize(&mat, &mut scaled, Size::new(size[0], size[1]), 0.0, 0.0, how).map_err(failed)?;
    imgproc::cvt_color_def(&scaled, &mut out, imgproc::COLOR_GRAY2BGR).map_err(failed)?;
    Ok(out)
}

/// Samples blue, green, red of brightness and colour differences (BT.601, full range).
fn blue_green_red(luma: &[u8], [blue, red]: &[Vec<u8>; 2], width: usize) -> Vec<u8> {
    let height = luma.len() / width.max(1);
    let wide = if blue.len() < luma.len() { 2 } else { 1 };
    let row = width.div_ceil(wide).min(blue.len());
    let mut out = Vec::with_capacity(3 * luma.len());
    for y in 0..height {
        for x in 0..width {
            let k = ((y / wide) * row + x / wide).min(blue.len().saturating_sub(1));
            let [v, b, r] = [luma[y * width + x], blue[k], red[k]].map(f32::from);
            let (b, r) = (b - 128.0, r - 128.0);
            let bgr = [v + 1.772 * b, v - 0.344 * b - 0.714 * r, v + 1.402 * r];
            out.extend(bgr.map(|c| c.round().clamp(0.0, 255.0) as u8));
        }
    }
    out
}

/// A picture in colour, 8 bits for each of red, green and blue.
#[derive(Debug)]
pub struct Picture(pub(super) Mat);

impl Picture {
    /// Samples red, green, blue, pixel by pixel and row by row.
    ///
    /// # Errors
    /// [`Error::Film`] if OpenCV fails.
    pub fn rgb(&self) -> Result<Vec<u8>> {
        let mut out = Mat::default();
        imgproc::cvt_color_def(&self.0, &mut out, imgproc::COLOR_BGR2RGB).map_err(failed)?;
        Ok(out.data_bytes().map_err(failed)?.to_vec())
    }

    /// Width and height, px.
    pub fn size_px(&self) -> [usize; 2] {
        [self.0.cols(), self.0.rows()].map(|n| n.unsigned_abs() as usize)
    }

    /// Writes the picture; its kind is known by the ending of `path`.
    ///
    /// # Errors
    /// [`Error::Film`] if the ending is not known or the file cannot be written.
    pub fn save(&self, path: &Path) -> Result<()> {
        let name = text(path);
        let (rgb, [width, height]) = (self.rgb()?, self.size_px().map(|n| n as u32));
        let (mut bytes, kind) = (Cursor::new(Vec::new()), ExtendedColorType::Rgb8);
        let done = ImageFormat::from_path(path).and_then(|format| match format {
            ImageFormat::Jpeg => {
                JpegEncoder::new_with_quality(&mut bytes, JPEG_QUALITY).encode(&rgb, width, height, kind)
            }
            _ => image::write_buffer_with_format(&mut bytes, &rgb, width, height, kind, format),
        });
        if done.is_err() {
            let ending = path.extension().map_or_else(String::new, |e| format!(".{}", text(e)));
            return Err(Error::Film(
                Fault::new(&name, format!("pictures cannot be written as {ending:?}"))
                    .of_kind(FaultKind::Unsupported)
                    .advice("Name it .png"),
            ));
        }
        output::write(path, bytes.get_ref()).map_err(|e| {
            Error::Film(Fault::new(&name, format!("the picture cannot be written ({e})")).caused_by(&e))
        })
    }
}

pub(super) fn failed(e: opencv::Error) -> Error {
    Error::Film(Fault::new("overlay", format!("drawing failed ({e})")))
}
