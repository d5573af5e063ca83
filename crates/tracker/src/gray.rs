//! Converts a frame to its brightness, in 8 bits for pictures and for looking at what moves, or as it was recorded.
//!
//! Owns: [`gray8`], [`samples`]. Must not: serve measurement, which takes the frame's own bytes.

use crate::error::{Error, Fault, FaultKind, Result};
use crate::frame::{Frame, PixelFormat};

/// Samples of a frame by their upper 8 bits, row by row; zeros where it could not be decoded.
///
/// # Errors
/// [`Error::Source`] if its plane is shorter than its size says.
pub fn gray8(frame: &Frame) -> Result<Vec<u8>> {
    let (w, h) = (frame.width as usize, frame.height as usize);
    let Some(bytes) = frame.bytes()? else { return Ok(vec![0; w * h]) };
    if frame.format == PixelFormat::Gray8 {
        let mut out = Vec::with_capacity(w * h);
        for y in 0..h {
            let row = bytes.get(y * frame.stride..y * frame.stride + w);
            out.extend_from_slice(row.ok_or_else(|| short(frame, bytes.len()))?);
        }
        return Ok(out);
    }
    let down = frame.depth_bits.saturating_sub(8);
    let shown = |v: u16| (v >> down).min(255) as u8;
    Ok(samples(frame)?.unwrap_or_default().into_iter().map(shown).collect())
}

/// Samples of a frame as they were recorded, row by row; `None` where it could not be decoded.
///
/// # Errors
/// [`Error::Source`] if its plane is shorter than its size says.
pub fn samples(frame: &Frame) -> Result<Option<Vec<u16>>> {
    let (w, h) = (frame.width as usize, frame.height as usize);
    let Some(bytes) = frame.bytes()? else { return Ok(None) };
    let short = || short(frame, bytes.len());
    let mut out = Vec::with_capacity(w * h);
    match frame.format {
        PixelFormat::Gray8 => {
            for y in 0..h {
                let row = bytes.get(y * frame.stride..y * frame.stride + w).ok_or_else(short)?;
                out.extend(row.iter().map(|b| u16::from(*b)));
            }
        }
        PixelFormat::Gray16 => {
            for y in 0..h {
                let row = bytes.get(y * frame.stride..y * frame.stride + 2 * w).ok_or_else(short)?;
                out.extend(row.chunks_exact(2).map(|b| u16::from_le_bytes([b[0], b[1]])));
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
                    out.push((v >> (16 - first % 8 - bits) & ((1 << bits) - 1)) as u16);
                }
            }
        }
    }
    Ok(Some(out))
}

fn short(frame: &Frame, bytes: usize) -> Error {
    Error::Source(
        Fault::new(
            format!("frame {}", frame.index),
            format!("{bytes} bytes are too few for {} x {} px", frame.width, frame.height),
        )
        .of_kind(FaultKind::Damaged),
    )
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
            colour: None,
        };
        assert_eq!(gray8(&f).unwrap(), [0xAB, 0x12]);
        assert_eq!(samples(&f).unwrap().unwrap(), [0xABC, 0x123]);
    }
}
