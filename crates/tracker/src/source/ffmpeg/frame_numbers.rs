//! Follows H.264's frame numbers: they go on by one after each picture from which others are predicted, so they tell whether
//! frames that are not there were in the coded film (ITU-T H.264, 7.4.3, `frame_num`).
//!
//! Owns: [`FrameNumbers`]. Must not: decode, or decide what a gap is.

use std::collections::BTreeMap;

use ffmpeg_next::ffi;

use super::units::Units;

/// Types of units: a part of a picture, of one that predicts from none before it, and the two sets of parameters.
const SLICE: u8 = 1;
const FRESH_SLICE: u8 = 5;
const SEQUENCE: u8 = 7;
const PICTURE: u8 = 8;
/// Profiles whose sets say more (7.3.2.1.1).
const HIGH_PROFILES: [u32; 13] = [100, 110, 122, 244, 44, 83, 86, 118, 128, 138, 139, 134, 135];
/// Bytes of a unit that are looked at: no set or slice header up to the frame number is longer, but for sets with
/// scaling matrices, which have a thousand at most.
const LOOKED_AT: usize = 1024;

/// The sequence parameters that are needed.
#[derive(Debug, Clone, Copy)]
struct Sequence {
    bits: u32,
    has_planes_apart: bool,
    may_jump: bool,
}

/// Follows the frame numbers of a stream's packets.
#[derive(Debug)]
pub(super) struct FrameNumbers {
    units: Units,
    sequences: BTreeMap<u32, Sequence>,
    /// The sequence set of each picture set.
    pictures: BTreeMap<u32, u32>,
    /// The number of the last picture from which others are predicted.
    last: Option<u32>,
}

impl FrameNumbers {
    /// For H.264 with its parameters as the container holds them; `None` for all else.
    pub(super) fn of(codec: ffi::AVCodecID, parameters: &[u8]) -> Option<Self> {
        if codec != ffi::AVCodecID::AV_CODEC_ID_H264 {
            return None;
        }
        let units = Units::of(codec, parameters)?;
        let mut numbers = Self { units, sequences: BTreeMap::new(), pictures: BTreeMap::new(), last: None };
        if units.have_lengths() {
            // ISO/IEC 14496-15, 5.3.3.1: after six bytes sequence sets, a number, and picture sets.
            let mut at = 5;
            for mask in [0x1F, 0xFF] {
                let count = *parameters.get(at)? & mask;
                at += 1;
                for _ in 0..count {
                    let size = usize::from(u16::from_be_bytes(*parameters.get(at..)?.first_chunk()?));
                    numbers.set(parameters.get(at + 2..at + 2 + size)?);
                    at += 2 + size;
                }
            }
        } else {
            units.split(parameters).into_iter().for_each(|unit| numbers.set(unit));
        }
        Some(numbers)
    }

    /// Whether a packet's picture follows that of the packet before it with no reference picture between them;
    /// `None` where nothing tells.
    pub(super) fn follows(&mut self, packet: &[u8]) -> Option<bool> {
        for unit in self.units.split(packet) {
            match unit.first()? & 0x1F {
                SEQUENCE | PICTURE => self.set(unit),
                FRESH_SLICE => {
                    self.last = Some(0);
                    return None;
                }
                SLICE => return self.slice(unit),
                _ => {}
            }
        }
        None
    }

    fn slice(&mut self, unit: &[u8]) -> Option<bool> {
        let before = self.last.take();
        let mut bits = Bits::new(unit);
        bits.unsigned()?;
        bits.unsigned()?;
        let sequence = *self.sequences.get(self.pictures.get(&bits.unsigned()?)?)?;
        if sequence.has_planes_apart {
            bits.number(2)?;
        }
        let number = bits.number(sequence.bits)?;
        let is_reference = unit.first()? & 0x60 != 0;
        self.last = if is_reference { Some(number) } else { before };
        let before = before.filter(|_| !sequence.may_jump)?;
        // A second field has the number of the first.
        let next = (before + 1) % (1 << sequence.bits);
        Some(number == next || number == before)
    }

    fn set(&mut self, unit: &[u8]) {
        match unit.first().map(|b| b & 0x1F) {
            Some(SEQUENCE) => self.sequences.extend(sequence(unit)),
            Some(PICTURE) => {
                let mut bits = Bits::new(unit);
                self.pictures.extend(bits.unsigned().zip(bits.unsigned()));
            }
            _ => {}
        }
    }
}

/// A set of sequence parameters and its number.
fn sequence(unit: &[u8]) -> Option<(u32, Sequence)> {
    let mut bits = Bits::new(unit);
    let profile = bits.number(8)?;
    bits.number(16)?;
    let id = bits.unsigned()?;
    let mut has_planes_apart = false;
    if HIGH_PROFILES.contains(&profile) {
        let format = bits.unsigned()?;
        if format == 3 {
            has_planes_apart = bits.number(1)? == 1;
        }
        bits.unsigned()?;
        bits.unsigned()?;
        bits.number(1)?;
        if bits.number(1)? == 1 {
            for list in 0..if format == 3 { 12 } else { 8 } {
                if bits.number(1)? == 1 {
                    bits.scaling_list(if list < 6 { 16 } else { 64 })?;
                }
            }
        }
    }
    let number_bits = bits.unsigned()? + 4;
    match bits.unsigned()? {
        0 => {
            bits.unsigned()?;
        }
        1 => {
            bits.number(1)?;
            bits.unsigned()?;
            bits.unsigned()?;
            for _ in 0..bits.unsigned()?.min(255) {
                bits.unsigned()?;
            }
        }
        _ => {}
    }
    bits.unsigned()?;
    let may_jump = bits.number(1)? == 1;
    (number_bits <= 16).then_some((id, Sequence { bits: number_bits, has_planes_apart, may_jump }))
}

/// The bits of a unit after its first byte, without the bytes that keep marks apart.
struct Bits {
    bytes: Vec<u8>,
    at: usize,
}

impl Bits {
    fn new(unit: &[u8]) -> Self {
        let mut bytes = Vec::new();
        let mut zeros = 0;
        for &byte in unit.iter().skip(1).take(LOOKED_AT) {
            if zeros >= 2 && byte == 3 {
                zeros = 0;
                continue;
            }
            zeros = if byte == 0 { zeros + 1 } else { 0 };
            bytes.push(byte);
        }
        Self { bytes, at: 0 }
    }

    fn bit(&mut self) -> Option<u32> {
        let byte = self.bytes.get(self.at / 8)?;
        let bit = byte >> (7 - self.at % 8) & 1;
        self.at += 1;
        Some(u32::from(bit))
    }

    fn number(&mut self, count: u32) -> Option<u32> {
        (0..count).try_fold(0, |sum, _| Some(sum << 1 | self.bit()?))
    }

    /// An Exp-Golomb number (9.1).
    fn unsigned(&mut self) -> Option<u32> {
        let mut zeros = 0;
        while self.bit()? == 0 {
            zeros += 1;
        }
        (zeros < 32).then_some(())?;
        Some((1 << zeros) - 1 + self.number(zeros)?)
    }

    /// Goes over a scaling list (7.3.2.1.1.1).
    fn scaling_list(&mut self, size: usize) -> Option<()> {
        let (mut last, mut next) = (8, 8);
        for _ in 0..size {
            if next != 0 {
                let coded = i64::from(self.unsigned()?);
                let change = if coded % 2 == 1 { (coded + 1) / 2 } else { -coded / 2 };
                next = (last + change).rem_euclid(256);
            }
            last = if next == 0 { last } else { next };
        }
        Some(())
    }
}
