//! Reads the bits of a JPEG picture's coded data, block by block.
//!
//! Owns: [`Bits`], [`Codes`]. Must not: know of segments. ITU-T T.81, annexes C, F and K.

use std::sync::OnceLock;

/// Bits of a code that are looked up at once; longer codes are rare.
const QUICK: usize = 11;
/// Longest code, bits.
const LONGEST: usize = 16;
/// Coefficients of a block.
const BLOCK: u32 = 64;

/// The meaning of a code.
#[derive(Clone, Copy, Default)]
struct Code {
    /// Bits of the code and of the number behind it; 0 where there is no such code.
    bits: u8,
    /// Coefficients of a block that it goes on by; [`BLOCK`] at its end.
    coefficients: u8,
    /// Bits of the number behind it: 0 where it only goes on.
    size: u8,
}

impl Code {
    fn new(length: usize, value: u8) -> Self {
        let (run, size) = (value >> 4, value & 15);
        // Without a number it is the block's end, or sixteen coefficients of 0.
        let coefficients = if size == 0 && run < 15 { BLOCK as u8 } else { run + 1 };
        Self { bits: length as u8 + size, coefficients, size }
    }
}

/// The codes of one table.
pub(super) struct Codes {
    /// For each beginning of [`QUICK`] bits the code; of a longer one, or none, 0 bits.
    quick: Box<[Code; 1 << QUICK]>,
    /// For each length the first code, the one past the last, and where its value stands.
    lengths: [(u32, u32, usize); LONGEST + 1],
    values: Vec<u8>,
}

impl Codes {
    /// The codes of a table of how many there are of each length, and what they stand for; `None` if there are no such codes.
    pub(super) fn new(counts: &[u8; 16], values: &[u8]) -> Option<Self> {
        let mut quick = Box::new([Code::default(); 1 << QUICK]);
        let mut lengths = [(0, 0, 0); LONGEST + 1];
        let (mut code, mut place) = (0u32, 0);
        for length in 1..=LONGEST {
            let n = usize::from(counts[length - 1]);
            lengths[length] = (code, code + n as u32, place);
            for value in values.get(place..place + n)? {
                if length <= QUICK {
                    let first = (code as usize) << (QUICK - length);
                    quick.get_mut(first..first + (1 << (QUICK - length)))?.fill(Code::new(length, *value));
                }
                code += 1;
            }
            if code > 1 << length {
                return None;
            }
            place += n;
            code <<= 1;
        }
        Some(Self { quick, lengths, values: values.to_vec() })
    }

    /// The usual codes, which pictures in films may leave out: of class 0 or 1, table 0 or 1.
    pub(super) fn usual(class: usize, table: usize) -> Option<&'static Self> {
        static USUAL: OnceLock<Vec<Option<Codes>>> = OnceLock::new();
        let all = USUAL.get_or_init(|| {
            let tables: [(&[u8; 16], &[u8]); 4] =
                [(&DC[0], &SIZES), (&DC[1], &SIZES), (&AC[0], &RUNS[0]), (&AC[1], &RUNS[1])];
            tables.iter().map(|(counts, values)| Self::new(counts, values)).collect()
        });
        all.get(2 * class + table).filter(|_| table < 2)?.as_ref()
    }
}

/// The data of a scan.
pub(super) struct Bits<'a> {
    data: &'a [u8],
    /// The next byte to be taken.
    at: usize,
    /// Bits that were taken and not used, the next one highest; behind the data come zeros.
    bits: u64,
    count: i32,
}

impl<'a> Bits<'a> {
    pub(super) fn new(data: &'a [u8]) -> Self {
        Self { data, at: 0, bits: 0, count: 0 }
    }

    /// Takes bytes up to a marker, 32 bits or more where there are so many. Behind it and behind the end nothing more comes.
    #[inline(always)]
    fn fill(&mut self) {
        if self.count >= 32 {
            return;
        }
        if let Some(next) = self.data.get(self.at..).and_then(|rest| rest.first_chunk::<8>()) {
            let next = u64::from_be_bytes(*next);
            // The highest bit of each byte of ones, and maybe of one beside such a byte.
            let ones = (!next).wrapping_sub(0x0101_0101_0101_0101) & next & 0x8080_8080_8080_8080;
            if ones == 0 && self.count >= 0 {
                let bytes = (63 - self.count) as usize / 8;
                self.bits |= (next & !(u64::MAX >> (8 * bytes))) >> self.count;
                self.count += 8 * bytes as i32;
                self.at += bytes;
                return;
            }
        }
        self.fill_by_bytes();
    }

    #[cold]
    fn fill_by_bytes(&mut self) {
        while (0..=56).contains(&self.count) {
            let Some(&byte) = self.data.get(self.at) else { return };
            if byte == 0xff {
                if self.data.get(self.at + 1) != Some(&0) {
                    return;
                }
                self.at += 1;
            }
            self.at += 1;
            self.bits |= u64::from(byte) << (56 - self.count);
            self.count += 8;
        }
    }

    fn skip(&mut self, n: u32) {
        self.bits <<= n;
        self.count -= n as i32;
    }

    /// Takes a code and the number behind it.
    #[inline(always)]
    fn code(&mut self, codes: &Codes) -> Result<Code, String> {
        // They take 31 bits at most.
        self.fill();
        let code = codes.quick[(self.bits >> (64 - QUICK)) as usize];
        if code.bits == 0 {
            return self.long_code(codes);
        }
        self.skip(u32::from(code.bits));
        Ok(code)
    }

    #[cold]
    fn long_code(&mut self, codes: &Codes) -> Result<Code, String> {
        for length in QUICK + 1..=LONGEST {
            let code = (self.bits >> (64 - length)) as u32;
            let (first, end, place) = codes.lengths[length];
            if (first..end).contains(&code) {
                let code = Code::new(length, codes.values[place + (code - first) as usize]);
                self.skip(u32::from(code.bits));
                return Ok(code);
            }
        }
        self.skip(LONGEST as u32);
        self.is_there()?;
        Err("its data hold a code that is none".to_owned())
    }

    /// Whether all bits that were used are there.
    fn is_there(&self) -> Result<(), String> {
        if self.count < 0 { Err("its data end before its last block".to_owned()) } else { Ok(()) }
    }

    /// Goes through the coefficients of a block.
    pub(super) fn block(&mut self, dc: &Codes, ac: &Codes) -> Result<(), String> {
        // The first code is that of the sum, which has a size and no run.
        self.code(dc)?;
        let mut at = 1;
        let mut last = Code::default();
        while at < BLOCK {
            last = self.code(ac)?;
            at += u32::from(last.coefficients);
        }
        self.is_there()?;
        if at > BLOCK && last.size > 0 {
            return Err("its data hold a block of more than 64 coefficients".to_owned());
        }
        Ok(())
    }

    /// Goes on behind marker `number` of those that parts begin with.
    pub(super) fn restart(&mut self, number: usize) -> Result<(), String> {
        let (left, at) = self.end();
        // More than one such byte may stand before the code of a marker.
        let next = self.data[at..].iter().position(|b| *b != 0xff).map(|n| at + n);
        if left > 0 || next.is_none_or(|next| self.data[next] != 0xd0 + number as u8) {
            return Err("a part of its data is not where it should be".to_owned());
        }
        *self = Self { data: self.data, at: next.map_or(at, |n| n + 1), bits: 0, count: 0 };
        Ok(())
    }

    /// Whole bytes that were not used, and where the marker behind them is.
    pub(super) fn end(&self) -> (usize, usize) {
        let rest = &self.data[self.at..];
        let is_marker = |pair: &[u8]| pair[0] == 0xff && pair[1] != 0;
        let behind = rest.windows(2).position(is_marker).unwrap_or(rest.len());
        (self.count as usize / 8 + behind, self.at + behind)
    }
}

/// Codes of the sums of luma's and chroma's blocks (tables K.3, K.4): how many of each length, and what they stand for.
const DC: [[u8; 16]; 2] =
    [[0, 1, 5, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0, 0, 0], [0, 3, 1, 1, 1, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0]];
const SIZES: [u8; 12] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11];
/// Codes of the other coefficients (tables K.5, K.6).
const AC: [[u8; 16]; 2] =
    [[0, 2, 1, 3, 3, 2, 4, 3, 5, 5, 4, 4, 0, 0, 1, 125], [0, 2, 1, 2, 4, 4, 3, 4, 7, 5, 4, 4, 0, 1, 2, 119]];
const RUNS: [[u8; 162]; 2] = [
    [
        0x01, 0x02, 0x03, 0x00, 0x04, 0x11, 0x05, 0x12, 0x21, 0x31, 0x41, 0x06, 0x13, 0x51, 0x61, 0x07, 0x22,
        0x71, 0x14, 0x32, 0x81, 0x91, 0xa1, 0x08, 0x23, 0x42, 0xb1, 0xc1, 0x15, 0x52, 0xd1, 0xf0, 0x24, 0x33,
        0x62, 0x72, 0x82, 0x09, 0x0a, 0x16, 0x17, 0x18, 0x19, 0x1a, 0x25, 0x26, 0x27, 0x28, 0x29, 0x2a, 0x34,
        0x35, 0x36, 0x37, 0x38, 0x39, 0x3a, 0x43, 0x44, 0x45, 0x46, 0x47, 0x48, 0x49, 0x4a, 0x53, 0x54, 0x55,
        0x56, 0x57, 0x58, 0x59, 0x5a, 0x63, 0x64, 0x65, 0x66, 0x67, 0x68, 0x69, 0x6a, 0x73, 0x74, 0x75, 0x76,
        0x77, 0x78, 0x79, 0x7a, 0x83, 0x84, 0x85, 0x86, 0x87, 0x88, 0x89, 0x8a, 0x92, 0x93, 0x94, 0x95, 0x96,
        0x97, 0x98, 0x99, 0x9a, 0xa2, 0xa3, 0xa4, 0xa5, 0xa6, 0xa7, 0xa8, 0xa9, 0xaa, 0xb2, 0xb3, 0xb4, 0xb5,
        0xb6, 0xb7, 0xb8, 0xb9, 0xba, 0xc2, 0xc3, 0xc4, 0xc5, 0xc6, 0xc7, 0xc8, 0xc9, 0xca, 0xd2, 0xd3, 0xd4,
        0xd5, 0xd6, 0xd7, 0xd8, 0xd9, 0xda, 0xe1, 0xe2, 0xe3, 0xe4, 0xe5, 0xe6, 0xe7, 0xe8, 0xe9, 0xea, 0xf1,
        0xf2, 0xf3, 0xf4, 0xf5, 0xf6, 0xf7, 0xf8, 0xf9, 0xfa,
    ],
    [
        0x00, 0x01, 0x02, 0x03, 0x11, 0x04, 0x05, 0x21, 0x31, 0x06, 0x12, 0x41, 0x51, 0x07, 0x61, 0x71, 0x13,
        0x22, 0x32, 0x81, 0x08, 0x14, 0x42, 0x91, 0xa1, 0xb1, 0xc1, 0x09, 0x23, 0x33, 0x52, 0xf0, 0x15, 0x62,
        0x72, 0xd1, 0x0a, 0x16, 0x24, 0x34, 0xe1, 0x25, 0xf1, 0x17, 0x18, 0x19, 0x1a, 0x26, 0x27, 0x28, 0x29,
        0x2a, 0x35, 0x36, 0x37, 0x38, 0x39, 0x3a, 0x43, 0x44, 0x45, 0x46, 0x47, 0x48, 0x49, 0x4a, 0x53, 0x54,
        0x55, 0x56, 0x57, 0x58, 0x59, 0x5a, 0x63, 0x64, 0x65, 0x66, 0x67, 0x68, 0x69, 0x6a, 0x73, 0x74, 0x75,
        0x76, 0x77, 0x78, 0x79, 0x7a, 0x82, 0x83, 0x84, 0x85, 0x86, 0x87, 0x88, 0x89, 0x8a, 0x92, 0x93, 0x94,
        0x95, 0x96, 0x97, 0x98, 0x99, 0x9a, 0xa2, 0xa3, 0xa4, 0xa5, 0xa6, 0xa7, 0xa8, 0xa9, 0xaa, 0xb2, 0xb3,
        0xb4, 0xb5, 0xb6, 0xb7, 0xb8, 0xb9, 0xba, 0xc2, 0xc3, 0xc4, 0xc5, 0xc6, 0xc7, 0xc8, 0xc9, 0xca, 0xd2,
        0xd3, 0xd4, 0xd5, 0xd6, 0xd7, 0xd8, 0xd9, 0xda, 0xe2, 0xe3, 0xe4, 0xe5, 0xe6, 0xe7, 0xe8, 0xe9, 0xea,
        0xf2, 0xf3, 0xf4, 0xf5, 0xf6, 0xf7, 0xf8, 0xf9, 0xfa,
    ],
];
