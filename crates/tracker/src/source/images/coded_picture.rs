//! Decodes a PNG, BMP, JPEG or PGM picture in memory through OpenCV.

use opencv::core::{CV_8U, CV_16U, Mat, Vector};
use opencv::imgcodecs;
use opencv::prelude::{MatTraitConst, MatTraitConstManual};

use super::picture::Picture;
use crate::source::orientation::Orientation;

/// Decodes a picture, not turned as its tag says; an error is a clause without a full stop.
pub(super) fn decode(bytes: &[u8]) -> Result<Picture, String> {
    let bytes = Vector::<u8>::from_slice(bytes);
    gray(imgcodecs::imdecode(&bytes, imgcodecs::IMREAD_UNCHANGED).map_err(|e| short(&e.message))?)
}

/// The brightness of a picture as OpenCV reads it.
fn gray(color: Mat) -> Result<Picture, String> {
    if color.empty() {
        return Err("it is not a picture that can be read, or it is cut".to_owned());
    }
    let channels = color.channels();
    let (gray, converted_from) = if channels == 1 {
        (color, None)
    } else {
        let code = match channels {
            3 => opencv::imgproc::COLOR_BGR2GRAY,
            4 => opencv::imgproc::COLOR_BGRA2GRAY,
            n => return Err(format!("it has {n} channels")),
        };
        let mut gray = Mat::default();
        opencv::imgproc::cvt_color_def(&color, &mut gray, code).map_err(|e| short(&e.message))?;
        (gray, Some(format!("{channels} channels")))
    };
    let depth_bits = match gray.depth() {
        CV_8U => 8,
        CV_16U => 16,
        other => return Err(format!("its samples are of OpenCV's kind {other}, not 8 or 16 bit")),
    };
    let size = |n: i32| u32::try_from(n).map_err(|e| e.to_string());
    // OpenCV's 16-bit samples are in this machine's order; all machines that we are built for are little-endian.
    let samples = gray.data_bytes().map_err(|e| short(&e.message))?.to_vec();
    Ok(Picture {
        width: size(gray.cols())?,
        height: size(gray.rows())?,
        depth_bits,
        samples,
        converted_from,
        orientation: Orientation::default(),
        pixel_size: None,
    })
}

fn short(message: &str) -> String {
    message.lines().next().unwrap_or("it cannot be decoded").trim().to_owned()
}
