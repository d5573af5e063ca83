//! Walks ASF (WMV): packets of one length that hold parts of numbered objects, a picture each (Advanced Systems Format
//! specification 01.20.05, sections 3 and 5).

use super::Fit;
use super::bytes::Bytes;
use super::pages::{Paged, Pages};

/// Identities as they lie in a file.
const HEADER: [u8; 16] = *b"\x30\x26\xb2\x75\x8e\x66\xcf\x11\xa6\xd9\x00\xaa\x00\x62\xce\x6c";
const DATA: [u8; 16] = *b"\x36\x26\xb2\x75\x8e\x66\xcf\x11\xa6\xd9\x00\xaa\x00\x62\xce\x6c";
const PROPERTIES: [u8; 16] = *b"\xa1\xdc\xab\x8c\x47\xa9\xcf\x11\x8e\xe4\x00\xc0\x0c\x20\x53\x65";
/// Bytes of the header object and of the data object before what they hold.
const IN_HEADER: u64 = 30;
const IN_DATA: u64 = 50;
/// Place of the length of a packet in the properties, bytes.
const PACKET_LENGTH: u64 = 92;
/// First bytes of most packets: two bytes of error correction follow, which are 0.
const BEGIN: [u8; 3] = [0x82, 0, 0];

/// Parts of an object that have come.
#[derive(Debug, Clone, Copy)]
struct Object {
    number: u32,
    next: u32,
    size: u32,
}

/// The packets of a file.
#[derive(Debug)]
pub(super) struct Asf {
    length: u64,
    end: u64,
    stream: u8,
    object: Option<Object>,
}

fn word(file: &mut Bytes, at: u64) -> Option<u64> {
    file.array(at).map(u64::from_le_bytes)
}

impl Asf {
    /// The walk through the file's packets, of which the stream's own objects are heeded.
    pub(super) fn walk(file: &mut Bytes, stream: i32) -> Option<Paged<Self>> {
        let stream = u8::try_from(stream).ok()?;
        if file.array(0)? != HEADER {
            return None;
        }
        let header_end = word(file, 16)?;
        let mut at = IN_HEADER;
        let mut length = None;
        while at < header_end {
            if file.array(at)? == PROPERTIES {
                length = file.array(at + PACKET_LENGTH).map(u32::from_le_bytes);
            }
            at = at.checked_add(word(file, at + 16)?.max(24))?;
        }
        let length = u64::from(length.filter(|l| *l > 0)?);
        if file.array(header_end)? != DATA {
            return None;
        }
        let begin = header_end + IN_DATA;
        let count = word(file, header_end + 40)?;
        // A file that was not finished does not say how many packets it has.
        let told = count.checked_mul(length).filter(|n| *n > 0).and_then(|n| begin.checked_add(n));
        let end = told.unwrap_or(file.length());
        Some(Paged::new(Self { length, end, stream, object: None }, begin))
    }

    /// A part of an object of the stream. How it follows the part before.
    fn part(&mut self, number: u32, offset: u32, size: u32, length: u32, wrap: u32) -> Fit {
        let before = self.object.replace(Object { number, next: offset.saturating_add(length), size });
        let Some(before) = before else { return Fit::Whole };
        let is_whole = before.next == before.size;
        if before.number == number && !is_whole {
            return if before.next == offset && before.size == size { Fit::Whole } else { Fit::Broken };
        }
        let follows = number == before.number.wrapping_add(1) & wrap;
        match (is_whole && offset == 0, follows) {
            (true, true) => Fit::Whole,
            (true, false) => Fit::Jump,
            (false, _) => Fit::Broken,
        }
    }

    /// Goes over the parts in a packet; `None` if it is none.
    fn parts(&mut self, bytes: &[u8]) -> Option<Fit> {
        let mut at = Cursor { bytes, at: 0 };
        let mut flags = at.number(1)?;
        if flags & 0x80 != 0 {
            at.skip(flags & 0x0F)?;
            flags = at.number(1)?;
        }
        let types = at.number(1)?;
        at.number(flags >> 5 & 3)?;
        at.number(flags >> 1 & 3)?;
        let padding = at.number(flags >> 3 & 3)?;
        // Time and duration.
        at.skip(6)?;
        let is_many = flags & 1 != 0;
        let (count, length_type) = if is_many {
            let count = at.number(1)?;
            (count & 0x3F, count >> 6 & 3)
        } else {
            (1, 0)
        };
        let mut fit = Fit::Whole;
        for _ in 0..count {
            let stream = at.number(1)? & 0x7F;
            if stream == 0 {
                return None;
            }
            let number = at.number(types >> 4 & 3)?;
            let offset = at.number(types >> 2 & 3)?;
            let more = at.number(types & 3)?;
            let size = if more >= 8 { Some(u32::from_le_bytes(*at.rest().first_chunk()?)) } else { None };
            at.skip(more)?;
            let rest = u32::try_from(at.rest().len()).ok()?.checked_sub(padding)?;
            let length = if is_many { at.number(length_type)? } else { rest };
            at.skip(length)?;
            let wrap = [0, 0xFF, 0xFFFF, u32::MAX][(types >> 4 & 3) as usize];
            if let Some(size) = size.filter(|_| stream == u32::from(self.stream)) {
                fit = fit.max(self.part(number, offset, size, length, wrap));
            }
        }
        (!is_many || at.rest().len() == usize::try_from(padding).ok()?).then_some(fit)
    }
}

impl Pages for Asf {
    fn page(&mut self, file: &mut Bytes, at: u64) -> Option<(u64, Fit)> {
        let end = at.checked_add(self.length).filter(|end| *end <= file.length())?;
        let mut bytes = vec![0; usize::try_from(self.length).ok()?];
        file.fill(at, &mut bytes)?;
        let fit = self.parts(&bytes);
        if fit.is_none() {
            self.object = None;
        }
        Some((end, fit?))
    }

    fn find(&mut self, file: &mut Bytes, at: u64) -> u64 {
        let begins = |file: &mut Bytes, at: u64| file.array(at) == Some(BEGIN);
        let end = self.end.min(file.length());
        (at + 1..end)
            .find(|&at| begins(file, at) && (at + self.length >= end || begins(file, at + self.length)))
            .unwrap_or(self.end)
    }

    fn is_whole(&self) -> bool {
        self.object.is_none_or(|o| o.next == o.size)
    }

    fn end(&self, _: &Bytes) -> u64 {
        self.end
    }
}

/// Numbers of a packet in their order.
struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Cursor<'a> {
    fn rest(&self) -> &'a [u8] {
        self.bytes.get(self.at..).unwrap_or_default()
    }

    fn skip(&mut self, count: u32) -> Option<()> {
        self.at = self.at.checked_add(usize::try_from(count).ok()?).filter(|at| *at <= self.bytes.len())?;
        Some(())
    }

    /// A number of no, one, two or four bytes, by its type.
    fn number(&mut self, kind: u32) -> Option<u32> {
        let count = [0, 1, 2, 4][(kind & 3) as usize];
        let bytes = self.rest().get(..count)?;
        self.at += count;
        Some(bytes.iter().rev().fold(0, |sum, b| sum << 8 | u32::from(*b)))
    }
}
