//! Passing over background at vector speed: whether any pixel of a stretch is beyond the threshold.
//!
//! Owns: [`Skip`], the trait [`Sample`]. Must not: say where. Written so that the compiler makes vector
//! instructions of it: the extreme of many bytes, or saturating differences or-ed together, one test at the end.

use std::ops::Range;

use multiversion::multiversion;

use super::levels::Side;
use super::pixels::Pixels;
use crate::frame::PixelFormat;

/// A sample that can be compared with a threshold many at a time.
pub(crate) trait Sample: Copy {
    /// The threshold as a limit to subtract; `None` where no sample of this type can be beyond it.
    fn limit(threshold: u16, side: Side) -> Option<Self>;
    /// Whether any sample is beyond the limit.
    fn any(values: &[Self], limit: Self, side: Side) -> bool;
    /// Whether this one is.
    fn beyond(self, limit: Self, side: Side) -> bool;
}

macro_rules! sample {
    ($t:ty, $any:ident) => {
        impl Sample for $t {
            #[inline]
            fn limit(threshold: u16, side: Side) -> Option<Self> {
                // Beyond is above the limit for bright markers and below it for dark ones.
                match side {
                    Side::Bright => <$t>::try_from(threshold.saturating_sub(1)).ok(),
                    Side::Dark => Some(<$t>::try_from(threshold.saturating_add(1)).unwrap_or(<$t>::MAX)),
                }
            }

            #[inline]
            fn any(values: &[Self], limit: Self, side: Side) -> bool {
                $any(values, limit, side)
            }

            #[inline]
            fn beyond(self, limit: Self, side: Side) -> bool {
                match side {
                    Side::Bright => self > limit,
                    Side::Dark => self < limit,
                }
            }
        }
    };
}
sample!(u8, any_u8);
sample!(u16, any_u16);

/// Every processor has an instruction for the extreme of bytes.
#[inline(always)]
fn any_u8(values: &[u8], limit: u8, side: Side) -> bool {
    match side {
        Side::Bright => values.iter().fold(0, |a, &v| a.max(v)) > limit,
        Side::Dark => values.iter().fold(u8::MAX, |a, &v| a.min(v)) < limit,
    }
}

/// Not so for 16 bits, but all have saturating differences.
#[inline(always)]
fn any_u16(values: &[u16], limit: u16, side: Side) -> bool {
    let beyond = match side {
        Side::Bright => values.iter().fold(0, |a, &v| a | v.saturating_sub(limit)),
        Side::Dark => values.iter().fold(0, |a, &v| a | limit.saturating_sub(v)),
    };
    beyond != 0
}

/// The same for little-endian samples in bytes.
#[inline(always)]
fn any_pair(bytes: &[u8], limit: u16, side: Side) -> bool {
    let values = bytes.as_chunks().0.iter().map(|&b| u16::from_le_bytes(b));
    let beyond = match side {
        Side::Bright => values.fold(0, |a, v| a | v.saturating_sub(limit)),
        Side::Dark => values.fold(0, |a, v| a | limit.saturating_sub(v)),
    };
    beyond != 0
}

/// Bytes from which on the widest instructions of the processor are worth the call.
const LONG: usize = 1024;

#[multiversion(targets("x86_64+avx2"))]
fn long_u8(values: &[u8], limit: u8, side: Side) -> bool {
    any_u8(values, limit, side)
}

#[multiversion(targets("x86_64+avx2"))]
fn long_pair(bytes: &[u8], limit: u16, side: Side) -> bool {
    any_pair(bytes, limit, side)
}

/// Sixteen-bit words of a packed stretch tested at once: a multiple of the packing's period and of a vector.
const LANES: usize = 120;

/// For a packed format: at each byte of the period a big-endian word holds one whole sample or none. `keep`
/// takes the neighbours' upper bits away, `limit` is the threshold shifted to where the sample lies; the lower
/// bits that are left of its neighbour do not change the comparison.
#[derive(Debug, Clone, PartialEq)]
struct Words {
    keep: [[u16; LANES]; 2],
    limit: [[u16; LANES]; 2],
}

impl Words {
    fn new(bits: usize, threshold: u16, side: Side) -> Self {
        let period = if bits == 12 { 3 } else { 5 };
        let never = match side {
            Side::Bright => u16::MAX,
            Side::Dark => 0,
        };
        let mut this = Self { keep: [[0; LANES]; 2], limit: [[never; LANES]; 2] };
        for phase in 0..2 {
            for lane in 0..LANES {
                let byte = (2 * lane + phase) % period;
                let within = (byte * 8).next_multiple_of(bits) - byte * 8;
                if within >= 8 {
                    continue;
                }
                let shift = 16 - within - bits;
                this.keep[phase][lane] = u16::MAX >> within;
                let t = u32::from(threshold);
                this.limit[phase][lane] = match side {
                    Side::Bright => (t << shift).saturating_sub(1).min(0xffff) as u16,
                    Side::Dark => ((t + 1) << shift).min(0xffff) as u16,
                };
            }
        }
        this
    }

    /// Whether any sample in `2 * LANES` bytes is beyond; `bytes` has one more.
    #[inline]
    fn any(&self, bytes: &[u8], side: Side) -> bool {
        let mut beyond = 0;
        for phase in 0..2 {
            let words = bytes[phase..phase + 2 * LANES].chunks_exact(2);
            for ((b, keep), limit) in words.zip(&self.keep[phase]).zip(&self.limit[phase]) {
                let v = u16::from_be_bytes([b[0], b[1]]) & keep;
                beyond |= match side {
                    Side::Bright => v.saturating_sub(*limit),
                    Side::Dark => limit.saturating_sub(v),
                };
            }
        }
        beyond != 0
    }
}

/// Says whether a stretch may hold a pixel beyond the threshold. Never wrongly no.
#[derive(Debug, Default)]
pub(crate) struct Skip {
    words: Option<(u16, Side, PixelFormat, Box<Words>)>,
}

impl Skip {
    /// Whether any pixel from the first column of the first row to the last column of the last may be beyond the
    /// threshold. What lies between rows is looked at too, and where packed rows do not end on whole bytes the
    /// pixels just before and behind.
    #[inline]
    pub fn may_hold(
        &mut self,
        pixels: &Pixels<'_>,
        rows: Range<usize>,
        columns: (u32, u32),
        threshold: u16,
        side: Side,
    ) -> bool {
        let from = pixels.start(rows.start, columns.0 as usize).0;
        let (last, skip) = pixels.start(rows.end - 1, columns.1 as usize);
        let last = last + usize::from(skip > 0);
        match pixels.format {
            PixelFormat::Gray8 => {
                let Some(limit) = u8::limit(threshold, side) else { return false };
                let bytes = &pixels.bytes[from..last];
                if bytes.len() < LONG { any_u8(bytes, limit, side) } else { long_u8(bytes, limit, side) }
            }
            PixelFormat::Gray16 => {
                let Some(limit) = u16::limit(threshold, side) else { return false };
                let bytes = &pixels.bytes[from..last];
                if bytes.len() < LONG { any_pair(bytes, limit, side) } else { long_pair(bytes, limit, side) }
            }
            PixelFormat::Packed10 | PixelFormat::Packed12 => {
                let bits = pixels.format.bits_per_pixel() as usize;
                let known = matches!(&self.words, Some((t, s, f, _))
                    if *t == threshold && *s == side && *f == pixels.format);
                if !known {
                    let words = Box::new(Words::new(bits, threshold, side));
                    self.words = Some((threshold, side, pixels.format, words));
                }
                let Some((_, _, _, words)) = &self.words else { return true };
                // Back to the start of a group of samples that begins on a byte.
                let origin = pixels.group_origin(rows.start);
                let period = if bits == 12 { 3 } else { 5 };
                let mut at = origin + (from - origin) / period * period;
                while at < last {
                    let Some(chunk) = pixels.bytes.get(at..at + 2 * LANES + 1) else { return true };
                    if words.any(chunk, side) {
                        return true;
                    }
                    at += 2 * LANES;
                }
                false
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_single_pixel_is_never_passed_over_in_any_format() {
        for format in [PixelFormat::Gray8, PixelFormat::Gray16, PixelFormat::Packed10, PixelFormat::Packed12]
        {
            let bits = format.bits_per_pixel() as usize;
            let top = if bits == 16 { 4095 } else { (1u32 << bits) - 1 } as u16;
            // An odd width, so that packed rows end inside bytes.
            let (w, h) = (701usize, 3usize);
            for side in [Side::Bright, Side::Dark] {
                let (ground, t) = match side {
                    Side::Bright => (top / 2, top / 2 + 1),
                    Side::Dark => (top / 2, top / 2 - 1),
                };
                for x in [0, 1, 2, 3, 4, 5, 158, 159, 160, 161, 350, 697, 698, 699, 700] {
                    let mut values = vec![ground; w * h];
                    values[w + x] = t;
                    let bytes = crate::detect::pixels::pack(&values, bits);
                    let pixels = Pixels::of_samples(&bytes, w, h, format);
                    let mut skip = Skip::default();
                    assert!(skip.may_hold(&pixels, 1..2, (0, w as u32), t, side), "{format:?} {side:?} {x}");
                    // A step farther and nothing is beyond; the last row's tail may be looked at in full.
                    let farther = match side {
                        Side::Bright => t + 1,
                        Side::Dark => t - 1,
                    };
                    assert!(
                        !skip.may_hold(&pixels, 0..1, (0, w as u32), farther, side),
                        "{format:?} {side:?} {x} farther"
                    );
                }
            }
        }
    }
}
