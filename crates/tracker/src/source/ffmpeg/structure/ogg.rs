//! Reads Ogg's pages: pages with a mark, the number of their stream, a number of their own and a checksum (RFC 3533, section 6).

use std::collections::BTreeMap;

use super::Fit;
use super::bytes::Bytes;
use super::pages::Pages;

const MARK: [u8; 4] = *b"OggS";
/// Bytes of a page's header before the table of lengths.
const HEADER: usize = 27;
/// Place of the checksum in the header, bytes.
const CHECKSUM: usize = 22;

/// The last page's number in each stream.
#[derive(Debug, Default)]
pub(super) struct Ogg {
    numbers: BTreeMap<[u8; 4], u32>,
}

/// The checksum's polynomial is x^32 + 0x04c1_1db7, the highest bit first.
const TABLE: [u32; 256] = {
    let mut table = [0; 256];
    let mut i = 0;
    while i < 256 {
        let mut value = (i as u32) << 24;
        let mut bit = 0;
        while bit < 8 {
            value = (value << 1) ^ if value >> 31 == 1 { 0x04c1_1db7 } else { 0 };
            bit += 1;
        }
        table[i] = value;
        i += 1;
    }
    table
};

fn checksum(bytes: &[u8]) -> u32 {
    bytes.iter().fold(0, |sum, b| (sum << 8) ^ TABLE[((sum >> 24) as u8 ^ b) as usize])
}

impl Pages for Ogg {
    fn page(&mut self, file: &mut Bytes, at: u64) -> Option<(u64, Fit)> {
        let head: [u8; HEADER] = file.array(at)?;
        if !head.starts_with(&MARK) {
            return None;
        }
        let mut lengths = vec![0; usize::from(head[26])];
        file.fill(at + HEADER as u64, &mut lengths)?;
        let data: usize = lengths.iter().map(|l| usize::from(*l)).sum();
        let mut page = vec![0; HEADER + lengths.len() + data];
        file.fill(at, &mut page)?;
        page[CHECKSUM..CHECKSUM + 4].fill(0);
        let word = |at: usize| [head[at], head[at + 1], head[at + 2], head[at + 3]];
        let number = u32::from_le_bytes(word(18));
        if checksum(&page) != u32::from_le_bytes(word(CHECKSUM)) {
            return Some((at + page.len() as u64, Fit::Broken));
        }
        let last = self.numbers.insert(word(14), number);
        let follows = last.is_none_or(|last| number == last.wrapping_add(1));
        Some((at + page.len() as u64, if follows { Fit::Whole } else { Fit::Jump }))
    }

    fn find(&mut self, file: &mut Bytes, at: u64) -> u64 {
        (at + 1..file.length()).find(|at| file.array(*at) == Some(MARK)).unwrap_or(file.length())
    }
}
