//! Sums the bytes of a table's rows: the pages of a Parquet file carry none of their own in what we write.
//!
//! Owns: [`Summed`], [`RowSum`], its key in the metadata. Must not: know of rows.

use std::fs::File;
use std::io::{self, Read, Write};

use crc32fast::Hasher;

/// Key of the sum in a file's metadata.
pub(super) const SUM_KEY: &str = "pydpend.row_bytes_crc32";
/// Bytes that are read at once.
const CHUNK: usize = 1 << 20;

/// The CRC-32 of the first `length` bytes of a file, which hold its rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct RowSum {
    length: u64,
    crc: u32,
}

impl RowSum {
    /// The sum of the first `length` bytes of what is read; of all of them if there are fewer.
    fn of(file: impl Read, length: u64) -> io::Result<Self> {
        let (mut hasher, mut rest) = (Hasher::new(), file.take(length));
        let mut bytes = vec![0; CHUNK];
        let mut total = 0;
        loop {
            let count = rest.read(&mut bytes)?;
            if count == 0 {
                return Ok(Self { length: total, crc: hasher.finalize() });
            }
            hasher.update(&bytes[..count]);
            total += count as u64;
        }
    }

    /// Whether a file's first bytes have this sum.
    ///
    /// # Errors
    /// Those of reading.
    pub(super) fn holds(self, file: impl Read) -> io::Result<bool> {
        Ok(Self::of(file, self.length)? == self)
    }

    /// The sum as text: length in bytes and eight hexadecimal digits.
    pub(super) fn to_text(self) -> String {
        format!("{} {:08x}", self.length, self.crc)
    }

    /// The sum of a text; `None` where it is none.
    pub(super) fn from_text(text: &str) -> Option<Self> {
        let (length, crc) = text.split_once(' ')?;
        Some(Self { length: length.parse().ok()?, crc: u32::from_str_radix(crc, 16).ok()? })
    }
}

/// A file that is written, and the sum of its bytes so far.
#[derive(Debug)]
pub(super) struct Summed {
    file: File,
    hasher: Hasher,
    length: u64,
}

impl Summed {
    pub(super) fn new(file: File) -> Self {
        Self { file, hasher: Hasher::new(), length: 0 }
    }

    /// The sum of the bytes written so far.
    pub(super) fn sum(&self) -> RowSum {
        RowSum { length: self.length, crc: self.hasher.clone().finalize() }
    }
}

impl Write for Summed {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let count = self.file.write(bytes)?;
        self.hasher.update(&bytes[..count]);
        self.length += count as u64;
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_flipped_bit_is_noticed_and_a_text_gives_the_sum_again() {
        let mut bytes: Vec<u8> = (0..=255).cycle().take(5000).collect();
        let sum = RowSum::of(&bytes[..], 4000).unwrap();
        assert_eq!(RowSum::from_text(&sum.to_text()), Some(sum));
        assert!(sum.holds(&bytes[..]).unwrap());
        for bit in (0..8 * 4000).step_by(731) {
            bytes[bit / 8] ^= 1 << (bit % 8);
            assert!(!sum.holds(&bytes[..]).unwrap(), "bit {bit}");
            bytes[bit / 8] ^= 1 << (bit % 8);
        }
        bytes[4000] ^= 1;
        assert!(sum.holds(&bytes[..]).unwrap(), "behind the rows");
        assert!(!sum.holds(&bytes[..3999]).unwrap(), "cut");
        assert_eq!(RowSum::from_text("12 xyz"), None);
    }
}
