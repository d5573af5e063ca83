//! Reads the slots of an AVI file from its index: which of them a packet is, and which are empty.
//!
//! Owns: [`Slots`]. In AVI a frame's time is its slot, and a demuxer that passes over damage counts on without it, so
//! all later frames would come too early. The index (`idx1`) tells the place of each.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};

/// Most bytes of an index that are read: 4 million slots.
const MOST_BYTES: u64 = 64 << 20;

/// A slot: where its chunk begins, and the bytes of its frame.
#[derive(Debug, Clone, Copy)]
struct Slot {
    at: u64,
    size: u32,
}

/// The slots of one stream.
#[derive(Debug)]
pub(super) struct Slots {
    slots: Vec<Slot>,
    /// Bytes put into the file before its index (cut out of it if below 0) since the index was written.
    moved: i64,
    next: usize,
    /// Whether the last packet lay where the index says, and not as far away as the index itself.
    in_place: bool,
}

/// Slot of a packet by the index.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Found {
    /// Its slot.
    pub slot: u64,
    /// Slots before it, after the last packet's, that hold a frame which did not come.
    pub lost: Vec<u64>,
    /// Whether bytes are missing or too many since the last packet, or are not those that the index tells.
    pub is_broken: bool,
}

fn fourcc(bytes: &[u8], at: usize) -> Option<[u8; 4]> {
    bytes.get(at..at.checked_add(4)?)?.try_into().ok()
}

fn number(bytes: &[u8], at: usize) -> Option<u32> {
    fourcc(bytes, at).map(u32::from_le_bytes)
}

fn read(file: &mut File, at: u64, length: u64) -> Option<Vec<u8>> {
    file.seek(SeekFrom::Start(at)).ok()?;
    let mut bytes = Vec::new();
    file.take(length).read_to_end(&mut bytes).ok()?;
    Some(bytes)
}

impl Slots {
    /// The slots of the stream numbered `stream`; `None` if the file has no index that fits its chunks.
    pub(super) fn read(path: &str, stream: usize) -> Option<Self> {
        let mut file = File::open(path).ok()?;
        let length = file.metadata().ok()?.len();
        let head = read(&mut file, 0, 12)?;
        if fourcc(&head, 0) != Some(*b"RIFF") || fourcc(&head, 8) != Some(*b"AVI ") {
            return None;
        }
        let mut at = 12u64;
        let (list, expected) = loop {
            let head = read(&mut file, at, 12)?;
            let size = u64::from(number(&head, 4)?);
            let end = at + 8 + size + size % 2;
            if fourcc(&head, 0)? == *b"LIST" && fourcc(&head, 8)? == *b"movi" {
                break (at + 8, end);
            }
            at = end;
        };
        let place = Self::index_at(&mut file, expected).or_else(|| Self::index_in_tail(&mut file, length))?;
        let size = number(&read(&mut file, place, 8)?, 4)?;
        let index = read(&mut file, place + 8, u64::from(size).min(MOST_BYTES))?;
        let id = format!("{stream:02}");
        let entries = index.chunks_exact(16).filter(|e| e.starts_with(id.as_bytes()) && &e[2..4] != b"wb");
        let mut slots: Vec<Slot> = entries
            .filter_map(|e| Some(Slot { at: u64::from(number(e, 8)?), size: number(e, 12)? }))
            .collect();
        // Offsets count from the list's name, or from the file's beginning.
        let first = slots.iter().find(|s| s.size > 0)?.at;
        let starts_there = |file: &mut File, at: u64| read(file, at, 2).is_some_and(|b| b == id.as_bytes());
        let base = [list, 0].into_iter().find(|base| starts_there(&mut file, base + first))?;
        slots.iter_mut().for_each(|s| s.at += base);
        let moved = i64::try_from(i128::from(place) - i128::from(expected)).ok()?;
        Some(Self { slots, moved, next: 0, in_place: true })
    }

    /// Number of empty slots.
    pub(super) fn empty(&self) -> u64 {
        self.slots.iter().filter(|s| s.size == 0).count() as u64
    }

    fn index_at(file: &mut File, at: u64) -> Option<u64> {
        (fourcc(&read(file, at, 4)?, 0)? == *b"idx1").then_some(at)
    }

    /// The last index in the file that is whole.
    fn index_in_tail(file: &mut File, length: u64) -> Option<u64> {
        let from = length.saturating_sub(MOST_BYTES);
        let tail = read(file, from, MOST_BYTES)?;
        let whole = |at: &usize| {
            number(&tail, at + 4)
                .is_some_and(|n| n % 16 == 0 && *at as u64 + 8 + u64::from(n) <= tail.len() as u64)
        };
        let at = (0..tail.len().saturating_sub(8)).rev().filter(|at| tail[*at..].starts_with(b"idx1"));
        at.into_iter().find(whole).map(|at| from + at as u64)
    }

    /// The slot whose chunk begins at `at`.
    fn slot_at(&self, at: u64) -> Option<usize> {
        let k = self.slots.partition_point(|s| s.at < at);
        // Empty slots may share the place of the next.
        (k..self.slots.len()).take_while(|k| self.slots[*k].at == at).find(|k| self.slots[*k].size > 0)
    }

    /// The slot of the next packet, whose first byte is at `data` and which has `size` bytes.
    pub(super) fn find(&mut self, data: u64, size: usize) -> Found {
        let chunk = data.saturating_sub(8);
        let here = self.slot_at(chunk).filter(|k| *k >= self.next).map(|k| (k, true));
        let there = chunk.checked_add_signed(-self.moved);
        let moved = there.and_then(|at| self.slot_at(at)).filter(|k| *k >= self.next).map(|k| (k, false));
        // Damage moves what comes after it: once a packet was found moved, so are all others.
        let found = if self.in_place { here.or(moved) } else { moved };
        let Some((slot, in_place)) = found else {
            self.next += 1;
            return Found { slot: self.next as u64 - 1, lost: Vec::new(), is_broken: false };
        };
        let lost: Vec<u64> =
            (self.next..slot).filter(|k| self.slots[*k].size > 0).map(|k| k as u64).collect();
        let is_broken = !lost.is_empty()
            || self.in_place != in_place
            || usize::try_from(self.slots[slot].size) != Ok(size);
        self.in_place = in_place;
        self.next = slot + 1;
        Found { slot: slot as u64, lost, is_broken }
    }
}
