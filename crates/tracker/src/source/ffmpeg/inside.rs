//! Checks the order inside packets whose pictures stand for themselves, where the codec has one: FFmpeg's decoders fill up what is
//! not there, and say nothing.
//!
//! Owns: [`Inside`]. Must not: decode.

use ffmpeg_next::ffi;

use crate::source::images::check_jpeg;

/// Follows the packets of a stream.
pub(super) struct Inside {
    check: fn(&[u8]) -> Result<(), String>,
    /// A packet was met that is as the standard says. Films of cameras that write otherwise are not doubted.
    was_right: bool,
}

impl Inside {
    /// `None` for a codec without an order that can be checked.
    pub(super) fn of(codec: ffi::AVCodecID) -> Option<Self> {
        let check = match codec {
            ffi::AVCodecID::AV_CODEC_ID_MJPEG => check_jpeg,
            ffi::AVCodecID::AV_CODEC_ID_JPEGLS => has_end,
            ffi::AVCodecID::AV_CODEC_ID_DVVIDEO => has_blocks,
            _ => return None,
        };
        Some(Self { check, was_right: false })
    }

    /// Damage inside a packet, a clause, where a packet before it was right.
    pub(super) fn problem(&mut self, packet: &[u8]) -> Option<String> {
        let problem = (self.check)(packet).err();
        self.was_right |= problem.is_none();
        problem.filter(|_| self.was_right)
    }
}

/// Whether a picture's marker of its end is there (ITU-T T.87: as in JPEG).
fn has_end(packet: &[u8]) -> Result<(), String> {
    let is_there = packet.windows(2).rev().any(|pair| pair == [0xff, 0xd9]);
    is_there.then_some(()).ok_or_else(|| "its end is not there".to_owned())
}

/// Bytes of a block of DV (IEC 61834-2), and blocks of a sequence: one of the header, two of the subcode, three of auxiliary data, and nine
/// times one of sound and fifteen of pictures.
const BLOCK: usize = 80;
const BLOCKS: usize = 150;
const FIRST_SOUND: usize = 6;
const SOUND_EVERY: usize = 16;

/// Whether each block says of itself what stands in its place: its kind in the upper three bits of its first byte, its number in
/// its third.
fn has_blocks(packet: &[u8]) -> Result<(), String> {
    let is_there = packet.len().is_multiple_of(BLOCK * BLOCKS)
        && packet.chunks_exact(BLOCK).enumerate().all(|(i, block)| {
            let i = i % BLOCKS;
            let (kind, number) = match i.checked_sub(FIRST_SOUND) {
                Some(i) if i.is_multiple_of(SOUND_EVERY) => (3, i / SOUND_EVERY),
                Some(i) => (4, i - i / SOUND_EVERY - 1),
                None if i == 0 => (0, 0),
                None if i < 3 => (1, i - 1),
                None => (2, i - 3),
            };
            usize::from(block[0] >> 5) == kind && usize::from(block[2]) == number
        });
    is_there.then_some(()).ok_or_else(|| "a block of its data is not where it should be".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sequence of DV's blocks, written down from the standard's table of their first bytes.
    fn sequence() -> Vec<u8> {
        let mut bytes = vec![0u8; BLOCK * BLOCKS];
        let mut block = |i: usize, kind: u8, number: usize| {
            bytes[BLOCK * i] = kind;
            bytes[BLOCK * i + 2] = number as u8;
        };
        block(0, 0x1f, 0);
        (0..2).for_each(|n| block(1 + n, 0x3f, n));
        (0..3).for_each(|n| block(3 + n, 0x56, n));
        for n in 0..9 {
            block(6 + 16 * n, 0x76, n);
            (0..15).for_each(|k| block(7 + 16 * n + k, 0x96, 15 * n + k));
        }
        bytes
    }

    #[test]
    fn every_block_of_dv_is_where_it_says_that_it_is() {
        let good = [sequence(), sequence()].concat();
        assert!(has_blocks(&good).is_ok() && has_blocks(&good[..good.len() - 80]).is_err());
        for at in (0..2 * BLOCKS).map(|i| BLOCK * i) {
            let mut bad = good.clone();
            bad[at..at + 3].fill(0xff);
            assert!(has_blocks(&bad).is_err(), "block {}", at / BLOCK);
        }
    }

    #[test]
    fn what_was_never_in_order_is_not_doubted() {
        let mut inside = Inside::of(ffi::AVCodecID::AV_CODEC_ID_JPEGLS).unwrap();
        let mut told = |packet: &[u8]| inside.problem(packet).is_some();
        assert!(!told(b"no end") && !told(b"end \xff\xd9 \0"));
        assert!(told(b"no end") && !told(b"\xff\xd9"));
        assert!(Inside::of(ffi::AVCodecID::AV_CODEC_ID_H264).is_none());
    }
}
