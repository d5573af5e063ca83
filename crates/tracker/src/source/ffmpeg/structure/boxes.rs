//! Walks MP4 and QuickTime: boxes that fill the file, and in a fragmented film fragments that are numbered (ISO/IEC 14496-12).

use std::collections::VecDeque;
use std::ops::Range;

use super::bytes::Bytes;
use super::{Fit, Walk};

/// Boxes of a fragmented film's fragment: its header, what it holds.
const FRAGMENT: [u8; 4] = *b"moof";
const BODY: [u8; 4] = *b"mdat";
/// Boxes that may follow the last fragment and hold no pictures.
const NO_PICTURES: [[u8; 4]; 6] = [*b"mfra", *b"free", *b"skip", *b"udta", *b"meta", *b"uuid"];

/// The boxes of a file, and where they stop to fit together, found before the first packet: there are few.
#[derive(Debug, Default)]
pub(super) struct Boxes {
    /// Places where the chain of boxes or of fragments is broken, rising, and how.
    breaks: Vec<(u64, Fit)>,
    next: usize,
    /// Bytes of the fragments' contents, where there is one stream only: the reader gives packets of each, or it passed over it.
    bodies: VecDeque<Range<u64>>,
    /// The reader gave a packet of one of the first of `bodies`.
    is_given: bool,
    /// The chain of a fragmented film ends in a box that may hold pictures, and does not end with the file: of fragments
    /// nothing tells how many there are.
    lacks_fragments: bool,
}

impl Boxes {
    /// `is_alone` is whether the file holds one stream only.
    pub(super) fn new(file: &mut Bytes, is_alone: bool) -> Self {
        let mut boxes = Self::default();
        let (mut at, mut number) = (0, None);
        let (mut follows_header, mut is_fragmented) = (false, false);
        while at < file.length() {
            let Some((end, kind)) = header(file, at) else {
                let holds_none = |kind| NO_PICTURES.contains(&kind);
                boxes.lacks_fragments = is_fragmented && !file.array(at + 4).is_some_and(holds_none);
                if !is_fragmented || boxes.lacks_fragments {
                    boxes.breaks.push((at, Fit::Broken));
                }
                break;
            };
            if kind == FRAGMENT {
                let this = fragment_number(file, at);
                if this.is_none() || number.is_some_and(|n: u32| this != Some(n.wrapping_add(1))) {
                    boxes.breaks.push((at, Fit::Jump));
                }
                number = this;
            }
            if kind == BODY && follows_header && is_alone {
                boxes.bodies.push_back(at..end);
            }
            follows_header = kind == FRAGMENT;
            is_fragmented |= follows_header;
            at = end;
        }
        boxes
    }
}

/// One past a box and its four letters; `None` if there is none or it ends past the file.
fn header(file: &mut Bytes, at: u64) -> Option<(u64, [u8; 4])> {
    let kind: [u8; 4] = file.array(at + 4)?;
    let size = match file.u32(at)? {
        0 => file.length() - at,
        1 => u64::from_be_bytes(file.array(at + 8)?),
        n => u64::from(n),
    };
    let end = at.checked_add(size)?;
    let is_name = kind.iter().all(|b| b.is_ascii_graphic() || *b == b' ' || *b == 0xA9);
    (size >= 8 && end <= file.length() && is_name).then_some((end, kind))
}

/// The number in a fragment's own header, which is the first box in it.
fn fragment_number(file: &mut Bytes, at: u64) -> Option<u32> {
    let (_, kind) = header(file, at + 8)?;
    (kind == *b"mfhd").then(|| file.u32(at + 20)).flatten()
}

impl Walk for Boxes {
    fn reach(&mut self, _: &mut Bytes, to: u64) -> Fit {
        let mut worst = Fit::Whole;
        while let Some((_, fit)) = self.breaks.get(self.next).filter(|(at, _)| *at <= to) {
            worst = worst.max(*fit);
            self.next += 1;
        }
        while self.bodies.front().is_some_and(|body| body.end <= to) {
            self.bodies.pop_front();
            if !std::mem::take(&mut self.is_given) {
                worst = worst.max(Fit::Jump);
            }
        }
        self.is_given |= self.bodies.front().is_some_and(|body| body.contains(&to));
        worst
    }

    fn rest(&mut self, file: &mut Bytes) -> Fit {
        self.reach(file, u64::MAX)
    }

    fn ends_in_pictures(&self) -> bool {
        self.lacks_fragments
    }
}
