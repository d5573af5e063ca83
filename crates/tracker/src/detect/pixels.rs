//! Reads a frame's samples whatever their format.
//!
//! Owns: [`Pixels`]. Must not: judge a sample.

use super::simd::lanes::{Eight, Job, LANES, work};
use crate::error::{Error, Fault, Place, Result};
use crate::frame::{Frame, PixelFormat};

/// A frame's plane, checked once so that every row inside it can be read.
#[derive(Clone, Copy)]
pub(crate) struct Pixels<'a> {
    /// The bytes of the plane.
    pub bytes: &'a [u8],
    /// Width, px.
    pub width: usize,
    /// Height, px.
    pub height: usize,
    /// How samples are stored.
    pub format: PixelFormat,
    /// Bits from the start of one row to the start of the next.
    row_bits: usize,
}

impl<'a> Pixels<'a> {
    /// The pixels of a frame, `None` if it was not decoded.
    ///
    /// # Errors
    /// [`Error::Detect`] where the plane holds fewer bytes than its size says, [`Error::Source`] where the recording
    /// cannot be read any more.
    pub fn of(frame: &'a Frame) -> Result<Option<Self>> {
        let Some(bytes) = frame.bytes()? else { return Ok(None) };
        let (width, height) = (frame.width as usize, frame.height as usize);
        let bits = frame.format.bits_per_pixel() as usize;
        let row_bits = if frame.stride == 0 { width * bits } else { frame.stride * 8 };
        let needed = (row_bits * height.saturating_sub(1) + width * bits).div_ceil(8);
        if width == 0 || height == 0 || row_bits < width * bits || bytes.len() < needed {
            return Err(Error::Detect(
                Fault::new(
                    "frame",
                    format!(
                        "{width} x {height} px of {bits} bits need {needed} bytes, the plane has {}",
                        bytes.len()
                    ),
                )
                .at(Place::Frame(frame.index))
                .advice("The recording or its header is damaged"),
            ));
        }
        Ok(Some(Self { bytes, width, height, format: frame.format, row_bits }))
    }

    /// Samples that lie row after row without gaps; `bytes` must hold them all.
    pub fn of_samples(bytes: &'a [u8], width: usize, height: usize, format: PixelFormat) -> Self {
        let row_bits = width * format.bits_per_pixel() as usize;
        debug_assert!(bytes.len() * 8 >= row_bits * height);
        Self { bytes, width, height, format, row_bits }
    }

    /// First byte and bits of it to leave out where pixel `x` of row `y` starts.
    #[inline]
    pub fn start(&self, y: usize, x: usize) -> (usize, usize) {
        let bit = y * self.row_bits + x * self.format.bits_per_pixel() as usize;
        (bit / 8, bit % 8)
    }

    /// Asks memory for samples from `x` of row `y` on, as many of `count` as there are, without waiting for them.
    #[inline]
    pub fn fetch(&self, y: usize, x: usize, count: usize) {
        let (byte, _) = self.start(y, x);
        let end = self.bytes.len().min(byte + count * self.format.bits_per_pixel() as usize / 8);
        self.bytes[byte..end].chunks(64).for_each(fetch);
    }

    /// Samples from `x` of row `y` into `out`, as many as `out` holds.
    ///
    /// Both ends must lie inside the row.
    #[inline]
    pub fn read(&self, y: usize, x: usize, out: &mut [u16]) {
        debug_assert!(y < self.height && x + out.len() <= self.width);
        let (byte, skip) = self.start(y, x);
        match self.format {
            PixelFormat::Gray8 => {
                for (o, &b) in out.iter_mut().zip(&self.bytes[byte..]) {
                    *o = u16::from(b);
                }
            }
            PixelFormat::Gray16 => {
                for (o, b) in out.iter_mut().zip(self.bytes[byte..].chunks_exact(2)) {
                    *o = u16::from_le_bytes([b[0], b[1]]);
                }
            }
            PixelFormat::Packed10 => self.unpack::<10>(byte, skip, out),
            PixelFormat::Packed12 => self.unpack::<12>(byte, skip, out),
        }
    }

    /// A window's samples as floats: `height` rows from `y` on of `width` samples from `x` on, each row in whole eights
    /// of `out`, what is behind its last sample means nothing; `row` is scratch.
    pub fn floats(
        &self,
        [x, y]: [usize; 2],
        [width, height]: [usize; 2],
        row: &mut Vec<u16>,
        out: &mut [f32],
    ) {
        let stride = width.next_multiple_of(LANES);
        let rows = out.chunks_exact_mut(stride).take(height);
        if self.format == PixelFormat::Gray8 {
            let (from, _) = self.start(y, x);
            let to = from + (height - 1) * self.row_bits / 8 + stride;
            if let Some(bytes) = self.bytes.get(from..to) {
                // Eight after eight, also beyond the last one wanted, is faster.
                let row_bytes = self.row_bits / 8;
                return work(Floats { bytes, row_bytes, stride, out: &mut out[..height * stride] });
            }
        }
        row.resize(width, 0);
        for (j, out) in rows.enumerate() {
            self.read(y + j, x, row);
            out.iter_mut().zip(&*row).for_each(|(o, &v)| *o = f32::from(v));
        }
    }

    /// Most significant bits first.
    fn unpack<const BITS: usize>(&self, byte: usize, skip: usize, out: &mut [u16]) {
        let mask = (1 << BITS) - 1;
        // A sample of 10 or 12 bits spans at most three bytes.
        let single = |out: &mut [u16], mut bit: usize| {
            for o in out {
                let b = |i: usize| u32::from(self.bytes.get(bit / 8 + i).copied().unwrap_or(0));
                let word = b(0) << 16 | b(1) << 8 | b(2);
                *o = (word >> (24 - BITS - bit % 8)) as u16 & mask;
                bit += BITS;
            }
        };
        // Those before the first that begins on a byte, then fours out of eight bytes, then the rest.
        let bit = byte * 8 + skip;
        let ahead = (0..4).find(|k| (bit + k * BITS).is_multiple_of(8)).unwrap_or(0).min(out.len());
        let (before, out) = out.split_at_mut(ahead);
        single(before, bit);
        let (mut from, mut done) = ((bit + ahead * BITS) / 8, 0);
        for four in out.as_chunks_mut::<4>().0 {
            let Some(eight) = self.bytes.get(from..).and_then(|b| b.first_chunk()) else { break };
            let word = u64::from_be_bytes(*eight);
            *four = std::array::from_fn(|k| (word >> (64 - BITS * (k + 1))) as u16 & mask);
            from += BITS / 2;
            done += 4;
        }
        single(&mut out[done..], from * 8);
    }
}

/// Asks memory for the line that some bytes begin in.
#[inline(always)]
pub(crate) fn fetch(bytes: &[u8]) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: every x86-64 processor has the instruction, and it reads nothing.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(bytes.as_ptr().cast()) };
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = bytes;
}

/// Bytes as floats, row by row in whole eights.
struct Floats<'a> {
    bytes: &'a [u8],
    row_bytes: usize,
    stride: usize,
    out: &'a mut [f32],
}

impl Job for Floats<'_> {
    type Outcome = ();

    #[inline(always)]
    fn run<V: Eight>(self, token: V::Token) {
        for (j, out) in self.out.chunks_exact_mut(self.stride).enumerate() {
            let bytes = &self.bytes[j * self.row_bytes..][..self.stride];
            for (out, eight) in out.as_chunks_mut().0.iter_mut().zip(bytes.as_chunks().0) {
                *out = V::load_bytes(token, eight).array();
            }
        }
    }
}

/// Samples as a stream of bits, most significant first; 16 bits little-endian.
#[cfg(test)]
pub(crate) fn pack(values: &[u16], bits: usize) -> Vec<u8> {
    if bits == 16 {
        return values.iter().flat_map(|v| v.to_le_bytes()).collect();
    }
    let mut bytes = vec![0u8; (values.len() * bits).div_ceil(8)];
    for (i, &v) in values.iter().enumerate() {
        for b in 0..bits {
            if v >> (bits - 1 - b) & 1 == 1 {
                let at = i * bits + b;
                bytes[at / 8] |= 0x80 >> (at % 8);
            }
        }
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packed_rows_that_end_inside_a_byte_are_read_back() {
        for (bits, format) in [(10, PixelFormat::Packed10), (12, PixelFormat::Packed12)] {
            let (w, h) = (7usize, 5usize);
            let values: Vec<u16> = (0..w * h).map(|i| (i * 397 % (1 << bits)) as u16).collect();
            let frame = Frame {
                index: 0,
                ticks: 0,
                width: w as u32,
                height: h as u32,
                stride: 0,
                format,
                depth_bits: bits as u32,
                plane: Some(Box::new(pack(&values, bits))),
                colour: None,
            };
            let pixels = Pixels::of(&frame).unwrap().unwrap();
            for y in 0..h {
                for x in 0..w {
                    let mut out = vec![0; w - x];
                    pixels.read(y, x, &mut out);
                    assert_eq!(out, values[y * w + x..(y + 1) * w]);
                }
            }
        }
    }

    #[test]
    fn a_short_plane_is_an_error_that_names_the_frame() {
        let frame = Frame {
            index: 3,
            ticks: 0,
            width: 4,
            height: 4,
            stride: 4,
            format: PixelFormat::Gray8,
            depth_bits: 8,
            plane: Some(Box::new(vec![0u8; 15])),
            colour: None,
        };
        let text = Pixels::of(&frame).err().unwrap().to_string();
        assert!(text.contains("frame 3") && text.contains("16 bytes") && text.contains("15"), "{text}");
    }
}
