//! Walks Matroska and WebM: elements of an identity, a length and what they hold, nested three deep (RFC 8794, RFC 9559).

use super::bytes::Bytes;
use super::{Fit, Walk};

const EBML: u32 = 0x1A45_DFA3;
const SEGMENT: u32 = 0x1853_8067;
const CLUSTER: u32 = 0x1F43_B675;
const VOID: u32 = 0xEC;
const CHECKSUM: u32 = 0xBF;
/// Identities of the elements that a segment holds beside clusters: index of places, facts, tracks, index of times, files, chapters, tags.
const IN_SEGMENT: [u32; 7] =
    [0x114D_9B74, 0x1549_A966, 0x1654_AE6B, 0x1C53_BB6B, 0x1941_A469, 0x1043_A770, 0x1254_C367];
/// Identities of the elements that a cluster holds: time, silent tracks, place, length of the one before, blocks alone, in groups, encrypted.
const IN_CLUSTER: [u32; 7] = [0xE7, 0x5854, 0xA7, 0xAB, 0xA3, 0xA0, 0xAF];
/// Identities of a cluster's elements that are a number, of eight bytes at most.
const NUMBERS: [u32; 3] = [0xE7, 0xA7, 0xAB];
const LONGEST_NUMBER: u64 = 8;
/// Elements of a block group, met where the group's own header was lost: block, length, references, padding, additions.
const IN_GROUP: [u32; 6] = [0xA1, 0x9B, 0xFB, 0xFA, 0x75A2, 0x75A1];
const TRACKS: u32 = 0x1654_AE6B;
const TRACK: u32 = 0xAE;
const TRACK_NUMBER: u32 = 0xD7;
const GROUP: u32 = 0xA0;
/// Blocks, alone or in a group.
const BLOCKS: [u32; 2] = [0xA3, 0xA1];

/// State of the walk through Matroska.
#[derive(Debug, Default)]
pub(super) struct Matroska {
    at: u64,
    in_segment: bool,
    /// In a cluster, and where that ends if it is known.
    cluster: Option<Option<u64>>,
    segment_end: Option<u64>,
    /// Numbers of the tracks.
    tracks: Vec<u64>,
    /// The number of the reader's track, once a block of it was met.
    own: Option<u64>,
    /// A block was passed that the reader should have given out, or that is of no track.
    passed: bool,
    /// The walk lost its way and waits for a block to go on from.
    adrift: bool,
    /// The last cluster, or the last block in it, ends past the file.
    ends_in_pictures: bool,
}

/// An element's header.
struct Element {
    id: u32,
    begin: u64,
    /// `None` for one that ends where the next begins.
    end: Option<u64>,
}

fn element(file: &mut Bytes, at: u64) -> Option<Element> {
    let [first] = file.array(at)?;
    let id_bytes = first.leading_zeros() as u64 + 1;
    if id_bytes > 4 {
        return None;
    }
    let mut id = 0u32;
    for i in 0..id_bytes {
        let [byte] = file.array(at + i)?;
        id = id << 8 | u32::from(byte);
    }
    let (size, size_bytes) = variable(file, at + id_bytes)?;
    let begin = at + id_bytes + size_bytes;
    let unknown = size == (1 << (7 * size_bytes)) - 1;
    let end = if unknown { None } else { Some(begin.checked_add(size)?) };
    Some(Element { id, begin, end })
}

/// A number of one to eight bytes, the first of which says how many, and how many those are.
fn variable(file: &mut Bytes, at: u64) -> Option<(u64, u64)> {
    let [first] = file.array(at)?;
    let length = first.leading_zeros() as u64 + 1;
    if length > 8 {
        return None;
    }
    let mut value = u64::from(first) & ((1 << (8 - length)) - 1);
    for i in 1..length {
        let [byte] = file.array(at + i)?;
        value = value << 8 | u64::from(byte);
    }
    Some((value, length))
}

/// The numbers of the tracks told between `at` and `end`.
fn tracks(file: &mut Bytes, mut at: u64, end: u64) -> Vec<u64> {
    let mut numbers = Vec::new();
    while at < end {
        let Some(e) = element(file, at) else { break };
        let Some(next) = e.end else { break };
        match e.id {
            // Into it: its number is among what it holds.
            TRACK => at = e.begin,
            TRACK_NUMBER => {
                let mut number = 0;
                for i in e.begin..next.min(e.begin + 8) {
                    let Some([byte]) = file.array(i) else { break };
                    number = number << 8 | u64::from(byte);
                }
                numbers.push(number);
                at = next;
            }
            _ => at = next,
        }
    }
    numbers
}

impl Matroska {
    /// Goes over one element or into it. `None` if it does not fit; else whether it holds `to` and is no master.
    fn step(&mut self, file: &mut Bytes, to: u64) -> Option<bool> {
        if let Some(Some(end)) = self.cluster
            && self.at >= end
        {
            if self.at > end {
                return None;
            }
            self.cluster = None;
        }
        let element = element(file, self.at)?;
        let outer = match (self.cluster, self.in_segment) {
            (Some(Some(end)), _) => Some(end),
            (_, true) => self.segment_end,
            _ => None,
        };
        let fits = |end: u64| end <= file.length() && outer.is_none_or(|outer| end <= outer);
        let id = element.id;
        let anywhere = id == VOID || id == CHECKSUM;
        let in_cluster = IN_CLUSTER.contains(&id) || anywhere;
        if let Some(known) = self.cluster {
            if in_cluster || known.is_none() && IN_GROUP.contains(&id) {
                let end = element.end.filter(|e| fits(*e))?;
                if NUMBERS.contains(&id) && end - element.begin > LONGEST_NUMBER {
                    return None;
                }
                self.at = end;
                let is_packet = (element.begin..end).contains(&to);
                self.block(file, &element, end, is_packet);
                return Some(is_packet);
            }
            if known.is_some() {
                return None;
            }
            // One of unknown length ends where something that it cannot hold begins.
            self.cluster = None;
        }
        if !self.in_segment {
            return match id {
                SEGMENT => {
                    self.in_segment = true;
                    self.segment_end = element.end;
                    self.at = element.begin;
                    Some(false)
                }
                EBML | VOID => {
                    self.at = element.end.filter(|e| fits(*e))?;
                    Some(false)
                }
                _ => None,
            };
        }
        if id == CLUSTER {
            // Its own end may lie past a file that is cut: what it holds says where.
            if let Some(end) = element.end
                && outer.is_some_and(|outer| end > outer)
            {
                return None;
            }
            self.cluster = Some(element.end);
            self.at = element.begin;
            return Some(false);
        }
        if anywhere || IN_SEGMENT.contains(&id) {
            self.at = element.end.filter(|e| fits(*e))?;
            if id == TRACKS {
                self.tracks = tracks(file, element.begin, self.at);
            }
            return Some(false);
        }
        None
    }

    /// Looks whose block an element of a cluster is.
    fn block(&mut self, file: &mut Bytes, e: &Element, end: u64, is_packet: bool) {
        let mut at = Some(e.begin).filter(|_| BLOCKS.contains(&e.id));
        if e.id == GROUP {
            let mut inner = e.begin;
            while at.is_none() && inner < end {
                let Some(child) = element(file, inner) else { break };
                at = Some(child.begin).filter(|_| BLOCKS.contains(&child.id));
                let Some(next) = child.end else { break };
                inner = next;
            }
        }
        let Some((number, _)) = at.and_then(|at| variable(file, at)) else { return };
        if is_packet {
            self.own.get_or_insert(number);
        } else if self.own == Some(number) || !self.tracks.contains(&number) {
            self.passed = true;
        }
    }

    /// Whether the walk stands at a block that ends past the file.
    fn is_cut_block(&self, file: &mut Bytes) -> bool {
        let length = file.length();
        let cut =
            |e: Element| (BLOCKS.contains(&e.id) || e.id == GROUP) && e.end.is_some_and(|end| end > length);
        self.cluster.is_some() && element(file, self.at).is_some_and(cut)
    }

    /// Stands at the block whose content begins at `to`, if its header is there.
    fn resume(&mut self, file: &mut Bytes, to: u64) {
        self.adrift = true;
        self.cluster = Some(None);
        for header in 2..=9 {
            let Some(at) = to.checked_sub(header) else { return };
            if let Some(e) = element(file, at)
                && BLOCKS.contains(&e.id)
                && e.begin == to
                && let Some(end) = e.end.filter(|end| *end <= file.length())
            {
                self.adrift = false;
                self.at = end;
                return;
            }
        }
    }
}

impl Walk for Matroska {
    fn reach(&mut self, file: &mut Bytes, to: u64) -> Fit {
        if !self.adrift {
            // Laced frames share a block: the walk has passed it already.
            if self.at > to {
                return Fit::Whole;
            }
            self.passed = false;
            while self.at <= to {
                match self.step(file, to) {
                    Some(true) => return if self.passed { Fit::Jump } else { Fit::Whole },
                    Some(false) => {}
                    None => break,
                }
            }
        }
        self.resume(file, to);
        Fit::Broken
    }

    fn rest(&mut self, file: &mut Bytes) -> Fit {
        while !self.adrift && self.at < file.length() {
            if self.step(file, u64::MAX).is_none() {
                self.ends_in_pictures = self.is_cut_block(file);
                return Fit::Broken;
            }
        }
        self.ends_in_pictures = self.cluster.flatten().is_some_and(|end| end > file.length());
        // A cluster or a segment that ends past the file is cut, even where its last block is whole.
        let ends = [self.cluster.flatten(), self.segment_end];
        let whole = !self.adrift && ends.iter().flatten().all(|end| *end <= file.length());
        if whole { Fit::Whole } else { Fit::Broken }
    }

    fn ends_in_pictures(&self) -> bool {
        self.ends_in_pictures
    }
}
