//! Marks the row cells that may hold a pixel beyond the threshold, at the speed of memory (the prefilter); only those are
//! labelled.
//!
//! Owns: [`Prefilter`], the trait [`Sample`]. Must not: say where in a cell.
//!
//! A cell is tested once: the extreme of its samples is compared with the threshold, or saturating differences from the
//! threshold are or-ed together and compared with 0.

use std::array::from_fn;
use std::marker::PhantomData;

use multiversion::multiversion;
use wide::{u8x16, u16x8};

use super::plan::{CELL_PX, Cell, Plan};
use crate::detect::pixels::{Pixels, fetch};
use crate::detect::settings::Polarity;
use crate::frame::PixelFormat;

/// Samples per bit mask.
pub(crate) const MASK_BITS: usize = 64;

/// A sample that can be compared with a threshold many at a time.
pub(crate) trait Sample: Copy {
    /// The threshold as a limit to subtract; `None` where no sample of this type can be beyond it.
    fn limit(threshold: u16, polarity: Polarity) -> Option<Self>;
    /// Whether any sample in blocks of little-endian bytes is beyond the limit.
    fn any(blocks: &[Block], limit: Self, polarity: Polarity) -> bool;
    /// The samples beyond the limit, as bits from the lowest on.
    fn beyond(many: &[Self; MASK_BITS], limit: Self, polarity: Polarity) -> u64;
}

macro_rules! sample {
    ($t:ty, $beyond:ident) => {
        impl Sample for $t {
            #[inline(always)]
            fn limit(threshold: u16, polarity: Polarity) -> Option<Self> {
                // Beyond is above the limit for bright markers and below it for dark ones.
                match polarity {
                    Polarity::Bright => <$t>::try_from(threshold.saturating_sub(1)).ok(),
                    Polarity::Dark => Some(<$t>::try_from(threshold.saturating_add(1)).unwrap_or(<$t>::MAX)),
                }
            }

            // Written so that the compiler makes one vector of what is farthest, and one instruction a block.
            #[inline(always)]
            fn any(blocks: &[Block], limit: Self, polarity: Polarity) -> bool {
                let mut farthest = [limit; BLOCK / size_of::<$t>()];
                for block in blocks {
                    for (f, bytes) in farthest.iter_mut().zip(block.as_chunks().0) {
                        let v = <$t>::from_le_bytes(*bytes);
                        *f = match polarity {
                            Polarity::Bright => v.max(*f),
                            Polarity::Dark => v.min(*f),
                        };
                    }
                }
                farthest.iter().fold(0, |all, f| all | (f ^ limit)) != 0
            }

            #[inline(always)]
            fn beyond(many: &[Self; MASK_BITS], limit: Self, polarity: Polarity) -> u64 {
                $beyond(many, limit, polarity)
            }
        }
    };
}
sample!(u8, beyond_u8);
sample!(u16, beyond_u16);

/// Bytes of a vector of AVX2.
const BLOCK: usize = 32;
type Block = [u8; BLOCK];

#[inline(always)]
fn beyond_u8(many: &[u8; MASK_BITS], limit: u8, polarity: Polarity) -> u64 {
    let limit = u8x16::splat(limit);
    let within = many.as_chunks().0.iter().enumerate().fold(0, |bits, (i, few)| {
        let values = u8x16::new(*few);
        let farther = match polarity {
            Polarity::Bright => values.max(limit),
            Polarity::Dark => values.min(limit),
        };
        bits | u64::from(farther.simd_eq(limit).to_bitmask()) << (16 * i)
    });
    !within
}

#[inline(always)]
fn beyond_u16(many: &[u16; MASK_BITS], limit: u16, polarity: Polarity) -> u64 {
    let limit = u16x8::splat(limit);
    let within = many.as_chunks().0.iter().enumerate().fold(0, |bits, (i, few)| {
        let values = u16x8::new(*few);
        // Not every processor has extremes of 16 bits, but all have saturating differences.
        let beyond = match polarity {
            Polarity::Bright => values.saturating_sub(limit),
            Polarity::Dark => limit.saturating_sub(values),
        };
        bits | u64::from(beyond.simd_eq(u16x8::splat(0)).to_bitmask()) << (8 * i)
    });
    !within
}

/// Parts of a frame that are read side by side: a processor that reads one row after another waits for memory half
/// of the time.
const STREAMS: usize = 4;

/// The cell of a row that may hold a pixel beyond: row, and column of cells.
pub(crate) type Mark = (u32, u32);

type Marks = [Vec<Mark>; STREAMS];

/// A row, or nothing below the last one.
struct Line<'a> {
    y: u32,
    cells: &'a [Cell],
    /// The bytes of the plane, and after how many bits of them the row starts.
    bytes: &'a [u8],
    bit: usize,
}

impl<'a> Line<'a> {
    #[inline(always)]
    fn new(pixels: &Pixels<'a>, plan: &'a Plan, y: usize) -> Self {
        if y >= pixels.height {
            return Self { y: 0, cells: &[], bytes: &[], bit: 0 };
        }
        let (byte, within) = pixels.start(y, 0);
        Self { y: y as u32, cells: plan.cells(y), bytes: pixels.bytes, bit: byte * 8 + within }
    }
}

/// Whether a cell of a row may hold a pixel beyond its threshold. A trait and no closure, since a closure is not
/// compiled for the instructions of the function that it is in.
trait Test {
    fn any(&mut self, line: &Line<'_>, cell: Cell) -> bool;
}

/// Asks of every cell of every row, and notes where the answer is yes.
#[inline(always)]
fn pass(pixels: &Pixels<'_>, plan: &Plan, marks: &mut Marks, mut test: impl Test) {
    let rows = pixels.height.div_ceil(STREAMS);
    marks.iter_mut().for_each(Vec::clear);
    for row in 0..rows {
        let lines: [Line<'_>; STREAMS] = from_fn(|stream| Line::new(pixels, plan, stream * rows + row));
        for column in 0..plan.columns {
            for (line, marks) in lines.iter().zip(marks.iter_mut()) {
                if let Some(&cell) = line.cells.get(column)
                    && cell.start < cell.end
                    && test.any(line, cell)
                {
                    marks.push((line.y, column as u32));
                }
            }
        }
    }
}

/// Samples of 8 or 16 bits in whole blocks, which reach beyond a cell that is cut; at the end of the plane the last
/// one is filled up with what is there. The polarity is a constant for the compiler's sake.
struct Blocks<T, const BRIGHT: bool>(PhantomData<T>);

impl<T: Sample, const BRIGHT: bool> Test for Blocks<T, BRIGHT> {
    #[inline(always)]
    fn any(&mut self, line: &Line<'_>, cell: Cell) -> bool {
        let polarity = if BRIGHT { Polarity::Bright } else { Polarity::Dark };
        let Some(limit) = T::limit(cell.threshold, polarity) else { return false };
        let bytes = &line.bytes[line.bit / 8 + cell.start as usize * size_of::<T>()..];
        // Most cells are whole ones, whose number of blocks the compiler knows.
        if cell.end - cell.start == CELL_PX
            && let Some(whole) = bytes.get(..CELL_PX as usize * size_of::<T>())
        {
            return T::any(whole.as_chunks().0, limit, polarity);
        }
        let (whole, rest) = bytes.as_chunks();
        let count = ((cell.end - cell.start) as usize * size_of::<T>()).div_ceil(BLOCK);
        match whole.get(..count) {
            Some(whole) => T::any(whole, limit, polarity),
            None => {
                let mut last = [0; BLOCK];
                last.iter_mut().zip(rest.iter().cycle()).for_each(|(to, &v)| *to = v);
                T::any(whole, limit, polarity) || T::any(&[last], limit, polarity)
            }
        }
    }
}

#[multiversion(targets("x86_64+avx2"))]
fn pass_u8<'a>(pixels: &Pixels<'a>, plan: &Plan, polarity: Polarity, marks: &mut Marks) {
    match polarity {
        Polarity::Bright => pass(pixels, plan, marks, Blocks::<u8, true>(PhantomData)),
        Polarity::Dark => pass(pixels, plan, marks, Blocks::<u8, false>(PhantomData)),
    }
}

#[multiversion(targets("x86_64+avx2"))]
fn pass_u16<'a>(pixels: &Pixels<'a>, plan: &Plan, polarity: Polarity, marks: &mut Marks) {
    match polarity {
        Polarity::Bright => pass(pixels, plan, marks, Blocks::<u16, true>(PhantomData)),
        Polarity::Dark => pass(pixels, plan, marks, Blocks::<u16, false>(PhantomData)),
    }
}

/// Bytes, or words in two vectors, that are worked on together: 32 bytes are a vector of AVX2.
const VECTOR_LANES: usize = 32;

/// Masks and limits of packed samples. The big-endian word of 16 bits at a byte holds the whole sample that begins in this byte;
/// where none begins, the word is left out. Of 12 bits, samples a, b begin in bytes 0 and 1 of three:
///
/// ```text
/// byte      0        1        2
///       aaaaaaaa aaaabbbb bbbbbbbb
/// word at 0: aaaaaaaa aaaabbbb    word at 1: aaaabbbb bbbbbbbb
/// ```
///
/// There are `N` words at even and as many at odd bytes of a cell. `keep` masks the bits before the sample, `limit` is the
/// threshold shifted to the sample's place; bits of the next sample behind it do not change the comparison.
#[derive(Debug, Clone, PartialEq)]
struct Words<const N: usize> {
    keep: [[u16; N]; 2],
    limit: [[u16; N]; 2],
    coarse: Option<Coarse<N>>,
}

/// Masks and limits of the first byte of each sample alone, which holds its upper bits: by even and odd bytes of a cell. Half
/// of the work, and mostly enough.
#[derive(Debug, Clone, PartialEq)]
struct Coarse<const N: usize> {
    keep: [[u8; 2]; N],
    limit: [[u8; 2]; N],
}

/// Bits of a byte before the sample that begins in it; `None` where none begins.
fn bits_before(byte: usize, bits: usize) -> Option<usize> {
    let before = (byte * 8).next_multiple_of(bits) - byte * 8;
    (before < 8).then_some(before)
}

impl<const N: usize> Coarse<N> {
    /// `None` where the upper bits of some sample say nothing.
    fn new(bits: usize, threshold: u16, polarity: Polarity) -> Option<Self> {
        let never = match polarity {
            Polarity::Bright => u8::MAX,
            Polarity::Dark => 0,
        };
        let mut this = Self { keep: [[0; 2]; N], limit: [[never; 2]; N] };
        for byte in 0..2 * N {
            let Some(before) = bits_before(byte, bits) else { continue };
            // A sample beyond the threshold has upper bits that are beyond or at those of the threshold.
            let upper = u8::try_from(threshold >> (bits + before - 8)).ok()?;
            this.keep[byte / 2][byte % 2] = u8::MAX >> before;
            this.limit[byte / 2][byte % 2] = match polarity {
                Polarity::Bright => upper.checked_sub(1)?,
                Polarity::Dark => upper.checked_add(1)?,
            };
        }
        Some(this)
    }

    /// Whether any sample in `2 * N` bytes may be beyond.
    // Written so that the compiler makes one vector of all differences.
    #[inline(always)]
    fn any<const BRIGHT: bool>(&self, bytes: &[u8]) -> bool {
        let (keep, limit) = (self.keep.as_flattened(), self.limit.as_flattened());
        let mut beyond = [0; VECTOR_LANES];
        for few in 0..(2 * N).div_ceil(VECTOR_LANES) {
            // The last ones may be looked at twice.
            let at = (few * VECTOR_LANES).min(2 * N - VECTOR_LANES);
            let (bytes, keep, limit) =
                (&bytes[at..at + VECTOR_LANES], &keep[at..at + VECTOR_LANES], &limit[at..at + VECTOR_LANES]);
            for (i, beyond) in beyond.iter_mut().enumerate() {
                let v = bytes[i] & keep[i];
                *beyond |= if BRIGHT { v.saturating_sub(limit[i]) } else { limit[i].saturating_sub(v) };
            }
        }
        beyond.iter().fold(0, |all, b| all | b) != 0
    }
}

impl<const N: usize> Words<N> {
    fn new(bits: usize, threshold: u16, polarity: Polarity) -> Self {
        let never = match polarity {
            Polarity::Bright => u16::MAX,
            Polarity::Dark => 0,
        };
        let coarse = Coarse::new(bits, threshold, polarity);
        let mut this = Self { keep: [[0; N]; 2], limit: [[never; N]; 2], coarse };
        for byte in 0..2 * N {
            let Some(before) = bits_before(byte, bits) else { continue };
            let shift = 16 - before - bits;
            let t = u32::from(threshold);
            this.keep[byte % 2][byte / 2] = u16::MAX >> before;
            this.limit[byte % 2][byte / 2] = match polarity {
                Polarity::Bright => (t << shift).saturating_sub(1).min(0xffff) as u16,
                Polarity::Dark => ((t + 1) << shift).min(0xffff) as u16,
            };
        }
        this
    }

    /// Whether any sample in `2 * N + 1` bytes is beyond, but for those of the last byte.
    // Written so that the compiler makes one vector of what is beyond.
    #[inline(always)]
    fn any<const BRIGHT: bool>(&self, bytes: &[u8]) -> bool {
        let mut beyond = [0; VECTOR_LANES];
        for (phase, (keep, limit)) in self.keep.iter().zip(&self.limit).enumerate() {
            let words: &[[u8; 2]] = bytes[phase..phase + 2 * N].as_chunks().0;
            for few in 0..N.div_ceil(VECTOR_LANES) {
                // The last ones may be looked at twice.
                let at = (few * VECTOR_LANES).min(N - VECTOR_LANES);
                let (words, keep, limit) = (
                    &words[at..at + VECTOR_LANES],
                    &keep[at..at + VECTOR_LANES],
                    &limit[at..at + VECTOR_LANES],
                );
                for (i, beyond) in beyond.iter_mut().enumerate() {
                    let v = u16::from_be_bytes(words[i]) & keep[i];
                    *beyond |= if BRIGHT { v.saturating_sub(limit[i]) } else { limit[i].saturating_sub(v) };
                }
            }
        }
        beyond.iter().fold(0, |all, b| all | b) != 0
    }

    /// Whether any sample of fewer bytes than a whole vector is beyond the threshold.
    #[inline(always)]
    fn any_of_few<const BRIGHT: bool>(&self, bytes: &[u8]) -> bool {
        let mut beyond = 0;
        for (phase, (keep, limit)) in self.keep.iter().zip(&self.limit).enumerate() {
            let words = bytes[phase..phase + bytes.len() - 1].as_chunks().0.iter();
            for ((word, keep), limit) in words.zip(keep).zip(limit) {
                let v = u16::from_be_bytes(*word) & keep;
                beyond |= if BRIGHT { v.saturating_sub(*limit) } else { limit.saturating_sub(v) };
            }
        }
        beyond != 0
    }
}

/// The words for each threshold of a recording in use, in order.
type Known<const N: usize> = Vec<(u16, Words<N>)>;

/// Packed samples; a cell takes `2 * N` bytes.
struct Packed<'a, const N: usize, const BRIGHT: bool> {
    known: &'a mut Known<N>,
    bits: usize,
}

impl<const N: usize, const BRIGHT: bool> Test for Packed<'_, N, BRIGHT> {
    #[inline(always)]
    fn any(&mut self, line: &Line<'_>, cell: Cell) -> bool {
        let polarity = if BRIGHT { Polarity::Bright } else { Polarity::Dark };
        let found = self.known.binary_search_by_key(&cell.threshold, |k| k.0);
        let i = found.unwrap_or_else(|i| {
            self.known.insert(i, (cell.threshold, Words::new(self.bits, cell.threshold, polarity)));
            i
        });
        let words = &self.known[i].1;
        let start = line.bit + cell.start as usize * self.bits;
        // Prefetch two cells ahead: the hardware prefetcher does not reach that far here.
        if let Some(next) = line.bytes.get(start / 8 + 4 * N..start / 8 + 6 * N) {
            next.chunks(64).for_each(fetch);
        }
        // Most cells are whole ones that begin with a sample on a byte, as words do.
        if start.is_multiple_of(8)
            && cell.end - cell.start == CELL_PX
            && let Some(whole) = line.bytes.get(start / 8..start / 8 + 2 * N + 1)
        {
            return words.coarse.as_ref().is_none_or(|coarse| coarse.any::<BRIGHT>(&whole[..2 * N]))
                && words.any::<BRIGHT>(whole);
        }
        // Parts of cells are tested from the last sample before them that begins on a byte; samples run on over the ends of rows
        // that end inside a byte.
        let mut from = start;
        while !from.is_multiple_of(8) {
            from -= self.bits;
        }
        let (mut from, to) = (from / 8, (start + (cell.end - cell.start) as usize * self.bits).div_ceil(8));
        while from < to {
            let count = (to - from).next_multiple_of(2).min(2 * N);
            // No byte is left behind the last word of the plane: the cell is marked untested.
            let Some(part) = line.bytes.get(from..from + count + 1) else { return true };
            if words.any_of_few::<BRIGHT>(part) {
                return true;
            }
            from += count;
        }
        false
    }
}

#[multiversion(targets("x86_64+avx2"))]
fn pass_packed<'a, const N: usize>(
    pixels: &Pixels<'a>,
    plan: &Plan,
    polarity: Polarity,
    known: &mut Known<N>,
    marks: &mut Marks,
) {
    let bits = pixels.format.bits_per_pixel() as usize;
    match polarity {
        Polarity::Bright => pass(pixels, plan, marks, Packed::<N, true> { known, bits }),
        Polarity::Dark => pass(pixels, plan, marks, Packed::<N, false> { known, bits }),
    }
}

/// Number of words at the even bytes of a cell of packed samples.
const fn words_of(bits: usize) -> usize {
    CELL_PX as usize * bits / 8 / 2
}

/// Finds the cells of a frame that may hold a pixel beyond the threshold; owns its scratch.
#[derive(Debug, Default)]
pub(crate) struct Prefilter {
    marks: Marks,
    known_10: Known<{ words_of(10) }>,
    known_12: Known<{ words_of(12) }>,
    /// The polarity that words are known for.
    polarity: Option<Polarity>,
}

impl Prefilter {
    /// The cells that may hold a pixel beyond their threshold, row by row. None is left out that does; pixels just
    /// beside a cell may be the reason that it is there.
    pub fn find(&mut self, pixels: &Pixels<'_>, plan: &Plan, polarity: Polarity) {
        if self.polarity != Some(polarity) {
            self.known_10.clear();
            self.known_12.clear();
            self.polarity = Some(polarity);
        }
        match pixels.format {
            PixelFormat::Gray8 => pass_u8(pixels, plan, polarity, &mut self.marks),
            PixelFormat::Gray16 => pass_u16(pixels, plan, polarity, &mut self.marks),
            PixelFormat::Packed10 => pass_packed(pixels, plan, polarity, &mut self.known_10, &mut self.marks),
            PixelFormat::Packed12 => pass_packed(pixels, plan, polarity, &mut self.known_12, &mut self.marks),
        }
    }

    /// The marks that [`Prefilter::find`] found, in order.
    pub fn marks(&self) -> impl Iterator<Item = Mark> {
        self.marks.iter().flatten().copied()
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
            // An odd width, so that packed rows end inside bytes; a height that is no multiple of four.
            let (w, h) = (701usize, 7usize);
            let last = (h as u32 - 1, (w as u32 - 1) / CELL_PX);
            for polarity in [Polarity::Bright, Polarity::Dark] {
                let (ground, t) = match polarity {
                    Polarity::Bright => (top / 2, top / 2 + 1),
                    Polarity::Dark => (top / 2, top / 2 - 1),
                };
                for x in [0, 1, 2, 3, 4, 5, 158, 159, 160, 161, 319, 320, 321, 639, 640, 697, 698, 699, 700] {
                    for y in [0, 1, 3, 6] {
                        let mut values = vec![ground; w * h];
                        values[y * w + x] = t;
                        let bytes = crate::detect::pixels::pack(&values, bits);
                        let pixels = Pixels::of_samples(&bytes, w, h, format);
                        let mut prefilter = Prefilter::default();
                        prefilter.find(&pixels, &Plan::uniform(w, h, t, polarity), polarity);
                        let mark = (y as u32, x as u32 / CELL_PX);
                        assert!(prefilter.marks().any(|m| m == mark), "{format:?} {polarity:?} {x} {y}");
                        // The pixel's own cell, one beside it, and of packed rows the last one.
                        assert!(prefilter.marks().count() <= 3, "{format:?} {polarity:?} {x} {y}");
                        // A step farther and nothing is beyond.
                        let farther = match polarity {
                            Polarity::Bright => t + 1,
                            Polarity::Dark => t - 1,
                        };
                        prefilter.find(&pixels, &Plan::uniform(w, h, farther, polarity), polarity);
                        assert!(
                            prefilter.marks().all(|m| m == last),
                            "{format:?} {polarity:?} {x} {y} farther"
                        );
                    }
                }
            }
        }
    }
}
