//! Walks MXF: a key of 16 bytes, a length and what it says, one after the other (SMPTE ST 377-1, 6.3). A recording lies in
//! one of them whole, or has one for each picture.

use super::bytes::Bytes;
use super::{Fit, Walk};

/// First bytes of every key.
const KEY: [u8; 4] = [0x06, 0x0E, 0x2B, 0x34];
/// Bytes of a key.
const KEY_LENGTH: u64 = 16;
/// Most bytes of something else before the first key (6.5).
const MOST_RUN_IN: u64 = 65_536;

/// State of the walk through MXF.
#[derive(Debug)]
pub(super) struct Mxf {
    at: u64,
    /// The place of the first packet's element: later packets that lie in it are of a recording that is whole in it.
    first: Option<u64>,
}

impl Mxf {
    /// `None` without a key where the first one has to be.
    pub(super) fn new(file: &mut Bytes) -> Option<Self> {
        let at = (0..MOST_RUN_IN).find(|at| file.array(*at) == Some(KEY))?;
        Some(Self { at, first: None })
    }

    /// The end of the element at which the walk stands; `None` where there is none that is whole.
    fn end(&self, file: &mut Bytes) -> Option<u64> {
        if file.array(self.at)? != KEY {
            return None;
        }
        let at = self.at.checked_add(KEY_LENGTH)?;
        let [first] = file.array(at)?;
        // Above 127 it is the number of bytes that the length has (ISO/IEC 8825-1, 8.1.3).
        let size = if first > 0x7F { u64::from(first & 0x7F) } else { 0 };
        let mut length = if size == 0 { u64::from(first) } else { 0 };
        for place in 0..size {
            let [byte] = file.array(at + 1 + place)?;
            length = length.checked_mul(256)? + u64::from(byte);
        }
        (at + 1 + size).checked_add(length)
    }
}

impl Walk for Mxf {
    fn reach(&mut self, file: &mut Bytes, to: u64) -> Fit {
        while self.at < to {
            match self.end(file) {
                Some(end) if end <= to => self.at = end,
                Some(_) if self.first.is_none_or(|first| first == self.at) => {
                    self.first = Some(self.at);
                    return Fit::Whole;
                }
                _ => break,
            }
        }
        self.first.get_or_insert(to);
        let is_whole = self.at == to;
        self.at = to;
        if is_whole { Fit::Whole } else { Fit::Broken }
    }

    fn rest(&mut self, file: &mut Bytes) -> Fit {
        while self.at < file.length() {
            match self.end(file) {
                Some(end) if end <= file.length() => self.at = end,
                _ => return Fit::Broken,
            }
        }
        Fit::Whole
    }
}
