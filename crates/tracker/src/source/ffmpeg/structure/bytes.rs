//! Reads numbers at places of a file through a buffer.

use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};

/// A file and the place that its buffer stands at.
pub(super) struct Bytes {
    file: BufReader<File>,
    at: u64,
    length: u64,
}

impl Bytes {
    pub(super) fn new(file: File) -> Option<Self> {
        let length = file.metadata().ok()?.len();
        Some(Self { file: BufReader::with_capacity(1 << 14, file), at: 0, length })
    }

    /// Bytes in the file.
    pub(super) fn length(&self) -> u64 {
        self.length
    }

    /// `N` bytes at `place`; `None` where the file does not hold them.
    pub(super) fn array<const N: usize>(&mut self, place: u64) -> Option<[u8; N]> {
        let mut bytes = [0; N];
        self.fill(place, &mut bytes)?;
        Some(bytes)
    }

    /// Fills `bytes` from `place` on; `None` where the file does not hold so many.
    pub(super) fn fill(&mut self, place: u64, bytes: &mut [u8]) -> Option<()> {
        if place.checked_add(bytes.len() as u64)? > self.length {
            return None;
        }
        let step = i64::try_from(i128::from(place) - i128::from(self.at)).ok()?;
        // What is near is still in the buffer.
        if self.file.seek_relative(step).is_err() {
            self.file.seek(SeekFrom::Start(place)).ok()?;
        }
        self.at = place;
        self.file.read_exact(bytes).ok()?;
        self.at += bytes.len() as u64;
        Some(())
    }

    /// A big-endian number of four bytes.
    pub(super) fn u32(&mut self, place: u64) -> Option<u32> {
        self.array(place).map(u32::from_be_bytes)
    }
}
