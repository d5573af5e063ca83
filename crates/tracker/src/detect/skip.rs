//! Passing over background at the speed of memory: which cells may hold a pixel beyond the threshold.
//!
//! Owns: [`Skip`], the trait [`Sample`]. Must not: say where in a cell. The extreme of many bytes, or saturating
//! differences or-ed together, and one test at the end.

use std::array::from_fn;
use std::marker::PhantomData;
use std::ops::Range;

use multiversion::multiversion;
use wide::{u8x16, u16x8};

use super::levels::Side;
use super::pixels::Pixels;
use super::plan::{Cell, Plan};
use crate::frame::PixelFormat;

/// Samples whose bits are found together.
pub(crate) const FEW: usize = 16;

/// A sample that can be compared with a threshold many at a time.
pub(crate) trait Sample: Copy {
    /// The threshold as a limit to subtract; `None` where no sample of this type can be beyond it.
    fn limit(threshold: u16, side: Side) -> Option<Self>;
    /// Whether any sample in blocks of little-endian bytes is beyond the limit.
    fn any(blocks: &[Block], limit: Self, side: Side) -> bool;
    /// Which of a few samples are beyond the limit, as bits from the lowest on.
    fn beyond_of(few: &[Self; FEW], limit: Self, side: Side) -> u32;
    /// Whether this one is.
    fn beyond(self, limit: Self, side: Side) -> bool;
}

macro_rules! sample {
    ($t:ty, $any:ident, $beyond_of:ident) => {
        impl Sample for $t {
            #[inline(always)]
            fn limit(threshold: u16, side: Side) -> Option<Self> {
                // Beyond is above the limit for bright markers and below it for dark ones.
                match side {
                    Side::Bright => <$t>::try_from(threshold.saturating_sub(1)).ok(),
                    Side::Dark => Some(<$t>::try_from(threshold.saturating_add(1)).unwrap_or(<$t>::MAX)),
                }
            }

            #[inline(always)]
            fn any(blocks: &[Block], limit: Self, side: Side) -> bool {
                $any(blocks, limit, side)
            }

            #[inline(always)]
            fn beyond_of(few: &[Self; FEW], limit: Self, side: Side) -> u32 {
                $beyond_of(few, limit, side)
            }

            #[inline(always)]
            fn beyond(self, limit: Self, side: Side) -> bool {
                match side {
                    Side::Bright => self > limit,
                    Side::Dark => self < limit,
                }
            }
        }
    };
}
sample!(u8, any_u8, bits_u8);
sample!(u16, any_u16, bits_u16);

#[inline(always)]
fn bits_u8(few: &[u8; FEW], limit: u8, side: Side) -> u32 {
    let (values, limit) = (u8x16::new(*few), u8x16::splat(limit));
    let beyond = match side {
        Side::Bright => values.saturating_sub(limit),
        Side::Dark => limit.saturating_sub(values),
    };
    0xffff ^ beyond.simd_eq(u8x16::splat(0)).to_bitmask()
}

#[inline(always)]
fn bits_u16(few: &[u16; FEW], limit: u16, side: Side) -> u32 {
    few.iter().enumerate().fold(0, |m, (i, v)| m | u32::from(v.beyond(limit, side)) << i)
}

/// Bytes that are worked on together: four vectors of every processor.
const BLOCK: usize = 64;
type Block = [u8; BLOCK];

/// The extreme of bytes.
#[inline(always)]
fn any_u8(blocks: &[Block], limit: u8, side: Side) -> bool {
    let further = |a: u8x16, b: u8x16| match side {
        Side::Bright => a.max(b),
        Side::Dark => a.min(b),
    };
    let mut extremes = [u8x16::splat(limit); 4];
    for block in blocks {
        for (e, few) in extremes.iter_mut().zip(block.as_chunks().0) {
            *e = further(*e, u8x16::new(*few));
        }
    }
    let [a, b, c, d] = extremes;
    further(further(a, b), further(c, d)).simd_eq(u8x16::splat(limit)).to_bitmask() != 0xffff
}

/// Not every processor has that for 16 bits, but all have saturating differences. Little-endian samples in bytes.
#[inline(always)]
fn any_u16(blocks: &[Block], limit: u16, side: Side) -> bool {
    let limit = u16x8::splat(limit);
    let mut beyond = [u16x8::splat(0); 4];
    for block in blocks {
        for (b, few) in beyond.iter_mut().zip(block.as_chunks::<16>().0) {
            let pairs: [[u8; 2]; 8] = from_fn(|i| [few[2 * i], few[2 * i + 1]]);
            let values = u16x8::new(pairs.map(u16::from_le_bytes));
            *b |= match side {
                Side::Bright => values.saturating_sub(limit),
                Side::Dark => limit.saturating_sub(values),
            };
        }
    }
    let [a, b, c, d] = beyond;
    ((a | b) | (c | d)).simd_eq(u16x8::splat(0)).to_bitmask() != 0xff
}

/// Parts of a frame that are read side by side: a processor that reads one row after another waits for memory half
/// of the time.
const STREAMS: usize = 4;

/// The cell of a row that may hold a pixel beyond: row, and column of cells.
pub(crate) type Mark = (u32, u32);

type Marks = [Vec<Mark>; STREAMS];

/// Whether a stretch of bytes in a row may hold a pixel beyond a threshold. A trait and no closure, since a closure is
/// not compiled for the instructions of the function that it is in.
trait Test {
    fn any(&mut self, pixels: &Pixels<'_>, y: usize, at: Range<usize>, threshold: u16) -> bool;
}

/// Asks of every cell of every row, and notes where the answer is yes.
#[inline(always)]
fn pass(pixels: &Pixels<'_>, plan: &Plan, marks: &mut Marks, mut test: impl Test) {
    let rows = pixels.height.div_ceil(STREAMS);
    let bits = pixels.format.bits_per_pixel() as usize;
    marks.iter_mut().for_each(Vec::clear);
    for row in 0..rows {
        for column in 0..plan.columns {
            for (stream, marks) in marks.iter_mut().enumerate() {
                let y = stream * rows + row;
                if y >= pixels.height {
                    break;
                }
                let Cell { start, end, threshold } = plan.cell(y, column);
                let (from, skip) = pixels.start(y, start as usize);
                let to = from + (skip + (end - start) as usize * bits).div_ceil(8);
                if start < end && test.any(pixels, y, from..to, threshold) {
                    marks.push((y as u32, column as u32));
                }
            }
        }
    }
}

/// Samples of 8 or 16 bits in whole blocks, which reach beyond the stretch; at the end of the plane the last one is
/// filled up with what is there. The side is a constant for the compiler's sake.
struct Blocks<T, const BRIGHT: bool>(PhantomData<T>);

impl<T: Sample, const BRIGHT: bool> Test for Blocks<T, BRIGHT> {
    #[inline(always)]
    fn any(&mut self, pixels: &Pixels<'_>, _: usize, at: Range<usize>, threshold: u16) -> bool {
        let side = if BRIGHT { Side::Bright } else { Side::Dark };
        let Some(limit) = T::limit(threshold, side) else { return false };
        let (whole, rest) = pixels.bytes[at.start..].as_chunks::<BLOCK>();
        match whole.get(..at.len().div_ceil(BLOCK)) {
            Some(whole) => T::any(whole, limit, side),
            None => {
                let mut last = [0; BLOCK];
                last.iter_mut().zip(rest.iter().cycle()).for_each(|(to, &v)| *to = v);
                T::any(whole, limit, side) || T::any(&[last], limit, side)
            }
        }
    }
}

fn pass_u8(pixels: &Pixels<'_>, plan: &Plan, side: Side, marks: &mut Marks) {
    match side {
        Side::Bright => pass(pixels, plan, marks, Blocks::<u8, true>(PhantomData)),
        Side::Dark => pass(pixels, plan, marks, Blocks::<u8, false>(PhantomData)),
    }
}

fn pass_u16(pixels: &Pixels<'_>, plan: &Plan, side: Side, marks: &mut Marks) {
    match side {
        Side::Bright => pass(pixels, plan, marks, Blocks::<u16, true>(PhantomData)),
        Side::Dark => pass(pixels, plan, marks, Blocks::<u16, false>(PhantomData)),
    }
}

/// Packed samples.
struct Packed<'a> {
    known: &'a mut Vec<(u16, Words)>,
    side: Side,
    bits: usize,
}

impl Test for Packed<'_> {
    #[inline(always)]
    fn any(&mut self, pixels: &Pixels<'_>, y: usize, at: Range<usize>, threshold: u16) -> bool {
        let found = self.known.binary_search_by_key(&threshold, |k| k.0);
        let i = found.unwrap_or_else(|i| {
            self.known.insert(i, (threshold, Words::new(self.bits, threshold, self.side)));
            i
        });
        let words = &self.known[i].1;
        // Back to the start of a group of samples that begins on a byte.
        let (origin, period) = (pixels.group_origin(y), if self.bits == 12 { 3 } else { 5 });
        let mut from = origin + (at.start - origin) / period * period;
        while from < at.end {
            let count = (at.end - from).next_multiple_of(32).min(2 * LANES);
            // At the end of the plane each is looked at.
            let Some(chunk) = pixels.bytes.get(from..from + count + 1) else { return true };
            if words.any(chunk, self.side) {
                return true;
            }
            from += count;
        }
        false
    }
}

#[multiversion(targets("x86_64+avx2"))]
fn pass_packed<'a>(
    pixels: &Pixels<'a>,
    plan: &Plan,
    side: Side,
    known: &mut Vec<(u16, Words)>,
    marks: &mut Marks,
) {
    let bits = pixels.format.bits_per_pixel() as usize;
    match side {
        Side::Bright => pass(pixels, plan, marks, Packed { known, side: Side::Bright, bits }),
        Side::Dark => pass(pixels, plan, marks, Packed { known, side: Side::Dark, bits }),
    }
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

    /// Whether any sample in `bytes` is beyond, but for those of the last byte: at most `2 * LANES + 1`.
    #[inline(always)]
    fn any(&self, bytes: &[u8], side: Side) -> bool {
        let mut beyond = 0;
        for phase in 0..2 {
            let words = bytes[phase..phase + bytes.len() - 1].chunks_exact(2);
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

/// Finds the cells of a frame that may hold a pixel beyond the threshold; owns its scratch.
#[derive(Debug, Default)]
pub(crate) struct Skip {
    marks: Marks,
    /// By threshold, for one packed format and side.
    words: Vec<(u16, Words)>,
    words_of: Option<(PixelFormat, Side)>,
}

impl Skip {
    /// The cells that may hold a pixel beyond their threshold, row by row. None is left out that does; pixels just
    /// beside a cell may be the reason that it is there.
    pub fn find(&mut self, pixels: &Pixels<'_>, plan: &Plan, side: Side) {
        match pixels.format {
            PixelFormat::Gray8 => pass_u8(pixels, plan, side, &mut self.marks),
            PixelFormat::Gray16 => pass_u16(pixels, plan, side, &mut self.marks),
            PixelFormat::Packed10 | PixelFormat::Packed12 => {
                if self.words_of != Some((pixels.format, side)) {
                    self.words.clear();
                    self.words_of = Some((pixels.format, side));
                }
                pass_packed(pixels, plan, side, &mut self.words, &mut self.marks);
            }
        }
    }

    /// What [`Skip::find`] found, in order.
    pub fn marks(&self) -> impl Iterator<Item = Mark> {
        self.marks.iter().flatten().copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detect::plan::CELL_PX;

    #[test]
    fn a_single_pixel_is_never_passed_over_in_any_format() {
        for format in [PixelFormat::Gray8, PixelFormat::Gray16, PixelFormat::Packed10, PixelFormat::Packed12]
        {
            let bits = format.bits_per_pixel() as usize;
            let top = if bits == 16 { 4095 } else { (1u32 << bits) - 1 } as u16;
            // An odd width, so that packed rows end inside bytes; a height that is no multiple of four.
            let (w, h) = (701usize, 7usize);
            for side in [Side::Bright, Side::Dark] {
                let (ground, t) = match side {
                    Side::Bright => (top / 2, top / 2 + 1),
                    Side::Dark => (top / 2, top / 2 - 1),
                };
                for x in [0, 1, 2, 3, 4, 5, 158, 159, 160, 161, 319, 320, 321, 639, 640, 697, 698, 699, 700] {
                    for y in [0, 1, 3, 6] {
                        let mut values = vec![ground; w * h];
                        values[y * w + x] = t;
                        let bytes = crate::detect::pixels::pack(&values, bits);
                        let pixels = Pixels::of_samples(&bytes, w, h, format);
                        let mut skip = Skip::default();
                        skip.find(&pixels, &Plan::uniform(w, h, t, side), side);
                        let mark = (y as u32, x as u32 / CELL_PX);
                        assert!(skip.marks().any(|m| m == mark), "{format:?} {side:?} {x} {y}");
                        // The pixel's own cell, one beside it, and of packed rows the last one.
                        assert!(skip.marks().count() <= 3, "{format:?} {side:?} {x} {y}");
                        // A step farther and nothing is beyond.
                        let farther = match side {
                            Side::Bright => t + 1,
                            Side::Dark => t - 1,
                        };
                        skip.find(&pixels, &Plan::uniform(w, h, farther, side), side);
                        assert!(skip.marks().all(|m| m == (6, 2)), "{format:?} {side:?} {x} {y} farther");
                    }
                }
            }
        }
    }
}
