//! Converts a frame to its brightness in 8 bits, for pictures and for looking at what moves.
//!
//! Owns: [`gray8`]. Must not: serve measurement where a recording has more than 8 bits.

use crate::error::{Error, Fault, FaultKind, Result};
use crate::frame::{Frame, PixelFormat};

/// Samples of a frame by their upper 8 bits, row by row; zeros where it could not be decoded.
///
/// # Errors
/// [`Error::Source`] if its plane is shorter than its size says.
pub fn gray8(frame: &Frame) -> Result<Vec<u8>> {
    let (w, h) = (frame.width as usize, frame.height as usize);
    let Some(bytes) = frame.bytes()? else { return Ok(vec![0; w * h]) };
    let short = || {
        Error::Source(
            Fault::new(
                format!("frame {}", frame.index),
                format!("{} bytes are too few for {w} x {h} px", bytes.len()),
            )
            .of_kind(FaultKind::Damaged),
        )
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
    }
}
