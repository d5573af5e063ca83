//! Finds the greatest sample of a frame at the speed of memory.
//!
//! Owns: [`peak_level`]. Must not: unpack a frame. Written so that the compiler makes vector instructions of it, once for
//! every machine of the kind and once for those with AVX2.

use multiversion::multiversion;

use crate::error::Result;
use crate::frame::{Frame, PixelFormat};

/// The greatest sample of a frame, in units of its least significant bit; `None` if it was not decoded or its plane
/// is shorter than its size says.
///
/// # Errors
/// [`Error::Source`](crate::error::Error::Source) where the recording cannot be read any more.
pub fn peak_level(frame: &Frame) -> Result<Option<u16>> {
    Ok(frame.bytes()?.and_then(|bytes| peak_in(frame, bytes)))
}

fn peak_in(frame: &Frame, bytes: &[u8]) -> Option<u16> {
    let (width, height) = (frame.width as usize, frame.height as usize);
    let row_bits = width.checked_mul(frame.format.bits_per_pixel() as usize)?;
    if frame.stride == 0 || frame.stride * 8 == row_bits {
        return greatest(bytes, row_bits.checked_mul(height)?, frame.format);
    }
    (0..height).try_fold(0, |best, y| {
        Some(greatest(bytes.get(y.checked_mul(frame.stride)?..)?, row_bits, frame.format)?.max(best))
    })
}

/// The greatest of the samples in the first `bits` of `bytes`; `None` if there are fewer bytes.
fn greatest(bytes: &[u8], bits: usize, format: PixelFormat) -> Option<u16> {
    Some(greatest_in(bytes.get(..bits.div_ceil(8))?, bits, format))
}

// What it calls is always inlined: only what becomes part of it gets its instructions.
#[multiversion(targets("x86_64+avx2"))]
fn greatest_in(bytes: &[u8], bits: usize, format: PixelFormat) -> u16 {
    match format {
        PixelFormat::Gray8 => bytes.iter().fold(0, |best, byte| u8::max(best, *byte)).into(),
        PixelFormat::Gray16 => {
            let (pairs, _) = bytes.as_chunks();
            pairs.iter().fold(0, |best, pair| u16::max(best, u16::from_le_bytes(*pair)))
        }
        // 2 * 80 bytes are 32 groups of 5, and 80 words five vectors of 16.
        PixelFormat::Packed10 => packed::<10, 80, 161>(bytes, bits),
        // 2 * 48 bytes are 32 groups of 3, and 48 words three vectors of 16.
        PixelFormat::Packed12 => packed::<12, 48, 97>(bytes, bits),
    }
}

/// The layout of samples in the big-endian words that start at byte `2 * lane + phase`: each word holds one whole sample or none.
/// The bits that are left of it by `keep` are shifted down by `shift`.
struct Lanes<const N: usize> {
    keep: [[u16; N]; 2],
    shift: [[u32; N]; 2],
}

impl<const N: usize> Lanes<N> {
    const fn new(bits: usize) -> Self {
        let mut this = Self { keep: [[0; N]; 2], shift: [[0; N]; 2] };
        let mut byte = 0;
        while byte < 2 * N {
            // Bits from the start of the byte to the start of the next sample.
            let ahead = (byte * 8).next_multiple_of(bits) - byte * 8;
            if ahead < 8 {
                this.keep[byte % 2][byte / 2] = u16::MAX >> ahead;
                this.shift[byte % 2][byte / 2] = (16 - ahead - bits) as u32;
            }
            byte += 1;
        }
        this
    }
}

/// The greatest sample of `BITS` in the first `bits` of `bytes`, taken 2 N bytes at a time and, because the last word
/// reaches into the next byte, looking at `ONE_MORE`, which is 2 N + 1. Words are compared where they lie.
#[inline(always)]
fn packed<const BITS: usize, const N: usize, const ONE_MORE: usize>(bytes: &[u8], bits: usize) -> u16 {
    let lanes = const { Lanes::<N>::new(BITS) };
    let mut best = [[0u16; N]; 2];
    let mut rest = bytes;
    while let Some(group) = rest.first_chunk::<ONE_MORE>() {
        raise(&mut best, group, &lanes.keep);
        rest = &rest[2 * N..];
    }
    // The rest with zeros behind it, also in place of what the last byte holds beyond its sample.
    let mut last = [0u8; ONE_MORE];
    last[..rest.len()].copy_from_slice(rest);
    let unused = bytes.len() * 8 - bits;
    if let Some(end) = rest.len().checked_sub(1) {
        last[end] &= u8::MAX << unused;
    }
    raise(&mut best, &last, &lanes.keep);
    let all = best.iter().flatten().zip(lanes.shift.iter().flatten());
    all.map(|(word, shift)| word >> shift).max().unwrap_or(0)
}

#[inline(always)]
fn raise<const N: usize, const ONE_MORE: usize>(
    best: &mut [[u16; N]; 2],
    group: &[u8; ONE_MORE],
    keep: &[[u16; N]; 2],
) {
    for (phase, (best, keep)) in best.iter_mut().zip(keep).enumerate() {
        for (lane, (best, keep)) in best.iter_mut().zip(keep).enumerate() {
            let at = 2 * lane + phase;
            *best = u16::max(*best, u16::from_be_bytes([group[at], group[at + 1]]) & keep);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detect::pack;

    #[test]
    fn the_one_bright_sample_is_found_wherever_it_lies_and_nothing_outside_the_picture_is() {
        for (format, bits) in [
            (PixelFormat::Gray8, 8),
            (PixelFormat::Gray16, 16),
            (PixelFormat::Packed10, 10),
            (PixelFormat::Packed12, 12),
        ] {
            // Widths by which rows end on and inside bytes, and pictures shorter and longer than a group.
            for (width, height) in [(1, 1), (3, 1), (7, 5), (64, 3), (129, 4)] {
                let count = width * height;
                let top = if bits == 8 { 255 } else { (1u32 << bits.min(12)) as u16 - 1 };
                for at in (0..count).step_by(1 + count / 61) {
                    // The neighbours' lower bits, all set, are below it by one step at most.
                    let mut values = vec![top - 1; count];
                    values[at] = top;
                    let mut bytes = pack(&values, bits);
                    let unused = bytes.len() * 8 - count * bits;
                    if let Some(last) = bytes.last_mut() {
                        *last |= ((1u32 << unused) - 1) as u8;
                    }
                    let mut frame = Frame {
                        index: 0,
                        ticks: 0,
                        width: width as u32,
                        height: height as u32,
                        stride: if (width * bits).is_multiple_of(8) { width * bits / 8 } else { 0 },
                        format,
                        depth_bits: bits as u32,
                        plane: Some(Box::new(bytes.clone())),
                        colour: None,
                    };
                    assert_eq!(peak_level(&frame), Ok(Some(top)), "{format:?} {width} x {height}, {at}");
                    frame.plane = Some(Box::new(bytes[..bytes.len() - 1].to_vec()));
                    assert_eq!(peak_level(&frame), Ok(None), "{format:?} {width} x {height} cut");
                }
                let dark = Frame {
                    index: 0,
                    ticks: 0,
                    width: width as u32,
                    height: 2,
                    stride: width * 2 + 3,
                    format: PixelFormat::Gray16,
                    depth_bits: 16,
                    // 255 only between the rows.
                    plane: Some(Box::new([vec![1; 2 * width], vec![255; 3], vec![1; 2 * width]].concat())),
                    colour: None,
                };
                assert_eq!(peak_level(&dark), Ok(Some(257)));
            }
        }
    }
}
