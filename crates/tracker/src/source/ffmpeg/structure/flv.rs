//! Walks FLV: tags one after the other, each with a kind, a length and behind it the length again (Adobe's Flash Video File
//! Format 10.1, annex E).

use super::bytes::Bytes;
use super::walk::Elements;

/// Bytes of a tag's header.
const HEADER: u64 = 11;
/// Sound, picture, script.
const KINDS: [u8; 3] = [8, 9, 18];

/// State of the walk through FLV.
#[derive(Debug)]
pub(super) struct Flv {
    at: u64,
    /// Whether the lengths behind tags are right; `None` before the first. Some writers leave them out.
    has_lengths: Option<bool>,
}

impl Flv {
    /// `None` if the file begins as no FLV does.
    pub(super) fn new(file: &mut Bytes) -> Option<Self> {
        let head: [u8; 9] = file.array(0)?;
        let first = u64::from(u32::from_be_bytes([head[5], head[6], head[7], head[8]])) + 4;
        head.starts_with(b"FLV").then_some(Self { at: first, has_lengths: None })
    }
}

impl Elements for Flv {
    fn at(&mut self) -> &mut u64 {
        &mut self.at
    }

    fn step(&mut self, file: &mut Bytes) -> Option<()> {
        let head: [u8; HEADER as usize] = file.array(self.at)?;
        // The bit above the kind is that of encryption.
        if !KINDS.contains(&(head[0] & 0xDF)) {
            return None;
        }
        let length = HEADER + u64::from(u32::from_be_bytes([0, head[1], head[2], head[3]]));
        let end = self.at + length;
        let behind = file.u32(end);
        // The last tag may lack it.
        if behind.is_none() && end != file.length() {
            return None;
        }
        let is_right = behind.is_none_or(|told| u64::from(told) == length);
        if *self.has_lengths.get_or_insert(is_right) && !is_right {
            return None;
        }
        self.at = end + 4;
        Some(())
    }
}
